"""Errors of scattering matrices: cosines and materials in float32, and H and V near the vertical.

- **Cosines.** S falls with the cosine of incidence, or fades with it (physical_optics.py:lit_share): a direction that
  is rounded by e rad changes S by e/cosine of itself. The rounding of S is measured on sampled facets.
- **Materials.** Facets have m = 1/sqrt(eps) in float32. Fresnel's coefficients are proportional to 1 - m, which has
  few digits where eps is close to 1: at 1.001 its rounding is up to 6e-5 of the echo.
- **Polarisation.** H is horizontal, s x up. It turns about the line of sight s from place to place, by the change of
  the azimuth times the sine of the elevation: by step/(horizontal distance) near the vertical through an antenna, and
  by all angles across it. A plane facet has one S, that of its centroid: the error is what H and V at its corners would
  make of S. Where both antennas are one and S is that of a conductor it cancels.

docs/theory/facets.md says what follows; tests/scattering/test_facet_errors.py measures it against finer facets.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.boxes import box
from ..base.rows import spread_over
from ..base.vectors import cross, unit
from ..numerics.pulse_geometry import PulseGeometry
from ..scene.triangles import areas, bisect, centroids, edges
from ._facet_sampling import drawn
from .facet_kinds import FacetView
from .physical_optics import normals_and_areas, scattering_matrix, turned

FACETS, PULSES = 200, 5  # samples
FLOAT32_DIRECTION = 6e-8  # rad, rms: measured 4e-8 to 7e-8 by tests/scattering/test_facet_errors.py
FLOAT32_ROOT = 2.0**-24  # largest relative rounding of m in float32
STEEP = 0.5  # sine of the angle between line of sight and vertical: above, H turns no faster than directions do
MOST_PIECES = 4096  # of the sampled facets, cut more finely towards the vertical through an antenna
SHARP = 0.3  # rad of turn over one piece: beyond, errors do not fall with the square of its size

Ends = tuple[np.ndarray, np.ndarray]  # positions of transmitter and receiver, m (3,) each


class DirectionError:
    """Errors of a scene's facets, relative to these at random phases, at the highest frequency of a band."""

    def __init__(self, view: FacetView) -> None:
        scene, mirror, antennas, vertical = view.scene, view.mirror, view.antennas, view.vertical
        self._vertical = (float(vertical[0]), float(vertical[1]), float(vertical[2]))
        self._columns, self._forward = view.columns, antennas.forward
        eps = np.array([m.permittivity(view.highest) for m in scene.materials], np.complex128)
        self._triangles, self._two_sided = scene.triangles, scene.two_sided
        self._permittivity, self._reflectivity = eps[scene.material], scene.reflectivity
        self.rounding = self._rounding([(antennas.tx[p], antennas.rx[p]) for p in spread_over(len(antennas), PULSES)])
        cancels = antennas.is_monostatic and bool(np.isinf(self._permittivity[mirror]).all())
        none = cancels or not mirror.any()
        rows = [] if none else steep_pulses(antennas, centroids(scene.triangles), vertical)
        self.steep = [(antennas.tx[p], antennas.rx[p]) for p in rows]
        self._mirror = np.flatnonzero(mirror) if self.steep else np.zeros(0, int)
        self._drawn: list[tuple[np.ndarray, np.ndarray]] = []

    def turn(self, edge: float) -> tuple[float, bool]:
        """Error of one pair of H and V per facet cut to `edge`, m, at the steepest pulses; and whether they turn
        sharply within one. 0 where no line of sight is within 30 deg of the vertical."""
        worst, sharp = 0.0, False
        for i, ends in enumerate(self.steep):
            if len(self._drawn) <= i:
                some, share = drawn_near_vertical(self._triangles[self._mirror], ends, self._vertical)
                self._drawn.append((self._mirror[some], share))
            error, angle = self._turn(*self._drawn[i], ends, edge)
            worst, sharp = max(worst, error), sharp or angle > SHARP
        return worst, sharp

    def _rounding(self, looks: list[Ends]) -> float:
        some, share = drawn(areas(self._triangles), FACETS, np.random.default_rng(0))
        triangles, wrong, right = self._triangles[some], 0.0, 0.0
        share = share * areas(triangles) * self._reflectivity[some] ** 2
        normals, places = normals_and_areas(triangles)[0], centroids(triangles)
        weak = root_rounding(self._permittivity[some]) ** 2
        for ends in looks:
            to_tx, to_rx = (unit(end - places) for end in ends)
            n = np.where(
                (self._two_sided[some] & turned(normals, to_tx, to_rx, self._forward))[:, None], -normals, normals
            )
            exact = self._matrix(n, to_tx, to_rx, some)
            power = share * (np.abs(exact) ** 2).sum(axis=1)
            right += float(power.sum())
            wrong += float(power @ weak)
            for look in (to_tx,) if ends[0] is ends[1] or np.array_equal(*ends) else (to_tx, to_rx):
                tilted = self._matrix(unit(n + FLOAT32_DIRECTION * look), to_tx, to_rx, some)
                wrong += float(share @ (np.abs(tilted - exact) ** 2).sum(axis=1))
        return float(np.sqrt(wrong / right)) if right else 0.0

    def _matrix(self, normals: np.ndarray, to_tx: np.ndarray, to_rx: np.ndarray, some: np.ndarray) -> np.ndarray:
        """S of facets `some`, complex128 (n, 4)."""
        eps = self._permittivity[some]
        return scattering_matrix(normals, to_tx, to_rx, eps, self._vertical, self._forward).reshape(-1, 4)

    def _turn(self, some: np.ndarray, share: np.ndarray, ends: Ends, edge: float) -> tuple[float, float]:
        pieces, of = self._graded(self._triangles[some], ends, edge)
        weight, middle = share[of] * areas(pieces) * self._reflectivity[some[of]] ** 2, centroids(pieces)
        to_tx, to_rx = (unit(end - middle) for end in ends)
        n = normals_and_areas(pieces)[0]
        n = np.where((self._two_sided[some[of]] & turned(n, to_tx, to_rx, self._forward))[:, None], -n, n)
        exact = self._matrix(n, to_tx, to_rx, some[of]).reshape(-1, 2, 2)
        right = float(weight @ (np.abs(exact.reshape(-1, 4)[:, self._columns]) ** 2).sum(axis=1))
        shrink = np.minimum(1.0, edge / np.maximum.reduce(edges(pieces)))[:, None]
        wrong, sharpest = np.zeros(len(pieces)), 0.0
        for corner in np.moveaxis(pieces, 1, 0):
            angles = [self._turned_by(middle, middle + shrink * (corner - middle), end) for end in ends]
            sent, received = (_rotations(angle) for angle in angles)
            there = received @ exact @ np.swapaxes(sent, 1, 2)
            apart = (there - exact).reshape(-1, 4)[:, self._columns]
            wrong = np.maximum(wrong, (np.abs(apart) ** 2).sum(axis=1))
            sharpest = max(sharpest, *(float(np.abs(angle).max()) for angle in angles))
        return float(np.sqrt(weight @ wrong / right)) if right else 0.0, sharpest

    def _turned_by(self, places: np.ndarray, others: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Angle by which H and V turn about the line of sight from an antenna, from places to others, rad (n,)."""
        look, up = unit(places - end), np.array(self._vertical)
        one, two = (_level(p - end, self._vertical) for p in (places, others))
        return np.asarray(np.arctan2(cross(one, two) @ up, (one * two).sum(axis=1)) * (look @ up))

    def _graded(self, triangles: np.ndarray, ends: Ends, edge: float) -> tuple[np.ndarray, np.ndarray]:
        """Facets cut down to `edge` on the vertical through an antenna, to their distance from it elsewhere, and which
        of the given ones each is a part of (n,)."""
        of = np.arange(len(triangles))
        while True:
            lengths = edges(triangles)
            longest, places = np.maximum.reduce(lengths), centroids(triangles)
            aside = np.minimum.reduce([np.linalg.norm(_level(places - end, self._vertical), axis=1) for end in ends])
            long = longest > np.maximum(edge, aside - longest)
            if not long.any() or len(triangles) + long.sum() > MOST_PIECES:
                return triangles, of
            halves = bisect(triangles[long], lengths[:, long])
            triangles = np.concatenate([triangles[~long], *halves])
            of = np.concatenate([of[~long], of[long], of[long]])


def root_rounding(permittivity: np.ndarray) -> np.ndarray:
    """Largest relative error of Fresnel's coefficients by the rounding of m = 1/sqrt(eps), complex (n,), to float32.

    0 for conductors and vacuum, whose m is exact.
    """
    eps = np.where(np.isinf(permittivity) | (permittivity == 1), 4, permittivity)
    root = np.sqrt(eps)  # m/(1 - m) = 1/(root - 1) = (root + 1)/(eps - 1)
    rounding = FLOAT32_ROOT * np.abs((root + 1) / (eps - 1))
    return np.where(eps == permittivity, rounding, 0.0)


def steep_pulses(antennas: PulseGeometry, places: np.ndarray, vertical: Sequence[float] | np.ndarray) -> list[int]:
    """For each antenna the pulse at which lines of sight to places, m (n, 3), come nearest to the vertical, where they
    come within 30 deg of it."""
    bounds = box(places)
    middle, radius = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0])) / 2
    out = []
    for end in antennas.ends:
        look = end - middle
        aside = np.linalg.norm(_level(look, vertical), axis=1)
        sine = (aside - radius) / (np.linalg.norm(look, axis=1) + radius)
        at = int(np.argmin(sine))
        if sine[at] < STEEP:
            out.append(at)
    return out


def drawn_near_vertical(
    triangles: np.ndarray, ends: Ends, vertical: Sequence[float] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Indices of facets sampled at a pulse, more of them near the vertical through an antenna; and the number that each
    represents."""
    area, places = areas(triangles), centroids(triangles)
    aside = np.minimum.reduce([np.linalg.norm(_level(places - end, vertical), axis=1) for end in ends])
    steep = area / np.maximum(aside, np.maximum.reduce(edges(triangles))) ** 2
    size = area / area.sum() + steep / steep.sum() if area.any() else area
    return drawn(size, FACETS, np.random.default_rng(4))


def _level(vectors: np.ndarray, up: Sequence[float] | np.ndarray) -> np.ndarray:
    """Horizontal part of vectors (n, 3)."""
    axis = np.array(up)
    return np.asarray(vectors - (vectors @ axis)[..., None] * axis)


def _rotations(angle: np.ndarray) -> np.ndarray:
    """Matrices (n, 2, 2) that turn H, V of lines of sight about them: H' = cos H - sin V."""
    c, s = np.cos(angle), np.sin(angle)
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)
