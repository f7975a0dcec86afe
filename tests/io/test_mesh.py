"""Reading meshes: parts and their materials, repaired winding, repeated faces, and what is refused."""

from __future__ import annotations

import logging

import numpy as np
import pytest
import trimesh

import sarcl
from sarcl.io.meshes.mesh import load
from sarcl.scene.material import MATERIALS, METAL
from sarcl.scene.triangles import areas, normals

TOLERANCE = {"float64": 1e-12}


def box(at=(0, 0, 0), size=(1, 2, 3)):
    return trimesh.creation.box(size, transform=trimesh.transformations.translation_matrix(at))


def changed(mesh, faces):
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def volume(scene):
    """Signed volume of closed facets: positive when they face outwards."""
    return np.linalg.det(scene.triangles).sum() / 6


def soup(mesh):
    """Corners stored once a face, as STL does."""
    return trimesh.Trimesh(mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False)


# winding


@pytest.mark.parametrize("store", [lambda m: m, soup], ids=["shared corners", "corners once a face"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.9, 1.0])
def test_faces_of_a_closed_body_are_turned_outside_however_many_were_not(share, store, caplog):
    ball = trimesh.creation.icosphere(subdivisions=3)
    random = np.random.default_rng(0)
    wrong = random.permutation(len(ball.faces)) < share * len(ball.faces)
    faces = np.where(wrong[:, None], ball.faces[:, ::-1], ball.faces)
    with caplog.at_level(logging.INFO, "sarcl"):
        scene = sarcl.Scene.from_mesh(store(changed(ball, faces)))
    assert volume(scene) == pytest.approx(ball.volume, rel=TOLERANCE["float64"])
    assert not scene.two_sided.any() and len(scene.triangles) == len(ball.faces)
    assert (f"{wrong.sum()} of 1280 faces turned round" in caplog.text) == bool(wrong.any())


def test_bodies_are_turned_one_by_one():
    inside_out = box((5, 0, 0))
    inside_out.invert()
    both = trimesh.util.concatenate([box(), inside_out])
    scene = sarcl.Scene.from_mesh(both)
    assert volume(scene) == pytest.approx(12) and not scene.two_sided.any()


@pytest.mark.parametrize("outer", [False, True])
@pytest.mark.parametrize("store", [lambda m: m, soup], ids=["shared corners", "corners once a face"])
def test_the_wall_of_a_cavity_stays_wound_inwards(outer, store):
    """6 m^3 with a hole of 0.125 m^3, in which another body of 0.001 m^3 stands; beside it a body that is wrong."""
    hole, inside, beside = box((0.1, 0, 0), (0.5, 0.5, 0.5)), box((0.1, 0, 0.1), (0.1, 0.1, 0.1)), box((9, 0, 0))
    hole.invert()
    beside.invert()
    mesh = trimesh.util.concatenate([box(), hole, inside, beside])
    if outer:  # all of it the wrong way round
        mesh.invert()
    scene = sarcl.Scene.from_mesh(store(mesh))
    assert volume(scene) == pytest.approx(6 - 0.125 + 0.001 + 6) and not scene.two_sided.any()
    mean = scene.triangles.mean(axis=1)
    wall = (np.abs(mean - (0.1, 0, 0)).max(axis=1) < 0.26) & (np.abs(mean - (0.1, 0, 0.1)).max(axis=1) > 0.06)
    assert wall.sum() == 12 and np.linalg.det(scene.triangles[wall]).sum() / 6 == pytest.approx(-0.125)


def test_bodies_whose_boxes_overlap_alone_hold_nothing():
    """A small ball within the box around a large ring, not within the ring: it is turned outwards."""
    ring = trimesh.creation.torus(3.0, 0.5)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    ball.invert()
    scene = sarcl.Scene.from_mesh(trimesh.util.concatenate([ring, ball]))
    assert volume(scene) == pytest.approx(ring.volume - ball.volume)  # of which the second is negative as given


def test_an_open_sheet_is_wound_alike_and_keeps_both_sides():
    sheet = sarcl.Scene.from_heights(np.arange(9.0), np.arange(7.0), np.zeros((7, 9))).triangles
    sheet = np.where(np.arange(len(sheet))[:, None, None] % 3 == 0, sheet[:, ::-1], sheet)
    scene = sarcl.Scene.from_mesh(trimesh.Trimesh(**trimesh.triangles.to_kwargs(sheet)))
    assert scene.two_sided.all() and (normals(scene.triangles) == (0, 0, 1)).all()  # most faces pointed upwards


