"""Transfer functions along track, transformed numerically: amplitude left when the known phase is taken out.

A scatterer at slant range r that is seen with the amplitude w(s), s the sine of its aspect, sends along the track

    h(x; r, k) = w(s) exp(-j 2 k (R - r)),   R = sqrt(r^2 + x^2),  s = x/R,  k = 2 pi f/c

Its transform over x is H(u; r, k) = sqrt(r/r_c) A exp(-j (kappa - 2 k) r) with kappa = sqrt(4 k^2 - u^2). A depends on
u/2k and k r alone, and changes slowly: it is transformed by FFT at a few ranges and frequencies, tabulated over u/2k,
and interpolated between them. Beyond the aspects at which any pulse sees any scatterer, w is continued and falls to 0
over a few Fresnel zones: there the samples do not depend on it. docs/theory/spectral_echo.md derives it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.errors import NotApplicable, ToleranceUnreachable
from ...numerics.polynomials import chebyshev, lagrange
from ...opencl import fft
from ._aspect_window import Aspects, DopplerGrid, KnownPhase, ResponsePhase, wavenumber
from ._straight_track import StraightTrack, tangent
from .planning_time import PlanningTime

# Ranges and frequencies of the tables, and width of their margins in Fresnel zones, that are tried one after the other.
TRIED = ((1, 1, 4), (1, 2, 4), (2, 2, 4), (2, 3, 4), (3, 3, 4), (3, 4, 16), (4, 4, 64), (6, 8, 64))
CELLS = 8  # of a table per Fresnel zone, for a margin of 4
TESTED = 4  # scatterers whose responses are compared with the formula
COMPARED = 9  # ranges and frequencies, three of each, at which they are compared
SAFETY = 1.5  # the error is measured at a few ranges and frequencies
MOST_CELLS = 2**22  # of a table, and lags of a transform: beyond, echo is the better choice

Functions = Callable[[np.ndarray, float], np.ndarray]  # (sines (n,), frequency, Hz) -> complex128 (J, n)


@dataclass(frozen=True, eq=False)
class AzimuthTransfer:
    """Tables of A over u/2k = start + i step: complex128 (J, ranges, frequencies, n), for J amplitude functions.

    phase                that is taken out of the responses, and the variable of the tables
    ranges, frequencies  m (Q,), Hz (M,): nodes;  error  relative, of responses made from the tables
    """

    aspects: Aspects
    phase: ResponsePhase
    ranges: np.ndarray
    frequencies: np.ndarray
    start: float
    step: float
    tables: np.ndarray
    error: float = 0.0

    def range_weights(self, slant_range: np.ndarray) -> np.ndarray:
        """Shares of the tables of each range in a response at slant ranges (n,), with sqrt(r/r_c): (Q, n)."""
        middle = self.aspects.middle_range
        return lagrange(middle / self.ranges, middle / slant_range) * np.sqrt(slant_range / middle)

    def basis(self, frequencies: np.ndarray) -> np.ndarray:
        """Shares of the tables of each frequency (M, n): A falls with 1/sqrt(f), which is taken out."""
        return lagrange(self.frequencies, frequencies) * np.sqrt(self.frequencies[:, None] / frequencies)

    @property
    def limits(self) -> tuple[float, float]:
        """Values of u/2k between which A is not 0."""
        return self.start + self.step, self.start + (self.tables.shape[-1] - 3) * self.step

    def positions(self, ratio: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First of four table cells for values of u/2k, and distance from the second in cells; -1 outside the table."""
        position = (ratio - self.start) / self.step
        inside = (position >= 1) & (position < self.tables.shape[-1] - 2)
        cell = np.floor(np.where(inside, position, 1))
        return np.where(inside, cell - 1, -1).astype(np.int32), np.where(inside, position - cell, 0)

    def amplitude(self, term: int, node: int, frequency: float, u: np.ndarray) -> np.ndarray:
        """A of one function, by the table of one range, at wavenumbers u (n,): as the kernel interpolates it."""
        k = float(wavenumber(frequency))
        cell, z = self.positions(self.phase.ratio(u, k))
        weights = lagrange(np.array([-1.0, 0, 1, 2]), z)
        table = self.basis(np.array([frequency]))[:, 0] @ self.tables[term, node]
        made = sum(weights[i] * table[np.maximum(cell, 0) + i] for i in range(4))
        return np.asarray(np.where(cell < 0, 0, made))


