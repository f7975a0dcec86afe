"""Text of .obj and .off files: as trimesh reads it right, or refused where it would not.

trimesh counts negative indices from the end of the file, where the format counts them back from the line of the face;
it takes index 0 for 1, and covers every polygon by a fan about its first corner.
"""

from __future__ import annotations

import re

import numpy as np

from . import _checks

# what makes it necessary to look closer at the text of an .obj file
ODD = re.compile(
    r"^[ \t]*f[ \t].*[ \t/]-\d|^[ \t]*f[ \t](?:.*[ \t])?0+(?:[/ \t]|$)|^[ \t]*f(?:[ \t]+[^\s#]+){4}"
    r"|^[ \t]*(?:v|vt|vn|f)[ \t].*#",
    re.MULTILINE,
)


def of_obj(data: bytes, what: str) -> bytes | None:
    """The text of an .obj file for trimesh; None where that is the file as it is.

    ValueError names the line of a face whose indices, or corners, are none.
    """
    text = _decoded(data)
    if text is None or not ODD.search(text := text.replace("\\\n", " ")):
        return None
    lines = text.split("\n")
    counts = {"v": 0, "vt": 0, "vn": 0}
    vertices: list[list[str]] = []
    faces: list[tuple[int, list[list[int | None]]]] = []  # number of the line, and v/vt/vn of its corners
    for number, line in enumerate(lines):
        word, *rest = line.split("#")[0].split() or [""]
        if word in counts:
            counts[word] += 1
            lines[number] = line.partition("#")[0]
            if word == "v":
                vertices.append(rest[:3])
        elif word == "f":
            corners = [_corner(corner, counts, f"{what}, line {number + 1}") for corner in rest]
            faces.append((number, corners))
            words = ("/".join("" if i is None else str(i) for i in corner) for corner in corners)
            lines[number] = " ".join(["f", *words])
    points = _numbers(vertices)
    if points is not None:
        for number in _wrong_fans([[(corner[0] or 0) - 1 for corner in corners] for _, corners in faces], points):
            number, corners = faces[number]
            raise ValueError(f"{what}, line {number + 1}: a face of {len(corners)} corners {_checks.CONCAVE}")
    return "\n".join(lines).encode()


def _corner(word: str, counts: dict[str, int], where: str) -> list[int | None]:
    """Indices v/vt/vn of a corner, counted from 1; None where one is left out."""
    indices: list[int | None] = []
    for name, digits in zip(counts, word.split("/"), strict=False):
        if not digits:
            indices.append(None)
            continue
        try:
            index = int(digits)
        except ValueError:
            raise ValueError(f"{where}: {word!r:.40} is no corner; wanted v, v/vt, v//vn or v/vt/vn") from None
        absolute = counts[name] + 1 + index if index < 0 else index
        if absolute < 1:
            raise ValueError(
                f"{where}: index {index} of {name}, of which {counts[name]} come before this line; they are counted "
                "from 1, or back from -1: export it again"
            )
        indices.append(absolute)
    return indices


def check_off(data: bytes, what: str) -> None:
    """ValueError for vertices of another number of coordinates than three, and for concave polygons."""
    text = _decoded(data)
    if text is None:
        return
    text = re.sub(r"#[^\n]*", "", text)
    head = re.match(r"\s*((?:ST)?C?N?(4?n?)OFF)\b", text)
    if head is None:
        return
    if head[2]:
        raise ValueError(
            f"{what} is of the kind {head[1]}, whose vertices have not three coordinates; export it as OFF"
        )
    lines = [line for line in text[head.end() :].split("\n") if line.strip()]
    try:
        n, k = (int(word) for word in lines[0].split()[:2])
        polygons = [
            [int(word) for word in line.split()[1 : 1 + int(line.split()[0])]] for line in lines[n + 1 : n + k + 1]
        ]
    except (ValueError, IndexError):
        return  # which trimesh refuses
    points = _numbers([line.split()[:3] for line in lines[1 : n + 1]])
    if points is not None and (wrong := _wrong_fans(polygons, points)):
        raise ValueError(f"{what}: face {wrong[0]}, of {len(polygons[wrong[0]])} corners, {_checks.CONCAVE}")


def _wrong_fans(polygons: list[list[int]], points: np.ndarray) -> list[int]:
    """Numbers of the polygons that fans do not cover. Indices that no vertex can have are left to trimesh."""
    index = [max(-1, min(i, len(points))) for polygon in polygons for i in polygon]
    return _checks.wrong_fans(np.array([len(p) for p in polygons], np.int64), np.array(index, np.int64), points)


def _decoded(data: bytes) -> str | None:
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        return None


def _numbers(rows: list[list[str]]) -> np.ndarray | None:
    """Rows of three numbers, (n, 3); None where they are not."""
    try:
        numbers = np.array(rows, np.float64)
    except ValueError:
        return None
    return numbers if numbers.ndim == 2 and numbers.shape[1] == 3 else None