def strip(twists, n=20):
    """A band of n quads whose end meets its start after `twists` half turns; 1 is a Moebius strip."""
    angle = 2 * np.pi * np.arange(n) / n
    tilt = twists * angle / 2
    rings = [
        np.stack([(2 + s * np.cos(tilt)) * np.cos(angle), (2 + s * np.cos(tilt)) * np.sin(angle), s * np.sin(tilt)], -1)
        for s in (-0.5, 0.5)
    ]
    low, high = np.arange(n), n + np.arange(n)
    after = [np.roll(r, -1) for r in (low, high)]
    if twists % 2:
        after[0][-1], after[1][-1] = after[1][-1], after[0][-1]
    faces = np.concatenate([np.stack([low, after[0], after[1]], 1), np.stack([low, after[1], high], 1)])
    return trimesh.Trimesh(np.concatenate(rings), faces, process=False)


def test_a_moebius_strip_has_one_side_and_is_left_alone(caplog):
    with caplog.at_level(logging.INFO, "sarcl"):
        scene = sarcl.Scene.from_mesh(strip(1))
    assert (scene.triangles == strip(1).triangles).all() and scene.two_sided.all()
    assert "no winding could make agree" in caplog.text
    caplog.clear()
    sarcl.Scene.from_mesh(strip(2))
    assert "no winding" not in caplog.text


def test_without_repair_winding_that_disagrees_tells_nothing(caplog):
    faces = box().faces.copy()
    faces[3] = faces[3, ::-1]
    wrong = changed(box(), faces)
    with caplog.at_level(logging.INFO, "sarcl"):
        scene = sarcl.Scene.from_mesh(wrong, repair=False)
    assert (scene.triangles == wrong.triangles).all() and scene.two_sided.all() and not caplog.text
    assert not sarcl.Scene.from_mesh(wrong).two_sided.any()


def test_a_closed_mesh_that_nobody_here_made_is_turned_outside(data_folder):
    """Austin's duct: closed, half its faces wound backwards."""
    path = data_folder / "austin_rcs" / "Closed-Duct_PRIME_model_meshAA.inp"
    if not path.is_file():
        pytest.skip("no austin_rcs in the data folder")
    words = path.read_text().split()
    n, k = int(words[0]), int(words[1])
    vertices = np.array(words[2 : 2 + 3 * n], float).reshape(n, 3)
    faces = np.array(words[2 + 3 * n : 2 + 3 * (n + k)], int).reshape(k, 3) - 1
    given = trimesh.Trimesh(vertices, faces, process=False)
    assert given.is_watertight and not given.is_winding_consistent
    scene = sarcl.Scene.from_mesh(given)
    assert not scene.two_sided.any() and len(scene.triangles) == k
    mended = trimesh.Trimesh(**trimesh.triangles.to_kwargs(scene.triangles))
    assert mended.is_watertight and mended.is_winding_consistent and mended.volume > 40


# faces twice, needles, faces of no area


def test_repeated_faces_are_left_out_and_counted(caplog):
    faces = np.concatenate([box().faces, box().faces[[2, 5]], np.roll(box().faces[[7]], 1, axis=1)])
    with caplog.at_level(logging.INFO, "sarcl"):
        scene = sarcl.Scene.from_mesh(changed(box(), faces))
    assert len(scene.triangles) == 12 and not scene.two_sided.any() and volume(scene) == pytest.approx(6)
    assert "3 of 15 faces left out: they repeat another" in caplog.text


@pytest.mark.parametrize("invert", [False, True])
def test_a_body_given_twice_is_there_once(invert):
    copy = box()
    if invert:
        copy.invert()
    scene = sarcl.Scene.from_mesh(trimesh.Scene([box(), copy]))
    assert len(scene.triangles) == 12 and volume(scene) == pytest.approx(6)


