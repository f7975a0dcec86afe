"""Meshes that trimesh reads, as triangles with the names of their parts, and repairs of them."""

from __future__ import annotations

import io
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base import validation
from . import _gltf_checks, _mesh_checks, _mesh_text, _other_files, input_paths

log = logging.getLogger(__name__)

SAME_PLACE = 1e-8  # of the mesh's size: corners closer than this are one


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


def load(mesh: Any, repair: bool = True, external: bool = False) -> Mesh:
    """A mesh file, a trimesh.Trimesh or a trimesh.Scene, its parts in place.

    repair  drop repeated faces, give neighbours one winding, face closed bodies outwards; the log gives the numbers
    external  the file may name others outside its folder
    A mesh is closed where every edge belongs to two faces of one winding. FileNotFoundError, IsADirectoryError,
    ValueError: missing, unreadable, no faces, corners not finite. TypeError: no mesh.
    """
    import trimesh

    what, declared = "mesh", None
    if isinstance(mesh, (str, Path)):
        what = f"mesh file {Path(mesh).name!r}"
        mesh, declared = _read(Path(mesh), what, external)
    if isinstance(mesh, trimesh.Trimesh):
        alone, mesh = mesh, trimesh.Scene()
        mesh.add_geometry(alone, geom_name=alone.metadata.get("name"))
    if not isinstance(mesh, trimesh.Scene):
        raise TypeError(f"{what} is a {type(mesh).__name__}; give a file name or a trimesh.Trimesh")
    vertices, faces, part, names = _parts(mesh, what)
    _mesh_checks.check_held(declared, len(faces), what)
    if len(faces) == 0:
        raise ValueError(
            f"{what} has no faces; nothing would reflect: check what the file holds and how it was exported"
        )
    validation.finite(f"{what} vertices", vertices)
    kept, turned, closed = _repaired(vertices, faces, repair, what)
    faces = np.where(turned[:, None], faces[:, ::-1], faces)[kept]
    return Mesh(vertices[faces], part[kept], names, closed, _unit(mesh, what))


def _unit(scene: Any, what: str) -> float | None:
    """Metres per unit of a trimesh.Scene, None where it names no unit; ValueError where its parts have several."""
    from trimesh.units import unit_conversion

    named = {geometry.units for geometry in scene.geometry.values() if getattr(geometry, "units", None)}
    if not named:
        return None
    found = {float(f"{unit_conversion(unit, 'meters'):.12g}") for unit in named}
    if len(found) > 1:
        raise ValueError(f"{what} has parts in several units ({', '.join(sorted(named))}); export it in one unit")
    return found.pop()


def _read(path: Path, what: str, external: bool) -> tuple[Any, int | None]:
    """What trimesh makes of a file, and the number of faces that the file says it has."""
    import trimesh

    input_paths.check(path, "mesh file")
    known = sorted(trimesh.available_formats())
    if path.suffix.lower().lstrip(".") not in known:
        raise ValueError(f"{what}: unknown format {path.suffix!r}; known are {', '.join(known)}")
    declared = _mesh_checks.declared_faces(path, what)
    given = _changed(path, what)
    others = _other_files.Resolver(path, external)
    resolver: Any = others  # what trimesh asks of a resolver, without being one of its classes
    try:
        # process=False: merging and reordering corners is not needed and hides what the file holds
        made = trimesh.load_scene(given, file_type=path.suffix[1:].lower(), process=False, resolver=resolver)
    except Exception as exc:
        _check_refused(others, what)
        # trimesh treats a file that is not binary as text, and asks a package that sarcl does not need for its encoding
        guess = isinstance(exc, ModuleNotFoundError) and exc.name == "charset_normalizer"
        why = "neither a whole binary file nor text" if guess else str(exc) or type(exc).__name__
        raise ValueError(
            f"{what} cannot be read as {path.suffix} ({why}): it is truncated, damaged or not what its name "
            "says; export it again"
        ) from exc
    _check_refused(others, what)
    _mesh_checks.check_polygons(made, what)
    return made, declared