def doppler_grid(transfer: AzimuthTransfer, track: StraightTrack, reach: tuple[float, float]) -> DopplerGrid:
    """The wavenumbers of a transfer function; reach  lowest and highest end of any scatterer's response, m (2,)."""
    n_lags = lags_of(track, reach)
    period = n_lags * track.spacing
    k = wavenumber(np.array(transfer.aspects.band))
    ends = np.outer(1 / transfer.phase.ratio(np.ones(2), k), transfer.limits) * period / (2 * np.pi)
    first = int(np.ceil(ends.min()))
    return DopplerGrid(period, n_lags, first, max(1, int(np.floor(ends.max())) - first + 1))


def lags_of(track: StraightTrack, reach: tuple[float, float]) -> int:
    """Pulse intervals of a period that holds the track and any scatterer's response; reach as of `doppler_grid`."""
    length = max(reach[1], track.length - min(reach[0], 0.0)) + 2 * track.spacing
    return fft.good_length(int(np.ceil(length / track.spacing)))


def compared_samples(n_factors: int, n_functions: int, n_lags: int) -> float:
    """Samples that are transformed where responses are compared with the formula: see `response_error`."""
    return float(COMPARED) * (n_factors + n_functions) * n_lags


def transfer_tables(
    aspects: Aspects, functions: Functions, n_ranges: int, n_frequencies: int, margin: float
) -> AzimuthTransfer:
    """Tables at Chebyshev nodes of ranges and frequencies. `margin`: Fresnel zones by which they exceed the window."""
    low, high = aspects.support
    start, step, n = _cells(aspects, margin)
    inverse = np.sort(
        chebyshev(0.5 / aspects.nearest + 0.5 / aspects.farthest, 1 / aspects.nearest - 1 / aspects.farthest, n_ranges)
    )
    ranges, middle = 1 / inverse, aspects.middle_range
    frequencies = chebyshev(sum(aspects.band) / 2, aspects.band[1] - aspects.band[0], n_frequencies)
    tables = None
    for q, r in enumerate(ranges.tolist()):
        for m, f in enumerate(frequencies.tolist()):
            k = float(wavenumber(f))
            lag_step = np.pi / (k * n * step)
            first, count = _lags(aspects, r, lag_step, n)
            if max(count, n) > MOST_CELLS:
                raise NotApplicable(
                    f"scatterers are seen over {r * (high - low):.3g} m of track, which would need transforms of "
                    f"{max(count, n)} samples, and spectral_echo takes up to {MOST_CELLS}; use echo"
                )
            lag = (first + np.arange(count)) * lag_step
            distance = np.hypot(r, lag)
            sine = lag / distance
            window = aspects.window(sine)
            inside = np.flatnonzero(window)
            wave = window[inside] * np.exp(-2j * k * lag[inside] ** 2 / (distance[inside] + r))
            wave *= np.exp(-2j * k * start * lag[inside])
            response = np.zeros((1, count), np.complex128)
            made = functions(sine[inside], f)
            ratio = start + np.arange(n) * step
            u = 2 * k * ratio
            kappa = 2 * k * np.sqrt(np.maximum(1 - ratio**2, 1e-6))
            known = lag_step * np.sqrt(middle / r) * np.exp(1j * (-(u**2) / (kappa + 2 * k)) * r)
            # exp(-j u lag) of the first lag; its whole steps are the FFT's
            known = known * np.exp(-1j * (u - u[0]) * (first * lag_step))
            if tables is None:
                tables = np.empty((len(made), n_ranges, n_frequencies, n), np.complex128)
            for j, psi in enumerate(made):
                response[0, inside] = psi * wave
                folded = response.reshape(-1, n).sum(axis=0)[None]
                tables[j, q, m] = fft.rows(None, folded)[0] * known
    assert tables is not None
    return AzimuthTransfer(aspects, KnownPhase(middle), ranges, frequencies, start, step, tables)


