"""Scenes: points, facets, meshes and terrain; cutting keeps the surface; and what is refused."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

import sarcl
from sarcl.base.counter_rng import gaussian
from sarcl.scene.material import MATERIALS, METAL
from sarcl.scene.triangles import areas, centroids, edges, normals, shortest_edges

TOLERANCE = {
    "area": 1e-12,  # float64 sums of some ten thousand facets, relative
    "position": 1e-12,  # float64, relative to the largest coordinate
    "float32 rotation": 1e-6,  # a rotation given in float32 is one to 1e-7
}
TRIANGLE = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])


def soup(n=20, seed=0):
    return np.random.default_rng(seed).uniform(-5, 5, (n, 3, 3))


def total_area(scene):
    return areas(scene.triangles).sum()


# points


def test_points_keep_positions_and_amplitudes():
    scene = sarcl.Scene.points([[1, 2, 3], [4, 5, 6]], [1, 2j])
    assert (scene.positions == [[1, 2, 3], [4, 5, 6]]).all() and (scene.amplitudes == [1, 2j]).all()
    assert scene.positions.dtype == np.float64 and scene.amplitudes.dtype == np.complex128
    assert len(scene.triangles) == 0


def test_one_amplitude_serves_all_points():
    assert (sarcl.Scene.points(np.zeros((4, 3)), 3j).amplitudes == [3j] * 4).all()
    assert (sarcl.Scene.points(np.zeros((4, 3))).amplitudes == 1).all()


# facets


def test_normals_follow_the_right_hand():
    assert normals(TRIANGLE)[0] == pytest.approx([0, 0, 1])
    assert normals(TRIANGLE[:, ::-1])[0] == pytest.approx([0, 0, -1])


def test_area_centroid_and_edges_of_the_three_four_five_triangle():
    t = np.array([[[1.0, 1, 1], [4, 1, 1], [1, 5, 1]]])
    assert areas(t)[0] == 6 and edges(t)[:, 0] == pytest.approx([3, 5, 4])
    assert centroids(t)[0] == pytest.approx([2, 7 / 3, 1])


def test_facets_take_one_value_or_one_each():
    one = sarcl.Scene.facets(soup(3), roughness=0.1, two_sided=False, material=0.5)
    assert (one.roughness == 0.1).all() and not one.two_sided.any() and (one.reflectivity == 0.5).all()
    each = sarcl.Scene.facets(soup(3), roughness=[0, 1, 2], two_sided=[True, False, True])
    assert (each.roughness == [0, 1, 2]).all() and (each.two_sided == [True, False, True]).all()


def test_facets_without_area_are_left_out_with_what_belongs_to_them(caplog):
    flat = np.array([[0.0, 0, 0], [1, 1, 1], [2, 2, 2]])
    point = np.ones((3, 3))
    with caplog.at_level(logging.INFO, "sarcl"):
        scene = sarcl.Scene.facets([flat, TRIANGLE[0], point], roughness=[1, 2, 3], two_sided=[1, 0, 1])
    assert (scene.triangles == TRIANGLE).all() and (scene.roughness == 2).all() and not scene.two_sided.any()
    assert "left out 2 of 3 facets: zero area" in caplog.text


@pytest.mark.parametrize("thinness", [1e-3, 1e-6, 1e-9])
def test_needles_stay_as_long_as_float64_carries_their_area(thinness):
    scene = sarcl.Scene.facets(TRIANGLE * [1, thinness, 1])
    assert total_area(scene) == pytest.approx(thinness / 2, rel=1e-6)
    assert np.abs(normals(scene.triangles)[0] - (0, 0, 1)).max() <= 1e-6
    assert total_area(scene.split(0.1)) == pytest.approx(thinness / 2, rel=1e-6)


def test_a_needle_thinner_than_float64_is_degenerate():
    with pytest.raises(ValueError, match="all 1 facets are degenerate"):
        sarcl.Scene.facets(TRIANGLE * [1, 1e-13, 1])


@pytest.mark.parametrize("size", [1e-60, 1e-3, 1e60])
def test_degenerate_means_thin_not_small(size):
    assert len(sarcl.Scene.facets(TRIANGLE * size).triangles) == 1


# splitting


@pytest.mark.parametrize("max_edge", [100, 3, 1, 0.3])
def test_splitting_leaves_no_longer_edge_and_the_same_area(max_edge):
    scene = sarcl.Scene.facets(soup())
    cut = scene.split(max_edge)
    assert edges(cut.triangles).max() <= max_edge
    assert abs(total_area(cut) - total_area(scene)) <= TOLERANCE["area"] * total_area(scene)


def test_splitting_keeps_normals_and_stays_on_the_surface():
    cut = sarcl.Scene.facets(TRIANGLE).split(0.11)
    assert np.abs(normals(cut.triangles) - (0, 0, 1)).max() <= TOLERANCE["position"]
    corners = cut.triangles.reshape(-1, 3)
    assert (corners[:, 2] == 0).all() and (corners >= 0).all() and (corners[:, :2].sum(axis=1) <= 1).all()


def test_splitting_repeats_what_belongs_to_a_facet():
    far = np.array([0, 0, 100.0])
    scene = sarcl.Scene.facets(
        np.concatenate([TRIANGLE, TRIANGLE + far]), roughness=[0.1, 0.2], two_sided=[True, False]
    )
    cut = (scene + sarcl.Scene.points([[1, 2, 3]])).split(0.2)
    above = cut.triangles[:, 0, 2] > 50
    assert 0 < above.sum() < len(above)
    assert (cut.roughness == np.where(above, 0.2, 0.1)).all() and (cut.two_sided == ~above).all()
    assert (cut.positions == [[1, 2, 3]]).all()


def test_splitting_what_is_short_enough_or_no_facet_changes_nothing():
    scene = sarcl.Scene.facets(soup())
    assert (scene.split(100).triangles == scene.triangles).all()
    assert len(sarcl.Scene.points([[0, 0, 0]]).split(0.1).positions) == 1


def test_too_many_facets_are_refused_before_they_fill_the_memory():
    with pytest.raises(MemoryError, match=r"no longer than 1e-06 m would number more than 50,000,000; take a smaller"):
        sarcl.Scene.facets(TRIANGLE).split(1e-6)
    with pytest.raises(MemoryError, match="more than 1,000;"):
        sarcl.Scene.facets(TRIANGLE * [1, 1e-6, 1]).split(1e-4, max_facets=1000)


# meshes


def box(**options):
    return trimesh.creation.box((1, 2, 3), **options)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb", "off", "dae"])
def test_a_mesh_file_has_the_surface_it_was_written_with(tmp_path, suffix):
    box().export(tmp_path / f"box.{suffix}")
    for path in (tmp_path / f"box.{suffix}", str(tmp_path / f"box.{suffix}")):
        scene = sarcl.Scene.from_mesh(path)
        assert total_area(scene) == pytest.approx(22)
        assert scene.bounds == pytest.approx(np.array([[-0.5, -1, -1.5], [0.5, 1, 1.5]]))


def test_a_text_stl_is_read_too(tmp_path):
    (tmp_path / "box.stl").write_text(box().export(file_type="stl_ascii"))
    assert total_area(sarcl.Scene.from_mesh(tmp_path / "box.stl")) == pytest.approx(22)


def test_a_mesh_object_and_a_scene_of_several_are_taken_as_they_are():
    two = trimesh.Scene([box(), box(transform=trimesh.transformations.translation_matrix((9, 0, 0)))])
    assert total_area(sarcl.Scene.from_mesh(box())) == pytest.approx(22)
    both = sarcl.Scene.from_mesh(two)
    assert total_area(both) == pytest.approx(44) and both.bounds[1, 0] == pytest.approx(9.5)


def test_corners_are_scaled_then_turned_then_moved():
    scene = sarcl.Scene.from_mesh(box(), scale=0.1, rotation=np.pi / 2, position=(10, 20, 30))
    assert scene.bounds == pytest.approx(np.array([[9.9, 19.95, 29.85], [10.1, 20.05, 30.15]]))


VECTOR = np.array([0.3, -0.2, 1.1])
ROTATIONS = {
    "matrix": (Rotation.from_rotvec(VECTOR).as_matrix(), VECTOR),
    "vector": (VECTOR, VECTOR),
    "list": (VECTOR.tolist(), VECTOR),
    "angle": (0.7, np.array([0, 0, 0.7])),
    "whole angle": (1, np.array([0, 0, 1])),
    "scipy": (Rotation.from_rotvec(VECTOR), VECTOR),
    "none": (None, np.zeros(3)),
    "no turn": ((0, 0, 0), np.zeros(3)),
}


@pytest.mark.parametrize("name", ROTATIONS)
def test_a_rotation_is_a_matrix_a_vector_or_an_angle_about_z(name):
    rotation, vector = ROTATIONS[name]
    turned, plain = sarcl.Scene.from_mesh(box(), rotation=rotation), sarcl.Scene.from_mesh(box())
    wanted = Rotation.from_rotvec(vector).apply(plain.triangles.reshape(-1, 3).copy()).reshape(-1, 3, 3)
    assert np.abs(turned.triangles - wanted).max() <= TOLERANCE["position"]


def test_a_rotation_in_float32_is_one():
    matrix = Rotation.from_rotvec(VECTOR).as_matrix()
    rough = sarcl.Scene.from_mesh(box(), rotation=matrix.astype(np.float32))
    exact = sarcl.Scene.from_mesh(box(), rotation=matrix)
    assert np.abs(rough.triangles - exact.triangles).max() <= TOLERANCE["float32 rotation"]
    assert abs(total_area(rough) - 22) <= TOLERANCE["area"] * 22


def test_a_closed_mesh_has_an_outside_and_an_open_one_has_two():
    assert not sarcl.Scene.from_mesh(box()).two_sided.any()
    opened = trimesh.Trimesh(box().vertices, box().faces[1:])
    assert sarcl.Scene.from_mesh(opened).two_sided.all()


def test_a_closed_mesh_whose_corners_are_stored_once_a_facet_is_still_closed(tmp_path):
    box().export(tmp_path / "box.stl")  # this format knows no shared corners
    assert not sarcl.Scene.from_mesh(tmp_path / "box.stl").two_sided.any()


def test_max_edge_cuts_the_mesh():
    scene = sarcl.Scene.from_mesh(box(), max_edge=0.4)
    assert edges(scene.triangles).max() <= 0.4 and total_area(scene) == pytest.approx(22)


def test_the_callers_mesh_is_left_as_it_was():
    mesh = trimesh.Trimesh(box().vertices, box().faces[1:])
    before = mesh.vertices.copy(), mesh.faces.copy()
    sarcl.Scene.from_mesh(mesh, scale=2, position=(1, 1, 1), rotation=1.0)
    assert (mesh.vertices == before[0]).all() and (mesh.faces == before[1]).all()
    mesh.vertices[0] = 7  # still writeable


def mesh_file(folder, name, content):
    (folder / name).write_bytes(content)
    return sarcl.Scene.from_mesh(folder / name)


BINARY = box().export(file_type="stl")
TEXT = b"this is no mesh\n" * 20
BAD_FILES = {
    "text named .stl": ("a.stl", TEXT, "'a.stl'.*"),
    "text named .ply": ("a.ply", TEXT, r"'a.ply' cannot be read as \.ply .*not what its name says"),
    "text named .obj": ("a.obj", TEXT, "'a.obj' has no faces"),
    "text named .dae": ("a.dae", TEXT, r"'a.dae' cannot be read as \.dae"),
    "text named .glb": ("a.glb", TEXT, r"'a.glb' cannot be read as \.glb"),
    "stl truncated": ("a.stl", BINARY[:300], "'a.stl' declares 12 facets, 684 bytes, and has 300"),
    "stl of a head only": ("a.stl", BINARY[:84], "'a.stl' declares 12 facets, 684 bytes, and has 84 bytes"),
    "stl of no facets": ("a.stl", BINARY[:80] + bytes(4), "'a.stl' has no faces"),
    "ply truncated": ("a.ply", box().export(file_type="ply")[:-30], r"'a.ply' cannot be read as \.ply .*truncated"),
    "glb truncated": ("a.glb", box().export(file_type="glb")[:-300], "'a.glb' cannot be read"),
    "text stl truncated": ("a.stl", box().export(file_type="stl_ascii").encode()[:700], "'a.stl'"),
    "empty file": ("a.stl", b"", "'a.stl' has no faces"),
    "corners only": ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has no faces; nothing would reflect: check what"),
    "points only": ("a.ply", trimesh.PointCloud(np.eye(3)).export(file_type="ply"), "'a.ply' has no faces"),
    "facet of corners that are not there": ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "cannot be read"),
    "corner not finite": (
        "a.obj",
        b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n",
        r"'a.obj' vertices\[1, 2\] is nan; every value must be finite",
    ),
    "all facets degenerate": ("a.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "all 1 facets are degenerate"),
    "unknown suffix": ("a.foo", TEXT, r"mesh file 'a.foo': unknown format '\.foo'; known are .*stl"),
    "no suffix": ("mesh", TEXT, "mesh file 'mesh': unknown format ''; known are"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_mesh_files_are_named_with_what_is_wrong(tmp_path, name):
    file, content, message = BAD_FILES[name]
    with pytest.raises(ValueError, match=message):
        mesh_file(tmp_path, file, content)


def test_a_missing_file_and_a_folder_have_different_errors(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.stl' does not exist; check the name"):
        sarcl.Scene.from_mesh(tmp_path / "nowhere.stl")
    with pytest.raises(IsADirectoryError, match="is a folder; give the name of a file in it"):
        sarcl.Scene.from_mesh(tmp_path)


def bad_mesh(at, value):
    vertices = np.array(box().vertices)
    vertices[at] = value
    return trimesh.Trimesh(vertices, box().faces, process=False)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_mesh_object_with_a_corner_not_finite_is_refused_by_index(value):
    with pytest.raises(ValueError, match=r"mesh vertices\[5, 1\] is"):
        sarcl.Scene.from_mesh(bad_mesh((5, 1), value))


@pytest.mark.parametrize("what", [None, 3, b"tank.stl", [1, 2], trimesh.PointCloud(np.eye(3))], ids=repr)
def test_what_is_no_mesh_is_refused(what):
    with pytest.raises(TypeError, match=r"give a file name or a trimesh\.Trimesh"):
        sarcl.Scene.from_mesh(what)


# terrain


def heights(n_y=4, n_x=6, seed=0):
    random = np.random.default_rng(seed)
    x, y = (np.cumsum(random.uniform(0.5, 2, n)) for n in (n_x, n_y))
    return x, y, random.uniform(-1, 1, (n_y, n_x))


def test_flat_terrain_has_the_area_of_its_box_and_faces_up():
    x, y, z = heights()
    scene = sarcl.Scene.from_heights(x, y, 0 * z + 7)
    assert abs(total_area(scene) - np.ptp(x) * np.ptp(y)) <= TOLERANCE["area"] * total_area(scene)
    assert (normals(scene.triangles) == (0, 0, 1)).all() and not scene.two_sided.any()


def test_tilted_terrain_has_the_area_of_its_box_over_the_cosine_of_its_slope():
    x, y, _ = heights()
    scene = sarcl.Scene.from_heights(x, y, np.add.outer(-0.3 * y, 0.4 * x))
    wanted = np.ptp(x) * np.ptp(y) * np.sqrt(1 + 0.3**2 + 0.4**2)
    assert abs(total_area(scene) - wanted) <= TOLERANCE["area"] * wanted
    assert np.abs(normals(scene.triangles) - np.array([-0.4, 0.3, 1]) / np.sqrt(1.25)).max() <= TOLERANCE["position"]


def test_every_cell_makes_two_facets_through_its_corners_facing_up():
    x, y, z = heights()
    scene = sarcl.Scene.from_heights(x, y, z)
    assert len(scene.triangles) == 2 * 3 * 5 and (normals(scene.triangles)[:, 2] > 0).all()
    corners = {(xi, yi): z[i, j] for i, yi in enumerate(y) for j, xi in enumerate(x)}
    for cx, cy, cz in scene.triangles.reshape(-1, 3):
        assert corners[cx, cy] == cz


def test_heights_may_be_a_function():
    x, y, _ = heights()
    scene = sarcl.Scene.from_heights(x, y, lambda x, y: 0.4 * x - 0.3 * y)
    same = sarcl.Scene.from_heights(x, y, np.add.outer(-0.3 * y, 0.4 * x))
    assert np.abs(scene.triangles - same.triangles).max() <= 1e-14  # sums in another order
    assert (sarcl.Scene.from_heights(x, y, lambda x, y: 7).triangles[..., 2] == 7).all()


def test_materials_are_given_by_cell():
    x, y, z = heights()
    kind = np.arange(15).reshape(3, 5) % 3
    names = np.array(["sand", "wet soil", "water"])
    mine = sarcl.Material(9, name="mine")
    for scene, wanted in (
        (sarcl.Scene.from_heights(x, y, z, material=names[kind]), [MATERIALS[n] for n in names]),
        (sarcl.Scene.from_heights(x, y, z, material=kind, materials=["water", mine, "sand"]),
         [MATERIALS["water"], mine, MATERIALS["sand"]]),
    ):  # fmt: skip
        middle = centroids(scene.triangles)
        i, j = (np.searchsorted(axis, middle[:, k]) - 1 for axis, k in ((y, 1), (x, 0)))
        assert [scene.materials[m] for m in scene.material] == [wanted[k] for k in kind[i, j]]
    grey = np.linspace(0, 1, 15).reshape(3, 5)
    scene = sarcl.Scene.from_heights(x, y, z, material=grey)
    assert scene.materials == (METAL,) and (scene.reflectivity == grey[i, j]).all()


def test_roughness_is_given_by_cell():
    x, y, z = heights()
    rough = np.arange(15.0).reshape(3, 5)
    scene = sarcl.Scene.from_heights(x, y, z, roughness=rough)
    middle = centroids(scene.triangles)
    i, j = (np.searchsorted(axis, middle[:, k]) - 1 for axis, k in ((y, 1), (x, 0)))
    assert (scene.roughness == rough[i, j]).all()


# grid points of random height


def rough(sigma=0.3, n=60, seed=1, **options):
    axis = np.arange(n + 1) * 2.0
    flat = np.zeros((n + 1, n + 1))
    return sarcl.Scene.from_heights(axis, axis, flat, point_roughness=sigma, **options), seed


def test_grid_points_move_up_and_down_and_the_surface_stays_closed():
    scene, seed = rough()
    made = scene.realized(seed)
    assert (made.triangles[..., :2] == scene.triangles[..., :2]).all()
    corners = made.triangles.reshape(-1, 3)
    assert len(np.unique(corners, axis=0)) == len(np.unique(corners[:, :2], axis=0)) == 61 * 61
    assert not made.point_roughness.any() and made.realized(5) is made


def test_grid_points_have_the_deviation_asked_and_are_independent():
    scene, seed = rough()
    points = np.unique(scene.realized(seed).triangles.reshape(-1, 3), axis=0)
    z = points[np.lexsort(points[:, :2].T)][:, 2].reshape(61, 61) / 0.3
    # 3721 numbers: their mean within 4/sqrt(n), their variance within 4 sqrt(2/n)
    assert abs(z.mean()) < 4 / 61 and abs(z.var() - 1) < 4 * np.sqrt(2) / 61
    assert kstest(z.ravel(), "norm").pvalue > 0.01
    for shifted in (z[1:] * z[:-1], z[:, 1:] * z[:, :-1]):
        assert abs(shifted.mean()) < 4 / 60


def test_grid_points_tilt_facets_as_the_slope_between_neighbours_says():
    """SARAS: the slope is Gaussian, its standard deviation sqrt(2) sigma/dx along either axis."""
    scene, seed = rough(n=200)
    n = normals(scene.realized(seed).triangles)
    for axis in (0, 1):
        slope = -n[:, axis] / n[:, 2]
        # 40 200 slopes, neighbours' correlation -1/2: variance of the variance 2 (1 + 2/4)/n; four deviations
        assert abs(slope.var() / (2 * 0.3**2 / 2**2) - 1) < 4 * np.sqrt(3 / 40_200)


def test_deviations_are_given_by_grid_point():
    sigma = np.zeros((3, 4))
    sigma[1, 2] = 0.5
    scene = sarcl.Scene.from_heights(range(4), range(3), np.zeros((3, 4)), point_roughness=sigma)
    moved = scene.realized(2).triangles
    where = moved[..., 2] != 0
    assert where.sum() == 6 and (moved[where][:, :2] == (2, 1)).all()


def test_heights_follow_the_seed_and_their_place_alone():
    scene, seed = rough(n=8)
    same, other = scene.realized(seed), scene.realized(seed + 1)
    assert (scene.realized(seed).triangles == same.triangles).all()
    assert (other.triangles[..., 2] != same.triangles[..., 2]).mean() > 0.99
    part, _ = rough(n=5)
    small = {tuple(c[:2]): c[2] for c in part.realized(seed).triangles.reshape(-1, 3)}
    large = {tuple(c[:2]): c[2] for c in same.triangles.reshape(-1, 3)}
    assert all(large[place] == z for place, z in small.items())
    both = (sarcl.Scene.points([[0, 0, 9]]) + scene).realized(seed)
    assert (both.triangles == same.triangles).all()


def test_facets_of_random_points_are_realized_before_they_are_cut():
    scene, seed = rough(n=3)
    with pytest.raises(ValueError, match=r"call scene\.realized\(seed\) first"):
        scene.split(0.5)
    cut = scene.realized(seed).split(0.5)
    assert abs(total_area(cut) - total_area(scene.realized(seed))) <= TOLERANCE["area"] * total_area(cut)


def test_the_facets_random_heights_are_a_stream_of_their_own():
    places = np.random.default_rng(0).uniform(-10, 10, (4000, 3))
    first, second = gaussian(places, 3), gaussian(places, 3, stream=1)
    assert abs(np.corrcoef(first, second)[0, 1]) < 4 / np.sqrt(4000)
    assert (gaussian(places, 3) == first).all()


# standing on the ground


def test_the_height_of_the_ground_is_that_of_the_facet_there():
    x, y, z = heights()
    ground = sarcl.Scene.from_heights(x, y, z)
    for i in (0, 1, 3):
        for j in (0, 2, 5):
            assert ground.height_at(x[j], y[i]) == pytest.approx(z[i, j], abs=TOLERANCE["position"])
    tilted = sarcl.Scene.from_heights(x, y, lambda x, y: 0.4 * x - 0.3 * y + 2)
    for at in np.random.default_rng(0).uniform((x[0], y[0]), (x[-1], y[-1]), (50, 2)):
        assert tilted.height_at(*at) == pytest.approx(0.4 * at[0] - 0.3 * at[1] + 2, abs=TOLERANCE["position"])
    with pytest.raises(ValueError, match=r"no facet lies at x -99, y 0 m; the scene reaches from"):
        ground.height_at(-99, 0)
    with pytest.raises(ValueError, match="no facet lies"):
        sarcl.Scene.points([[0, 0, 0]]).height_at(0, 0)


def test_what_stands_on_something_stands_on_its_highest_facet():
    table = sarcl.Scene.from_mesh(box(), position=(0, 0, 3)) + sarcl.Scene.facets(TRIANGLE * 10)
    assert table.height_at(0.1, 0.1) == pytest.approx(4.5)


def test_a_thing_is_put_on_the_ground():
    ground = sarcl.Scene.from_heights([-9, 9], [-9, 9], lambda x, y: 0.1 * x + 5)
    thing = sarcl.Scene.from_mesh(box(), material="wood") + sarcl.Scene.points([[0, 0, 2]])
    placed = thing.on(ground, 4, -3)
    assert placed.bounds == pytest.approx(thing.bounds + np.array([4, -3, 5.4 + 1.5]))
    assert placed.positions == pytest.approx(np.array([[4, -3, 8.9]]))
    sunk = thing.on(ground, 4, -3, depth=0.2)
    assert sunk.bounds[0, 2] == pytest.approx(5.4 - 0.2)
    assert (ground + placed).materials == (METAL, MATERIALS["wood"])
    with pytest.raises(ValueError, match="no facet lies at x 40"):
        thing.on(ground, 40, 0)
    with pytest.raises(TypeError, match=r"ground is a float; wanted a sarcl\.Scene"):
        thing.on(3.0, 0, 0)


# materials


def test_a_number_is_a_perfect_conductor_of_that_reflectivity():
    for material, factor in (("metal", 1), (0.3, 0.3), (1, 1), (np.float64(0.5), 0.5)):
        scene = facets(material=material)
        assert scene.materials == (METAL,) and scene.material == [0] and scene.reflectivity == [factor]


def test_a_materials_own_reflectivity_becomes_the_facets():
    """So that whoever multiplies by scene.reflectivity has it all, once."""
    painted = sarcl.Material(4, reflectivity=0.5, name="painted")
    bare = sarcl.Material(4, name="painted")
    scene = facets(material=painted, reflectivity=0.5)
    assert scene.materials == (bare,) and scene.reflectivity == [0.25]
    by_hand = sarcl.Scene(np.zeros((0, 3)), [], TRIANGLE, [0.5], [0], [True], [0], (painted,))
    assert by_hand.materials == (bare,) and by_hand.reflectivity == [0.25]
    assert dataclasses.replace(by_hand).reflectivity == [0.25]


def test_adding_merges_materials_and_cutting_keeps_them():
    a = facets(soup(2), material=["sand", "metal"])
    b = facets(soup(3), material=["metal", 0.5, "glass"])
    both = a + b + points([[0, 0, 0]])
    assert [both.materials[i].name for i in both.material] == ["sand", "metal", "metal", "metal", "glass"]
    assert len(both.materials) == 3 and both.material.dtype == np.int32
    cut = both.split(1.0)
    share = [areas(cut.triangles)[cut.material == i].sum() for i in range(3)]
    assert share == pytest.approx([areas(both.triangles)[both.material == i].sum() for i in range(3)])


def test_facets_without_area_are_left_out_with_their_material():
    flat = np.array([[[0.0, 0, 0], [1, 1, 1], [2, 2, 2]]])
    scene = facets(np.concatenate([flat, TRIANGLE]), material=["sand", "glass"], reflectivity=[0.1, 0.2])
    assert scene.materials[scene.material[0]].name == "glass" and scene.reflectivity == [0.2]


# adding, and what every scene has


def test_adding_scenes_puts_everything_in_one_in_order():
    a = sarcl.Scene.points([[1, 2, 3]], 2j)
    b = sarcl.Scene.facets(soup(3), material=0.3, roughness=0.1, two_sided=False)
    c = sarcl.Scene.facets(TRIANGLE)
    both = a + b + c
    assert (both.positions == a.positions).all() and (both.amplitudes == 2j).all()
    assert (both.triangles == np.concatenate([b.triangles, TRIANGLE])).all()
    assert (both.reflectivity == [0.3, 0.3, 0.3, 1]).all() and (both.roughness == [0.1, 0.1, 0.1, 0]).all()
    assert (both.two_sided == [False, False, False, True]).all()


def test_a_scene_adds_to_scenes_only():
    with pytest.raises(TypeError, match=r"unsupported operand"):
        sarcl.Scene.facets(TRIANGLE) + 3


def test_the_center_is_that_of_the_box_of_everything():
    scene = sarcl.Scene.points([[-9, 0, 0]]) + sarcl.Scene.facets(TRIANGLE)
    assert (scene.bounds == [[-9, 0, 0], [1, 1, 0]]).all() and (scene.center == [-4, 0.5, 0]).all()


def test_the_callers_arrays_are_neither_frozen_nor_followed():
    positions, amplitudes, triangles = np.ones((2, 3)), np.ones(2, complex), soup(2)
    roughness, two_sided = np.ones(2), np.ones(2, bool)
    made = [
        sarcl.Scene.points(positions, amplitudes)
        + sarcl.Scene.facets(triangles, roughness=roughness, two_sided=two_sided),
        sarcl.Scene(positions, amplitudes, triangles, np.ones(2), roughness, two_sided),
    ]
    before = [array.copy() for array in (positions, amplitudes, triangles, roughness)]
    for array in (positions, amplitudes, triangles, roughness):
        array += 1
    two_sided[:] = False
    for scene in made:
        kept = (scene.positions, scene.amplitudes, scene.triangles, scene.roughness)
        assert all((k == b).all() for k, b in zip(kept, before, strict=True)) and scene.two_sided.all()
        for array in (*kept, scene.reflectivity, scene.two_sided):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0


def test_any_array_of_numbers_makes_the_same_scene():
    triangles = np.round(soup(4))
    turned = np.asfortranarray(triangles)
    for given in (triangles.tolist(), triangles.astype(int), triangles.astype("f4"), turned, triangles[::-1][::-1]):
        scene = sarcl.Scene.facets(given)
        assert (scene.triangles == triangles).all() and scene.triangles.dtype == np.float64
        assert scene.triangles.flags.c_contiguous
    by_hand = sarcl.Scene([[0, 0, 0]], [1], np.zeros((0, 3, 3)), [], [], [])
    assert by_hand.amplitudes.dtype == np.complex128 and by_hand.two_sided.dtype == bool


def facets(triangles=TRIANGLE, **options):
    return sarcl.Scene.facets(triangles, **options)


def terrain(x=(0, 1, 2), y=(0, 1), z=((0, 0, 0), (0, 0, 0)), **options):
    return sarcl.Scene.from_heights(x, y, z, **options)


points = sarcl.Scene.points
BAD = {
    "points of no axis": (lambda: points([0, 0, 0]), r"positions has shape \(3,\), wanted \(n, 3\)"),
    "no points": (lambda: points(np.zeros((0, 3))), "positions is empty"),
    "points not finite": (lambda: points([[0, 0, 0], [np.inf, 0, 0]]), r"positions\[1, 0\] is inf"),
    "amplitudes of other length": (lambda: points([[0, 0, 0]], [1, 2]), r"amplitudes has shape \(2,\), wanted \(1,\)"),
    "amplitudes not finite": (lambda: points([[0, 0, 0]], [np.nan]), r"amplitudes\[0\] is"),
    "amplitude a word": (lambda: points([[0, 0, 0]], "loud"), "amplitudes must be numbers"),
    "positions with gaps": (lambda: points(np.ma.masked_equal([[0, 0, 9]], 9)), "1 values are masked: fill or remove"),
    "one triangle alone": (lambda: facets(TRIANGLE[0]), r"triangles has shape \(3, 3\), wanted \(n_facets, 3, 3\)"),
    "no triangles": (lambda: facets(np.zeros((0, 3, 3))), "triangles is empty"),
    "triangles not finite": (lambda: facets(TRIANGLE * np.nan), r"triangles\[0, 0, 0\] is nan"),
    "materials of other length": (
        lambda: facets(material=["sand", "sand"]),
        r"material has shape \(2,\), wanted one for",
    ),
    "reflectivity above one": (lambda: facets(reflectivity=1.5), "reflectivity must lie between 0 and 1"),
    "place of no material": (
        lambda: sarcl.Scene(np.zeros((0, 3)), [], TRIANGLE, [1], [0], [True], [1], (METAL,)),
        "scene material holds 1; it is an index into materials, 0 to 0",
    ),
    "deviations of other shape": (lambda: terrain(point_roughness=[[0.1]]), r"point_roughness has .* wanted \(2, 3\)"),
    "negative deviation": (lambda: terrain(point_roughness=-0.1), "point_roughness reaches -0.1 m"),
    "deviation not finite": (lambda: terrain(point_roughness=np.nan), "point_roughness is nan"),
    "function of another shape": (lambda: terrain(z=lambda x, y: x[:1]), r"z has shape \(1, 3\), wanted \(2, 3\)"),
    "function not finite": (lambda: terrain(z=lambda x, y: x * np.nan), r"z\[0, 0\] is nan"),
    "seed below zero": (lambda: rough()[0].realized(-1), "seed is -1; it must be at least 0"),
    "all degenerate": (lambda: facets(TRIANGLE * [1, 0, 1]), "all 1 facets are degenerate .*check the mesh"),
    "unknown material": (
        lambda: facets(material="wool"),
        r"material is 'wool'; known are 'metal', .*; or give a sarcl\.Material",
    ),
    "material above one": (lambda: facets(material=1.2), "material is 1.2; an amplitude reflectivity lies between"),
    "material below zero": (lambda: facets(material=-0.1), "material is -0.1; it must be at least 0"),
    "material not finite": (lambda: facets(material=np.nan), "material is nan"),
    "no material": (lambda: facets(material=None), "material must be a number, got None"),
    "negative roughness": (lambda: facets(roughness=-1), r"roughness\[0\] is -1 m; a standard deviation cannot be"),
    "roughness not finite": (lambda: facets(roughness=np.inf), "roughness is inf"),
    "roughness of other length": (lambda: facets(roughness=[1, 2]), r"roughness has shape \(2,\), wanted \(1,\)"),
    "two_sided of other length": (lambda: facets(two_sided=[1, 0]), r"two_sided has shape \(2,\), wanted \(1,\)"),
    "x not increasing": (lambda: terrain(x=(0, 1, 1)), "x must hold at least two increasing values"),
    "y of one value": (lambda: terrain(y=(0,), z=((0, 0, 0),)), "y must hold at least two increasing values"),
    "heights turned": (lambda: terrain(z=np.zeros((3, 2))), r"z has shape \(3, 2\), wanted \(2, 3\)"),
    "height not finite": (lambda: terrain(z=((0, 0, 0), (0, np.nan, 0))), r"z\[1, 1\] is nan"),
    "heights with gaps": (lambda: terrain(z=np.ma.masked_equal([[0, 0, 0], [0, -99, 0]], -99)), "masked: fill"),
    "cell roughness of other shape": (lambda: terrain(roughness=[[1], [2]]), r"roughness has shape .* \(1, 2\)"),
    "cell roughness not finite": (lambda: terrain(roughness=[[0, np.nan]]), r"roughness\[0, 1\] is nan"),
    "no max_edge": (lambda: facets().split(0), "max_edge is 0; it must be greater than 0"),
    "max_edge a word": (lambda: sarcl.Scene.from_mesh(box(), max_edge="auto"), "max_edge must be a number"),
    "no scale": (lambda: sarcl.Scene.from_mesh(box(), scale=0), "scale is 0; it must be greater than 0"),
    "mirror for rotation": (
        lambda: sarcl.Scene.from_mesh(box(), rotation=np.diag([1, 1, -1])),
        "does not rotate: its rows must be orthonormal",
    ),
    "scale in rotation": (lambda: sarcl.Scene.from_mesh(box(), rotation=2 * np.eye(3)), "does not rotate"),
    "four by four": (lambda: sarcl.Scene.from_mesh(box(), rotation=np.eye(4)), r"rotation has shape \(4, 4\)"),
    "two angles": (lambda: sarcl.Scene.from_mesh(box(), rotation=(1, 2)), r"rotation has shape \(2,\)"),
    "rotation not finite": (lambda: sarcl.Scene.from_mesh(box(), rotation=np.inf), "rotation is inf"),
    "flat position": (lambda: sarcl.Scene.from_mesh(box(), position=(0, 0)), r"position has shape \(2,\)"),
    "empty mesh": (lambda: sarcl.Scene.from_mesh(trimesh.Trimesh()), "mesh has no faces; nothing would reflect"),
    "empty scene of meshes": (lambda: sarcl.Scene.from_mesh(trimesh.Scene()), "mesh has no faces"),
    "nothing by hand": (lambda: sarcl.Scene([], [], [], [], [], []), "scene is empty"),
    "number by hand": (lambda: sarcl.Scene(5, [1], [], [], [], []), r"scene positions has shape \(\)"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_scenes_say_what_was_wanted(name):
    make, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        make()


def test_shortest_edges_begin_opposite_the_longest_and_keep_the_normal():
    """Of a needle, the normal is a difference of products that float32 resolves if one of the edges is short."""
    triangles = np.random.default_rng(0).normal(size=(50, 3, 3))
    triangles[:25] = triangles[:25, :1] + np.array([[0, 0, 0], [1, 0, 0], [1, 1e-5, 0]])
    triangles = np.concatenate([np.roll(triangles, i, axis=1) for i in range(3)])
    one, two = shortest_edges(triangles).transpose(0, 2, 1)
    lengths = edges(triangles)
    np.testing.assert_allclose(np.linalg.norm(two - one, axis=1), lengths.max(axis=0), rtol=1e-9)
    shorter = np.sort(lengths, axis=0)[:2]
    np.testing.assert_allclose(np.sort([np.linalg.norm(e, axis=1) for e in (one, two)], axis=0), shorter, rtol=1e-9)
    np.testing.assert_allclose(np.cross(one, two) / np.linalg.norm(np.cross(one, two), axis=1)[:, None],
                               normals(triangles), atol=1e-9)  # fmt: skip
