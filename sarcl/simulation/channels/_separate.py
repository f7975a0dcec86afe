"""What an array's channels are to become, and the plain way there: every channel by a run of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays.channels import Channel, Sampling
from ...model.waveform import Waveform
from ...numerics.pulse_geometry import PulseGeometry
from ..scene_echoes import Work, band_of
from ..spreading import Band
from .channel_rows import Rows, antennas_of


@dataclass(frozen=True, eq=False)
class Layout:
    """What is asked of an array: its rows, the channels sent, their frequencies, the range window (near, far), m."""

    rows: Rows
    sent: list[Channel]
    grid: Sampling
    window: tuple[float, float]
    waveform: Waveform
    compressed: bool

    def samples(self, channel: Channel) -> tuple[slice, np.ndarray]:
        """A channel's samples in its rows, and their frequencies, Hz."""
        if self.rows.separated:
            own = self.grid.of(channel.carrier)
            return slice(0, own.n), own.frequency + own.step * np.arange(own.n)
        part = self.grid.part(channel.carrier)
        return part, self.grid.frequency + self.grid.step * np.arange(self.grid.n)[part]

    def spectrum(self, channel: Channel, frequencies: np.ndarray) -> np.ndarray:
        """Of what a channel sends, after its own filter if compressed, at frequencies, Hz (n,)."""
        pulse = replace(self.waveform, center=channel.carrier).pulse_spectrum(frequencies)
        return np.asarray(np.abs(pulse) ** 2 if self.compressed else pulse)

    def band(self, frequencies: np.ndarray) -> Band:
        """Of a run of the engines at frequencies, Hz (n,)."""
        n, step = len(frequencies), self.grid.step
        return Band(n, n * step, float(frequencies[0]) + n // 2 * step)

    def shape(self, n_pulses: int) -> tuple[int, ...]:
        """Of samples: (pulses, senders, receivers, polarizations, samples)."""
        n = self.grid.width if self.rows.separated else self.grid.n
        return n_pulses, *self.rows.shape[1:], len(self.rows.polarizations), n

    @property
    def runs(self) -> int:
        """Pulses of all channels at all receivers."""
        return sum(c.stop - c.first for c in self.sent) * self.rows.hearing

    @property
    def overlap(self) -> float:
        """Channels that are added up on one sample, at most."""
        if self.rows.separated:
            return 1.0
        counts: dict[int, np.ndarray] = {}
        for channel in self.sent:
            counts.setdefault(channel.first, np.zeros(self.grid.n))[self.grid.part(channel.carrier)] += 1
        return max(1.0, *(float(count.max()) for count in counts.values()))


class Apart:
    """Every channel at every receiver by a run of its own, over its own band."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.runs = layout, layout.runs

    @property
    def bands(self) -> list[Band]:
        """Of every run."""
        made = [self.layout.samples(channel)[1] for channel in self.layout.sent]
        return [self.layout.band(frequencies) for frequencies in made]

    def pulses(self, budget: float) -> int:
        """Pulses to be filled at a time: all, the engines keep to the budget."""
        return len(self.layout.rows.sides.tx)

    def fill(self, work: Work, samples: np.ndarray, start: int, total: int) -> float:
        """Add to samples (n, senders, receivers, n_polarizations, n_samples), zeros, of n pulses from `start` on.

        total  pairs of scatterer and run, for progress. Returns the predicted error.
        """
        layout, rows, worst = self.layout, self.layout.rows, 0.0
        for channel, at, here in during(layout.sent, start, len(samples)):
            part, frequencies = layout.samples(channel)
            spectrum = (layout.spectrum(channel, frequencies) * work.weights.factor(frequencies)).astype(np.complex64)
            band = band_of(layout.waveform, channel.carrier, len(frequencies) * layout.grid.step)
            tx = rows.sides.senders(channel.offset, at)
            _, rx, reference = rows.ends(channel.offset, at)
            for j in range(rows.hearing):
                antennas = antennas_of(
                    tx, rx[:, j], reference[:, j], float(frequencies[0]), layout.grid, layout.window, len(frequencies)
                )
                made = run(work, antennas, band, frequencies, at.start, total)
                worst = max(worst, work.predicted_error)
                rows.put(samples[here], channel, slice(j, j + 1), part, (made * spectrum)[:, None])
        return worst

    def describe(self) -> dict[str, int]:
        """For a report."""
        return {}


def during(sent: list[Channel], start: int, n: int) -> list[tuple[Channel, slice, slice]]:
    """Channels sent at pulses start ... start + n - 1: which of the pulses, and which of these."""
    out = []
    for channel in sent:
        first, stop = max(channel.first, start), min(channel.stop, start + n)
        if first < stop:
            out.append((channel, slice(first, stop), slice(first - start, stop - start)))
    return out


def run(
    work: Work, antennas: PulseGeometry, band: Waveform, frequencies: np.ndarray, first: int, total: int
) -> np.ndarray:
    """Echoes of antennas at pulses from `first` on, (n, n_polarizations, n_samples)."""
    beam = work.weights.seen_from(antennas.tx, antennas.rx, slice(first, first + len(antennas.tx)))
    made = np.zeros((len(antennas.tx), len(work.order.polarizations), len(frequencies)), np.complex64)
    work.add(antennas, band, frequencies, made, total, first, beam)
    return made
