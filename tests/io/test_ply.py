"""PLY files: lists of any lengths in text and binary, and numbers that do not fit what the header declares."""

import struct

import numpy as np
import pytest

import sarcl
from sarcl.io.meshes import mesh

# a unit cube of two triangles and five squares; its first face is a square, and so is the mean of all of them
POINTS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
FACES = [(0, 1, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
ORDER = {"binary_little_endian": "<", "binary_big_endian": ">"}


def header(kind, vertices, faces, count="uchar", index="int", more="", name="vertex_indices"):
    return (
        f"ply\nformat {kind} 1.0\ncomment made by a test\nelement vertex {vertices}\nproperty float x\n"
        f"property double y\nproperty float z\nelement face {faces}\nproperty list {count} {index} {name}\n{more}"
        "end_header\n"
    ).encode()


def text_of(points=POINTS, faces=FACES, end="", **how):
    rows = [" ".join(map(str, p)) for p in points] + [" ".join(map(str, (len(f), *f))) + end for f in faces]
    return header("ascii", len(points), len(faces), **how) + "\n".join(rows).encode()


def binary_of(kind, points=POINTS, faces=FACES, end=b"", **how):
    order = ORDER[kind]
    body = b"".join(struct.pack(f"{order}fdf", *p) for p in points)
    body += b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) + end for f in faces)
    return header(kind, len(points), len(faces), **how) + body


def written(path, data):
    path.write_bytes(data)
    return path


def refused(path, data, words):
    with pytest.raises(ValueError, match=rf"mesh file '{path.name}'.*{words}"):
        sarcl.Scene.from_mesh(written(path, data))


def test_triangles_and_squares_in_one_file_are_read_alike_from_text_and_binary(tmp_path):
    text = sarcl.Scene.from_mesh(written(tmp_path / "text.ply", text_of()))
    assert len(text.triangles) == 12 and not text.two_sided.any()
    assert np.linalg.det(text.triangles).sum() / 6 == pytest.approx(1)
    for kind in ORDER:
        for more, end in (("", b""), ("property uchar flags\nproperty list uchar float uv\n", b"\x01\x02" + bytes(8))):
            path = written(tmp_path / "binary.ply", binary_of(kind, more=more, end=end))
            np.testing.assert_array_equal(sarcl.Scene.from_mesh(path).triangles, text.triangles)


def test_comments_may_hold_any_characters(tmp_path):
    """The second byte of "Å" in UTF-8 alone is a new line in Latin-1."""
    want = sarcl.Scene.from_mesh(written(tmp_path / "plain.ply", text_of())).triangles
    for comment in ("von Åke", "a\x0cb\x1cc", "before the end_header", "end_header"):
        for data in (text_of(), binary_of("binary_big_endian")):
            for line in (f"comment {comment}\n", f"obj_info {comment}\n"):
                path = written(tmp_path / "a.ply", data.replace(b"comment made by a test\n", line.encode()))
                np.testing.assert_array_equal(sarcl.Scene.from_mesh(path).triangles, want)


def test_a_long_word_takes_no_memory_for_the_others(tmp_path):
    """An array of all words as wide as the longest would take 0.1 TB."""
    points = np.random.default_rng(0).normal(size=(5000, 3)).round(3).tolist()
    path = written(tmp_path / "a.ply", text_of([*points[:-1], (1, 2, "3." + "0" * 300)], [(0, 1, 2)] * 20000))
    assert len(mesh.load(path, repair=False).triangles) == 20000
    data = text_of([*points[:-1], (1, 2, "0" * 10**6)], [(0, 1, 2)] * 20000)
    refused(tmp_path / "b.ply", data, "a word that is no number")


def test_lists_whose_lengths_change_without_changing_the_size_of_the_file_are_not_misread(tmp_path):
    """4 + 3 + 5 corners take the bytes of three squares."""
    points = [(np.cos(a), np.sin(a), 0) for a in 2 * np.pi * np.arange(5) / 5]
    faces = [(0, 1, 2, 3), (0, 1, 2), (0, 1, 2, 3, 4)]
    path = written(tmp_path / "a.ply", binary_of("binary_little_endian", points, faces))
    made = sarcl.Scene.from_mesh(path, repair=False)
    want = np.array(points, np.float32)[[(0, 1, 2), (0, 2, 3), (0, 1, 2), (0, 1, 2), (0, 2, 3), (0, 3, 4)]]
    np.testing.assert_allclose(made.triangles, want, atol=1e-7)


def test_polygons_of_binary_files_are_checked_like_those_of_text(tmp_path):
    points = [(0, 2, 0), (0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0)]
    faces = [(0, 1, 2), (0, 1, 2, 3, 4, 5)]
    for data in (text_of(points, faces), *(binary_of(kind, points, faces) for kind in ORDER)):
        refused(tmp_path / "a.ply", data, "face 1, of 6 corners, is concave or crosses itself.*export it as triangles")


