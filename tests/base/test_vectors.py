"""Vectors in space."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.base import vectors


@pytest.mark.parametrize("n", [0, 1, 2, 500])
def test_distinct_places_are_those_of_numpy(n):
    places = np.random.default_rng(n).integers(-3, 4, (n, 3)) * 0.5 * [1, -1, 1]  # with 0 and -0
    rows, number = vectors.distinct(places)
    expected, index = np.unique(places, axis=0, return_inverse=True)
    assert np.array_equal(rows, expected) and np.array_equal(number, index.ravel())
    assert np.array_equal(rows[number], places)
