"""Shadows on the facets of a scene: what casts them, and what antennas see of pieces of facets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base import boxes
from ..base.errors import warn
from ..base.text import size_text
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scene import triangles as geometry
from ..scene.material import COHERENT, Material
from ..scene.scene import Scene
from ..scene.terrain import Heights, clear_of, is_overlooked, stand_above
from ..visibility.illumination import Illumination, IlluminationTask, Occlusion, illuminated
from ..visibility.lit_parts import ON_PLANE, FacetPieces, LitParts, ground_of, upper_sides
from ..visibility.seen_lobes import mean_lobes
from ..visibility.swept_shadows import far_slopes, never_shaded
from .facet_kinds import coherent
from .facet_plan import FACET_BYTES
from .random_surface import Pieces, with_facets
from .rough_pieces import RoughPieces

Progress = Callable[[int, int], object]  # called as progress(pulse, pulses)
# Facets count as small where their sides are less than so many times the distance below which corners lie in a plane;
# so many of them, or such a share of all, are worth a warning
SMALL, MANY_SMALL, FEW_SMALL = 10.0, 100, 0.01
# Of a facet of median width, by which shadows move between pulses that they are looked at from: largest, and over the
# accuracy of amplitudes
FINEST = 0.25, 3.0
DRAWN = 2**17  # facets whose echoes tell the mean power per area of more facets
# Part of a terrain that antennas may see from below: with more, hardly any facet lies above all that may shade it
MOST_FAR = 0.01


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


def lit_parts_of(
    pieces: Pieces, wanted: np.ndarray, antennas: PulseGeometry, rule: ShadowRule, device: Device, progress: Progress
) -> LitParts:
    """Lit parts of the pieces `wanted` (k,), which the facets that they are parts of occlude."""
    scene, given = pieces.scene, pieces.original.triangles
    occluders = given
    # forward scatter passes through the ground's own body: all of its facets count
    ground = np.zeros(len(given), bool) if antennas.forward else ground_of(pieces.original, antennas.ends)
    upper = upper_sides(pieces.original, ground)
    heights = pieces.original.heights
    if ground.any() and heights is not None:
        is_other = np.zeros(len(given), bool)
        is_other[pieces.of[wanted]] = True
        others = np.flatnonzero(is_other & ~ground)
        upper[others] = stand_above(heights, given[others])
        # lines of sight that climb more steeply than the terrain, from what stands above it, meet none of it
        if upper[is_other].all() and not rule.margin and is_overlooked(heights, pieces.original.bounds, antennas.ends):
            occluders, ground = given[~ground], ground[~ground]
    sides = scene.two_sided, wanted, given, pieces.of, ground, upper, antennas.forward
    parts, options = FacetPieces(scene.triangles, *sides), {"max_bytes": rule.max_bytes, "margin": rule.margin}
    return LitParts(device, parts, occluders, antennas.ends, progress=progress, **options)


def illumination_of(
    scene: Scene,
    rough: RoughPieces | None,
    host: tuple[Pieces, np.ndarray] | None,
    antennas: PulseGeometry,
    rule: ShadowRule,
    device: Device,
    progress: Progress,
) -> Illumination | None:
    """Shares, from samples, of the pieces of a scene on a device, and then of all of the host; None: all of these are
    seen whole.

    host  those of the host, and which of them count (k,) bool
    """
    rows = np.zeros(0, np.int64) if host is None else np.flatnonzero(host[1])
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
        pieces = host[0]
        is_shaded, power = casters.shade(scene, pieces.scene.triangles[rows], pieces.of[rows], antennas)
        beside, rows = beside + power, rows[is_shaded]
        parts.append((pieces.scene.triangles[rows], pieces.of[rows], n_rough + rows))
    corners, of, number = (np.concatenate(values) for values in zip(*parts, strict=True)) if parts else [rows[:0]] * 3
    if not len(number):
        return None
    cut = with_facets(scene, corners, of)
    light = casters.light(cut, of, antennas, rule, device, progress, beside)
    return light.among(number, n_rough + (0 if host is None else len(host[0])))


def warn_of_reach(triangles: np.ndarray) -> None:
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
    upper       facets of which the upper side of the terrain alone reflects (k,) bool
    far_slopes  facets of the terrain by which it may hide itself, m (n, 3, 3)
    """

    solid: np.ndarray
    floor: np.ndarray
    hidden_by_floor: np.ndarray
    heights: Heights | None
    on_heights: np.ndarray
    upper: np.ndarray
    far_slopes: np.ndarray

    @classmethod
    def of(cls, scene: Scene, antennas: PulseGeometry) -> Casters:
        """Those of a scene, its terrain by its facets where it is complete."""
        on = ground_of(scene, antennas.ends)
        if scene.heights is None or not on.any():
            return cls(scene.triangles, scene.triangles[:0], on, None, on, on, scene.triangles[:0])
        clear = clear_of(scene.heights, scene.triangles, on, antennas.ends)
        floor, casting = scene.triangles[on], scene.triangles[:0]
        if not clear[on].all():
            casting = floor[far_slopes(floor, antennas.ends)]
        return cls(scene.triangles[~on], floor, ~clear, scene.heights, on, upper_sides(scene, on), casting)

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
        hidden, upper = self._pieces_hidden_by_floor(pieces, of, antennas), self.upper[of]
        occlusions = (
            Occlusion(self.solid, np.ones(len(of), bool)),
            # lines of sight that leave the ground upwards enter it again through far slopes alone
            Occlusion(self.far_slopes, hidden & upper, apart=True),
            Occlusion(self.floor, hidden & ~upper),
        )
        power = echo_powers(pieces, pieces.triangles, np.arange(len(of)), antennas)
        limits = min(FINEST[0], FINEST[1] * rule.accuracy), rule.accuracy, rule.max_bytes
        task = IlluminationTask(pieces.triangles, antennas.ends, pieces.two_sided, occlusions, power, beside, *limits)
        return illuminated(task, device, progress)

    def shade(
        self, scene: Scene, facets: np.ndarray, of: np.ndarray, antennas: PulseGeometry
    ) -> tuple[np.ndarray, float]:
        """Parts of a scene's facets `of` (k,), m (k, 3, 3), of which some antenna may not see the whole (k,) bool; and
        the power of the others, which lie on the terrain."""
        is_lit, casters = np.zeros(len(of), bool), np.concatenate([self.solid, self.far_slopes])
        if len(self.far_slopes) <= MOST_FAR * len(self.floor):
            rows = np.flatnonzero(self.on_heights[of])
            # of a terrain that may hide itself, the back of no facet is certain to be seen
            two_sided = (scene.two_sided & ~self.hidden_by_floor)[of[rows]]
            is_lit[rows] = never_shaded(facets[rows], two_sided, casters, antennas.ends)
        lit = np.flatnonzero(is_lit)
        drawn = lit[:: len(lit) // DRAWN + 1]
        if not len(drawn):
            return ~is_lit, 0.0
        power = echo_powers(scene, facets[drawn], of[drawn], antennas).sum()
        return ~is_lit, float(power * geometry.areas(facets[lit]).sum() / geometry.areas(facets[drawn]).sum())

    def _pieces_hidden_by_floor(self, pieces: Scene, of: np.ndarray, antennas: PulseGeometry) -> np.ndarray:
        """Pieces of facets `of` (k,) that the terrain may hide (k,): of a wall, those near the ground alone."""
        is_hidden = self.hidden_by_floor[of]
        rows = np.flatnonzero(is_hidden)
        if self.heights is not None and len(rows):
            on = self.on_heights[of[rows]]
            is_hidden[rows] = ~clear_of(self.heights, pieces.triangles[rows], on, antennas.ends)
        return is_hidden


def echo_powers(scene: Scene, facets: np.ndarray, of: np.ndarray, antennas: PulseGeometry) -> np.ndarray:
    """Powers (k,) of the echoes of parts of a scene's facets `of` (k,), m (k, 3, 3), relative to one another: means of
    a track. Errors of shadows on facets are in proportion to their roots.

        P = |R|^2 A,   of one antenna  |R|^2 A cos(delta)^2 D(delta)/Omega,   delta from the normal to the antenna

    Diagrams D and Omega as in _rough_surface.py. Between two antennas a facet that is edge-on to one of them may still
    send an echo to the other.
    """
    power = scene.reflectivity[of] ** 2 * geometry.areas(facets)
    if len(antennas.ends) == 1:
        lobes = [partial(_lobe, material) for material in scene.materials]
        power *= mean_lobes(facets, scene.two_sided[of], antennas.tx, lobes, scene.material[of])
    return np.asarray(power)


def _lobe(material: Material, cosine: np.ndarray) -> np.ndarray:
    """Power per area that a facet sends back, by the cosine of incidence."""
    diagram = 1.0 if material.diagram in COHERENT else material.lobe(np.arccos(cosine)) / material.solid_angle
    return np.asarray(cosine**2 * diagram)


def rough_looks(scene: Scene, cell: float, n_pulses: int) -> float:
    """Pairs of a pulse and a piece of incoherent facets, cut to a cell's edge, m."""

    def pieces() -> float:
        return float(np.maximum(2 * geometry.areas(scene.triangles[~coherent(scene)]) / cell**2, 1.0).sum())

    return scene.kept.of(("rough pieces", cell), pieces) * n_pulses
