"""Facets spread into range profiles, polarisation by polarisation: the engine of kernels/spread_facets.cl."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.stage_timer import Clock
from ...model.waveform import Waveform
from ...numerics import range_profiles
from ...numerics.device_profiles import SpreadSamples
from ...numerics.pulse_geometry import PulseGeometry
from ...numerics.tile_constants import TileConstants
from ...opencl.device import Kernel
from ...opencl.launch_numbers import launch_numbers
from ...scattering.antenna_weights import AntennaWeights
from ...scattering.facet_plan import FacetPlan
from ...scattering.facets import POLARIZATIONS, FacetSet, diagram_macros, vertical_axes
from ...scattering.pulse_nodes import every, plan_pulse_nodes
from ...scattering.rough_pieces import RoughFacets
from ...scene.triangles import centroids
from ...visibility.illumination import Span
from ..echo_request import EchoRequest
from ..kernel_images import PatchSamples, sample_patches
from ..spreading import (
    ChannelView,
    Counts,
    HostTiling,
    Rows,
    TiledScatterers,
    Tiling,
    most_pulses,
    terms,
)
from ._piece_tiling import PieceTiling

AMPLITUDES, SPREAD = "facet_amplitudes", "spread_facets"  # kernels, each in a file of its name
MOST_PULSES = 256  # pulses per block where amplitudes are interpolated: two blocks cannot share their nodes
NODES_SHARE = 0.2  # of the tolerance that is left: the most that interpolation between pulse nodes may take


class TiledFacets(TiledScatterers):
    """Facets prepared for every channel, receiver and pulse.

    nodes  Hz (n,), frequencies at which amplitudes are computed, and by what they are scaled: those of `plan`
    of     prepares some of the facets in the same way;  REFLECTIVITY  its plane among the facets' numbers
    metal  all are perfect conductors;  dispersive  the materials differ from node to node
    """

    REFLECTIVITY = 6

    def __init__(
        self, request: EchoRequest, facets: FacetSet, plan: FacetPlan, antennas: PulseGeometry, waveform: Waveform,
        weights: AntennaWeights, *, stays: bool = True,
    ) -> None:  # fmt: skip
        """antennas, waveform, weights  of all channels: samples of patches are computed for them
        stays  False: pieces that a device cuts do not stay on it
        """
        device, self.stays, self.limits = request.device, stays, request.limits
        self.of = lambda some: TiledFacets(request, some, plan, antennas, waveform, weights)
        self.facets, self.facet_plan, nodes = facets, plan, plan.nodes
        self.metal = all(np.isinf(m.conductivity) for m in facets.materials)
        roots = np.stack([facets.roots(float(f)) for f in nodes])
        self.dispersive = not self.metal and bool(np.ptp(roots, axis=0).any())

        def amplitudes(some: np.ndarray, pulse: int, frequency: float) -> np.ndarray:
            ends, f = (antennas.tx[pulse], antennas.rx[pulse]), np.array([frequency])
            sent = facets.picked(some).amplitudes(*ends, f, request.polarizations, request.vertical)[0]
            return np.asarray(sent * weights.weights(positions[some], pulse, frequency)[:, None])

        tiling: Tiling
        if isinstance(facets, RoughFacets):
            numbers = facets.tiling_numbers(nodes, self.metal, self.dispersive)
            tiling = PieceTiling(facets.pieces, *numbers, stays=stays)
            positions = tiling.bounds  # no patches are sampled of random phases
        else:
            positions = centroids(facets.triangles)
            tiling = HostTiling(
                device, positions, lambda order: facets.planes(order, nodes, self.metal, self.dispersive)
            )
        n_sums = len(antennas) * len(nodes) * len(request.polarizations)

        def patches(order: np.ndarray) -> PatchSamples:
            return sample_patches(positions, order, antennas, waveform, amplitudes)

        super().__init__(device, tiling, n_sums if facets.is_mirror else 0, patches)

    @cached_property
    def numbers(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the facets, m (n, 3), and their numbers as the kernels read them, float32 (k, n)."""
        if isinstance(self.tiling, PieceTiling):
            return self.tiling.on_host()
        order, nodes = np.arange(len(self.facets)), self.facet_plan.nodes
        return centroids(self.facets.triangles), self.facets.planes(order, nodes, self.metal, self.dispersive)


