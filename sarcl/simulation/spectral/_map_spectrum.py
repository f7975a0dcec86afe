"""Spectrum of a reflectivity map at the range wavenumbers of every Doppler and radar frequency.

    y(u, f) = exp(-j (kappa - 2 k) r_c) A(u, f) sum_k b_k exp(-j u x_k - j kappa (r_k - r_c))
    kappa = sqrt(4 k^2 - u^2)

(x_k, r_k) are azimuth and slant range of the scatterers, anywhere; u is evenly spaced, kappa is not. Scatterers are
spread on a grid (type-1 nonuniform FFT over x), whose transform over r is read between its samples (type 2): Stolt's
change of variables without an approximation, kernels/spectral_echo.cl. With the centre of the band
(u_c, kappa_c), kappa = kappa_c + slope (u - u_c) + small: the map is sheared by the slope, so that squinted beams need
no finer grid in range.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...base.text import size_text
from ...numerics import shared_tile
from ...numerics.interpolation import Interpolator
from ...opencl import fft
from ...opencl.device import Device
from ...opencl.launch_numbers import launch_numbers
from ._aspect_window import DopplerGrid, wavenumber
from ._azimuth_transfer import AzimuthTransfer
from ._map_plan import MapPlan, RangeWavenumbers

AT_ONCE = 2**17  # pairs of wavenumber and frequency per block: their coordinates stay in a cache
TOGETHER = 16  # rows: numbers that the host's vectors hold divide it
PAIR = 80  # bytes per pair, of its coordinates and spectra
FLAT = 9  # coefficients of 1/transform of the interpolation kernel


class ReflectivityMap:
    """Scatterers at azimuth and slant range, m (n,), sorted into the tiles of a grid, on a device."""

    def __init__(
        self, device: Device, plan: MapPlan, numbers: RangeWavenumbers, grid: DopplerGrid, azimuth: np.ndarray,
        slant_range: np.ndarray,
    ) -> None:  # fmt: skip
        self.device, self.plan, self.numbers, self.grid = device, plan, numbers, grid
        offset = slant_range - numbers.phase.middle_range
        cycles = (numbers.u_c * azimuth + numbers.kappa_c * offset) / (2 * np.pi)
        cycles -= np.rint(cycles)
        row = offset / plan.spacing + plan.origin
        column = (azimuth + numbers.slope * offset) / grid.period
        column = (column - np.floor(column)) * plan.n_columns
        taps, n_tiles = plan.kernel.taps, plan.n_columns // plan.tile
        first, rest = [], []
        for position in (row, column):
            start = position - (taps - 1) / 2
            whole = np.rint(start)
            rest.append((start - whole).astype(np.float32))
            first.append(whole.astype(np.int32))
        first[1] %= plan.n_columns
        tile = (first[0] // plan.tile) * n_tiles + first[1] // plan.tile
        self.order = np.argsort(tile, kind="stable")
        counts = np.bincount(tile, minlength=(plan.n_rows // plan.tile) * n_tiles)
        self.start = device.upload(np.concatenate([[0], np.cumsum(counts)]).astype(np.int32))
        self.first = device.upload(np.stack(first, axis=1)[self.order])
        self.rest = device.upload(np.stack(rest, axis=1)[self.order])
        self.wave = np.exp(-2j * np.pi * cycles).astype(np.complex64)
        self.macros = {"VW": 1, "TAPS": taps, "TERMS": plan.kernel.terms, "TILE": plan.tile}
        self.grouped, self.spread = shared_tile.spreading_kernel(device, "spectral_echo.cl", **self.macros, NODES=1)
        self.table = device.upload(plan.kernel.table)
        self.flat = device.upload(_flat(plan.kernel))

    def over_azimuth(
        self, amplitudes: np.ndarray, wavenumbers: slice, budget: float
    ) -> Iterator[tuple[slice, np.ndarray]]:
        """Transform over azimuth of amplitudes (n,), band of rows by band: the rows, and complex64 (n_u, n rows) at
        some wavenumbers.

        budget  bytes, of which a band and its transform take up to a fourth
        """
        plan, device, grid = self.plan, self.device, self.grid
        values = device.upload((amplitudes * self.wave).astype(np.complex64)[self.order])
        n_tiles = plan.n_columns // plan.tile
        a_band = 8 * plan.tile * plan.n_columns
        most = min(budget / 6, device.info.max_alloc)
        if a_band > most:
            raise MemoryError(
                f"max_bytes leaves {size_text(most)} for a band of the reflectivity map, which needs "
                f"{size_text(a_band)}; raise max_bytes to {6.1 * a_band:.2g} or more"
            )
        at_once = max(1, int(min(budget / 16, device.info.max_alloc) / a_band))
        index = grid.indices[wavenumbers] - int(np.rint(self.numbers.u_c * grid.period / (2 * np.pi)))
        flat = (1 / plan.kernel.transform(index / plan.n_columns)).astype(np.float32)
        row = (np.arange(plan.n_rows) - plan.origin) / plan.n_range
        flat_rows = (1 / plan.kernel.transform(row)).astype(np.float32)
        index %= plan.n_columns
        for first in range(0, plan.n_rows // plan.tile, at_once):
            n = min(at_once, plan.n_rows // plan.tile - first)
            made = device.empty(n * a_band)
            device.run(
                self.spread, *shared_tile.launch(device, (n_tiles, n), self.grouped), values, self.first, self.rest,
                self.start, self.table, n_tiles, first, made,
            )  # fmt: skip
            rows = device.download(made, np.empty((n * plan.tile, plan.n_columns), np.complex64))
            wave = fft.rows(device, rows)
            part = slice(first * plan.tile, (first + n) * plan.tile)
            wave *= flat_rows[part, None]
            out = np.empty((len(index), n * plan.tile), np.complex64)
            for start in range(0, len(index), 256):  # transposed a few columns at a time, for the cache
                some = slice(start, start + 256)
                out[some] = wave[:, index[some]].T
            out *= flat[:, None]
            yield part, out

    def add(
        self, over_azimuth: np.ndarray, wavenumbers: slice, tables: np.ndarray, transfer: AzimuthTransfer,
        frequencies: np.ndarray, out: np.ndarray, budget: float,
    ) -> None:  # fmt: skip
        """Add y(u, f) at some wavenumbers to out, complex64 (n_u, n_f).

        over_azimuth  of the amplitudes, at these wavenumbers (n_u, n_rows);  budget  bytes
        tables        complex (M, n): A at the transfer's frequencies, for these amplitudes
        """
        device, plan = self.device, self.plan
        kernel = device.kernel(
            "spectral_echo.cl", "migrate", **self.macros, GROUPED=int(self.grouped), NODES=len(tables)
        )
        held = device.upload(np.ascontiguousarray(tables, np.complex64))
        basis = device.upload(transfer.basis(frequencies).astype(np.float32))
        for part, coordinates in self.coordinates(transfer, frequencies, wavenumbers, budget):
            padded = np.zeros((part.stop - part.start, plan.n_range), np.complex64)
            padded[:, : plan.n_rows - plan.origin] = over_azimuth[part, plan.origin :]
            padded[:, plan.n_range - plan.origin :] = over_azimuth[part, : plan.origin]
            spectra = device.upload(fft.rows(device, padded))
            made = np.empty((len(padded), len(frequencies)), np.complex64)
            buffer = device.empty(made.nbytes)
            first, rest, cycles, cell, cell_rest = (device.upload(a) for a in coordinates)
            device.run(
                kernel, made.shape[::-1], None,
                launch_numbers("spectral_echo.cl", "migrate", n_range=plan.n_range, n_table=tables.shape[-1]),
                spectra, first, rest, cycles, cell, cell_rest, held, basis, self.flat, self.table, buffer,
            )  # fmt: skip
            out[part] += device.download(buffer, made)

    def _at_once(self, n_frequencies: int, budget: float) -> int:
        """Wavenumbers per block, which takes up to a sixth of `budget` bytes."""
        a_wavenumber = 16 * self.plan.n_range + PAIR * n_frequencies
        return whole_vectors(min(AT_ONCE // n_frequencies, budget / 6 / a_wavenumber))

    def coordinates(
        self, transfer: AzimuthTransfer, frequencies: np.ndarray, wavenumbers: slice, budget: float
    ) -> Iterator[tuple[slice, tuple[Any, ...]]]:
        """Blocks of wavenumbers, and the kernel's coordinates of each: first tap, rest, cycles, cell, its rest.

        budget  bytes, of which a block takes up to a sixth
        """
        plan, u, k = self.plan, self.grid.wavenumbers[wavenumbers], wavenumber(frequencies)
        at_once, scale = self._at_once(len(k), budget), plan.spacing * plan.n_range / (2 * np.pi)
        for start in range(0, len(u), at_once):
            part = slice(start, min(start + at_once, len(u)))
            kappa, cycles = self.numbers.rest(u[part], k)
            cell, cell_rest = transfer.positions(transfer.phase.ratio(u[part, None], k))
            kappa *= scale
            kappa -= (plan.kernel.taps - 1) / 2
            first = np.rint(kappa)
            kappa -= first
            first[cell < 0] = 0
            yield part, (
                first.astype(np.int32), kappa.astype(np.float32), cycles.astype(np.float32), cell,
                cell_rest.astype(np.float32),
            )  # fmt: skip


def whole_vectors(n_rows: float) -> int:
    """About n_rows, at least 1: so many that blocks of rows begin where the host's vectors of rows do.

    The host transforms several rows together, and the rest of them one by one: the same rows whatever the blocks are.
    """
    n = max(1, int(n_rows))
    return n // TOGETHER * TOGETHER if n >= TOGETHER else 1 << (n.bit_length() - 1)


def _flat(kernel: Interpolator) -> np.ndarray:
    """Coefficients of 1/transform in rising powers of nu^2, float32 (9,), within the band of the kernel."""
    nu = np.linspace(0, 0.52 / kernel.oversample, 200)
    wanted = 1 / kernel.transform(nu)
    powers = nu[:, None] ** (2 * np.arange(FLAT))
    scale = np.abs(powers).max(axis=0)
    solution = np.linalg.lstsq(powers / scale / wanted[:, None], np.ones(len(nu)), rcond=None)[0]
    return np.asarray(solution / scale, np.float32)
