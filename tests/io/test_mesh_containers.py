"""COLLADA files, and archives: what a reader would leave out of them or cover wrongly is refused, with its name."""

import bz2
import re
import warnings
import zipfile

import collada
import numpy as np
import pytest
import trimesh

import sarcl
from sarcl.io.meshes import mesh

CONCAVE = "is concave or crosses itself, and its triangles are not in the file; export it as triangles"
CORNERS = [(0, 2), (0, 0), (2, 0), (2, 1), (1, 1), (1, 2)]  # an L
L_OBJ = "".join(f"v {x} {y} 0\n" for x, y in CORNERS) + "f 1 2 3 4 5 6\n"
BOX = trimesh.creation.box((1, 2, 3))
NODE = '<node id="n"><instance_geometry url="#g"/></node>'


def dae(path, faces, node=NODE, library=""):
    points = " ".join(f"{x} {y} 0" for x, y in CORNERS)
    path.write_text(
        f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="18">{points}</float_array><technique_common>
<accessor source="#a" count="6" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{faces}</mesh></geometry></library_geometries>{library}
<library_visual_scenes><visual_scene id="s">{node}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
    )
    return path


def polylist(lengths, corners):
    return (
        f'<polylist count="{len(lengths.split())}"><input semantic="VERTEX" source="#v" offset="0"/>'
        f"<vcount>{lengths}</vcount><p>{corners}</p></polylist>"
    )


def polygons(*corners):
    given = "".join(f"<p>{p}</p>" for p in corners)
    return f'<polygons count="{len(corners)}"><input semantic="VERTEX" source="#v" offset="0"/>{given}</polygons>'


def area(scene):
    a, b = (scene.triangles[:, i] - scene.triangles[:, 0] for i in (1, 2))
    return np.linalg.norm(np.cross(a, b), axis=1).sum() / 2


@pytest.mark.parametrize("faces", [polylist("3 6", "0 1 2 0 1 2 3 4 5"), polygons("0 1 2", "0 1 2 3 4 5")])
def test_concave_polygons_of_collada_files_are_refused(tmp_path, faces):
    with pytest.raises(ValueError, match=re.escape(f"'a.dae', geometry 'g': face 1, of 6 corners, {CONCAVE}")):
        sarcl.Scene.from_mesh(dae(tmp_path / "a.dae", faces))


@pytest.mark.parametrize("faces", [polylist("4 3", "1 2 3 4 0 1 5"), polygons("1 2 3 4", "0 1 5")])
def test_convex_polygons_of_collada_files_are_covered(tmp_path, faces):
    assert area(sarcl.Scene.from_mesh(dae(tmp_path / "a.dae", faces))) == pytest.approx(1.5 + 1.0)


@pytest.mark.parametrize(
    "faces, how, words",
    [
        (polylist("3 2", "0 1 2 3 4"), {}, "geometry 'g': face 1 has 2 corners, wanted at least 3"),
        (polylist("3", "0 1 2 3 4"), {}, "geometry 'g': its faces have 3 corners, and it holds 5"),
        (polylist("3", "0 1 -1"), {}, "geometry 'g': a face names vertex -1 of 6"),
        ("<polygons count='1'><input semantic='VERTEX' source='#v' offset='0'/><ph><p>0 1 2</p><h>3 4 5</h></ph>"
         "</polygons>", {}, "has polygons with holes, which are not read here; export it as triangles"),
        (polylist("3", "0 1 2"), {"node": NODE + '<node><instance_geometry url="#other"/></node>'},
         "1 of 2 placed geometries cannot be read .*other"),
        (polylist("3", "0 1 2"), {"node": '<node><instance_geometry url="#g"><bind_material><technique_common>'
         '<instance_material target="#none"/></technique_common></bind_material></instance_geometry></node>'},
         "1 of 1 placed geometries cannot be read .*none"),
        (polylist("3", "0 1 9"), {"node": NODE}, "1 of 1 geometries cannot be read"),
        (polylist("3", "0 1 2"), {"node": '<node><instance_controller url="#c"/></node>' + NODE}, "has skins or"),
    ],
)  # fmt: skip
def test_surfaces_of_collada_files_that_would_be_missing_or_elsewhere_are_refused(tmp_path, faces, how, words):
    with pytest.raises(ValueError, match=f"'a\\.dae'.*{words}"):
        sarcl.Scene.from_mesh(dae(tmp_path / "a.dae", faces, **how))


def test_a_geometry_that_no_node_places_and_one_that_other_nodes_refer_to(tmp_path):
    other = '<geometry id="unused"><mesh><source id="q"/></mesh></geometry>'
    nodes = '<library_nodes><node id="of">' + NODE + "</node></library_nodes>"
    path = dae(tmp_path / "a.dae", polylist("3", "0 1 2"), '<node><instance_node url="#of"/></node>', nodes)
    assert area(sarcl.Scene.from_mesh(path)) == pytest.approx(2.0)
    path.write_text(path.read_text().replace("</library_geometries>", f"{other}</library_geometries>"))
    with pytest.raises(ValueError, match="1 of 2 geometries cannot be read"):
        sarcl.Scene.from_mesh(path)


def test_deprecations_within_pycollada_do_not_refuse_a_file(tmp_path, monkeypatch):
    """As with NumPy 2.5, where warnings are errors."""

    class Outdated(collada.Collada):
        def __init__(self, *arguments, **options):
            old = "Setting the shape on a NumPy array has been deprecated"
            warnings.warn_explicit(old, DeprecationWarning, "polylist.py", 144, module="collada.polylist")
            super().__init__(*arguments, **options)

    monkeypatch.setattr(collada, "Collada", Outdated)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert area(sarcl.Scene.from_mesh(dae(tmp_path / "a.dae", polylist("3", "0 1 2")))) == pytest.approx(2.0)


