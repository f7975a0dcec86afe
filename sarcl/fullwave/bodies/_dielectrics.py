"""Permittivities of the edges of a grid in dielectric and lossy bodies: second order in the size of cells.

At a boundary with the normal n, E across it follows from D by the mean of the inverse permittivity, and E along it by
the inverse of the mean: the inverse permittivity is the tensor

    n n^T <1/eps> + (1 - n n^T) / <eps>

with means over a cube of one cell (`_averages`). Its diagonal is taken at edges, the rest at nodes, whence each edge is
coupled to the eight edges across its nodes (kernels/fdtd_coupled.cl). In lossy bodies these
weights are complex: a part of them lags behind (`lagging_weights`). Waves in a body are slower on the grid than they
should be: its permittivity is corrected for that (`on_grid`).
Sources: A. Farjadpour et al., Opt. Lett. 31 (2006); G. R. Werner and J. R. Cary, J. Comput. Phys. 226 (2007).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..lattice import COURANT, Lattice
from ..target import VACUUM_PERMITTIVITY
from ._averages import Contents, averages, mixed_cells
from .cut_cells import Box, Intervals

LEAST_CELLS = 4  # per wavelength in a dielectric, and 2 pi times the depth that waves reach
LEAST = 1e-6  # difference of a permittivity from 1, and coupling, of edges that are listed
METAL = 1e-6  # share of conductors in a cell, by rounding
DOMINANT = 0.98  # of the diagonal: sum of the rest of a row of the inverse permittivity, at most
SLAB = 2**20  # cells of the box that are sampled at a time: bounds the memory, about 500 bytes each
HALO = 2  # planes on both sides of a slab that its means reach

Lines = tuple[Intervals, Intervals, Intervals]


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
    conductivity dt/(2 eps_0 tan(omega dt/2)), at the frequency where |K| of `dispersion`, averaged over directions, is
    that of a wavenumber k.
    """
    turn = _half_turn(lattice, k)
    return np.asarray(-permittivity.imag * VACUUM_PERMITTIVITY * 2 / lattice.time_step * np.tan(turn))