@dataclass(eq=False)
class PulseLevels:
    """Consecutive pulses from `start` to `stop` - 1, and levels of facets, uint8 (k,), at some moments among them.

    A moment is the number of an array in `levels`.
    """

    start: int
    levels: list[np.ndarray] = field(default_factory=list)
    _moments: list[np.ndarray] = field(default_factory=list)
    _between: list[np.ndarray] = field(default_factory=list)

    @property
    def stop(self) -> int:
        """The pulse after the last."""
        return self.start + sum(len(part) for part in self._between)

    @property
    def moments(self) -> np.ndarray:
        """The moments around each pulse, int32 (n, 2)."""
        return np.concatenate(self._moments)

    @property
    def between(self) -> np.ndarray:
        """Where each pulse lies between its two moments, float32 (n,)."""
        return np.concatenate(self._between)

    def extend(self, span: Span, stop: int) -> int:
        """Take the pulses of a span up to stop - 1 too; returns `stop`."""
        pulses, which = np.arange(self.stop, stop), []
        for level in (span.level, span.later):
            if not self.levels or self.levels[-1] is not level:
                self.levels.append(level)
            which.append(len(self.levels) - 1)
        self._moments.append(np.tile(np.array(which, np.int32), (len(pulses), 1)))
        self._between.append(span.moments(pulses))
        return stop


