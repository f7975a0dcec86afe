"""Scatterers to samples by a plan of levels."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...base.stage_timer import Clock
from ...numerics import cost_model
from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.device import Buffer, Device
from ..spreading import Counts
from ._ascent import Ascent
from .levels import FactorizedPlan
from .scatterers import Scatterers


@dataclass(eq=False)
class FactorizedSpreader:
    """Scatterers of one channel at one receiver, by a plan.

    n_samples  of a row;  budget  bytes on the device
    Profiles of the largest cells are kept from one call of `add` to the next, where all of them fit.
    """

    device: Device
    plan: FactorizedPlan
    scatterers: Scatterers
    antennas: PulseGeometry
    n_samples: int
    budget: float
    _whole: list[Buffer] | None = field(default=None, init=False)

    def __len__(self) -> int:
        return len(self.scatterers)

    @property
    def keeps_profiles(self) -> bool:
        """Whether profiles of the largest cells stay on the device: later calls of `add` repeat no work on cells."""
        return self._ascent.cells_at_once >= len(self.plan.levels[0].cells)

    @property
    def seconds(self) -> float:
        """About the seconds of one core that all pulses take."""
        return 1e-6 * cost_model.SPREAD_POINT * self.plan.cost * len(self) * len(self.antennas)

    @functools.cached_property
    def _ascent(self) -> Ascent:
        return Ascent(self.device, self.plan, self.scatterers, self.antennas, self.n_samples, self.budget)

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add to samples (n_pulses, n_polarizations, n_samples) of consecutive `pulses` of the antennas.

        on_progress is called with the number of pairs of scatterer and pulse that are done.
        """
        ascent, n_cells = self._ascent, len(self.plan.levels[0].cells)
        clock.lap("scene")
        first, stop = pulses[0], pulses[-1] + 1
        for low in range(0, n_cells, ascent.cells_at_once):
            cells = low, min(low + ascent.cells_at_once, n_cells)
            profiles = self._profiles(cells)
            clock.lap("echo")
            for start in range(first, stop, ascent.pulses_at_once):
                end = min(start + ascent.pulses_at_once, stop)
                for channel, of_channel in zip(self.scatterers.channels, profiles, strict=True):
                    rows = ascent.rows(of_channel, cells, range(start, end))
                    clock.lap("echo")
                    spectra = ascent.spectra_of.of(rows, 1, end - start)
                    if channel.basis is not None:
                        spectra = spectra * channel.basis
                    for column in channel.columns:
                        samples[start - first : end - first, column] += spectra
                    clock.lap("spectra")
                pairs = low * len(pulses) + (cells[1] - low) * (end - first)
                on_progress(len(self) * pairs // n_cells)
        facing_away = ascent.facing_away(first, stop) if self.scatterers.macros["FACETS"] else 0
        return Counts(len(self) * len(pulses), facing_away=facing_away)

    def _profiles(self, cells: tuple[int, int]) -> list[Buffer]:
        """Profiles of the largest cells (first, stop), channel by channel."""
        if self._whole is not None:
            return self._whole
        if cells[0] == 0:
            self._ascent.fronts[:] = 0
        profiles = [self._ascent.profiles(i, 0, *cells) for i in range(len(self.scatterers.channels))]
        if cells == (0, len(self.plan.levels[0].cells)):
            self._whole = profiles
        return profiles
