"""From a scene to the points and facets that a kernel adds up: displaced, culled and illuminated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base import boxes
from ..base.constants import EDGE_ON
from ..base.errors import warn
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scene import triangles as geometry
from ..scene.scene import Scene
from ..scene.terrain import Heights, above, check_above, clear_of, facets_on
from ..visibility.illumination import ALL_DARK, Illumination, lit
from ..visibility.lit_parts import ON_PLANE, FacetPieces, LitParts
from ..visibility.swept_shadows import never_shaded
from .facet_kinds import coherent
from .facets import FacetSet
from .random_surface import Pieces
from .rough_pieces import RoughFacets, RoughPieces

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
    return Points(scene.positions[keep], scene.amplitudes[keep]) if keep.any() else None, left_out


@dataclass(frozen=True)
class ShadowRule:
    """Rule by which shadows on facets are computed.

    exact    lit parts of coherent facets are computed; False: all shadows are shares, from samples
    sampled, accuracy  shadows on incoherent facets are shares; with this error relative to the norm of these facets
    margin   m: antennas of channels stand up to this far from these;  max_bytes  for lit parts, and for shares
    """

    exact: bool
    sampled: bool
    accuracy: float
    max_bytes: float
    margin: float = 0.0


def facets_of(
    pieces: Pieces | RoughPieces,
    antennas: PulseGeometry,
    *,
    shadows: ShadowRule | None,
    skips: set[str],
    device: Device,
    progress: Callable[[str, int, int], object],
) -> tuple[FacetSet | None, dict[str, int]]:
    """Facets of a scene, displaced, culled and illuminated, and counts of pairs left out: reason -> count.

    progress  called as progress("scene", 2, 3) when facets are culled, progress("shadows", pulses done, pulses) while
              they are illuminated, progress("scene", 3, 3) then
    """
    if isinstance(pieces, RoughPieces):
        if shadows is None or not shadows.exact or shadows.sampled:
            return _rough_facets_of(pieces, antennas, shadows=shadows, skips=skips, progress=progress)
        pieces = pieces.on_host
    scene, original = pieces.scene, pieces.original
    check_antennas_above(original, antennas)
    triangles, normals = scene.triangles, geometry.normals(scene.triangles)
    if pieces.height.any():
        triangles = triangles + (pieces.height[:, None] * normals)[:, None]
    culling = _Culling(scene, skips, antennas, lambda which: int(which.sum()))
    culling.cull(geometry.centroids(triangles), normals)
    progress("scene", 2, 3)
    keep, lit_parts, illumination = culling.keep, None, None
    is_clipped, is_sampled = np.zeros((2, len(keep)), bool)
    report_shadows = partial(progress, "shadows")
    if shadows is not None:
        if shadows.exact:  # rough facets too where they are few: their power is that of the lit part
            is_clipped = (coherent(scene) & ~pieces.incoherent) | (not shadows.sampled)
        _warn_of_reach(original.triangles)
        is_sampled = keep & ~is_clipped
        casters = Casters.of(original, antennas) if is_sampled.any() else None
        if casters is not None and casters.hides_any:
            illumination = casters.light(scene, pieces.of, is_sampled, antennas, shadows, device, report_shadows)
            culling.leave_out("shadowed", is_sampled & illumination.dark)
        else:
            is_sampled = np.zeros(len(keep), bool)
        if (keep & is_clipped).any():
            lit_parts = _lit_parts_of(pieces, keep & is_clipped, antennas, shadows, device, report_shadows)
            if not (keep & ~lit_parts.dark).any():
                warn(ALL_DARK)
            culling.leave_out("shadowed", keep & lit_parts.dark)
    progress("scene", 3, 3)
    if not keep.any():
        return None, culling.left_out
    kept = slice(None) if keep.all() else keep  # no copies where all are kept
    return FacetSet(
        triangles[kept],
        scene.reflectivity[kept],
        scene.two_sided[kept],
        scene.material[kept],
        scene.materials,
        illumination,
        np.flatnonzero(keep),
        pieces.random[kept],
        lit_parts,
        None if lit_parts is None else np.where(lit_parts.partly, np.cumsum(lit_parts.partly) - 1, -1)[kept],
        is_sampled[kept],
        pieces.incoherent[kept] if pieces.incoherent.any() else None,
    ), culling.left_out


def _lit_parts_of(
    pieces: Pieces, wanted: np.ndarray, antennas: PulseGeometry, rule: ShadowRule, device: Device, progress: Progress
) -> LitParts:
    """Lit parts of the pieces `wanted` (k,), which the facets that they are parts of occlude."""
    scene, given = pieces.scene, pieces.original.triangles
    facets = FacetPieces(scene.triangles, scene.two_sided, wanted, given, pieces.of)
    options = {"max_bytes": rule.max_bytes, "margin": rule.margin}
    return LitParts(device, facets, given, antennas.ends, progress=progress, **options)


def _rough_facets_of(
    pieces: RoughPieces,
    antennas: PulseGeometry,
    *,
    shadows: ShadowRule | None,
    skips: set[str],
    progress: Callable[[str, int, int], object],
) -> tuple[FacetSet | None, dict[str, int]]:
    """As `facets_of`, of pieces on a device: culled by the facets that they are parts of, unless shadows fall on
    them."""
    scene, n_pulses = pieces.scene, len(antennas.tx)
    check_antennas_above(scene, antennas)
    culling = _Culling(scene, skips, antennas, pieces.number_of)
    culling.cull(pieces.bounds, geometry.normals(scene.triangles))
    keep, left_out = culling.keep, culling.left_out
    progress("scene", 2, 3)
    casters = None
    if shadows is not None:
        _warn_of_reach(scene.triangles)
        casters = Casters.of(scene, antennas)
    if shadows is None or casters is None or not casters.hides_any or not keep.any():
        progress("scene", 3, 3)
        return RoughFacets(pieces.within(keep)) if keep.any() else None, left_out
    pieces = pieces.within(keep)
    is_lit = casters.never_shade(pieces, antennas)
    rest = pieces.rows(np.flatnonzero(~is_lit))
    cut, of = rest.cells()
    report_shadows = partial(progress, "shadows")
    power = scene.reflectivity[pieces.of] ** 2 * geometry.areas(pieces.facets)
    illumination = casters.light(
        cut, of, np.ones(len(of), bool), antennas, shadows, pieces.device, report_shadows, float(power[is_lit].sum())
    )
    index = np.flatnonzero(np.repeat(~is_lit, pieces.counts))
    illumination = illumination.among(index, len(pieces))
    seen = np.flatnonzero(~illumination.dark)
    left_out["shadowed"] = (len(pieces) - len(seen)) * n_pulses
    progress("scene", 3, 3)
    return RoughFacets(pieces.picked(seen), illumination, seen) if len(seen) else None, left_out


class _Culling:
    """Facets `keep` (k,) that may send something back, and counts of the other pairs with pulses: reason -> count.

    number_of  counts the pieces of facets (k,) bool
    """

    def __init__(
        self, scene: Scene, skips: set[str], antennas: PulseGeometry, number_of: Callable[[np.ndarray], int]
    ) -> None:
        self.scene, self.skips, self.antennas, self.number_of = scene, skips, antennas, number_of
        self.keep = np.ones(len(scene.triangles), bool)
        self.left_out = {"zero reflectivity": 0, "facing away": 0, "shadowed": 0}

    def leave_out(self, reason: str, which: np.ndarray) -> None:
        """Keep no facets of `which` (k,), all of them kept so far."""
        self.left_out[reason] += self.number_of(which) * len(self.antennas.tx)
        self.keep &= ~which

    def cull(self, centers: np.ndarray, normals: np.ndarray) -> None:
        """Leave out facets that reflect nothing or face away, where `skips` says so; arguments as of `faces_away`."""
        if "zero reflectivity" in self.skips:
            self.leave_out("zero reflectivity", self.scene.reflectivity == 0)
        if "facing away" in self.skips:
            away = self.keep & ~self.scene.two_sided & faces_away(centers, normals, self.antennas)
            self.leave_out("facing away", away)


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
        wanted: np.ndarray,
        antennas: PulseGeometry,
        rule: ShadowRule,
        device: Device,
        progress: Progress,
        beside: float = 0.0,
    ) -> Illumination:
        """Shares of pieces of a scene's facets `of` (k,), those `wanted` (k,), that antennas see past these casters.

        beside  power of other pieces, which all antennas see whole

        The pieces are without random heights: displaced along their normals they would occlude their neighbours.
        """
        ground = (self.floor, self._pieces_hidden_by_floor(pieces, of, antennas)) if len(self.floor) else None
        return lit(
            pieces.triangles,
            antennas.tx,
            None if antennas.is_monostatic else antennas.rx,
            two_sided=pieces.two_sided,
            wanted=wanted,
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

    def never_shade(self, pieces: RoughPieces, antennas: PulseGeometry) -> np.ndarray:
        """Facets of pieces (k,) that are certain to be seen whole by all antennas: of the terrain, which these stand
        on."""
        is_lit = (self.on_heights & ~self.hidden_by_floor)[pieces.of]
        rows = np.flatnonzero(is_lit)
        two_sided = pieces.scene.two_sided[pieces.of[rows]]
        is_lit[rows] = never_shaded(pieces.facets[rows], two_sided, self.solid, antennas.ends)
        return is_lit

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
