"""Points or facets of a scene, planned for their spectral echoes, and their spectra along track."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable, ToleranceUnreachable
from ...base.tolerances import rounded_up
from ...opencl.device import Device
from ._aspect_expansion import AmplitudeSamples, AspectExpansion, expand, one_function
from ._aspect_window import DopplerGrid, aspects
from ._azimuth_transfer import SAFETY as RESPONSE_SAFETY
from ._azimuth_transfer import AzimuthTransfer, doppler_grid, plan_transfer, response_error
from ._map_plan import MapPlan, RangeWavenumbers, plan_map, range_wavenumbers, tile_of
from ._map_spectrum import ReflectivityMap
from ._scatterer_amplitudes import ScattererAmplitudes
from ._stationary_phase import stationary_tables
from ._straight_track import StraightTrack, tangent

# Shares of the tolerance: of amplitudes over aspect, transfer functions, what lies outside the beam, the grids.
EXPANSION, TRANSFER, OUTSIDE, GRID = 0.35, 0.25, 0.15, 0.2
STEEPEST = 0.95  # largest sine of the aspect: nearer to the track's direction the geometry degenerates
PROFILE, DRAWN = 2048, 48  # aspects and scatterers from which the beam's extent is found
MANY = 64  # scatterers, the strongest of which try the responses along the track
HALF_POWER = 0.25  # two-way power at which a one-way beam has half its power
MOST_DOPPLER = 64  # pulse repetition frequencies over which responses may spread in Doppler


@dataclass(frozen=True, eq=False)
class SpectralPart:
    """A plan for points or for facets.

    some   indices of the scatterers that the beam reaches (n,);  outside  error of what lies outside the beam
    """

    amplitudes: ScattererAmplitudes
    some: np.ndarray
    expansion: AspectExpansion
    transfer: AzimuthTransfer
    grid: DopplerGrid
    numbers: RangeWavenumbers
    map: MapPlan
    outside: float

    @property
    def predicted_error(self) -> float:
        """Relative to the scatterers at random phases."""
        return self.expansion.error + self.transfer.error + self.outside + self.map.error

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a report."""
        return {
            "method": "spectral, " + ("exact" if self.transfer.phase.paraxial is None else "saras"),
            "functions of aspect": len(self.expansion),
            "ranges": len(self.transfer.ranges),
            "frequencies": len(self.transfer.frequencies),
            "wavenumbers along track": self.grid.count,
            "cells": f"{self.map.n_columns} x {self.map.n_rows}",
            "taps": self.map.kernel.taps,
        }

    def bytes(self) -> tuple[float, float]:
        """Bytes per wavenumber along track of the map's transform, and per frequency of a spectrum."""
        return 8.0 * self.map.n_rows, 8.0 * self.grid.count

    def on_device(self, device: Device) -> ReflectivityMap:
        """The map of the scatterers, sorted for the kernels."""
        a = self.amplitudes
        return ReflectivityMap(
            device, self.map, self.numbers, self.grid, a.azimuth[self.some], a.slant_range[self.some]
        )

    def add(
        self, held: ReflectivityMap, frequencies: np.ndarray, out: np.ndarray, budget: float,
        on_progress: Callable[[float], None],
    ) -> None:  # fmt: skip
        """Add the spectra at frequencies, Hz (n_f,), to out (n_polarizations, n_u, n_f); budget  bytes for the map."""
        weights = self.transfer.range_weights(self.amplitudes.slant_range[self.some])
        at_once = max(1, int(budget / self.bytes()[0]))
        parts = [slice(i, min(i + at_once, self.grid.count)) for i in range(0, self.grid.count, at_once)]
        for j in range(len(self.expansion)):
            factors = self.expansion.factors(self.some, j).astype(np.complex64)
            for n, spectra in enumerate(out):
                for tables, weight in zip(self.transfer.tables[j], weights, strict=True):
                    for some in parts:
                        made = held.over_azimuth(factors[:, n] * weight.astype(np.float32), some, budget)
                        held.add(made, some, tables, self.transfer, frequencies, spectra[some])
            on_progress((j + 1) / len(self.expansion))