def table_samples(aspects: Aspects, n_functions: int, n_ranges: int, n_frequencies: int, margin: float) -> float:
    """Samples that are transformed for tables: see `transfer_tables`."""
    _, step, n = _cells(aspects, margin)
    k = float(wavenumber(aspects.band[1]))
    lags = _lags(aspects, aspects.farthest, np.pi / (k * n * step), n)[1]
    return float(n_ranges * n_frequencies * n_functions) * max(lags, n)


def _cells(aspects: Aspects, margin: float) -> tuple[float, float, int]:
    """First value of u/2k in a table, the step to the next one, and their number."""
    zone, (low, high) = aspects.fresnel, aspects.support
    step = zone / (CELLS * max(1.0, margin / 4))
    n = fft.good_length(int(np.ceil((high - low + 2 * margin * zone) / step)) + 4)
    return -high - margin * zone, step, n


def _lags(aspects: Aspects, slant_range: float, step: float, n: int) -> tuple[int, int]:
    """The first lag at which a slant range, m, is seen, in steps, m, and how many there are: a multiple of n."""
    first, last = (int(np.floor(slant_range * float(tangent(end)) / step)) for end in aspects.support)
    return first, -(-(last - first + 2) // n) * n


@dataclass(frozen=True, eq=False)
class SeenScatterers:
    """Some scatterers: factors (n, J), places along the track and slant ranges, m (n,)."""

    factors: np.ndarray
    azimuth: np.ndarray
    slant_range: np.ndarray


class AllowedError(NamedTuple):
    """Error that transfer functions may have, and the tolerance that was asked for, of which it is a share."""

    error: float
    tolerance: float


def plan_transfer(
    aspects: Aspects,
    functions: Functions,
    factors: np.ndarray,
    track: StraightTrack,
    reach: tuple[float, float],
    allowed: AllowedError,
    time: PlanningTime,
    groups: Sequence[SeenScatterers] = (),
) -> AzimuthTransfer:
    """The smallest tables whose responses differ from the formula by no more than is allowed.

    factors  of some scatterers (n, J);  time  that the plan may take
    groups   of scatterers whose samples are compared too, at the pulses that there are
    """
    best, n_lags = np.inf, lags_of(track, reach)
    some, n_functions = factors[:TESTED].shape
    for tried in TRIED:
        time.spend(compared_samples(some, n_functions, n_lags), n_lags)
        time.spend(table_samples(aspects, n_functions, *tried), n_lags)
        transfer = transfer_tables(aspects, functions, *tried)
        error = response_error(transfer, functions, factors[:TESTED], track, reach)
        error = max(error, *(_seen_error(transfer, functions, group, track, reach) for group in groups), 0.0)
        error *= SAFETY
        best = min(best, error)
        if error <= allowed.error:
            return replace(transfer, error=error)
    raise ToleranceUnreachable(
        allowed.tolerance,
        None,
        "transform along the track of beams with edges",
        "use echo",
        f"by spectral_echo: transfer functions leave {best:.1e} of the responses along the track",
    )


def response_error(
    transfer: AzimuthTransfer,
    functions: Functions,
    factors: np.ndarray,
    track: StraightTrack,
    reach: tuple[float, float],
) -> float:
    """Largest relative error of responses along the track made from tables, over stretches as long as the track.

    Where the track sees little of the responses at one range, their error counts relative to the mean of all ranges.
    """
    aspects, worst = transfer.aspects, 0.0
    low, high = aspects.band
    ranges = sorted({aspects.nearest, aspects.farthest, 0.6 * aspects.nearest + 0.4 * aspects.farthest})
    for f in {low, high, 0.4 * low + 0.6 * high}:
        power = np.array([_power_and_error(transfer, functions, factors, track, reach, r, f) for r in ranges])
        right = np.maximum(power[:, 0], power[:, 0].mean())
        worst = max(worst, float(np.sqrt((power[:, 1] / right).max())) if right.any() else 0.0)
    return worst


def _power_and_error(
    transfer: AzimuthTransfer, functions: Functions, factors: np.ndarray, track: StraightTrack,
    reach: tuple[float, float], r: float, f: float,
) -> tuple[float, float]:  # fmt: skip
    """Power of the responses at slant range r, m, and frequency f, Hz, and of their error."""
    aspects, grid = transfer.aspects, doppler_grid(transfer, track, reach)
    # a period away the response is 0 at all lags at which scatterers of this range are seen
    begin, end = (r * float(tangent(sine)) for sine in aspects.support)
    low_seen, high_seen = (r * float(tangent(sine)) for sine in aspects.seen)
    first = max(aspects.lags[0], low_seen, end - grid.period)
    last = min(aspects.lags[1], high_seen, begin + grid.period)
    n = min(int((last - first) / track.spacing), grid.n_lags)
    if n < 1:
        return 0.0, 0.0
    lag = first + np.arange(n) * track.spacing
    response, exact = _responses(transfer, functions, factors, grid, r, f, lag)
    span = min(n, track.n_pulses)
    return _largest_sum(np.abs(exact) ** 2, span), _largest_sum(np.abs(response - exact) ** 2, span)


def _seen_error(
    transfer: AzimuthTransfer,
    functions: Functions,
    seen: SeenScatterers,
    track: StraightTrack,
    reach: tuple[float, float],
) -> float:
    """Relative error of the samples of some scatterers, at all pulses.

    A short track may see them far below what stretches elsewhere along the track would.
    """
    grid, wrong, right = doppler_grid(transfer, track, reach), 0.0, 0.0
    n = min(track.n_pulses, grid.n_lags)
    for f in transfer.aspects.band:
        for i, r in enumerate(seen.slant_range.tolist()):
            lag = -float(seen.azimuth[i]) + np.arange(n) * track.spacing
            response, exact = _responses(transfer, functions, seen.factors[[i]], grid, r, f, lag)
            wrong += float((np.abs(response - exact) ** 2).sum())
            right += float((np.abs(exact) ** 2).sum())
    return float(np.sqrt(wrong / right)) if right else 0.0


def _responses(
    transfer: AzimuthTransfer,
    functions: Functions,
    factors: np.ndarray,
    grid: DopplerGrid,
    r: float,
    f: float,
    lag: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Responses (n_factors, n) at evenly spaced lags, m (n,), by the tables and by the formula."""
    u, k = grid.wavenumbers, float(wavenumber(f))
    turn = transfer.phase.at_middle(u, k) - (transfer.phase.kappa(u, k) - 2 * k) * (r - transfer.aspects.middle_range)
    known = np.exp(1j * (turn + u * lag[0])) / grid.period
    shares = transfer.range_weights(np.array([r]))[:, 0]
    tables = [[transfer.amplitude(j, q, f, u) for q in range(len(shares))] for j in range(len(transfer.tables))]
    spectra = (factors @ np.einsum("q,jqu->ju", shares, np.array(tables))) * known
    response = fft.rows(None, grid.folded(spectra), inverse=True)[:, : len(lag)]
    distance = np.hypot(r, lag)
    wave = np.exp(-2j * k * lag**2 / (distance + r)) * transfer.aspects.window(lag / distance)
    return response, (factors @ functions(lag / distance, f)) * wave


def _largest_sum(power: np.ndarray, n: int) -> float:
    """Largest sum over n neighbours, added over all rows."""
    total = np.concatenate([np.zeros((len(power), 1)), np.cumsum(power, axis=1)], axis=1)
    return float((total[:, n:] - total[:, :-n]).max(axis=1).sum())
