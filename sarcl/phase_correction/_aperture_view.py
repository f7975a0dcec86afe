"""Pulses of an aperture with trial corrections, and their images and contributions on a grid, for _search.py."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..imaging.backproject import pixels_alone
from ..model.image_grid import ImageGrid
from ..model.lazy_rows import Columns, Scaled
from ..model.phase_history import PhaseHistory
from ..numerics.pulse_geometry import half_path
from . import _bright_points, _phase_gradient, _phase_smoothing
from ._bright_points import Beam

CELLS = 8  # Doppler cells: distance across range of the points that are examined for a narrow aperture
# rad, largest phase over the aperture, besides a line, of a point half a range cell behind a place, which every column
# of contributions holds; and of one CELLS beside it, which is one of many
MOST_BEHIND, MOST_BESIDE = 1.5, 4.0
LEAST_PULSES = 8
PLACES = 16  # places of the grid that are examined
PULSES = 64  # pulses of the aperture that are examined
TOLERANCE = 1e-2  # tolerance of images in which bright points are chosen
LAGS = np.arange(-4, 5) / 2  # range cells from a point
NO_LAG = np.zeros(1)
WINDOW = 64.0  # Doppler cells about a point that sharpness is computed over, after the first passes
MOST_PIXELS = 4000  # brightest pixels that are used over a wide aperture
MOST_VALUES = 2.5e7  # contributions of a pulse to a point, 8 bytes each, that are kept at a time

Errors = tuple[np.ndarray, np.ndarray]  # phase rad, range m, (n,) each


@dataclass(frozen=True, eq=False)
class ApertureView:
    """Rows of a phase history, pulse by pulse and channel by channel, with a grid for their images.

    channels   rows per pulse
    frequency  Hz, that phases refer to
    shift_phase  rad/m (n, 2), change of a pulse's phase per shift of the image across range, and in range
    alive      bool (n,): False for pulses without energy
    places     number of bright points that are used
    scale      contributions are divided by it, so that they are of order 1
    beam       full angle, rad, and unit directions of the rows (n_rows, 3); None: every row sees every point
    options    further arguments of backproject
    """

    raw: PhaseHistory
    channels: int
    grid: ImageGrid
    frequency: float
    shift_phase: np.ndarray
    alive: np.ndarray
    places: int = 200
    scale: float = 1.0
    beam: Beam | None = None
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of pulses."""
        return self.raw.n_rows // self.channels

    @property
    def cell(self) -> float:
        """Range cell c/(2 bandwidth), m."""
        return SPEED_OF_LIGHT / (2 * float(self.raw.bandwidth[0]))

    @property
    def is_narrow(self) -> bool:
        """Whether phases of all points near a place are linear over the pulses: an FFT over them then focuses."""
        return self.narrow_pulses == (0, self.n)

    @cached_property
    def narrow_pulses(self) -> tuple[int, int]:
        """The longest narrow sub-aperture about the middle: pulses first ... last - 1."""
        rows = self.raw[:: self.channels]
        return narrow_pulses(rows, self.grid, self.frequency, self.cell / 2)

    @property
    def window(self) -> float:
        """Doppler cells about a point that sharpness is computed over; 0: the point alone, over a wide aperture."""
        return WINDOW if self.is_narrow else 0.0

    def band(self, first: int, last: int) -> ApertureView:
        """The view with samples first ... last - 1 alone."""
        start = self.raw.frequency + first * self.raw.frequency_step
        cut = replace(self.raw, samples=Columns(self.raw.samples, first, last), frequency=start, waveform=None)
        return replace(self, raw=cut)

    def pulses(self, first: int, last: int) -> ApertureView:
        """The view with pulses first ... last - 1 alone."""
        rows = slice(first * self.channels, last * self.channels)
        beam = None if self.beam is None else (self.beam[0], self.beam[1][rows])
        return replace(
            self, raw=self.raw[rows], shift_phase=self.shift_phase[first:last], alive=self.alive[first:last], beam=beam
        )

    def corrected(self, errors: Errors) -> PhaseHistory:
        """The rows with the errors of the pulses removed."""
        phase, shift = (np.repeat(e, self.channels) for e in errors)
        return corrected(self.raw, phase, shift, self.frequency)

    def power(self, errors: Errors) -> np.ndarray:
        """Power of the image of the corrected rows, of grid.shape, summed over polarisations; ValueError if 0."""
        return self._power(errors) if any(e.any() for e in errors) else self._plain_power

    @cached_property
    def _plain_power(self) -> np.ndarray:
        """`power` without errors, which every search starts from, and every correction is compared with."""
        return self._power((np.zeros(self.n), np.zeros(self.n)))

    def _power(self, errors: Errors) -> np.ndarray:
        raw = self.corrected(errors)
        kinds = [] if raw.polarization is None else sorted(set(raw.polarization.tolist()))
        parts = [np.flatnonzero(raw.polarization == kind) for kind in kinds] if len(kinds) > 1 else [slice(None)]
        power = np.zeros(self.grid.shape)
        for rows in parts:
            beam = None if self.beam is None else (self.beam[0], self.beam[1][rows])
            part = raw if len(parts) == 1 else raw[rows]
            pixels = pixels_alone(part, self.grid, tolerance=TOLERANCE, beam=beam, **self.options)
            power += (np.abs(pixels) / self.scale) ** 2
        if not power.any():
            raise ValueError(
                "the image on this grid is zero everywhere: no pixel lies inside the range window of a pulse; "
                "check the grid's center"
            )
        return power

    def brightest(self, errors: Errors, width: float, share: float = 1.0) -> np.ndarray:
        """Bright points, m (k, 3), of the image of the corrected rows, `width` Doppler cells apart."""
        most = int(np.clip(share * min(self.places, MOST_VALUES / (self.n * len(LAGS))), 10, None))
        return _bright_points.brightest(self.raw[:: self.channels], self.power(errors), self.grid, width, most)

    def pixels(self, errors: Errors, share: float = 1.0) -> np.ndarray:
        """The brightest pixels, m (k, 3), of the image of the corrected rows."""
        most = share * np.clip(MOST_VALUES / self.n, 500, MOST_PIXELS)
        return _bright_points.pixels(self.power(errors), self.grid, int(most))

    def probes(self, *choices: Errors, apart: float = 8.0) -> np.ndarray:
        """Points, m (k, 3), to compare errors at: those that are bright with any of the choices removed.

        apart  Doppler cells between them, over narrow apertures
        """
        if self.is_narrow:
            return np.concatenate([self.brightest(e, apart, 1 / len(choices)) for e in choices])
        return np.concatenate([self.pixels(e, 1 / len(choices)) for e in choices])

    def contributions(self, errors: Errors, places: np.ndarray, lags: np.ndarray, *, taper: bool = False) -> np.ndarray:
        """Contributions of every pulse to places, with the errors removed: complex64 (n, columns, lags).

        taper  True: with a Hamming window over the band, so that a target has no side lobes at other ranges
        """
        terms = _bright_points.contributions(self.corrected(errors), places, lags, self.scale, taper, self.beam)
        return terms.reshape(self.n, -1, len(lags))

    def values(self, errors: Errors, places: np.ndarray) -> np.ndarray:
        """Contributions to probes with all their lags as columns, (n, columns)."""
        return self.contributions(errors, places, LAGS if self.is_narrow else NO_LAG).reshape(self.n, -1)

    def sharpness(self, errors: Errors, places: np.ndarray) -> float:
        """Sum |I|^4 at probes with the errors removed."""
        return _phase_gradient.sharpness(self.values(errors, places), np.zeros(self.n), self.window)

    def shift_removed(self, errors: Errors) -> Errors:
        """The errors without what only shifts the image: the mean, and the least-squares shift across range.

        Pulses without energy get a phase interpolated between those of their neighbours.
        """
        phase, shift = _phase_smoothing.unwrapped(errors[0]), errors[1]
        if not self.alive.all():
            there = np.flatnonzero(self.alive)
            phase = np.interp(np.arange(self.n), there, np.unwrap(phase[there]))
        residual = _phase_smoothing.detrended(phase, self.shift_phase[:, 0])
        if shift.any():
            shift = shift - self.implied_range(phase - residual)
            shift = shift - shift.mean()
        return residual, shift

    def implied_range(self, phase: np.ndarray) -> np.ndarray:
        """The range error, m, of a motion that causes this phase error: -c phase/(4 pi f)."""
        return -SPEED_OF_LIGHT / (4 * np.pi * self.frequency) * phase


