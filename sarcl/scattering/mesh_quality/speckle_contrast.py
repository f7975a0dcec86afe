"""Speckle contrast of an image, from the number of facets per resolution cell.

Triangles with random phases and equal power, two to a parallelogram of s1 x s2 resolution cells, sinc responses:

    C^2 = 2 g - 1 - (4/9) s1 s2/2        g = (G_0(s1) G_0(s2) + G_1(s1) G_1(s2))/2
    G_i(s) = sum over |m| < s of (1 - |m|/s)^2 cos(2 pi i m/3)

C, standard deviation over mean of the intensity, is 1 for speckle. g, the mean square of what the responses' power adds
up to over its squared mean, says how unevenly a lattice of pairs, a third of a diagonal apart, covers the image: 1 for
s1, s2 <= 1; sinc^2 has a triangle for a transform. s1 s2/2 is a facet's area, in cells. The term (4/9) s1 s2/2, with
4/9 = (integral sinc^4/(integral sinc^2)^2)^2, corrects for the finite number of unit-amplitude scatterers per cell; it
vanishes for facets whose diagram gives them Rayleigh amplitudes. tests/scattering/test_mesh_quality.py holds this
against such sums; docs/theory/facets.md.

source   moments of sums of independent phasors: Goodman 2007, "Speckle phenomena in optics", section 3.6
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base import constants, validation
from ...base.boxes import box
from ...model.waveform import Waveform
from ...numerics.pulse_geometry import PulseGeometry
from ...scene.material import COHERENT
from ...scene.scene import Scene
from ...scene.triangles import edges, normals

OFF = 0.05  # deviation of the contrast from 1 that is worth a warning
GAPS = 1.1  # g that is worth a warning: the contrast may be right by chance where the image has holes
TURNED = 1.0  # rad, rms phase of random heights, from which on phases count as random
LONE = 1.5  # cells, extent below which a surface counts as one cell: (integral sinc^2)^2/integral sinc^4 = 1.5
MOST_TERMS = 30  # of G_1, which is negligible beside G_0 where there are more
SAMPLED = 100_000  # facets of a scene that are looked at
ENOUGH = 8.0  # facets per cell that are advised: C = 0.97


@dataclass(frozen=True)
class Speckle:
    """Speckle of facets with random phases that face the antennas at mid-track.

    facets    their number;  per_cell  number per resolution cell
    contrast  standard deviation of the intensity over its mean, 1 for speckle;  gaps  g, 1 for none
    cell      m (2,): resolution in slant range and cross range; inf: none
    needed    m, edges short enough for speckle
    """

    facets: int = 0
    per_cell: float = np.inf
    contrast: float = 1.0
    gaps: float = 1.0
    cell: tuple[float, float] = (np.inf, np.inf)
    needed: float = np.inf

    def describe(self) -> dict[str, Any]:
        """For a report's plan."""
        return {"rough facets per resolution cell": float(f"{self.per_cell:.2g}")} if self.facets else {}

    def warnings(self) -> list[str]:
        """Warnings for a user: contrast off by more than 5 %, or holes."""
        if abs(self.contrast - 1) <= OFF and self.gaps <= GAPS:
            return []
        holes = ", and the image has holes" if self.gaps > GAPS else ""
        return [
            f"too few facets for speckle: {self.per_cell:.2g} rough ones per resolution cell of {self.cell[0]:.2g} x "
            f"{self.cell[1]:.2g} m (slant range x cross range); the intensity's standard deviation over its mean will "
            f"be about {self.contrast:.2f}, where speckle has 1{holes}. Cut them to edges of at most "
            f"{self.needed:.2g} m (Scene.split); echo cuts them to half a cell in range alone"
        ]


