"""The rows, weights and pixels that the operator and its adjoint share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..base.constants import SPEED_OF_LIGHT
from ..base.validation import instance
from ..imaging.antenna_beam import antenna_of, is_antenna
from ..imaging.focusing_task import FocusingTask, Skip, all_lit, geometry_of, make_task
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..model.waveform import Waveform
from ..scattering.antenna_weights import AntennaWeights
from ._options import EchoesOptions

Domain: TypeAlias = ImageGrid | ArrayLike
SKIPS: tuple[Skip, ...] = (
    "range window",
    "beam",
    "no data",
)  # all reasons to leave pairs out but weights of 0: rows keep their places


class RowsAsRead:
    """Samples of which a block of `at_once` rows is made when it is read, by make(start, stop), and alone is kept.

    Blocks that are made for the second time, since the image is made in parts, are kept from then on.
    """

    def __init__(
        self, make: Callable[[int, int], np.ndarray], n_rows: int, at_once: int, dtype: np.dtype[np.complexfloating]
    ) -> None:
        self.dtype, self._make, self._n_rows, self._at_once = dtype, make, n_rows, at_once
        self._latest, self._made = (-1, np.empty(0)), set[int]()
        self._kept: dict[int, np.ndarray] = {}

    def __getitem__(self, rows: slice) -> np.ndarray:
        start, stop, _ = rows.indices(self._n_rows)
        parts = []
        while start < stop:
            first = start // self._at_once * self._at_once
            block = self._kept.get(first)
            parts.append((self._of(first) if block is None else block)[start - first : stop - first])
            start = first + self._at_once
        return np.concatenate(parts) if len(parts) > 1 else parts[0]

    def _of(self, first: int) -> np.ndarray:
        """The block that begins with row `first`."""
        if self._latest[0] != first:
            self._latest = first, self._make(first, min(first + self._at_once, self._n_rows))
            if first in self._made:
                self._kept[first] = self._latest[1]
            self._made.add(first)
        return self._latest[1]


class Samples:
    """Samples of a PhaseHistory that are exchanged from one application to the next: `array` (n_rows, n_samples)."""

    def __init__(self, array: np.ndarray) -> None:
        self.array: np.ndarray | RowsAsRead = array
        self.shape = array.shape

    @property
    def dtype(self) -> np.dtype[np.complexfloating]:
        """Data type of the samples as they are now."""
        return self.array.dtype

    def __getitem__(self, rows: slice) -> np.ndarray:
        return np.asarray(self.array[rows])


@dataclass(frozen=True, eq=False)
class Measurement:
    """What is measured of the pixels: s_pn = m_pn sum_x v_p(x) a(x) exp(-j 2 pi f_pn (tau - tau_ref)).

    task     geometry, pixels, range window and beam, taper and antenna, with weights of 1 in rows and samples
    samples  of task.raw
    rows     (n_rows, 1) float64, and  band  float64 (1, n_samples) or (n_rows, n_samples): m = rows times band, the
             weights of rows, and those of samples times the spectrum of the waveform
    seen     pixels, flat, that have a position (n,) int; None: all
    """

    task: FocusingTask
    samples: Samples
    rows: np.ndarray
    band: np.ndarray
    seen: np.ndarray | None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows of samples, and samples of a row."""
        return self.task.raw.n_rows, self.task.raw.n_samples

    @property
    def positions(self) -> np.ndarray:
        """Positions of the pixels that are seen, m (n, 3)."""
        positions = self.task.grid.positions.reshape(-1, 3)
        return positions if self.seen is None else positions[self.seen]

    @cached_property
    def slope(self) -> np.ndarray:
        """j 2 pi kappa of all samples, kappa = 2 f/c, 1/m (n_rows, n_samples)."""
        raw = self.task.raw
        frequencies = raw.frequency[:, None] + np.arange(raw.n_samples) * raw.frequency_step[:, None]
        return np.asarray(4j * np.pi / SPEED_OF_LIGHT * frequencies)

    @property
    def seen_pixels(self) -> int:
        """Number of pixels that have a position."""
        return self.task.grid.size if self.seen is None else len(self.seen)

    @property
    def is_cut(self) -> bool:
        """Whether a beam leaves out pixels of some rows, or a window has another weight in each pixel."""
        return self.task.antennas.beam is not None or self.task.taper is not None

    def weighted(self, samples: np.ndarray, start: int = 0) -> np.ndarray:
        """Samples (n, n_samples) of rows from `start` on times m, of their type."""
        rows = slice(start, start + len(samples))
        out = samples * self.rows[rows].astype(samples.real.dtype)
        out *= self.band if len(self.band) == 1 else self.band[rows]
        return np.asarray(out)


def measurement_of(
    domain: Domain, like: PhaseHistory, options: EchoesOptions, aimed: AntennaWeights | None = None
) -> Measurement:
    """The measurement for the options of `Echoes`; ValueError or TypeError for options that do not fit.

    aimed  gains of options.antenna that are aimed already: only the places of the antennas are new
    """
    antenna, beam, wrap = options.antenna, options.beam, bool(options.wrap)
    instance("like", like, PhaseHistory)
    grid = domain if isinstance(domain, ImageGrid) else ImageGrid.points(domain)
    if is_antenna(beam):
        raise TypeError("beam is an Antenna; give it as antenna=, and the angle of a cone as beam=")
    noise = (
        np.random.default_rng(0).standard_normal((*np.shape(like.samples), 2), np.float32).view(np.complex64)[..., 0]
    )
    samples = Samples(noise)
    raw = replace(like, samples=samples, report=None)
    task = make_task(raw, grid, options.window, options.weights, wrap, SKIPS, beam, sum_polarizations=True)
    rows, across = task.row_weight, task.sample_weight
    task = replace(task, row_weight=np.ones_like(rows), sample_weight=np.ones_like(across))
    if task.antennas.beam is not None and all_lit(task.antennas, grid):
        task = replace(task, antennas=geometry_of(raw, wrap))
    if aimed is not None:
        task = replace(task, antenna=aimed.at(task.antennas))
    elif antenna is not None:
        if not is_antenna(antenna):
            raise TypeError(f"antenna is a {type(antenna).__name__}; give an Antenna, or (antenna, aim)")
        center = grid.bounds.mean(axis=0) if grid.center is None else grid.center
        task = replace(task, antenna=antenna_of(raw, antenna, center, "antenna"))
    pulse = like.waveform if options.waveform is None else options.waveform
    band = across[None]
    if pulse is not None:
        instance("waveform", pulse, Waveform)
        axes = np.stack([raw.frequency, raw.frequency_step], axis=1)
        if (axes == axes[0]).all():
            axes = axes[:1]
        frequencies = axes[:, :1] + np.arange(raw.n_samples) * axes[:, 1:]
        band = band * pulse.matched_spectrum(frequencies.ravel()).reshape(frequencies.shape)
    if not band.any():
        raise ValueError("the spectrum of waveform is 0 at all frequencies of like; give its own waveform")
    seen = None if grid.empty is None else np.flatnonzero(~grid.empty.ravel())
    measurement = Measurement(task, samples, rows[:, None], band, seen)
    samples.array = measurement.weighted(noise)
    return measurement
