"""Echoes of arrays: every channel with its own position and carrier, summed at each receiver or kept separate."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...arrays.channels import LEAST_CUT, channels_of, cut_of, sampling, warn_of
from ...base.errors import ToleranceUnreachable, confirm_tolerance, warned_once
from ...base.report import Report
from ...base.validation import choice
from ...model.antenna_array import AntennaArray
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...numerics.plan import LEAST_TOLERANCE
from ...numerics.pulse_geometry import PulseGeometry
from ...scattering.antenna_weights import AntennaWeights
from ...scene.scene import Scene
from .. import echo_sampling
from ..echo_check import draws_of, exact, worth_checking
from ..echo_output import EchoOutput
from ..echo_request import EchoRequest
from ..scene_echoes import SceneEchoes, band_of
from ..scene_preparation import bounded, prepare_scene
from ._interpolated import InterpolatedChannels
from ._separate import Added, ChannelLayout, SeparateChannels, active_channels
from .channel_rows import CHANNELS, RECEIVE, ChannelRows

EQUAL, INTERPOLATED = "equal channels", "interpolated channels"  # reasons to leave out contributions


def array_echo(
    array: AntennaArray, scene: Scene, original_scene: Scene, waveform: Waveform, track: Trajectory,
    receiver: Trajectory | None, point: np.ndarray, range_window: Any, weights: AntennaWeights, request: EchoRequest, *,
    motion: dict[str, object], channels: str, receive: str, compressed: bool, check: bool | None, out: Any,
) -> PhaseHistory:  # fmt: skip
    """The phase history that `sarcl.echo` returns with an array; arguments as there.

    motion  what the report says of antennas while pulses are on their way
    scene  with its random heights;  original_scene  without them;  point  the reference point, m (3,)

    Source: Farooq 2009, equations 4.28 to 4.32, with exact distances to every element.
    """
    choice("channels", channels, CHANNELS)
    choice("receive", receive, RECEIVE)
    if receive == "own" and channels != "separated":
        raise ValueError("receive='own' keeps the channel of every element separate; pass channels='separated' too")
    bounded(float(np.abs(scene.amplitudes).max(initial=0.0)) * weights.peak * float(np.abs(array.weights).sum()))
    rows = ChannelRows(array, track, receiver, point, channels, receive, request.polarizations)
    tx, rx = rows.track.tx, rows.track.rx
    sent = channels_of(array, waveform.center, len(track), EQUAL in request.skips)
    carriers = np.array([c.carrier for c in sent])
    warn_of(array, waveform, carriers)
    reference_range = rows.track.half_path(point)
    near, far = echo_sampling.window(scene, waveform, tx, rx, reference_range, range_window)
    grid = sampling(carriers, waveform, near, far, compressed)
    cut = cut_of(grid, waveform, carriers, compressed)
    whole = band_of(waveform, grid.frequency + (grid.n - 1) / 2 * grid.step, grid.n * grid.step)
    layout = ChannelLayout(rows, sent, grid, (near, far), waveform, compressed)
    geometry = layout.geometry(tx, rx, reference_range, layout.frequencies)
    with EchoOutput(layout.shape(len(track)), out, request.budget, (near, far)) as output:
        with warned_once():  # the scene may be prepared for one method and then for the other
            method, prepared = _planned(layout, scene, original_scene, whole, geometry, weights, request)
        added = _filled(method, prepared, output)
        prepared.check_seen(added.counts, near, far)
        request.clock.lap("spectra")
        measured = None
        overlap = len(sent) if rows.separated else layout.overlap
        if worth_checking(prepared, check, overlap):
            measured = _measured(prepared, layout, output)
            request.clock.lap("check")
        counted = prepared.counted(added.counts, method.runs // len(track))
        left_out = {
            EQUAL: sum((c.stop - c.first) * rows.n_receivers * (len(c.elements) - 1) for c in sent),
            INTERPOLATED: layout.runs - method.runs,
        }
        counted["contributions_skipped"] |= {why: len(prepared) * n for why, n in left_out.items() if n}
        how = (
            added.plan
            | {"channels": channels, "carriers": len(sent), "receivers": rows.n_receivers}
            | method.describe()
            | motion
        )
        if cut > LEAST_CUT:
            how["tone spectra"] = f"cut half-way to the next carriers: {100 * cut:.2g} % of their norm is left out"
        raw = output.finish(
            **rows.fields(waveform.center, grid, track, receiver or track),
            waveform=waveform, array=array, compressed=compressed,
            report=Report(
                plan=how, tolerance=request.tolerance, predicted_error=added.predicted_error,
                error_terms=added.error_terms, measured_error=measured, **counted,
                seconds=request.clock.seconds, device=request.device.info.name, seed=request.seed,
            ),
        )  # fmt: skip
    confirm_tolerance(raw=raw)
    return raw


def _planned(
    layout: ChannelLayout, scene: Scene, original_scene: Scene, whole: Waveform, geometry: PulseGeometry,
    weights: AntennaWeights, request: EchoRequest,
) -> tuple[SeparateChannels | InterpolatedChannels, SceneEchoes]:  # fmt: skip
    """The cheaper method whose plan keeps the tolerance, and the scene prepared for it.

    whole  waveform over the band of all channels;  geometry  of the arrays' reference points
    """
    margin = float(np.linalg.norm(layout.rows.array.positions, axis=1).max())
    interpolated = _interpolated(layout, scene, weights, request)
    if interpolated is not None:
        inner = replace(request, tolerance=interpolated.tolerance)
        try:
            return interpolated, prepare_scene(
                inner, original_scene, scene, whole, geometry, weights, interpolated.bands, margin
            )
        except ToleranceUnreachable:  # interpolation leaves less of the tolerance to the echoes at the positions
            pass
    separate = SeparateChannels(layout)
    return separate, prepare_scene(request, original_scene, scene, whole, geometry, weights, separate.bands, margin)


def _interpolated(
    layout: ChannelLayout, scene: Scene, weights: AntennaWeights, request: EchoRequest
) -> InterpolatedChannels | None:
    """Channels interpolated from a few positions, where that is allowed, accurate and cheaper."""
    shared = not layout.rows.separated or layout.grid.holds([c.carrier for c in layout.sent])
    if INTERPOLATED not in request.skips or layout.runs <= len(layout.rows.track) or not shared:
        return None
    channels = InterpolatedChannels(layout, scene, weights, request.vertical, request.tolerance)
    faster = channels.is_faster(len(scene.positions) + len(scene.triangles))
    return channels if faster and channels.tolerance >= LEAST_TOLERANCE else None


def _filled(method: SeparateChannels | InterpolatedChannels, prepared: SceneEchoes, output: EchoOutput) -> Added:
    """Fill the output with samples."""
    added, total = Added(), len(prepared) * method.runs
    pulses = min(method.pulses(prepared.request.budget), output.pulses)
    for start in range(0, len(output), pulses):
        block = output.block(start, min(start + pulses, len(output)))
        added += method.fill(prepared, block, start, added.counts.pairs, total)
        output.keep(start, block)
    return added


def _measured(prepared: SceneEchoes, layout: ChannelLayout, samples: EchoOutput) -> float:
    """Relative error of 256 random samples, 16 in each of 16 rows, against the exact sum over channels and scatterers.

    With many facets (as in `echo_check.measure_error`) or many channels there are fewer rows and samples.
    """
    rows, sent = layout.rows, layout.sent
    random = np.random.default_rng(0)
    draws = min(draws_of(prepared), 16 if len(sent) < 8 else 4 if len(sent) < 64 else 2)
    sums = np.zeros(3)
    for _ in range(draws):
        pulse, transmitter, receiver = (int(random.integers(n)) for n in rows.shape)
        some = random.integers(0, samples.shape[-1], draws)
        wanted = np.zeros((len(prepared.request.polarizations), draws), np.complex128)
        power = np.zeros(wanted.shape)
        for channel, _, _ in active_channels(sent, pulse, 1):
            part, frequencies = layout.samples(channel)
            inside = (some >= part.start) & (some < part.stop)
            if not inside.any() or (rows.separated and transmitter not in channel.elements):
                continue
            f = frequencies[some[inside] - part.start]
            _, rx, reference = rows.ends(channel.offset, which=slice(receiver, receiver + 1))
            geometry = layout.geometry(rows.tx_positions(channel.offset), rx[:, 0], reference[:, 0], f[:1])
            weight = rows.array.weights[transmitter] if rows.separated else channel.weight
            factor = weight * layout.spectrum(channel, f) * prepared.weights.factor(f)
            values, powers = exact(prepared, geometry, pulse, f, prepared.weights.at(geometry))
            wanted[:, inside] += values * factor
            power[:, inside] += powers * np.abs(factor) ** 2
        made = samples[pulse][transmitter, receiver][:, some]
        sums += [np.sum(np.abs(made - wanted) ** 2), np.sum(np.abs(wanted) ** 2), power.sum()]
    return float(np.sqrt(sums[0] / max(sums[1], sums[2]))) if sums[0] else 0.0
