"""Facets spread into range profiles, polarisation by polarisation: the engine of kernels/facets.cl."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from . import cl, profiles
from .beam import Beam
from .check import SPEED_OF_LIGHT
from .facet_plan import FacetPlan
from .geometry import Antennas
from .lighting import Lighting
from .material import DIAGRAMS, Material
from .planning import Clock, Plan
from .spread_plan import plan_tiles, splits, terms
from .triangles import box, centroids

SCALE = 1e9  # Hz, so that amplitudes over frequency keep away from float32's smallest numbers
POLARIZATIONS = ("HH", "HV", "VH", "VV")


@dataclass(frozen=True, eq=False)
class Facets:
    """What is left of a scene's facets to be added up.

    triangles     m (k, 3, 3);  reflectivity, two_sided, material (k,), materials   as in Scene
    light, kept   what of each facet both antennas see, by blocks of pulses, and which of its facets these are (k,);
                  None: all of all
    random        complex Gaussian numbers of unit power (k,): what rough facets send back besides
    """

    triangles: np.ndarray
    reflectivity: np.ndarray
    two_sided: np.ndarray
    material: np.ndarray
    materials: tuple[Material, ...]
    light: Lighting | None
    kept: np.ndarray
    random: np.ndarray

    def __len__(self) -> int:
        return len(self.triangles)

    def roots(self, frequency: float) -> np.ndarray:
        """1/sqrt(eps) of every material at one frequency, complex128; 0 of a perfect conductor."""
        eps = np.array([m.permittivity(frequency) for m in self.materials], np.complex128)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(np.isinf(eps), 0, 1 / np.sqrt(eps))

    def shares(self, n_pulses: int) -> Iterator[tuple[int, int, np.ndarray]]:
        """(first pulse, last + 1, share of each facet that is seen, uint8 (k,), 255 for all of it) of every block."""
        if self.light is None:
            yield 0, n_pulses, np.full(len(self), 255, np.uint8)
        else:
            for i, (first, last) in enumerate(self.light.blocks.tolist()):
                yield first, last, self.light.share(i)[self.kept]

    def share_at(self, pulse: int) -> np.ndarray:
        """Share of each facet that a pulse sees, 0 to 1 (k,)."""
        return np.ones(len(self)) if self.light is None else self.light.fraction(self.light.block_of(pulse))[self.kept]

    @property
    def is_rough(self) -> bool:
        """Any material has roughness finer than a facet."""
        return any(m.height > 0 for m in self.materials)

    def planes(self, order: np.ndarray, nodes: np.ndarray, metal: bool, dispersive: bool) -> np.ndarray:
        """Rows of numbers as kernels/facets.cl reads them, float32, in `order`; repeats at its end are blank."""
        first, second = (self.triangles[:, i] - self.triangles[:, 0] for i in (1, 2))
        factor = np.where(self.two_sided, -self.reflectivity, self.reflectivity)
        rows = [*first.T, *second.T, factor]
        if self.is_rough:
            rows += [*roughness_planes(self.materials)[:, self.material], self.random.real, self.random.imag]
        if not metal:
            for f in nodes if dispersive else nodes[:1]:
                root = self.roots(float(f))[self.material]
                rows += [root.real, root.imag]
        out = np.stack(rows)[:, order].astype(np.float32)
        out[:6, len(self) :] = 0
        return out


class FacetSpreader:
    """Adds facets to the samples of every pulse by the cheapest plan that meets the tolerance."""

    def __init__(
        self, device: cl.Device, antennas: Antennas, bandwidth: float, frequencies: np.ndarray, tolerance: float,
        budget: float, skip: bool, polarizations: Sequence[str], plan: FacetPlan, vertical: np.ndarray, beam: Beam,
    ) -> None:  # fmt: skip
        self.device, self.antennas, self.frequencies, self.bandwidth = device, antennas, frequencies, bandwidth
        self.tolerance, self.budget, self.skip, self.facet_plan = tolerance, budget, skip, plan
        self.vertical, self.beam = vertical, beam
        # from one place what is sent as H and received as V equals what is sent as V and received as H
        self.alike = {"VH": "HV"} if antennas.rx is None else {}
        self.wanted = [self.alike.get(name, name) for name in polarizations]
        self.made = [name for name in POLARIZATIONS if name in self.wanted]

    def add(
        self, part: Facets, samples: np.ndarray, clock: Clock, tell: Callable[[int], object] | None
    ) -> tuple[Plan, int, int, int]:
        """Add to samples (n_pulses, n_polarizations, n_samples).

        Returns the plan, and how many pairs of facet and pulse were outside the window, inside but from behind, and
        left out of the beam.
        """
        positions = centroids(part.triangles)
        center = box(positions).mean(axis=0)
        left = self.tolerance - self.facet_plan.predicted_error
        plan, tiles, order = plan_tiles(
            positions, center, self.antennas, self.bandwidth, len(self.frequencies), left, least_tolerance=0.0
        )
        device, lanes, nodes = self.device, self.device.info.vector_width, self.facet_plan.nodes
        bistatic = self.antennas.rx is not None
        metal = all(np.isinf(m.conductivity) for m in part.materials)
        dispersive = not metal and bool(np.ptp(np.stack([part.roots(float(f)) for f in nodes]), axis=0).any())
        macros = {**plan.macros(bistatic), **self.beam.macros(len(nodes)), "TILE": tiles.per_tile, "METAL": int(metal)}
        macros |= {
            "DISPERSIVE": int(dispersive),
            "ROUGH": int(part.is_rough),
            **{name: int(name in self.made) for name in POLARIZATIONS},
        }
        constants_kernel = device.kernel("facets.cl", "tile_constants", **macros)
        kernel = device.kernel("facets.cl", "spread_facets", **macros)
        wave = nodes / SPEED_OF_LIGHT
        shared = [cl.wide(tiles.references.T), tiles.radius.astype(np.float32), tiles.offsets]
        references, radius, offsets = (device.upload(a) for a in shared)
        facets = device.upload(part.planes(order, nodes, metal, dispersive))
        # the basis brings in the frequency itself
        scale = np.full_like(wave, np.sqrt(np.pi) / SPEED_OF_LIGHT * SCALE)
        node = device.upload(np.stack([wave, scale, nodes / self.beam.frequency]).astype(np.float32))
        patterns, second = self.beam.upload(device)
        reach = device.upload(self.beam.limits)
        up, table = device.upload(_vertical(self.vertical)), device.upload(plan.interpolator.table)
        last = tiles.per_tile - (len(order) - len(part))
        flush = max(1, int(terms(self.tolerance) / tiles.per_tile))
        clock.lap("scene")

        channels, n_samples = len(nodes) * len(self.made), samples.shape[2]
        stride = plan.length + 2 * profiles.padding(plan.interpolator)
        record = 4 * plan.components(bistatic)
        parts = splits(self.device, len(self.antennas.tx), tiles)
        per_pulse = record * tiles.n_tiles + 24 * stride * parts * channels
        most = max(64, 16 * device.info.units)
        pulses = max(1, min(most, int(self.budget / 2 / per_pulse)) // lanes) * lanes
        basis = self.facet_plan.basis(self.frequencies) / SCALE
        outside = behind = unlit = 0
        for start, stop, share in self._blocks(part, len(samples), pulses):
            packed = self.antennas.packed(center, plan.length, start, stop, lanes)
            n, used = packed.shape[2], stop - start
            pulse, seen = device.upload(packed), device.upload(share[order])
            constants = device.empty(record * n * tiles.n_tiles)
            rows, done = device.zeros(24 * parts * used * stride * channels), device.zeros(12 * parts * used)
            device.run(
                constants_kernel, (n // lanes, tiles.n_tiles), None,
                pulse, references, radius, n, tiles.n_tiles, 0, int(self.skip), constants,
            )  # fmt: skip
            axes = device.upload(self.beam.turned(start, stop))
            device.run(
                kernel, (used, parts), (1, 1) if device.is_cpu else None,
                pulse, n, used, constants, references, tiles.n_tiles, offsets, tiles.offsets.shape[1], facets, seen,
                node, up, patterns, second, axes, np.float32(self.beam.range), reach, radius, table, last,
                flush, rows, stride, stride // 2, done,
            )  # fmt: skip
            made = device.download(rows, np.empty((parts, used * channels, 3, stride), np.complex64))
            clock.lap("echo")
            total = made[:, :, 1:].sum(axis=(0, 2), dtype=np.complex128).astype(np.complex64)
            spectra = profiles.to_samples(device, total, n_samples, plan.interpolator)
            spectra = spectra.reshape(used, len(self.made), len(nodes), n_samples)
            for i, name in enumerate(self.wanted):
                for m, weight in enumerate(basis.astype(np.float32)):
                    samples[start:stop, i] += spectra[:, self.made.index(name), m] * weight
            counts = device.download(done, np.empty((3, parts, used), np.int32)).sum(axis=(1, 2), dtype=np.int64)
            outside += used * len(part) - int(counts[0] + counts[2])
            behind += int(counts[0] - counts[1])
            unlit += int(counts[2])
            clock.lap("spectra")
            if tell:
                tell(stop * len(part))
        return plan, outside, behind, unlit

    @staticmethod
    def _blocks(part: Facets, n_pulses: int, most: int) -> Iterator[tuple[int, int, np.ndarray]]:
        """(first pulse, last, share seen) of blocks of at most `most` pulses."""
        for first, last, share in part.shares(n_pulses):
            for start in range(first, last, most):
                yield start, min(start + most, last), share


def roughness_planes(materials: Sequence[Material]) -> np.ndarray:
    """Height, m, number of the diagram, 1/width and 1/Omega of materials as kernels/facets.cl reads them: (4, n)."""
    rows = [(min(m.height, 1e3), DIAGRAMS.index(m.diagram), 1 / (m.width or 1.0), 1 / m.solid_angle) for m in materials]
    return np.array([(h, 0 if d > 4 else d, w, o) for h, d, w, o in rows]).T


def _vertical(up: np.ndarray) -> np.ndarray:
    """`up` and what takes its place for lines of sight along it (6,)."""
    other = (0.0, 1.0, 0.0) if abs(up[1]) < 0.9 else (1.0, 0.0, 0.0)
    return np.array([*up, *other], np.float32)