def test_a_sheet_modelled_from_both_sides_is_one_sheet_or_two_back_to_back():
    sheet = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    both = trimesh.Trimesh(**trimesh.triangles.to_kwargs(np.concatenate([sheet, sheet[:, ::-1]])))
    scene = sarcl.Scene.from_mesh(soup(both))
    assert len(scene.triangles) == 1 and scene.two_sided.all()
    scene = sarcl.Scene.from_mesh(both)  # joined at its edges: a closed body of no volume
    assert normals(scene.triangles)[:, 2].tolist() == [1, -1] and not scene.two_sided.any()


def test_closed_bodies_that_touch_keep_their_walls():
    scene = sarcl.Scene.from_mesh(trimesh.Scene([box(), box((1, 0, 0))]))
    assert len(scene.triangles) == 24 and not scene.two_sided.any() and volume(scene) == pytest.approx(12)


def test_faces_of_no_area_and_needles_are_left_out_and_counted(caplog):
    vertices = np.concatenate([box().vertices, [[9, 9, 9], [10, 9, 9], [11, 9, 9], [9, 9, 9], [10, 9 + 1e-14, 9]]])
    faces = np.concatenate([box().faces, [[8, 9, 10], [8, 11, 9], [8, 12, 10]]])
    with caplog.at_level(logging.INFO, "sarcl"):
        scene = sarcl.Scene.from_mesh(trimesh.Trimesh(vertices, faces, process=False))
    assert areas(scene.triangles).sum() == pytest.approx(22) and len(scene.triangles) == 12
    assert "1 of 15 faces left out: two of their corners are one" in caplog.text
    assert "zero area" in caplog.text


def test_a_mesh_of_nothing_but_collapsed_faces_is_refused():
    with pytest.raises(ValueError, match="all 1 facets are degenerate"):
        sarcl.Scene.from_mesh(trimesh.Trimesh(np.eye(3), [[0, 0, 1]], process=False))


# parts


def car():
    scene = trimesh.Scene()
    scene.add_geometry(box(), geom_name="body", node_name="chassis")
    scene.add_geometry(box((0, 0, 9), (1, 1, 1)), geom_name="glazing", node_name="front window")
    behind = trimesh.transformations.translation_matrix((0, 9, 0))
    scene.graph.update(frame_to="rear window", geometry="glazing", matrix=behind)
    return scene


def made_of(scene):
    """(share of area, name) of each material."""
    area = areas(scene.triangles)
    return {m.name: area[scene.material == i].sum() for i, m in enumerate(scene.materials)}


def test_parts_go_by_node_before_geometry_before_the_rest():
    parts = {"glazing": "glass", "*": "metal", "rear window": "wood"}
    scene = sarcl.Scene.from_mesh(car(), material=parts)
    assert made_of(scene) == pytest.approx({"metal": 22, "glass": 6, "wood": 6})
    assert scene.bounds[1] == pytest.approx([0.5, 9.5, 9.5])  # nodes stand where their matrices say
    behind = scene.triangles[:, 0, 1] > 5
    assert {scene.materials[i].name for i in scene.material[behind]} == {"wood"}


def test_parts_may_be_numbers_and_materials():
    mine = sarcl.Material(7, reflectivity=0.5, name="mine")
    scene = sarcl.Scene.from_mesh(car(), material={"body": 0.3, "glazing": mine})
    assert scene.materials == (METAL, sarcl.Material(7, name="mine"))
    assert set(zip(scene.material.tolist(), scene.reflectivity.tolist(), strict=True)) == {(0, 0.3), (1, 0.5)}


def test_parts_of_a_file_go_by_the_materials_in_it(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl steel\nKd 1 0 0\nnewmtl pane\nKd 0 1 0\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 3\n"
        "o one\nusemtl steel\nf 1 2 3\nf 1 2 4\no two\nusemtl pane\nf 1 3 4\n"
    )  # fmt: skip
    scene = sarcl.Scene.from_mesh(tmp_path / "a.obj", material={"pane": "glass", "*": "metal"})
    assert made_of(scene) == pytest.approx({"metal": 0.5 + 1.5, "glass": 1.5})


def test_unknown_and_forgotten_parts_are_named_with_those_there_are():
    with pytest.raises(
        ValueError, match="part 'windows' that the mesh does not have; its parts are 'chassis' = 'body'"
    ):
        sarcl.Scene.from_mesh(car(), material={"windows": "glass", "*": "metal"})
    with pytest.raises(ValueError, match=r"does not say what the part 'chassis' is made of; name it or give '\*'"):
        sarcl.Scene.from_mesh(car(), material={"glazing": "glass"})
    with pytest.raises(ValueError, match="material is 'wool'; known are"):
        sarcl.Scene.from_mesh(car(), material={"*": "wool"})