def _changed(path: Path, what: str) -> Path | io.BytesIO:
    """The file, or its text with faces as trimesh reads them right; ValueError for what trimesh would leave out."""
    kind = path.suffix.lower()
    if kind in (".glb", ".gltf"):
        _gltf_checks.check(input_paths.contents(path, "mesh file"), what)
    if kind == ".off":
        _mesh_text.check_off(input_paths.contents(path, "mesh file"), what)
    made = _mesh_text.of_obj(input_paths.contents(path, "mesh file"), what) if kind == ".obj" else None
    return path if made is None else io.BytesIO(made)


def _check_refused(others: _other_files.Resolver, what: str) -> None:
    if others.refused:
        raise ValueError(
            f"{what} leads to another file: {others.refused[0]!r:.200}, outside its folder, {_other_files.ALLOW}"
        )


def _parts(scene: Any, what: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[tuple[str, ...]]]:
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
        _mesh_checks.check_indices(corners, triangles, what)
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


def _repaired(vertices: np.ndarray, faces: np.ndarray, repair: bool, what: str) -> tuple[np.ndarray, np.ndarray, bool]:
    """(kept, turned, closed): faces to keep (k,), faces to reverse (k,), and whether there is an outside."""
    label = _weld(vertices)
    place = label[faces]  # corners by position: many formats store a corner once per face
    kept = (place != np.roll(place, 1, axis=1)).all(axis=1)
    if not kept.any():
        raise ValueError(f"all {len(faces)} facets are degenerate (zero area); nothing would reflect: check the {what}")
    turned = np.zeros(len(faces), bool)
    collapsed, repeated, closed = len(faces) - int(kept.sum()), 0, False
    # bodies that touch are closed before their corners are merged, and may not be closed afterwards
    for corners in (faces, place):
        if repair:
            turned = _wound(corners, kept, vertices[faces])
            # closed bodies may share a wall with two faces; elsewhere faces that differ in winding alone are one face
            alike = _closed(_turn(corners, turned)[kept])
            first = _first(_turn(place, turned), kept, alike)
            repeated += int(kept.sum() - first.sum())
            kept = first
            if not alike:  # repeated faces have hidden which faces are neighbours
                turned = _wound(corners, kept, vertices[faces])
        closed = _closed(_turn(corners, turned)[kept])
        if closed:
            break
    if not closed and repair and not _oriented(place, turned, kept):
        log.info("%s has faces that no winding could make agree with their neighbours", what)
    for n, why in (
        (collapsed, "left out: two of their corners are one"),
        (repeated, "left out: they repeat another"),
        (int(turned[kept].sum()), "turned round: wound against their neighbours, or inwards"),
    ):
        if n:
            log.info("%s: %d of %d faces %s", what, n, len(faces), why)
    return kept, turned, closed


def _weld(vertices: np.ndarray) -> np.ndarray:
    """For each corner (n,) a number that corners at the same position share."""
    size = float(np.ptp(vertices, axis=0).max()) or 1.0
    cell = np.rint((vertices - vertices.min(axis=0)) / (SAME_PLACE * size)).astype(np.int64)
    return np.unique(cell, axis=0, return_inverse=True)[1].reshape(-1)


def _turn(faces: np.ndarray, turned: np.ndarray) -> np.ndarray:
    return np.where(turned[:, None], faces[:, ::-1], faces)


