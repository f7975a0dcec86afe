"""Waves that one border of a flat face of a conductor sends along the face, and another border diffracts.

Borders 1 and 2 run along t_i = x_i x n, x_i in the face and away from the border, n the face's outward normal; the
wedges behind them have the angles N_i pi. The wave runs along the unit vector g in the face over a length L, with its
electric field across the face; g_1 = g, g_2 = -g. For the antenna of border i, along u_i at an angle phi_i about the
border, from the face, Keller's coefficient for waves along the face is, but for what is common to all N,

    f_i = (2/N_i) sin(pi/N_i) cos(phi_i/2)/[cos(phi_i/N_i) - cos(pi/N_i)],   1 for sheets and at phi_i = pi

Where the wave goes nearly straight on, near the plane of the face, it is no ray. With the phase a_i^2 of the detour
over the border, and W(a) = exp(j a^2) erfc(a exp(j pi/4)),

    a_i^2 = k L (1 + g_i.u_i),   r_i = sqrt(2 k L sin beta_i g_i.x_i) cos(phi_i/2)/a_i,   |r_i| <= 1
    a/dc = j f_1 f_2 r_1 r_2 sqrt(k L) (h_1.t_1) (h_2.t_2)/[sqrt(2 pi) (g.x) cos^2(gamma/2)]
           [a_2 W(a_1) - a_1 W(a_2)]/(a_2^2 - a_1^2) exp(-j k L)

h_i is the magnetic field of a unit wave from the antenna, beta_i the angle between u_i and t_i, gamma that between both
borders, x and t their bisectors, c the mean of both places along t. exp(-j k L) belongs to the path and is not in what
follows. Exchanging transmitter and receiver changes nothing. All is finite, at L = 0 too, but for forward scatter along
the face. On the cone of diffracted rays r_i is the sign of cos(phi_i/2). Waves with the electric field along the face
are weaker by 1/(k L) and left out.

source   derived in docs/theory/edges.md; for parallel edges at right angles, far from grazing, the product of two of
         Keller's coefficients (Keller 1962, J. Opt. Soc. Am. 52, 116-130).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.vectors import cross, dot
from .physical_optics import UP, polarisation

BESIDE_PLANE = 1e-5  # rad, of phi from pi, where a quotient has its limit
ALIKE = 1e-4  # relative difference of two arguments, below which a quotient is a derivative: to 1e-8
TINY = 1e-30  # of a difference between directions, squared
LEAST = 1e-6  # of a: both are 0 in forward scatter along the face


@dataclass(frozen=True, eq=False)
class FaceBorders:
    """Pairs of borders of faces: arrays (...), with a last axis of 3 for vectors.

    inward   unit vectors in the face, away from border 1 and from border 2, at right angles to them: two (..., 3)
    normal   outward unit normals of the faces (..., 3);  number  N of both wedges: two (...)
    """

    inward: tuple[np.ndarray, np.ndarray]
    normal: np.ndarray
    number: tuple[np.ndarray, np.ndarray]

    def chosen(self, rows: np.ndarray) -> FaceBorders:
        """Some of them."""
        (x, y), (n, m) = self.inward, self.number
        return FaceBorders((x[rows], y[rows]), self.normal[rows], (n[rows], m[rows]))


def double_matrix(
    borders: FaceBorders,
    to_tx: np.ndarray,
    to_rx: np.ndarray,
    ray: np.ndarray,
    phase: np.ndarray,
    up: tuple[float, float, float] = UP,
) -> np.ndarray:
    """a/dc without its phase, complex128 (..., 2, 2, m) [r, t], 0 is H and 1 is V; no unit.

    to_tx, to_rx  unit vectors (..., 3), from border 1 to the transmitter and from border 2 to the receiver
    ray           unit vectors (..., 3) in the face, from border 1 to border 2
    phase         k L (..., m) of rays, at m frequencies
    An antenna inside of its wedge: 0.
    """
    fields, arguments, factor = [], [], np.ones(())
    for x, number, to, way in zip(borders.inward, borders.number, (to_tx, to_rx), (ray, -ray), strict=True):
        t, n = cross(x, borders.normal), borders.normal
        fields.append([dot(cross(-to, e), t) for e in polarisation(-to, up)])
        phi = np.arctan2(dot(n, to), dot(x, to)) % (2 * np.pi)
        detour = np.maximum(dot(way + to, way + to) / 2, TINY)  # 1 + way.to
        sine = np.sqrt(np.maximum(1 - dot(to, t) ** 2, 0))
        factor = factor * np.where(phi <= np.pi * number, _keller(phi, number), 0)
        share = np.sqrt(2 * sine * np.maximum(dot(way, x), 0) / detour) * np.cos(phi / 2)
        factor = factor * np.clip(share, -1, 1)
        arguments.append(np.sqrt(phase * detour[..., None]))
    x1, x2 = borders.inward
    bisector = np.sqrt((1 - dot(x1, x2)) / 2)  # cos(gamma/2)
    across = dot(ray, x1 - x2) / (2 * bisector)
    scale = 1j * factor / (np.sqrt(2 * np.pi) * across * bisector**2)
    waves = scale[..., None] * np.sqrt(phase) * _transition(*arguments)
    sent, received = (np.stack(one, axis=-1) for one in fields)
    return np.asarray(received[..., :, None, None] * sent[..., None, :, None] * waves[..., None, None, :])


def _keller(phi: np.ndarray, number: np.ndarray) -> np.ndarray:
    """f of an antenna at an angle phi about a border, from the face (...)."""
    gap = np.cos(phi / number) - np.cos(np.pi / number)
    beside = (np.abs(phi - np.pi) < BESIDE_PLANE) | (gap == 0)
    return np.where(beside, 1.0, 2 / number * np.sin(np.pi / number) * np.cos(phi / 2) / np.where(beside, 1, gap))


def _transition(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """[b W(a) - a W(b)]/(b^2 - a^2), complex128 (...), of a, b >= 0."""
    from scipy.special import wofz

    a, b = np.maximum(one, LEAST), np.maximum(other, LEAST)
    alike = np.abs(a - b) < ALIKE * (a + b)
    turn, mean = np.exp(0.75j * np.pi), (a + b)[alike] / 2  # W(a) = w(a exp(3 j pi/4)), w of Faddeeva
    out = (b * wofz(turn * a) - a * wofz(turn * b)) / np.where(alike, 1, b**2 - a**2)
    w = wofz(turn * mean)
    slope = turn * (-2 * turn * mean * w + 2j / np.sqrt(np.pi))  # dW/da; the quotient is -(W/a)' a/2
    out[alike] = (w / mean - slope) / 2
    return np.asarray(out)
