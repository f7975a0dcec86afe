"""The grid of a reflectivity map, as coarse as the tolerance allows, and the range wavenumbers at which it is read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.errors import ToleranceUnreachable
from ...base.tolerances import askable, rounded_up
from ...numerics.error_bounds import FLOAT32
from ...numerics.interpolation import Interpolator, interpolator
from ...opencl import fft
from ...opencl.device import Device
from ._aspect_window import DopplerGrid, ResponsePhase, wavenumber
from ._azimuth_transfer import AzimuthTransfer

KERNELS = ((6, 1.5), (6, 2.0), (8, 1.5), (8, 2.0), (8, 2.5))  # taps and oversampling that are tried, cheapest first
CELLS = 64, 8  # cells per side of a tile: on CPUs it stays in a cache, on GPUs many tiles are computed at once
SAFE_CELLS = 4.0  # resolution cells over which scatterers that lie evenly may add up in the aliases of a grid


@dataclass(frozen=True, eq=False)
class RangeWavenumbers:
    """kappa(u, f) about the centre of a band, and the shear of the map that takes out its slope over u.

    phase  that is known;  u_c, kappa_c  rad/m;  slope  d kappa/d u;  spread  (lowest, highest) rest of kappa, rad/m
    """

    phase: ResponsePhase
    u_c: float
    kappa_c: float
    slope: float
    spread: tuple[float, float]

    def rest(self, u: np.ndarray, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """kappa less its value and slope at the centre, rad/m, and cycles of the phase at the middle range: (n_u, n_f)
        each."""
        kappa, cycles = self.phase.kappa(u[:, None], k), self.phase.at_middle(u[:, None], k)
        cycles /= 2 * np.pi
        cycles -= np.rint(cycles)
        kappa -= (self.kappa_c + self.slope * (u - self.u_c))[:, None]
        return kappa, cycles


def range_wavenumbers(transfer: AzimuthTransfer, grid: DopplerGrid) -> RangeWavenumbers:
    """kappa over all wavenumbers of a grid and frequencies of the band at which the transfer function is not 0."""
    u, k = grid.wavenumbers, wavenumber(np.linspace(*transfer.aspects.band, 9))
    phase, (low, high) = transfer.phase, transfer.limits
    k_c = float(k[4])
    u_c = float((low + high) / 2 / phase.ratio(np.ones(1), k_c)[0])
    u_c = float(u[np.argmin(np.abs(u - u_c))])
    kappa_c = float(phase.kappa(np.array([u_c]), k_c)[0])
    slope = -u_c / (kappa_c if phase.paraxial is None else 2 * phase.paraxial)
    found = RangeWavenumbers(phase, u_c, kappa_c, slope, (0.0, 0.0))
    rest = found.rest(u, k)[0]
    ratio = phase.ratio(u[:, None], k)
    inside = (ratio >= low) & (ratio <= high)
    spread = (float(rest[inside].min()), float(rest[inside].max())) if inside.any() else (0.0, 0.0)
    middle = sum(spread) / 2
    return RangeWavenumbers(phase, u_c, kappa_c + middle, slope, (spread[0] - middle, spread[1] - middle))


@dataclass(frozen=True, eq=False)
class MapPlan:
    """Grid of a map: kernel, columns over a period of azimuth, rows of `spacing` m over slant range, and predicted
    error. Row `origin` is at the middle range; the transform over range has n_range samples."""

    kernel: Interpolator
    tile: int
    n_columns: int
    n_rows: int
    n_range: int
    spacing: float
    origin: int
    error: float


def plan_map(
    tolerance: float, numbers: RangeWavenumbers, grid: DopplerGrid, ranges: tuple[float, float], per_cell: float,
    tile: int, asked: float,
) -> MapPlan:  # fmt: skip
    """The cheapest grid whose predicted error is at most `tolerance`.

    ranges    (nearest, farthest), m
    per_cell  most scatterers in a resolution cell, 0 where they have random phases: if they lie evenly, aliases of the
              interpolation kernel add up in phase where their echoes cancel
    asked     the whole tolerance, for the message
    """
    best = np.inf
    # where kappa hardly varies one row would do: no row is longer than the map is deep
    band = max(numbers.spread[1] - numbers.spread[0], 2 * np.pi / max(ranges[1] - ranges[0], 1e-3))
    for taps, oversample in KERNELS:
        kernel = interpolator(taps, oversample)
        spacing = 2 * np.pi / (oversample * band)
        origin = int(np.ceil((numbers.phase.middle_range - ranges[0]) / spacing)) + taps
        rows = origin + int(np.ceil((ranges[1] - numbers.phase.middle_range) / spacing)) + taps
        rows = -(-rows // tile) * tile
        columns = tile * fft.good_length(int(np.ceil(max(oversample * grid.count, 4 * taps) / tile)))
        n_range = 2 * fft.good_length(int(np.ceil(oversample * max(origin, rows - origin))))
        gain = float(np.sqrt(max(1.0, SAFE_CELLS * per_cell)))
        rounding = 2 * FLOAT32.unit * (np.sqrt(np.log2(float(columns) * n_range)) + 2) * kernel.edge_gain + 1e-6
        error = (2 * gain + 1) * kernel.error + rounding
        best = min(best, error)
        if error <= tolerance:
            return MapPlan(kernel, tile, columns, rows, n_range, spacing, origin, error)
    reach = rounded_up(best * asked / tolerance)
    raise ToleranceUnreachable(
        asked, askable(reach), "float32 grids of the reflectivity map", "echo goes further", how="by spectral_echo"
    )


def tile_of(device: Device) -> int:
    """Cells per side of a tile."""
    return CELLS[0] if device.is_cpu else CELLS[1]


def scatterers_per_cell(azimuth: np.ndarray, ranges: np.ndarray, grid: DopplerGrid, numbers: RangeWavenumbers) -> float:
    """Most scatterers in a resolution cell."""
    cells = []
    for place, band in (
        (azimuth, 2 * np.pi * grid.count / grid.period),
        (ranges, numbers.spread[1] - numbers.spread[0]),
    ):
        size = max(2 * np.pi / max(band, 1e-9), float(np.ptp(place)) / 4096, 1e-9)
        cells.append(((place - place.min()) / size).astype(np.int64))
    return float(np.bincount(cells[0] * (cells[1].max() + 1) + cells[1]).max())
