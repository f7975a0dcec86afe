"""Aspects between which the beam of an antenna receives all but a share of the energy of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._scatterer_amplitudes import ScattererAmplitudes
from ._straight_track import tangent

PROFILE, DRAWN = 2048, 48  # aspects, and scatterers whose gains are averaged at each
MEASURED = 32768  # scatterers among which the energy that limits leave out is measured
PAIRS = 1024  # of these scatterers, each with a pulse, that are drawn
FEW_PAIRS = 8192  # of which all are looked at
HALF_POWER = 0.25  # two-way power at which a one-way beam has half its power
TRIES = 8  # limits that are tried, each leaving out less energy than the one before
ROUNDING = 1e-6  # pulse intervals: a limit so near to a pulse is at the pulse
DEVIATIONS = 2  # standard deviations of measured energies that are allowed for


@dataclass(frozen=True)
class BeamExtent:
    """Sines of aspects.

    low, high  outside of which nothing is computed;  outside  relative error of what is left out
    main       between which the beam has half its power
    """

    low: float
    high: float
    outside: float
    main: tuple[float, float]


def beam_extent(
    amplitudes: ScattererAmplitudes,
    first: np.ndarray,
    last: np.ndarray,
    band: tuple[float, float],
    allowed: float,
    among: np.ndarray | None = None,
) -> BeamExtent:
    """The extent of a beam that leaves out an error of `allowed` at most, relative to all echoes at random phases.

    first, last  sines between which the track sees each scatterer (n,);  band  Hz, its limits
    among        indices of these scatterers (n,); None: all
    The aspects are those of all scatterers, by their sizes. Limits come from a mean gain; what they leave out is then
    measured at scatterers and pulses drawn for that purpose, and counts in the prediction.
    """
    ends, share = (float(first.min()), float(last.max())), allowed / 2
    if not ends[0] < ends[1]:
        return BeamExtent(*ends, 0.0, ends)
    energy = _Energy(amplitudes, first, last, band, among)
    whole = energy.profile(ends)
    if not whole.any():
        return BeamExtent(*ends, 0.0, ends)
    for _ in range(TRIES):
        inner = _within(whole, ends, share)
        near = energy.profile(inner)  # again between limits that were found: beams may be narrow
        low, high = _within(near, inner, share)
        outside = energy.left_out(low, high)
        if outside <= allowed:
            return BeamExtent(low, high, outside, _main_lobe(near, inner))
        share *= 0.5 * allowed / outside
    return BeamExtent(*ends, 0.0, _main_lobe(whole, ends))


def _main_lobe(power: np.ndarray, limits: tuple[float, float]) -> tuple[float, float]:
    """The first and the last of evenly spaced sines at which a beam has half its power or more."""
    lit = np.flatnonzero(power >= HALF_POWER * power.max())
    sines = np.linspace(*limits, len(power))
    return float(sines[lit[0]]), float(sines[lit[-1]])


def _within(power: np.ndarray, limits: tuple[float, float], share: float) -> tuple[float, float]:
    """Limits of evenly spaced sines outside of which lies at most share^2 / 2 of the energy."""
    sines, total = np.linspace(*limits, len(power)), np.cumsum(power)
    half = 0.25 * share**2 * total[-1]
    one = max(0, int(np.searchsorted(total, half)) - 1)
    two = min(len(power) - 1, int(np.searchsorted(total, total[-1] - half)) + 1)
    return float(sines[one]), float(sines[two])


class _Energy:
    """Energy of scatterers over aspect: of the pulses between two sines of each."""

    def __init__(
        self,
        amplitudes: ScattererAmplitudes,
        first: np.ndarray,
        last: np.ndarray,
        band: tuple[float, float],
        among: np.ndarray | None,
    ) -> None:
        self.amplitudes, self.band, self.among = amplitudes, band, among
        size = amplitudes.size if among is None else amplitudes.size[among]
        size = size if size.any() else np.ones(len(first))
        self.ends = float(first.min()), float(last.max())
        self.seen = self._seen(first, last, size)
        self.random = np.random.default_rng(1)
        chance = np.cumsum(size + size.mean())
        n = min(DRAWN, len(size))
        self.drawn, self.share = np.arange(n), np.ones(n)
        if n < len(size):
            self.drawn = np.searchsorted(chance[:-1], np.sort(self.random.random(n)) * chance[-1])
            self.share = 1 / (size[self.drawn] + size.mean())
        self.some, self.weight = np.arange(len(size)), np.ones(len(size))
        if len(size) > MEASURED:  # each of those that are measured represents several
            self.some = np.searchsorted(chance[:-1], (np.arange(MEASURED) + 0.5) / MEASURED * chance[-1])
            self.weight = chance[-1] / MEASURED / (size[self.some] + size.mean())
        self.size = size[self.some]

    def _seen(self, first: np.ndarray, last: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Sum of the sizes of the scatterers that are seen within each of PROFILE - 1 intervals, evenly spaced between
        the ends."""
        scale = (PROFILE - 1) / (self.ends[1] - self.ends[0])
        begin, end = (((at - self.ends[0]) * scale).astype(np.int32) for at in (first, last))
        change = np.bincount(begin, size, PROFILE + 1) - np.bincount(end + 1, size, PROFILE + 1)
        change[PROFILE - 2] += change[PROFILE - 1]  # the upper end itself lies within the last interval
        return np.asarray(np.maximum(np.cumsum(change[: PROFILE - 1]), 0))

    def power(self, some: np.ndarray, sines: np.ndarray) -> np.ndarray:
        """Of scatterers (n,), each at one of the sines (n,): (n,)."""
        return np.asarray(sum((np.abs(self.amplitudes(some, sines, f)) ** 2).sum(axis=1) for f in self.band))

    def profile(self, limits: tuple[float, float]) -> np.ndarray:
        """Energy at PROFILE sines between limits: a mean gain, by the sizes of the scatterers that are seen there."""
        sines, n = np.linspace(*limits, PROFILE), len(self.drawn)
        drawn = self.drawn if self.among is None else self.among[self.drawn]
        gain = self.power(np.repeat(drawn, PROFILE), np.tile(sines, n)).reshape(n, PROFILE)
        at = (sines - self.ends[0]) * ((PROFILE - 1) / (self.ends[1] - self.ends[0]))
        seen = self.seen[np.clip(at.astype(np.int64), 0, PROFILE - 2)]
        share = self.share * self.amplitudes.slant_range[drawn]  # pulses per sine: range / cosine^3
        return np.asarray((share @ gain) * seen * (1 - sines**2) ** -1.5)

    def left_out(self, low: float, high: float) -> float:
        """Relative error of leaving out what lies below `low` and above `high`, measured at pulses, with a margin.

        A narrow beam may pass scatterers between two pulses, which then see side lobes alone.
        """
        track, n = self.amplitudes.track, self.amplitudes.track.n_pulses
        some = self.some if self.among is None else self.among[self.some]
        azimuth, slant_range = self.amplitudes.azimuth[some], self.amplitudes.slant_range[some]
        ends = [(azimuth + slant_range * float(tangent(end))) / track.spacing for end in (low, high)]
        first = np.clip(np.ceil(ends[0] - ROUNDING), 0, n)  # pulse of each that is not below
        stop = np.clip(np.floor(ends[1] + ROUNDING) + 1, first, n)
        if not first.any() and (stop == n).all():
            return 0.0
        lost, deviation = self._measured((np.zeros(len(some)), first), (stop, n - stop))
        kept, uncertain = self._measured((first, stop - first))
        most, least = lost + DEVIATIONS * deviation, max(kept - DEVIATIONS * uncertain, kept / 2)
        return float(np.sqrt(most / (least + most))) if most else 0.0

    def _measured(self, *runs: tuple[np.ndarray, np.ndarray]) -> tuple[float, float]:
        """Energy at runs of pulses of each scatterer, (first, number), and its standard deviation: from all pairs of
        scatterer and pulse where these are few, else from PAIRS of them.

        A third of the pairs are drawn by size, a third by its square, as the energies of smooth facets are, and a third
        alike: a faint scatterer in a side lobe may send back more than a strong one in a null.
        """
        first, number = (np.concatenate(one) for one in zip(*runs, strict=True))
        size = np.tile(self.size, len(runs))
        plain = np.tile(self.weight, len(runs)) * size * number
        if not plain.any():
            return 0.0, 0.0
        total = int(number.sum())
        if total <= FEW_PAIRS:
            at = np.repeat(np.arange(len(number)), number.astype(np.int64))
            pulse = first[at] + np.arange(total) - (np.cumsum(number) - number)[at]
            return float((self._powers(at, pulse) * self.weight[at % len(self.some)]).sum()), 0.0
        squared, alike = plain * size, np.tile(self.weight, len(runs)) * number
        chance = (plain / plain.sum() + squared / squared.sum() + alike / alike.sum()) / 3
        at = np.searchsorted(np.cumsum(chance)[:-1], self.random.random(PAIRS))
        pulse = first[at] + np.floor(self.random.random(PAIRS) * number[at])
        which = at % len(self.some)
        found = self._powers(at, pulse) * self.weight[which] * number[at] / chance[at]
        return float(found.mean()), float(found.std() / np.sqrt(PAIRS))

    def _powers(self, at: np.ndarray, pulse: np.ndarray) -> np.ndarray:
        """Of the scatterers of runs `at` (n,), each at a pulse (n,): (n,)."""
        which = self.some[at % len(self.some)]
        some = which if self.among is None else self.among[which]
        return self.power(some, self.amplitudes.sines(pulse * self.amplitudes.track.spacing, some))
