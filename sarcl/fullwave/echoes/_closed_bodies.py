"""Refusals of scenes that are not closed bodies of facets: what a grid of cells cannot hold."""

from __future__ import annotations

from ...scene.scene import Scene


def check_bodies(scene: Scene) -> None:
    """ValueError where a scene has points, terrain, rough or partly reflecting facets, or dielectrics.

    Whether the bodies are closed is seen when they are cut by the lines of the grid (`_mesh_lines`).
    """
    said = "scene has {}, and fullwave_echo computes closed bodies of smooth facets: {}"
    if len(scene.positions):
        raise ValueError(said.format(
            f"{len(scene.positions)} points", "leave them out, or add the samples that echo computes for them"
        ))  # fmt: skip
    if scene.heights is not None:
        raise ValueError(said.format("terrain, which is open at its rim", "use echo for terrain"))
    if scene.roughness.any() or scene.point_roughness.any():
        n = int((scene.roughness > 0).sum() + scene.point_roughness.any(axis=(1, 2)).sum())
        raise ValueError(said.format(
            f"{n} facets with a random roughness",
            "give roughness=0, or scene.realized(seed), which moves the corners of the mesh",
        ))  # fmt: skip
    if (scene.reflectivity != 1).any():
        low = float(scene.reflectivity.min())
        raise ValueError(said.format(
            f"facets of reflectivity {low:g}, a factor of physical optics", "give a material of its permittivity and "
            "conductivity, such as sarcl.Material(eps_r=3, conductivity=0.01), or reflectivity 1",
        ))  # fmt: skip
    for material in scene.materials:
        name = repr(material.name) if material.name else "of a Material"
        if material.height or material.diagram not in ("smooth", "sinc"):
            raise ValueError(said.format(
                f"a material {name} with roughness finer than a facet", "give one with height 0 and diagram 'smooth'"
            ))  # fmt: skip
        if not material.conducting:
            raise ValueError(said.format(
                f"a material {name} of relative permittivity {material.eps_r:g}", 'give material="metal"'
            ))  # fmt: skip
