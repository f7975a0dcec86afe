"""Permittivities of the edges of a grid in dielectric and lossy bodies.

The cell about an edge is sampled along nine lines, half a cell apart. Where the surface lies along an axis of the
grid (ALIGNED), an edge has the mean over these lines of the harmonic mean along each: fields along a boundary see the
mean of both permittivities, to a quarter of a cell, and fields across it the harmonic mean. Where the surface is askew,
no number per edge is right for both. There an edge has the permittivity of what fills most of its cell: of all
profiles across a boundary, a step alone has both the mean and the harmonic mean of the boundary itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..lattice import COURANT, Lattice
from ..target import VACUUM_PERMITTIVITY
from ._cut_cells import Box, Intervals, free_lengths

LEAST_CELLS = 4  # per wavelength in a dielectric, and 2 pi times the depth that waves reach
ALIGNED = 0.999  # cosine of the angle between an axis and the normal of a surface, at least
LINES = [(m, n) for m in (-1, 0, 1) for n in (-1, 0, 1)]


def halved(lattice: Lattice) -> Lattice:
    """The grid of cells of half the size, whose node 2n is node n."""
    nx, ny, nz = lattice.shape
    return Lattice(lattice.cell / 2, (2 * nx, 2 * ny, 2 * nz), lattice.origin)


def check_cells(lattice: Lattice, permittivity: complex, k: float) -> None:
    """ValueError where a wavelength in a body, or the depth that waves reach, has fewer cells than LEAST_CELLS."""
    cells = 2 * np.pi / (abs(np.sqrt(complex(permittivity))) * k * lattice.cell)
    if cells < LEAST_CELLS:
        raise ValueError(
            f"permittivity {permittivity:.4g} leaves {cells:.2g} cells of {lattice.cell:.3g} m per wavelength in the "
            f"body, wanted {LEAST_CELLS}: give cells of at most {lattice.cell * cells / LEAST_CELLS:.3g} m, or None, a "
            "perfect conductor, where waves do not enter the body"
        )


def conductivities(lattice: Lattice, permittivity: np.ndarray, k: float) -> np.ndarray:
    """S/m, (n,): what gives permittivities eps' - j eps'' (n,) on the grid at k, rad/m.

    The grid takes E as the mean of two steps where it drives a current, and differences for derivatives: eps'' is
    conductivity dt/(2 eps_0 tan(omega dt/2)), at the frequency where |K| of `_dispersion`, averaged over directions, is
    that of a wavenumber k.
    """
    length = np.sqrt(6 * (1 - np.sinc(k * lattice.cell / np.pi)))  # dx |K|
    turn = np.arcsin(COURANT * length / 2)  # omega dt/2
    return np.asarray(-permittivity.imag * VACUUM_PERMITTIVITY * 2 / lattice.time_step * np.tan(turn))


def edge_permittivities(
    box: Box, axis: int, parts: Sequence[tuple[Intervals, complex]], conductor: Intervals | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the edges of a box along an axis that are partly in dielectrics (n,), and their permittivities (n,).

    parts      intervals along the axis on the halved grid, and permittivities; the later holds where parts overlap
    conductor  intervals of conductors, which take what they cover; edges beside them have what fills most of the rest
    """
    covers = [_covered(box, axis, part) for part, _ in parts]
    metal = _covered(box, axis, conductor) if conductor is not None else None
    at = np.flatnonzero(sum(_about(values, axis, line, half) for values in covers for line in LINES for half in (0, 1)))
    size = len(at)
    made, harmonic, uncut = np.zeros((len(parts) + 1, size)), np.zeros(size, complex), np.ones(size, bool)
    tilt = np.zeros((3, size), complex)  # of the permittivity: along the edge, and along both axes after
    for line in LINES:
        weight, inverse = (2 - abs(line[0])) * (2 - abs(line[1])) / 16, np.zeros(size, complex)
        for half in (0, 1):
            left = np.ones(size)
            if metal is not None:
                left -= _about(metal, axis, line, half).flat[at]
                uncut &= left > 1 - 1e-6
            mean = np.zeros(size, complex)
            for number in range(len(parts) - 1, -1, -1):
                permittivity = parts[number][1]
                share = np.minimum(_about(covers[number], axis, line, half).flat[at], left)
                left -= share
                made[number] += weight * share
                inverse += share / 2 / permittivity
                mean += share * permittivity
            made[-1] += weight * left
            inverse += left / 2
            tilt += weight * (mean + left) * np.array([2 * (2 * half - 1), *line])[:, None] * [[1], [2], [2]]
        harmonic += weight / np.where(inverse == 0, 1, inverse)
    values = np.array([permittivity for _, permittivity in parts] + [1.0])
    step = values[np.argmax(made, axis=0)]
    slope = np.abs(tilt)
    along = uncut & (slope.max(axis=0) >= ALIGNED * np.linalg.norm(slope, axis=0))
    value = np.where(along, harmonic, step)
    return at[value != 1], value[value != 1]


def _covered(box: Box, axis: int, part: Intervals) -> np.ndarray:
    """Covered shares of the edges of the halved grid, float32 (twice the box's shape)."""
    nx, ny, nz = (2 * n for n in box.shape)
    return np.asarray(1 - free_lengths(Box(2 * box.low, (nx, ny, nz)), axis, part))


def _about(covered: np.ndarray, axis: int, line: tuple[int, int], half: int) -> np.ndarray:
    """Shares (*shape of the box) of half a line, `line` half cells from each edge along the axes after its own."""
    some = [slice(None)] * 3
    some[axis] = slice(half, None, 2)
    out = covered[tuple(some)]
    for step, along in zip(line, ((axis + 1) % 3, (axis + 2) % 3), strict=True):
        some = [slice(None)] * 3
        some[along] = slice(step % 2, None, 2)
        out = out[tuple(some)]
        if step < 0:
            out = np.roll(out, 1, axis=along)  # nothing is covered beside the box
    return out
