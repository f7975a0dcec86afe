"""Parametric shapes: exact dimensions, closed, facing outwards, as fine as asked."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from sarcl import shapes
from sarcl.scene.material import MATERIALS
from sarcl.scene.triangles import areas, centroids, edges, normals

TOLERANCE = {"float64": 1e-12}  # sums of some thousand terms, relative

N = 12  # sections: a prism, a pyramid, a truncated pyramid over a regular polygon
POLYGON = N / 2 * np.sin(2 * np.pi / N)  # its area for radius 1
APOTHEM = np.cos(np.pi / N)
SIDE = 2 * np.sin(np.pi / N)


def lateral(bottom, top, height):
    """Area of N trapezoids between polygons of radii bottom and top."""
    slant = np.hypot(height, APOTHEM * (bottom - top))
    return N * SIDE * (bottom + top) / 2 * slant


# name -> (scene, volume, area, lower and upper corner)
SOLIDS = {
    "box": (lambda **o: shapes.box((1, 2, 3), **o), 6, 22, ((-0.5, -1, 0), (0.5, 1, 3))),
    "cylinder": (
        lambda **o: shapes.cylinder(2, 3, sections=N, **o),
        3 * 4 * POLYGON, 2 * 4 * POLYGON + lateral(2, 2, 3), ((-2, -2, 0), (2, 2, 3)),
    ),
    "cone": (
        lambda **o: shapes.cone(2, 3, sections=N, **o),
        4 * POLYGON, 4 * POLYGON + lateral(2, 0, 3), ((-2, -2, 0), (2, 2, 3)),
    ),
    "frustum": (
        lambda **o: shapes.frustum(2, 1, 3, sections=N, **o),
        (4 + 2 + 1) * POLYGON, 5 * POLYGON + lateral(2, 1, 3), ((-2, -2, 0), (2, 2, 3)),
    ),
}  # fmt: skip


def mesh(scene):
    return trimesh.Trimesh(**trimesh.triangles.to_kwargs(scene.triangles))


@pytest.mark.parametrize("edge", [None, 0.4])
@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_has_its_dimensions_and_is_closed_and_faces_outwards(name, edge):
    make, volume, area, corners = SOLIDS[name]
    scene = make(edge=edge)
    assert mesh(scene).is_watertight and mesh(scene).is_winding_consistent
    assert mesh(scene).volume == pytest.approx(volume, rel=TOLERANCE["float64"])  # positive: outwards
    assert areas(scene.triangles).sum() == pytest.approx(area, rel=TOLERANCE["float64"])
    assert scene.bounds == pytest.approx(np.array(corners), abs=TOLERANCE["float64"])
    assert not scene.two_sided.any()
    if edge:
        assert edges(scene.triangles).max() <= edge


def test_round_solids_converge_to_the_round_ones_as_the_square_of_the_sections():
    exact = {"cylinder": 12 * np.pi, "cone": 4 * np.pi, "frustum": 7 * np.pi}
    made = {
        "cylinder": lambda n: shapes.cylinder(2, 3, sections=n),
        "cone": lambda n: shapes.cone(2, 3, sections=n),
        "frustum": lambda n: shapes.frustum(2, 1, 3, sections=n),
    }
    for name, volume in exact.items():
        short = [1 - mesh(made[name](n)).volume / volume for n in (40, 80)]
        assert short[1] < 1.1e-3 and short[0] / short[1] == pytest.approx(4, rel=0.01)


@pytest.mark.parametrize("options", [{}, {"edge": 0.5}, {"sections": 8}, {"size": (1.916, 0.802, 0.402)}])
def test_a_tank_has_its_size_and_is_made_of_closed_bodies_that_face_outwards(options):
    scene = shapes.tank(**options)
    size = np.array(options.get("size", (9.58, 4.01, 4.02)))  # Zou et al. 2021, table 2
    assert scene.bounds == pytest.approx(np.array([[-0.5, -0.5, 0], [0.5, 0.5, 1]]) * size, abs=1e-12)
    tank = mesh(scene)
    assert tank.is_watertight and tank.is_winding_consistent
    bodies = tank.split()
    assert len(bodies) == 12 and all(body.is_watertight and body.volume > 0 for body in bodies)
    if "edge" in options:
        assert edges(scene.triangles).max() <= options["edge"]


def test_a_tanks_plane_parts_have_the_volume_of_their_outlines():
    """Of bodies between two planes across the tank, whose outlines are convex: its area times their distance."""
    parts = [body for body in mesh(shapes.tank()).split() if len(np.unique(body.vertices[:, 1].round(9))) == 2]
    assert len(parts) == 8
    for body in parts:
        y = body.vertices[:, 1]
        area = ConvexHull(body.vertices[y > y.mean()][:, ::2]).volume
        assert body.volume == pytest.approx(area * np.ptp(y), rel=1e-9) and area > 0.1


def test_few_facets_where_flat():
    assert len(shapes.plate((1, 2)).triangles) == 2 and len(shapes.box((1, 2, 3)).triangles) == 12
    assert len(shapes.cylinder(1, 2, sections=10).triangles) == 40
    assert len(shapes.frustum(3, 2, 1, sections=4).triangles) == 16  # a truncated pyramid


@pytest.mark.parametrize("facets, made", [(20, 20), (21, 80), (2000, 2000), (2001, 2420)])
def test_a_sphere_has_at_least_so_many_facets_of_like_size(facets, made):
    scene = shapes.sphere(3, facets=facets)
    assert len(scene.triangles) == made
    assert mesh(scene).is_watertight and mesh(scene).is_winding_consistent and mesh(scene).volume > 0
    assert areas(scene.triangles).max() < 2.1 * areas(scene.triangles).min()
    radius = np.linalg.norm(scene.triangles, axis=-1)
    assert np.abs(radius / 3 - 1).max() <= TOLERANCE["float64"]
    out = (normals(scene.triangles) * centroids(scene.triangles)).sum(axis=1)
    assert (out > 0).all()


def test_a_sphere_of_an_edge_is_as_fine_as_asked_and_not_much_finer():
    for edge in (5, 1, 0.3, 0.11):
        longest = edges(shapes.sphere(2, edge=edge).triangles).max()
        assert 0.6 * edge < longest <= edge or longest == pytest.approx(2 * 1.0514622, rel=1e-6)  # an icosahedron's


def test_a_spheres_corners_are_the_same_to_the_last_bit_on_both_sides_of_every_edge():
    corners = shapes.sphere(1, facets=5000).triangles.reshape(-1, 3)
    assert len(np.unique(corners, axis=0)) == 5120 // 2 + 2  # Euler: V = F/2 + 2


def test_open_shapes_face_up_and_reflect_from_both_sides():
    for scene, area in ((shapes.plate((2, 3)), 6), (shapes.disc(2, sections=N), 4 * POLYGON)):
        assert areas(scene.triangles).sum() == pytest.approx(area, rel=TOLERANCE["float64"])
        assert (normals(scene.triangles) == (0, 0, 1)).all() and scene.two_sided.all()
    assert not shapes.plate((1, 1), two_sided=False).two_sided.any()
    assert shapes.plate((2, 3)).bounds.tolist() == [[-1, -1.5, 0], [1, 1.5, 0]]


def test_shapes_are_turned_then_moved_and_take_what_facets_take():
    scene = shapes.box((1, 2, 3), rotation=np.pi / 2, position=(10, 20, 30), material="concrete", roughness=0.1)
    assert scene.bounds == pytest.approx(np.array([[9, 19.5, 30], [11, 20.5, 33]]))
    assert scene.materials == (MATERIALS["concrete"],) and (scene.roughness == 0.1).all()
    each = shapes.box((1, 1, 1), material=["metal"] * 4 + ["wood"] * 8)
    assert [each.materials[i].name for i in each.material] == ["metal"] * 4 + ["wood"] * 8


def test_papers_scene_parallelepiped_on_cylinder_with_a_cone_beside_it():
    ground = shapes.plate((60, 60), edge=10, two_sided=False, material="dry soil")
    tower = shapes.cylinder(5, 4).on(ground, -8, 0)
    top = shapes.box((4, 4, 6)).on(tower, -8, 0)
    scene = ground + tower + top + shapes.cone(4, 7, material="wet soil").on(ground, 9, 3)
    assert top.bounds[:, 2] == pytest.approx([4, 10])
    assert scene.bounds[:, 2] == pytest.approx([0, 10])
    assert [m.name for m in scene.materials] == ["dry soil", "metal", "wet soil"]


BAD = {
    "no radius": (lambda: shapes.cylinder(0, 1), "radius is 0; it must be greater than 0"),
    "negative height": (lambda: shapes.cone(1, -1), "height is -1"),
    "no top": (lambda: shapes.frustum(1, 0, 1), "top is 0"),
    "flat box": (lambda: shapes.box((1, 0, 1)), r"size\[1\] is 0"),
    "box of two": (lambda: shapes.box((1, 1)), r"size has shape \(2,\), wanted \(3,\)"),
    "nan": (lambda: shapes.sphere(np.nan), "radius is nan"),
    "short tank": (lambda: shapes.tank((9.58, 0, 4.02)), r"size\[1\] is 0"),
    "two sections": (lambda: shapes.cylinder(1, 1, sections=2), "sections is 2; it must be at least 3"),
    "no edge": (lambda: shapes.box((1, 1, 1), edge=0), "edge is 0"),
    "edge and facets": (lambda: shapes.sphere(1, edge=0.1, facets=100), "edge or facets, not both"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_dimensions_are_named(name):
    make, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("make", [lambda e: shapes.sphere(1, edge=e), lambda e: shapes.cone(1, 1, edge=e)])
def test_too_many_facets_are_refused_before_they_are_made(make):
    with pytest.raises(MemoryError, match="take a larger"):
        make(1e-4)
