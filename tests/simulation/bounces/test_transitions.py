"""Waves beside free edges between reflections: exact half-plane, physical optics twice, full waves of corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from helpers.cases import quick_of
from scipy.special import fresnel, jv

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.scattering.half_plane import FADING, transition

F = SPEED_OF_LIGHT  # Hz: wavelengths are metres
K = 2 * np.pi
PANEL = 6  # nodes of Gauss and Legendre in each


@dataclass(frozen=True)
class Plate:
    """Parallelogram of two sides, m, that begin at the fold through the origin; it reflects along a x b."""

    a: np.ndarray
    b: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        across = np.cross(self.a, self.b)
        return np.asarray(across / np.linalg.norm(across))

    @property
    def corners(self) -> np.ndarray:
        return np.array([0 * self.a, self.a, self.a + self.b, self.b])

    def nodes(self, per_wavelength: float) -> tuple[np.ndarray, np.ndarray]:
        """Places, m (n, 3), and weights, m^2 (n,)."""
        nodes, weights = np.polynomial.legendre.leggauss(PANEL)
        axes = []
        for side in (self.a, self.b):
            n = int(np.ceil(np.linalg.norm(side) * per_wavelength / PANEL))
            axes.append((((np.arange(n)[:, None] + (nodes + 1) / 2) / n).ravel(), np.tile(weights / 2 / n, n)))
        (x, wx), (y, wy) = axes
        places = x[:, None, None] * self.a + y[:, None] * self.b
        area = np.linalg.norm(np.cross(self.a, self.b))
        return places.reshape(-1, 3), (wx[:, None] * wy).ravel() * area


def corner(first: float, second: float, width: float, angle: float) -> tuple[Plate, Plate]:
    """Two plates with a fold along z, arms of `first` and `second` wavelengths, and an angle in degrees."""
    turned = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    z = np.array([0.0, 0.0, width])
    return Plate(z, np.array([first, 0.0, 0.0])), Plate(second * turned, z)


def look(azimuth: float, elevation: float) -> np.ndarray:
    return np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )  # fmt: skip


def fields(to: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """H and V of waves to or from a direction."""
    h = np.cross([0.0, 0.0, 1.0], to)
    h /= np.linalg.norm(h)
    return h, np.cross(to, h)


def physical_optics_twice(plates: tuple[Plate, Plate], to: np.ndarray, per_wavelength: float = 8) -> np.ndarray:
    """Two reflections, complex (2, 2), m: currents of either plate radiate in the near field to the other, whose
    currents radiate to the antenna. Nothing is said of edges, beams or images."""
    out = np.zeros((2, 2), complex)
    for one, other in (plates, plates[::-1]):
        (y, wy), (x, wx) = one.nodes(per_wavelength), other.nodes(per_wavelength)
        way = x[:, None] - y
        far = np.linalg.norm(way, axis=-1)
        kernel = np.exp(-1j * K * far) * (1 + 1j * K * far) / (4 * np.pi * far**3) * wy * np.exp(1j * K * (y @ to))
        moment = np.einsum("ij,ijc->ic", kernel, way)
        for sent, field in enumerate(fields(to)):
            current = 2 * np.cross(one.normal, np.cross(-to, field))
            second = 2 * np.cross(other.normal, np.cross(current, moment))
            total = (wx * np.exp(1j * K * (x @ to))) @ second
            out[:, sent] += [K / (2 * np.sqrt(np.pi)) * e @ total for e in fields(to)]
    return (out + out.T) / 2


def beams_with_transitions(plates: tuple[Plate, Plate], to: np.ndarray, per_wavelength: float = 36) -> np.ndarray:
    """Two reflections, complex (2, 2), m: the image's wave on all of the last plate, times Fresnel's integral at each
    of the three free edges of the one before; twin of the code, node by node."""
    out = np.zeros((2, 2), complex)
    for one, other in (plates, plates[::-1]):
        if min(one.normal @ to, other.normal @ (to - 2 * (to @ one.normal) * one.normal)) <= 0:
            continue
        x, w = other.nodes(per_wavelength)
        ray = -to + 2 * (to @ one.normal) * one.normal
        wave = w * (x @ one.normal > 0) * np.exp(1j * K * (x @ to - x @ ray))
        for begin, end in ((0, 1), (1, 2), (2, 3), (3, 0)):
            start, way = one.corners[begin], one.corners[end] - one.corners[begin]
            way = way / np.linalg.norm(way)
            if abs(start[:2]).max() == 0 and abs(one.corners[end][:2]).max() == 0:
                continue  # the fold
            across = x - start - ((x - start) @ way)[:, None] * way
            turned = ray - (ray @ way) * way
            detour = np.linalg.norm(turned) * np.linalg.norm(across, axis=1) - across @ turned
            inward = np.cross(way, ray) * np.sign(np.cross(way, ray) @ (one.corners.mean(axis=0) - start))
            sine, cosine = fresnel(np.sign((x - start) @ inward) * 2 * np.sqrt(np.maximum(detour, 0)))
            wave = wave * (0.5 + (0.5 + 0.5j) * (cosine - 1j * sine))
        for sent, field in enumerate(fields(to)):
            magnetic = np.cross(-to, field)
            current = 2 * np.cross(other.normal, magnetic - 2 * (magnetic @ one.normal) * one.normal)
            out[:, sent] += [K / (2 * np.sqrt(np.pi)) * wave.sum() * e @ current for e in fields(to)]
    return (out + out.T) / 2


def computed(plates: tuple[Plate, Plate], azimuth: float, elevation: float, edges: bool) -> np.ndarray:
    """What a second reflection adds, HH, HV, VH and VV."""
    quads = np.array([plate.corners for plate in plates])
    scene = sarcl.Scene.facets(quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3), two_sided=False)
    options = {"polarization": "all", "tolerance": 1e-3, "edges": edges}
    one, two = (np.ravel(sarcl.rcs(scene, azimuth, elevation, F, bounces=n, **options)) for n in (1, 2))
    return np.asarray((two - one).reshape(2, 2))


@pytest.mark.parametrize("phi", [0.6, 1.2, 2.0])
def test_the_transition_is_the_reflected_part_of_the_exact_field_of_a_half_plane(phi):
    """Sommerfeld's field as a series of Bessel functions; waves exp(j k r cos(phi - angle)) arrive."""
    angle, r, n = 0.9, 1.7, np.arange(0, 80)
    terms = np.where(n > 0, 2, 1) * np.exp(1j * n * np.pi / 4) * jv(n / 2, K * r)
    hard = (terms * np.cos(n * phi / 2) * np.cos(n * angle / 2)).sum()
    soft = (terms * np.sin(n * phi / 2) * np.sin(n * angle / 2)).sum()
    both = np.pi - phi - angle
    detour = r * (1 + np.cos(phi + angle))
    v = np.sign(both) * 2 * np.sqrt(detour)
    assert abs(v) < FADING[0]
    assert np.isclose((hard - soft) / 2, np.exp(1j * K * r * np.cos(phi + angle)) * transition(v), atol=1e-10)
    assert np.allclose(transition(np.array([FADING[1], -FADING[1]])), [1, 0], atol=1e-12)


