"""Rows, columns, Doppler bins and range blocks of a range-Doppler image, and its predicted error."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import ToleranceUnreachable
from ...base.tolerances import askable, rounded_up
from ...model.phase_history import PhaseHistory
from ...numerics import cost_model
from ...numerics.interpolation import Interpolator
from ...numerics.interpolator_choice import choose_interpolator
from ...opencl import fft
from ._doppler import EVANESCENT, STEEPEST, Band, delay
from ._extent import Extent
from ._track import Track
from ._velocity import Hyperbolas

SEGMENT = 64  # columns along which positions and phases of a Doppler bin are linear
ROUNDING = 4e-6  # relative error of complex64 FFTs and float32 phases
INTERPOLATION, COMPRESSION = 0.4, 0.5  # shares of the tolerance that the other errors leave
# Root mean squares over a band of a phase that grows with the square of the frequency from its middle, and of its
# fourth power, relative to those at its ends: 1/sqrt(5), 1/sqrt(17), and some room for the phase's cubic part.
QUADRATIC, FOURTH = 0.5, 0.3
LEAST_PHASE = 0.05  # share of the tolerance below which the phases of the compression are float32
SUMS_PAY = 30.0  # times faster, on CPUs, from which on GPUs leave transforms along the track to the host
CUBIC = 1 / 24  # largest error of a cubic through four nodes, in the first interval: of exp(j k psi), k the node


@dataclass(frozen=True, eq=False)
class FocusPlan:
    """Plan of an image.

    times, ranges   zero-Doppler times of the rows, s, and slant ranges of the columns, m; times lie step/finer apart
    band            Doppler band, as sines of squint angles
    fit             effective velocity by slant range
    length          rows of the azimuth FFT;  bins  numbers of the Doppler bins, in steps of 1/(length step) Hz
    blocks          first and last column + 1 of range blocks. A single block has one secondary range compression,
                    that of its middle; with several (three at least) it is interpolated by cubics through four of
                    their ends; with a block for each column, every column has its own
    interpolator, profile_length   of range profiles;  center  their delay 0, m
    phases          float32, or float64 where the phases of the secondary range compression need it
    errors          predicted relative errors by cause
    """

    times: np.ndarray
    ranges: np.ndarray
    finer: int
    band: Band
    fit: Hyperbolas
    length: int
    bins: np.ndarray
    blocks: tuple[tuple[int, int], ...]
    interpolator: Interpolator
    profile_length: int
    center: float
    phases: type[np.float32] | type[np.float64]
    errors: dict[str, float]

    @property
    def predicted_error(self) -> float:
        """Sum of the errors by cause."""
        return float(sum(self.errors.values()))

    def cost(self, n_rows: int, n_samples: int) -> float:
        """Cost in contributions of sarcl/numerics/cost_model.py: FFTs, filters, reading along the migration."""
        bins, columns, several = len(self.bins), len(self.ranges), len(self.blocks) > 1
        filters = len(self.blocks) + 1 if several else 1
        out = n_rows * n_samples * cost_model.REFERENCED + n_samples * self._along(n_rows, self.length)
        out += bins * filters * (n_samples * cost_model.COMPRESSION_FILTER + cost_model.profile(self.profile_length))
        out += (
            bins * columns * (4 if several else 1) * (cost_model.STRAIGHTENED + cost_model.TAPS[self.interpolator.taps])
        )
        return out + columns * self._along(len(self.times), self.length * self.finer)

    def sums_pay(self, n: int, length: int) -> bool:
        """Whether n rows are transformed along the track by sums over the Doppler bins, instead of FFTs of a length."""
        return self._along(n, length) < cost_model.profile(length)

    def held(self, n_rows: int, n_samples: int) -> int:
        """Complex numbers of the arrays of all rows, and of all Doppler bins."""
        n_times, period = len(self.times), self.length * self.finer
        spectra = n_rows if self.sums_pay(n_rows, self.length) else self.length
        folded = 2 * n_times if self.sums_pay(n_times, period) else period
        return spectra * n_samples + folded * len(self.ranges)

    def far_fewer(self, n_rows: int) -> bool:
        """Whether GPUs' FFTs of such lengths, too, would take longer than sums for so many rows of samples."""
        transforms = ((n_rows, self.length), (len(self.times), self.length * self.finer))
        return all(SUMS_PAY * self._along(n, length) < cost_model.profile(length) for n, length in transforms)

    def _along(self, n: int, length: int) -> float:
        """Cost of a column of n rows, transformed along the track by an FFT or by sums."""
        return min(cost_model.profile(length), cost_model.SUMMED * len(self.bins) * n)

    def describe(self) -> dict[str, Any]:
        """The plan in words and numbers, for a report."""
        return {
            "method": "range-Doppler",
            "Doppler bins": f"{len(self.bins)} of an FFT of {self.length}",
            "range blocks": len(self.blocks),
            "taps": self.interpolator.taps,
            "profiles": self.profile_length,
        }


