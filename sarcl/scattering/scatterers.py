"""From a scene to the points and facets that a kernel adds up: displaced, culled and illuminated."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base import boxes
from ..base.constants import EDGE_ON
from ..base.errors import warn
from ..base.text import size_text
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scene import triangles as geometry
from ..scene.scene import Scene
from ..scene.terrain import Heights, above, check_above, clear_of, facets_on
from ..visibility.illumination import ALL_DARK, Illumination, lit
from ..visibility.lit_parts import ON_PLANE, FacetPieces, LitParts
from ..visibility.swept_shadows import never_shaded
from .facet_kinds import coherent
from .facet_plan import FACET_BYTES
from .facets import FacetSet
from .random_surface import Pieces, with_facets
from .rough_pieces import RoughFacets, RoughPieces
from .subdivision import CutScene

Progress = Callable[[int, int], object]  # called as progress(pulse, pulses)
# Facets count as small where their sides are less than so many times the distance below which corners lie in a plane;
# so many of them, or such a share of all, are worth a warning
SMALL, MANY_SMALL, FEW_SMALL = 10.0, 100, 0.01
# Of a facet of median width, by which shadows move between pulses that they are looked at from: largest, and over the
# accuracy of amplitudes
FINEST = 0.25, 3.0


@dataclass(frozen=True, eq=False)
class Points:
    """Points, m (n, 3), with complex amplitudes (n,)."""

    positions: np.ndarray
    amplitudes: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)

    def largest(self) -> float:
        """Largest amplitude."""
        return float(np.abs(self.amplitudes).max())

    def planes(self, order: np.ndarray) -> np.ndarray:
        """Rows of numbers as kernels/spread_points.cl reads them, float32, in `order`; padding at its end is blank."""
        out = np.stack([self.amplitudes.real, self.amplitudes.imag])[:, order].astype(np.float32)
        out[:, len(self) :] = 0
        return out


def points_of(scene: Scene, skips: set[str], n_pulses: int) -> tuple[Points | None, dict[str, int]]:
    """The scene's points, and counts of pairs of point and pulse that are left out: reason -> count."""
    keep = scene.amplitudes != 0 if "zero reflectivity" in skips else np.ones(len(scene.positions), bool)
    left_out = {"zero reflectivity": int((~keep).sum()) * n_pulses}
    if len(keep) and keep.all():
        return Points(scene.positions, scene.amplitudes), left_out
    return Points(scene.positions[keep], scene.amplitudes[keep]) if keep.any() else None, left_out


@dataclass(frozen=True)
class ShadowRule:
    """Rule by which shadows on facets are computed.

    exact    lit parts of coherent facets are computed; False: all shadows are shares, from samples
    sampled, accuracy  shadows on incoherent facets are shares; with this error relative to the norm of these facets
    margin   m: antennas of channels stand up to this far from these;  max_bytes  for lit parts, and for shares
    host     bytes for pieces on the host
    """

    exact: bool
    sampled: bool
    accuracy: float
    max_bytes: float
    margin: float = 0.0
    host: float = np.inf

    def check_room(self, n: int) -> None:
        """MemoryError for more pieces on which shadows may fall than the host holds."""
        if n * FACET_BYTES > self.host:
            raise MemoryError(
                f"shadows may fall on {n:,} pieces of rough facets, which take {size_text(n * FACET_BYTES)}; max_bytes "
                f"allows {size_text(self.host)}. Take a smaller scene, a larger max_bytes, or shadows=False"
            )


def facets_of(
    cut: CutScene,
    antennas: PulseGeometry,
    *,
    shadows: ShadowRule | None,
    skips: set[str],
    device: Device,
    progress: Callable[[str, int, int], object],
) -> tuple[tuple[FacetSet, ...], dict[str, int]]:
    """Facets of a scene, displaced, culled and illuminated: those that a device cuts, in blocks, and those of the host,
    in sets that hold any; and counts of pairs left out: reason -> count.

    shadows   None: every facet is seen whole
    progress  called as progress("scene", 2, 3) when facets are culled, progress("shadows", pulses done, pulses) while
              they are illuminated, progress("scene", 3, 3) then
    """
    original, rough, host, lit_parts = cut.original, cut.rough, None, None
    check_antennas_above(original, antennas)
    culling, illumination = _Culling(skips, antennas), None
    if rough is not None:  # culled by the facets that they are parts of
        keep = culling.kept(original, rough.bounds, geometry.normals(original.triangles), rough.number_of)
        rough = rough.within(keep) if rough.number_of(keep) else None
    if cut.host is not None:
        host = _HostFacets.culled(cut.host, culling, shadows)
    progress("scene", 2, 3)
    if shadows is not None:
        _warn_of_reach(original.triangles)
        report_shadows = partial(progress, "shadows")
        illumination = _illumination_of(original, rough, host, antennas, shadows, device, report_shadows)
        if host is not None and host.is_clipped.any():
            lit_parts = _lit_parts_of(host.pieces, host.is_clipped, antennas, shadows, device, report_shadows)
    sets: list[FacetSet] = [] if rough is None else list(_seen_rough(rough, illumination, culling))
    if host is not None:
        sets.append(host.seen(illumination, 0 if rough is None else len(rough), lit_parts, culling))
    sets = [part for part in sets if len(part)]
    if not sets and lit_parts is not None:
        warn(ALL_DARK)
    progress("scene", 3, 3)
    return tuple(sets), culling.left_out