def plan_part(
    amplitudes: ScattererAmplitudes, track: StraightTrack, band: tuple[float, float], has_beam: bool,
    is_random: bool, variant: str, tolerance: float, asked: float, device: Device,
) -> SpectralPart:  # fmt: skip
    """The plan for points or facets whose error is at most `tolerance`.

    variant    "exact" or "saras";  band  Hz, its limits
    has_beam   antennas limit the aspects at which scatterers are seen;  is_random  scatterers have random phases
    asked      the whole tolerance, for messages
    """
    low, high, outside, main = _aspects_seen(amplitudes, track, band, has_beam, OUTSIDE * tolerance)
    _check_doppler(track, band[1], main, has_beam)
    _check_spread(track, band[1], low, high)
    nearest, farthest = float(amplitudes.slant_range.min()), float(amplitudes.slant_range.max())
    farthest = max(farthest, nearest * (1 + 1e-4))  # nodes over range need an interval

    def seen(some: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return np.clip(amplitudes.sines(random.integers(0, track.n_pulses, len(some)) * track.spacing, some), low, high)

    samples = AmplitudeSamples(amplitudes, amplitudes.size, band, seen)
    if variant == "saras":
        expansion = one_function(samples, float(np.clip(0.0, *main)))
    else:
        expansion = expand(samples, (low, high), EXPANSION * tolerance, asked)
    azimuth, ranges = amplitudes.azimuth, amplitudes.slant_range
    lags = -float(azimuth.max()), track.length - float(azimuth.min())
    seen_aspects = aspects(low, high, (nearest, farthest), band, lags, TRANSFER * tolerance / 3)
    ends = [azimuth + ranges * float(tangent(end)) for end in seen_aspects.support]
    some = np.flatnonzero((ends[0] <= track.length) & (ends[1] >= 0))
    reach = float(ends[0][some].min()), float(ends[1][some].max())
    drawn = some[np.linspace(0, len(some) - 1, min(len(some), MANY)).astype(int)]
    factors = np.stack([expansion.factors(drawn, j) for j in range(len(expansion))], axis=-1)
    factors = factors[:, np.abs(factors).sum(axis=(0, 2)).argmax()]
    factors = factors[np.argsort(-np.abs(factors).sum(axis=1), kind="stable")]
    if variant == "saras":
        transfer = stationary_tables(seen_aspects, expansion.functions)
        error = RESPONSE_SAFETY * response_error(transfer, expansion.functions, factors[:1], track, reach)
        _check_saras(expansion.error, error, outside, (1 - GRID) * tolerance, asked)
        transfer = replace(transfer, error=error)
    else:
        transfer = plan_transfer(
            seen_aspects, expansion.functions, factors, track, reach, TRANSFER * tolerance, asked
        )  # fmt: skip
    grid = doppler_grid(transfer, track, reach)
    numbers = range_wavenumbers(transfer, grid)
    per_cell = _per_cell(azimuth[some], ranges[some], grid, numbers)
    made = plan_map(
        GRID * tolerance, numbers, grid, (nearest, farthest), 0.0 if is_random else per_cell, tile_of(device), asked
    )
    return SpectralPart(amplitudes, some, expansion, transfer, grid, numbers, made, outside)


def _check_saras(of_amplitudes: float, of_transfer: float, outside: float, allowed: float, asked: float) -> None:
    """ToleranceUnreachable where SARAS's approximations exceed their share of the tolerance."""
    error = of_amplitudes + of_transfer + outside
    if error > allowed:
        best = rounded_up(1.05 * asked * error / allowed)
        raise ToleranceUnreachable(
            asked, best if best < 1 else None, "SARAS's transfer function", "take variant='exact', or echo",
            "by variant='saras': stationary phase, parabolas and the grid deformation differ from the responses along "
            f"the track by {of_transfer:.1e}, amplitudes of one aspect by {of_amplitudes:.1e}",
        )  # fmt: skip


def _aspects_seen(
    amplitudes: ScattererAmplitudes, track: StraightTrack, band: tuple[float, float], has_beam: bool, allowed: float
) -> tuple[float, float, float, tuple[float, float]]:
    """Sines (low, high) of the aspects at which pulses see scatterers, the relative error of leaving out what a beam
    receives beyond them, and the sines between which it has half its power."""
    first, last = amplitudes.sines(0.0), amplitudes.sines(track.length)
    low, high = float(first.min()), float(last.max())
    if has_beam:
        low, high, outside, main = _beam(amplitudes, track, band, (low, high), allowed)
    else:
        outside, main = 0.0, (low, high)
    if max(abs(low), abs(high)) > STEEPEST:
        raise NotApplicable(
            f"scatterers are seen down to {np.degrees(np.arccos(max(abs(low), abs(high)))):.2g} deg from the direction "
            f"of the track, where spectral_echo needs {np.degrees(np.arccos(STEEPEST)):.2g} deg; use echo"
        )
    return low, high, outside, main


def _beam(
    amplitudes: ScattererAmplitudes, track: StraightTrack, band: tuple[float, float], limits: tuple[float, float],
    allowed: float,
) -> tuple[float, float, float, tuple[float, float]]:  # fmt: skip
    """The same for antennas with a beam: from the power of some scatterers over aspect."""
    random = np.random.default_rng(1)
    n = min(DRAWN, len(amplitudes))
    some = np.sort(random.choice(len(amplitudes), n, replace=False))
    first, last = amplitudes.sines(0.0, some), amplitudes.sines(track.length, some)
    which, cut = np.repeat(some, PROFILE), False
    for _ in range(2):  # again between the limits that were found: beams may be narrow
        sines = np.linspace(*limits, PROFILE)
        power = np.zeros(PROFILE)
        for f in (band[0], band[1]):
            made = amplitudes(which, np.tile(sines, n), f).reshape(n, PROFILE, -1)
            seen = (sines >= first[:, None]) & (sines <= last[:, None])
            power += ((np.abs(made) ** 2).sum(axis=2) * seen).sum(axis=0)
        total = np.cumsum(power)
        half = 0.25 * (allowed / 2) ** 2 * total[-1]
        one = max(0, int(np.searchsorted(total, half)) - 1)
        two = min(PROFILE - 1, int(np.searchsorted(total, total[-1] - half)) + 1)
        cut |= one > 0 or two < PROFILE - 1
        limits = float(sines[one]), float(sines[two])
    main = np.flatnonzero(power >= HALF_POWER * power.max())
    return *limits, allowed * cut, (float(sines[main[0]]), float(sines[main[-1]]))


def _check_doppler(track: StraightTrack, highest: float, main: tuple[float, float], has_beam: bool) -> None:
    """ValueError where the pulse repetition frequency is below the Doppler bandwidth."""
    needed = track.prf * track.spacing * 2 * highest / SPEED_OF_LIGHT * (main[1] - main[0])
    if needed > track.prf * (1 + 1e-9):
        of = "the beam (between its half-power directions)" if has_beam else "the scene as this track sees it"
        raise NotApplicable(
            f"the track has {track.prf:.6g} pulses per second, below the Doppler bandwidth of {of}, {needed:.6g} Hz; "
            f"give prf={needed:.4g} or more, or use echo, which computes aliased echoes too"
        )


def _check_spread(track: StraightTrack, highest: float, low: float, high: float) -> None:
    """NotApplicable where side lobes reach so far beyond the pulse repetition frequency that echo is cheaper."""
    spread = track.spacing * 2 * highest / SPEED_OF_LIGHT * (high - low)
    if spread > MOST_DOPPLER:
        raise NotApplicable(
            f"at this tolerance side lobes count over {spread:.0f} times the pulse repetition frequency, and "
            f"spectral_echo computes up to {MOST_DOPPLER}; raise prf or the tolerance, or use echo"
        )


def _per_cell(azimuth: np.ndarray, ranges: np.ndarray, grid: DopplerGrid, numbers: RangeWavenumbers) -> float:
    """Most scatterers in a resolution cell."""
    cells = []
    for place, band in (
        (azimuth, 2 * np.pi * grid.count / grid.period),
        (ranges, numbers.spread[1] - numbers.spread[0]),
    ):
        size = max(2 * np.pi / max(band, 1e-9), float(np.ptp(place)) / 4096, 1e-9)
        cells.append(((place - place.min()) / size).astype(np.int64))
    return float(np.bincount(cells[0] * (cells[1].max() + 1) + cells[1]).max())
