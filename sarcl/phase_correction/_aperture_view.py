"""View: the pulses of a phase history as seen on a grid, with trial errors taken off. _search.py works on it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..imaging.backproject import backproject
from ..model.image_grid import ImageGrid
from ..model.lazy_rows import Columns, Scaled
from ..model.phase_history import PhaseHistory
from . import _bright_points, _phase_gradient, _phase_smoothing

TOLERANCE = 1e-2  # of images that places are chosen in
LAGS = np.arange(-4, 5) / 2  # range cells about a place
NO_LAG = np.zeros(1)
WINDOW = 64.0  # Doppler cells about a place that count once the worst is gone
MOST_PIXELS = 4000
MOST_VALUES = 2.5e7  # of one pulse at one pixel, 8 bytes each
MOST_BEND = 2.0  # rad
LEAST_CORE = 8  # pulses

Errors = tuple[np.ndarray, np.ndarray]  # phase rad, range m, (n,) each


@dataclass(frozen=True, eq=False)
class View:
    """Rows, pulse by pulse and channel by channel, as seen on a grid.

    channels   rows a pulse
    frequency  Hz, at which phases are meant
    along      rad/m (n, 2): what shifts of the image across range and in range do to the phase of a pulse
    alive      bool (n,): False for pulses that hold nothing
    places     how many bright places are used
    scale      of contributions, so that they are neither large nor small
    options    of backproject
    """

    raw: PhaseHistory
    channels: int
    grid: ImageGrid
    frequency: float
    along: np.ndarray
    alive: np.ndarray
    places: int = 200
    scale: float = 1.0
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
    def narrow(self) -> bool:
        """True where all that lies in one range cell turns evenly over the pulses: an FFT over them focuses it.

        A place half a cell behind another turns by along[:, 1] cell/2 against it, less what is even.
        """
        return self.core == (0, self.n)

    @property
    def core(self) -> tuple[int, int]:
        """The most pulses first ... last - 1 about the middle that are narrow."""
        bend = self.along[:, 1] * self.cell / 2
        first, last = 0, self.n
        while last - first > LEAST_CORE and np.ptp(bend[first:last]) > MOST_BEND:
            first, last = first + 1, last - 1
        return first, last

    @property
    def window(self) -> float:
        """Doppler cells about a place that count; 0, the place alone, where the aperture is not narrow."""
        return WINDOW if self.narrow else 0.0

    def band(self, first: int, last: int) -> View:
        """Samples first ... last - 1 alone."""
        start = self.raw.frequency + first * self.raw.frequency_step
        cut = replace(self.raw, samples=Columns(self.raw.samples, first, last), frequency=start, waveform=None)
        return replace(self, raw=cut)

    def pulses(self, first: int, last: int) -> View:
        """Pulses first ... last - 1 alone."""
        rows = slice(first * self.channels, last * self.channels)
        return replace(self, raw=self.raw[rows], along=self.along[first:last], alive=self.alive[first:last])

    def corrected(self, errors: Errors) -> PhaseHistory:
        """The rows with the pulses' errors taken off."""
        phase, shift = (np.repeat(e, self.channels) for e in errors)
        return corrected(self.raw, phase, shift, self.frequency)

    def power(self, errors: Errors) -> np.ndarray:
        """Of the image of the corrected rows, of grid.shape; polarisations add as powers. ValueError if it is zero."""
        raw = self.corrected(errors)
        kinds = [] if raw.polarization is None else sorted(set(raw.polarization.tolist()))
        parts = [raw.select(polarization=kind) for kind in kinds] if len(kinds) > 1 else [raw]
        power = np.zeros(self.grid.shape)
        for part in parts:
            made = backproject(part, self.grid, tolerance=TOLERANCE, check=False, **self.options)
            power += (np.abs(made.data) / self.scale) ** 2
        if not power.any():
            raise ValueError(
                "the image on this grid is zero everywhere: no pixel lies inside the range window of a pulse; "
                "check the grid's center"
            )
        return power

    def brightest(self, errors: Errors, width: float, share: float = 1.0) -> np.ndarray:
        """Places, m (k, 3), in the image of the corrected rows, `width` Doppler cells apart."""
        most = int(np.clip(share * min(self.places, MOST_VALUES / (self.n * len(LAGS))), 10, None))
        return _bright_points.brightest(self.raw[:: self.channels], self.power(errors), self.grid, width, most)

    def pixels(self, errors: Errors, share: float = 1.0) -> np.ndarray:
        """The brightest pixels, m (k, 3), of the image of the corrected rows."""
        most = share * np.clip(MOST_VALUES / self.n, 500, MOST_PIXELS)
        return _bright_points.pixels(self.power(errors), self.grid, int(most))

    def probes(self, *choices: Errors) -> np.ndarray:
        """Places, m (k, 3), to judge errors by: bright with any of the choices taken off."""
        if self.narrow:
            return np.concatenate([self.brightest(e, 8.0, 1 / len(choices)) for e in choices])
        return np.concatenate([self.pixels(e, 1 / len(choices)) for e in choices])

    def contributions(self, errors: Errors, places: np.ndarray, lags: np.ndarray) -> np.ndarray:
        """Of every pulse to places, with the errors taken off: complex64 (n, columns, lags)."""
        made = _bright_points.contributions(self.corrected(errors), places, lags, self.scale)
        return made.reshape(self.n, -1, len(lags))

    def values(self, errors: Errors, places: np.ndarray) -> np.ndarray:
        """Contributions at probes, (n, columns), lags and all."""
        return self.contributions(errors, places, LAGS if self.narrow else NO_LAG).reshape(self.n, -1)

    def sharpness(self, errors: Errors, places: np.ndarray) -> float:
        """Sum |I|^4 at probes with the errors taken off."""
        return _phase_gradient.sharpness(self.values(errors, places), np.zeros(self.n), self.window)

    def unmoved(self, errors: Errors) -> Errors:
        """The errors less what only shifts the image: the mean, and the least-squares shift across range.

        Pulses that hold nothing get a phase between those of their neighbours.
        """
        phase, shift = _phase_smoothing.unwrapped(errors[0]), errors[1]
        if not self.alive.all():
            there = np.flatnonzero(self.alive)
            phase = np.interp(np.arange(self.n), there, np.unwrap(phase[there]))
        left = _phase_smoothing.detrended(phase, self.along[:, 0])
        if shift.any():
            shift = shift - self.tied(phase - left)
            shift = shift - shift.mean()
        return left, shift

    def tied(self, phase: np.ndarray) -> np.ndarray:
        """The range error, m, that makes this phase error: -c phase/(4 pi f)."""
        return -SPEED_OF_LIGHT / (4 * np.pi * self.frequency) * phase


def corrected(raw: PhaseHistory, phase: np.ndarray, shift: np.ndarray, frequency: float) -> PhaseHistory:
    """raw less errors exp(j phase) exp(-j 4 pi (f - frequency) shift/c), rad and m (n_rows,); nothing is read.

    The echo comes from `shift` too far: its reference range is taken that much nearer, which also turns it by
    the phase of `frequency`; that is taken back.
    """
    turn = np.exp(-1j * (phase + 4 * np.pi * frequency / SPEED_OF_LIGHT * shift))
    return replace(raw, samples=Scaled(raw.samples, turn), reference_range=raw.reference_range - shift)
