"""Echoes of arrays: every channel at its own place and carrier, added up at a receiver or kept apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from . import echo_rows
from .array import AntennaArray
from .array_rows import CHANNELS, RECEIVE, Rows, Sides, antennas_of
from .channels import Channel, Sampling, channels_of, sampling, warn_of
from .check import choice, sealed
from .echo_work import Order, Work, band_of
from .gains import Beam
from .gains_error import beam_error
from .phase_history import PhaseHistory
from .report import Report
from .scene import Scene
from .trajectory import Trajectory
from .waveform import Waveform

EQUAL = "equal channels"  # why channels are left out


def array_echo(
    array: AntennaArray, scene: Scene, given: Scene, waveform: Waveform, track: Trajectory,
    receiver: Trajectory | None, point: np.ndarray, range_window: Any, weights: Beam, order: Order, *, channels: str,
    receive: str, compressed: bool, check: bool | None,
) -> PhaseHistory:  # fmt: skip
    """What `sarcl.echo` returns with an array; arguments as there. given  the scene before random heights.

    Source: Farooq 2009, equations 4.28 to 4.32, with exact distances to every element.
    """
    choice("channels", channels, CHANNELS)
    choice("receive", receive, RECEIVE)
    if receive == "own" and channels != "separated":
        raise ValueError("receive='own' keeps every element's own channel apart; say channels='separated' too")
    sides = Sides.of(track, receiver)
    merge = "places" if EQUAL in order.skips else "none"
    sent = channels_of(array, waveform.center, len(track), merge)
    carriers = np.array([c.carrier for c in sent])
    warn_of(array, waveform, carriers)
    reference_range = echo_rows.half_path(sides.tx, sides.rx, point)
    near, far = echo_rows.window(scene, waveform, sides.tx, sides.rx, reference_range, range_window)
    grid = sampling(carriers, waveform, near, far, compressed)
    whole = band_of(waveform, grid.frequency + (grid.n - 1) / 2 * grid.step, grid.n * grid.step)
    everywhere = antennas_of(sides.tx, sides.rx, reference_range, grid.frequency, grid, (near, far))
    if merge == "places" and channels == "simultaneous" and array.is_constant and np.ptp(array.positions, axis=0).any():
        middle = array.positions.mean(axis=0)
        together = sides.together(weights, array.positions - middle, array.weights, middle)
        if _within(together, scene, whole, order):
            weights, sent = together, channels_of(array, waveform.center, len(track), "carriers")
    work = Work(order, given, scene, whole, everywhere, weights)
    rows = Rows(array, sides, point, channels, receive, order.polarizations)
    n = grid.width if rows.separated else grid.n
    count = int(np.prod(rows.shape))
    samples = echo_rows.zeros(count, len(order.polarizations), n, near, far)
    samples = samples.reshape(*rows.shape, len(order.polarizations), n)
    total = work.scatterers * sum((c.stop - c.first) * len(rows.receivers(c)) for c in sent)
    worst = 0.0
    for channel in sent:
        part, frequencies = _samples(channel, grid, rows.separated)
        spectrum = _spectrum(channel, waveform, frequencies, compressed) * work.weights.factor(frequencies)
        band = band_of(waveform, channel.carrier, len(frequencies) * grid.step)
        at = slice(channel.first, channel.stop)
        for number, heard in rows.receivers(channel):
            _, rx, reference = rows.ends(channel.offset, heard)
            tx = sides.senders(channel.offset)
            n_here, edges = len(frequencies), (near, far)
            antennas = antennas_of(tx[at], rx[at], reference[at], float(frequencies[0]), grid, edges, n_here)
            beam = work.weights.seen_from(antennas.tx, antennas.tx if antennas.rx is None else antennas.rx, at)
            made = np.zeros((len(antennas.tx), len(order.polarizations), len(frequencies)), np.complex64)
            work.add(antennas, band, frequencies, made, total, channel.first, beam)
            made *= spectrum.astype(np.complex64)
            worst = max(worst, work.predicted_error)
            rows.put(samples, channel, number, part, made)
    work.must_show(near, far)
    order.clock.lap("spectra")
    measured = None
    overlap = len(sent) if rows.separated else max(1.0, sum(grid.width for _ in sent) / grid.n)
    if work.worth_checking(check, overlap):
        measured = _measured(work, rows, sent, grid, samples, (near, far), waveform, compressed)
        order.clock.lap("check")
    equal = work.scatterers * sum((c.stop - c.first) * len(rows.receivers(c)) * (len(c.elements) - 1) for c in sent)
    counted = work.counted(total // max(1, work.scatterers * len(track)))
    if equal:
        counted["contributions_skipped"][EQUAL] = equal
    how = work.plan() | {"channels": channels, "carriers": len(sent), "receivers": len(rows.heard)}
    return PhaseHistory(
        sealed(samples.reshape(-1, n)), **rows.geometry(waveform.center, grid, track, receiver or track),
        waveform=waveform, array=array, compressed=compressed,
        report=Report(
            plan=how, tolerance=order.tolerance, predicted_error=worst, measured_error=measured,
            **counted,
            seconds=order.clock.seconds, device=order.device.info.name, seed=order.seed,
        ),
    )  # fmt: skip


def _within(beam: Beam, scene: Scene, whole: Waveform, order: Order) -> bool:
    """Whether elements of one carrier may be one antenna: in float32, at a few frequencies of the band.

    Where they cancel almost wholly, each has to be added by itself.
    """
    try:
        found = beam_error(beam, scene, whole, order.polarizations, order.vertical, 0.7 * order.tolerance)
    except ValueError:
        return False
    return float(found.over_band.min(where=found.over_band > 0, initial=np.inf)) < 0.2 * order.tolerance


def _samples(channel: Channel, grid: Sampling, separated: bool) -> tuple[slice, np.ndarray]:
    """A channel's samples in its rows, and their frequencies, Hz."""
    if separated:
        own = grid.of(channel.carrier)
        return slice(0, own.n), own.frequency + own.step * np.arange(own.n)
    part = grid.part(channel.carrier)
    return part, grid.frequency + grid.step * np.arange(grid.n)[part]


