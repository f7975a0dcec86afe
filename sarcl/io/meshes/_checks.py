"""Faces that a mesh file declares and holds; and polygons, as fans of triangles where these cover them.

trimesh reads what it finds of a truncated text file, and covers every polygon by a fan about its first corner.
"""

from __future__ import annotations

import io
import re

import numpy as np

HEAD = 2**16  # bytes in which a header ends
FLAT = 1e-9  # area of a reversed triangle of a fan over its polygon's, below which it is a line
CONCAVE = "is concave or crosses itself, and its triangles are not in the file; export it as triangles"
TAKE = "it is truncated, damaged or not what its name says; export it again"


def declared_faces(data: bytes, kind: str, what: str) -> int | None:
    """Number of faces that a file of the ending `kind` says it has, None where its format does not say.

    ValueError for an STL file that is not as long as it says.
    """
    if kind == ".stl":
        return _of_stl(data, what)
    if kind == ".off":
        text = re.sub(rb"#[^\n]*", b"", data[:HEAD])
        match = re.match(rb"\s*(?:ST)?C?N?4?n?OFF\s+(\d+)\s+(\d+)", text)
        return int(match[2]) if match else None
    return None


def check_indices(vertices: np.ndarray, faces: np.ndarray, what: str) -> None:
    """ValueError where vertices are not (n, 3), or a face names a vertex that there is not."""
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(
            f"{what} has vertices of shape {vertices.shape} and faces of shape {faces.shape}, wanted (n, 3): {TAKE}"
        )
    wrong = (faces < 0) | (faces >= len(vertices))
    if wrong.any():
        face = int(np.flatnonzero(wrong.any(axis=1))[0])
        raise ValueError(f"{what}: face {face} names vertex {faces[face][wrong[face]][0]} of {len(vertices)}: {TAKE}")


def _of_stl(data: bytes, what: str) -> int | None:
    size, head = len(data), data[:HEAD]
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
    for line in io.BytesIO(data):
        word = line.strip().partition(b" ")[0].lower()
        if word in counts:
            counts[word] += 1
    if counts[b"vertex"] != 3 * counts[b"endfacet"] or not counts[b"endsolid"]:
        raise ValueError(
            f"{what} has {counts[b'endfacet']} whole facets, {counts[b'vertex']} vertices and {counts[b'endsolid']} "
            f"lines 'endsolid': {TAKE}"
        )
    return counts[b"endfacet"]


def fans(corners: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Triangles (k, 3) of polygons of `corners` (n,) corners each; index (sum,): vertices, polygon after polygon."""
    triangles = corners - 2
    first = np.repeat(np.cumsum(corners) - corners, triangles)
    within = np.arange(len(first)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.asarray(index[np.stack([first, first + within + 1, first + within + 2], axis=1)])


def fans_fit(corners: np.ndarray) -> np.ndarray:
    """Whether fans about the first corner cover polygons of k corners, (n, k, 3): bool (n,).

    Each triangle of a fan must turn as the polygon does, by Newell's normal: half the sum of p_i x p_(i+1).
    """
    from_first = corners[:, 1:] - corners[:, :1]
    crosses = np.cross(from_first[:, :-1], from_first[:, 1:])  # (n, k - 2, 3): twice the area of each triangle
    normal = crosses.sum(axis=1)
    along = np.einsum("nij,nj->ni", crosses, normal)
    return np.asarray((along >= -FLAT * (normal**2).sum(axis=1, keepdims=True)).all(axis=1))


def wrong_fans(corners: np.ndarray, index: np.ndarray, vertices: np.ndarray) -> list[int]:
    """Numbers of the polygons that a fan about their first corner leaves; corners, index  as of `fans`.

    Polygons that name vertices that there are not, of vertices (n, 3), or that are not finite, are left to others.
    """
    wrong_polygons: list[int] = []
    begin = np.cumsum(corners) - corners
    for length in np.unique(corners[corners > 3]):
        numbers = np.flatnonzero(corners == length)
        polygons = index[begin[numbers][:, None] + np.arange(length)]
        is_complete = np.asarray(((polygons >= 0) & (polygons < len(vertices))).all(axis=1))
        corners_at = vertices[np.where(is_complete[:, None], polygons, 0)]
        with np.errstate(all="ignore"):
            wrong = is_complete & np.isfinite(corners_at).all(axis=(1, 2)) & ~fans_fit(corners_at)
        wrong_polygons += numbers[wrong].tolist()
    return sorted(wrong_polygons)
