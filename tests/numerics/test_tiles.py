"""Tiles of points: radii of smaller tiles without making them."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.numerics.tiles import tile_points


def clusters():
    """64 points within a millimetre at each of four places 100 km apart."""
    random = np.random.default_rng(0)
    places = np.repeat(np.array([[0, 0, 0], [1e5, 0, 0], [0, 1e5, 0], [1e5, 1e5, 0]], float), 64, axis=0)
    return places + random.uniform(-5e-4, 5e-4, (256, 3))


@pytest.mark.parametrize(
    "points", [np.random.default_rng(1).normal(size=(n, 3)) for n in (1, 63, 256, 1000)] + [clusters()]
)
def test_radii_of_smaller_tiles_are_those_of_these_tiles(points):
    center = points.mean(axis=0)
    tiles, _ = tile_points(points, center, 256)
    smaller, _ = tile_points(points, center, 64)
    radii = tiles.radii_in_parts(64)  # the last point alone fills up tiles beyond
    assert radii[: smaller.n_tiles] == pytest.approx(smaller.radius, rel=1e-6, abs=1e-12)
    assert (radii[smaller.n_tiles :] == 0).all()
