"""Legal but odd content of mesh files: surfaces are where the format says, or the file is refused in words."""

import json
import re
import struct

import numpy as np
import pytest

import sarcl

CORNERS = [(0, 2), (0, 0), (2, 0), (2, 1), (1, 1), (1, 2)]  # an L, whose fan about the first corner covers 4 m^2 of 3


def area(scene):
    a, b = (scene.triangles[:, i] - scene.triangles[:, 0] for i in (1, 2))
    return np.linalg.norm(np.cross(a, b), axis=1).sum() / 2


def written(path, text):
    path.write_text(text)
    return path


def test_concave_polygons_are_refused_and_convex_ones_are_covered(tmp_path):
    points = "".join(f"{x} {y} 0\n" for x, y in CORNERS)
    obj = "".join(f"v {row}\n" for row in points.splitlines())
    ply = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
    ply += f"element face 1\nproperty list uchar int vertex_index\nend_header\n{points}"
    why = "is concave or crosses itself, and its triangles are not in the file; export it as triangles"
    for name, text, where in (
        ("a.obj", obj + "f 1 2 3\nf 1 2 3 4 5 6\n", "'a.obj', line 8: a face of 6 corners"),
        ("b.obj", obj + "f 6/1 1/1 2/1 3/1 4/1 5/1\nvt 0 0\n", "'b.obj', line 7: a face of 6 corners"),
        ("c.obj", "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 1 0\nf 1 2 3 4\n", "'c.obj', line 5: a face of 4 corners"),
        ("a.off", f"OFF\n6 1 0\n{points}6 0 1 2 3 4 5\n", "'a.off': face 0, of 6 corners,"),
        ("a.ply", ply + "6 0 1 2 3 4 5\n", "'a.ply': face 0, of 6 corners,"),
    ):
        with pytest.raises(ValueError, match=re.escape(f"{where} {why}")):
            sarcl.Scene.from_mesh(written(tmp_path / name, text))
    for name, text in (
        ("d.obj", obj + "f 2 3 4 5\n"),
        ("e.obj", obj + "f -3 -4 -5 -2\n"),
        ("d.off", f"OFF\n6 1 0\n{points}4 1 2 3 4\n"),
        ("d.ply", ply + "4 1 2 3 4\n"),
    ):
        assert area(sarcl.Scene.from_mesh(written(tmp_path / name, text), repair=False)) == pytest.approx(1.5), name


def polygon(path, corners):
    """A mesh file of one polygon, m (k, 3)."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
    return written(path, "\n".join([*lines, "f " + " ".join(str(i + 1) for i in range(len(corners)))]))


def test_fans_cover_what_turns_one_way_about_their_first_corner(tmp_path):
    """Convex polygons from any corner, turned and far away; of concave ones a fan from the corner that sees all."""
    random = np.random.default_rng(1)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    for n in (4, 5, 8, 60):
        angle = 2 * np.pi * (np.arange(n) + random.uniform(0, 0.9, n)) / n
        circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        wanted = np.sin(np.diff(angle, append=angle[0] + 2 * np.pi)).sum() / 2
        for i in range(0, n, -(-n // 4)):
            scene = sarcl.Scene.from_mesh(polygon(tmp_path / "a.obj", np.roll(circle, i, axis=0) @ turn + 100))
            assert len(scene.triangles) == n - 2 and area(scene) == pytest.approx(wanted, rel=1e-9)
    dart = np.array([[0, 0, 0], [2, -1, 0], [1, 0, 0], [2, 1, 0]], float) @ turn + 100
    for i in (0, 2):
        assert area(sarcl.Scene.from_mesh(polygon(tmp_path / "a.obj", np.roll(dart, -i, axis=0)))) == pytest.approx(1)
    for i in (1, 3):
        with pytest.raises(ValueError, match="is concave"):
            sarcl.Scene.from_mesh(polygon(tmp_path / "a.obj", np.roll(dart, -i, axis=0)))


def test_indices_of_obj_files_count_from_1_or_back_from_their_line(tmp_path):
    text = "v 0 0 0 # m\nv 1 0 0\nv 1 1 0\nf -3 -2 -1 # here\nv 5 0 0\nv 6 0 0\nv 6 1 0\nf -3 -2 -1\n"
    scene = sarcl.Scene.from_mesh(written(tmp_path / "a.obj", text))
    assert scene.bounds.tolist() == [[0, 0, 0], [6, 1, 0]] and scene.two_sided.all()
    for wrong, why in (("0 1 2", "index 0 of v, of which 3 come"), ("-4 1 2", "index -4 of v"), ("1 2 x", "'x' is no")):
        text = f"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3 1\nf {wrong}\n"
        with pytest.raises(ValueError, match=rf"'a\.obj', line 5: {why}"):
            sarcl.Scene.from_mesh(written(tmp_path / "a.obj", text))


def test_off_files_of_other_dimensions_are_refused(tmp_path):
    text = "4OFF\n3 1 0\n0 0 0 2\n2 0 0 2\n2 2 0 2\n3 0 1 2\n"
    with pytest.raises(ValueError, match=r"'a\.off' is of the kind 4OFF, whose vertices have not three coordinates"):
        sarcl.Scene.from_mesh(written(tmp_path / "a.off", text))


def glb(path, *, primitive=None, accessor=None, **top):
    """A triangle, with other fields of its primitive, of its positions and of the file."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]], np.float32).tobytes()
    made = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "buffers": [{"byteLength": len(points)}], "bufferViews": [{"buffer": 0, "byteLength": len(points)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", **(accessor or {})}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, **(primitive or {})}]}], **top,
    }  # fmt: skip
    text = json.dumps(made).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(points))
    path.write_bytes(
        head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(points), b"BIN\0") + points
    )
    return path


@pytest.mark.parametrize(
    "fields, words",
    [
        ({"primitive": {"mode": 6}}, "fans of triangles"),
        ({"accessor": {"sparse": {"count": 1}}}, "sparse accessors"),
        ({"accessor": {"componentType": 5122, "normalized": True}}, "normalized whole numbers"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "needs the extension 'KHR_draco_mesh_compression'"),
        ({"extensionsRequired": ["EXT_of_tomorrow"]}, "needs the extension 'EXT_of_tomorrow'"),
        ({"nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {}}}]}, "nodes with the extension"),
        ({"primitive": {"extensions": {"EXT_meshopt_compression": {}}}}, "meshes with the extension"),
        ({"nodes": [{"mesh": 0, "weights": [0, 0.5]}]}, "morph targets with weights"),
    ],
)
def test_surfaces_that_gltf_files_have_beyond_what_is_read_are_refused(tmp_path, fields, words):
    with pytest.raises(ValueError, match=rf"'a\.glb' .*{words}.*export it"):
        sarcl.Scene.from_mesh(glb(tmp_path / "a.glb", **fields))


def test_what_does_not_move_surfaces_of_gltf_files_is_read(tmp_path):
    scene = sarcl.Scene.from_mesh(
        glb(
            tmp_path / "a.glb", extensionsRequired=["KHR_materials_unlit", "KHR_texture_transform"],
            nodes=[{"mesh": 0, "weights": [0.0], "translation": [5, 0, 0]}],
        )
    )  # fmt: skip
    assert area(scene) == pytest.approx(0.5) and scene.bounds[0].tolist() == [5, 0, 0]
