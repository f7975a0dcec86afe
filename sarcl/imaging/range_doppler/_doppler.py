"""The Doppler band that an image needs, as sines of the squint angle, and the Doppler centroid.

A point at zero-Doppler time u and slant range r is seen at time t under sin(angle) = v (u - t)/R, its Doppler frequency
is 2 f v sin(angle)/c. Bands end in tapers wide compared with the Fresnel zone: sharp ends would ring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import warn
from ...model.phase_history import PhaseHistory
from ._aperture_window import ApertureWindow

STEEPEST = 0.98  # largest sine of a squint angle
EVANESCENT = 0.999  # sine from which on a Doppler bin is left out: at 1 no wave has its Doppler frequency
MOST_ROWS = 2048  # rows from which a Doppler centroid is estimated
# Relative error by the ends of the band: FRESNEL / (k^3 sqrt(n)) for tapers of k Fresnel widths and a pixel's band of n
# of them. Measured with noise: 0.1 where the tapers lie beyond the rows, 0.45 where rows are weighted by them (beams).
FRESNEL, FRESNEL_BEAM = 0.2, 0.6
LEAST_ZONES = 1.5  # Fresnel widths of a taper, at least
PARTS, SURE = 8, 4  # parts of the rows by which a centroid is judged, and standard deviations


@dataclass(frozen=True)
class Band:
    """Sines of squint angles low ... high, of weight 1 or of a window; the tapers beyond, and the error they cause.

    taper   width of the fall from 1 to 0 beyond each end
    window  over the beam, where there is one; its own ends are within low ... high unless no row sees them
    """

    low: float
    high: float
    taper: float
    error: float
    window: ApertureWindow | None = None

    @classmethod
    def tapered(cls, low: float, high: float, pixel_band: float, zone: float, allowed: float, has_beam: bool) -> Band:
        """The band whose tapers are as wide as an error of `allowed` needs.

        pixel_band  difference of the sines under which rows see one pixel;  zone  width of a Fresnel zone, as a sine
        has_beam    rows within the tapers contribute, with the tapers' weights
        """
        ringing = (FRESNEL_BEAM if has_beam else FRESNEL) / np.sqrt(max(pixel_band / zone, 1e-3))
        zones = max(LEAST_ZONES, float(ringing / allowed) ** (1 / 3))
        return cls(low, high, zones * zone, float(ringing) / zones**3)

    @classmethod
    def windowed(
        cls, window: ApertureWindow, corners: tuple[float, float], pixel_band: float, zone: float, allowed: float
    ) -> Band:
        """The band of a window over the beam; it is cut off, with tapers, where no row sees the image, at `corners`."""
        low, high = window.ends
        used = max(low, corners[0]), min(high, corners[1])
        if used == (low, high):
            return cls(low, high, 1e-3 * zone, window.error, window)
        cut = cls.tapered(*used, pixel_band, zone, allowed, False)
        return cls(*used, cut.taper, cut.error + window.error, window)

    def weight(self, sines: np.ndarray) -> np.ndarray:
        """Weights of Doppler bins at sines (...): 1 or the window in the band, falling to 0 over the tapers."""
        rise = self._rise(sines)
        taper = np.asarray(rise**3 * (10 - 15 * rise + 6 * rise * rise))
        return taper if self.window is None else taper * self.window.weight(sines)

    def row_weight(self, sines: np.ndarray, zones: np.ndarray | float) -> np.ndarray:
        """Weights, complex (...), that rows have at sines of squint angles where Doppler bins have `weight`.

        zones  widths of the Fresnel zone as sines. The next term of the stationary phase after the weight itself is
               -j zone^2 cos^3/(4 pi) times its second derivative: nothing within the band without a window
        """
        if self.window is None:
            rise = self._rise(sines)
            curvature = 60 * rise * (1 - rise) * (1 - 2 * rise) / self.taper**2
        else:  # no row lies in the tapers beyond it
            curvature = self.window.bend(sines)
        cosine = np.sqrt(1 - np.minimum(np.asarray(sines) ** 2, 1))
        return np.asarray(self.weight(sines) - 1j * (np.asarray(zones) ** 2 * cosine**3 / (4 * np.pi)) * curvature)

    def _rise(self, sines: np.ndarray) -> np.ndarray:
        """1 in the band, falling to 0 along straight lines over the tapers."""
        below, above = (sines - self.low) / self.taper + 1, (self.high - sines) / self.taper + 1
        return np.asarray(np.clip(np.minimum(below, above), 0, 1))

    @property
    def ends(self) -> tuple[float, float]:
        """The sines between which weights are not zero."""
        return self.low - self.taper, self.high + self.taper


def sine(u: np.ndarray, ranges: np.ndarray, t: np.ndarray, speed: np.ndarray | float) -> np.ndarray:
    """Sines of the squint angle at which rows at t, s, see points (u, r), s and m; arrays that broadcast."""
    ahead = speed * (u - t)
    return np.asarray(ahead / np.hypot(ranges, ahead))


def delay(sines: float, distance: float, speed: float) -> float:
    """u - t, s, at which points of a slant range, m, are seen under a sine of the squint angle."""
    return float(distance / speed * sines / np.sqrt(1 - sines**2))


def fresnel(wavelength: float, distance: np.ndarray) -> np.ndarray:
    """Widths of the Fresnel zone at slant ranges, m (n,), as sines of the squint angle."""
    return np.asarray(np.sqrt(wavelength / (2 * distance)))


def centroid_of_geometry(raw: PhaseHistory, step: float, speed: float) -> float:
    """Sine of the squint angle at which reference ranges change as they do, at the middle of the track; 0 where they
    are constant."""
    t = (np.arange(raw.n_rows) - (raw.n_rows - 1) / 2) * step
    slope = float(t @ (raw.reference_range - raw.reference_range.mean()) / (t @ t))
    return float(np.clip(-slope / speed, -STEEPEST, STEEPEST))


def centroid_of_data(raw: PhaseHistory, step: float, speed: float, expected: float, doubt: bool = True) -> float:
    """Sine of the squint angle of the mean Doppler frequency of the echoes, the nearest to the expected one.

    From the phase between neighbouring rows, whose reference ranges are taken into account. The Doppler frequency is
    known but for multiples of the pulse rate: the expected one chooses among them.
    doubt  warn where the echoes themselves tell that it is another: their Doppler frequency grows with the frequency
    Source: Madsen, IEEE Trans. AES-25, 1989, pp. 134-140; Bamler and Runge, IEEE Trans. GE-29, 1991, pp. 415-424.
    """
    first = max(0, (raw.n_rows - MOST_ROWS) // 2)
    samples = raw.read(first, min(first + MOST_ROWS, raw.n_rows))
    moved = np.diff(raw.reference_range[first : first + len(samples)])
    frequency = raw.frequency[0] + np.arange(raw.n_samples) * raw.frequency_step[0]
    products = samples[1:] * samples[:-1].conj()
    if np.ptp(moved) > 0 or moved[0]:
        products = products * np.exp(-4j * np.pi / SPEED_OF_LIGHT * np.outer(moved, frequency))
    total = complex(products.sum(dtype=np.complex128))
    if total == 0:
        raise ValueError("the echoes are zero, and have no Doppler centroid: give doppler='geometry'")
    rate, wavelength = 1 / step, SPEED_OF_LIGHT / float(raw.center_frequency[0])
    centroid, prediction = np.angle(total) / (2 * np.pi) * rate, 2 * speed * expected / wavelength
    centroid += rate * np.rint((prediction - centroid) / rate)
    if doubt:
        _doubt(products, frequency, rate, float(centroid), float(prediction))
    return float(np.clip(wavelength * centroid / (2 * speed), -STEEPEST, STEEPEST))


def _doubt(products: np.ndarray, frequency: np.ndarray, rate: float, centroid: float, expected: float) -> None:
    """Warn where Doppler frequencies that grow with the frequency tell of another multiple of the pulse rate.

    products  of neighbouring rows, (rows, samples), at frequencies, Hz;  expected  Hz, centroid of the geometry
    """
    half = len(frequency) // 2
    if half < 2 or len(products) < 2 * PARTS:
        return
    parts = np.stack([part.sum(axis=0, dtype=np.complex128) for part in np.array_split(products, PARTS)])
    apart = float(frequency[half:].mean() - frequency[:half].mean())
    turns = np.angle(parts[:, half:].sum(axis=1) * parts[:, :half].sum(axis=1).conj()) / (2 * np.pi)
    estimates = turns * rate * float(frequency.mean()) / apart
    deviation = float(estimates.std() / np.sqrt(PARTS - 1))
    absolute = float(np.median(estimates))
    nearest = centroid + rate * round((absolute - centroid) / rate)
    if abs(nearest - centroid) > rate / 2 and SURE * deviation < rate / 2:
        warn(
            f"Doppler frequencies of the echoes change over the band as those of a centroid of {absolute:.5g} Hz do, "
            f"where {centroid:.5g} Hz is used, the nearest to the {expected:.5g} Hz of the track and reference ranges; "
            f"the pulse rate is {rate:.5g} Hz. Give near={nearest:.5g}, or near={centroid:.5g} where that is right"
        )
