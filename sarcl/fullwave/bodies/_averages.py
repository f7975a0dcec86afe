"""Means of the permittivity over cells about points of a grid, and the direction across the surface there.

Points are edges and nodes of a box of the grid. The lines of the halved grid say, for every half of an edge, how much
of it is in which body. About a point, nine lines along each axis, half a cell apart, give

    mean, inverse   of the permittivity and of its inverse in a cube of one cell: lines along an axis, which are exact
                    along themselves, count by the square of the normal's component
    normal          gradient of the permittivity, smoothed by hat functions of one cell to each side: with one function
                    for all three components, the gradient of a plane is across it
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .cut_cells import Box, Intervals, free_lengths

LINES = [(m, n) for m in (-1, 0, 1) for n in (-1, 0, 1)]  # places of lines, half cells across their axis
SIMPSON = 2 / 3, 1 / 6  # weights of lines through a point, and half a cell beside it: mean over a cell
HAT = 1 / 2, 1 / 4  # the same for a hat function of one cell to each side
FLAT = 1e-3  # change of the permittivity over a cell, relative: less has no direction


@dataclass(frozen=True, eq=False)
class Contents:
    """What the halves of edges along one axis hold, arrays of twice the shape of a box.

    mean, inverse  of the permittivity, without the share of conductors, complex64;  metal  that share, float32
    """

    mean: np.ndarray
    inverse: np.ndarray
    metal: np.ndarray

    @classmethod
    def of(
        cls, box: Box, axis: int, parts: Sequence[tuple[Intervals, complex]], conductor: Intervals | None
    ) -> Contents:
        """parts  intervals on the halved grid, and permittivities; the later holds where parts overlap"""
        nx, ny, nz = (2 * n for n in box.shape)
        fine = Box(2 * box.low, (nx, ny, nz))
        vacuum = np.ones(fine.shape, np.float32)
        metal = np.zeros(fine.shape, np.float32)
        if conductor is not None:
            vacuum = free_lengths(fine, axis, conductor)
            metal = 1 - vacuum
        mean, inverse = np.zeros((2, *fine.shape), np.complex64)
        for intervals, permittivity in reversed(parts):
            share = np.minimum(1 - free_lengths(fine, axis, intervals), vacuum)
            vacuum = vacuum - share
            mean += share * np.complex64(permittivity)
            inverse += share / np.complex64(permittivity)
        return cls(mean + vacuum, inverse + vacuum, metal)


@dataclass(frozen=True, eq=False)
class Averages:
    """What is about n points.

    mean, inverse  of the permittivity and of its inverse, outside of conductors, complex (n,)
    normal         across the surface, a unit vector; 0 where the permittivity changes evenly to both sides (n, 3)
    metal          share of conductors (n,)
    series         means over lines along x, y and z of the harmonic mean along each, complex (n, 3): where there is no
                   normal, as in a thin sheet
    """

    mean: np.ndarray
    inverse: np.ndarray
    normal: np.ndarray
    metal: np.ndarray
    series: np.ndarray


def mixed_cells(contents: Sequence[Contents]) -> tuple[np.ndarray, np.ndarray]:
    """Which cells of a box have more than one permittivity, or conductors, within a cell of them, bool; and the
    permittivity of each of the others.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    blocks = [_blocks(part.mean + 3 * part.metal) for part in contents]
    mixed = np.zeros(blocks[0][0].shape, bool)
    for number in (np.real, np.imag):
        low = np.min([number(values).min(axis=0) for values in blocks], axis=0)
        high = np.max([number(values).max(axis=0) for values in blocks], axis=0)
        mixed |= maximum_filter(high, 3) - minimum_filter(low, 3) > 1e-4 * np.abs(high)
    mixed |= maximum_filter(np.max([_blocks(part.metal).max(axis=0) for part in contents], axis=0), 3) > 0
    return mixed, blocks[0][0].astype(complex)


def _blocks(values: np.ndarray) -> np.ndarray:
    """The eight values of each cell, first axis, of arrays of twice the shape."""
    nx, ny, nz = (n // 2 for n in values.shape)
    return values.reshape(nx, 2, ny, 2, nz, 2).transpose(1, 3, 5, 0, 2, 4).reshape(8, nx, ny, nz)


def averages(contents: Sequence[Contents], cells: np.ndarray, offset: Sequence[int]) -> Averages:
    """Averages about the points at cells (n, 3) of a box, a cell or more from its sides, plus `offset` half cells."""
    at, n = 2 * cells + np.asarray(offset), len(cells)
    mean, inverse, series, gradient = np.zeros((4, n, 3), complex)
    metal = np.zeros((n, 3))
    for axis, part in enumerate(contents):
        for line in LINES:
            weight, smooth = (float(np.prod([rule[abs(step)] for step in line])) for rule in (SIMPSON, HAT))
            place = at.copy()
            place[:, [(axis + 1) % 3, (axis + 2) % 3]] += line
            far_before, before, after, far_after = (_along(part.mean, place, axis, step) for step in (-2, -1, 0, 1))
            inverses = (_along(part.inverse, place, axis, -1) + _along(part.inverse, place, axis, 0)) / 2
            mean[:, axis] += weight * (before + after) / 2
            inverse[:, axis] += weight * inverses
            series[:, axis] += weight / np.where(inverses == 0, 1, inverses)
            gradient[:, axis] += smooth * (far_after + after - before - far_before)
            metal[:, axis] += weight * (_along(part.metal, place, axis, -1) + _along(part.metal, place, axis, 0)) / 2
    normal = _unit(gradient, FLAT * np.abs(mean).max(axis=1, initial=0))
    has_normal = np.asarray(normal.any(axis=1))
    share = np.where(has_normal[:, None], normal**2, 1 / 3)
    return Averages((share * mean).sum(axis=1), (share * inverse).sum(axis=1), normal, metal.mean(axis=1), series)


def _unit(gradient: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Unit vectors along gradients, complex (n, 3), by their larger part; 0 where shorter than `least` (n,)."""
    real = np.abs(gradient.real).max(axis=1) >= np.abs(gradient.imag).max(axis=1)
    slope = np.where(real[:, None], gradient.real, gradient.imag)
    length = np.linalg.norm(slope, axis=1)
    sloped = length > least
    return np.asarray(np.where(sloped[:, None], slope / np.where(sloped, length, 1)[:, None], 0))


def _along(values: np.ndarray, place: np.ndarray, axis: int, step: int) -> np.ndarray:
    """Values at places (n, 3), `step` further along an axis."""
    x, y, z = (place[:, m] + step * (m == axis) for m in range(3))
    return np.asarray(values[x, y, z])