def test_real_files_name_their_parts(data_folder):
    path = data_folder / "meshes" / "gazebo_vehicles_CC-BY-3.0" / "pickup.dae"
    if not path.is_file():
        pytest.skip("no meshes in the data folder")
    wheels = "geom-Truck_1"
    scene = sarcl.Scene.from_mesh(path, scale=0.0254, material={wheels: 0.1, "*": "metal"})
    assert 0 < (scene.reflectivity == 0.1).sum() < len(scene.triangles) and scene.materials == (MATERIALS["metal"],)
    with pytest.raises(ValueError, match=f"'{wheels}'"):
        sarcl.Scene.from_mesh(path, material={"doors": "metal"})


def test_a_mirrored_part_still_faces_outwards():
    scene = trimesh.Scene()
    scene.add_geometry(box((3, 0, 0)), transform=np.diag([-1.0, 1, 1, 1]))
    assert volume(sarcl.Scene.from_mesh(scene, repair=False)) == pytest.approx(6)


def test_corners_that_are_not_finite_are_named_by_file_and_place(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n")
    with pytest.raises(ValueError, match=r"mesh file 'a.obj' vertices\[2, 1\] is inf; every value must be finite"):
        load(tmp_path / "a.obj")


@pytest.mark.parametrize("unit", [1e-30, 1e-6, 1e6])
def test_corners_are_one_by_their_distance_over_the_meshs_size_not_in_its_unit(unit):
    ball = soup(trimesh.creation.icosphere(subdivisions=2))
    assert load(trimesh.Trimesh(ball.vertices * unit, ball.faces, process=False)).closed


CENTIMETRES = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>
<unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">0 0 0 501 0 0 0 200 0</float_array><technique_common>
<accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def test_the_unit_that_a_mesh_file_names_is_used_and_said(tmp_path):
    path = tmp_path / "car.dae"
    path.write_text(CENTIMETRES)
    with pytest.warns(
        sarcl.SarclWarning, match=r"unit of this mesh is 0.01 m.*longest side is taken as 5.01 m.*scale=0.01"
    ):
        scene = sarcl.Scene.from_mesh(path)
    assert np.ptp(scene.triangles[..., 0]) == pytest.approx(5.01, rel=1e-12)
    assert np.ptp(sarcl.Scene.from_mesh(path, scale=2.0).triangles[..., 0]) == 1002  # m per unit of the file, as given
    path.write_text(CENTIMETRES.replace('meter="0.01"', 'meter="1"'))
    assert np.ptp(sarcl.Scene.from_mesh(path).triangles[..., 0]) == 501  # metres: nothing to say
    assert np.ptp(sarcl.Scene.from_mesh(box((0, 0, 0))).triangles[..., 0]) == np.ptp(box((0, 0, 0)).vertices[:, 0])


@pytest.mark.parametrize(("units", "metres"), [("m", 1), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254), ("ft", 0.3048)])
def test_the_unit_of_a_mesh_may_be_named(units, metres):
    import trimesh

    box = trimesh.creation.box(extents=(4200.0, 1.0, 1.0))
    assert np.ptp(sarcl.Scene.from_mesh(box, units=units).triangles[..., 0]) == pytest.approx(4200 * metres, rel=1e-12)


def test_a_mesh_of_millimetres_is_told_and_refused_with_its_size():
    import trimesh

    box = trimesh.creation.box(extents=(4200.0, 1800.0, 1500.0))
    with pytest.warns(sarcl.SarclWarning, match=r"names no unit.*longest side is 4200 m\. Give units='mm'"):
        car = sarcl.Scene.from_mesh(box)
    with pytest.raises(MemoryError, match=r"take a smaller scene \(this one is 4200 m long"):
        car.split(0.01)
    with pytest.raises(ValueError, match=r"scale=2\.0 and units='mm' both say how long a unit"):
        sarcl.Scene.from_mesh(box, scale=2.0, units="mm")
    with pytest.raises(ValueError, match=r"units.*'km'"):
        sarcl.Scene.from_mesh(box, units="km")
