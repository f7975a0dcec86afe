"""Scatterers spread into oversampled range profiles, block by block: a type-1 nonuniform FFT in range."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base import float_pairs
from ..base.boxes import box
from ..base.stage_timer import Clock
from ..numerics import range_profiles
from ..numerics.plan import Plan
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.scatterers import Points
from .spreading import plan_tiles, splits, terms


class Spreader:
    """Adds points to the samples of every pulse by the cheapest plan that meets the tolerance."""

    def __init__(
        self,
        device: Device,
        antennas: PulseGeometry,
        bandwidth: float,
        n_samples: int,
        tolerance: float,
        budget: float,
        skip: bool,
        beam: AntennaWeights,
        basis: np.ndarray,
        nodes: np.ndarray,
    ) -> None:
        self.device, self.antennas, self.n_samples = device, antennas, n_samples
        self.bandwidth, self.tolerance, self.budget, self.skip = bandwidth, tolerance, budget, skip
        self.beam, self.basis, self.nodes = beam, basis, nodes

    def add(
        self, part: Points, samples: np.ndarray, clock: Clock, tell: Callable[[int], object] | None
    ) -> tuple[Plan, int, int]:
        """Add `part` to samples (n_pulses, n_samples).

        Returns the plan, and how many pairs were gated out, and left out of the beam.
        """
        positions = part.positions
        center = box(positions).mean(axis=0)
        plan, tiles, order = plan_tiles(
            positions, center, self.antennas, self.bandwidth, self.n_samples, self.tolerance
        )
        bistatic = not self.antennas.is_monostatic
        device, lanes = self.device, self.device.info.vector_width
        channels = len(self.nodes)
        macros = {**plan.macros(bistatic), **self.beam.macros(channels), "TILE": tiles.per_tile}
        constants_kernel = device.kernel("spread_points.cl", "tile_constants", **macros)
        kernel = device.kernel("spread_points.cl", "spread", **macros)
        table = device.upload(plan.interpolator.table)
        references = device.upload(float_pairs.wide(tiles.references.T))
        radius = device.upload(tiles.radius.astype(np.float32))
        offsets = device.upload(tiles.offsets)
        planes = device.upload(part.planes(order))
        ratios = device.upload((self.nodes / self.beam.frequency).astype(np.float32))
        patterns, second = self.beam.upload(device)
        reach = device.upload(self.beam.limits)
        last = tiles.per_tile - (len(order) - len(part))
        flush = max(1, int(terms(self.tolerance) / tiles.per_tile))
        clock.lap("scene")

        stride = plan.length + 2 * range_profiles.padding(plan.interpolator)
        record = 4 * plan.components(bistatic)
        parts = splits(self.device, len(self.antennas.tx), tiles)
        per_pulse = record * tiles.n_tiles + 24 * stride * parts * channels
        # enough pulses at once to keep every unit busy, few enough to tell how far it is
        most = max(64, 16 * device.info.units)
        pulses = max(1, min(most, int(self.budget / 2 / per_pulse)) // lanes) * lanes
        n_pulses, gated, unlit = len(samples), 0, 0
        for start in range(0, n_pulses, pulses):
            stop = min(start + pulses, n_pulses)
            packed = self.antennas.packed(center, plan.length, start, stop, lanes)
            n, used = packed.shape[2], stop - start
            pulse = device.upload(packed)
            constants = device.empty(record * n * tiles.n_tiles)
            rows, done = device.zeros(24 * parts * used * stride * channels), device.zeros(8 * parts * used)
            device.run(
                constants_kernel, (n // lanes, tiles.n_tiles), None,
                pulse, references, radius, n, tiles.n_tiles, 0, int(self.skip), constants,
            )  # fmt: skip
            axes = device.upload(self.beam.packed_axes(np.arange(start, stop)))
            device.run(
                kernel, (used, parts), (1, 1) if device.is_cpu else None,
                pulse, n, used, constants, references, tiles.n_tiles, offsets, tiles.offsets.shape[1], planes,
                ratios, patterns, second, axes, np.float32(self.beam.range), reach, radius, table, last,
                flush, rows, stride, stride // 2, done,
            )  # fmt: skip
            made = device.download(rows, np.empty((parts, used * channels, 3, stride), np.complex64))
            clock.lap("echo")
            total = made[:, :, 1:].sum(axis=(0, 2), dtype=np.complex128).astype(np.complex64)
            spectra = range_profiles.to_samples(device, total, self.n_samples, plan.interpolator)
            spectra = spectra.reshape(used, channels, self.n_samples)
            if channels == 1:
                samples[start:stop] += spectra[:, 0]
            else:
                samples[start:stop] += np.einsum("pmf,mf->pf", spectra, self.basis.astype(np.float32))
            added, dark = device.download(done, np.empty((2, parts, used), np.int32)).sum(axis=(1, 2), dtype=np.int64)
            gated += used * len(part) - int(added) - int(dark)
            unlit += int(dark)
            clock.lap("spectra")
            if tell:
                tell(stop * len(part))
        return plan, gated, unlit
