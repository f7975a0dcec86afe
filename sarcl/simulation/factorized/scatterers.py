"""Scatterers of factorised echoes: what the kernel of the smallest cells reads of them, and the sums that they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .cells import ScattererCells


@dataclass(frozen=True, eq=False)
class Channel:
    """One of the sums over all scatterers that are computed by themselves: samples are sums of channels times weights.

    columns  polarisations of the samples that it is added to;  basis  float32 (n_samples,), its weight; None: 1
    """

    columns: tuple[int, ...]
    basis: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Scatterers:
    """Scatterers in cells, and the channels in which they are added.

    planes  numbers of the scatterers as kernels/spread_leaves.cl reads them, float32 (k, n), in the order of the cells
    """

    cells: ScattererCells
    planes: np.ndarray
    channels: tuple[Channel, ...]

    def __len__(self) -> int:
        return len(self.cells)
