"""Whether a mesh is fine enough for the wavelength and the curved surfaces it approximates: its error in dB.

dB = 10 log10(|flat|^2/|curved|^2) of every smooth surface as a whole, from the sums of _curved_echo.py over the mesh at
hand, at up to 16 pulses and frequencies of the band. No bound, but what flat facets change, to the physics of echoes:
docs/theory/facets.md holds it against exact spheres, cylinders and other bodies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base import constants, validation
from ...base.boxes import box
from ...model.waveform import Waveform
from ...numerics.pulse_geometry import PulseGeometry
from ...scene.scene import Scene
from ...scene.triangles import edges
from ..facet_kinds import coherent, kinds
from ._adjacency import adjacency_of, uncut
from ._curvature import SurfaceCurvature, curvature_of
from ._curved_echo import Sums, sums

WARN = 0.5  # dB
AIM = 0.25  # dB, of the edges that are advised
FINE = 2.0  # rad, two-way, over an edge of lambda/6.3: finer facets have an error below WARN, whatever their curvature
STEEP = 1e-4  # rad, two-way, of a height that is worth a look
LOOKS = 16
MOST_COST = 1.2e7  # integrands after which there is no further look
WEAK = 1e-2  # of the power of the strongest: curved surfaces that are weaker are not judged,
DULL = 1e-3  # nor those with less radar cross section than this times their area: no part of them is specular
LIMIT = 40.0  # dB: what cancels is no measure
GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class FacetError:
    """Change of the echo by flat facets in place of curved surfaces: error and sizes of the worst surface.

    error_db    rms change of its level over pulses and band, weighted by power; 0 where nothing is curved
    worst_db    largest change of its level where it is no more than 10 dB below its strongest
    judged      curved surfaces with something specular, within 20 dB of the strongest
    coarse      those of them with an error of more than 0.5 dB
    edge, radius, standoff, needed   m: of its facets across the bend, of the bend, how far that stands off them, and
                the edges that would do
    wavelength  m;  rcs  m^2;  place  m (3,), its middle
    """

    error_db: float = 0.0
    worst_db: float = 0.0
    judged: int = 0
    coarse: int = 0
    edge: float = 0.0
    radius: float = np.inf
    standoff: float = 0.0
    needed: float = np.inf
    wavelength: float = np.inf
    rcs: float = 0.0
    place: tuple[float, ...] = (0.0, 0.0, 0.0)

    def describe(self) -> dict[str, Any]:
        """For a report's plan."""
        return {"flat for curved, dB": round(self.error_db, 2)} if self.judged else {}

    def warnings(self) -> list[str]:
        """Warnings for a user; none below 0.5 dB."""
        if self.error_db < WARN:
            return []
        waves = 1 / self.wavelength
        place = ", ".join(f"{v:.4g}" for v in self.place)
        more = f" (and {self.coarse - 1} more surfaces by over {WARN:g} dB)" if self.coarse > 1 else ""
        return [
            f"mesh too coarse for the wavelength: about ({place}) m facets of {self.edge:.2g} m "
            f"({self.edge * waves:.2g} wavelengths) approximate a curve of radius {self.radius:.2g} m, which lies up "
            f"to {self.standoff:.2g} m ({self.standoff * waves:.2g} wavelengths) off them; echoes of that surface, "
            f"{10 * np.log10(max(self.rcs, 1e-30)):.0f} dBsm, differ by {self.error_db:.1f} dB rms over pulses and "
            f"band and by up to {self.worst_db:.1f} dB{more}. Mesh the curve itself with edges of at most "
            f"{self.needed:.2g} m (sarcl.shapes: edge=...); cutting flat facets (max_edge, split) does not make them "
            "curved"
        ]


def judge(scene: Scene, antennas: PulseGeometry, waveform: Waveform) -> FacetError:
    """Error of a scene's facets in the echoes of the curved surfaces that they approximate.

    Only facets count that reflect coherently and face the antennas; shadows are neglected. Give the scene without
    random heights (`Scene.realized`), which hide curves; cutting does not. TypeError names a wrong type.
    """
    for name, value, kind in zip(
        ("scene", "antennas", "waveform"), (scene, antennas, waveform), (Scene, PulseGeometry, Waveform), strict=True
    ):
        validation.instance(name, value, kind)
    turns = 4 * np.pi * (waveform.center + waveform.bandwidth / 2) / constants.SPEED_OF_LIGHT  # rad/m
    mirror = coherent(scene) & (scene.reflectivity > 0) if len(scene.triangles) else np.zeros(0, bool)
    if not mirror.any():
        return FacetError()
    scene = scene if mirror.all() else scene.part(mirror)
    if np.max(edges(scene.triangles)) * turns < FINE:
        return FacetError()
    scene, b = _curved(scene)
    longest = np.maximum.reduce(edges(scene.triangles)) * turns
    bend = np.maximum.reduce(np.abs(b.height), axis=1) * turns
    matters = np.zeros(int(b.surface.max()) + 1, bool)
    matters[b.surface[(longest >= FINE) & (bend > STEEP)]] = True
    some = np.flatnonzero(matters[b.surface])
    if len(some) == 0:
        return FacetError()
    if len(some) < len(b.surface):
        scene = scene.part(some)
        b = SurfaceCurvature(*(getattr(b, name)[some] for name in SurfaceCurvature.__dataclass_fields__))
    b = replace(b, surface=(np.cumsum(matters) - 1)[b.surface])
    return _verdict(scene, b, waveform, _looks(scene, b, antennas, waveform))


