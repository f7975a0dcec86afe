"""What a straight track sees: a window over the aspects, and the wavenumbers along the track."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.special

from ...base.constants import SPEED_OF_LIGHT


@dataclass(frozen=True, eq=False)
class Aspects:
    """What the track sees of the scatterers: sines low ... high, at slant ranges nearest ... farthest, m, in a band.

    lags       (lowest, highest), m: antenna minus scatterer along the track
    taper      width of the window's edges, in sines;  edge  of its error function
    hard       whether the beam ends at the lowest, and at the highest aspect: the window then falls to 0 within it
    """

    low: float
    high: float
    nearest: float
    farthest: float
    band: tuple[float, float]
    lags: tuple[float, float]
    taper: float
    edge: float
    hard: tuple[bool, bool] = (False, False)

    @property
    def fresnel(self) -> float:
        """Width of a Fresnel zone at the nearest range, in sines."""
        return fresnel_zone(self.low, self.high, self.nearest, self.band[0])

    @property
    def middle_range(self) -> float:
        """Range in the middle, m."""
        return (self.nearest + self.farthest) / 2

    def window(self, sine: np.ndarray) -> np.ndarray:
        """1 at aspects that are seen, falling to 0 over the taper."""
        outside = np.abs(sine - (self.low + self.high) / 2) - (self.high - self.low) / 2
        t = np.clip(outside / self.taper, 0, 1)
        return np.where(t < 1, scipy.special.erfc(self.edge * (t - 0.5)) / 2, 0) / (
            scipy.special.erfc(-self.edge / 2) / 2
        )

    @property
    def support(self) -> tuple[float, float]:
        """Sines beyond which the window is 0."""
        return self.low - self.taper, self.high + self.taper

    @property
    def seen(self) -> tuple[float, float]:
        """Sines between which responses are the window times the amplitudes: its falling edges are part of the echoes
        at hard edges of a beam, and beyond all that a pulse sees elsewhere."""
        low, high = self.support
        return low if self.hard[0] else self.low, high if self.hard[1] else self.high


def fresnel_zone(low: float, high: float, slant_range: float, frequency: float) -> float:
    """Width of a Fresnel zone, in sines of the aspect: H's phase over u/2k curves by 1 rad in it."""
    cosine = np.sqrt(1 - max(abs(low), abs(high)) ** 2)
    return float(cosine**1.5 / np.sqrt(4 * np.pi * frequency / SPEED_OF_LIGHT * slant_range))


def aspects(
    low: float, high: float, ranges: tuple[float, float], band: tuple[float, float], lags: tuple[float, float],
    tolerance: float, hard: tuple[bool, bool] = (False, False),
) -> Aspects:  # fmt: skip
    """Aspects between two sines with a window whose edges cause errors of about `tolerance`; where an end is a hard
    edge of the beam, the window's edge lies within, over half the beam at most.

    The ratio of the window's edge to a Fresnel zone was measured: errors of 1.9e-3, 3e-4, 3e-5 at 0.67, 1, 1.33.
    """
    edge = 2 * float(scipy.special.erfcinv(min(tolerance / 3, 0.1)))
    ratio = max(0.7, (-np.log10(tolerance) - 0.55) / 2.9)
    taper = edge * ratio * fresnel_zone(low, high, ranges[0], band[0])
    if any(hard):
        taper = min(taper, (high - low) / sum(hard))
    low, high = low + taper * hard[0], high - taper * hard[1]
    return Aspects(low, high, *ranges, band, lags, taper, edge, hard)


@dataclass(frozen=True, eq=False)
class DopplerGrid:
    """Wavenumbers along track u = 2 pi i/period, i = first ... first + count - 1, of a length of `period` m.

    n_lags  pulses in a period: samples of the track are the folded inverse FFT of this length
    """

    period: float
    n_lags: int
    first: int
    count: int

    @property
    def indices(self) -> np.ndarray:
        """i (count,)."""
        return self.first + np.arange(self.count)

    @property
    def wavenumbers(self) -> np.ndarray:
        """u, rad/m (count,)."""
        return 2 * np.pi * self.indices / self.period

    def folded(self, spectrum: np.ndarray) -> np.ndarray:
        """Spectra (n, count) as those of samples at the pulses, (n, n_lags): wavenumbers one PRF apart added."""
        out = np.zeros((len(spectrum), self.n_lags), spectrum.dtype)
        start = 0
        while start < self.count:
            at = (self.first + start) % self.n_lags
            n = min(self.n_lags - at, self.count - start)
            out[:, at : at + n] += spectrum[:, start : start + n]
            start += n
        return out


def wavenumber(frequency: float | np.ndarray) -> np.ndarray:
    """k = 2 pi f/c, rad/m."""
    return np.asarray(2 * np.pi * frequency / SPEED_OF_LIGHT)


class ResponsePhase(Protocol):
    """A phase that is taken out of transfer functions before they are tabulated; the tables' variable."""

    @property
    def middle_range(self) -> float:
        """Range from which the phases of samples count, m."""

    @property
    def paraxial(self) -> float | None:
        """Of SARAS's approximation: k_0, rad/m."""

    def ratio(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """The variable of the tables at wavenumbers along the track and k, rad/m."""

    def kappa(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """Wavenumber over slant range, rad/m."""

    def at_middle(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """Phase at the middle range, rad."""


@dataclass(frozen=True, eq=False)
class KnownPhase:
    """The phase of responses along the track that is taken out before A is tabulated.

    middle_range  r_c, m
    paraxial      None: exact. k_0, rad/m: as SARAS approximates it, with parabolas over u; the range's share at the
                  centre of the band alone (equations 27 and 34, signs of the numerical transform)
    """

    middle_range: float
    paraxial: float | None = None

    def ratio(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """The variable of the tables: u/2k, of SARAS u/2k_0."""
        return np.asarray(u / (2 * (k if self.paraxial is None else self.paraxial + 0 * np.asarray(k))))

    def kappa(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """Wavenumber over slant range, rad/m: sqrt(4 k^2 - u^2), of SARAS 2 k - u^2/4 k_0."""
        if self.paraxial is None:
            return np.asarray(np.sqrt(np.maximum(4 * np.square(k) - u**2, 1e-6)))
        return np.asarray(2 * k - u**2 / (4 * self.paraxial))

    def at_middle(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """Phase at the middle range, rad: -(sqrt(4 k^2 - u^2) - 2 k) r_c, of SARAS u^2 r_c/4 k."""
        if self.paraxial is None:
            return np.asarray(u**2 * self.middle_range / (self.kappa(u, k) + 2 * k))
        return np.asarray(u**2 * self.middle_range / (4 * k))