def _seen_rough(pieces: RoughPieces, illumination: Illumination | None, culling: _Culling) -> Iterator[FacetSet]:
    """The pieces on a device of which an antenna sees something, in blocks; of these an illumination is the first
    part."""
    seen = None
    if illumination is not None:
        seen = np.flatnonzero(~illumination.dark[: len(pieces)])
        culling.leave_out("shadowed", len(pieces) - len(seen))
        pieces = pieces.picked(seen)
    for here, part in pieces.blocks():
        yield RoughFacets(part, illumination, None if seen is None else seen[here])


@dataclass(frozen=True, eq=False)
class _HostFacets:
    """Pieces on the host that may send something back: those of `keep` (k,) bool.

    triangles   m (k, 3, 3), with random heights
    is_clipped  pieces, of those kept, whose lit parts are computed, and
    is_sampled  those whose shares are counted in samples (k,) bool; both False: every facet is seen whole
    """

    pieces: Pieces
    triangles: np.ndarray
    keep: np.ndarray
    is_clipped: np.ndarray
    is_sampled: np.ndarray

    @classmethod
    def culled(cls, pieces: Pieces, culling: _Culling, shadows: ShadowRule | None) -> _HostFacets:
        """The pieces less those that are left out, under a rule of shadows, None: without shadows."""
        scene, triangles, normals = pieces.scene, pieces.scene.triangles, geometry.normals(pieces.scene.triangles)
        if pieces.height.any():
            triangles = triangles + (pieces.height[:, None] * normals)[:, None]
        keep = culling.kept(scene, geometry.centroids(triangles), normals, lambda which: int(which.sum()))
        is_clipped, is_sampled = np.zeros((2, len(keep)), bool)
        if shadows is not None:
            if shadows.exact:  # rough facets too where they are few: their power is that of the lit part
                is_clipped = keep & ((coherent(scene) & ~pieces.incoherent) | (not shadows.sampled))
            is_sampled = keep & ~is_clipped
        return cls(pieces, triangles, keep, is_clipped, is_sampled)

    def seen(
        self, illumination: Illumination | None, first: int, lit_parts: LitParts | None, culling: _Culling
    ) -> FacetSet:
        """Those of which an antenna sees something; in an illumination they are numbers `first` and on."""
        scene, pieces, keep, is_sampled = self.pieces.scene, self.pieces, self.keep, None
        if illumination is not None and self.is_sampled.any():
            dark = self.is_sampled & illumination.dark[first:]
            culling.leave_out("shadowed", int(dark.sum()))
            keep, is_sampled = keep & ~dark, self.is_sampled
        else:
            illumination = None
        if lit_parts is not None:
            dark = keep & lit_parts.dark
            culling.leave_out("shadowed", int(dark.sum()))
            keep = keep & ~dark
        kept = slice(None) if keep.all() else keep  # no copies where all are kept
        return FacetSet(
            self.triangles[kept],
            scene.reflectivity[kept],
            scene.two_sided[kept],
            scene.material[kept],
            scene.materials,
            illumination,
            first + np.flatnonzero(keep),
            pieces.random[kept],
            lit_parts,
            None if lit_parts is None else np.where(lit_parts.partly, np.cumsum(lit_parts.partly) - 1, -1)[kept],
            None if is_sampled is None else is_sampled[kept],
            pieces.incoherent[kept] if pieces.incoherent.any() else None,
        )


def _lit_parts_of(
    pieces: Pieces, wanted: np.ndarray, antennas: PulseGeometry, rule: ShadowRule, device: Device, progress: Progress
) -> LitParts:
    """Lit parts of the pieces `wanted` (k,), which the facets that they are parts of occlude."""
    scene, given = pieces.scene, pieces.original.triangles
    facets = FacetPieces(scene.triangles, scene.two_sided, wanted, given, pieces.of)
    options = {"max_bytes": rule.max_bytes, "margin": rule.margin}
    return LitParts(device, facets, given, antennas.ends, progress=progress, **options)


