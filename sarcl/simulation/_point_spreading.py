"""Points spread into oversampled range profiles, block by block of pulses: a type-1 nonuniform FFT in range."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..base.stage_timer import Clock
from ..model.waveform import Waveform
from ..numerics import range_profiles
from ..numerics.device_profiles import SpreadSamples
from ..numerics.plan import Plan
from ..numerics.pulse_geometry import PulseGeometry
from ..numerics.tile_constants import TileConstants
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.scatterers import Points
from ._kernel_images import sample_patches
from .spreading import GROUP, Counts, HostTiling, TiledScatterers, is_grouped, most_pulses, splits, terms


def tiled_points(
    device: Device, points: Points, antennas: PulseGeometry, waveform: Waveform, weights: AntennaWeights
) -> TiledScatterers:
    """Points prepared for every channel, within the band of the waveform."""

    def amplitudes(some: np.ndarray, pulse: int, frequency: float) -> np.ndarray:
        return (weights.weights(points.positions[some], pulse, frequency) * points.amplitudes[some])[:, None]

    return TiledScatterers(
        device, HostTiling(device, points.positions, points.planes), len(antennas),
        lambda order: sample_patches(points.positions, order, antennas, waveform, amplitudes),
    )  # fmt: skip


def spread_points(
    points: TiledScatterers, plan: Plan, antennas: PulseGeometry, weights: AntennaWeights, nodes: np.ndarray,
    basis: np.ndarray, tolerance: float, budget: float, gated: bool, samples: np.ndarray, pulses: Sequence[int],
    clock: Clock, on_progress: Callable[[int], object],
) -> Counts:  # fmt: skip
    """Add points to samples (n_pulses, n_samples) of consecutive `pulses` of the antennas.

    nodes    Hz (m,), frequencies at which gains are computed;  basis (m, n_samples)  interpolates between them
    gated    leave out points outside the range window;  budget  bytes on the device
    on_progress is called with the number of pairs of point and pulse that are done.
    """
    device, lanes, n_samples = points.device, points.device.info.vector_width, samples.shape[1]
    tiles = points.tiles(plan.per_tile)
    bistatic, channels = not antennas.is_monostatic, len(nodes)
    grouped = is_grouped(device)
    macros = {**plan.macros(bistatic), **weights.macros(channels), "TILE": tiles.per_tile, "GROUPED": int(grouped)}
    tile_constants = TileConstants(device, plan, bistatic=bistatic)
    kernel = device.kernel("spread_points.cl", "spread", **macros)
    table = device.upload(plan.interpolator.table)
    ratios = device.upload((nodes / weights.frequency).astype(np.float32))
    patterns, second = weights.upload(device)
    reach = device.upload(weights.limits)
    flush = max(1, int(terms(tolerance) / tiles.per_tile))
    clock.lap("scene")

    stride = plan.length + 2 * range_profiles.padding(plan.interpolator)
    parts = splits(device, len(antennas), tiles.n_tiles, grouped)
    spectra_of = SpreadSamples(device, n_samples, plan.interpolator, plan.length)
    per_pulse = tile_constants.nbytes * tiles.n_tiles + (24 * stride * parts + spectra_of.row_bytes) * channels
    at_once = max(1, min(most_pulses(device), int(budget / 2 / per_pulse)) // lanes) * lanes
    counts, first, end = Counts(), pulses[0], pulses[-1] + 1
    for start in range(first, end, at_once):
        stop = min(start + at_once, end)
        packed = antennas.packed(points.center, plan.length, start, stop, lanes)
        n, used = packed.shape[2], stop - start
        pulse = device.upload(packed)
        whole = 0, tiles.n_tiles
        constants = tile_constants.compute(pulse, n, tiles.references, tiles.radius, whole, tiles.n_tiles, int(gated))
        rows, done = device.zeros(24 * parts * used * stride * channels), device.zeros(8 * parts * used)
        axes = device.upload(weights.packed_axes(np.arange(start, stop)))
        size, ends = (used, parts), (1, 1) if device.is_cpu else None
        if grouped:
            size, ends = (GROUP * used, parts), (GROUP, 1)
        device.run(
            kernel, size, ends,
            launch_numbers(
                "spread_points.cl", "spread", n=n, n_used=used, n_tiles=tiles.n_tiles,
                n_offsets=tiles.n_offsets, second=second, range=weights.range, last=tiles.last, flush=flush,
                stride=stride, origin=stride // 2,
            ),
            pulse, constants, tiles.references, tiles.offsets, tiles.planes, ratios, patterns, axes, reach,
            tiles.radius, table, rows, done, steps=tiles.n_tiles / parts,
        )  # fmt: skip
        device.finish()
        clock.lap("echo")
        spectra = spectra_of.of(rows, parts, used * channels).reshape(used, channels, n_samples)
        here = samples[start - first : stop - first]
        if channels == 1:
            here += spectra[:, 0]
        else:
            here += np.einsum("pmf,mf->pf", spectra, basis.astype(np.float32))
        added, dark = device.download(done, np.empty((2, parts, used), np.int32)).sum(axis=(1, 2), dtype=np.int64)
        pairs = used * len(points)
        counts += Counts(pairs, pairs - int(added) - int(dark), 0, int(dark))
        clock.lap("spectra")
        on_progress(counts.pairs)
    return counts