@pytest.mark.parametrize(
    "how, faces, words",
    [
        ({"index": "int"}, [(0, 1, 2.5)], r"face 0 names vertex 2\.5 of 400"),
        ({"index": "float"}, [(0, 1, 2.5)], r"face 0 names vertex 2\.5 of 400"),
        ({"index": "int"}, [(0, 1, 400)], "face 0 names vertex 400 of 400"),
        ({"index": "int"}, [(0, 1, -1)], "face 0 names vertex -1 of 400"),
        ({"index": "int"}, [(0, 1, "nan")], "face 0 names vertex nan of 400"),
        ({"index": "int"}, [(0, 1, "x")], "words that are no numbers"),
        ({"index": "int"}, [(0, 1)], "face 0 has 2 corners, wanted at least 3"),
        ({"index": "int"}, [()], "face 0 has 0 corners"),
    ],
)
def test_indices_that_do_not_fit_are_refused(tmp_path, how, faces, words):
    points = np.random.default_rng(0).normal(size=(400, 3)).tolist()
    refused(tmp_path / "a.ply", text_of(points, faces, **how), words)


@pytest.mark.parametrize("kind", ["uchar", "char"])
def test_indices_of_text_are_what_is_written(tmp_path, kind):
    """400 vertices: 300 that wraps around its declared type to 44 would be one of them too."""
    points = np.random.default_rng(0).normal(size=(400, 3)).round(3).tolist()
    path = written(tmp_path / "a.ply", text_of(points, [(0, 1, 300)], index=kind))
    np.testing.assert_allclose(mesh.load(path, repair=False).triangles[0, 2], points[300], atol=1e-6)


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda t: t.replace(b"\n4 0 1 3 2", b"\n4 0 1 3"), "declares 7 faces and holds"),
        (lambda t: t.replace(b"\n4 0 1 3 2", b"\n260 0 1 3 2"), "face 0 has 260 vertex_indices, wanted .* 0 to 255"),
        (lambda t: t.replace(b"\n4 0 1 3 2", b"\n-4 0 1 3 2"), "face 0 has -4 vertex_indices"),
        (lambda t: t.replace(b"\n4 0 1 3 2", b"\n4.5 0 1 3 2"), "face 0 has 4.5 vertex_indices"),
        (lambda t: t.replace(b"\n4 0 1 3 2", b"\nnan 0 1 3 2"), "face 0 has nan vertex_indices"),
        (lambda t: t + b" 7", "holds 1 numbers more than it declares"),
        (lambda t: t.replace(b"element face 7", b"element face 6"), "holds 5 numbers more than it declares"),
        (lambda t: t.replace(b"element face 7", b"element face 8"), "declares 8 faces and holds 7"),
        (lambda t: t.replace(b"element face 7", b"element face 999999999999"), "declares 999999999999 faces and holds"),
        (lambda t: t.replace(b"element face 7", b"element face " + b"9" * 9000), "no line of the header"),
        (
            lambda t: t.replace(b"element vertex 8", b"element vertex -8"),
            "'element vertex -8' is no line of the header",
        ),
        (lambda t: t.replace(b"list uchar int", b"list uchar integer"), "is no line of the header"),
        (lambda t: t.replace(b"property float x", b"property float u"), "vertices of u, y, z, wanted x, y and z"),
        (lambda t: text_of(name="a", more="property list uchar int b\n", end=" 0"), "without a list vertex_index"),
        (lambda t: t.replace(b"end_header", b"end"), "no header from 'ply' to 'end_header'"),
        (lambda t: t.replace(b"format ascii 1.0\n", b""), "no line 'format'"),
        (lambda t: t.replace(b"element face", b"element tristrips"), "has strips of triangles"),
        (
            lambda t: t.replace(b"end_header", b"element face 1\nproperty uchar a\nend_header") + b" 7",
            "declares two elements with the name 'face'",
        ),
        (
            lambda t: t.replace(b"property float z", b"property float z\nproperty float x"),
            "declares two properties of 'vertex' with the name 'x'",
        ),
        (lambda t: t.replace(b"\n4 0 1 3 2", b"\n4 0 1 3 0_2"), "a word that is no number: '0_2'"),
        (lambda t: t.replace(b"\n4 0 1 3 2", b"\n4 0 1 3 " + b"0" * 500 + b"2"), "a word that is no number: '000"),
    ],
)
def test_what_a_text_file_does_not_hold_is_refused(tmp_path, change, words):
    refused(tmp_path / "a.ply", change(text_of()), words)


def test_binary_files_that_are_too_short_or_too_long_are_refused(tmp_path):
    data = binary_of("binary_little_endian")
    refused(tmp_path / "a.ply", data[:-3], "declares 7 faces and holds 6")
    refused(tmp_path / "a.ply", data + b"\0\0", "holds 2 bytes more than it declares")
    refused(tmp_path / "a.ply", data[: data.index(b"end_header") + 40], "declares 8 vertices and holds 1")


def test_a_mesh_has_the_name_of_its_file(tmp_path):
    assert mesh.load(written(tmp_path / "a.ply", text_of())).names == [("a.ply",)]
    refused(tmp_path / "b.ply", text_of([], []), "has no faces")
