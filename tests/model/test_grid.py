"""Grids: pixel [i, j] = center + (i - n//2) dy y + (j - m//2) dx x, its inverse, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl

TOLERANCE = {
    "position": 1e-12,  # float64, relative to the largest coordinate
    "index": 1e-9,  # pixels; positions 7000 km from the origin are multiples of 1e-9 m, pixels here are >= 0.1 m
}

PLANES = {
    "ground": {"shape": (5, 8), "spacing": (0.2, 0.1)},
    "one number for both": {"shape": 7, "spacing": 0.5},
    "one pixel": {"shape": (1, 1), "spacing": (1, 2), "center": (3, -4, 5)},
    "upright": {"shape": (4, 3), "spacing": (1, 2), "normal": (1, 0, 0)},
    "tilted": {"shape": (6, 5), "spacing": (0.3, 2), "normal": (1, 2, 3), "x_axis": (0, 1, 0), "center": (1, 2, 3)},
    "downwards": {"shape": (4, 4), "spacing": 1, "normal": (0, 0, -2)},
    "on the Earth": {"shape": (33, 32), "spacing": 1.0, "center": (4.2e6, 1.7e5, 4.78e6), "normal": (4.2, 0.17, 4.78)},
}  # fmt: skip


@pytest.mark.parametrize("name", PLANES)
def test_pixel_i_j_lies_where_the_formula_says(name):
    grid = sarcl.ImageGrid.plane(**PLANES[name])
    (n, m), (dy, dx) = grid.shape, grid.spacing
    positions = grid.positions
    assert positions.shape == (n, m, 3) and positions.dtype == np.float64
    for i in range(n):
        for j in range(m):
            wanted = grid.center + (i - n // 2) * dy * grid.y_axis + (j - m // 2) * dx * grid.x_axis
            assert np.abs(positions[i, j] - wanted).max() <= TOLERANCE["position"] * (1 + np.abs(wanted).max())


@pytest.mark.parametrize("name", PLANES)
def test_the_axes_and_the_normal_are_orthonormal_and_right_handed(name):
    grid = sarcl.ImageGrid.plane(**PLANES[name])
    axes = np.stack([grid.x_axis, grid.y_axis, grid.normal])
    assert np.abs(axes @ axes.T - np.eye(3)).max() <= TOLERANCE["position"]
    assert np.linalg.det(axes) == pytest.approx(1)
    wanted = np.array(PLANES[name].get("normal", (0, 0, 1)), float)
    assert np.abs(grid.normal - wanted / np.linalg.norm(wanted)).max() <= TOLERANCE["position"]


def test_columns_run_along_x_and_rows_along_y_of_a_level_plane():
    grid = sarcl.ImageGrid.plane(shape=(5, 8), spacing=(0.2, 0.1))
    assert (grid.x_axis == (1, 0, 0)).all() and (grid.y_axis == (0, 1, 0)).all()
    assert grid.positions[2, 4] == pytest.approx([0, 0, 0])
    assert grid.positions[4, 0] == pytest.approx([-0.4, 0.4, 0])


def test_columns_run_along_y_where_x_is_the_normal():
    grid = sarcl.ImageGrid.plane(shape=(2, 2), spacing=1, normal=(2, 0, 0))
    assert (grid.x_axis == (0, 1, 0)).all() and (grid.y_axis == (0, 0, 1)).all()


def test_x_axis_is_projected_on_the_plane():
    grid = sarcl.ImageGrid.plane(shape=(2, 2), spacing=1, x_axis=(3, 4, 100))
    assert grid.x_axis == pytest.approx([0.6, 0.8, 0])


@pytest.mark.parametrize("length", [1e-200, 1e-3, 1e200])
def test_the_length_of_a_direction_does_not_matter(length):
    grid = sarcl.ImageGrid.plane(shape=2, spacing=1, normal=(0, 0, length), x_axis=(0, length, 0))
    assert (grid.normal == (0, 0, 1)).all() and (grid.x_axis == (0, 1, 0)).all()


@pytest.mark.parametrize("name", PLANES)
def test_index_is_the_inverse_of_at(name):
    grid = sarcl.ImageGrid.plane(**PLANES[name])
    random = np.random.default_rng(0)
    row, column = random.uniform(-50, 50, (2, 4, 6))
    back = grid.index(grid.at(row, column))
    assert back.shape == (4, 6, 2)
    assert np.abs(back - np.stack([row, column], axis=-1)).max() <= TOLERANCE["index"] / min(grid.spacing) * 50
    assert np.abs(grid.index(grid.positions[0, -1]) - (0, grid.shape[1] - 1)).max() <= 5e-8


def test_index_projects_what_is_above_the_plane():
    grid = sarcl.ImageGrid.plane(shape=(5, 8), spacing=(0.2, 0.1))
    assert grid.index((0.3, -0.2, 77)) == pytest.approx([1, 7])


def test_at_takes_numbers_lists_and_arrays_that_broadcast():
    grid = sarcl.ImageGrid.plane(shape=(5, 8), spacing=(0.2, 0.1))
    assert grid.at(2, 4).shape == (3,) and grid.at([0, 1], [2, 3]).shape == (2, 3)
    assert (grid.at(np.arange(5)[:, None], np.arange(8)) == grid.positions).all()


@pytest.mark.parametrize("name", PLANES)
def test_bounds_hold_every_pixel_tightly(name):
    grid = sarcl.ImageGrid.plane(**PLANES[name])
    listed = grid.positions.reshape(-1, 3)
    wanted = np.stack([listed.min(axis=0), listed.max(axis=0)])
    assert np.abs(grid.bounds - wanted).max() <= TOLERANCE["position"] * (1 + np.abs(wanted).max())
    assert (sarcl.ImageGrid.points(grid.positions).bounds == wanted).all()


@pytest.mark.parametrize("shape", [(4,), (2, 3), (2, 3, 4), (1, 1)])
def test_points_take_any_shape(shape):
    positions = np.random.default_rng(0).standard_normal((*shape, 3))
    grid = sarcl.ImageGrid.points(positions)
    assert grid.shape == shape and grid.size == np.prod(shape) and not grid.is_plane
    assert (grid.positions == positions).all()


def test_any_array_of_numbers_makes_the_same_points():
    positions = np.arange(24.0).reshape(2, 4, 3)
    for given in (positions.tolist(), positions.astype(int), positions.astype("f4"), np.asfortranarray(positions),
                  positions[::-1, ::-1].copy()[::-1, ::-1]):  # fmt: skip
        grid = sarcl.ImageGrid.points(given)
        assert (grid.positions == positions).all() and grid.positions.flags.c_contiguous


def test_a_grid_larger_than_any_memory_is_only_numbers():
    grid = sarcl.ImageGrid.plane(shape=(10**10, 10**10), spacing=1e-3)
    assert grid.size == 10**20
    assert np.abs(grid.index(grid.at(10**10 - 1, 7)) - (10**10 - 1, 7)).max() <= 1e-3


def test_the_callers_arrays_are_neither_frozen_nor_followed():
    center, positions = np.ones(3), np.ones((2, 3))
    plane, points = sarcl.ImageGrid.plane(shape=2, spacing=1, center=center), sarcl.ImageGrid.points(positions)
    center += 1
    positions += 1
    assert (plane.center == 1).all() and (points.positions == 1).all()
    for array in (plane.center, plane.x_axis, plane.y_axis, points.positions):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5


def plane(**changed):
    return sarcl.ImageGrid.plane(**{"shape": (5, 8), "spacing": 1, **changed})


points = sarcl.ImageGrid.points
BAD = {
    "no rows": (lambda: plane(shape=(0, 3)), r"shape\[0\] is 0; it must be at least 1"),
    "half a column": (lambda: plane(shape=(3, 2.5)), r"shape\[1\] must be a whole number, got 2.5"),
    "three axes": (lambda: plane(shape=(3, 4, 5)), r"shape is \(3, 4, 5\); wanted \(row, column\)"),
    "a word for shape": (lambda: plane(shape="ab"), r"shape\[0\] must be a whole number, got 'ab'"),
    "no spacing": (lambda: plane(spacing=0), r"spacing\[0\] is 0; it must be greater than 0"),
    "negative spacing": (lambda: plane(spacing=(1, -1)), r"spacing\[1\] is -1"),
    "three spacings": (lambda: plane(spacing=(1, 2, 3)), r"spacing is \(1, 2, 3\)"),
    "spacing not finite": (lambda: plane(spacing=np.nan), r"spacing\[0\] is nan"),
    "no normal": (lambda: plane(normal=(0, 0, 0)), r"normal is \(0, 0, 0\); a direction needs a length"),
    "x_axis along the normal": (
        lambda: plane(x_axis=np.array([0, 0, 2])),
        r"x_axis \(0, 0, 2\) is along the normal \(0, 0, 1\); give one that lies in the plane",
    ),
    "flat center": (lambda: plane(center=(0, 0)), r"center has shape \(2,\), wanted \(3,\)"),
    "center not finite": (lambda: plane(center=(0, np.inf, 0)), r"center\[1\] is inf"),
    "complex center": (lambda: plane(center=np.ones(3) * 1j), "center must be numbers that fit float64"),
    "one position": (lambda: points([0, 0, 0]), r"positions has shape \(3,\), wanted \(\.\.\., 3\)"),
    "positions of two coordinates": (lambda: points(np.zeros((4, 2))), r"positions has shape \(4, 2\)"),
    "no positions": (lambda: points(np.zeros((0, 3))), r"positions has shape \(0, 3\), wanted"),
    "ragged positions": (lambda: points([[0, 0, 0], [1, 2]]), "positions is .* whose rows differ in length"),
    "positions not finite": (lambda: points([[[0, 0, 0], [0, 0, np.nan]]]), r"positions\[0, 1, 2\] is nan"),
    "neither": (lambda: sarcl.ImageGrid((4, 4)), "ImageGrid.plane or ImageGrid.points"),
    "positions of another shape": (
        lambda: sarcl.ImageGrid((2,), listed=np.zeros((3, 3))),
        r"listed has shape \(3, 3\), wanted \(2, 3\)",
    ),
    "positions of no shape": (
        lambda: sarcl.ImageGrid((1,), listed=np.zeros((0, 3))),
        r"listed has shape \(0, 3\), wanted \(1, 3\)",
    ),
    "ragged list": (lambda: sarcl.ImageGrid((2,), listed=[[0, 0, 0], [1, 2]]), "listed is .* whose rows differ"),
    "normal of points": (lambda: points(np.zeros((1, 3))).normal, "normal is for planes"),
    "index in points": (lambda: points(np.zeros((1, 3))).index((0, 0, 0)), "index is for planes"),
    "at in points": (lambda: points(np.zeros((1, 3))).at(0, 0), "at is for planes"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_grids_say_what_was_wanted(name):
    make, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        make()


def test_the_spacing_and_the_normal_of_a_zero_doppler_grid_are_those_of_its_positions():
    x, y = np.meshgrid(2.0 * np.arange(6), 3.0 * np.arange(5))
    grid = sarcl.ImageGrid.zero_doppler(np.arange(5) / 100, 7e5 + np.arange(6), np.stack([x, y, 0 * x], axis=-1))
    for pixel in ((0, 0), (2, 3), (4, 5)):
        assert grid.spacing_at(*pixel) == pytest.approx((3, 2))
        assert grid.normal_at(*pixel) == pytest.approx((0, 0, 1))
