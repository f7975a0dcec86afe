"""Echoes of arrays: every channel with its own position and carrier, summed at each receiver or kept separate."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...arrays.channels import LEAST_CUT, channels_of, cut_of, sampling, warn_of
from ...model.antenna_array import AntennaArray
from ...numerics.plan import LEAST_TOLERANCE
from .. import echo_sampling
from ..echo_check import draws_of, exact
from ..echo_output import EchoOutput
from ..echo_request import EchoRequest
from ..echo_task import EchoTask
from ..scene_echoes import SceneEchoes, band_of
from ..scene_plan import SeenScene
from ..scene_preparation import bounded
from ..spreading import Counts
from ._channel_rows import ChannelRows
from ._interpolated import InterpolatedChannels
from ._separate import ChannelLayout, SeparateChannels, active_channels

EQUAL, INTERPOLATED = "equal channels", "interpolated channels"  # reasons to leave out contributions
Method = SeparateChannels | InterpolatedChannels


class ArrayChannels:
    """Rows and samples of the channels of an array, and the methods that may compute them.

    seen    the scene as the array's reference points see it, over the band of all channels
    window  (near, far), m about the reference
    shape   of the samples: (pulses, transmitters, receivers, polarizations, samples)
    overlap  channels that are checked in one sample
    Source: Farooq 2009, equations 4.28 to 4.32, with exact distances to every element.
    """

    def __init__(self, task: EchoTask, array: AntennaArray) -> None:
        options, request, waveform = task.options, task.request, task.waveform
        if options.receive == "own" and options.channels != "separated":
            raise ValueError("receive='own' keeps the channel of every element separate; pass channels='separated' too")
        largest = float(np.abs(task.scene.amplitudes).max(initial=0.0))
        bounded(largest * task.weights.peak * float(np.abs(array.weights).sum()))
        rows = ChannelRows(
            array, task.track, task.receiver, task.point, options.channels, options.receive, request.polarizations
        )
        sent = channels_of(array, waveform.center, len(task.track), EQUAL in request.skips)
        carriers = np.array([c.carrier for c in sent])
        warn_of(array, waveform, carriers)
        tx, rx, reference_range = rows.track.tx, rows.track.rx, rows.track.half_path(task.point)
        self.window = near, far = echo_sampling.window(
            task.scene, waveform, tx, rx, reference_range, options.range_window
        )
        grid = sampling(carriers, waveform, near, far, options.compressed)
        self.task, self.cut = task, cut_of(grid, waveform, carriers, options.compressed)
        self.layout = layout = ChannelLayout(rows, sent, grid, (near, far), waveform, options.compressed)
        self.seen = SeenScene(
            task.original,
            task.scene,
            band_of(waveform, grid.frequency + (grid.n - 1) / 2 * grid.step, grid.n * grid.step),
            layout.geometry(tx, rx, reference_range, layout.frequencies),
            task.weights,
            float(np.linalg.norm(array.positions, axis=1).max()),
        )
        self.shape = layout.shape(len(task.track))
        self.overlap = float(len(sent)) if rows.separated else layout.overlap

    def methods(self, request: EchoRequest) -> list[tuple[Method, EchoRequest]]:
        """The methods that may compute the echoes, cheapest first, and what is asked of each."""
        separate: tuple[Method, EchoRequest] = SeparateChannels(self.layout), request
        interpolated = self._interpolated(request)
        # interpolation leaves less of the tolerance to the echoes at the positions
        inner = [(interpolated, replace(request, tolerance=interpolated.tolerance))] if interpolated else []
        return [*inner, separate]

    def _interpolated(self, request: EchoRequest) -> InterpolatedChannels | None:
        """Channels interpolated from a few positions, where that is allowed, accurate and cheaper."""
        layout, scene = self.layout, self.seen.scene
        shared = not layout.rows.separated or layout.grid.holds([c.carrier for c in layout.sent])
        if (
            request.crease is not None
            or request.bounces > 1  # shadows of edges and of bounced beams end abruptly from element to element
            or INTERPOLATED not in request.skips
            or layout.runs <= len(layout.rows.track)
            or not shared
        ):
            return None
        channels = InterpolatedChannels(layout, scene, self.seen.weights, request.vertical, request.tolerance)
        faster = channels.is_faster(len(scene.positions) + len(scene.triangles))
        return channels if faster and channels.tolerance >= LEAST_TOLERANCE else None

    def counted(self, method: Method, prepared: SceneEchoes, counts: Counts) -> dict[str, Any]:
        """Contributions done and skipped, as a report has them."""
        layout = self.layout
        counted = prepared.counted(counts, method.runs // len(layout.rows.track))
        equal = sum((c.stop - c.first) * layout.rows.n_receivers * (len(c.elements) - 1) for c in layout.sent)
        left_out = {EQUAL: equal, INTERPOLATED: layout.runs - method.runs}
        counted["contributions_skipped"] |= {why: len(prepared) * n for why, n in left_out.items() if n}
        return counted

    def words(self, method: Method, plan: dict[str, Any]) -> dict[str, Any]:
        """The plan of the scatterers with what is to be said of channels and antennas."""
        layout = self.layout
        sizes = {"carriers": len(layout.sent), "receivers": layout.rows.n_receivers}
        words = plan | {"channels": self.task.options.channels} | sizes | method.describe() | self.task.motion
        if self.cut > LEAST_CUT:
            words["tone spectra"] = (
                f"cut half-way to the next carriers: {100 * self.cut:.2g} % of their norm is left out"
            )
        return words

    def fields(self) -> dict[str, Any]:
        """Fields of the PhaseHistory, beside its samples and report."""
        task = self.task
        return self.layout.rows.fields(task.waveform.center, self.layout.grid, task.track, task.receiver or task.track)

    def measured(self, prepared: SceneEchoes, samples: EchoOutput) -> float:
        """Relative error of 256 random samples, 16 in each of 16 rows, against the exact sum over channels and
        scatterers.

        With many facets (as in `echo_check.measure_error`) or many channels there are fewer rows and samples.
        """
        layout = self.layout
        rows, sent = layout.rows, layout.sent
        random = np.random.default_rng(0)
        draws = min(draws_of(prepared), 16 if len(sent) < 8 else 4 if len(sent) < 64 else 2)
        sums = np.zeros(3)
        for _ in range(draws):
            pulse, transmitter, receiver = (int(random.integers(n)) for n in rows.shape)
            columns = random.integers(0, samples.shape[-1], draws)
            exact_sums = np.zeros((len(prepared.request.polarizations), draws), np.complex128)
            power = np.zeros(exact_sums.shape)
            for channel, _, _ in active_channels(sent, pulse, 1):
                part, frequencies = layout.samples(channel)
                inside = (columns >= part.start) & (columns < part.stop)
                if not inside.any() or (rows.separated and transmitter not in channel.elements):
                    continue
                f = frequencies[columns[inside] - part.start]
                _, rx, reference = rows.ends(channel.offset, which=slice(receiver, receiver + 1))
                geometry = layout.geometry(rows.tx_positions(channel.offset), rx[:, 0], reference[:, 0], f[:1])
                weight = rows.array.weights[transmitter] if rows.separated else channel.weight
                factor = weight * layout.spectrum(channel, f) * prepared.weights.factor(f)
                values, powers = exact(prepared, geometry, pulse, f, prepared.weights.at(geometry))
                exact_sums[:, inside] += values * factor
                power[:, inside] += powers * np.abs(factor) ** 2
            row_samples = samples[pulse][transmitter, receiver][:, columns]
            sums += [np.sum(np.abs(row_samples - exact_sums) ** 2), np.sum(np.abs(exact_sums) ** 2), power.sum()]
        return float(np.sqrt(sums[0] / max(sums[1], sums[2]))) if sums[0] else 0.0
