"""Meshes that trimesh reads, as triangles with the names of their parts, and repairs of them."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ...base import validation
from ...base.errors import warn
from .. import input_paths, other_files
from . import _archive, _checks, _collada_checks, _gltf_checks, _ply, _repair, _text

if TYPE_CHECKING:
    import trimesh

# Metres per unit; the inch and the foot are international (NIST SP 811, appendix B.6)
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
LARGE = 1e3  # m: longer than most models of single objects in metres, shorter than a car in millimetres


@dataclass(frozen=True, eq=False)
class Mesh:
    """triangles (k, 3, 3) in the file's units; part (k,): index into `names`; closed: the mesh has an outside.

    names holds, for each part, the words it can be called by: node, geometry, material.
    unit   m per unit of the file, where the file names its unit (.dae and .3mf do); else None
    """

    triangles: np.ndarray
    part: np.ndarray
    names: list[tuple[str, ...]]
    closed: bool
    unit: float | None = None


def load(mesh: object, repair: bool = True, external: bool = False) -> Mesh:
    """A mesh file, a trimesh.Trimesh or a trimesh.Scene, its parts in place.

    repair  drop repeated faces, give neighbours one winding, face closed bodies outwards, but for walls of cavities in
            them; the log gives the numbers
    external  the file may name others outside its folder
    A mesh is closed where every edge belongs to two faces of one winding. FileNotFoundError, IsADirectoryError,
    ValueError: missing, unreadable, no faces, corners not finite. TypeError: no mesh.
    """
    import trimesh

    what = "mesh"
    if isinstance(mesh, (str, Path)):
        what = f"mesh file {Path(mesh).name!r}"
        mesh = _read(Path(mesh), what, external)
    if isinstance(mesh, trimesh.Trimesh):
        single, mesh = mesh, trimesh.Scene()
        mesh.add_geometry(single, geom_name=single.metadata.get("name"))
    if not isinstance(mesh, trimesh.Scene):
        raise TypeError(f"{what} is a {type(mesh).__name__}; give a file name or a trimesh.Trimesh")
    vertices, faces, part, names = _parts(mesh, what)
    if len(faces) == 0:
        raise ValueError(f"{what} has no faces; nothing would reflect: check what the file holds")
    validation.finite(f"{what} vertices", vertices)
    kept, turned, closed = _repair.repaired(vertices, faces, repair, what)
    faces = np.where(turned[:, None], faces[:, ::-1], faces)[kept]
    return Mesh(vertices[faces], part[kept], names, closed, _unit(mesh, what))


def metres_per_unit(mesh: Mesh, scale: float | None, units: str | None) -> float:
    """Metres per unit of a mesh: as given by one of both arguments, else as its file names it, else 1.

    A warning gives the size of the scene where the file's unit is not the metre, and of one of more than LARGE metres
    without a unit. ValueError where both are given.
    """
    if units is not None:
        if scale is not None:
            raise ValueError(f"scale={scale!r} and units={units!r} both say how long a unit of the mesh is; give one")
        return UNITS[validation.choice("units", units, tuple(UNITS))]
    if scale is not None:
        return validation.number("scale", scale, above=0)
    size = float(np.ptp(mesh.triangles.reshape(-1, 3), axis=0).max())
    if mesh.unit is None:
        if size > LARGE:
            warn(
                f"this mesh names no unit and is taken in metres: its longest side is {size:.4g} m. Give units='mm' if "
                "it is in millimetres (or 'cm', 'in', 'ft'), or units='m' to confirm it"
            )
        return 1.0
    if mesh.unit != 1:
        warn(
            f"the unit of this mesh is {mesh.unit:g} m, as its file says: its longest side is taken as "
            f"{size * mesh.unit:.4g} m. Give scale={mesh.unit:g} to confirm it, or another scale, m per unit, where "
            "the file is wrong"
        )
    return mesh.unit


def _unit(scene: trimesh.Scene, what: str) -> float | None:
    """Metres per unit of a trimesh.Scene, None where it names no unit; ValueError where its parts have several."""
    from trimesh.units import unit_conversion

    units = {geometry.units for geometry in scene.geometry.values() if getattr(geometry, "units", None)}
    if not units:
        return None
    lengths = {float(f"{unit_conversion(unit, 'meters'):.12g}") for unit in units}
    if len(lengths) > 1:
        raise ValueError(f"{what} has parts in several units ({', '.join(sorted(units))}); export it in one unit")
    return lengths.pop()


def _read(path: Path, what: str, external: bool) -> trimesh.Scene:
    """The trimesh.Scene of a file, or of all meshes in an archive."""
    import trimesh

    input_paths.check(path, "mesh file")
    formats = sorted(trimesh.available_formats())
    kind = path.suffix.lower()
    if kind.lstrip(".") not in formats:
        raise ValueError(f"{what}: unknown format {path.suffix!r}; known are {', '.join(formats)}")
    if kind not in _archive.KINDS:
        resolver = other_files.Resolver(path, external)
        scene = _scene(input_paths.contents(path, "mesh file"), kind, path, what, resolver)
        _check_refused(resolver, what)
        return scene
    files = _archive.contents(path, what)
    names = _archive.meshes(path, files, trimesh.exchange.load.mesh_formats(), what)
    scenes = []
    for name in names:
        neighbours = {other: io.BytesIO(data) for other, data in _archive.beside(files, name).items()}
        archive = trimesh.resolvers.ZipResolver(neighbours)
        kind, label = Path(name).suffix.lower(), f"{what}, its file {name!r:.100}"
        scenes.append(_scene(files[name], kind, None, label, archive))
    return trimesh.scene.scene.append_scenes(scenes) if len(scenes) > 1 else scenes[0]


def _scene(
    data: bytes, kind: str, path: Path | None, what: str, others: trimesh.resolvers.Resolver | other_files.Resolver
) -> trimesh.Scene:
    """A trimesh.Scene of the bytes of a mesh file; ValueError for what would be left out or covered wrongly.

    path  gives the mesh its name, where it is a file;  others  gives trimesh the files that this one names
    """
    import trimesh

    if kind == ".ply":
        vertices, faces = _ply.read(data, what)
        scene = trimesh.Scene()
        scene.add_geometry(trimesh.Trimesh(vertices, faces, process=False), geom_name=path.name if path else None)
        return scene
    declared = _checks.declared_faces(data, kind, what)
    if kind == ".off":
        _text.check_off(data, what)
    elif kind == ".obj":
        data = _text.of_obj(data, what) or data
    elif kind in (".glb", ".gltf"):
        _gltf_checks.check(data, what)
    elif kind == ".dae" and zipfile.is_zipfile(io.BytesIO(data)):
        raise ValueError(f"{what} is a zip file, wanted XML: give it the name .zae")
    try:
        with _collada_checks.without_deprecations() if kind == ".dae" else nullcontext():
            collada = _collada_checks.open_document(data) if kind == ".dae" else None
            # process=False: merging and reordering corners is not needed and hides what the file holds
            scene = trimesh.load_scene(
                io.BytesIO(data),
                file_type=str(path.absolute()) if path else kind[1:],
                process=False,
                resolver=cast(trimesh.resolvers.Resolver, others),
            )
    except Exception as exc:
        if isinstance(others, other_files.Resolver):
            _check_refused(others, what)
        # trimesh treats a file that is not binary as text, and asks a package that sarcl does not need for its encoding
        guess = isinstance(exc, ModuleNotFoundError) and exc.name == "charset_normalizer"
        why = "neither a whole binary file nor text" if guess else str(exc) or type(exc).__name__
        raise ValueError(
            f"{what} cannot be read as {kind} ({why}): it is truncated, damaged or not what its name says; export it "
            "again"
        ) from exc
    if collada is not None:
        _collada_checks.check(collada, what)
    n_faces = sum(len(one.faces) for one in scene.geometry.values() if isinstance(one, trimesh.Trimesh))
    if declared is not None and n_faces < declared:  # polygons count as several
        raise ValueError(f"{what} declares {declared} faces and holds {n_faces}: {_checks.TAKE}")
    return scene


def _check_refused(others: other_files.Resolver, what: str) -> None:
    if others.refused:
        raise ValueError(
            f"{what} leads to another file: {others.refused[0]!r:.200}, outside its folder, {other_files.ALLOW}"
        )


def _parts(scene: trimesh.Scene, what: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[tuple[str, ...]]]:
    """Corners (n, 3), faces (k, 3), part of each face (k,), and the names of the parts."""
    import trimesh

    vertices, faces, part = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    names: list[tuple[str, ...]] = []
    offset = 0
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
            continue
        corners, triangles = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        _checks.check_indices(corners, triangles, what)
        if not np.array_equal(matrix, np.eye(4)):
            corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
            if np.linalg.det(matrix[:3, :3]) < 0:  # a mirror reverses windings
                triangles = triangles[:, ::-1]
        vertices.append(corners)
        faces.append(triangles + offset)
        part.append(np.full(len(triangles), len(names)))
        offset += len(corners)
        material = getattr(getattr(mesh.visual, "material", None), "name", None)
        names.append(tuple(dict.fromkeys(str(n) for n in (node, geometry, material) if n)))
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(part), names


def part_materials(material: object, mesh: Mesh) -> dict[str, Any]:
    """Arguments of Scene.facets: one material for all, or {part: material} with "*" for the rest.

    A part goes by its node's name before its geometry's before its material's. ValueError names the parts there
    are where a name is none of them, or a part has no material.
    """
    if not isinstance(material, Mapping):
        return {"material": material}
    part_names = {name for names in mesh.names for name in names}
    parts_text = "; ".join(" = ".join(map(repr, names)) for names in mesh.names)
    for name in material:
        if name not in part_names and name != "*":
            raise ValueError(f"material names a part {name!r} that the mesh does not have; its parts are {parts_text}")
    choice = [next((name for name in (*names, "*") if name in material), None) for names in mesh.names]
    for names, name_used in zip(mesh.names, choice, strict=True):
        if name_used is None:
            raise ValueError(
                f"material does not say what the part {names[0]!r} is made of; name it or give '*' for the rest: the "
                f"parts are {parts_text}"
            )
    words = list(dict.fromkeys(choice))
    place = np.array([words.index(c) for c in choice])
    return {"material": place[mesh.part], "materials": [material[w] for w in words if w is not None]}
