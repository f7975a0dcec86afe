"""Facets ready for the kernel: cut, displaced, culled and illuminated; and the amplitude of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.boxes import box
from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..scene.material import DIAGRAMS, Material
from ..scene.triangles import BLOCK, centroids, normals, shortest_edges
from ..visibility.illumination import Illumination, Span, shares_of
from ..visibility.lit_parts import LitParts

AT_ONCE = 100_000  # amplitudes computed per block
POLARIZATIONS = ("HH", "HV", "VH", "VV")


@dataclass(frozen=True, eq=False)
class Light:
    """What pulses see of facets `index` (r,), which others occlude.

    share  of the area, 0 to 1, float32 (n_pulses, r)
    mean   of exp(j k_m (u_t + u_r).rho) over whole facets, counting the lit part alone: complex64 (n_pulses, r, m)
    """

    index: np.ndarray
    share: np.ndarray
    mean: np.ndarray

    @classmethod
    def whole(cls, n_pulses: int, n_waves: int) -> Light:
        """Every facet is seen whole."""
        return cls(np.zeros(0, np.int64), np.zeros((n_pulses, 0)), np.zeros((n_pulses, 0, n_waves), np.complex64))


@dataclass(frozen=True, eq=False)
class FacetSet:
    """The facets of a scene that are added up.

    triangles     m (k, 3, 3);  reflectivity, two_sided, material (k,), materials   as in Scene
    illumination  share of each facet that both antennas see, by blocks of pulses; None: every facet is seen whole
    kept          indices of the facets in the illumination (k,)
    random        complex Gaussian numbers of unit power (k,), for the incoherent echo of rough facets
    lit_parts     what pulses see of facets that others occlude; None: no facet occludes another
    lit_rows      number of each facet among the partly lit ones, -1 where every pulse sees it whole (k,)
    sampled       facets that the illumination is of; the others count whole in it (k,); None: all
    incoherent    rough facets whose coherent part others of the set carry (k,); None: none
    forward       what the transmitter lights radiates to a receiver behind it as well, where that is another antenna
    """

    triangles: np.ndarray
    reflectivity: np.ndarray
    two_sided: np.ndarray
    material: np.ndarray
    materials: tuple[Material, ...]
    illumination: Illumination | None
    kept: np.ndarray
    random: np.ndarray
    lit_parts: LitParts | None = None
    lit_rows: np.ndarray | None = None
    sampled: np.ndarray | None = None
    incoherent: np.ndarray | None = None
    forward: bool = False

    def __len__(self) -> int:
        return len(self.triangles)

    @property
    def bounds(self) -> np.ndarray:
        """Box of the centroids, m (2, 3)."""
        return box(centroids(self.triangles))

    def places(self, numbers: np.ndarray) -> np.ndarray:
        """About the centroids of facets of these numbers, m (n, 3)."""
        return centroids(self.triangles[numbers])

    def roots(self, frequency: float) -> np.ndarray:
        """1/sqrt(eps) of every material at one frequency, complex128; 0 of a perfect conductor."""
        eps = np.array([m.permittivity(frequency) for m in self.materials], np.complex128)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(np.isinf(eps), 0, 1 / np.sqrt(eps))

    def spans(self, n_pulses: int) -> Iterator[Span]:
        """The track in parts, in each of which the amplitude of each facet's illuminated share, uint8 (k,), changes
        evenly."""
        if self.illumination is None:
            all_of_all = np.full(len(self), 255, np.uint8)
            yield Span(0, n_pulses, all_of_all, all_of_all)
            return
        yield from self.illumination.spans(lambda level: self._weighed(level[self.kept]))

    def within(self, first: int, stop: int, n_pulses: int) -> FacetSet:
        """What pulses first ... stop - 1 of n see of them, as pulses 0 ..."""
        return self if stop - first == n_pulses else self.between(first, stop)

    def between(self, first: int, stop: int) -> FacetSet:
        """What pulses first ... stop - 1 see of them, as pulses 0 ..."""
        return replace(
            self,
            illumination=self.illumination and self.illumination.between(first, stop),
            lit_parts=self.lit_parts and self.lit_parts.between(first),
        )

    def split(self) -> list[FacetSet]:
        """The facets that every pulse sees past the others, and those of which some pulse sees a part: sets that hold
        any."""
        if self.lit_parts is None or self.lit_rows is None:
            return [self]
        steady = self.lit_rows < 0
        return [part for part in (self._some(steady), self._some(~steady)) if len(part)]

    def chosen(self, index: np.ndarray) -> FacetSet:
        """These facets, by rising numbers, with their shadows."""
        return self._some(index)

    @property
    def is_changing(self) -> np.ndarray:
        """Facets (k,) of which pulses see different shares."""
        changing = np.zeros(len(self), bool)
        if self.lit_rows is not None:
            changing |= self.lit_rows >= 0
        if self.illumination is not None:
            changing |= self.illumination.changing[self.kept] & (True if self.sampled is None else self.sampled)
        return changing

    def steady(self) -> tuple[FacetSet | None, FacetSet | None]:
        """The facets of which all pulses see the same share, and the others; None: there are none."""
        changing = self.is_changing
        if not changing.any():
            return replace(self, lit_parts=None, lit_rows=None), None
        return None if changing.all() else self._some(~changing), self._some(changing)

    @property
    def n_partly_lit(self) -> int:
        """Number of facets of which some pulse sees a part past the others."""
        return 0 if self.lit_rows is None else int(np.count_nonzero(self.lit_rows >= 0))

    def _some(self, which: np.ndarray) -> FacetSet:
        lit_parts, lit_rows = self.lit_parts, None if self.lit_rows is None else self.lit_rows[which]
        if lit_rows is not None and not (lit_rows >= 0).any():
            lit_parts = lit_rows = None
        return FacetSet(
            self.triangles[which], self.reflectivity[which], self.two_sided[which], self.material[which],
            self.materials, self.illumination, self.kept[which],
            self.random[which] if len(self.random) else self.random, lit_parts, lit_rows,
            None if self.sampled is None else self.sampled[which],
            None if self.incoherent is None else self.incoherent[which],
            self.forward,
        )  # fmt: skip

    def light(self, first: int, ends: list[np.ndarray], waves: np.ndarray) -> Light:
        """What consecutive pulses from `first` on see of the partly lit facets among them.

        ends  antennas of these pulses, m (n, 3), one or two;  waves  rad/m (m,)
        """
        if self.lit_parts is None or self.lit_rows is None:
            return Light.whole(len(ends[0]), len(waves))
        index = np.flatnonzero(self.lit_rows >= 0)
        share, mean = self.lit_parts.at(first, ends, waves)
        rows = self.lit_rows[index]
        return Light(index, share[:, rows], mean[:, rows])

    def share_at(self, pulse: int) -> np.ndarray:
        """Amplitude of the share of each facet that a pulse sees, 0 to 1 (k,), by sampled shadows alone."""
        if self.illumination is None:
            return np.ones(len(self))
        *levels, part = self.illumination.levels_around(pulse)
        before, after = (self._weighed(level[self.kept]) / np.float32(255) for level in levels)
        return np.asarray(before + part * (after - before))

    def _weighed(self, level: np.ndarray) -> np.ndarray:
        """Amplitudes, uint8 (k,), of illuminated shares whose roots are given, uint8 (k,): without a coherent part the
        power of a facet is that of the share."""
        if self.sampled is not None:
            level = np.where(self.sampled, level, np.uint8(255))
        random = self.is_incoherent
        return level if random.all() else np.where(random, level, shares_of(level))

    @property
    def is_incoherent(self) -> np.ndarray:
        """Facets (k,) that have no coherent part."""
        out = np.array([np.isinf(m.height) for m in self.materials])[self.material]
        return out if self.incoherent is None else out | self.incoherent

    @property
    def has_sampled_shadows(self) -> bool:
        """Whether shares of facets are counted from sample points, and some are in shadow for a part of the track."""
        if self.illumination is None:
            return False
        some = self.kept if self.sampled is None else self.kept[self.sampled]
        return not bool(self.illumination.full[some].all())

    @property
    def samples_incoherent_alone(self) -> bool:
        """Whether shares are counted on facets without a coherent part alone, of which their root is the amplitude."""
        sampled = np.ones(len(self), bool) if self.sampled is None else self.sampled
        return self.illumination is not None and not bool((sampled & ~self.is_incoherent).any())

    @property
    def is_rough(self) -> bool:
        """Whether any material has roughness finer than a facet."""
        return any(m.height > 0 for m in self.materials)

    @property
    def is_mirror(self) -> bool:
        """Whether any material has a coherent part, reflected as by a mirror of the facet's size."""
        return any(np.isfinite(m.height) for m in self.materials)

    def picked(self, some: np.ndarray) -> FacetSet:
        """These facets, in this order, without shadows."""
        return replace(self._some(some), illumination=None, lit_parts=None, lit_rows=None, sampled=None)

    def amplitudes(
        self, tx: np.ndarray, rx: np.ndarray, frequencies: np.ndarray, polarizations: Sequence[str],
        vertical: np.ndarray, light: Light | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Amplitude of every facet for antennas at tx, rx, m (3,), about its centroid, in float64: the reference of
        kernels/facet_amplitudes.cl, without gains and terrain shadows; complex128 (n frequencies, k, n_polarizations).

        light  of this pulse at these frequencies: facets that are lit in part; None: every facet is seen whole
        """
        from .added_models import put_into
        from .physical_optics import normals_and_areas, rough_mean, scattering_parts, triangle_mean, turned

        places = centroids(self.triangles)
        to_tx, to_rx = (unit(end - places) for end in (tx, rx))
        behind = self.two_sided & turned(normals(self.triangles), to_tx, to_rx, self.forward)
        triangles = np.where(behind[:, None, None], self.triangles[:, ::-1], self.triangles)
        facing, areas = normals_and_areas(triangles)
        both = to_tx + to_rx
        phases = (triangles[:, 1:] - triangles[:, :1]) @ both[:, :, None]
        cosine, parts = scattering_parts(facing, to_tx, to_rx, tuple(vertical.tolist()), self.forward)
        some = [("HV".index(name[0]), "HV".index(name[1])) for name in polarizations]
        parts = np.stack([parts[..., i, j] for i, j in some], axis=-1)
        n, k = len(frequencies), len(self)
        out = np.empty((n, k, len(polarizations)), np.complex128)
        step = max(1, AT_ONCE // max(k, 1))
        root = np.ones(k)
        if light is not None:
            root[light.index] = np.sqrt(light.share[0])
        for first in range(0, n, step):
            wave = frequencies[first : first + step, None] / SPEED_OF_LIGHT
            mean = triangle_mean(2 * np.pi * wave * phases[:, 0, 0], 2 * np.pi * wave * phases[:, 1, 0])
            if light is not None:
                mean[:, light.index] = light.mean[0, :, first : first + step].T
            if self.incoherent is not None:
                mean[:, self.incoherent] = 0
            if self.is_rough:
                q = 2 * np.pi * wave[..., None] * both
                for i, material in enumerate(self.materials):
                    of = self.material == i
                    if of.any():
                        mean[:, of] = rough_mean(
                            mean[:, of], material, q[:, of], facing[of], areas[of], 1 / wave, self.random[of] * root[of]
                        )
            eps = np.array(
                [[m.permittivity(float(f)) for m in self.materials] for f in frequencies[first : first + step]]
            )
            if (eps == eps[:1]).all():
                eps = eps[:1]
            r_h, r_v, behind = self._coefficients(np.clip(cosine, 0, 1), eps[:, self.material], wave)
            mean *= np.sqrt(np.pi) * wave * areas * self.reflectivity
            for i in range(len(some)):
                matrix = parts[0, :, i] + r_h * parts[1, :, i] + r_v * parts[2, :, i]
                if behind is not None:
                    matrix -= behind[0] * parts[3, :, i] + behind[1] * (parts[0, :, i] - parts[3, :, i])
                np.multiply(mean, matrix, out=out[first : first + step, :, i])
            if any(m.scattering for m in self.materials):
                looks, block = (facing, to_tx, to_rx), frequencies[first : first + step]
                kinds = self.materials, self.material
                put_into(out[first : first + step], mean, kinds, looks, block, vertical, some, forward=self.forward)
        return out

    def _coefficients(
        self, cosine: np.ndarray, eps: np.ndarray, wave: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, list[np.ndarray] | None]:
        """R_h, R_v, and T_h, T_v of thin sheets, 0 of others, None without sheets: (n frequencies, k) each.

        cosine  (k,);  eps  (n, k);  wave  1/wavelength, 1/m (n, 1)
        """
        from .physical_optics import fresnel, slab

        thickness = np.array([m.thickness for m in self.materials])[self.material]
        sheet, (r_h, r_v) = thickness > 0, fresnel(cosine, eps)
        if not sheet.any():
            return r_h, r_v, None
        of_h, of_v, *through = slab(cosine, np.where(sheet, eps, 2 - 1j), np.where(sheet, thickness, 1.0) * wave)
        return np.where(sheet, of_h, r_h), np.where(sheet, of_v, r_v), [np.where(sheet, t, 0) for t in through]

    def planes(self, order: np.ndarray, nodes: np.ndarray, metal: bool, dispersive: bool) -> np.ndarray:
        """Rows of numbers as facet_amplitudes.cl reads them, float32, in `order`; repeats at its end are blank."""
        roots = [] if metal else [self.roots(float(f)) for f in (nodes if dispersive else nodes[:1])]
        n = 7 + 6 * self.is_rough + 2 * len(roots)
        out = np.empty((n, len(order)), np.float32)
        rough = roughness_planes(self.materials) if self.is_rough else np.zeros((4, 0))
        for first in range(0, len(order), BLOCK):  # so few at a time stay in the processor's cache
            block = order[first : first + BLOCK]
            rows = iter(out[:, first : first + BLOCK])

            def put(*values: np.ndarray, rows: Iterator[np.ndarray] = rows) -> None:
                for value in values:
                    next(rows)[:] = value

            # normals of needles: float32 resolves them if one of the two edges is the short one
            for edge in shortest_edges(self.triangles[block]):
                put(*edge)
            put(np.where(self.two_sided[block], -self.reflectivity[block], self.reflectivity[block]))
            material = self.material[block]
            if self.is_rough:
                height, *diagram = rough[:, material]
                if self.incoherent is not None:
                    height = np.where(self.incoherent[block], -height, height)  # the sign tells the kernels
                put(height, *diagram, self.random[block].real, self.random[block].imag)
            for root in roots:
                put(root[material].real, root[material].imag)
        out[:6, len(self) :] = 0
        return out


def roughness_planes(materials: Sequence[Material]) -> np.ndarray:
    """Height, m, number of the diagram, 1/width and 1/Omega of materials as facet_amplitudes.cl reads them: (4, n)."""
    rows = [(min(m.height, 1e3), DIAGRAMS.index(m.diagram), 1 / (m.width or 1.0), 1 / m.solid_angle) for m in materials]
    return np.array(rows).T


def diagram_macros() -> dict[str, int]:
    """Build-time macros of facet_amplitudes.cl with the numbers of the diagrams: DIAGRAM_ISOTROPIC and so on."""
    return {f"DIAGRAM_{name.upper()}": number for number, name in enumerate(DIAGRAMS)}


def vertical_axes(up: np.ndarray) -> np.ndarray:
    """`up`, and the direction that replaces it for lines of sight along it (6,)."""
    other = (0.0, 1.0, 0.0) if abs(up[1]) < 0.9 else (1.0, 0.0, 0.0)
    return np.array([*up, *other], np.float32)
