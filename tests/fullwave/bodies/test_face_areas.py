"""Shares of faces that closed meshes cover: closed forms, several bodies, planes that hold facets."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl import shapes
from sarcl.fullwave.bodies.mesh_lines import mesh_lines
from sarcl.fullwave.lattice import Lattice
from sarcl.scene.triangles import rotation

CELL = 0.1  # m
GRID = Lattice(CELL, (30, 30, 32), np.zeros(3))
ROUNDING = 1e-5  # corners are rounded to 2^-20 cells


def box(low, high):
    low, high = CELL * np.array(low, float), CELL * np.array(high, float)
    return shapes.box(high - low, position=[*(low + high)[:2] / 2, low[2]]).triangles


def in_box(low, high):
    """How much of each face across an axis a box covers, as a function of nodes (n, 3)."""

    def covered(node, axis):
        out = np.ones(len(node))
        for a in range(3):
            if a == axis:
                out *= (node[:, a] >= low[a]) & (node[:, a] <= high[a])
            else:
                out *= np.clip(high[a] - node[:, a], 0, 1) - np.clip(low[a] - node[:, a], 0, 1)
        return out

    return covered


def shares(triangles, axis):
    """Nodes of the faces that are listed, (n, 3), and their covered shares (n,)."""
    found = mesh_lines(GRID, triangles).areas[axis]
    return np.stack(np.unravel_index(found.places, GRID.shape), axis=1), found.covered


FIRST, SECOND = ((8.3, 8.6, 9.2), (19.7, 20.1, 16.9)), ((12.4, 10.5, 11.45), (17.5, 25.3, 14.15))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_box_covers_products_of_its_sides(axis):
    node, covered = shares(box(*FIRST), axis)
    assert np.allclose(covered, in_box(*FIRST)(node, axis), atol=ROUNDING)
    assert len(node) > 100 and ((covered > 0.05) & (covered < 0.95)).sum() > 100


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_bodies_count_once_and_faces_that_two_surfaces_cut_are_left_out(axis):
    node, covered = shares(np.concatenate([box(*FIRST), box(*SECOND)]), axis)
    one, two = in_box(*FIRST)(node, axis), in_box(*SECOND)(node, axis)
    apart = (one == 0) | (one == 1) | (two == 0) | (two == 1)
    assert apart.all()
    assert np.allclose(covered, np.maximum(one, two), atol=ROUNDING)
    alone = sum(len(shares(box(*body), axis)[0]) for body in (FIRST, SECOND))
    assert alone - 40 < len(node) <= alone


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_cavity_is_not_covered(axis):
    hole = (10.2, 11.3, 11.4), (15.6, 16.1, 14.2)
    node, covered = shares(np.concatenate([box(*FIRST), box(*hole)[:, ::-1]]), axis)
    assert np.allclose(covered, in_box(*FIRST)(node, axis) - in_box(*hole)(node, axis), atol=ROUNDING)


def test_on_a_plane_that_holds_facets_the_larger_section_counts():
    """A box that ends where a smaller one begins, on a plane of the grid."""
    low, high = ((8.3, 8.6, 6.5), (19.7, 20.1, 12)), ((10.3, 10.6, 12), (15.7, 16.4, 15.5))
    node, covered = shares(np.concatenate([box(*low), box(*high)]), 2)
    wanted = np.maximum(in_box(*low)(node, 2), in_box(*high)(node, 2))
    at = (node[:, 2] == 12) & (wanted < 1)  # a face within the lower box is closed by its edges
    assert at.sum() > 30 and (node[:, 2] == 13).sum() > 10
    assert np.allclose(covered[at | (node[:, 2] != 12)], wanted[at | (node[:, 2] != 12)], atol=ROUNDING)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_plane_askew_cuts_every_face_to_its_polygon(axis):
    """A box turned about all axes, against points within the faces."""
    turn, centre = rotation(np.array([0.4, 0.7, -0.3])), np.array([1.5, 1.48, 1.61])
    half = np.array([0.6, 0.5, 0.4])
    body = shapes.box(2 * half, position=(0, 0, -half[2])).triangles @ turn.T + centre
    node, covered = shares(body, axis)
    fine = np.stack(np.meshgrid(*[(np.arange(60) + 0.5) / 60] * 2, indexing="ij"), -1).reshape(-1, 2)
    points = np.repeat(node[:, None].astype(float), len(fine), axis=1)
    for m in (1, 2):
        points[:, :, (axis + m) % 3] += fine[:, m - 1]
    inside = (np.abs((CELL * points - centre) @ turn) < half).all(axis=2)
    assert np.abs(inside.mean(axis=1) - covered).max() < 0.02
    assert np.abs(inside.mean(axis=1) - covered).mean() < 0.003
