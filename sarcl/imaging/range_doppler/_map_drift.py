"""Doppler rate from the data: map drift. A wrong rate displaces two looks along the track from each other.

A processor of velocity v0 puts echoes of Doppler frequency q, received at t, to the zero-Doppler time t + h(v0, q),

    h(v, q) = (r/v) s/sqrt(1 - s^2),   s = lambda q/(2 v)

so that points of true velocity v appear h(v0, q) - h(v, q) late, and looks of two frequencies apart. Their intensities
are correlated along the track, in blocks of slant range, and the velocity that explains all blocks best is taken:
v^2 = factor v0^2, and the Doppler rate grows with v^2. Focused again with it, the looks lie closer; this is repeated.
Sources: Li, Held, Curlander and Wu, "Doppler parameter estimation for spaceborne synthetic-aperture radars", IEEE
Trans. GE-23, 1985, pp. 47-56; Carrara, Goodman and Majewski, "Spotlight synthetic aperture radar", 1995, chapter 6.
reference: sarcl/reference/map_drift.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from ...base.stage_timer import Clock
from ...model.phase_history import PhaseHistory
from ...opencl.device import Device
from ._doppler import sine
from ._extent import Extent
from ._focus import focus
from ._host_rows import Budget, Job
from ._plan import FocusPlan, make_plan
from ._track import Track
from ._velocity import Hyperbolas

TOLERANCE = 0.1  # tolerance of the looks: the displacement of intensities does not need more
MOST_PIXELS = 2048, 512  # rows and columns of the looks, from the middle of the image
BLOCKS = 8  # blocks of slant ranges
FINER = 4  # points per row at which correlations are tabulated
FACTORS = 0.8, 1.25  # smallest and largest v^2/v0^2
ENOUGH = 6.0  # least peak of the correlation over the median at all lags, in median absolute deviations
STEPS = 6  # repetitions, at most
CLOSE = 2e-6  # change of the factor that ends them


@dataclass(frozen=True, eq=False)
class Looks:
    """Intensities of two looks, float (rows, columns), focused with velocities `speeds`, m/s (columns,).

    ranges   slant ranges, m (columns,);  row  s, between rows
    doppler  Hz (2,), middles of the looks;  wavelength  m
    """

    first: np.ndarray
    second: np.ndarray
    ranges: np.ndarray
    speeds: np.ndarray
    row: float
    doppler: tuple[float, float]
    wavelength: float


def converged(looks_with: Callable[[float], Looks]) -> float:
    """The factor of v^2 at which looks that are focused with it do not move any more.

    looks_with  makes the looks for a factor.  ValueError as from `factor_of`
    """
    factor = 1.0
    for _ in range(STEPS):
        change = factor_of(looks_with(factor))
        factor *= change
        if abs(change - 1) < CLOSE:
            break
    return factor


def factor_of(looks: Looks) -> float:
    """v^2 over the square of the velocity with which the looks were focused.

    ValueError where they have too little in common to tell: noise, or ground without contrast.
    """
    n = len(looks.first)
    columns = np.array_split(np.arange(len(looks.ranges)), min(BLOCKS, len(looks.ranges)))
    ranges, speeds = (np.array([v[c].mean() for c in columns]) for v in (looks.ranges, looks.speeds))
    spectra = [cross_spectrum(looks.first[:, c], looks.second[:, c]) for c in columns]

    def lags(factor: float) -> np.ndarray:
        return displacement(looks, ranges, speeds, factor) / looks.row

    table = [np.fft.fftshift(np.fft.irfft(np.pad(x, (0, (FINER - 1) * n)), n=2 * FINER * n)) for x in spectra]
    lags_of_table = (np.arange(2 * FINER * n) - FINER * n) / FINER
    span = float(np.abs(lags(FACTORS[0]) - lags(FACTORS[1])).max())
    factors = np.linspace(*FACTORS, int(np.clip(FINER * span, 64, 20_000)))
    moved = np.array([lags(float(f)) for f in factors])
    totals = sum(np.interp(moved[:, i], lags_of_table, line) for i, line in enumerate(table))
    best = int(totals.argmax())
    every = sum(
        line[np.abs(lags_of_table) < n / 2] for line in table
    )  # the looks' likeness at any lag, to compare with
    middle = float(np.median(every))
    if best in (0, len(factors) - 1) or not totals[best] - middle > ENOUGH * np.median(np.abs(every - middle)):
        raise ValueError(
            "the Doppler rate cannot be told from the data: two looks have too little in common within "
            f"{FACTORS[0]:g} to {FACTORS[1]:g} of the geometry's rate, as noise or ground without contrast has; give "
            "doppler_rate='geometry', or a number in Hz/s"
        )
    optimum = optimize.minimize_scalar(
        lambda factor: -sum(correlation(x, lag) for x, lag in zip(spectra, lags(factor), strict=True)),
        bounds=(factors[max(best - 2, 0)], factors[min(best + 2, len(factors) - 1)]),
        method="bounded",
        options={"xatol": CLOSE / 4},
    )
    return float(optimum.x)


def displacement(looks: Looks, ranges: np.ndarray, speeds: np.ndarray, factor: float) -> np.ndarray:
    """Second look less first look, s (n,), of points at slant ranges, m (n,), where v^2 is `factor` times speeds^2."""
    late = [
        _ahead(speeds, q, ranges, looks.wavelength) - _ahead(speeds * np.sqrt(factor), q, ranges, looks.wavelength)
        for q in looks.doppler
    ]
    return np.asarray(late[1] - late[0])


def cross_spectrum(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Sum over columns of the looks' cross spectra along their n rows, without means, complex (n + 1,)."""
    n = len(first)
    a, b = (np.fft.rfft(look - look.mean(axis=0), n=2 * n, axis=0) for look in (first, second))
    return np.asarray((a.conj() * b).sum(axis=1))


