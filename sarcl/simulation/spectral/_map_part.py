"""One reflectivity map of a part of a scene, and the transfer functions that its spectrum is multiplied by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...opencl.device import Device
from ._aspect_window import DopplerGrid
from ._azimuth_transfer import AzimuthTransfer
from ._map_plan import MapPlan, RangeWavenumbers
from ._map_spectrum import ReflectivityMap


@dataclass(frozen=True, eq=False)
class MapPart:
    """Where the scatterers of a part lie in a map, and its plan.

    picked                indices, among the scatterers of the part, of those in this map (n,)
    azimuth, slant_range  coordinates in this map, m (n,)
    shares                shares of the transfer's tables of every node in each response: (Q, n), real or complex
    """

    picked: np.ndarray | slice
    azimuth: np.ndarray
    slant_range: np.ndarray
    shares: Callable[[], np.ndarray]
    transfer: AzimuthTransfer
    grid: DopplerGrid
    numbers: RangeWavenumbers
    map: MapPlan

    @property
    def error(self) -> float:
        """Predicted error, relative to the echoes of this map."""
        return self.transfer.error + self.map.error

    @property
    def nodes(self) -> int:
        """Number of tables, for each of which the map is made anew."""
        return self.transfer.tables.shape[1]

    def bytes(self) -> tuple[float, float]:
        """Bytes per wavenumber along track of the map's transform, and per frequency of a spectrum."""
        return 8.0 * self.map.n_rows, 8.0 * self.grid.count

    def on_device(self, device: Device) -> ReflectivityMap:
        """The scatterers, sorted for the kernels."""
        return ReflectivityMap(device, self.map, self.numbers, self.grid, self.azimuth, self.slant_range)

    def add(
        self, held: ReflectivityMap, factors: np.ndarray, term: int, frequencies: np.ndarray, out: np.ndarray,
        budget: float,
    ) -> None:  # fmt: skip
        """Add the spectra of one term at frequencies, Hz (n_f,), to out (n_polarizations, n_u, n_f).

        factors  of the part's scatterers in this term, complex64 (n, n_polarizations);  budget  bytes for the map
        """
        at_once = max(1, int(budget / self.bytes()[0]))
        parts = [slice(i, min(i + at_once, self.grid.count)) for i in range(0, self.grid.count, at_once)]
        for tables, share in zip(self.transfer.tables[term], self.shares(), strict=True):
            share = share.astype(np.complex64 if np.iscomplexobj(share) else np.float32)
            for n, spectra in enumerate(out):
                amplitudes = factors[self.picked, n] * share
                for some in parts:
                    made = held.over_azimuth(amplitudes, some, budget)
                    held.add(made, some, tables, self.transfer, frequencies, spectra[some])