def archive(path, **files):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        for name, data in files.items():
            made.writestr(name.replace("__", "."), data)
    return path


def test_concave_polygons_in_archives_are_refused_and_the_file_in_them_is_named(tmp_path):
    square = L_OBJ.replace("f 1 2 3 4 5 6", "f 2 3 4 5")
    for name, path in (
        ("L.obj", archive(tmp_path / "a.zip", box__stl=BOX.export(file_type="stl"), L__obj=L_OBJ)),
        ("L.obj", tmp_path / "L.obj.bz2"),
        ("L.dae", archive(tmp_path / "a.zae", L__dae=dae(tmp_path / "L.dae", polygons("0 1 2 3 4 5")).read_text())),
    ):
        if path.suffix == ".bz2":
            path.write_bytes(bz2.compress(L_OBJ.encode()))
        with pytest.raises(ValueError, match=rf"'{path.name}', its file '{name}', .*6 corners,? {re.escape(CONCAVE)}"):
            sarcl.Scene.from_mesh(path)
    assert area(sarcl.Scene.from_mesh(archive(tmp_path / "b.zip", a__obj=square))) == pytest.approx(1.5)
    (tmp_path / "b.obj.bz2").write_bytes(bz2.compress(square.encode()))
    assert area(sarcl.Scene.from_mesh(tmp_path / "b.obj.bz2")) == pytest.approx(1.5)


def test_a_mesh_of_an_archive_that_cannot_be_read_is_not_left_out(tmp_path):
    stl = BOX.export(file_type="stl")
    whole = archive(tmp_path / "a.zip", a__stl=stl, b__stl=stl, readme__txt="", __MACOSX_="")
    assert len(mesh.load(whole, repair=False).triangles) == 24
    for name, data in (
        ("b.stl", stl[:-20]),
        ("b.off", b"OFF\n3 1 0\n0 0 0\n"),
        ("b.ply", b"ply\n"),
        ("b.glb", b"glTF"),
    ):
        broken = archive(tmp_path / "b.zip", a__stl=stl, **{name.replace(".", "__"): data})
        with pytest.raises(ValueError, match=rf"mesh file 'b\.zip', its file '{name}'"):
            sarcl.Scene.from_mesh(broken)


def test_archives_without_a_mesh_with_a_password_or_damaged_are_refused(tmp_path):
    empty = archive(tmp_path / "a.zip", readme__txt="", inner__zip="")
    with pytest.raises(
        ValueError, match=r"'a\.zip' holds no meshes \('readme\.txt', 'inner\.zip'\), wanted at least one"
    ):
        sarcl.Scene.from_mesh(empty)
    two = archive(tmp_path / "a.zae", a__dae="", b__dae="")
    with pytest.raises(
        ValueError, match=r"'a\.zae' holds 2 meshes \('a\.dae', 'b\.dae'\), wanted one \.dae: unpack it"
    ):
        sarcl.Scene.from_mesh(two)
    path = archive(tmp_path / "c.zip", a__stl=BOX.export(file_type="stl"))
    data = bytearray(path.read_bytes())
    data[60] ^= 255
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"'c\.zip' cannot be unpacked"):
        sarcl.Scene.from_mesh(path)
    path.rename(tmp_path / "c.dae")
    with pytest.raises(ValueError, match=r"'c\.dae' is a zip file, wanted XML: give it the name \.zae"):
        sarcl.Scene.from_mesh(tmp_path / "c.dae")


def test_a_glb_that_names_a_file_of_its_archive_finds_it(tmp_path):
    files = trimesh.Scene(BOX).export(file_type="gltf")
    path = archive(tmp_path / "a.zip", **{name.replace(".", "__"): data for name, data in files.items()})
    assert len(sarcl.Scene.from_mesh(path).triangles) == 12


def test_an_archive_in_an_archive_and_names_given_twice_are_refused(tmp_path):
    """trimesh leaves out what they hold."""
    stl = BOX.export(file_type="stl")
    for inner in ("more.zip", "more.ZAE", "more.stl.bz2"):
        path = archive(tmp_path / "a.zip", **{"a__stl": stl, inner.replace(".", "__"): b""})
        with pytest.raises(ValueError, match=rf"'a\.zip' holds another archive, '{inner}': unpack it"):
            sarcl.Scene.from_mesh(path)
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as made, pytest.warns(UserWarning, match="Duplicate name"):
        made.writestr("a.stl", stl)
        made.writestr("a.stl", stl)
    with pytest.raises(ValueError, match=r"'b\.zip' holds 2 files of 1 names"):
        sarcl.Scene.from_mesh(tmp_path / "b.zip")


def test_meshes_in_folders_of_an_archive_read_the_files_beside_them(tmp_path):
    """Two glTF files whose buffers have one name and one length."""
    sizes = {"": 1.0, "large/": 2.0, "deep/er/": 3.0}
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as made:
        for folder, size in sizes.items():
            for name, data in trimesh.Scene(trimesh.creation.box([size] * 3)).export(file_type="gltf").items():
                made.writestr(folder + name, data)
    made = sarcl.Scene.from_mesh(tmp_path / "a.zip", repair=False)
    assert area(made) == pytest.approx(6 * sum(size**2 for size in sizes.values()))
