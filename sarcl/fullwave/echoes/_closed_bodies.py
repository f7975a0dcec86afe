"""Refusals of scenes that are not closed bodies of facets: what a grid of cells cannot hold."""

from __future__ import annotations

import numpy as np

from ...scattering import added_models
from ...scene.material import VACUUM_PERMITTIVITY, Material
from ...scene.scene import Scene

LEAST_INSIDE = 6.0  # cells per wavelength in a body; the run that predicts the error of the grid then has 4


def check_bodies(scene: Scene) -> None:
    """ValueError where a scene has points, terrain, rough or partly reflecting facets.

    Whether the bodies are closed is seen when they are cut by the lines of the grid (`mesh_lines`).
    """
    said = "scene has {}, and fullwave_echo computes closed bodies of smooth facets: {}"
    if len(scene.positions):
        raise ValueError(
            said.format(
                f"{len(scene.positions)} points", "leave them out, or add the samples that echo computes for them"
            )
        )
    if scene.heights is not None:
        raise ValueError(said.format("terrain, which is open at its rim", "use echo for terrain"))
    if scene.roughness.any() or scene.point_roughness.any():
        n = int((scene.roughness > 0).sum() + scene.point_roughness.any(axis=(1, 2)).sum())
        raise ValueError(
            said.format(
                f"{n} facets with a random roughness",
                "give roughness=0, or scene.realized(seed), which moves the corners of the mesh",
            )
        )
    if (scene.reflectivity != 1).any():
        low = float(scene.reflectivity.min())
        raise ValueError(
            said.format(
                f"facets of reflectivity {low:g}, a factor of physical optics",
                "give a material of its permittivity and "
                "conductivity, such as sarcl.Material(eps_r=3, conductivity=0.01), or reflectivity 1",
            )
        )
    added_models.refuse(scene, "fullwave_echo", "use echo")
    for material in scene.materials:
        if material.height or material.diagram not in ("smooth", "sinc"):
            raise ValueError(
                said.format(
                    f"{_named(material)} with roughness finer than a facet",
                    "give one with height 0 and diagram 'smooth'",
                )
            )


def check_wavelengths(scene: Scene, cells: float, highest: float) -> None:
    """ValueError where a wavelength in a body has fewer cells than LEAST_INSIDE; cells  per wavelength in vacuum at the
    highest frequency, Hz.
    """
    for material in scene.materials:
        if material.conducting:
            continue
        permittivity = complex(material.permittivity(highest))
        shorter = float(np.abs(np.sqrt(permittivity)))
        if cells / shorter < LEAST_INSIDE:
            raise ValueError(
                f"cells is {cells:g}, which leaves {cells / shorter:.2g} cells per wavelength in {_named(material)} of "
                f"relative permittivity {permittivity if permittivity.imag else permittivity.real:.3g}; give "
                f'cells={np.ceil(10 * LEAST_INSIDE * shorter) / 10:g}, or material="metal" where waves do not pass '
                "through the body"
            )


def _named(material: Material) -> str:
    return f"a material {material.name!r}" if material.name else "a material"


def parts_of(scene: Scene, frequency: float, exact: float | None = None) -> list[tuple[np.ndarray, complex | None]]:
    """Facets of each material (k, 3, 3), and its permittivity, relative, at a frequency, Hz; None: a conductor.

    exact  frequency, Hz, at which the permittivity and conductivity that the grid has are those of the material, where
           these follow frequency or eps_r is complex; default: the same frequency
    """
    exact = frequency if exact is None else exact
    out: list[tuple[np.ndarray, complex | None]] = []
    for number, material in enumerate(scene.materials):
        triangles = scene.triangles[scene.material == number]
        if len(triangles):
            permittivity = None
            if not material.conducting:
                there = complex(material.permittivity(exact))
                permittivity = complex(there.real, there.imag * exact / frequency)
            out.append((triangles, permittivity))
    return out


def losses_said(scene: Scene, frequency: float) -> dict[str, object]:
    """For reports: what the grid has at every frequency of each material whose eps_r is complex or follows frequency:
    the permittivity and conductivity at the waveform's centre, Hz. Empty where there is none.
    """
    said = []
    for number, material in enumerate(scene.materials):
        follows = bool(np.imag(material.eps_r)) or any(material.exponents)
        if follows and not material.conducting and (scene.material == number).any():
            permittivity = complex(material.permittivity(frequency))
            conductivity = -permittivity.imag * 2 * np.pi * frequency * VACUUM_PERMITTIVITY
            what = (
                f"eps_r {material.eps_r:g}"
                if np.imag(material.eps_r)
                else f"{permittivity.real:.4g} of {_named(material)}"
            )
            said.append(f"{what} as {conductivity:.3g} S/m, exact at {frequency / 1e9:.4g} GHz")
    return {"losses": "; ".join(said)} if said else {}
