"""One reflectivity map of a part of a scene, and the transfer functions that its spectrum is multiplied by."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...blocks.bands import FlatArray
from ...opencl.device import Device
from ._aspect_window import DopplerGrid
from ._azimuth_transfer import AzimuthTransfer
from ._map_plan import MapPlan, RangeWavenumbers
from ._map_spectrum import ReflectivityMap, whole_vectors
from ._scratch import Scratch


@dataclass(frozen=True, eq=False)
class SpectrumRows:
    """Spectra of a map in one polarisation, at wavenumbers first ... stop - 1 of its grid, in the rows of an array.

    flat, start  the array, and its row of the grid's first wavenumber
    """

    polarization: int
    first: int
    stop: int
    flat: FlatArray
    start: int

    def _rows(self, wavenumbers: slice) -> slice:
        return slice(self.start + wavenumbers.start, self.start + wavenumbers.stop)

    @property
    def _is_in_memory(self) -> bool:
        """Whether rows of the array are views of it."""
        return not isinstance(self.flat, Scratch) or self.flat.whole is not None

    def sums(self, wavenumbers: slice) -> np.ndarray:
        """What is added up so far."""
        return self.flat[self._rows(wavenumbers)]

    def zeros(self, wavenumbers: slice) -> np.ndarray:
        """Zeros, to begin with."""
        if not self._is_in_memory:
            assert isinstance(self.flat, Scratch)
            return np.zeros((wavenumbers.stop - wavenumbers.start, self.flat.shape[1]), np.complex64)
        rows = self.sums(wavenumbers)
        rows[...] = 0
        return rows

    def put(self, wavenumbers: slice, rows: np.ndarray) -> None:
        """Keep the rows that `sums` or `zeros` gave."""
        if not self._is_in_memory:
            self.flat[self._rows(wavenumbers)] = rows


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

    def on_device(self, device: Device) -> ReflectivityMap:
        """The scatterers, sorted for the kernels."""
        return ReflectivityMap(device, self.map, self.numbers, self.grid, self.azimuth, self.slant_range)

    def add(
        self, held: ReflectivityMap, factors: np.ndarray, term: int, frequencies: np.ndarray,
        out: Sequence[SpectrumRows], budget: float, folder: Path | None,
    ) -> None:  # fmt: skip
        """Add the spectra of one term at frequencies, Hz (n_f,), to rows of each polarisation.

        factors  of the part's scatterers in this term, complex64 (n, n_polarizations)
        budget   bytes;  folder  of temporary files: the map's transform is written to one where it takes over a sixth
        """
        room = budget / 6
        for node, (tables, share) in enumerate(zip(self.transfer.tables[term], self.shares(), strict=True)):
            share = share.astype(np.complex64 if np.iscomplexobj(share) else np.float32)
            for spectra in out:
                begin, n_u = spectra.first, spectra.stop - spectra.first
                amplitudes = factors[self.picked, spectra.polarization] * share
                bands = held.over_azimuth(amplitudes, slice(begin, spectra.stop), budget)
                whole, size = None, 0
                for rows, made in bands:
                    if whole is None:  # bands one after the other, each with all wavenumbers
                        size = made.shape[1]
                        whole = Scratch((-(-self.map.n_rows // size) * n_u, size), room, folder)
                    if made.shape[1] < size:
                        made = np.pad(made, ((0, 0), (0, size - made.shape[1])))
                    whole.put(rows.start // size * n_u, made)
                assert whole is not None
                at_once = whole_vectors(room / (8 * (self.map.n_rows + size + len(frequencies))))
                for first in range(0, n_u, at_once):
                    stop = min(first + at_once, n_u)
                    starts = range(0, whole.shape[0], n_u)
                    parts = [whole.rows(start + first, start + stop) for start in starts]
                    over = np.concatenate(parts, axis=1)[:, : self.map.n_rows] if len(parts) > 1 else parts[0]
                    at = slice(begin + first, begin + stop)
                    sums = spectra.zeros(at) if term == node == 0 else spectra.sums(at)
                    held.add(over, at, tables, self.transfer, frequencies, sums, budget)
                    spectra.put(at, sums)
