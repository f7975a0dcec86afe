"""Targets in a plane whose currents are known for every direction of travel, and the echoes that anchors form of them.

Currents at a cell depend on the direction by other paths than the direct one: scattering among points, two walls by
images, the series of a conducting cylinder with its creeping waves, edges that light a wedge.
Lengths in wavelengths of the middle frequency; a target has cells `y` (n, 2), and currents(k, d) (n, P) for directions
of travel d (P, 2).
"""

from __future__ import annotations

import numpy as np
from scipy.special import expit, h2vp, hankel2

PER_WAVELENGTH = 10


def unit(angle):
    return np.stack([np.cos(angle), np.sin(angle)], -1)


def steps(length):
    """Middles of cells along a line."""
    n = int(PER_WAVELENGTH * length)
    return (np.arange(n) + 0.5) / n * length


def direct(k, y, d):
    return np.exp(-1j * k * (y @ d.T))


class Points:
    """Points that scatter among themselves, in all orders (Foldy and Lax)."""

    def __init__(self, rng, size):
        n = int(rng.integers(2, 50))
        self.y = rng.uniform(-1, 1, (n, 2)) * [size, size * rng.uniform(0.2, 1)]
        self.strength = rng.uniform(0.3, 1, n) * np.exp(2j * np.pi * rng.uniform(size=n))
        self.coupling = rng.uniform(0.02, 0.5)

    def currents(self, k, d):
        r = np.linalg.norm(self.y[:, None] - self.y, axis=2) + np.eye(len(self.y))
        between = self.coupling * np.exp(-1j * k * r) / np.maximum(r, 0.3) * self.strength[:, None]
        between *= (1 - np.eye(len(r))) * 2 / np.sqrt(len(r))
        between *= min(1, 0.8 / np.abs(np.linalg.eigvals(between)).max())  # no resonance without loss
        return np.linalg.solve(np.eye(len(r)) - between, self.strength[:, None] * direct(k, self.y, d))


class Dihedral:
    """Two walls at a right angle: each is lit directly and by the image of the wave in the other."""

    def __init__(self, rng, size):
        self.length, self.walls = size * np.sqrt(2), unit(rng.uniform(-0.3, 0.3) + np.pi / 4 * np.array([1, -1]))
        self.corner = -self.length / 4 * self.walls.sum(axis=0)
        self.along = steps(self.length)
        self.y = self.corner + np.concatenate([self.along[:, None] * wall for wall in self.walls])

    def currents(self, k, d):
        out = []
        for wall, normal in (self.walls, self.walls[::-1]):
            y = self.corner + self.along[:, None] * wall
            image = d - 2 * (d @ wall)[:, None] * wall
            edge = self.length * np.abs((d @ wall) / (d @ normal))  # where the image's light ends, not abruptly
            lit = expit((edge - self.along[:, None]) / (0.25 / np.sqrt(self.length)))
            reflected = np.exp(-1j * k * (self.corner @ d.T + (y - self.corner) @ image.T))
            out.append(-2 * (d @ normal) * (direct(k, y, d) - lit * reflected))
        return np.concatenate(out)


class Cylinder:
    """A conducting cylinder: the exact series of its current."""

    def __init__(self, rng, size):
        self.radius, self.parallel = size, rng.integers(2)
        self.angle = steps(2 * np.pi * size) / size
        self.y = size * unit(self.angle)

    def currents(self, k, d):
        x = k * self.radius
        m = np.arange(-int(x + 6 * x ** (1 / 3) + 6), int(x + 6 * x ** (1 / 3) + 7))
        term = np.exp(-0.5j * np.pi * m) / (hankel2(m, x) if self.parallel else h2vp(m, x))
        turns = np.exp(-1j * np.outer(m, np.arctan2(d[:, 1], d[:, 0])))
        return np.exp(1j * np.outer(self.angle, m)) @ (term[:, None] * turns)


class Wedge:
    """The outline of a cone: light on its sides and its base, and waves from its tip and its rims."""

    def __init__(self, rng, size):
        half = size * rng.uniform(0.2, 1)
        self.edges = np.array([[-size, 0], [size, half], [size, -half]])
        sides, normals = [], []
        for start, end in ((0, 1), (2, 0), (1, 2)):
            way = self.edges[end] - self.edges[start]
            length = np.linalg.norm(way)
            sides.append(self.edges[start] + steps(length)[:, None] * way / length)
            normals.append(np.tile([-way[1], way[0]] / length, (len(sides[-1]), 1)))
        self.y, self.normal = np.concatenate(sides), np.concatenate(normals)
        self.weight, self.soft = rng.uniform(0.2, 1, 3), 0.3 / np.sqrt(2 * np.pi * size)

    def currents(self, k, d):
        out = self.soft * np.logaddexp(0, -2 * (self.normal @ d.T) / self.soft) * direct(k, self.y, d)
        for edge, weight in zip(self.edges, self.weight, strict=True):
            r = np.linalg.norm(self.y - edge, axis=1)
            out += (weight * np.exp(-1j * k * r) / np.sqrt(1 + k * r))[:, None] * np.exp(-1j * k * (d @ edge))
        return out


TARGETS = (Points, Dihedral, Cylinder, Wedge)


def case(seed, largest=14.0, n_pulses=121):
    """A random target over 10 to 29 degrees: directions (P,), echoes (P anchors, P, 1, F), echoes of own runs."""
    rng = np.random.default_rng(seed)
    kind = TARGETS[rng.integers(len(TARGETS))]
    target = kind(rng, np.exp(rng.uniform(np.log(1.5), np.log(largest))))
    middle = np.pi + rng.uniform(-0.3, 0.3) if kind is Dihedral else rng.uniform(0, 2 * np.pi)
    along = np.linspace(-0.5, 0.5, n_pulses) * np.deg2rad(19.2) * np.exp(rng.uniform(np.log(0.5), np.log(1.5)))
    d, k = unit(middle + along), 2 * np.pi * np.linspace(0.85, 1.15, 4)
    formed = np.empty((n_pulses, n_pulses, 1, len(k)), np.complex64)
    for f, wavenumber in enumerate(k):
        path = direct(wavenumber, target.y, d)
        formed[:, :, 0, f] = (target.currents(wavenumber, d) / path).T @ path**2
    own = formed[np.arange(n_pulses), np.arange(n_pulses)]
    return kind.__name__, along, formed, own