def lagging_weights(lattice: Lattice, weights: np.ndarray, k: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Real weights w and v, and the part d of a sum that each step keeps, with which w + v (1 - d)/(1 - d exp(-j omega
    dt)) is the complex weight, at k, rad/m. Below omega the lagging part has all of its weight, above it little.
    """
    turn = 2 * _half_turn(lattice, k)
    keep = float(np.exp(-turn))
    response = (1 - keep) / (1 - keep * np.exp(-1j * turn))
    lagging = weights.imag / response.imag
    return weights.real - lagging * response.real, lagging, keep


def _half_turn(lattice: Lattice, k: float) -> float:
    """omega dt/2 at the frequency where |K|, averaged over directions, is that of a wavenumber k, rad/m."""
    length = np.sqrt(_square(k * lattice.cell).real)  # dx |K|
    return float(np.arcsin(COURANT * length / 2))


def on_grid(lattice: Lattice, permittivity: complex, k: float) -> complex:
    """The permittivity on the grid in which waves have the wavelength that they should have at k, rad/m, averaged over
    directions: less than the permittivity of the body.
    """
    index = np.sqrt(complex(permittivity))
    phase = k * lattice.cell
    return complex(_square(index * phase) / _square(phase))


def _square(phase: complex) -> complex:
    """(dx |K|)^2 of waves with `phase` rad per cell, averaged over directions."""
    return complex(6 * (1 - np.sin(phase) / phase))


@dataclass(frozen=True, eq=False)
class Permittivities:
    """Of the edges of a box that are partly in dielectrics, along one axis.

    at       numbers in a raveled array of the box (n,)
    values   complex (n,), 1 over which is the inverse permittivity along the edge
    across   the inverse permittivity off its diagonal, a quarter of it, times `values`, complex (4, n): with D along b
             at the nodes before and after the edge, and along c; b and c are the axes after. 0: not coupled
    """

    at: np.ndarray
    values: np.ndarray
    across: np.ndarray


def permittivities(
    box: Box, parts: Sequence[tuple[Lines, complex]], conductor: Lines | None = None
) -> list[Permittivities]:
    """Permittivities of the edges of a box along x, y and z.

    parts      intervals along x, y and z on the halved grid, and permittivities; the later holds where parts overlap
    conductor  intervals of conductors, which take what they cover; edges beside them have what fills most of the rest,
               and are not coupled
    """
    values, tensor = np.ones((3, *box.shape), np.complex64), np.zeros((3, *box.shape), np.complex64)
    cut = np.zeros((3, *box.shape), bool)
    planes = max(1, SLAB // (box.shape[1] * box.shape[2]))
    for first in range(0, box.shape[0], planes):
        last = min(first + planes, box.shape[0])
        start, stop = max(first - HALO, 0), min(last + HALO, box.shape[0])
        slab = Box(box.low + np.array([start, 0, 0]), (stop - start, *box.shape[1:]))
        core = slice(first - start, last - start)
        for whole, part in zip((values, tensor, cut), _of_slab(slab, parts, conductor), strict=True):
            whole[:, first:last] = part[:, core]
    tensor *= _least_scale(values, tensor, cut)
    tensor[np.abs(tensor) < LEAST] = 0
    out = []
    for axis in range(3):
        across = np.stack(_at_nodes(tensor, axis)) * values[axis] / 4
        at = np.flatnonzero((np.abs(values[axis] - 1) > LEAST) | across.any(axis=0))
        out.append(Permittivities(at, values[axis].flat[at].astype(complex), across.reshape(4, -1)[:, at]))
    return out


def _of_slab(
    box: Box, parts: Sequence[tuple[Lines, complex]], conductor: Lines | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Permittivities of edges, tensors off their diagonal (yz, zx, xy) at nodes, and which edges are near conductors:
    (3, *shape of the box) each.
    """
    contents = [
        Contents.of(box, axis, [(lines[axis], value) for lines, value in parts], conductor and conductor[axis])
        for axis in range(3)
    ]
    mixed, alone = mixed_cells(contents)
    values, tensor = np.stack([alone] * 3), np.zeros((3, *box.shape), complex)
    cut = np.zeros(values.shape, bool)
    inner = np.zeros(mixed.shape, bool)  # nothing is dielectric at the sides of the box
    inner[1:-1, 1:-1, 1:-1] = mixed[1:-1, 1:-1, 1:-1]
    values[:, mixed] = 1
    cells = np.argwhere(inner)
    kinds = np.array([value for _, value in parts] + [1.0])
    for axis in range(3):
        near = averages(contents, cells, np.arange(3) == axis)
        across = near.normal[:, axis] ** 2
        smooth = 1 / np.where(near.metal > METAL, 1, across * near.inverse + (1 - across) / (near.mean + near.metal))
        smooth = np.where(near.normal.any(axis=1), smooth, near.series[:, axis])
        metal = near.metal > METAL
        rest = near.mean / np.maximum(1 - near.metal, METAL)
        most = kinds[np.argmin(np.abs(rest[:, None] - kinds), axis=1)]
        values[axis][inner], cut[axis][inner] = np.where(metal, most, smooth), metal
    near = averages(contents, cells, (0, 0, 0))
    step = np.where(near.metal > METAL, 0, near.inverse - 1 / (near.mean + near.metal))
    for axis in range(3):
        tensor[axis][inner] = step * near.normal[:, (axis + 1) % 3] * near.normal[:, (axis + 2) % 3]
    return values, tensor, cut


def _at_nodes(tensor: np.ndarray, axis: int) -> list[np.ndarray]:
    """Of the edges along an axis, the elements that couple them to both axes after it, at both nodes of each edge."""
    with_b, with_c = tensor[(axis + 2) % 3], tensor[(axis + 1) % 3]
    return [moved for values in (with_b, with_c) for moved in (values, np.roll(values, -1, axis=axis))]


def _least_scale(values: np.ndarray, tensor: np.ndarray, cut: np.ndarray) -> np.ndarray:
    """Factors of the tensors at nodes, 0 to 1 (*shape): with them each row of the inverse permittivity, over all edges,
    has a diagonal that is larger than the sum of the rest, so that the matrix is positive and the grid stable.
    """
    scale = np.ones(values.shape[1:])
    for axis in range(3):
        rest = sum(2 * np.abs(part) / 4 for part in _at_nodes(tensor, axis))
        own = np.where(cut[axis], 0, DOMINANT * np.abs(1 / values[axis]) / np.maximum(rest, 1e-30))
        scale = np.minimum(scale, np.minimum(own, np.roll(own, 1, axis=axis)))
    return np.asarray(scale)