def _first(faces: np.ndarray, kept: np.ndarray, alike: bool) -> np.ndarray:
    """`kept` without faces that repeat an earlier one: the same corners, and if `alike` the same winding."""
    start = faces.argmin(axis=1)[:, None]
    key = np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1) if alike else np.sort(faces, axis=1)
    rows = np.flatnonzero(kept)
    out = np.zeros(len(faces), bool)
    out[rows[np.unique(key[kept], axis=0, return_index=True)[1]]] = True
    return out


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(number of each edge, its direction, its face), each (3 k,): face by face."""
    ends = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    forward = ends[:, 0] < ends[:, 1]
    low, high = ends.min(axis=1), ends.max(axis=1)
    number = np.unique(low * (int(high.max(initial=0)) + 1) + high, return_inverse=True)[1].reshape(-1)
    return number, forward, np.repeat(np.arange(len(faces)), 3)


def _closed(faces: np.ndarray) -> bool:
    """True where every edge belongs to two faces that pass it in opposite directions."""
    number, forward, _ = _edges(faces)
    return bool(
        len(number) and (np.bincount(number) == 2).all() and (np.bincount(number, weights=forward * 2 - 1.0) == 0).all()
    )


def _oriented(faces: np.ndarray, turned: np.ndarray, kept: np.ndarray) -> bool:
    """True where no two faces that alone share an edge pass it in the same direction."""
    number, forward, _ = _edges(_turn(faces, turned)[kept])
    pair = np.bincount(number) == 2
    return bool((np.bincount(number, weights=forward * 2 - 1.0)[pair] == 0).all())


def _wound(faces: np.ndarray, kept: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Faces to reverse, of those kept, so that neighbours have one winding and closed bodies face outwards.

    Every face is two nodes of a graph, one for each winding; neighbours link the nodes that agree. The two halves of
    a body are then two components, of which the one that reverses fewer faces is taken. A body that is one component
    (a Moebius strip) has no sides and stays as it is. (trimesh.repair goes face by face and needs networkx.)
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows = np.flatnonzero(kept)
    k = len(rows)
    number, forward, face = _edges(faces[rows])
    uses = np.bincount(number)
    order = np.argsort(number, kind="stable")
    first = order[np.flatnonzero(np.diff(number[order], prepend=-1))][uses == 2]
    second = order[np.flatnonzero(np.diff(number[order], append=-1))][uses == 2]
    a, b, against = face[first], face[second], forward[first] == forward[second]
    ends = np.concatenate([a, a + k]), np.concatenate([np.where(against, b + k, b), np.where(against, b, b + k)])
    links = coo_array((np.ones(len(ends[0]), bool), ends), shape=(2 * k, 2 * k))
    n, component = connected_components(links, directed=False)
    plain, mirror = component[:k], component[k:]
    size = np.bincount(plain, minlength=n)  # faces that a component leaves as they are
    turn = (size[mirror] > size[plain]) | ((size[mirror] == size[plain]) & (mirror < plain))
    body = np.minimum(plain, mirror)
    volume = np.linalg.det(triangles[rows] - triangles[rows].reshape(-1, 3).mean(axis=0)) * np.where(turn, -1, 1)
    inwards = np.bincount(body, weights=volume, minlength=n) < 0
    inwards &= np.bincount(body[face], weights=uses[number] != 2, minlength=n) == 0
    out = np.zeros(len(faces), bool)
    out[rows] = (turn ^ inwards[body]) & (plain != mirror)
    return out


def part_materials(material: Any, mesh: Mesh) -> dict[str, Any]:
    """Arguments of Scene.facets: one material for all, or {part: material} with "*" for the rest.

    A part goes by its node's name before its geometry's before its material's. ValueError names the parts there
    are where a name is none of them, or a part has no material.
    """
    if not isinstance(material, Mapping):
        return {"material": material}
    known = {name for names in mesh.names for name in names}
    there = "; ".join(" = ".join(map(repr, names)) for names in mesh.names)
    for name in material:
        if name not in known and name != "*":
            raise ValueError(f"material names a part {name!r} that the mesh does not have; its parts are {there}")
    choice = [next((name for name in (*names, "*") if name in material), None) for names in mesh.names]
    for names, chosen in zip(mesh.names, choice, strict=True):
        if chosen is None:
            raise ValueError(
                f"material does not say what the part {names[0]!r} is made of; name it or give '*' for the rest: the "
                f"parts are {there}"
            )
    words = list(dict.fromkeys(choice))
    place = np.array([words.index(c) for c in choice])
    return {"material": place[mesh.part], "materials": [material[w] for w in words if w is not None]}