def _curved(scene: Scene) -> tuple[Scene, SurfaceCurvature]:
    """A scene with the fewest facets for its flat parts, and the curvature of the surfaces that they approximate."""
    j = adjacency_of(scene.triangles)
    fewer = None if scene.has_random_points else uncut(scene.triangles, j, kinds(scene))
    if fewer is not None:
        scene = replace(scene.part(fewer[1]), triangles=validation.sealed(fewer[0]))
        j = adjacency_of(scene.triangles)
    return scene, curvature_of(scene.triangles, scene.two_sided, j)


def _looks(scene: Scene, b: SurfaceCurvature, antennas: PulseGeometry, waveform: Waveform) -> list[tuple[Sums, float]]:
    """Sums at pulses and frequencies spread over track and band, and what radar cross section, m^2, 1 m^4 is in them,
    times how strong the frequency is in the waveform."""
    out, cost = [], 0
    size = float(np.linalg.norm(np.diff(box(scene.triangles.reshape(-1, 3)), axis=0)))
    differ = len(antennas.tx) * (1 + 8 * waveform.bandwidth * size / constants.SPEED_OF_LIGHT)  # how many looks may
    spread = np.array([int(f"{i + 1:b}"[::-1], 2) / 2 ** (i + 1).bit_length() for i in range(LOOKS)])
    rows = (spread * len(antennas.tx)).astype(int)  # at 1/2, 1/4, 3/4, 1/8 ... of the track (van der Corput)
    if len(antennas.tx) < LOOKS:  # each once before any twice
        rows = np.resize(spread[: len(antennas.tx)].argsort().argsort(), LOOKS)
    for i in range(int(min(LOOKS, np.ceil(differ)))):
        frequency = waveform.center + waveform.bandwidth * ((0.5 + GOLDEN * i) % 1 - 0.5)
        echo = sums(scene, b, antennas, int(rows[i]), frequency)
        share = float(waveform.matched_spectrum(np.array([frequency]))[0]) ** 2
        out.append((echo, share * 4 * np.pi * (frequency / constants.SPEED_OF_LIGHT) ** 2))
        cost += echo.cost
        if cost > MOST_COST:
            break
    return out


def _verdict(scene: Scene, b: SurfaceCurvature, waveform: Waveform, looks: list[tuple[Sums, float]]) -> FacetError:
    """The error of the worst surface of those that are strong enough."""
    flat = np.stack([(np.abs(s.flat) ** 2 + s.flat_power) * scale for s, scale in looks])  # (looks, 2, n)
    curved = np.stack([(np.abs(s.curved) ** 2 + s.curved_power) * scale for s, scale in looks])
    weight = (flat + curved) / 2
    strength = weight.mean(axis=0)
    judged = strength > np.maximum(WEAK * strength.max(), DULL * np.bincount(b.surface, b.area))
    if not judged.any():
        return FacetError()
    least = np.where(judged, 1e-12 * strength, 1.0)
    level = np.clip(10 * np.log10((flat + least) / (curved + least)), -LIMIT, LIMIT)
    error = np.sqrt((weight * level**2).sum(axis=0) / np.where(judged, weight.sum(axis=0), 1)) * judged
    side, worst = np.unravel_index(int(error.argmax()), error.shape)
    seen = weight[:, side, worst] >= 0.1 * weight[:, side, worst].max()
    blame = sum((s.blame * scale for s, scale in looks), 1e-12 * b.area) * (b.surface == worst)
    its = np.flatnonzero(blame > 1e-3 * blame.max())
    square = (b.edge[its] ** 2).sum(axis=2)
    bend = 8 * np.abs(b.height[its]) / square
    across = bend.argmax(axis=1)[:, None]
    size, bend = (np.take_along_axis(a, across, axis=1)[:, 0] for a in (np.sqrt(square), bend))
    blame = blame[its] * (bend > 0)
    edge, radius = _median(size, blame), 1 / max(_median(bend, blame), 1e-300)
    wavelength, rms = constants.SPEED_OF_LIGHT / waveform.center, float(error[side, worst])
    fine = min(edge * np.sqrt(AIM / max(rms, AIM)), np.sqrt(radius * wavelength) / 4)
    middle = box(scene.triangles[b.surface == worst].reshape(-1, 3)).mean(axis=0)
    return FacetError(
        error_db=rms,
        worst_db=float(np.abs(level)[seen, side, worst].max()),
        judged=int(judged.any(axis=0).sum()),
        coarse=int((error >= WARN).any(axis=0).sum()),
        edge=edge,
        radius=radius,
        standoff=edge**2 / (8 * radius),
        needed=float(min(edge, max(fine, wavelength / (2 * np.pi)))),
        wavelength=wavelength,
        rcs=float(strength[side, worst]),
        place=tuple(middle.tolist()),
    )


def _median(values: np.ndarray, weights: np.ndarray) -> float:
    """Median of values (n,) with weights (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])
