"""Ratio of the energy in the range profiles to the energy at the pixels.

Interpolation and rounding errors are proportional to the former; the tolerance is relative to the latter.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..numerics import interpolator_choice, range_profiles
from ..numerics.interpolation import deconvolved
from ..numerics.pulse_geometry import half_path
from ..opencl import fft
from .focusing_task import FocusingTask
from .kept_results import per_task
from .row_norms import row_norms

FAINTEST = 1e-20  # share of the power beside the pixels, taken where every pixel is at an exact null of every row
ROWS, PIXELS, MOST = 16, 256, 2**18  # rows and pixels in the estimate; samples at most
FEW = 64  # rows of which all are read, as their errors may add up in phase
TAPS, FINER, TERMS = 12, 4.0, 6  # taps, oversampling and terms of an interpolator with an error of 1e-11
CHANCE, CHANCE_OF_FEW = 1.25, 1.12  # what noise in many pixels makes of `near`, which is 1
INNER = 0.5  # share of a kernel's largest error that most kernels keep to in the inner half of the band
BESIDE = TAPS + 2  # samples beside a pixel: those that an interpolation reads, and one more on each side


@dataclass(frozen=True, eq=False)
class ProfileEnergy:
    """Root mean square of range profiles, relative to that at the pixels themselves.

    near_pixels    over the samples around each pixel's range: errors of interpolation are proportional to it where they
                   add up as at random
    whole_profile  over all samples: rounding errors of the transforms are proportional to it
    rows           of few rows, of which all were read: what their errors of interpolation are in phase
    """

    near_pixels: float
    whole_profile: float
    rows: RowsInPhase | None = None

    def near(self, length: int = 0) -> float:
        """By how much errors of interpolation are larger, relative to the pixels, than those of the kernel.

        length  samples of the range profiles; 0: as if they did not matter
        """
        return self.near_pixels if self.rows is None else max(self.near_pixels, self.rows.ratio(length))

    def darkness(self, length: int = 0) -> float:
        """`near` where it is larger than chance makes it: than 1.25, of few rows than 1.12; else 1."""
        near = self.near(length)
        return near if near > (CHANCE if self.rows is None else CHANCE_OF_FEW) else 1.0

    def largest(self, n_samples: int) -> float:
        """The largest `darkness` of any plan for rows of so many samples."""
        return max(self.darkness(n) for n in (0, *interpolator_choice.lengths(n_samples)))


@per_task
def estimate(task: FocusingTask) -> ProfileEnergy:
    """Estimate from 256 pixels in 16 rows spread over the data and in the 16 strongest rows, to 1e-11 of an amplitude.

    Up to 64 rows are all read, unless they have more than 2^18 samples.
    ProfileEnergy(1, 1) where none of these pixels lies in the range window and beam of any row.
    """
    raw, grid = task.raw, task.grid
    bright = row_norms(task)
    few = raw.n_rows <= min(FEW, MOST // raw.n_samples)
    count = raw.n_rows if few else min(ROWS, raw.n_rows, max(1, MOST // raw.n_samples))
    usual = spread_over(raw.n_rows, count)
    best = np.setdiff1d(np.argsort(bright)[-count:], usual)
    _, x = grid.sample(PIXELS, seed=1)
    # weights: the strongest rows count once, the others represent all rows that are not read
    stands_for = {int(r): (raw.n_rows - len(best)) / len(usual) for r in usual} | {int(r): 1.0 for r in best}
    read = {r: raw.read(r, r + 1)[0] * (task.sample_weight * task.row_weight[r]) for r in stands_for}
    scale = max(1e-290, *(float(np.abs(samples).max()) for samples in read.values()))  # squares must not overflow
    n = raw.n_samples
    length = fft.good_length(max(4 * n, 48))
    pixel_power = near = pixels_inside = 0.0
    together = RowsInPhase.of(raw.n_rows, len(x), BESIDE) if few else None
    at_once = max(1, MOST // length)
    for rows in (list(read)[start : start + at_once] for start in range(0, len(read), at_once)):
        all_delays, all_inside = _delays(task, x, np.array(rows))
        each = _values(np.stack([read[row] / scale for row in rows]), length, all_delays, few)
        for row, delays, inside, values, around, beside in zip(rows, all_delays, all_inside, *each, strict=True):
            power, close = np.abs(values[inside]) ** 2, around[inside]
            gains = None if task.antenna is None else task.antenna.weights(x[inside], row, task.antenna.frequency)
            if gains is not None:
                power, close = power * np.abs(gains) ** 2, close * np.abs(gains) ** 2
            pixel_power += stands_for[row] * float(power.sum())
            near += stands_for[row] * float(close.sum())
            pixels_inside += stands_for[row] * int(inside.sum()) / raw.n_rows
            if together is not None:
                cycles = delays * (raw.frequency[row] / raw.frequency_step[row] + n // 2)
                factors = np.exp(2j * np.pi * (cycles[inside] % 1)) * (1.0 if gains is None else gains.conj())
                together.add(row, inside, delays, factors * values[inside], factors[:, None] * beside[inside])
    peak = 1.0 if task.antenna is None else task.antenna.peak
    total_power = pixels_inside * float(((bright / scale) ** 2).sum()) * peak**2
    if total_power == 0 or near == 0:
        return ProfileEnergy(1.0, 1.0)
    floor = 1e-20 * total_power  # where every pixel is at an exact null of every row
    return ProfileEnergy(
        float(np.sqrt(near / max(pixel_power, floor))), float(np.sqrt(total_power / max(pixel_power, floor))), together
    )


def share(task: FocusingTask) -> float:
    """Share of (row, pixel) pairs in the row's range window and beam, estimated from 64 rows and 256 pixels."""
    _, x = task.grid.sample(PIXELS, seed=1)
    return float(_delays(task, x, spread_over(task.raw.n_rows, 64))[1].mean())


