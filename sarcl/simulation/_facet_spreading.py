"""Facets spread into range profiles, polarisation by polarisation: the engine of kernels/spread_facets.cl."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ..base import float_pairs
from ..base.boxes import box
from ..base.constants import SPEED_OF_LIGHT
from ..base.stage_timer import Clock
from ..numerics import range_profiles
from ..numerics.plan import Plan
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.facet_plan import FacetPlan
from ..scattering.facets import POLARIZATIONS, Facets
from ..scattering.pulse_nodes import Knots, plan_knots
from ..scene.triangles import centroids
from ..visibility.illumination import Span
from .spreading import Band, plan_tiles, splits, terms

MOST_PULSES = 256  # a block, where amplitudes are shared: knots at its ends serve it alone
KNOTS_SHARE = 0.2  # of the tolerance left, for what lies between knots


class FacetSpreader:
    """Adds facets to the samples of every pulse by the cheapest plan that meets the tolerance."""

    def __init__(
        self, device: Device, antennas: PulseGeometry, bandwidth: float, frequencies: np.ndarray, tolerance: float,
        budget: float, skip: bool, polarizations: Sequence[str], plan: FacetPlan, vertical: np.ndarray,
        beam: AntennaWeights,
    ) -> None:  # fmt: skip
        self.device, self.antennas, self.frequencies, self.bandwidth = device, antennas, frequencies, bandwidth
        self.tolerance, self.budget, self.skip, self.facet_plan = tolerance, budget, skip, plan
        self.vertical, self.beam = vertical, beam
        # from one place what is sent as H and received as V equals what is sent as V and received as H
        self.alike = {"VH": "HV"} if antennas.is_monostatic else {}
        self.wanted = [self.alike.get(name, name) for name in polarizations]
        self.made = [name for name in POLARIZATIONS if name in self.wanted]

    def add(
        self, part: Facets, samples: np.ndarray, clock: Clock, tell: Callable[[int], object] | None
    ) -> tuple[Plan, Knots, int, int, int]:
        """Add to samples (n_pulses, n_polarizations, n_samples).

        Returns the plan, the knots, and how many pairs of facet and pulse were outside the window, inside but from
        behind, and left out of the beam.
        """
        n_samples, left = samples.shape[2], self.tolerance - self.facet_plan.predicted_error
        highest = float(self.frequencies[-1])
        band = Band(n_samples, self.bandwidth, float(self.antennas.frequency.mean()))
        room = left - band.least_tolerance(len(part), left)  # what range profiles need comes first
        knots = plan_knots(part, self.beam, self.made, self.vertical, highest, min(KNOTS_SHARE * left, room))
        work = _Work(self, part, knots, left - knots.error, n_samples)
        clock.lap("scene")
        basis = self.facet_plan.basis(self.frequencies).astype(np.float32)
        counts = np.zeros(3, np.int64)
        pairs = 0
        for start, stop, span in self._blocks(part, len(samples), work.pulses):
            total, found = work.profiles(start, stop, span)
            clock.lap("echo")
            spectra = range_profiles.to_samples(self.device, total, n_samples, work.plan.interpolator)
            spectra = spectra.reshape(stop - start, len(self.made), len(basis), n_samples)
            for i, name in enumerate(self.wanted):
                for m, weight in enumerate(basis):
                    samples[start:stop, i] += spectra[:, self.made.index(name), m] * weight
            counts += found
            pairs += (stop - start) * len(part)
            clock.lap("spectra")
            if tell:
                tell(stop * len(part))
        inside, front, unlit = counts.tolist()
        return work.plan, knots, pairs - inside - unlit, inside - front, unlit

    @staticmethod
    def _blocks(part: Facets, n_pulses: int, most: int) -> Iterator[tuple[int, int, Span]]:
        """(first pulse, last + 1, span they lie in) of blocks of at most `most` pulses."""
        for span in part.spans(n_pulses):
            for start in range(span.first, span.stop, most):
                yield start, min(start + most, span.stop), span


class _Work:
    """What lies on the device for all blocks: facets in tiles, tables, kernels."""

    def __init__(self, of: FacetSpreader, part: Facets, knots: Knots, tolerance: float, n_samples: int) -> None:
        self.of, self.part, self.knots, device = of, part, knots, of.device
        positions = centroids(part.triangles)
        self.center = box(positions).mean(axis=0)
        self.plan, self.tiles, self.order = plan_tiles(
            positions, self.center, of.antennas, of.bandwidth, n_samples, tolerance, least_tolerance=0.0
        )
        plan, tiles, nodes, bistatic = self.plan, self.tiles, of.facet_plan.nodes, not of.antennas.is_monostatic
        metal = all(np.isinf(m.conductivity) for m in part.materials)
        dispersive = not metal and bool(np.ptp(np.stack([part.roots(float(f)) for f in nodes]), axis=0).any())
        macros = {**plan.macros(bistatic), **of.beam.macros(len(nodes)), "TILE": tiles.per_tile, "METAL": int(metal)}
        macros |= {
            "DISPERSIVE": int(dispersive),
            "ROUGH": int(part.is_rough),
            "KNOTS": knots.order,
            **{name: int(name in of.made) for name in POLARIZATIONS},
        }
        names = ("tile_constants", "facet_amplitudes", "spread_facets")
        self.constants, self.amplitudes, self.spread = (
            device.kernel("spread_facets.cl", name, **macros) for name in names
        )
        shared = [float_pairs.wide(tiles.references.T), tiles.radius.astype(np.float32), tiles.offsets]
        self.references, self.radius, self.offsets = (device.upload(a) for a in shared)
        self.facets = device.upload(part.planes(self.order, nodes, metal, dispersive))
        at_nodes = nodes / SPEED_OF_LIGHT, of.facet_plan.scales(), nodes / of.beam.frequency
        self.nodes = device.upload(np.stack(at_nodes).astype(np.float32))
        self.patterns, self.second = of.beam.upload(device)
        self.reach, self.up = device.upload(of.beam.limits), device.upload(_vertical(of.vertical))
        self.table = device.upload(plan.interpolator.table)
        self.last = tiles.per_tile - (len(self.order) - len(part))
        self.flush = max(1, int(terms(of.tolerance) / tiles.per_tile))
        self.channels = len(nodes) * len(of.made)
        self.stride = plan.length + 2 * range_profiles.padding(plan.interpolator)
        self.record = 4 * plan.components(bistatic)
        self.splits = splits(device, len(of.antennas.tx), tiles)
        self.pulses, self.tiles_at_once = self._blocks()

    def _blocks(self) -> tuple[int, int]:
        """Pulses of a block, and tiles whose amplitudes are held at once, that keep to the budget."""
        device, tiles, lanes = self.of.device, self.tiles, self.of.device.info.vector_width
        most = max(64, 16 * device.info.units)
        if self.knots.spacing > 1:
            most = max(most, MOST_PULSES)
        per_pulse = self.record * tiles.n_tiles * (2 if self.knots.spacing > 1 else 1)
        per_pulse += 24 * self.stride * self.splits * self.channels
        room = self.of.budget / 2
        pulses = max(1, min(most, int(room / 2 / per_pulse)) // lanes) * lanes
        n_knots = pulses if self.knots.spacing == 1 else pulses // self.knots.spacing + self.knots.order + 1
        per_tile = tiles.per_tile * (8 * self.channels + 1) * n_knots
        return pulses, int(np.clip(room / 2 / per_tile, 1, tiles.n_tiles))

    def profiles(self, start: int, stop: int, span: Span) -> tuple[np.ndarray, np.ndarray]:
        """Range profiles of pulses start ... stop - 1, complex64 (n channels, stride), and counts of pairs (3,): inside
        the window, of these from the front, and left out of the beam."""
        device, tiles, used = self.of.device, self.tiles, stop - start
        at, which, shares = self.knots.of(start, stop)
        pulse, constants, n = self._constants(np.arange(start, stop), self.of.skip)
        knot_constants, n_knots = constants, n
        if self.knots.spacing > 1:  # what a knot does not see in its window a pulse beside it may
            _, knot_constants, n_knots = self._constants(at, False)
        axes, knot_axes = (device.upload(self.of.beam.packed_axes(rows)) for rows in (np.arange(start, stop), at))
        seen = device.upload(span.share[self.order])
        later = seen if span.later is span.share else device.upload(span.later[self.order])
        moments, which_here, shares_here = (device.upload(a) for a in (span.moments(at), which, shares))
        rows = device.zeros(24 * self.splits * used * self.stride * self.channels)
        done = device.zeros(12 * self.splits * used)
        n_offsets, ends = tiles.offsets.shape[1], (1, 1) if device.is_cpu else None
        size = min(self.tiles_at_once, tiles.n_tiles) * len(at) * tiles.per_tile
        made, marks = device.empty(8 * size * self.channels), device.empty(size)
        for first in range(0, tiles.n_tiles, self.tiles_at_once):
            here = min(self.tiles_at_once, tiles.n_tiles - first)
            device.run(
                self.amplitudes, (len(at), here), ends,
                n_knots, knot_constants, self.offsets, n_offsets, self.facets, seen, later, moments, self.nodes,
                self.up, self.patterns, self.second, knot_axes, np.float32(self.of.beam.range), self.reach, self.radius,
                first, made, marks,
            )  # fmt: skip
            device.run(
                self.spread, (used, self.splits), ends,
                pulse, n, used, constants, self.references, tiles.n_tiles, self.offsets, n_offsets, made, marks, first,
                here, which_here, shares_here, axes, self.reach, self.radius, self.table, self.last, self.flush, rows,
                self.stride, self.stride // 2, done,
            )  # fmt: skip
        found = device.download(rows, np.empty((self.splits, used * self.channels, 3, self.stride), np.complex64))
        total = found[:, :, 1:].sum(axis=(0, 2), dtype=np.complex128).astype(np.complex64)
        counts = device.download(done, np.empty((3, self.splits, used), np.int32))
        return total, counts.sum(axis=(1, 2), dtype=np.int64)

    def _constants(self, rows: np.ndarray, skip: bool) -> tuple[Any, Any, int]:
        """Packed antennas of pulses, what tiles share with each of them, and how many there are with blanks."""
        of, lanes = self.of, self.of.device.info.vector_width
        packed = of.antennas.picked(rows).packed(self.center, self.plan.length, 0, len(rows), lanes)
        n, device = packed.shape[2], of.device
        pulse, constants = device.upload(packed), device.empty(self.record * n * self.tiles.n_tiles)
        device.run(
            self.constants, (n // lanes, self.tiles.n_tiles), None,
            pulse, self.references, self.radius, n, self.tiles.n_tiles, 0, int(skip), constants,
        )  # fmt: skip
        return pulse, constants, n


def _vertical(up: np.ndarray) -> np.ndarray:
    """`up` and what takes its place for lines of sight along it (6,)."""
    other = (0.0, 1.0, 0.0) if abs(up[1]) < 0.9 else (1.0, 0.0, 0.0)
    return np.array([*up, *other], np.float32)