def _spectrum(channel: Channel, waveform: Waveform, frequencies: np.ndarray, compressed: bool) -> np.ndarray:
    pulse = replace(waveform, center=channel.carrier).pulse_spectrum(frequencies)
    return np.asarray(np.abs(pulse) ** 2 if compressed else pulse)


def _measured(
    work: Work, rows: Rows, sent: list[Channel], grid: Sampling, samples: np.ndarray, window: tuple[float, float],
    waveform: Waveform, compressed: bool,
) -> float:  # fmt: skip
    """Relative error of 256 random samples, 16 each of 16 rows, against the exact sum over channels and scatterers; of
    fewer where there are many facets, as `measure_error` does for one channel, or more than seven channels."""
    random, draws = np.random.default_rng(0), min(work.draws, 16 if len(sent) < 8 else 4)
    sums = np.zeros(3)
    for _ in range(draws):
        pulse, sender, receiver = (int(random.integers(n)) for n in rows.shape)
        some = random.integers(0, samples.shape[-1], draws)
        wanted = np.zeros((len(work.order.polarizations), draws), np.complex128)
        power = np.zeros(wanted.shape)
        for channel in sent:
            part, frequencies = _samples(channel, grid, rows.separated)
            inside = (some >= part.start) & (some < part.stop)
            its = not rows.separated or sender in channel.elements
            if not (channel.first <= pulse < channel.stop and inside.any() and its):
                continue
            f = frequencies[some[inside] - part.start]
            heard = channel.offset if rows.receive == "own" else rows.heard[receiver]
            _, rx, reference = rows.ends(channel.offset, heard)
            antennas = antennas_of(rows.sides.senders(channel.offset), rx, reference, float(f[0]), grid, window, 1)
            beam = work.weights.seen_from(antennas.tx, antennas.tx if antennas.rx is None else antennas.rx, slice(None))
            weight = rows.array.weights[sender] if rows.separated else channel.weight
            factor = weight * _spectrum(channel, waveform, f, compressed) * work.weights.factor(f)
            values, powers = work.exact(antennas, pulse, f, beam)
            wanted[:, inside] += values * factor
            power[:, inside] += powers * np.abs(factor) ** 2
        made = samples[pulse, sender, receiver][:, some]
        sums += [np.sum(np.abs(made - wanted) ** 2), np.sum(np.abs(wanted) ** 2), power.sum()]
    return float(np.sqrt(sums[0] / max(sums[1], sums[2]))) if sums[0] else 0.0