# arms, width, angle; azimuth and elevation, rad; largest difference from physical optics twice, and by how much that
# of sharp beams is larger
CORNERS = [
    ((2.0, 2.0, 2.0, 90), (np.pi / 4, 0.0), 0.05, 5.0),
    ((3.0, 3.0, 2.0, 90), (np.pi / 4 + 0.2, 0.1), 0.1, 2.5),
    ((4.0, 8.0, 3.0, 90), (0.6, 0.2), 0.07, 5.0),
    ((2.0, 4.0, 2.0, 90), (0.6, 0.2), 0.08, 0.9),  # no better than sharp beams, and no worse
    ((3.0, 3.0, 2.0, 100), (0.8, 0.1), 0.35, 2.0),
]


@pytest.mark.parametrize(("shape", "aspect", "gate", "gain"), quick_of(CORNERS[:2], CORNERS))
def test_two_reflections_with_edges_are_physical_optics_twice(shape, aspect, gate, gain):
    plates, to = corner(*shape), look(*aspect)
    got, sharp = computed(plates, *aspect, edges=True), computed(plates, *aspect, edges=False)
    twice, twin = physical_optics_twice(plates, to), beams_with_transitions(plates, to)
    size = np.linalg.norm(twice)
    assert np.linalg.norm(got - twin) < 2e-3 * np.linalg.norm(twin)
    assert np.linalg.norm(got - twice) < gate * size
    assert np.linalg.norm(sharp - twice) > gain * np.linalg.norm(got - twice)
    assert got[0, 1] == pytest.approx(got[1, 0], abs=1e-9 * size)


@pytest.mark.parametrize(("arm", "words"), [(4.0, "6 edges"), (30.0, "left out, the scene is larger than 24 wave")])
def test_the_report_says_what_of_waves_beside_edges_is_computed(arm, words):
    quads = np.array([plate.corners for plate in corner(arm, arm, arm, 90)])
    scene = sarcl.Scene.facets(quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3), two_sided=False)
    chirp = sarcl.Waveform.chirp(center=F, bandwidth=F / 100, duration=1e-6)
    track = sarcl.Trajectory(None, 1e5 * look(0.7, 0.1)[None])
    options = {"reference": (0, 0, 0), "range_window": (-200, 200), "tolerance": 0.1}
    plan = sarcl.echo(scene, chirp, track, bounces=2, edges=True, **options).report.plan
    assert plan["waves beside edges, between reflections"].startswith(words)


def test_a_corner_of_sheets_loses_as_much_as_one_of_walls():
    """The folds of sheets are wedges on their backs, and diffract there; in the corner they are no edges."""
    x, y, z = 3 * np.eye(3)
    quads = np.array([[0 * x, a, a + b, b] for a, b in ((x, y), (y, z), (z, x))])
    triangles, amplitudes = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3), []
    for two_sided in (False, True):
        scene = sarcl.Scene.facets(triangles, two_sided=two_sided)
        options = {"polarization": ("HH", "VV"), "tolerance": 1e-2, "edges": True}
        one, three = (np.ravel(sarcl.rcs(scene, 0.8, 0.6, F, bounces=n, **options)) for n in (1, 3))
        amplitudes.append(three - one)
    assert np.allclose(*amplitudes, rtol=1e-3)