def _illumination_of(
    scene: Scene,
    rough: RoughPieces | None,
    host: _HostFacets | None,
    antennas: PulseGeometry,
    rule: ShadowRule,
    device: Device,
    progress: Progress,
) -> Illumination | None:
    """Shares, from samples, of the pieces of a scene on a device, and then of all of the host, of which those count
    that are sampled; None: all of these are seen whole."""
    rows = np.zeros(0, np.int64) if host is None else np.flatnonzero(host.is_sampled)
    if rough is None and not len(rows):
        return None
    casters = Casters.of(scene, antennas)
    if not casters.hides_any:
        return None
    n_rough, beside = 0 if rough is None else len(rough), 0.0
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # corners, facets of the scene, numbers of pieces
    if rough is not None:
        is_shaded, power = casters.shade(scene, rough.facets, rough.of, antennas)
        beside += power
        if is_shaded.any():
            rest = rough.rows(np.flatnonzero(is_shaded))
            rule.check_room(len(rest))
            corners, row = rest.corners()
            number = np.flatnonzero(np.repeat(is_shaded, rough.counts))
            parts.append((corners, rough.of[is_shaded][row], number))
    if host is not None and len(rows):
        pieces = host.pieces
        is_shaded, power = casters.shade(scene, pieces.scene.triangles[rows], pieces.of[rows], antennas)
        beside, rows = beside + power, rows[is_shaded]
        parts.append((pieces.scene.triangles[rows], pieces.of[rows], n_rough + rows))
    corners, of, number = (np.concatenate(values) for values in zip(*parts, strict=True)) if parts else [rows[:0]] * 3
    if not len(number):
        return None
    cut = with_facets(scene, corners, of)
    light = casters.light(cut, of, antennas, rule, device, progress, beside)
    return light.among(number, n_rough + (0 if host is None else len(host.pieces)))


class _Culling:
    """Pieces that are left out, and counts of their pairs with pulses: reason -> count."""

    def __init__(self, skips: set[str], antennas: PulseGeometry) -> None:
        self.skips, self.antennas = skips, antennas
        self.left_out = {"zero reflectivity": 0, "facing away": 0, "shadowed": 0}

    def leave_out(self, reason: str, number: int) -> None:
        """Count a number of pieces, which no pulse adds."""
        self.left_out[reason] += number * len(self.antennas.tx)

    def kept(
        self, scene: Scene, centers: np.ndarray, normals: np.ndarray, number_of: Callable[[np.ndarray], int]
    ) -> np.ndarray:
        """Facets of a scene (k,) bool but those that reflect nothing or face away, where `skips` says so.

        centers, normals  as of `faces_away`;  number_of  counts the pieces of facets (k,) bool
        """
        keep = np.ones(len(normals), bool)
        if "zero reflectivity" in self.skips:
            keep = scene.reflectivity != 0
            self.leave_out("zero reflectivity", number_of(~keep))
        if "facing away" in self.skips:
            away = keep & ~scene.two_sided & faces_away(centers, normals, self.antennas)
            self.leave_out("facing away", number_of(away))
            keep &= ~away
        return keep


def _warn_of_reach(triangles: np.ndarray) -> None:
    """Warn where facets are so small beside all of the scene, m (k, 3, 3), that they count as lying in one plane."""
    low, high = boxes.box(triangles.reshape(-1, 3))
    apart = ON_PLANE * float(np.linalg.norm(high - low))
    small = int((geometry.areas(triangles) < (SMALL * apart) ** 2).sum())
    if small >= min(MANY_SMALL, FEW_SMALL * len(triangles)) and small:
        warn(
            f"the scene reaches over {float((high - low).max()):.3g} m: facets nearer to one another's planes than "
            f"{apart:.2g} m do not shadow one another, and {small} are hardly larger than that; leave out what lies "
            "far away, or compute its echoes on their own"
        )