class FacetSpreader:
    """Facets of one channel at one receiver, by the cheapest plan that meets the tolerance: prepared once, then added
    to the samples of some pulses after the other.

    plan, pulse_nodes, predicted_error  known before anything is added
    """

    def __init__(
        self, tiled: TiledFacets, facets: FacetSet, view: ChannelView, tolerance: float, budget: float
    ) -> None:
        """facets  as the channel's pulses see them;  budget  bytes on the device"""
        self.device, self.tiled, self.facets, self.gated = tiled.device, tiled, facets, view.gated
        self.antennas, self.weights, self.n_samples = view.antennas, view.weights, len(view.frequencies)
        antennas, facet_plan = view.antennas, tiled.facet_plan
        # a single antenna receives as V what is sent as H, exactly as it receives as H what is sent as V
        alike = {"VH": "HV"} if antennas.is_monostatic else {}
        self.columns = [alike.get(name, name) for name in view.polarizations]
        self.polarizations = [name for name in POLARIZATIONS if name in self.columns]
        room = tolerance - facet_plan.predicted_error
        most = min(NODES_SHARE * room, room - view.band.least_tolerance(len(facets), room))  # profiles come first
        self.partly = facets.lit_parts is not None
        # edges of shadows move from pulse to pulse
        if self.partly:
            self.pulse_nodes = every(len(antennas))
        else:
            highest = float(view.frequencies[-1])
            names, worth = self.polarizations, tiled.limits.own_amplitudes
            self.pulse_nodes = plan_pulse_nodes(facets, view.weights, names, view.vertical, highest, most, worth)
        self.plan = tiled.plan(antennas, view.band, room - self.pulse_nodes.error, least_tolerance=0.0)
        self.predicted_error = self.plan.predicted_error + facet_plan.predicted_error + self.pulse_nodes.error
        self.basis = facet_plan.basis(view.frequencies).astype(np.float32)
        self._upload(view.vertical, tolerance)
        self.at_once, self.tiles_at_once = self._blocks(budget)
        self.levels_at_once = max(2, int(budget / 8 / self.tiles.n_offsets))

    def _upload(self, vertical: np.ndarray, tolerance: float) -> None:
        """Kernels, and what all blocks of pulses share on the device."""
        device, scatterers, plan, weights = self.device, self.tiled, self.plan, self.weights
        self.tiles = scatterers.tiles(plan.per_tile)
        tiles, nodes, bistatic = self.tiles, scatterers.facet_plan.nodes, not self.antennas.is_monostatic
        self.channels = len(nodes) * len(self.polarizations)
        stride = plan.length + 2 * range_profiles.padding(plan.interpolator)
        of_weights = weights.macros(len(nodes))
        both = {"BISTATIC": int(bistatic), "CULL": of_weights["CULL"], "TILE": tiles.per_tile}
        of_amplitudes = {
            **of_weights,
            **both,
            "RANGE": 0,
            "ORDER": 2,
            "METAL": int(scatterers.metal),
            "DISPERSIVE": int(scatterers.dispersive),
            "ROUGH": int(self.facets.is_rough),
            "PARTLY": int(self.partly),
            **{name: int(name in self.polarizations) for name in POLARIZATIONS},
            **(diagram_macros() if self.facets.is_rough else {}),
        }
        shaded = int(self.facets.illumination is not None)
        of_spreading = {**plan.macros(bistatic), **both, "PULSE_NODES": self.pulse_nodes.order, "SHADED": shaded}

        def kernels(of_rows: Mapping[str, int]) -> tuple[Kernel, ...]:
            grouped = of_rows["GROUPED"]  # compilers for GPUs unroll loops over few channels; on CPUs no loop is short
            fixed = {"NODES": grouped * len(nodes), "CHANNELS": grouped * self.channels}
            return (
                device.kernel(f"{AMPLITUDES}.cl", AMPLITUDES, **of_amplitudes | fixed, GROUPED=grouped),
                device.kernel(f"{SPREAD}.cl", SPREAD, **{**of_spreading, **fixed, **of_rows}),
            )

        self.constants = TileConstants(device, plan, bistatic=bistatic)
        shape = stride, self.channels, len(self.antennas), tiles.n_tiles
        self.rows, (self.amplitudes, self.spread) = Rows.with_kernels(device, shape, kernels)
        at_nodes = nodes / SPEED_OF_LIGHT, scatterers.facet_plan.scales(), nodes / weights.frequency
        self.nodes = device.upload(np.stack(at_nodes).astype(np.float32))
        self.patterns, self.second = weights.upload(device)
        self.reach, self.up = device.upload(weights.limits), device.upload(vertical_axes(vertical))
        self.table = device.upload(plan.interpolator.table)
        self.flush = max(1, int(terms(tolerance) / tiles.per_tile))
        self.spectra_of = SpreadSamples(device, self.n_samples, plan.interpolator, plan.length)

    def _blocks(self, budget: float) -> tuple[int, int]:
        """Pulses per block, and tiles whose amplitudes are held at once, that keep to the budget, bytes."""
        device, tiles, lanes = self.device, self.tiles, self.device.info.vector_width
        most, spacing = most_pulses(device), self.pulse_nodes.spacing
        if spacing > 1:
            most = max(most, MOST_PULSES)
        per_pulse: float = self.constants.nbytes * tiles.n_tiles * (2 if spacing > 1 else 1)
        per_pulse += self.rows.pulse_bytes + self.spectra_of.row_bytes * self.channels
        room = budget / 2
        pulses = max(1, min(most, int(room / 2 / per_pulse)) // lanes) * lanes
        n_nodes = pulses if spacing == 1 else pulses // spacing + self.pulse_nodes.order + 1
        parts = 4 * (1 + 2 * len(self.tiled.facet_plan.nodes)) if self.partly else 0
        per_tile = tiles.per_tile * (8 * self.channels + 1) * n_nodes
        if parts:
            pulses = (
                max(1, min(pulses, int(room / 4 / (2 * parts * tiles.per_tile * tiles.n_tiles))) // lanes) * lanes
                or lanes
            )
        return pulses, int(np.clip(room / 2 / per_tile, 1, tiles.n_tiles))

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add to samples (n_pulses, n_polarizations, n_samples) of consecutive `pulses` of the antennas.

        on_progress is called with the number of pairs of facet and pulse that are done.
        """
        clock.lap("scene")
        counts, first = Counts(), pulses[0]
        for levels in self._pulse_blocks(first, pulses[-1] + 1):
            start, stop = levels.start, levels.stop
            rows, pair_counts = self._profiles(levels)
            clock.lap("echo")
            spectra = self.spectra_of.of(rows, self.rows.splits, (stop - start) * self.channels, 2)
            spectra = spectra.reshape(stop - start, len(self.polarizations), len(self.basis), self.n_samples)
            for i, name in enumerate(self.columns):
                for m, weight in enumerate(self.basis):
                    samples[start - first : stop - first, i] += spectra[:, self.polarizations.index(name), m] * weight
            pairs, (inside, front, unlit) = (stop - start) * len(self.facets), pair_counts.tolist()
            counts += Counts(pairs, pairs - inside - unlit, inside - front, unlit)
            clock.lap("spectra")
            on_progress(counts.pairs)
        self.tiles.release()
        return counts

    def _pulse_blocks(self, first: int, end: int) -> Iterator[PulseLevels]:
        """Blocks of pulses that keep to the budget, and their levels."""
        block: PulseLevels | None = None
        for span in self.facets.spans(len(self.antennas)):
            at, stop = max(span.first, first), min(span.stop, end)
            while at < stop:
                if block is None:
                    block = PulseLevels(at)
                at = block.extend(span, min(stop, block.start + self.at_once))
                if block.stop - block.start == self.at_once or len(block.levels) >= self.levels_at_once:
                    yield block
                    block = None
        if block is not None:
            yield block

    def _profiles(self, levels: PulseLevels) -> tuple[Any, np.ndarray]:
        """Range profiles of a block of pulses on the device, as `SpreadSamples.of` takes them, and counts of pairs
        (3,): inside the window, of these from the front, and outside the beam."""
        start, stop = levels.start, levels.stop
        device, tiles, used = self.device, self.tiles, stop - start
        at, which, shares = self.pulse_nodes.of(start, stop)
        pulse, constants, n = self._constants(np.arange(start, stop), self.gated)
        node_constants, n_nodes = constants, n
        if self.pulse_nodes.spacing > 1:  # a facet outside the window at a node may be inside at a pulse beside it
            _, node_constants, n_nodes = self._constants(at, False)
        axes, node_axes = (device.upload(self.weights.packed_axes(rows)) for rows in (np.arange(start, stop), at))
        which_here, shares_here = device.upload(which), device.upload(shares)
        moments, between = device.upload(levels.moments), device.upload(levels.between)
        seen = between
        if self.facets.illumination is not None:
            seen = device.upload(np.stack([level[tiles.order] for level in levels.levels]))
        parts = device.upload(self._parts(start, stop)) if self.partly else between
        (sums, rows), splits = self.rows.buffers(used), self.rows.splits
        done = device.zeros(12 * splits * used)
        n_offsets, group = tiles.n_offsets, self.rows.group
        size = min(self.tiles_at_once, tiles.n_tiles) * len(at) * tiles.per_tile
        made, marks = device.empty(8 * size * self.channels), device.empty(size)
        for first in range(0, tiles.n_tiles, self.tiles_at_once):
            n_block = min(self.tiles_at_once, tiles.n_tiles - first)
            device.run(
                self.amplitudes, (self.rows.items * len(at), n_block), group,
                launch_numbers(
                    f"{AMPLITUDES}.cl", AMPLITUDES, n=n_nodes, n_offsets=n_offsets, second=self.second,
                    range=self.weights.range, first=first, n_nodes=len(self.basis), record=self.constants.nbytes // 4,
                ),
                node_constants, tiles.offsets, tiles.planes, parts, self.nodes, self.up, self.patterns, node_axes,
                self.reach, tiles.radius, made, marks,
            )  # fmt: skip
            device.run(
                self.spread, self.rows.size(used), group,
                launch_numbers(
                    f"{SPREAD}.cl", SPREAD, n=n, n_used=used, n_tiles=tiles.n_tiles, n_offsets=n_offsets,
                    first=first, n_here=n_block, last=tiles.last, flush=self.flush,
                    stride=self.rows.stride, origin=self.rows.stride // 2, n_channels=self.channels,
                    near=np.float32(self.plan.near.radius),
                ),
                pulse, constants, tiles.references, tiles.offsets, made, marks, which_here, shares_here, seen,
                moments, between, axes, self.reach, tiles.radius, self.table, sums, rows, done,
                steps=n_block / splits,
            )  # fmt: skip
        counts = device.download(done, np.empty((3, splits, used), np.int32))
        return rows, counts.sum(axis=(1, 2), dtype=np.int64)

    def _parts(self, start: int, stop: int) -> np.ndarray:
        """Lit parts of the facets at pulses start ... stop - 1, as the kernel reads them: float32 (n, 1 + 2 m, .)."""
        waves = 2 * np.pi * self.tiled.facet_plan.nodes / SPEED_OF_LIGHT
        light = self.facets.light(start, [end[start:stop] for end in self.antennas.ends], waves)
        order = self.tiles.order
        out = np.empty((stop - start, 1 + 2 * len(waves), len(order)), np.float32)
        out[:, 0] = light.share[:, order]
        out[:, 1::2], out[:, 2::2] = (
            side.transpose(0, 2, 1)[:, :, order] for side in (light.mean.real, light.mean.imag)
        )
        return out

    def _constants(self, rows: np.ndarray, gated: bool) -> tuple[Any, Any, int]:
        """Packed antennas of pulses, the numbers that each shares with the tiles, and the pulses with blanks."""
        device, lanes, tiles = self.device, self.device.info.vector_width, self.tiles
        packed = self.antennas.picked(rows).packed(self.tiled.center, self.plan.length, 0, len(rows), lanes)
        n = packed.shape[2]
        pulse, whole = device.upload(packed), (0, tiles.n_tiles)
        constants = self.constants.compute(pulse, n, tiles.references, tiles.radius, whole, tiles.n_tiles, int(gated))
        return pulse, constants, n