def judge(scene: Scene, antennas: PulseGeometry, waveform: Waveform, represents: float = 1.0) -> Speckle:
    """Speckle of a scene's facets after cutting: of rough ones, and of those that random heights displace.

    represents  number of facets that each of these represents
    With an antenna at the scene's centre, or forward scattering, there is no resolution cell and no verdict. TypeError
    names a wrong type.
    """
    for name, value, kind in zip(
        ("scene", "antennas", "waveform"), (scene, antennas, waveform), (Scene, PulseGeometry, Waveform), strict=True
    ):
        validation.instance(name, value, kind)
    look = _looks(antennas, scene.center)
    if len(scene.triangles) == 0 or look is None:
        return Speckle()
    triangles, material, roughness, reflectivity, two_sided = (
        getattr(scene, name) for name in ("triangles", "material", "roughness", "reflectivity", "two_sided")
    )
    of_each = represents * max(1.0, len(triangles) / SAMPLED)
    if len(triangles) > SAMPLED:  # of large scenes some represent the others: drawn, because facets may stand in rows
        drawn = np.random.default_rng(0).choice(len(triangles), SAMPLED, replace=False)
        triangles, material, roughness, reflectivity, two_sided = (
            values[drawn] for values in (triangles, material, roughness, reflectivity, two_sided)
        )
    facing = normals(triangles) @ look[len(look) // 2]
    turn = 4 * np.pi * waveform.center / constants.SPEED_OF_LIGHT * np.maximum(np.abs(facing), 1e-9)  # rad/m
    height = np.array([0.0 if m.diagram in COHERENT else m.height for m in scene.materials])[material]
    rayleigh = turn * height > TURNED
    some = rayleigh | (turn * roughness > TURNED)
    some &= (reflectivity > 0) & ((facing > 0) | (two_sided & (facing < 0)))
    return _contrast(triangles[some], rayleigh[some], look, waveform, of_each) if some.any() else Speckle()


def _looks(antennas: PulseGeometry, center: np.ndarray) -> np.ndarray | None:
    """Mean directions to the antennas from a point (n, 3); None where they are not defined or cancel."""
    look = antennas.mean_direction(center)
    return look if np.linalg.norm(look[len(look) // 2]) > 1e-6 and not np.isnan(look).any() else None


def _contrast(
    triangles: np.ndarray, rayleigh: np.ndarray, look: np.ndarray, waveform: Waveform, of_each: float
) -> Speckle:
    """Contrast of triangles, m (k, 3, 3), some with Rayleigh amplitudes (k,), for gradients look (n, 3) of the path.

    of_each  how many facets each of them represents
    """
    middle = look[len(look) // 2]
    along = middle / np.linalg.norm(middle)
    turn = look - look[0]
    turn = turn[np.linalg.norm(turn, axis=1).argmax()]
    turn = turn - along * (turn @ along)
    axes = (
        2 / constants.SPEED_OF_LIGHT * np.stack([waveform.bandwidth * middle, waveform.center * turn])
    )  # cells per metre
    places = triangles @ axes.T  # (k, 3, 2)
    low, high = box(places.reshape(-1, 2))
    resolved = (high - low)[high - low > LONE]  # cells
    phasors = float((~rayleigh).mean())
    size, area = _parallelograms(places)
    if len(resolved) == 2 and area.any():
        uneven, total = _unevenness(size), float(area.sum())
        gaps, per_cell = float(area @ uneven) / total, len(area) / total
        lack = 4 / 9 * float(area @ (area * ~rayleigh)) / total
    else:  # all in one cell, or in a row of cells
        gaps, per_cell = 1.0, of_each * len(triangles) / float(resolved.prod())
        lack = phasors * (2 / 3 if len(resolved) else 1.0) / per_cell
    cell = tuple(float(1 / length) if length else np.inf for length in np.linalg.norm(axes, axis=1))
    typical = float(np.median(np.maximum.reduce(edges(triangles))))
    finer = typical * float(np.sqrt(min(per_cell / ENOUGH, 1.0))) if phasors else typical
    return Speckle(
        round(of_each * len(triangles)),
        per_cell,
        float(np.sqrt(max(2 * gaps - 1 - lack, 0.0))),
        gaps,
        (cell[0], cell[1]),
        min(min(cell) / 2, finer),
    )


def _parallelograms(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """s1, s2 (k, 2), in cells, of triangles (k, 3, 2), in the ratio of their extents, and areas s1 s2/2 (k,)."""
    (ax, ay), (bx, by) = ((places[:, i] - places[:, 0]).T for i in (1, 2))
    area = np.abs(ax * by - ay * bx) / 2
    span = np.maximum(places.max(axis=1) - places.min(axis=1), 1e-12)
    return np.sqrt(2 * area[:, None] * span / span[:, ::-1]), area


def _unevenness(size: np.ndarray) -> np.ndarray:
    """g of parallelograms (k, 2)."""
    s, n = np.maximum(size, 1e-12), np.floor(size)
    even = 1 + 2 * (n - n * (n + 1) / s + n * (n + 1) * (2 * n + 1) / (6 * s * s))
    shifted = np.ones_like(s)
    for m in range(1, int(min(s.max(initial=0), MOST_TERMS)) + 1):
        shifted += 2 * np.maximum(1 - m / s, 0) ** 2 * np.cos(2 * np.pi * m / 3)
    return np.asarray((even.prod(axis=1) + shifted.prod(axis=1)) / 2)
