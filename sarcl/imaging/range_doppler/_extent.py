"""Which zero-Doppler times and slant ranges an image has, and the Doppler band that it needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import warn
from ...base.validation import number
from ...model.image_grid import pair
from ...model.phase_history import PhaseHistory
from ._doppler import STEEPEST, Band, delay, fresnel, sine
from ._range_window import RangeWindow
from ._track import REMEDY, Track
from ._velocity import Positions

FILLED = 0.8  # of the sampling rate along rows and columns that the spectrum of a pixel fills, by default
HELD = 0.6  # of the slant ranges that the range window holds at one time: default times leave as many
MOST_PIXELS = 2**31


@dataclass(frozen=True, eq=False)
class Extent:
    """Rows and columns of an image.

    times, ranges  zero-Doppler times, s, step/finer apart, and slant ranges, m
    band           sines of the squint angles at which rows contribute
    pixel_band     difference of these sines for one pixel
    """

    times: np.ndarray
    ranges: np.ndarray
    finer: int
    band: Band
    pixel_band: float
    row_times: np.ndarray
    speed: float

    @property
    def middle_time(self) -> float:
        """Zero-Doppler time in the middle of the image, s."""
        return float(self.times[0] + self.times[-1]) / 2

    def rows_of(self, u: float) -> np.ndarray:
        """The rows that contribute to a point at a zero-Doppler time, s, in the middle of the ranges."""
        s = sine(np.array(u), np.array(self.ranges.mean()), self.row_times, self.speed)
        return np.flatnonzero((s >= self.band.low) & (s <= self.band.high))


def choose_extent(
    raw: PhaseHistory, track: Track, positions: Positions, centroid: float, beam: float | None,
    times: tuple[float, float] | None, ranges: tuple[float, float] | None, spacing: object, least: float,
    allowed: float,
) -> Extent:  # fmt: skip
    """The extent asked for, or the default: see `range_doppler`.

    centroid  sine of the squint angle of the Doppler centroid;  beam  full angle, rad, or None
    least     shortest slant range that reaches the ground, m;  allowed  error of the ends of the Doppler band
    ValueError: a pulse rate below the Doppler bandwidth, ranges outside the range window, empty images.
    """
    if abs(centroid) > STEEPEST:
        raise ValueError(
            f"the Doppler centroid is {np.degrees(np.arcsin(np.clip(centroid, -1, 1))):.3g} degrees from broadside, "
            f"too near to the direction of flight; {REMEDY}"
        )
    wide = pair("spacing", (None, None) if spacing is None else spacing)
    steps = [None if d is None else number(f"spacing[{i}]", d, above=0) for i, d in enumerate(wide)]
    cosine = np.sqrt(1 - centroid**2)
    about = float(raw.reference_range[raw.n_rows // 2]) * cosine if ranges is None else sum(ranges) / 2
    about = max(about, least)
    speed = track.speed
    sines = (-1.0, 1.0)
    if beam is not None:
        angle = float(np.arcsin(centroid))
        sines = (
            float(np.sin(max(angle - beam / 2, -np.pi / 2))),
            float(np.sin(min(angle + beam / 2, np.pi / 2))),
        )
    window = RangeWindow(raw, track, positions, sines, least, about)
    hertz = 2 * speed * float(raw.center_frequency[0]) / SPEED_OF_LIGHT
    middle = (track.start + track.stop) / 2 + delay(centroid, about, speed)
    if times is not None:
        middle = sum(times) / 2
    seen = np.clip(sine(np.array(middle), np.array(about), track.times, speed), *sines)
    pixel_band = float(np.ptp(seen))
    rate = 1 / track.step
    if hertz * pixel_band > rate:
        most = 2 * np.arcsin(min(1.0, rate / hertz / 2)) / cosine
        what = "all rows see a pixel under" if beam is None else "the beam has"
        raise ValueError(
            f"the pulse rate, {rate:.5g} Hz, is below the Doppler bandwidth: {what} {hertz * pixel_band:.5g} Hz; "
            f"give echoes of at least that pulse rate, or beam= of at most {most:.2g} rad if the antenna sees no more"
        )
    if times is None:
        half = (track.stop - track.start) / 2
        near = max(least, about - float(raw.swath[0]))
        for _ in range(60):
            if hertz * np.ptp(_ends(sines, middle, half, track, near, speed)) <= rate:
                break
            half *= 0.9
        if beam is not None:
            half = (track.stop - track.start) / 2
        if ranges is None:  # under squint points that are far along the track leave the range window
            most = window.length((middle, middle))
            while half > track.step and window.length((middle - half, middle + half)) < HELD * most:
                half *= 0.8
        times = middle - half, middle + half
    zone = float(fresnel(SPEED_OF_LIGHT / float(raw.center_frequency[0]), np.array(about)))
    taper = 0.0 if beam is None else Band.tapered(0, 0, pixel_band, zone, allowed).taper
    along, across = _wavenumbers(raw, np.clip([seen.min() - taper, seen.max() + taper], -STEEPEST, STEEPEST))
    finer = max(1, int(np.ceil(speed * along / (FILLED * rate) - 1e-9)))
    if steps[0] is not None:
        finer = max(1, int(np.ceil(track.step / steps[0] - 1e-9)))
    column = steps[1] or FILLED / across
    ranges = window.longest(times) if ranges is None else window.checked(ranges, times)
    n_times = int(np.floor((times[1] - times[0]) / track.step * finer + 1e-6)) + 1
    n_ranges = int(np.floor((ranges[1] - ranges[0]) / column + 1e-6)) + 1
    if n_times * n_ranges > MOST_PIXELS:
        raise MemoryError(
            f"an image of {n_times} x {n_ranges} pixels is larger than range_doppler makes; give times=, ranges= of a "
            "part of it, or a wider spacing="
        )
    made_times = times[0] + track.step / finer * np.arange(n_times)
    made_ranges = ranges[0] + column * np.arange(n_ranges)
    corners = sine(
        made_times[[0, -1], None, None], made_ranges[[0, -1], None], np.array([track.start, track.stop]), speed
    )  # (times, ranges, rows)
    used = float(max(sines[0], corners.min())), float(min(sines[1], corners.max()))
    if not used[0] < used[1]:
        raise ValueError(
            f"no row sees the times {made_times[0]:.6g} to {made_times[-1]:.6g} s in the beam; with this Doppler "
            f"centroid the rows see zero-Doppler times about {middle:.6g} s: give times= there, or doppler='data'"
        )
    widest = hertz * float(np.ptp(corners, axis=(0, 2)).max())
    if beam is None and widest > 1.001 * rate:
        away = rate * SPEED_OF_LIGHT / float(raw.center_frequency[0]) * about / (2 * speed)
        warn(
            f"the image spans {widest:.5g} Hz of Doppler, more than the pulse rate of "
            f"{rate:.5g} Hz: a point appears again {away:.4g} m along the track. Give fewer times=, or beam="
        )
    unambiguous = SPEED_OF_LIGHT * track.step / 2
    if made_ranges[-1] - made_ranges[0] > unambiguous:
        warn(
            f"the image is {made_ranges[-1] - made_ranges[0]:.5g} m wide, but echoes of the next pulse begin after "
            f"{unambiguous:.5g} m: of measured echoes ranges farther apart are mixed. Give narrower ranges="
        )
    zone = float(fresnel(SPEED_OF_LIGHT / float(raw.center_frequency[0]), made_ranges[0]))
    band = Band.tapered(*used, pixel_band, zone, allowed)
    return Extent(made_times, made_ranges, finer, band, pixel_band, track.times, speed)


def _wavenumbers(raw: PhaseHistory, sines: np.ndarray) -> tuple[float, float]:
    """Extent of a pixel's spectrum along the track and in slant range, cycles/m, seen between two sines (2,).

    Its wavenumbers are (2 f/c) (sin, cos): squint tilts the spectrum, and widens it in both.
    """
    band = raw.frequency[0] + np.array([[-0.5], [raw.n_samples - 0.5]]) * raw.frequency_step[0]
    nearest = np.clip(0.0, sines[0], sines[1])  # where the cosine is largest
    wide = 2 / SPEED_OF_LIGHT * band * np.sqrt(1 - np.append(sines, nearest) ** 2)
    return float(np.ptp(2 / SPEED_OF_LIGHT * band * sines)), float(np.ptp(wide))


def _ends(
    sines: tuple[float, float], middle: float, half: float, track: Track, about: float, speed: float
) -> np.ndarray:
    """Sines at which the ends of the track see the ends of an image, within the beam."""
    u = np.array([[middle - half], [middle + half]])
    return np.clip(sine(u, np.array(about), np.array([track.start, track.stop]), speed), *sines)
