"""Checks of what an ImageGrid is made of: pixels of a side, listed positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..base import arguments, validation

FARTHEST = 1e150  # m: squares of coordinates stay finite
LONGEST = 2**53  # pixels along a side of a plane: indices are float64 in places


def side(name: str, value: object) -> int:
    """Number of pixels along a side of a plane; indices are int64 in places and float64 in others."""
    count = validation.count(name, value)
    if count > LONGEST:
        raise ValueError(f"{name} is {count:.3g}; a side has at most {LONGEST:,} pixels: give fewer")
    return count


def steps(spacing: object) -> tuple[float, float]:
    """Distances from row to row and from column to column, m, from a pair or one number for both."""
    dy, dx = validation.pair("spacing", spacing)
    return validation.number("spacing[0]", dy, above=0), validation.number("spacing[1]", dx, above=0)


def pixels_of(slices: tuple[slice, ...], shape: tuple[int, ...]) -> list[range]:
    """Numbers of the pixels along each axis that slices of the first axes choose; IndexError where none is left."""
    ranges = []
    for axis, (n, selection) in enumerate(zip(shape, (*slices, *[slice(None)] * len(shape)), strict=False)):
        if not isinstance(selection, slice):
            raise IndexError(f"slices[{axis}] is {selection!r:.60}; give slices, such as numpy.s_[2:5]")
        arguments.checked_index(f"slices[{axis}]", "a grid", selection, (n,))
        pixels = range(*selection.indices(n))
        if pixels.step < 0:
            raise IndexError(f"axis {axis} of a grid is sliced with a step of {pixels.step}; steps are positive")
        if len(pixels) == 0:
            raise IndexError(f"no pixel is left of the {n} of axis {axis}; choose at least one")
        ranges.append(pixels)
    return ranges


def cells(positions: np.ndarray) -> np.ndarray:
    """Positions, m (..., 3), read-only; ValueError for values that are neither finite nor the three NaN of an empty
    cell."""
    if -FARTHEST < positions.min() and positions.max() < FARTHEST:  # both are NaN where any is
        return validation.sealed(positions)
    empty = np.isnan(positions).all(axis=-1)
    if empty.all():
        raise ValueError("every cell of the grid is empty (NaN, or not valid); give at least one position")
    bad = ~(np.abs(positions) < FARTHEST) & ~empty[..., None]
    if bad.any():
        index, place = validation.first(bad)
        if np.isfinite(positions[index]):
            raise ValueError(f"positions{place} is {positions[index]:g} m, where distances overflow; give metres")
        raise ValueError(
            f"positions{place} is {positions[index]}; give finite positions, and NaN in "
            "all three coordinates of a cell that is empty"
        )
    return validation.sealed(positions)


def text(vector: ArrayLike) -> str:
    return "(" + ", ".join(f"{v:g}" for v in np.asarray(vector)) + ")"