@dataclass(frozen=True, eq=False)
class Casters:
    """What casts shadows in a scene.

    solid  facets that stand on a terrain, or all where there is none, m (n, 3, 3);  floor  the terrain's, m (m, 3, 3)
    hidden_by_floor  facets of the scene that its terrain may hide from an antenna (k,) bool
    heights, on_heights  the terrain, None where there is none, and the facets that lie on it (k,) bool
    """

    solid: np.ndarray
    floor: np.ndarray
    hidden_by_floor: np.ndarray
    heights: Heights | None
    on_heights: np.ndarray

    @classmethod
    def of(cls, scene: Scene, antennas: PulseGeometry) -> Casters:
        """Those of a scene, its terrain by its facets where it is complete."""
        on = None if scene.heights is None else facets_on(scene.heights, scene.triangles)
        if scene.heights is None or on is None:
            nowhere = np.zeros(len(scene.triangles), bool)
            return cls(scene.triangles, scene.triangles[:0], nowhere, None, nowhere)
        clear = clear_of(scene.heights, scene.triangles, on, antennas.ends)
        return cls(scene.triangles[~on], scene.triangles[on], ~clear, scene.heights, on)

    @property
    def hides_any(self) -> bool:
        """Whether any facet may be hidden: lines of sight steeper than all slopes of a terrain meet it once."""
        return bool(len(self.solid) or self.hidden_by_floor.any())

    def light(
        self,
        pieces: Scene,
        of: np.ndarray,
        antennas: PulseGeometry,
        rule: ShadowRule,
        device: Device,
        progress: Progress,
        beside: float,
    ) -> Illumination:
        """Shares of pieces of a scene's facets `of` (k,) that antennas see past these casters.

        beside  power of other pieces, which all antennas see whole

        The pieces are without random heights: displaced along their normals they would occlude their neighbours.
        """
        ground = (self.floor, self._pieces_hidden_by_floor(pieces, of, antennas)) if len(self.floor) else None
        return lit(
            pieces.triangles,
            antennas.tx,
            None if antennas.is_monostatic else antennas.rx,
            two_sided=pieces.two_sided,
            tolerance=min(FINEST[0], FINEST[1] * rule.accuracy),
            accuracy=rule.accuracy,
            weights=pieces.reflectivity**2 * geometry.areas(pieces.triangles),
            beside=beside,
            max_bytes=rule.max_bytes,
            occluders=self.solid,
            ground=ground,
            device=device,
            progress=progress,
        )

    def shade(
        self, scene: Scene, facets: np.ndarray, of: np.ndarray, antennas: PulseGeometry
    ) -> tuple[np.ndarray, float]:
        """Parts of a scene's facets `of` (k,), m (k, 3, 3), of which some antenna may not see the whole (k,) bool; and
        the power of the others, which lie on the terrain."""
        is_lit = (self.on_heights & ~self.hidden_by_floor)[of]
        rows = np.flatnonzero(is_lit)
        is_lit[rows] = never_shaded(facets[rows], scene.two_sided[of[rows]], self.solid, antennas.ends)
        power = scene.reflectivity[of[is_lit]] ** 2 * geometry.areas(facets[is_lit])
        return ~is_lit, float(power.sum())

    def _pieces_hidden_by_floor(self, pieces: Scene, of: np.ndarray, antennas: PulseGeometry) -> np.ndarray:
        """Pieces of facets `of` (k,) that the terrain may hide (k,): of a wall, those near the ground alone."""
        is_hidden = self.hidden_by_floor[of]
        rows = np.flatnonzero(is_hidden)
        if self.heights is not None and len(rows):
            on = self.on_heights[of[rows]]
            is_hidden[rows] = ~clear_of(self.heights, pieces.triangles[rows], on, antennas.ends)
        return is_hidden


def check_antennas_above(scene: Scene, antennas: PulseGeometry) -> None:
    """ValueError for an antenna under a scene's terrain, where that is complete."""
    for name, positions in zip(("track", "receiver"), antennas.ends, strict=False):
        if scene.heights is not None and above(scene.heights, positions).min() < 0:
            if facets_on(scene.heights, scene.triangles) is not None:
                check_above(name, scene.heights, positions)


def rough_looks(scene: Scene, cell: float, n_pulses: int) -> float:
    """Pairs of a pulse and a piece of incoherent facets, cut to a cell's edge, m."""
    rough = ~coherent(scene)
    pieces = np.maximum(2 * geometry.areas(scene.triangles[rough]) / cell**2, 1.0)
    return float(pieces.sum()) * n_pulses


def faces_away(centers: np.ndarray, normals: np.ndarray, antennas: PulseGeometry) -> np.ndarray:
    """True (k,) for facets that face away from the transmitter, or from the receiver, at every pulse.

    centers  m (n, 3), of the facets, or corners of a box around them;  normals  (k, 3)

    n.u(p, x) <= n.u_mean + |u(p, x) - u_mean|: the last term is bounded over all pulses and the whole scene. Facets
    that are edge-on to one of two antennas still send back a part (physical_optics.py:lit_share).
    """
    edge_on = 0.0 if antennas.is_monostatic else 2 * EDGE_ON
    corners = boxes.box(centers)
    middle, radius = corners.mean(axis=0), float(np.linalg.norm(corners[1] - corners[0])) / 2
    out = np.zeros(len(normals), bool)
    for ends in (antennas.tx, antennas.rx):
        look = ends - middle
        distance = np.linalg.norm(look, axis=1)
        if distance.min() <= radius:
            continue  # inside the scene every direction is possible
        look = look / distance[:, None]
        mean = look.mean(axis=0)
        # a shift of the point by `radius` turns the direction by at most asin(radius/distance)
        spread = np.linalg.norm(look - mean, axis=1).max() + np.pi / 2 * radius / distance.min()
        out |= normals @ mean + spread < -edge_on
    return out
