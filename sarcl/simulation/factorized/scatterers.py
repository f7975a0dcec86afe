"""Scatterers of factorised echoes: what the kernel of the smallest cells reads of them, and the sums that they make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...scattering.antenna_weights import AntennaWeights
from ...scattering.facets import POLARIZATIONS
from .cells import ScattererCells


@dataclass(frozen=True, eq=False)
class Channel:
    """One of the sums over all scatterers that are computed by themselves: samples are sums of channels times weights.

    columns       polarisations of the samples that it is added to;  basis  float32 (n_samples,), its weight; None: 1
    polarization  in which facets reflect; "": they are points
    root          plane of 1/sqrt(eps);  wave, scale, ratio  of its frequency, as kernels/spread_leaves.cl reads them
    """

    columns: tuple[int, ...]
    basis: np.ndarray | None = None
    polarization: str = ""
    root: int = 0
    wave: float = 0.0
    scale: float = 0.0
    ratio: float = 1.0

    @property
    def macros(self) -> dict[str, int]:
        """Build-time macros of kernels/spread_leaves.cl."""
        return {name: int(name == self.polarization) for name in POLARIZATIONS}


@dataclass(frozen=True, eq=False)
class Scatterers:
    """Scatterers in cells, and the channels in which they are added.

    planes   numbers of the scatterers as kernels/spread_leaves.cl reads them, (n,) each, in the order of the cells
    weights  of the antennas, at every pulse
    macros   FACETS and those of facets, for the kernel;  up  float32 (6,), as facet_amplitudes.cl reads it
    """

    cells: ScattererCells
    planes: np.ndarray | tuple[np.ndarray, ...]
    channels: tuple[Channel, ...]
    weights: AntennaWeights
    macros: Mapping[str, int] = field(default_factory=lambda: {"FACETS": 0, "METAL": 0, "ROUGH": 0, "COHERENT": 0})
    up: np.ndarray = field(default_factory=lambda: np.zeros(6, np.float32))

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def n_frequencies(self) -> int:
        """Frequencies at which amplitudes are computed."""
        return len({channel.ratio for channel in self.channels})