def _delays(task: FocusingTask, x: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Delays of points, m (m, 3), in fractions of the range windows of rows; whether they lie in them and in the beam:
    (n, m) each."""
    raw, tx = task.raw, task.raw.tx[rows][:, None]
    half = half_path(tx, tx if task.antennas.is_monostatic else raw.rx[rows][:, None], x)
    delays = (2 * raw.frequency_step[rows] / SPEED_OF_LIGHT)[:, None] * (half - raw.reference_range[rows][:, None])
    seen = np.full(delays.shape, True) if task.wrap else np.abs(delays) <= 0.5
    if task.antennas.beam is not None:
        seen &= np.stack([task.antennas.beam_depth(x, row) >= 0 for row in rows])
    return delays, seen


def _values(
    samples: np.ndarray, length: int, delays: np.ndarray, with_neighbours: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values of the profiles of rows at delays (n, m), in fractions of the window; mean power of the BESIDE samples
    about each (n, m); and values as far from each as samples lie apart, frequencies weighted by `_edge_weights`:
    (n, m, BESIDE), or (n, 0) without neighbours.

    samples  (n, n_samples);  length  of the profiles
    """
    kernel, n_samples = deconvolved(TAPS, FINER, TERMS, np.float64), samples.shape[1]
    shaped = _inverse_transform(n_samples, length)
    place = delays * length - (kernel.taps - 1) / 2
    first = np.rint(place).astype(np.int64)
    shares, first = kernel.weights(place - first), first[..., None]

    def profiles(weights: np.ndarray | float, begin: int, count: int) -> np.ndarray:
        """Samples begin ... begin + count - 1 about each delay (n, m, count), of rows times weights (n_samples,)."""
        rows = range_profiles.from_samples(None, samples, weights, length, dtype=np.complex128)
        return np.asarray(rows[np.arange(len(rows))[:, None, None], (first + np.arange(begin, begin + count)) % length])

    values = (shares * profiles(shaped, 0, kernel.taps)).sum(axis=-1)
    around = (np.abs(profiles(1.0, -1, BESIDE)) ** 2).mean(axis=-1)
    if not with_neighbours:
        return values, around, np.empty((len(values), 0))
    read = profiles(shaped * _edge_weights(n_samples), -BESIDE // 2, BESIDE + kernel.taps - 1)
    return values, around, (sliding_window_view(read, kernel.taps, axis=-1) @ shares[..., None])[..., 0]


@functools.lru_cache(maxsize=16)
def _inverse_transform(n_samples: int, length: int) -> np.ndarray:
    """Factors of spectra (n_samples,) that make up for the kernel of `_values`."""
    k = np.arange(n_samples) - n_samples // 2
    factors = 1 / deconvolved(TAPS, FINER, TERMS, np.float64).transform(k / length)
    factors.flags.writeable = False
    return np.asarray(factors)


def _edge_weights(n: int) -> np.ndarray:
    """Weights (n,) of the samples of a row by the errors of interpolation kernels at their frequencies.

    Most kernels have their largest error at the edge of the band, and less than half of it in the inner half.
    """
    k = np.abs(np.arange(n) - n // 2)
    return np.maximum(k / max(n // 2, 1), INNER) if n > 1 else np.ones(1)


@dataclass(eq=False)
class RowsInPhase:
    """Contributions of a few rows to some pixels, and beside them; 0 where a row does not see a pixel.

    Errors of interpolation may add up in phase over few rows. A row p of spectrum S_p[k] contributes c_p P_p(d_p) to a
    pixel: P_p(d) = sum_k S_p[k] exp(j 2 pi k d), the delay d_p in fractions of the range window, and c_p the phase of
    the carrier. Interpolated from a profile of L samples it has the error (docs/theory/accuracy.md, "Evenly spaced
    scatterers")

        c_p sum_k S_p[k] exp(j 2 pi k d_p) sum_m exp(j 2 pi m L d_p) T(k/L + m)/T(k/L),   m = +-1, ...

    Of a kernel whose error is at most E, the sum over the rows is about E times, and hardly more than E times the
    largest value, over small delays d beside the pixel, of

        N_m(d) = sum_p c_p exp(j 2 pi m L d_p) Q_p(d_p + d)

    where Q_p is P_p with frequencies weighted as the errors of kernels are, which are largest at the edge of the band.
    Over many rows and pixels it is that of random phases, sqrt(sum_p |P_p|^2). Over few it need not be: where all rows
    have a pixel at the same place between their samples, the errors add up as the profiles beside the pixel do, even if
    their values at the pixel cancel.

    delays  d_p (n_rows, n), in fractions of the range window
    values  c_p P_p(d_p), complex128 (n_rows, n);  beside  c_p Q_p(d_p + d) at some delays d, (n_rows, n, n_beside)
    """

    delays: np.ndarray
    values: np.ndarray
    beside: np.ndarray
    _known: dict[int, float] = field(default_factory=dict)

    @classmethod
    def of(cls, n_rows: int, n: int, n_beside: int) -> RowsInPhase:
        """Rows that see no pixel yet."""
        zeros = np.zeros((n_rows, n, n_beside), np.complex128)
        return cls(np.zeros((n_rows, n)), zeros[..., 0].copy(), zeros)

    def add(self, row: int, inside: np.ndarray, delays: np.ndarray, values: np.ndarray, beside: np.ndarray) -> None:
        """Contributions of a row.

        inside  whether it sees each pixel (n,);  delays  d_p (n,)
        values, beside  c_p P_p(d_p) and c_p Q_p(d_p + d) of the pixels that it sees, (m,) and (m, n_beside)
        """
        self.delays[row] = delays
        self.values[row, inside] = values
        self.beside[row, inside] = beside

    def ratio(self, length: int = 0) -> float:
        """Largest norm of N_m over the pixels at any d, relative to the pixels themselves, for m = -1, 0, 1.

        length  L, samples of the profiles of a plan; 0: only the sum with m = 0, which bounds the errors of lines and
                of sub-apertures

        The pixels count with the larger of their norm and that of the same contributions with random phases, as they
        do for a tolerance.
        """
        if length not in self._known:
            images = np.array([0, length, -length] if length else [0])
            turns = np.exp(2j * np.pi * ((self.delays[..., None] * images) % 1))  # (n_rows, n, images)
            sums = self.beside.transpose(1, 2, 0) @ turns.transpose(1, 0, 2)
            power = float((np.abs(sums) ** 2).sum(axis=0).max())
            self._known[length] = float(np.sqrt(power / self._power))
        return self._known[length]

    @functools.cached_property
    def _power(self) -> float:
        """Of the pixels."""
        in_phase = float((np.abs(self.values.sum(axis=0)) ** 2).sum())
        power = float((np.abs(self.values) ** 2).sum())
        return max(in_phase, power, FAINTEST * float((np.abs(self.beside) ** 2).sum()))