def band_frequencies(raw: PhaseHistory) -> np.ndarray:
    """Frequencies of the samples, Hz (n_samples,)."""
    return np.asarray(raw.frequency[0] + np.arange(raw.n_samples) * raw.frequency_step[0])


def curved(frequencies: np.ndarray, center: float, bend: np.ndarray) -> np.ndarray:
    """sqrt(f^2 - b^2) less its value and slope at the centre frequency, Hz, without cancellation; arrays broadcast.

    With g = f - fc and a^2 = fc^2 - b^2 it is -(g b/a)^2 / (sqrt(f^2 - b^2) + a + g fc/a).
    """
    a = np.sqrt(center**2 - bend**2)
    g = frequencies - center
    return np.asarray(-((g * bend / a) ** 2) / (np.sqrt(frequencies**2 - bend**2) + a + g * center / a))


def make_plan(
    raw: PhaseHistory,
    track: Track,
    extent: Extent,
    fit: Hyperbolas,
    model_error: float,
    tolerance: float,
    near: float = 1.0,
    whole: float = 1.0,
) -> FocusPlan:
    """The plan for a tolerance; ToleranceUnreachable names the best there is.

    model_error  root mean square phase error of the hyperbolas, rad
    near, whole  energy about the pixels, and of the samples, relative to that at the pixels
    """
    times, ranges = extent.times, extent.ranges
    rounding = ROUNDING * whole
    band, fixed = extent.band, model_error + rounding
    errors = {"hyperbolic ranges": model_error, "rounding": rounding, "ends of the Doppler band": band.error}
    spare = tolerance - fixed - band.error
    if not spare > 0.2 * tolerance:
        if not band.error <= tolerance / 2:
            limit = "the ends of the Doppler band, which are bright in these data beside dark pixels"
            raise ToleranceUnreachable(
                tolerance, None, limit, "use backproject, or give times=, ranges= of bright pixels"
            )
        best = rounded_up(2 * fixed)
        limit = "rounding of complex64" if model_error < rounding else "the track's ranges, which are no hyperbolas"
        raise ToleranceUnreachable(tolerance, askable(best), limit, "use backproject, which takes any track")
    frequencies = band_frequencies(raw)
    center = float(frequencies[raw.n_samples // 2])
    steepest = max(abs(s) for s in extent.band.ends)
    bandwidth = frequencies.max() / frequencies.min()  # at one Doppler frequency sines differ by as much
    if steepest > STEEPEST or steepest * bandwidth > EVANESCENT:
        raise ValueError(
            f"points are seen up to {np.degrees(np.arcsin(min(1.0, steepest))):.3g} degrees from broadside, too near "
            f"to the direction of flight for range_doppler with frequencies of {frequencies[0] / 1e9:.4g} to "
            f"{frequencies[-1] / 1e9:.4g} GHz; use backproject"
        )
    compression = _Compression(frequencies, center, fit, band, ranges)
    phases, error = compression.phases(LEAST_PHASE * tolerance)
    errors["rounding"] += error
    spare -= error
    interpolator, profile_length, _ = choose_interpolator(
        INTERPOLATION * spare / near, raw.n_samples, float(len(ranges))
    )
    errors["interpolation in range"] = interpolator.error * near
    blocks, error = compression.blocks(COMPRESSION * spare / near, tolerance)
    errors["secondary range compression"] = error * near
    length, bins = _doppler_bins(track, extent, frequencies[[0, -1]], fit.at(ranges)[0])
    return FocusPlan(
        times=times,
        ranges=ranges,
        finer=extent.finer,
        band=band,
        fit=fit,
        length=length,
        bins=bins,
        blocks=blocks,
        interpolator=interpolator,
        profile_length=profile_length,
        center=float(ranges.mean()),
        phases=phases,
        errors=errors,
    )


def _doppler_bins(track: Track, extent: Extent, frequencies: np.ndarray, speeds: np.ndarray) -> tuple[int, np.ndarray]:
    """Length of the azimuth FFT, and numbers of the Doppler bins; frequencies  at the ends of the band, Hz (2,)."""
    times, ranges, (low, high) = extent.times, extent.ranges, extent.band.ends
    slow, fast = float(speeds.min()), float(speeds.max())
    earliest = delay(low, ranges[-1 if low < 0 else 0], slow if low < 0 else fast)
    latest = delay(high, ranges[-1 if high > 0 else 0], slow if high > 0 else fast)
    span = max(latest - (times[0] - track.stop), times[-1] - earliest)
    length = fft.good_length(int(np.ceil(span / track.step)) + 16)
    doppler = [2 * v * s * f / SPEED_OF_LIGHT for v in (slow, fast) for s in (low, high) for f in frequencies]
    scale = length * track.step
    return length, np.arange(int(np.floor(min(doppler) * scale)), int(np.ceil(max(doppler) * scale)) + 1)


@dataclass(frozen=True, eq=False)
class _Compression:
    """Secondary range compression over a swath; center  of the frequencies, Hz."""

    frequencies: np.ndarray
    center: float
    fit: Hyperbolas
    band: Band
    ranges: np.ndarray

    def blocks(self, allowed: float, tolerance: float) -> tuple[tuple[tuple[int, int], ...], float]:
        """The fewest range blocks whose compression has an error of at most `allowed`, and that error.

        One filter has the error psi, the phase at the ends of the band by which the ranges at both ends of the swath
        differ from its middle; cubics through the filters of the blocks' ends have psi^4/24, psi the largest difference
        of two.
        """
        n = len(self.ranges)
        error = QUADRATIC * max(self._difference(n // 2, i) for i in (0, n - 1))
        if error <= allowed:
            return ((0, n),), error
        for count in sorted({int(3 * 2 ** (i / 3)) for i in range(20)}):
            if count >= n:  # blocks of cubics have two columns or more: with one, two of their ends would be the same
                return tuple((i, i + 1) for i in range(n)), 0.0
            edges = np.linspace(0, n - 1, count + 1).astype(int)
            psi = max(self._difference(*ends) for ends in pairwise(edges))
            error = FOURTH * CUBIC * psi**4
            if error <= allowed:
                edges[-1] = n
                return tuple((int(a), int(b)) for a, b in pairwise(edges)), error
        limit = "secondary range compression of so wide a swath at this squint"
        remedy = "give ranges=(near, far) of a part of it, or use backproject"
        raise ToleranceUnreachable(tolerance, None, limit, remedy)

    def phases(self, allowed: float) -> tuple[type[np.float32] | type[np.float64], float]:
        """The type of the phases, and the error by its rounding.

        Far off broadside the phases at the ends of the bands are hundreds of cycles.
        """
        bends = np.array(self.band.ends)[:, None] * self.center
        phase = float(np.abs(curved(self.frequencies[[0, -1]], self.center, bends)).max())
        phase = phase * 4 * np.pi / SPEED_OF_LIGHT * self.ranges[-1]
        error = float(np.finfo(np.float32).eps) * phase  # several operations, and the root mean square over the bands
        return (np.float32, error) if error <= allowed else (np.float64, 0.0)

    def _difference(self, *columns: int) -> float:
        """Largest difference, rad, between the compressions of two columns at the ends of the bands."""
        ranges = self.ranges[list(columns)]
        speeds = self.fit.at(ranges)[0]
        bends = np.array(self.band.ends)[:, None] * self.center
        phases = [
            4 * np.pi / SPEED_OF_LIGHT * r * curved(self.frequencies[[0, -1]], self.center, bends * speeds[0] / v)
            for r, v in zip(ranges, speeds, strict=True)
        ]
        return float(np.abs(phases[1] - phases[0]).max())
