"""What a mesh file declares, compared with what it holds: before trimesh reads it, and after.

trimesh reads what it finds of a truncated text file, and unpacks archives of any size.
"""

from __future__ import annotations

import bz2
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..base.text import size_text
from . import _polygons

HEAD = 2**16  # bytes in which a header ends
UNPACKED = 2**26  # bytes that an archive may always hold
RATIO = 100  # bytes per byte of an archive above that; text of meshes is packed to a tenth, at most a thirtieth
PIECE = 2**20  # bytes unpacked at a time
TAKE = "it is truncated, damaged or not what its name says; export it again"


def declared_faces(path: Path, what: str) -> int | None:
    """Number of faces that a file says it has, None where its format does not say.

    ValueError for an archive that unpacks to more than a mesh would, and an STL file that is not as long as it says.
    """
    kind = path.suffix.lower()
    if kind in (".zip", ".zae"):
        _check_zip(path, what)
    elif kind == ".bz2":
        _check_bz2(path, what)
    with open(path, "rb") as file:
        head = file.read(HEAD)
    if kind == ".stl":
        return _of_stl(path, head, what)
    if kind == ".off":
        text = re.sub(rb"#[^\n]*", b"", head)
        found = re.match(rb"\s*(?:ST)?C?N?4?n?OFF\s+(\d+)\s+(\d+)", text)
    elif kind == ".ply":
        found = re.search(rb"\nelement\s+(face)\s+(\d+)", head.partition(b"end_header")[0])
    else:
        return None
    return int(found[2]) if found else None


def check_held(declared: int | None, held: int, what: str) -> None:
    """ValueError where a file holds fewer faces than it declares; polygons count as several."""
    if declared is not None and held < declared:
        raise ValueError(f"{what} declares {declared} faces and holds {held}: {TAKE}")


def check_indices(vertices: np.ndarray, faces: np.ndarray, what: str) -> None:
    """ValueError where vertices are not (n, 3), or a face names a vertex that there is not."""
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(
            f"{what} has vertices of shape {vertices.shape} and faces of shape {faces.shape}, wanted (n, 3): {TAKE}"
        )
    wrong = (faces < 0) | (faces >= len(vertices))
    if wrong.any():
        at = int(np.flatnonzero(wrong.any(axis=1))[0])
        raise ValueError(f"{what}: face {at} names vertex {faces[at][wrong[at]][0]} of {len(vertices)}: {TAKE}")


def check_polygons(scene: Any, what: str) -> None:
    """ValueError where a .ply file has polygons that the fans of trimesh about their first corners do not cover."""
    for mesh in scene.geometry.values():
        raw = mesh.metadata.get("_ply_raw", {}).get("face", {}).get("data")
        if not isinstance(raw, dict):  # a table: all faces have one number of corners
            names = getattr(getattr(raw, "dtype", None), "names", None)
            if names is None:
                continue
            raw = {name: raw[name]["f1"] for name in names if raw[name].dtype.names}
        faces = next((raw[name] for name in ("vertex_index", "vertex_indices") if name in raw), None)
        if faces is None:
            continue
        wrong = _polygons.wrong_fans([np.ravel(face).tolist() for face in faces], np.asarray(mesh.vertices))
        if wrong:
            raise ValueError(f"{what}: face {wrong[0]}, of {len(faces[wrong[0]])} corners, {_polygons.CONCAVE}")


def _of_stl(path: Path, head: bytes, what: str) -> int | None:
    size = path.stat().st_size
    if not size:
        return None
    n = int.from_bytes(head[80:84], "little")
    if len(head) >= 84 and size == 84 + 50 * n:
        return n
    if not head.lstrip()[:5].lower() == b"solid" or b"facet" not in head.lower():
        if not 0 <= size - 84 - 50 * n < 50:
            raise ValueError(f"{what} declares {n} facets, {84 + 50 * n} bytes, and has {size} bytes: {TAKE}")
        return n
    counts = {b"endfacet": 0, b"endsolid": 0, b"vertex": 0}
    with open(path, "rb") as file:
        for line in file:
            word = line.strip().partition(b" ")[0].lower()
            if word in counts:
                counts[word] += 1
    if counts[b"vertex"] != 3 * counts[b"endfacet"] or not counts[b"endsolid"]:
        raise ValueError(
            f"{what} has {counts[b'endfacet']} whole facets, {counts[b'vertex']} vertices and {counts[b'endsolid']} "
            f"lines 'endsolid': {TAKE}"
        )
    return counts[b"endfacet"]


def _most(path: Path) -> int:
    return max(UNPACKED, RATIO * path.stat().st_size)


def _check_zip(path: Path, what: str) -> None:
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
    except (zipfile.BadZipFile, NotImplementedError) as exc:
        raise ValueError(f"{what} cannot be read as a zip file ({exc}): {TAKE}") from None
    if size > _most(path):
        raise _too_much(path, what, size_text(size))


def _check_bz2(path: Path, what: str) -> None:
    size, most = 0, _most(path)
    try:
        with bz2.open(path, "rb") as file:
            while piece := file.read(PIECE):
                size += len(piece)
                if size > most:
                    raise _too_much(path, what, f"more than {size_text(most)}")
    except (OSError, EOFError) as exc:
        raise ValueError(f"{what} cannot be unpacked ({exc}): {TAKE}") from None


def _too_much(path: Path, what: str, size: str) -> ValueError:
    return ValueError(
        f"{what} has {size_text(path.stat().st_size)} and unpacks to {size}, more than {RATIO} times as much: unpack "
        "it yourself if you trust it, and give the mesh in it"
    )
