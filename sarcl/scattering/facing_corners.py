"""What single reflections leave out: large flat parts at right angles that face each other, by a quick look at a mesh.

A wave from direction u meets part A, with the normal a, at the height s over the plane of part B, and then B at the
height s (u.a)/(u.b) over that of A. Two reflections, in both orders, send back what a plate does of the area

    2 L l,    l = overlap of (u.a) [s_0, s_1] and (u.b) [h_0, h_1],    sigma = 4 pi (2 L l)^2/lambda^2 |R_a R_b|^2

with L the length that both have along the fold. source  docs/theory/bounces.md; Knott, Radar Cross Section, section 6.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.boxes import box
from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import cross, dot, unit
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import PulseGeometry
from ..scene.scene import Scene
from .facet_kinds import coherent
from .physical_optics import fresnel, normals_and_areas, triangle_mean

LEAST_SIZE = 5.0  # wavelengths: a part has at least the area of a square of that side
RIGHT = np.sin(np.radians(3.0))  # cosine between normals of parts, at most
STEEP, FLAT = 0.02, 1e-3  # rad, and share of the scene's diagonal: facets that differ by less lie in one plane
GRAZING = 0.02  # sine of the angle between a part and an antenna, at least
MOST_PARTS, MOST_PAIRS, LOOKS = 48, 32, 4  # that are looked at, the largest first; pairs whose lines of sight are
WORTH = 3.0  # dB, of a warning
SPREAD = np.linspace(-0.02, 0.02, 9)  # of the frequency: single reflections are averaged over their lobes


@dataclass(frozen=True)
class FacingCorners:
    """The corner whose two reflections are strongest: by how much these exceed its single ones, dB, and its sides, m.

    None of it where no parts face each other at right angles.
    """

    excess: float = -np.inf
    sides: tuple[float, float] = (0.0, 0.0)

    def describe(self) -> dict[str, Any]:
        """For a report's plan."""
        return {"left out at right angles, dB": round(self.excess)} if self.excess >= WORTH else {}

    def warnings(self) -> list[str]:
        """Warnings for a user."""
        if self.excess < WORTH:
            return []
        return [
            f"flat parts face each other at right angles, such as sides of {self.sides[0]:.2g} and "
            f"{self.sides[1]:.2g} m: single reflections alone are about {self.excess:.0f} dB weaker there than what "
            "both parts reflect one after the other; pass bounces=2 to echo or rcs, or 3 in corners of three parts"
        ]


@dataclass(frozen=True, eq=False)
class _Part:
    """Facets in one plane: corners, m (n, 3, 3), areas (n,), the side that is looked at, and its height over 0, m."""

    corners: np.ndarray
    area: np.ndarray
    normal: np.ndarray
    offset: float
    facet: int  # its largest one

    def turned(self) -> _Part:
        """The other side."""
        return _Part(self.corners, self.area, -self.normal, -self.offset, self.facet)


