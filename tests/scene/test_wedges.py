"""Edges of meshes: convex ones and borders are found, flat, hollow and creased ones are not."""

import numpy as np
import pytest

from sarcl import Scene, shapes
from sarcl.scene.wedges import wedges

CREASE = 0.35


def found(scene, crease=CREASE):
    return wedges(scene.triangles, scene.two_sided, crease)


def length(edges):
    return np.linalg.norm(edges.ends[:, 1] - edges.ends[:, 0], axis=1).sum()


@pytest.mark.parametrize("rotation", [None, (0.3, -0.5, 1.1)])
def test_a_box_has_twelve_right_angles(rotation):
    edges = found(shapes.box((1, 2, 3), rotation=rotation, position=(1e3, -20, 7)))
    assert len(edges) == 12
    assert length(edges) == pytest.approx(24)
    assert edges.number == pytest.approx(np.full(12, 1.5))


def test_frames_stand_on_their_edges_and_look_outwards():
    edges = found(shapes.box((1, 2, 3)))
    way = edges.ends[:, 1] - edges.ends[:, 0]
    tangent = np.cross(edges.inward, edges.normal)
    assert np.abs(np.cross(tangent, way)).max() < 1e-12
    assert np.abs((edges.inward * way).sum(axis=1)).max() < 1e-12
    middle = edges.ends.mean(axis=1) - [0, 0, 1.5]
    assert (edges.normal * middle).sum(axis=1).min() > 0.4  # outwards
    assert (edges.inward * middle).sum(axis=1).max() < -0.4  # face 1 runs inwards from its edge
    for angle in (0.25, 0.75, 1.25):  # directions outside of the body, by 1 mm
        at = edges.ends.mean(axis=1) + 1e-3 * (
            np.cos(angle * np.pi) * edges.inward + np.sin(angle * np.pi) * edges.normal
        )
        assert (np.abs(at - [0, 0, 1.5]) > [0.5, 1, 1.5]).any(axis=1).all()


def test_the_border_of_a_sheet_is_an_edge_of_two_pi():
    edges = found(shapes.plate((1, 2)))
    assert len(edges) == 4
    assert length(edges) == pytest.approx(6)
    assert (edges.number == 2).all()
    assert (edges.faces[:, 0] == edges.faces[:, 1]).all()


def test_curves_have_no_edges_and_rims_do():
    cylinder = shapes.cylinder(1, 2, sections=72)
    assert length(found(cylinder)) == pytest.approx(2 * 72 * 2 * np.sin(np.pi / 72))
    assert len(found(cylinder, crease=0.08)) == 144 + 72  # 0.087 rad between the sides
    assert len(found(shapes.sphere(1))) == 0


def test_hollow_edges_of_solids_are_none():
    """A groove: a prism of an L has six edges along it, of which one is hollow."""
    corner = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], float)
    sides = [[[*corner[i], 0], [*corner[(i + 1) % 6], 0], [*corner[(i + 1) % 6], 1], [*corner[i], 1]] for i in range(6)]
    triangles = [[s[i] for i in t] for s in sides for t in ((0, 1, 2), (0, 2, 3))]
    edges = wedges(np.array(triangles), np.zeros(12, bool), CREASE)
    upright = np.abs(edges.ends[:, 1, 2] - edges.ends[:, 0, 2]) > 0.5
    assert upright.sum() == 5
    assert not (edges.ends[upright][:, 0, :2] == [1, 1]).all(axis=1).any()


def test_folded_sheets_have_an_edge_on_their_outer_side_alone():
    sheets = shapes.plate((1, 1)) + shapes.plate((1, 1), rotation=(np.pi / 2, 0, 0), position=(0, 0.5, 0.5))
    edges = found(sheets)
    fold = edges.number < 2
    assert fold.sum() == 1
    assert edges.number[fold] == pytest.approx([1.5])
    assert length(edges) == pytest.approx(1 + 6)


def square(x, y, size):
    corner = np.array([(x, y, 0), (x + size, y, 0), (x + size, y + size, 0), (x, y + size, 0)], float)
    return corner[[[0, 1, 2], [0, 2, 3]]]


@pytest.mark.parametrize("gap", [0.0, 1e-7])
def test_sides_that_end_on_a_side_are_joined_to_it(gap):
    """One square of 2 m beside two of 1 m: a T-junction, with corners that differ by rounding."""
    flat = np.concatenate([square(0, 0, 2), square(2 + gap, 0, 1), square(2 + gap, 1, 1)])
    edges = found(Scene.facets(flat))
    assert length(edges) == pytest.approx(2 + 2 + 2 + 1 + 1 + 2, abs=1e-5)  # the border alone
    turned = flat.copy()
    turned[2:, :, 2], turned[2:, :, 0] = flat[2:, :, 0] - 2, 2
    edges = found(Scene.facets(turned))
    assert length(edges) == pytest.approx(12, abs=1e-5)
    assert sorted(edges.number[edges.number < 2]) == pytest.approx([1.5, 1.5])


def test_a_box_on_a_box_keeps_its_own_edges():
    edges = found(shapes.box((2, 2, 1)) + shapes.box((1, 1, 1), position=(0, 0, 1)))
    assert length(edges) == pytest.approx(20 + 12)
    assert edges.number == pytest.approx(np.full(len(edges), 1.5))


def test_a_sheet_of_two_coincident_faces_has_borders_of_two_pi():
    plate = shapes.plate((1, 1)).triangles
    both = np.concatenate([plate, plate[:, ::-1]])
    edges = wedges(both, np.zeros(4, bool), CREASE)
    assert length(edges) == pytest.approx(4)
    assert edges.number == pytest.approx(np.full(4, 2.0))


def test_separate_facets_and_slivers():
    sliver = np.array([[[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0]], [[5, 0, 0], [6, 0, 0], [5, 1, 0]]], float)
    edges = wedges(sliver, np.ones(2, bool), CREASE)
    assert np.isfinite(edges.ends).all()
    assert np.isfinite(edges.inward).all()
    assert length(edges) == pytest.approx(2 + np.sqrt(2) + 2, rel=0.3)