def correlation(spectrum: np.ndarray, lag: float) -> float:
    """Sum of first[n] second[n + lag], from the cross spectrum, (n + 1,); lag need not be whole."""
    n = len(spectrum) - 1
    turned = (spectrum * np.exp(1j * np.pi * np.arange(n + 1) / n * lag)).real
    return float(2 * turned.sum() - turned[0] - turned[-1]) / (2 * n)


def _ahead(speed: np.ndarray, doppler: float, ranges: np.ndarray, wavelength: float) -> np.ndarray:
    """h of the equations at the head, s (n,)."""
    s = np.clip(wavelength * doppler / (2 * speed), -0.999, 0.999)
    return np.asarray(ranges / speed * s / np.sqrt(1 - s * s))


@dataclass(frozen=True, eq=False)
class TwoLooks:
    """The looks of echoes in the extent of an image, for hyperbolas whose Doppler rates are scaled.

    With a beam the looks are halves of its Doppler band. Without one all rows see all pixels, and the looks are the
    halves of the rows.

    weights  of samples (n_samples,) and rows (n_rows,);  wavelength  m
    """

    device: Device
    raw: PhaseHistory
    track: Track
    extent: Extent
    fit: Hyperbolas
    weights: tuple[np.ndarray, np.ndarray]
    budget: Budget
    wavelength: float

    def focused(self, factor: float) -> Looks:
        """Both looks where the squares of effective velocities are `factor` times those of the geometry."""
        fit = self.fit.scaled(factor)
        kept = [
            _middle(axis, most) for axis, most in zip((self.extent.times, self.extent.ranges), MOST_PIXELS, strict=True)
        ]
        band = replace(self.extent.band, window=None)  # with a window the middles of the looks would lie elsewhere
        extent = replace(self.extent, times=kept[0], ranges=kept[1], band=band)
        plan = make_plan(self.raw, self.track, extent, fit, 0.0, TOLERANCE)
        speeds = fit.at(extent.ranges)[0]
        speed = float(speeds.mean())
        if self.extent.has_beam:
            low, high = plan.band.low, plan.band.high
            half = (low + high) / 2
            plans = [replace(plan, band=replace(plan.band, low=a, high=b)) for a, b in ((low, half), (half, high))]
            rows = [self.weights[1]] * 2
            middles = (low + half) / 2, (half + high) / 2
        else:
            plans = [plan, plan]
            later = np.arange(self.raw.n_rows) >= self.raw.n_rows // 2
            rows = [self.weights[1] * part for part in (later, ~later)]  # Doppler frequencies fall along the rows
            when = [float((row * self.track.times).sum() / row.sum()) for row in rows]
            distance = np.array(extent.ranges.mean())
            first, second = (float(sine(np.array(extent.middle_time), distance, np.array(t), speed)) for t in when)
            middles = first, second
        intensities = [self._intensity(one, row) for one, row in zip(plans, rows, strict=True)]
        step = float(extent.times[1] - extent.times[0])
        doppler = 2 * speed / self.wavelength * middles[0], 2 * speed / self.wavelength * middles[1]
        return Looks(intensities[0], intensities[1], extent.ranges, speeds, step, doppler, self.wavelength)

    def _intensity(self, plan: FocusPlan, rows: np.ndarray) -> np.ndarray:
        """Intensities of one look, float64 (times, ranges) of mean 1."""
        job = Job(self.device, plan, self.raw, self.track, (self.weights[0], rows), self.budget)
        data = focus(job, Clock(), lambda _: None)
        power = np.abs(data).astype(np.float64) ** 2
        return np.asarray(power / np.maximum(power.mean(), 1e-300))


def _middle(axis: np.ndarray, most: int) -> np.ndarray:
    """At most so many neighbours from the middle of an axis."""
    start = max(0, (len(axis) - most) // 2)
    return axis[start : start + most]
