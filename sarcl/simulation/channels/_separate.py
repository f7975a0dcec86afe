"""Layout of an array's channels in its samples, and their echoes computed channel by channel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...arrays.channels import Channel, Sampling
from ...base.report import ErrorTerm
from ...model.waveform import Waveform
from ...numerics.pulse_geometry import PulseGeometry
from ..scene_echoes import Added, ChannelEchoes, SceneEchoes, band_of
from ..spreading import Band
from ._channel_rows import ChannelRows

MOST_BLOCKS = 16  # of pulses, about: each plans all channels anew


@dataclass(frozen=True, eq=False)
class ChannelLayout:
    """Rows and samples of an array's channels: rows, channels, frequencies, range window (near, far), m."""

    rows: ChannelRows
    sent: list[Channel]
    grid: Sampling
    window: tuple[float, float]
    waveform: Waveform
    compressed: bool

    @property
    def frequencies(self) -> np.ndarray:
        """Frequencies of the samples of all channels, Hz (grid.n,)."""
        return np.asarray(self.grid.frequency + self.grid.step * np.arange(self.grid.n))

    def samples(self, channel: Channel) -> tuple[slice, np.ndarray]:
        """Which samples of its rows belong to a channel, and their frequencies, Hz."""
        if self.rows.separated:
            own = self.grid.of(channel.carrier)
            return slice(0, own.n), own.frequency + own.step * np.arange(own.n)
        part = self.grid.part(channel.carrier)
        return part, self.frequencies[part]

    def spectrum(self, channel: Channel, frequencies: np.ndarray) -> np.ndarray:
        """Spectrum of a channel's pulse at frequencies, Hz (n,), after its matched filter if compressed."""
        pulse = replace(self.waveform, center=channel.carrier).pulse_spectrum(frequencies)
        return np.asarray(np.abs(pulse) ** 2 if self.compressed else pulse)

    def band(self, frequencies: np.ndarray) -> Band:
        """Band of echoes that are computed at frequencies, Hz (n,)."""
        n, step = len(frequencies), self.grid.step
        return Band(n, n * step, float(frequencies[0]) + n // 2 * step)

    def geometry(
        self,
        tx: np.ndarray,
        rx: np.ndarray,
        reference_range: np.ndarray,
        frequencies: np.ndarray,
        window: tuple[float, float] | None = None,
    ) -> PulseGeometry:
        """Geometry of echoes between tx and rx, m (n, 3), at frequencies, Hz; window  (near, far), default `window`."""
        return PulseGeometry.sampled(
            tx, rx, reference_range, first=float(frequencies[0]), step=self.grid.step, n_samples=len(frequencies),
            window=self.window if window is None else window,
        )  # fmt: skip

    def shape(self, n_pulses: int) -> tuple[int, ...]:
        """Shape of the samples: (pulses, transmitters, receivers, polarizations, samples)."""
        n = self.grid.width if self.rows.separated else self.grid.n
        return n_pulses, *self.rows.shape[1:], len(self.rows.polarizations), n

    @property
    def runs(self) -> int:
        """Number of (pulse, channel, receiver): so many range profiles take part when each is computed by itself."""
        return sum(c.stop - c.first for c in self.sent) * self.rows.n_receivers

    @property
    def overlap(self) -> float:
        """Largest number of channels that are summed in one sample."""
        if self.rows.separated:
            return 1.0
        counts: dict[int, np.ndarray] = {}
        for channel in self.sent:
            counts.setdefault(channel.first, np.zeros(self.grid.n))[self.grid.part(channel.carrier)] += 1
        return max(1.0, *(float(count.max()) for count in counts.values()))


class ChannelPlace(NamedTuple):
    """One channel at one receiver, at the pulses at which it is sent, and some of these.

    first   number of its first pulse in the track;  pulses  those of a block, counted from there;  block  the same in
            the block;  samples  in a row
    """

    channel: Channel
    geometry: PulseGeometry
    band: Waveform
    frequencies: np.ndarray
    first: int
    pulses: range
    block: slice
    receiver: slice
    samples: slice


class SeparateChannels:
    """Echoes of every channel at every receiver, each computed by itself over its own band."""

    def __init__(self, layout: ChannelLayout) -> None:
        self.layout, self.runs = layout, layout.runs

    @property
    def bands(self) -> list[Band]:
        """Band of each channel."""
        return [self.layout.band(self.layout.samples(channel)[1]) for channel in self.layout.sent]

    def least(self, scene: SceneEchoes) -> float:
        """Pulses of a block, at least: each plans all channels anew."""
        return len(self.layout.rows.track) / MOST_BLOCKS

    def fresh(self) -> SeparateChannels:
        """The same for another device: nothing is kept."""
        return self

    def pulses(self, budget: float) -> int:
        """Pulses per call of `fill`: all of them, since each computation keeps to the memory budget by itself."""
        return len(self.layout.rows.track)

    def fill(self, scene: SceneEchoes, samples: np.ndarray, start: int, done: int, total: int) -> Added:
        """Add echoes to samples (n, transmitters, receivers, n_polarizations, n_samples), zeros, from pulse `start` on.

        done, total  pairs of scatterer and range profile, for progress
        """
        added, rows = Added(), self.layout.rows
        for one in self._places(start, len(samples)):
            spectrum = self.layout.spectrum(one.channel, one.frequencies) * scene.weights.factor(one.frequencies)
            planned = scene.channel(one.geometry, one.band, one.frequencies, one.first)
            echoes, of_channel = echoes_of(planned, one.pulses, len(one.frequencies), done + added.counts.pairs, total)
            added += of_channel
            shaped = (echoes * spectrum.astype(np.complex64))[:, None]
            rows.add(samples[one.block], one.channel, one.receiver, one.samples, shaped)
        return added

    def planned(self, scene: SceneEchoes) -> Added:
        """The plan of the echoes of all pulses, without these."""
        added = Added()
        for one in self._places(0, len(self.layout.rows.track)):
            channel = scene.channel(one.geometry, one.band, one.frequencies, one.first)
            added += Added(channel.error_terms, channel.plan)
        return added

    def _places(self, start: int, n: int) -> Iterator[ChannelPlace]:
        """Every channel at every receiver, where it is sent at some of the n pulses from `start` on."""
        layout, rows = self.layout, self.layout.rows
        for channel, at, block in active_channels(layout.sent, start, n):
            part, frequencies = layout.samples(channel)
            band = band_of(layout.waveform, channel.carrier, len(frequencies) * layout.grid.step)
            every = slice(channel.first, channel.stop)  # planned alike for all blocks
            pulses = range(at.start - channel.first, at.stop - channel.first)
            tx = rows.tx_positions(channel.offset, every)
            _, rx, reference = rows.ends(channel.offset, every)
            for j in range(rows.n_receivers):
                geometry = layout.geometry(tx, rx[:, j], reference[:, j], frequencies)
                yield ChannelPlace(
                    channel, geometry, band, frequencies, channel.first, pulses, block, slice(j, j + 1), part
                )

    def between(self, terms: tuple[ErrorTerm, ...]) -> tuple[ErrorTerm, ...]:
        """Error terms of the channels where their echoes have these: the same."""
        return terms

    def describe(self) -> dict[str, int]:
        """Words and numbers for a report: none."""
        return {}


def active_channels(sent: list[Channel], start: int, n: int) -> list[tuple[Channel, slice, slice]]:
    """Channels sent at some of the n pulses from `start` on, with those pulses counted from 0 and from `start`."""
    out = []
    for channel in sent:
        first, stop = max(channel.first, start), min(channel.stop, start + n)
        if first < stop:
            out.append((channel, slice(first, stop), slice(first - start, stop - start)))
    return out


def echoes_of(channel: ChannelEchoes, pulses: range, n_samples: int, done: int, total: int) -> tuple[np.ndarray, Added]:
    """Echoes (n, n_polarizations, n_samples) at n consecutive pulses of a channel, without the pulse's spectrum."""
    out = np.zeros((len(pulses), len(channel.scene.request.polarizations), n_samples), np.complex64)
    counts = channel.add(out, pulses, done, total)
    return out, Added(channel.error_terms, channel.plan, counts)
