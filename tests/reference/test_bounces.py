"""The reference of several reflections against closed forms, and against that of single reflections."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.reference.bounces import Reflectors, bounce_echo
from sarcl.reference.facet import facet_echo

F = np.array([9.6e9])
FAR = 1e6


def conductors(triangles: np.ndarray) -> Reflectors:
    k = len(triangles)
    return Reflectors(triangles, np.ones(k, bool), np.full((1, k), np.inf + 0j), np.ones(k), np.zeros(k))


def plates(*quads: list[tuple[float, float, float]]) -> np.ndarray:
    corners = np.array(quads, float)
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


DIHEDRAL = plates(
    [(0, -0.25, 0), (0.5, -0.25, 0), (0.5, 0.25, 0), (0, 0.25, 0)],
    [(0, -0.25, 0), (0, 0.25, 0), (0, 0.25, 0.5), (0, -0.25, 0.5)],
)
TRIHEDRAL = plates(
    [(0, 0, 0), (0.5, 0, 0), (0.5, 0.5, 0), (0, 0.5, 0)],
    [(0, 0, 0), (0, 0.5, 0), (0, 0.5, 0.5), (0, 0, 0.5)],
    [(0, 0, 0), (0, 0, 0.5), (0.5, 0, 0.5), (0.5, 0, 0)],
)


@pytest.mark.parametrize(("angle", "expected"), [(45, 32.070), (35, 30.252), (25, 27.599), (60, 29.060)])
def test_two_reflections_of_a_dihedral_have_their_closed_form(angle, expected):
    t = np.radians(angle)
    tx = FAR * np.array([np.cos(t), 0, np.sin(t)])
    two = bounce_echo(conductors(DIHEDRAL), F, (tx, tx), FAR, bounces=2)[1, 0]
    assert np.allclose(20 * np.log10(np.abs(np.diag(two))), expected, atol=1e-3)
    assert np.allclose(np.angle(np.diag(two) * [-1, 1]), 0, atol=1e-3)
    assert abs(two[0, 1]) < 1e-6 * abs(two[0, 0])


@pytest.mark.parametrize(("azimuth", "elevation", "expected"), [(45, 15, 26.862), (25, 35.2644, 28.504)])
def test_three_reflections_of_a_trihedral_have_their_closed_form(azimuth, elevation, expected):
    a, e = np.radians([azimuth, elevation])
    tx = FAR * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    three = bounce_echo(conductors(TRIHEDRAL), F, (tx, tx), FAR, bounces=3)[2, 0]
    assert np.allclose(20 * np.log10(np.abs(np.diag(three))), expected, atol=2e-3)


def test_one_reflection_is_that_of_the_facet_reference():
    rng = np.random.default_rng(0)
    triangle = rng.normal(size=(1, 3, 3))
    normal = np.cross(triangle[0, 1] - triangle[0, 0], triangle[0, 2] - triangle[0, 0])
    tx, rx = triangle[0].mean(axis=0) + 20 * (normal / np.linalg.norm(normal) + 0.3 * rng.normal(size=(2, 3)))
    f = np.array([1e9, 1.1e9])
    eps = np.full((2, 1), 4 - 0.3j)
    scene = Reflectors(triangle, np.zeros(1, bool), eps, np.ones(1), np.zeros(1))
    one = bounce_echo(scene, f, (tx, rx), 20.0, bounces=1)[0]
    assert np.allclose(one, facet_echo(triangle, eps, f, tx, rx, 20.0), rtol=1e-8, atol=1e-12)


def test_what_lies_in_the_way_takes_its_part():
    """A screen before a dihedral, square to the line of sight, over half of the width: it hides the plates up to 0.2 m
    from the fold, of 0.5 m, as rays arrive and as they leave. A fifth of the amplitude is lost."""
    t = np.radians(45)
    tx = FAR * np.array([np.cos(t), 0, np.sin(t)])
    screen = plates([(0.3, -0.25, 0.1), (0.3, 0.0, 0.1), (0.1, 0.0, 0.3), (0.1, -0.25, 0.3)])
    reflectivity = np.array([1.0] * 4 + [0.0] * 2)
    dark = Reflectors(
        np.concatenate([DIHEDRAL, screen]), np.ones(6, bool), np.full((1, 6), np.inf + 0j), reflectivity, np.zeros(6)
    )
    free = bounce_echo(conductors(DIHEDRAL), F, (tx, tx), FAR, bounces=2)[1, 0, 1, 1]
    blocked = bounce_echo(dark, F, (tx, tx), FAR, bounces=2)[1, 0, 1, 1]
    assert np.isclose(blocked / free, 0.8, atol=1e-4)
