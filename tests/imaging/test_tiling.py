"""Tilings: every kind of grid in tiles, by the same methods, whatever is made at a time."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.imaging.tiling.of_grid import tiling_of
from sarcl.model.image_grid import ImageGrid

PLANE = ImageGrid.plane(center=(3, 1, 2), shape=(37, 91), spacing=(0.3, 0.2), normal=(0.1, 0.2, 1))
CELLS = np.random.default_rng(0).uniform(-5, 5, (40, 50, 3))
HOLED = CELLS.copy()
HOLED[3:9] = np.nan
GRIDS = {"plane": PLANE, "points": ImageGrid.points(CELLS), "points and empty cells": ImageGrid.points(HOLED)}


@pytest.fixture(params=GRIDS)
def tiling(request):
    made = tiling_of(GRIDS[request.param], 8, listed=700)
    made.source = GRIDS[request.param]
    return made


def flat_of(tiling, values=np.nan):
    rows = tiling.extent(0, tiling.n_bands).stop
    return np.full((rows, *tiling.row_shape), values)


def expected(tiling, component):
    """A coordinate of the pixels as a flat image; 0 in empty cells."""
    return np.nan_to_num(tiling.source.positions[..., component]).reshape(-1, *tiling.row_shape)


def test_bands_are_all_pixels_once(tiling):
    covered = flat_of(tiling, 0)
    for band in range(tiling.n_bands):
        covered[tiling.extent(band, band + 1)] += 1
    assert (covered == 1).all()
    assert (
        sum(tiling.count(b, b + 1) for b in range(tiling.n_bands))
        == tiling.source.size
        == tiling.count(0, tiling.n_bands)
    )
    empty = 0 if tiling.source.empty is None else tiling.source.empty.sum()
    assert tiling.tile_sizes(0, tiling.n_bands).sum() == tiling.source.size - empty


def test_values_are_placed_where_their_positions_are(tiling):
    run = (0, tiling.n_bands)
    orders = tiling.bands(*run)[1]
    positions, flat = tiling.positions(*run, orders), flat_of(tiling)
    tiling.place(positions[..., 0].ravel(), run, 0, orders, flat)
    assert np.array_equal(flat, expected(tiling, 0))


def test_some_tiles_of_a_band_at_a_time_are_placed_as_all_at_once(tiling):
    flat = flat_of(tiling)
    for band in range(tiling.n_bands):
        run = (band, band + 1)
        tiles, orders = tiling.bands(*run)
        values = tiling.positions(*run, orders)[..., 1]
        for start in range(0, tiles.n_tiles, 3):
            tiling.place(values[start : start + 3].ravel(), run, start, orders, flat)
    assert np.array_equal(flat, expected(tiling, 1))


def test_references_and_radii_hold_all_points_of_a_tile(tiling):
    tiles, orders = tiling.bands(0, tiling.n_bands)
    inside = tiling.tile_sizes(0, tiling.n_bands) == tiling.per_tile  # without padding
    apart = tiling.positions(0, tiling.n_bands, orders) - tiling.center - tiles.references[:, None]
    assert (np.linalg.norm(apart, axis=2).max(axis=1)[inside] <= tiles.radius[inside] * (1 + 1e-9)).all()
    assert (tiles.radius <= tiling.radius * (1 + 1e-12)).all()


@pytest.mark.parametrize("most", [1, 3, 1000])
def test_parts_and_their_trees_are_all_leaves_once(tiling, most):
    factors, run = (4, 2, 1), (0, tiling.n_bands)
    seen, roots = [], 0
    parts = list(tiling.parts(run, factors[0], lambda bands: most, whole=False))
    for part, section in zip(parts, tiling.sections(parts, factors), strict=True):
        leaves = section.tree.leaves
        assert section.part == part and leaves.n_tiles == len(section.tree.slot) == len(section.sizes)
        assert np.array_equal(section.roots.centers[section.which], section.tree.centers[0])
        assert section.tree.leaves_of(len(section.which) - 1)[1] == leaves.n_tiles
        assert tiling.part_size(part, factors[0])[0] == len(section.which)
        roots += len(section.which)
        seen.append(leaves.references)
    assert roots == tiling.n_roots(*run, factors[0])
    every = tiling.bands(*run)[0].references
    assert sorted(map(tuple, np.concatenate(seen))) == sorted(map(tuple, every))


def test_blocks_are_all_bands_and_hold_what_fits(tiling):
    for most in (1, 2 * tiling.pixels(0, 1), 10**9):
        blocks = tiling.blocks(most)
        assert [b for a, c in blocks for b in range(a, c)] == list(range(tiling.n_bands))
        assert all(c - a == 1 or tiling.pixels(a, c) <= most for a, c in blocks)
