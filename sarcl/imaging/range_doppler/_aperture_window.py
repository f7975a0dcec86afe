"""A window over the beam, as a weight of Doppler bins: a function of the sine of the squint angle.

    w(s) = int B(s - x) W(u(x)) dx,    u(x) = (tan a - tan a_low)/(tan a_high - tan a_low),   sin a = x

W is the window over the rows that see a point, from the first to the last: rows are even in time, and so in tan a,
whatever the slant range. W is 0 outside the beam. B is a bump of some Fresnel zones: the stationary phase, which
takes a weight of Doppler bins for one of rows, has an error where weights change within a zone. Where W ends at 0.08,
as Hamming's does, its step becomes as smooth as the ends of a beam without a window, about the same place: the sum of
the weights stays, and the side lobes are those of W times the transform of B, which is at most 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAST_ZONES = 1.5  # Fresnel zones, smallest width of B
# of the width of B, by which W begins and ends within the beam, so that hardly any weight is left to rows outside,
# which an antenna whose beam ends there does not see: the first that leaves them OUTSIDE of the weights, 0.04 dB, or
# less. W is that much narrower. Windows that fall towards their ends take the first, one that does not takes more
INWARDS = 1 / 8, 3 / 16, 1 / 4, 5 / 16, 3 / 8, 7 / 16, 1 / 2
OUTSIDE = 4e-3
FINE, FINEST = 32, 2048  # least cells of the table per Fresnel zone, and in the beam
FAINTEST = 1e-9  # share of the largest weight: smaller ones are rounding of an FFT
MARGIN = 12.0  # Fresnel zones beside the beam in which the stationary phase is compared: it spreads by a few


@dataclass(frozen=True, eq=False)
class ApertureWindow:
    """Weights at even sines of the squint angle.

    sines    (n,);  weights (n,), 0 at both ends;  bends (n,) their second derivative
    error    relative error of an image of white noise with these weights
    """

    sines: np.ndarray
    weights: np.ndarray
    bends: np.ndarray
    error: float

    @classmethod
    def over(
        cls, low: float, high: float, table: np.ndarray, zone: float, allowed: float, *,
        inwards: tuple[float, ...] = INWARDS,
    ) -> ApertureWindow:  # fmt: skip
        """The window over a beam from `low` to `high`, sines, with an error of at most `allowed`.

        table    W at the middles of even cells of 0 <= u <= 1, as windows.table makes it
        zone     width of a Fresnel zone, as a sine
        inwards  shares of the smooth ends that may lie within the beam, from the smallest on
        """
        zones = LEAST_ZONES
        while True:
            for share in inwards:
                window = cls._smoothed(low, high, table, zone, zones, share)
                if window.error > allowed or window.outside(low, high) <= OUTSIDE:
                    break
            if window.error <= allowed:
                return window
            zones *= 1.2

    def outside(self, low: float, high: float) -> float:
        """Share of the weights that rows have which see the point beyond a beam from `low` to `high`, sines."""
        seen = np.abs(self.sines) < 1  # rows are even in the tangent, and none sees anything under a sine of 1 or more
        sines, weights = self.sines[seen], self.weights[seen]
        rows = weights / (1 - sines**2) ** 1.5
        return float(rows[(sines < low) | (sines > high)].sum() / rows.sum())

    @classmethod
    def _smoothed(
        cls, low: float, high: float, table: np.ndarray, zone: float, zones: float, share: float
    ) -> ApertureWindow:
        from scipy.signal import fftconvolve

        step = min(zone / FINE, (high - low) / FINEST)
        half = int(np.ceil(zones * zone / 2 / step))
        inwards = min(share * zones * zone, (high - low) / 4)  # a beam of few zones keeps half of itself
        low, high = low + inwards, high - inwards
        n = int(np.ceil((high - low) / step)) + 2 * half + 1
        sines = (low + high) / 2 + step * (np.arange(n) - (n - 1) / 2)
        inside = (sines >= low) & (sines <= high)
        ends, tangents = _tangent(np.array([low, high])), _tangent(np.clip(sines, low, high))
        cells = (np.arange(len(table)) + 0.5) / len(table)
        window = np.interp((tangents - ends[0]) / (ends[1] - ends[0]), cells, table) * inside
        x = (np.arange(2 * half + 1) + 0.5) / (2 * half + 1)
        bump = (x * (1 - x)) ** 2  # its integral is the rise x^3 (10 - 15 x + 6 x^2) of the ends of a band
        weights = fftconvolve(window, bump / bump.sum(), mode="same")
        weights[weights < FAINTEST * weights.max()] = 0
        bends = np.gradient(np.gradient(weights, step), step)
        return cls(sines, weights, bends, _error(weights, step / zone))

    def weight(self, sines: np.ndarray) -> np.ndarray:
        """Weights at sines of squint angles, of any shape."""
        return np.interp(sines, self.sines, self.weights)

    def bend(self, sines: np.ndarray) -> np.ndarray:
        """Second derivatives of the weights."""
        return np.interp(sines, self.sines, self.bends)

    @property
    def ends(self) -> tuple[float, float]:
        """The sines between which weights are not zero."""
        used = np.flatnonzero(self.weights)
        return float(self.sines[used[0]]), float(self.sines[used[-1]])


def _tangent(sines: np.ndarray) -> np.ndarray:
    return np.asarray(sines / np.sqrt(1 - sines**2))


def _error(weights: np.ndarray, step: float) -> float:
    """Relative difference of the rows' weights from the two terms of the stationary phase; step in Fresnel zones.

    Weights of Doppler bins become those of rows by a convolution with a chirp, a factor exp(j pi n^2) at n cycles per
    zone; its first two terms are 1 + j pi n^2.
    """
    import scipy.fft

    length = scipy.fft.next_fast_len(len(weights) + int(2 * MARGIN / step), real=True)
    power = np.abs(scipy.fft.rfft(weights, length)) ** 2
    phase = np.pi * np.fft.rfftfreq(length, step) ** 2
    return float(np.sqrt((np.abs(np.exp(1j * phase) - 1 - 1j * phase) ** 2 * power).sum() / power.sum()))
