"""Echoes of one transmitting and one receiving antenna: rows, samples, and the sum over the scatterers."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.report import ErrorTerm
from ..model.trajectory import receiver_positions
from ..numerics.pulse_geometry import PulseGeometry
from . import echo_sampling
from .echo_check import measure_error
from .echo_output import EchoOutput
from .echo_request import EchoRequest
from .echo_task import EchoTask
from .factorized.spreader import FactorizedSpreader
from .scene_echoes import Added, ChannelEchoes, SceneEchoes
from .scene_plan import SeenScene
from .spreading import Band, Counts, most_pulses


class SingleChannel:
    """Rows and samples of the echoes of one antenna, or of a pair, and how they are computed.

    seen    the scene as the antennas see it;  window  (near, far), m about the reference
    shape   of the samples: (pulses, polarizations, samples);  overlap  channels that are summed in one sample
    """

    overlap = 1.0

    def __init__(self, task: EchoTask) -> None:
        self.task = task
        tx, rx = task.track.positions, receiver_positions(task.track, task.receiver)
        self.reference_range = echo_sampling.half_path(tx, rx, task.point)
        self.window = near, far = echo_sampling.window(
            task.scene, task.waveform, tx, rx, self.reference_range, task.options.range_window
        )
        self.first, self.step, n = echo_sampling.sampling(task.waveform, near, far, task.options.compressed)
        antennas = PulseGeometry.sampled(
            tx, rx, self.reference_range, first=self.first, step=self.step, n_samples=n, window=self.window,
            forward=task.options.forward,
        )  # fmt: skip
        self.seen = SeenScene(task.original, task.scene, task.waveform, antennas, task.weights)
        self.shape: tuple[int, ...] = len(tx), len(task.request.polarizations), n

    @functools.cached_property
    def frequencies(self) -> np.ndarray:
        """Frequencies of the samples, Hz (n,): made when samples have found room."""
        return np.asarray(self.first + self.step * np.arange(self.shape[-1]))

    def methods(self, request: EchoRequest) -> list[tuple[SingleEchoes, EchoRequest]]:
        """The methods that may compute the echoes, cheapest first, and what is asked of each."""
        return [(SingleEchoes(self), request)]

    def spectrum(self, prepared: SceneEchoes) -> np.ndarray:
        """Spectrum of the pulse, after its matched filter if compressed, times the factor of the antennas' weights."""
        pulse = self.task.waveform.pulse_spectrum(self.frequencies)
        response = np.abs(pulse) ** 2 if self.task.options.compressed else pulse
        return np.asarray(response * prepared.weights.factor(self.frequencies))

    def measured(self, prepared: SceneEchoes, output: EchoOutput) -> float:
        """Relative error of random samples."""
        return measure_error(prepared, self.seen.antennas, self.frequencies, self.spectrum(prepared), output)

    def counted(self, method: SingleEchoes, prepared: SceneEchoes, counts: Counts) -> dict[str, Any]:
        """Contributions done and skipped, as a report has them."""
        return prepared.counted(counts)

    def words(self, method: SingleEchoes, plan: dict[str, Any]) -> dict[str, Any]:
        """The plan of the scatterers with what is to be said of antennas."""
        return plan | self.task.motion

    def fields(self) -> dict[str, Any]:
        """Fields of the PhaseHistory, beside its samples and report."""
        task = self.task
        rows = echo_sampling.row_fields(task.track, task.receiver, self.reference_range, task.request.polarizations)
        return {"frequency": self.first, "frequency_step": self.step, **rows}


class SingleEchoes:
    """The sum over the scatterers, planned once for all pulses."""

    def __init__(self, rows: SingleChannel) -> None:
        self.rows, self.runs = rows, rows.shape[0]
        self._channel: ChannelEchoes | None = None

    @property
    def bands(self) -> list[Band]:
        """Band of the samples."""
        antennas = self.rows.seen.antennas
        return [Band(self.rows.shape[-1], self.rows.task.waveform.bandwidth, float(antennas.frequency[0]))]

    def pulses(self, budget: float) -> int:
        """Pulses per call of `fill`: all of them."""
        return self.runs

    def least(self, scene: SceneEchoes) -> float:
        """Pulses of a block, at least: where profiles by levels are too large to be kept, blocks repeat their work."""
        kept = all(one.keeps_profiles for one in self.channel(scene).apart()[1])
        return most_pulses(scene.request.device) if kept else np.inf

    def fresh(self) -> SingleEchoes:
        """The same for another device: nothing is planned yet."""
        return SingleEchoes(self.rows)

    def channel(self, scene: SceneEchoes) -> ChannelEchoes:
        """The plan of the echoes of a scene."""
        rows = self.rows
        if self._channel is None:
            self._channel = scene.channel(rows.seen.antennas, rows.task.waveform, rows.frequencies)
        return replace(self._channel, scene=scene)

    def apart(self, scene: SceneEchoes) -> tuple[SingleEchoes, list[FactorizedSpreader]]:
        """The sum over the scatterers that are added pulse by pulse, and what adds the others; see ChannelEchoes."""
        channel, by_levels = self.channel(scene).apart()
        rest = SingleEchoes(self.rows)
        rest._channel = channel
        return rest, by_levels

    def fill(self, scene: SceneEchoes, samples: np.ndarray, start: int, done: int, total: int) -> Added:
        """Add echoes to samples (n, n_polarizations, n_samples), zeros so far, from pulse `start` on.

        done, total  pairs of scatterer and pulse, for progress
        """
        channel = self.channel(scene)
        counts = channel.add(samples, range(start, start + len(samples)), done, total)
        samples *= self.rows.spectrum(scene).astype(np.complex64)
        return Added(channel.error_terms, channel.plan, counts)

    def planned(self, scene: SceneEchoes) -> Added:
        """The plan of the echoes of all pulses, without these."""
        channel = self.channel(scene)
        return Added(channel.error_terms, channel.plan)

    def between(self, terms: tuple[ErrorTerm, ...]) -> tuple[ErrorTerm, ...]:
        """Error terms of the channels where their echoes have these: the same."""
        return terms