def corrected(raw: PhaseHistory, phase: np.ndarray, shift: np.ndarray, frequency: float) -> PhaseHistory:
    """raw without errors exp(j phase) exp(-j 4 pi (f - frequency) shift/c), rad and m (n_rows,); no sample is read.

    The echo arrives `shift` too far: its reference range is reduced by as much. That also changes the phase at
    `frequency`, which is compensated.
    """
    factor = np.exp(-1j * (phase + 4 * np.pi * frequency / SPEED_OF_LIGHT * shift))
    return replace(raw, samples=Scaled(raw.samples, factor), reference_range=raw.reference_range - shift)


def narrow_pulses(raw: PhaseHistory, grid: ImageGrid, frequency: float, depth: float) -> tuple[int, int]:
    """The longest narrow sub-aperture about the middle: pulses first ... last - 1.

    Over a narrow aperture the phases of all points near a place are linear in the pulse. An FFT over the pulses is then
    the image on a line through the place, which `_phase_gradient` uses.
    raw    a row per pulse, in order of time
    depth  m, half a range cell
    """
    places = grid.sample(PLACES, seed=0)[1].reshape(-1, 3)
    reach = float(np.linalg.norm(np.ptp(grid.bounds, axis=0))) / 2
    first, last = 0, raw.n_rows
    while last - first > LEAST_PULSES:
        beside, behind = _bends(raw, places, (first, last), frequency, depth, reach)
        if beside <= MOST_BESIDE and behind <= MOST_BEHIND:
            break
        step = max(1, (last - first) // PULSES)
        first, last = first + step, last - step
    return first, last


def _bends(
    raw: PhaseHistory, places: np.ndarray, pulses: tuple[int, int], frequency: float, depth: float, reach: float
) -> tuple[float, float]:
    """Largest deviation from a line, rad, of the phase of points CELLS beside places, and of those `depth` behind.

    reach  m, largest distance of a point beside a place
    """
    rows = np.unique(np.linspace(pulses[0], pulses[1] - 1, PULSES).astype(int))
    tx, rx = raw.tx[rows, None], raw.rx[rows, None]
    middle = len(rows) // 2
    look = unit(places - tx) + unit(places - rx)  # (rows, places, 3): twice a unit vector where tx is rx
    turned = look[-1] - look[0]
    angle = np.linalg.norm(turned, axis=-1, keepdims=True)
    ahead = unit(look[middle])
    across = turned - (turned * ahead).sum(axis=-1, keepdims=True) * ahead
    across *= np.minimum(CELLS * SPEED_OF_LIGHT / frequency / np.maximum(angle, 1e-12), reach) / np.maximum(
        np.linalg.norm(across, axis=-1, keepdims=True), 1e-300
    )
    plain = half_path(tx, rx, places)

    def bend(near: np.ndarray) -> float:
        phase = 4 * np.pi * frequency / SPEED_OF_LIGHT * (half_path(tx, rx, near) - plain)
        t = rows - rows.mean()
        phase = phase - phase.mean(axis=0)
        return float(np.abs(phase - np.outer(t, t @ phase) / (t @ t)).max())

    beside = []
    for near in (places + across, places - across):
        later = half_path(tx[middle], rx[middle], near) - plain[middle]
        beside.append(bend(near - later[:, None] * ahead))  # in the same range cell
    return max(beside), bend(places + depth * ahead)