@dataclass(frozen=True, eq=False)
class _Corner:
    """Two parts that face each other.

    fold   unit vector (3,);  length  m, that both have along it, and  middle  m;  spans  heights of each over the
    plane of the other, m
    """

    parts: tuple[_Part, _Part]
    fold: np.ndarray
    length: float
    middle: float
    spans: tuple[tuple[float, float], tuple[float, float]]

    def looks(self, antennas: PulseGeometry) -> tuple[np.ndarray, np.ndarray]:
        """Unit vectors to both antennas at every pulse (n, 3)."""
        place = self.place(0, self.spans[0][1] / 2)
        return unit(antennas.tx - place), unit(antennas.rx - place)

    def place(self, part: int, height: float) -> np.ndarray:
        """The place of a part in the middle of the fold, at a height over the plane of the other, m (3,)."""
        own, other = self.parts[part], self.parts[1 - part]
        return self.middle * self.fold + own.offset * own.normal + (other.offset + height) * other.normal

    def lit(self, looks: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sines (2, n) between parts and antennas, and where their overlap begins and ends, times these, m (n,)."""
        sines = np.stack([np.minimum(looks[0] @ part.normal, looks[1] @ part.normal) for part in self.parts])
        ends = np.stack([np.outer(span, sine) for span, sine in zip(self.spans, sines, strict=True)])
        low, high = ends[:, 0].max(axis=0), ends[:, 1].min(axis=0)
        return sines, low, np.where((sines > GRAZING).all(axis=0), np.maximum(high, low), low)

    def power(self, scene: Scene, antennas: PulseGeometry, frequency: float) -> np.ndarray:
        """Radar cross sections of two reflections at every pulse, m^2, with H and V across the planes of incidence:
        (2, n)."""
        looks, wave = self.looks(antennas), frequency / SPEED_OF_LIGHT
        sines, low, high = self.lit(looks)
        apart = looks[1] - looks[0]
        across = np.linalg.norm(apart - np.outer(apart @ self.fold, self.fold), axis=1)
        lobe = np.sinc(self.length * wave * ((looks[0] + looks[1]) @ self.fold)) * np.sinc(
            2 * (high - low) * wave * across
        )
        reflected = np.prod(
            [_reflected(scene, part, x, frequency) for part, x in zip(self.parts, sines, strict=True)], axis=0
        )
        return np.asarray(4 * np.pi * (2 * self.length * (high - low) * wave * lobe * reflected) ** 2)

    def single(self, scene: Scene, antennas: PulseGeometry, pulse: int, frequency: float) -> np.ndarray:
        """Mean radar cross sections of the single reflections of both parts at a pulse, m^2, over their lobes: (2,)."""
        waves = 2 * np.pi * frequency * (1 + SPREAD) / SPEED_OF_LIGHT
        total = np.zeros((2, len(waves)), np.complex128)
        for part in self.parts:
            places = part.corners.mean(axis=1)
            steps = [end[pulse] - places for end in (antennas.tx, antennas.rx)]
            paths = sum(np.linalg.norm(step, axis=1) for step in steps)
            both = unit(steps[0]) + unit(steps[1])
            b, c = (dot(part.corners[:, i] - part.corners[:, 0], both)[:, None] * waves for i in (1, 2))
            sine = np.maximum(both @ part.normal / 2, 0)
            sent = _reflected(scene, part, sine, frequency) * sine * part.area
            total += sent @ (triangle_mean(b, c) * np.exp(-1j * paths[:, None] * waves))
        return np.asarray(np.mean(np.abs(waves * total) ** 2, axis=1) / np.pi)

    def is_seen(self, triangles: np.ndarray, antennas: PulseGeometry, pulse: int) -> bool:
        """Whether both antennas see it, and its parts each other."""
        looks = self.looks(antennas)
        sines, low, high = self.lit(looks)
        middle = (low[pulse] + high[pulse]) / 2
        places = [self.place(i, middle / sines[i, pulse]) for i in (0, 1)]
        ways = [(places[0], places[1]), (places[0], antennas.tx[pulse]), (places[1], antennas.rx[pulse])]
        return not any(_blocked(triangles, *way) for way in ways)


def judge(scene: Scene, antennas: PulseGeometry, waveform: Waveform) -> FacingCorners:
    """The corner of a scene whose two reflections are strongest, where antennas see one."""
    corners = list(_corners(scene, SPEED_OF_LIGHT / waveform.center))
    powers = [corner.power(scene, antennas, waveform.center) for corner in corners]
    order = sorted(range(len(corners)), key=lambda i: -float(powers[i].max()))
    for i in order[:LOOKS]:
        corner, pulse = corners[i], int(powers[i].max(axis=0).argmax())
        if powers[i].max() > 0 and corner.is_seen(scene.triangles, antennas, pulse):
            single = corner.single(scene, antennas, pulse, waveform.center)
            ratio = float((powers[i][:, pulse] / np.maximum(single, np.finfo(float).tiny)).max())
            return FacingCorners(10 * float(np.log10(ratio)), (corner.spans[0][1], corner.spans[1][1]))
    return FacingCorners()


def _corners(scene: Scene, wavelength: float) -> Iterator[_Corner]:
    """Pairs of the largest flat parts at right angles that face each other."""
    parts = _parts(scene, wavelength)
    normals = np.array([part.normal for part in parts]).reshape(-1, 3)
    one, other = np.nonzero(np.triu(np.abs(normals @ normals.T) < RIGHT, 1))
    size = np.array([part.area.sum() for part in parts])
    for i in np.argsort(-np.minimum(size[one], size[other]), kind="stable")[:MOST_PAIRS].tolist():
        pair = parts[one[i]], parts[other[i]]
        sides = [(part, part.turned()) if scene.two_sided[part.facet] else (part,) for part in pair]
        for a in sides[0]:
            for b in sides[1]:
                corner = _corner(a, b, LEAST_SIZE * wavelength)
                if corner is not None:
                    yield corner


def _corner(a: _Part, b: _Part, least: float) -> _Corner | None:
    """Two parts as a corner; None where they do not face each other over `least`, m, each way."""
    fold, spans, along = unit(cross(a.normal, b.normal)), [], []
    for own, other in ((a, b), (b, a)):
        heights = own.corners @ other.normal - other.offset
        front = heights.max(axis=1) > 0
        if not front.any():
            return None
        spans.append((max(float(heights[front].min()), 0.0), float(heights.max())))
        places = own.corners[front] @ fold
        along.append((float(places.min()), float(places.max())))
    low, high = max(ends[0] for ends in along), min(ends[1] for ends in along)
    if high - low < least or min(end - begin for begin, end in spans) < least:
        return None
    return _Corner((a, b), fold, high - low, (low + high) / 2, (spans[0], spans[1]))


def _parts(scene: Scene, wavelength: float) -> list[_Part]:
    """Facets with a coherent part, joined where they lie in one plane: the largest parts.

    Without those of scattering models of installed packages: Fresnel's coefficients do not say what they reflect.
    """
    fresnel_facets = np.array([not material.scattering for material in scene.materials], bool)[scene.material]
    facet = np.flatnonzero(coherent(scene) & fresnel_facets & (scene.reflectivity > 0))
    triangles = scene.triangles[facet]
    normals, areas = normals_and_areas(triangles)
    has_area = areas > 0
    facet, triangles, normals, areas = facet[has_area], triangles[has_area], normals[has_area], areas[has_area]
    if not len(facet):
        return []
    size = float(np.linalg.norm(np.diff(box(triangles.reshape(-1, 3)), axis=0)))
    largest = np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1)
    normals = np.where((largest < 0) & scene.two_sided[facet, None], -normals, normals)
    offsets = dot(triangles[:, 0], normals)
    keys = np.rint(np.column_stack([normals / STEEP, offsets / (FLAT * size)])).astype(np.int64) + 2**14
    group = np.unique(keys @ (1 << np.array([0, 15, 30, 45])), return_inverse=True)[1]
    total = np.bincount(group, areas)
    large = np.argsort(-total, kind="stable")[:MOST_PARTS]
    parts = []
    for number in large[total[large] >= (LEAST_SIZE * wavelength) ** 2].tolist():
        own = np.flatnonzero(group == number)
        first = own[areas[own].argmax()]
        parts.append(_Part(triangles[own], areas[own], normals[first], float(offsets[first]), int(facet[first])))
    return parts


def _reflected(scene: Scene, part: _Part, sine: np.ndarray, frequency: float) -> np.ndarray:
    """Moduli of a part's coefficients of H and V at sines between it and the ray (n,), less its roughness: (2, n)."""
    material = scene.materials[scene.material[part.facet]]
    phase = 4 * np.pi * frequency / SPEED_OF_LIGHT * np.hypot(material.height, scene.roughness[part.facet]) * sine
    coefficients = np.abs(fresnel(np.clip(sine, 0, 1), np.asarray(material.permittivity(frequency))))
    return np.asarray(coefficients * np.exp(-(phase**2) / 2) * scene.reflectivity[part.facet])


def _blocked(triangles: np.ndarray, start: np.ndarray, end: np.ndarray) -> bool:
    """Whether a triangle, m (n, 3, 3), lies between two places, m (3,), but not at one of them."""
    way, sides = end - start, triangles[:, 1:] - triangles[:, :1]
    p = cross(np.broadcast_to(way, sides[:, 1].shape), sides[:, 1])
    volume = dot(p, sides[:, 0])
    step, volume = start - triangles[:, 0], np.where(volume == 0, np.inf, volume)  # inf: along the triangle
    q = cross(step, sides[:, 0])
    u, v, t = dot(p, step) / volume, q @ way / volume, dot(q, sides[:, 1]) / volume
    near = 1e-6 * float(np.abs(triangles - start).max()) / float(np.linalg.norm(way))
    return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > near) & (t < 1 - near)).any())
