"""Zero-Doppler times and slant ranges of an image, and the Doppler band that it needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base import host_memory
from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import warn
from ...base.text import size_text
from ...base.validation import number, pair
from ...model.phase_history import PhaseHistory
from ...numerics import windows
from ._aperture_window import ApertureWindow
from ._doppler import STEEPEST, Band, delay, fresnel, sine
from ._options import RangeDopplerOptions
from ._range_window import RangeWindow
from ._track import REMEDY, Track
from ._velocity import Positions

FILLED = 0.8  # share of the sampling rate along rows and columns that the spectrum of a pixel fills, by default
HELD = 0.6  # share of the slant ranges in the range window at one time that default times leave
MOST_PIXELS = 2**31
PIXEL_BYTES = 8 + 2 * 24  # a pixel, and its position while a grid is made


@dataclass(frozen=True, eq=False)
class Extent:
    """Rows and columns of an image.

    times, ranges  zero-Doppler times, s, step/finer apart, and slant ranges, m
    band           sines of the squint angles at which rows contribute;  band_for  that for another error of its ends
    zone           width of a Fresnel zone at the first range, as a sine
    pixel_band     difference of these sines for one pixel
    """

    times: np.ndarray
    ranges: np.ndarray
    finer: int
    band: Band
    pixel_band: float
    row_times: np.ndarray
    speed: float
    has_beam: bool
    zone: float
    band_for: Callable[[float], Band]

    @property
    def middle_time(self) -> float:
        """Zero-Doppler time in the middle of the image, s."""
        return float(self.times[0] + self.times[-1]) / 2

    def rows_of(self, u: float) -> np.ndarray:
        """The rows that contribute to a point at a zero-Doppler time, s, in the middle of the ranges."""
        s = sine(np.array(u), np.array(self.ranges.mean()), self.row_times, self.speed)
        return np.flatnonzero((s >= self.band.low) & (s <= self.band.high))


@dataclass(frozen=True, eq=False)
class View:
    """Echoes, and how their track sees the ground.

    positions  on the ground, of zero-Doppler times and slant ranges
    speed      effective velocity, m/s;  centroid  sine of the squint angle of the Doppler centroid
    least      shortest slant range that reaches the ground, m
    """

    raw: PhaseHistory
    track: Track
    positions: Positions
    speed: float
    centroid: float
    least: float


def choose_extent(view: View, options: RangeDopplerOptions, allowed: float) -> Extent:
    """The extent that `options` ask for, or the default; allowed  error of the ends of the Doppler band.

    ValueError: a pulse rate below the Doppler bandwidth, ranges outside the range window, empty images.
    """
    raw, track, speed, centroid, least = view.raw, view.track, view.speed, view.centroid, view.least
    times: tuple[float, float] | None = None
    if options.times is not None:
        times = options.times[0] - track.epoch, options.times[1] - track.epoch
    if abs(centroid) > STEEPEST:
        raise ValueError(
            f"the Doppler centroid is {np.degrees(np.arcsin(np.clip(centroid, -1, 1))):.3g} degrees from broadside, "
            f"too near to the direction of flight; {REMEDY}"
        )
    beam, ranges, has_beam = options.azimuth_beam, options.ranges, options.azimuth_beam is not None
    wide = pair("spacing", (None, None) if options.spacing is None else options.spacing)
    steps = [None if d is None else number(f"spacing[{i}]", d, above=0) for i, d in enumerate(wide)]
    at_middle = float(raw.reference_range[raw.n_rows // 2]) * np.sqrt(1 - centroid**2)
    about = max(at_middle if ranges is None else sum(ranges) / 2, least)
    sight = _Sight(track, speed, centroid, beam, float(raw.center_frequency[0]), about)
    window = RangeWindow(raw, track, view.positions, speed, sight.sines, least, about)
    middle = sight.middle if times is None else sum(times) / 2
    pixel = sight.rows_at(middle)
    pixel_band = float(np.ptp(pixel))
    _check_pulse_rate(sight, pixel_band)
    if times is None:
        near = max(least, about - float(raw.swath[0]))
        half = _default_half(sight, window, middle, near, None if ranges is not None else HELD)
        times = middle - half, middle + half
    taper = Band.tapered(0, 0, pixel_band, sight.zone(about), allowed, True).taper if has_beam else 0.0
    along, across = _wavenumbers(raw, np.clip([pixel.min() - taper, pixel.max() + taper], -STEEPEST, STEEPEST))
    finer = speed * along * track.step / FILLED if steps[0] is None else track.step / steps[0]
    finer = max(1, int(np.ceil(finer - 1e-9)))
    column = steps[1] or FILLED / across
    near, far = window.longest(times) if ranges is None else window.checked((ranges[0], ranges[1]), times)
    n_times = int(np.floor((times[1] - times[0]) / track.step * finer + 1e-6)) + 1
    n_ranges = int(np.floor((far - near) / column + 1e-6)) + 1
    _check_pixels(n_times, n_ranges)
    u, r = times[0] + track.step / finer * np.arange(n_times), near + column * np.arange(n_ranges)
    corners = sine(u[[0, -1], None, None], r[[0, -1], None], np.array([0.0, track.stop]), speed)
    used = _sines_used(sight, corners, u)
    _warn_of_ambiguities(sight, float(np.ptp(corners, axis=(0, 2)).max()), float(r[-1] - r[0]))
    zone = sight.zone(float(r[0]))
    over_beam = windows.both(options.window)[1] if has_beam else None

    def band_for(allowed: float) -> Band:
        if over_beam is None or used == (corners.min(), corners.max()):
            return Band.tapered(*used, pixel_band, zone, allowed, has_beam)
        over = ApertureWindow.over(*sight.sines, windows.table(over_beam), zone, allowed)
        return Band.windowed(over, (float(corners.min()), float(corners.max())), pixel_band, zone, allowed)

    return Extent(u, r, finer, band_for(allowed), pixel_band, track.times, speed, has_beam, zone, band_for)


def _check_pixels(n_times: int, n_ranges: int) -> None:
    """MemoryError for an image that no memory holds."""
    if n_times * n_ranges > MOST_PIXELS:
        raise MemoryError(
            f"an image of {n_times} x {n_ranges} pixels is larger than range_doppler makes; give times=, ranges= of a "
            "part of it, or a wider spacing="
        )
    room = host_memory.installed()
    if PIXEL_BYTES * n_times * n_ranges > room:
        raise MemoryError(
            f"an image of {n_times} x {n_ranges} pixels needs {size_text(PIXEL_BYTES * n_times * n_ranges)} with its "
            f"positions, and this machine has {size_text(room)}; give times=, ranges= of a part of at most "
            f"{int(room / PIXEL_BYTES):,} pixels, or a wider spacing="
        )


def _sines_used(sight: _Sight, corners: np.ndarray, times: np.ndarray) -> tuple[float, float]:
    """First and last sine of squint angles at which rows see the image; ValueError where no row does.

    corners  sines at which the first and the last row see its corners
    """
    used = float(max(sight.sines[0], corners.min())), float(min(sight.sines[1], corners.max()))
    if not used[0] < used[1]:
        epoch = sight.track.epoch
        raise ValueError(
            f"no row sees the times {epoch + times[0]:.10g} to {epoch + times[-1]:.10g} s in the beam; with this "
            f"Doppler centroid the rows see zero-Doppler times about {epoch + sight.middle:.10g} s: "
            "give times= there, or doppler='data'"
        )
    return used


@dataclass(frozen=True, eq=False)
class _Sight:
    """View of points from the rows: about the Doppler centroid, a sine, within a beam, rad, or wherever (None).

    speed      effective velocity, m/s: Doppler frequencies are 2 f speed/c times the sines of this file. Those of the
               antenna's angles are speed/track.speed times as large, since its own speed makes the same frequencies
    frequency  in the middle of the band, Hz;  about  slant range in the middle of the image, m
    """

    track: Track
    speed: float
    centroid: float
    beam: float | None
    frequency: float
    about: float

    @property
    def sines(self) -> tuple[float, float]:
        """Sines of the squint angles at the ends of the beam."""
        if self.beam is None:
            return -1.0, 1.0
        ratio = self.track.speed / self.speed
        angle = float(np.arcsin(np.clip(self.centroid / ratio, -1, 1)))
        ends = np.clip([angle - self.beam / 2, angle + self.beam / 2], -np.pi / 2, np.pi / 2)
        low, high = np.clip(np.sin(ends) * ratio, -1, 1)
        return float(low), float(high)

    @property
    def middle(self) -> float:
        """Zero-Doppler time that the middle of the track sees, s."""
        return self.track.stop / 2 + delay(self.centroid, self.about, self.speed)

    @property
    def hertz(self) -> float:
        """Doppler frequency, Hz, for a sine of 1."""
        return 2 * self.speed * self.frequency / SPEED_OF_LIGHT

    @property
    def rate(self) -> float:
        """Pulse rate, Hz."""
        return 1 / self.track.step

    def zone(self, distance: float) -> float:
        """Width of a Fresnel zone at a slant range, m, as a sine."""
        return float(fresnel(SPEED_OF_LIGHT / self.frequency, np.array(distance)))

    def rows_at(self, u: float) -> np.ndarray:
        """Sines under which the rows see a point at a zero-Doppler time, s, those beyond the beam at its ends."""
        return np.clip(sine(np.array(u), np.array(self.about), self.track.times, self.speed), *self.sines)


def _check_pulse_rate(sight: _Sight, pixel_band: float) -> None:
    """ValueError where the rows see a pixel under more Doppler frequencies than the pulse rate."""
    if sight.hertz * pixel_band > sight.rate:
        most = 2 * np.arcsin(min(1.0, sight.rate / sight.hertz / 2)) / np.sqrt(1 - sight.centroid**2)
        what = "all rows see a pixel under" if sight.beam is None else "the beam has"
        raise ValueError(
            f"the pulse rate, {sight.rate:.5g} Hz, is below the Doppler bandwidth: {what} "
            f"{sight.hertz * pixel_band:.5g} Hz; give echoes of at least that pulse rate, or azimuth_beam= of at most "
            f"{most:.2g} rad if the antenna sees no more"
        )


def _default_half(sight: _Sight, window: RangeWindow, middle: float, near: float, held: float | None) -> float:
    """Half the default span of zero-Doppler times about `middle`, s: that of the rows, or less.

    Less where the image, at slant range `near`, has more Doppler frequencies than the pulse rate, and where less than
    a share `held` of the slant ranges is left: under squint points far along the track leave the range window.
    """
    track = sight.track
    half = track.stop / 2
    ends = np.array([0.0, track.stop])

    def image_band(half: float) -> float:
        return float(np.ptp(sine(middle + half * np.array([[-1.0], [1.0]]), np.array(near), ends, sight.speed)))

    while sight.beam is None and half > track.step and sight.hertz * image_band(half) > sight.rate:
        half *= 0.9
    if held is not None:
        most = window.length((middle, middle))
        while half > track.step and window.length((middle - half, middle + half)) < held * most:
            half *= 0.8
    return half


def _warn_of_ambiguities(sight: _Sight, image_band: float, width: float) -> None:
    """Warn where points appear again along the track, or echoes of the next pulse fall into the image's width, m."""
    if sight.beam is None and sight.hertz * image_band > 1.001 * sight.rate:
        away = sight.rate / sight.hertz * sight.about
        warn(
            f"the image spans {sight.hertz * image_band:.5g} Hz of Doppler, more than the pulse rate of "
            f"{sight.rate:.5g} Hz: a point appears again {away:.4g} m along the track. Give fewer times=, or "
            "azimuth_beam="
        )
    unambiguous = SPEED_OF_LIGHT * sight.track.step / 2
    if width > unambiguous:
        warn(
            f"the image is {width:.5g} m wide, but echoes of the next pulse begin after {unambiguous:.5g} m: of "
            "measured echoes ranges farther apart are mixed. Give narrower ranges="
        )


def _wavenumbers(raw: PhaseHistory, sines: np.ndarray) -> tuple[float, float]:
    """Extent of a pixel's spectrum along the track and in slant range, cycles/m, seen between two sines (2,).

    Its wavenumbers are (2 f/c) (sin, cos): squint tilts the spectrum, and widens it in both.
    """
    band = raw.frequency[0] + np.array([[-0.5], [raw.n_samples - 0.5]]) * raw.frequency_step[0]
    nearest = np.clip(0.0, sines[0], sines[1])  # where the cosine is largest
    wide = 2 / SPEED_OF_LIGHT * band * np.sqrt(1 - np.append(sines, nearest) ** 2)
    return float(np.ptp(2 / SPEED_OF_LIGHT * band * sines)), float(np.ptp(wide))
