"""Borders of flat faces that face each other."""

import numpy as np
import pytest

from sarcl import shapes
from sarcl.scene.facing_borders import facing_borders
from sarcl.scene.wedges import wedges

X, _, Z = np.eye(3)


def found(triangles, two_sided=True):
    triangles = np.asarray(triangles, float)
    return facing_borders(triangles, wedges(triangles, np.full(len(triangles), two_sided), 0.35))


def fan(ring):
    """Facets of a convex polygon in the plane z = 0."""
    ring = np.concatenate([ring, np.zeros((len(ring), 1))], axis=1)
    return np.array([[ring[0], ring[i], ring[i + 1]] for i in range(1, len(ring) - 1)])


@pytest.mark.parametrize(
    ("scene", "count"),
    [
        (shapes.plate((1, 0.7)), 4),  # two on each side
        (shapes.plate((1, 0.7)).split(0.1), 4),
        (shapes.box((1, 0.7, 0.5)), 12),
        (shapes.box((1, 0.7, 0.5)).split(0.2), 12),
        (shapes.trihedral(1.0), 0),  # borders of triangles meet
    ],
)
def test_pairs_of_bodies(scene, count):
    borders = facing_borders(scene.triangles, wedges(scene.triangles, scene.two_sided, 0.35))
    assert len(borders) == count


def test_borders_are_lines_in_the_face_between_the_corners_of_the_plate():
    borders = found(shapes.plate((1, 0.7)).split(0.1).triangles)
    for ends, (x1, x2, normal, n, m) in borders:
        assert (n, m) == (2, 2)
        assert x1 == pytest.approx(-x2)
        assert abs(normal[2]) == pytest.approx(1)
        for line, x in zip(ends, (x1, x2), strict=True):
            way = line[1] - line[0]
            assert way == pytest.approx(np.cross(x, normal) * np.linalg.norm(way))
            assert np.abs(line) == pytest.approx(np.tile([0.5, 0.35, 0], (2, 1)))
            assert line.mean(axis=0) @ x < 0
    assert sorted(np.round(np.linalg.norm(np.diff(ends, axis=1), axis=2).max(), 6) for ends, _ in borders) == [
        0.7,
        0.7,
        1,
        1,
    ]
    lengths = np.bincount(borders.border)
    assert len(lengths) == 8
    assert lengths.sum() == 2 * len(wedges(shapes.plate((1, 0.7)).split(0.1).triangles, np.ones(384, bool), 0.35))


@pytest.mark.parametrize(("angle", "count"), [(0.0, 4), (0.2, 4), (0.45, 4), (0.55, 2)])
def test_borders_that_are_not_parallel(angle, count):
    ring = np.array([[0, 0], [1, 0], [1, 1 + np.tan(angle)], [0, 1]])
    assert len(found(fan(ring))) == count


def test_faces_that_are_not_convex_or_have_holes_have_none():
    square = shapes.plate((1, 1)).triangles
    three = np.concatenate([square + np.array(place) for place in ((0, 0, 0), (1, 0, 0), (0, 1, 0))])
    assert len(found(three)) == 0
    ring = [(i, j, 0) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    assert len(found(np.concatenate([square + np.array(place) for place in ring]))) == 0
    assert len(found(np.concatenate([square + np.array((*place[:2], 0.5 * place[0])) for place in ring[:1]]))) == 4


def test_faces_that_meet_in_a_hollow_edge_have_no_border_there():
    floor, wall = shapes.plate((1, 1)).triangles, shapes.plate((1, 1)).triangles[..., [2, 1, 0]]
    corner = np.concatenate([floor + X / 2, wall + Z / 2])
    assert len(found(corner, two_sided=True)) == 6  # behind, the fold is an edge


def test_no_facets():
    assert len(found(np.zeros((0, 3, 3)))) == 0
