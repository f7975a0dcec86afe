"""Surfaces, materials, viewpoints and phases that the facet tests share."""

from __future__ import annotations

import numpy as np

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference import facet
from sarcl.scene.material import Material

CONDUCTOR = complex(np.inf)
UP = np.array([0.0, 0.0, 1.0])
WET = Material(eps_r=6.0, conductivity=0.5)


def random_units(random, n):
    x = random.standard_normal((n, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def facing(random, n):
    """Normals and directions to two antennas, all lit and none within 3 deg of grazing or of straight up."""
    normal, u, r = (random_units(random, n) for _ in range(3))
    u *= np.sign((normal * u).sum(axis=1))[:, None]
    r *= np.sign((normal * r).sum(axis=1))[:, None]
    return normal, u, r


def plate(side, tilt=0.0):
    """A square as two triangles, m (2, 3, 3), facing z, then turned about y."""
    x, y = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]).T * side / 2
    corners = np.stack([x * np.cos(tilt), y, -x * np.sin(tilt)], axis=1)
    return corners[[[0, 1, 2], [0, 2, 3]]]


def quarters(triangles):
    """Every triangle cut into four at the middles of its edges."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(p, axis=1) for p in parts])


def far_amplitude(triangles, permittivity, frequency, u, r=None):
    """Amplitude of a surface in plane waves, about the origin, (2, 2)."""
    r = u if r is None else r
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    turned = np.exp(1j * k * (triangles.mean(axis=1) @ (u + r)))
    return (facet.facet_amplitude(triangles, permittivity, frequency, u, r) * turned[:, None, None]).sum(axis=0)


def echo_and_integral(scene, waveform, tx, rx, vertical, **options):
    """First and last sample of the only row of each polarisation, by `sarcl.echo` and by the float64 reference.

    tx, rx  m (3,);  returns two arrays (2 samples, 2, 2)
    """
    raw = sarcl.echo(
        scene, waveform, still(tx), receiver=still(rx), polarization="all", check=False, vertical=vertical, **options
    )
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)[[0, -1]]
    eps = np.array([[m.permittivity(v) for m in scene.materials] for v in f])[:, scene.material]
    wanted = facet.facet_echo(scene.triangles, eps, f, tx, rx, raw.reference_range[0], up=vertical)
    return raw.samples[:, [0, -1]].T.reshape(2, 2, 2), wanted


def adversarial_phases(random):
    """Phases (n, 2), rad: zero, equal, opposite, nearly so, tiny, huge, and both sides of the switch to the series."""
    corner = [0.0, 1e-300, 1e-9, 1e-3, 0.25, 0.5, 0.5 + 1e-12, 1.0, np.pi, 2 * np.pi, 100.0, 1e4, -1e-9, -0.5, -1e4]
    grid = np.stack(np.meshgrid(corner, corner), axis=-1).reshape(-1, 2)
    log = 10.0 ** random.uniform(-12, 4, (200, 2)) * random.choice([-1, 1], (200, 2))
    needle = 10.0 ** random.uniform(-3, 4, 200)
    needle = np.stack([needle, needle * (1 + 10.0 ** random.uniform(-16, -1, 200))], axis=1)
    return np.concatenate([grid, log, needle, random.uniform(-0.6, 0.6, (200, 2))])


def seen_from(distance, elevation, azimuth=0.0):
    """A viewpoint so many rad off the vertical, m (3,)."""
    side = np.sin(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), 0])
    return distance * (side + np.array([0, 0, np.cos(elevation)]))


def still(*places):
    return sarcl.Trajectory(np.arange(len(places)) / 100.0, np.array(places))
