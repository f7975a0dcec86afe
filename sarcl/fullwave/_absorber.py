"""Absorbing layers (CPML): coefficients, and the corrections on a device."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..opencl.device import Device
from .lattice import COURANT, LANES, Lattice

ROWS = 8  # rows per work-item on a CPU

ORDER = 3  # the conductivity grows with this power of the depth
STRENGTH = 0.8  # largest conductivity over (ORDER + 1)/(377 ohm dx), as Roden and Gedney (2000) recommend
SHIFT = 0.05  # frequency shift alpha at the inner face, in rad per cell of path: absorbs fields that decay, too


def coefficients(thickness: int) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """beta and gamma, float32 (2 thickness,), for E and for H: layers at the low end, then those at the high end.

    Source: J. A. Roden and S. D. Gedney, Microw. Opt. Technol. Lett. 27 (2000), eqs (19), (20), with kappa = 1.
    """
    layer = np.arange(thickness)
    electric = np.concatenate([thickness - layer, layer])
    magnetic = np.concatenate([thickness - layer - 0.5, layer + 0.5])
    return _at(electric / max(thickness, 1)), _at(magnetic / max(thickness, 1))


def _at(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    sigma = STRENGTH * (ORDER + 1) * COURANT * depth**ORDER
    alpha = SHIFT * COURANT * (1 - depth)
    beta = np.exp(-(sigma + alpha))
    gamma = np.where(sigma > 0, sigma / np.where(sigma > 0, sigma + alpha, 1) * (beta - 1), 0)
    return beta.astype(np.float32), gamma.astype(np.float32)


class Layers:
    """The layers at both ends of x (axis 0) or y (1) on a device, with the memory of both fields."""

    def __init__(self, device: Device, lattice: Lattice, axis: int, thickness: int, lanes: int) -> None:
        self.device, self.lattice, self.axis, self.thickness = device, lattice, axis, thickness
        self._kernel = device.kernel("fdtd_absorb.cl", "absorb", LANES=lanes)
        held = list(lattice.shape)
        held[axis] = 2 * thickness
        self._size, self._rows, self._vectors = int(np.prod(held)), held[1], held[2] // lanes
        self._coefficients = [[device.copied(part) for part in pair] for pair in coefficients(thickness)]
        self._memory = [device.zeros(8 * self._size) for _ in range(2)]

    def correct(self, to: Any, source: Any, magnetic: bool, first: int, last: int) -> None:
        """Correct the planes from `first` to `last` of E from H, or of H from E."""
        if self.axis:
            self._run(to, source, magnetic, first, last, first)
            return
        n, thick = self.lattice.shape[0], self.thickness
        self._run(to, source, magnetic, first, min(last, thick), first)
        self._run(to, source, magnetic, max(first, n - thick), last, max(first, n - thick) - n + 2 * thick)

    def _run(self, to: Any, source: Any, magnetic: bool, first: int, last: int, layer: int) -> None:
        if first >= last:
            return
        grid, cpu = self.lattice, self.device.is_cpu
        each, step = ROWS if cpu else 1, (grid.plane, grid.row)[self.axis]
        split, jump = (self.thickness, grid.shape[1] - self._rows) if self.axis else (self._rows, 0)
        self.device.run(
            self._kernel, (1 if cpu else self._vectors, -(-self._rows // each), last - first), None, to, source,
            self._memory[magnetic], *self._coefficients[magnetic], self.axis, (self.axis + 1) * grid.component,
            (self.axis + 2) % 3 * grid.component, step if magnetic else 0, 0 if magnetic else -step, self._size,
            grid.start, grid.plane, grid.row, self._rows, split, jump, self._vectors, each,
            np.float32(-COURANT if magnetic else COURANT), first, layer,
        )  # fmt: skip


def along_rows(device: Device, lattice: Lattice, thickness: int) -> tuple[tuple[Any, Any, Any], ...]:
    """Memory, beta and gamma of the layers along z, for E and for H: arguments of kernels/fdtd_vacuum.cl.

    They have LANES cells at each end of a row; the cells inside of the layers have gamma 0. Thickness 0: none.
    """
    size = 16 * LANES * lattice.shape[0] * lattice.shape[1] if thickness else 16
    return tuple(
        (device.zeros(size), *(device.copied(_in_rows(part)) for part in pair)) for pair in coefficients(thickness)
    )


def _in_rows(layers: np.ndarray) -> np.ndarray:
    """Coefficients (2 thickness,) in the outer cells of two vectors of LANES cells, 0 between."""
    out, half = np.zeros(2 * LANES, np.float32), len(layers) // 2
    out[:half], out[2 * LANES - half :] = layers[:half], layers[half:]
    return out
