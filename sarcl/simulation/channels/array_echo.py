"""Echoes of arrays: every channel at its own place and carrier, added up at a receiver or kept apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...arrays.channels import channels_of, sampling, warn_of
from ...base.errors import ToleranceUnreachable
from ...base.report import Report
from ...base.validation import choice
from ...model.antenna_array import AntennaArray
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...numerics.plan import LEAST_TOLERANCE
from ...numerics.pulse_geometry import PulseGeometry
from ...scattering.antenna_weights import Beam
from ...scene.scene import Scene
from .. import echo_sampling
from ..echo_output import Target
from ..scene_echoes import Order, Work, band_of, bounded
from ._interpolated import Between
from ._separate import Apart, Layout, during
from .channel_rows import CHANNELS, RECEIVE, Rows, Sides, antennas_of

EQUAL, BETWEEN = "equal channels", "interpolated channels"  # why channels are left out


def array_echo(
    array: AntennaArray, scene: Scene, given: Scene, waveform: Waveform, track: Trajectory,
    receiver: Trajectory | None, point: np.ndarray, range_window: Any, weights: Beam, order: Order, *, channels: str,
    receive: str, compressed: bool, check: bool | None, out: Any,
) -> PhaseHistory:  # fmt: skip
    """What `sarcl.echo` returns with an array; arguments as there. given  the scene before random heights.

    Source: Farooq 2009, equations 4.28 to 4.32, with exact distances to every element.
    """
    choice("channels", channels, CHANNELS)
    choice("receive", receive, RECEIVE)
    if receive == "own" and channels != "separated":
        raise ValueError("receive='own' keeps every element's own channel apart; say channels='separated' too")
    bounded(float(np.abs(scene.amplitudes).max(initial=0.0)) * weights.peak * float(np.abs(array.weights).sum()))
    sides = Sides.of(track, receiver)
    sent = channels_of(array, waveform.center, len(track), EQUAL in order.skips)
    carriers = np.array([c.carrier for c in sent])
    warn_of(array, waveform, carriers)
    reference_range = echo_sampling.half_path(sides.tx, sides.rx, point)
    near, far = echo_sampling.window(scene, waveform, sides.tx, sides.rx, reference_range, range_window)
    grid = sampling(carriers, waveform, near, far, compressed)
    whole = band_of(waveform, grid.frequency + (grid.n - 1) / 2 * grid.step, grid.n * grid.step)
    everywhere = antennas_of(sides.tx, sides.rx, reference_range, grid.frequency, grid, (near, far))
    rows = Rows(array, sides, point, channels, receive, order.polarizations)
    layout = Layout(rows, sent, grid, (near, far), waveform, compressed)
    with Target(layout.shape(len(track)), out, order.budget, (near, far)) as target:
        way, work = _way(layout, scene, given, whole, everywhere, weights, order)
        worst = _filled(way, work, target)
        work.must_show(near, far)
        order.clock.lap("spectra")
        measured = None
        overlap = len(sent) if rows.separated else layout.overlap
        if work.worth_checking(check, overlap):
            measured = _measured(work, layout, target)
            order.clock.lap("check")
        counted = work.counted(way.runs // len(track))
        left_out = {
            EQUAL: sum((c.stop - c.first) * rows.hearing * (len(c.elements) - 1) for c in sent),
            BETWEEN: layout.runs - way.runs,
        }
        counted["contributions_skipped"] |= {why: work.scatterers * n for why, n in left_out.items() if n}
        how = work.plan() | {"channels": channels, "carriers": len(sent), "receivers": rows.hearing} | way.describe()
        return target.finish(
            **rows.geometry(waveform.center, grid, track, receiver or track),
            waveform=waveform, array=array, compressed=compressed,
            report=Report(
                plan=how, tolerance=order.tolerance, predicted_error=worst, measured_error=measured,
                **counted,
                seconds=order.clock.seconds, device=order.device.info.name, seed=order.seed,
            ),
        )  # fmt: skip


def _way(
    layout: Layout, scene: Scene, given: Scene, whole: Waveform, everywhere: PulseGeometry, weights: Beam, order: Order
) -> tuple[Apart | Between, Work]:
    """The cheaper way to make the samples whose plan keeps the tolerance, and the scene made ready for it."""
    between = _between(layout, scene, weights, order)
    if between is not None:
        inner = replace(order, tolerance=between.tolerance)
        try:
            return between, Work(inner, given, scene, whole, everywhere, weights, between.bands)
        except ToleranceUnreachable:  # interpolated channels leave less of the tolerance to the echoes at the places
            pass
    apart = Apart(layout)
    return apart, Work(order, given, scene, whole, everywhere, weights, apart.bands)


def _between(layout: Layout, scene: Scene, weights: Beam, order: Order) -> Between | None:
    """Channels interpolated between few places, where that may be done and is cheaper."""
    shared = not layout.rows.separated or layout.grid.holds([c.carrier for c in layout.sent])
    if BETWEEN not in order.skips or layout.runs <= len(layout.rows.sides.tx) or not shared:
        return None
    between = Between(layout, scene, weights, order.vertical, order.tolerance)
    worth = between.pays(len(scene.positions) + len(scene.triangles))
    return between if worth and between.tolerance >= LEAST_TOLERANCE else None


def _filled(way: Apart | Between, work: Work, target: Target) -> float:
    """Fill the target; returns the predicted error."""
    worst, total = 0.0, work.scatterers * way.runs
    pulses = min(way.pulses(work.order.budget), target.pulses)
    for start in range(0, len(target), pulses):
        block = target.block(start, min(start + pulses, len(target)))
        worst = max(worst, way.fill(work, block, start, total))
        target.keep(start, block)
    return worst


def _measured(work: Work, layout: Layout, samples: Target) -> float:
    """Relative error of 256 random samples, 16 each of 16 rows, against the exact sum over channels and scatterers; of
    fewer where there are many facets, as `_echo_check.measure_error` does for one channel, or many channels."""
    rows, sent, grid = layout.rows, layout.sent, layout.grid
    random, draws = np.random.default_rng(0), min(work.draws, 16 if len(sent) < 8 else 4 if len(sent) < 64 else 2)
    sums = np.zeros(3)
    for _ in range(draws):
        pulse, sender, receiver = (int(random.integers(n)) for n in rows.shape)
        some = random.integers(0, samples.shape[-1], draws)
        wanted = np.zeros((len(work.order.polarizations), draws), np.complex128)
        power = np.zeros(wanted.shape)
        for channel, _, _ in during(sent, pulse, 1):
            part, frequencies = layout.samples(channel)
            inside = (some >= part.start) & (some < part.stop)
            if not inside.any() or (rows.separated and sender not in channel.elements):
                continue
            f = frequencies[some[inside] - part.start]
            _, rx, reference = rows.ends(channel.offset, which=slice(receiver, receiver + 1))
            antennas = antennas_of(
                rows.sides.senders(channel.offset), rx[:, 0], reference[:, 0], float(f[0]), grid, layout.window, 1
            )
            beam = work.weights.seen_from(antennas.tx, antennas.rx, slice(None))
            weight = rows.array.weights[sender] if rows.separated else channel.weight
            factor = weight * layout.spectrum(channel, f) * work.weights.factor(f)
            values, powers = work.exact(antennas, pulse, f, beam)
            wanted[:, inside] += values * factor
            power[:, inside] += powers * np.abs(factor) ** 2
        made = samples[pulse][sender, receiver][:, some]
        sums += [np.sum(np.abs(made - wanted) ** 2), np.sum(np.abs(wanted) ** 2), power.sum()]
    return float(np.sqrt(sums[0] / max(sums[1], sums[2]))) if sums[0] else 0.0
