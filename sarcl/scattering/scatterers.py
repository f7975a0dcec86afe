"""From a scene to the points and facets that a kernel adds up: displaced, culled and illuminated."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
from ..scene.terrain import above, check_above
from ..visibility.illumination import ALL_DARK, Illumination
from ..visibility.lit_parts import LitParts
from .facet_kinds import coherent
from .facet_shadows import ShadowRule, illumination_of, lit_parts_of, warn_of_reach
from .facets import FacetSet
from .random_surface import Pieces
from .rough_pieces import RoughFacets, RoughPieces
from .subdivision import CutScene


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
        warn_of_reach(original.triangles)
        report_shadows = partial(progress, "shadows")
        sampled = None if host is None else (host.pieces, host.is_sampled)
        illumination = illumination_of(original, rough, sampled, antennas, shadows, device, report_shadows)
        if host is not None and host.is_clipped.any():
            lit_parts = lit_parts_of(host.pieces, host.is_clipped, antennas, shadows, device, report_shadows)
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
            culling.antennas.forward,
        )


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


def check_antennas_above(scene: Scene, antennas: PulseGeometry) -> None:
    """ValueError for an antenna under a scene's terrain, where that is complete."""
    for name, positions in zip(("track", "receiver"), antennas.ends, strict=False):
        if scene.heights is not None and above(scene.heights, positions).min() < 0:
            if scene.on_heights is not None:
                check_above(name, scene.heights, positions)


def faces_away(centers: np.ndarray, normals: np.ndarray, antennas: PulseGeometry) -> np.ndarray:
    """True (k,) for facets that face away from the transmitter, or from the receiver, at every pulse; for forward
    scatter, from the transmitter.

    centers  m (n, 3), of the facets, or corners of a box around them;  normals  (k, 3)

    n.u(p, x) <= n.u_mean + |u(p, x) - u_mean|: the last term is bounded over all pulses and the whole scene. Facets
    that are edge-on to one of two antennas still send back a part (physical_optics.py:lit_share).
    """
    edge_on = 0.0 if antennas.is_monostatic else 2 * EDGE_ON
    looking = (antennas.tx,) if antennas.forward else (antennas.tx, antennas.rx)
    corners = boxes.box(centers)
    middle, radius = corners.mean(axis=0), float(np.linalg.norm(corners[1] - corners[0])) / 2
    out = np.zeros(len(normals), bool)
    for ends in looking:
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
