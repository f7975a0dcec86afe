"""Points spread into oversampled range profiles, block by block of pulses: a type-1 nonuniform FFT in range."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.stage_timer import Clock
from ...model.waveform import Waveform
from ...numerics import range_profiles
from ...numerics.device_profiles import SpreadSamples
from ...numerics.plan import Plan
from ...numerics.polynomials import lagrange
from ...numerics.pulse_geometry import PulseGeometry
from ...numerics.tile_constants import TileConstants
from ...opencl.device import Buffer, Device
from ...opencl.launch_numbers import launch_numbers
from ...scattering.antenna_weights import AntennaWeights
from ...scattering.scatterers import Points
from ..kernel_images import sample_patches
from ..spreading import ChannelView, Counts, HostTiling, Rows, TiledScatterers, most_pulses, terms


def tiled_points(
    device: Device, points: Points, antennas: PulseGeometry, waveform: Waveform, weights: AntennaWeights
) -> TiledScatterers:
    """Points prepared for every channel, within the band of the waveform."""

    def amplitudes(some: np.ndarray, pulse: int, frequency: float) -> np.ndarray:
        return (weights.weights(points.positions[some], pulse, frequency) * points.amplitudes[some])[:, None]

    return TiledScatterers(
        device,
        HostTiling(device, points.positions, points.planes),
        len(antennas),
        lambda order: sample_patches(points.positions, order, antennas, waveform, amplitudes),
    )


@dataclass(frozen=True, eq=False)
class PointSpreader:
    """Points of one channel at one receiver, by a plan.

    nodes   Hz (m,), frequencies at which gains are computed and between which they are interpolated
    budget  bytes on the device
    """

    points: TiledScatterers
    plan: Plan
    view: ChannelView
    nodes: np.ndarray
    tolerance: float
    budget: float

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add points to samples (n_pulses, n_samples) of consecutive `pulses` of the antennas.

        on_progress is called with the number of pairs of point and pulse that are done.
        """
        kernel, n_nodes = _PointKernel(self), len(self.nodes)
        basis = lagrange(self.nodes, self.view.frequencies).astype(np.float32)
        clock.lap("scene")
        counts, first, end = Counts(), pulses[0], pulses[-1] + 1
        for start in range(first, end, kernel.pulses_at_once):
            stop = min(start + kernel.pulses_at_once, end)
            n_pulses = stop - start
            profiles, n_added, n_dark = kernel.profiles(start, stop)
            clock.lap("echo")
            spectra = kernel.spectra_of.of(profiles, kernel.rows.splits, n_pulses * n_nodes, 2)
            spectra = spectra.reshape(n_pulses, n_nodes, samples.shape[1])
            block = samples[start - first : stop - first]
            block += spectra[:, 0] if n_nodes == 1 else np.einsum("pmf,mf->pf", spectra, basis)
            pairs = n_pulses * len(self.points)
            counts += Counts(pairs, pairs - n_added - n_dark, 0, n_dark)
            clock.lap("spectra")
            on_progress(counts.pairs)
        return counts


class _PointKernel:
    """Kernel of a spreader, and what all blocks of its pulses share on the device."""

    def __init__(self, spreader: PointSpreader) -> None:
        points, plan, antennas, weights = spreader.points, spreader.plan, spreader.view.antennas, spreader.view.weights
        self.points, self.plan, self.view, self.device = points, plan, spreader.view, points.device
        device, n_nodes, bistatic = points.device, len(spreader.nodes), not antennas.is_monostatic
        self.tiles = tiles = points.tiles(plan.per_tile)
        stride = plan.length + 2 * range_profiles.padding(plan.interpolator)
        macros = {**plan.macros(bistatic, antennas.wrap), **weights.macros(n_nodes), "TILE": tiles.per_tile}
        self.tile_constants = TileConstants(device, plan, bistatic=bistatic, wrap=antennas.wrap)
        self.rows, (self.kernel,) = Rows.with_kernels(
            device,
            (stride, n_nodes, len(antennas), tiles.n_tiles),
            lambda of_rows: (device.kernel("spread_points.cl", "spread", **macros, **of_rows),),
        )
        self.table = device.upload(plan.interpolator.table)
        self.ratios = device.upload((spreader.nodes / weights.frequency).astype(np.float32))
        self.patterns, self.second = weights.upload(device)
        self.reach = device.upload(weights.limits)
        self.flush = max(1, int(terms(spreader.tolerance) / tiles.per_tile))
        n_samples = len(spreader.view.frequencies)
        self.spectra_of = SpreadSamples(device, n_samples, plan.interpolator, plan.length)
        per_pulse = self.tile_constants.nbytes * tiles.n_tiles + self.spectra_of.row_bytes * n_nodes
        per_pulse += self.rows.pulse_bytes
        most, lanes = min(most_pulses(device), int(spreader.budget / 2 / per_pulse)), device.info.vector_width
        self.pulses_at_once = max(1, most // lanes) * lanes

    def profiles(self, start: int, stop: int) -> tuple[Buffer, int, int]:
        """Range profiles of pulses start ... stop - 1 on the device, as `SpreadSamples.of` takes them, and numbers of
        pairs that were added, and out of the beam."""
        device, tiles, weights, n_pulses = self.device, self.tiles, self.view.weights, stop - start
        packed = self.view.antennas.packed(self.points.center, self.plan.length, start, stop, device.info.vector_width)
        n, pulse, every_tile = packed.shape[2], device.upload(packed), (0, tiles.n_tiles)
        constants = self.tile_constants.compute(
            pulse, n, tiles.references, tiles.radius, every_tile, tiles.n_tiles, int(self.view.gated)
        )
        (sums, rows), splits = self.rows.buffers(n_pulses), self.rows.splits
        done = device.zeros(8 * splits * n_pulses)
        axes = device.upload(weights.packed_axes(np.arange(start, stop)))
        device.run(
            self.kernel, self.rows.size(n_pulses), self.rows.group,
            launch_numbers(
                "spread_points.cl", "spread", n=n, n_used=n_pulses, n_tiles=tiles.n_tiles, n_offsets=tiles.n_offsets,
                second=self.second, range=weights.range, last=tiles.last, flush=self.flush,
                stride=self.rows.stride, origin=self.rows.stride // 2, near=np.float32(self.plan.near.radius),
            ),
            pulse, constants, tiles.references, tiles.offsets, tiles.planes, self.ratios, self.patterns, axes,
            self.reach, tiles.radius, self.table, sums, rows, done, steps=tiles.n_tiles / splits,
        )  # fmt: skip
        device.finish()
        counts = device.download(done, np.empty((2, splits, n_pulses), np.int32))
        n_added, n_dark = counts.sum(axis=(1, 2), dtype=np.int64).tolist()
        return rows, n_added, n_dark
