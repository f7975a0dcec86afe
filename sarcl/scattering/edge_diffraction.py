"""Diffraction by the edges of conductors: what the physical theory of diffraction adds to physical optics.

A wedge has faces 1 and 2, that meet in an edge along t; N pi is the angle outside. Face 1 runs from the edge along
x_1, its outward normal is n_1, and x_1 x n_1 = t. Angles about the edge are counted from face 1; those of the
transmitter are phi' and beta', where cos beta' = d.t and d = -u_t is the direction of the incident wave.

The currents on a face are an integral over plane waves (Sommerfeld). Added up along strips in the direction of the
diffracted ray that grazes the face, sin beta' x_1 + cos beta' t, with the phase towards the receiver, they are residues
at alpha, cos alpha = -mu (Michaeli):

    mu  = [u_r.x_1 + cot beta' (u_r.t - cos beta')]/sin beta'
    c_N(x) = cot(x/(2 N))/N
    T_h = j/(k sin beta' sin alpha) [c_N(alpha - phi') + c_N(alpha + phi')]
    T_s = c_N(alpha + phi') - c_N(alpha - phi')
    K_x = eta H_t T_h
    K_t = [-j cos beta' eta H_t (2/N + j k mu sin beta' T_h) - j E_t T_s]/(k sin^2 beta')

A plane is a wedge with N = 1: physical optics of the same strips, K = 2 n x eta H j/(k sin beta' (cos phi' + mu)), has
the same form with N = 1 where the face is lit, phi' < pi. The difference, the fringe currents, scatters from a length
dl of the edge

    a = k/(2 sqrt(pi)) e_r.K dl,   |a|^2 = radar cross section, m^2

in the convention of `physical_optics`. k K does not depend on the frequency. The fringe is finite at shadow and
reflection boundaries. It has one singularity: forward scatter along a face at grazing incidence.

Where an edge scatters from its ends alone, away from the cone beta = beta', the currents at these are not complete, and
K is not reciprocal. What one antenna sends and receives is made so: HV and VH are their mean.

source   Michaeli 1986, "Elimination of infinities in equivalent edge currents, part I: fringe current components", IEEE
         Trans. Antennas Propagat. 34(7), 912-918; Knott 1985, "The relationship between Mitzner's ILDC and Michaeli's
         equivalent currents", 33(1), 112-114. The formulas above are derived in docs/theory/edges.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.vectors import cross
from .physical_optics import UP, polarisation

NEAR = (
    0.1  # rad, to a pole that all currents and those of physical optics share: their difference is a series, to 1e-12
)
LEAST_ANGLE = 1e-7  # rad, of alpha from 0: sin(alpha/N)/sin(alpha) has a limit at 0
LEAST_GRAZING = 1e-12  # rad, of alpha from pi: 1/sin(alpha) of an antenna beside the face times the field along it
IN_PLANE = 1e-14  # of n.u: a transmitter in the plane of a sheet is the mean of one above and one below
LEAST_SINE = 1e-4  # of beta': a wave along the edge is taken at this angle from it


@dataclass(frozen=True, eq=False)
class WedgeShape:
    """Shapes of wedges: arrays of one shape (...), with a last axis of 3 for vectors.

    inward   unit vectors in face 1, from the edge and at right angles to it (..., 3)
    normal   unit outward normals of face 1 (..., 3)
    number   N, the angle outside in units of pi, 1 < N <= 2 (...); 2 is the border of a sheet
    """

    inward: np.ndarray
    normal: np.ndarray
    number: np.ndarray

    @property
    def tangent(self) -> np.ndarray:
        """Unit vectors along the edges (..., 3)."""
        return cross(self.inward, self.normal)


def edge_matrix(
    wedge: WedgeShape,
    to_tx: np.ndarray,
    to_rx: np.ndarray,
    up: tuple[float, float, float] = UP,
    *,
    optics: bool = False,
) -> np.ndarray:
    """a/dl of the fringe currents of wedges, complex128 (..., 2, 2) [r, t], 0 is H and 1 is V; no unit.

    to_tx, to_rx  unit vectors (..., 3) from the edge to the antennas. A transmitter inside of the wedge: 0.
    optics        those of physical optics instead
    """
    sent = polarisation(-to_tx, up)
    received = sent if to_rx is to_tx else polarisation(-to_rx, up)
    out = np.empty((*np.broadcast_shapes(wedge.number.shape, to_tx.shape[:-1], to_rx.shape[:-1]), 2, 2), complex)
    response = _StripResponse.of(wedge, to_tx, to_rx, (0, 1) if optics else (1, -1))
    for j, field in enumerate(sent):
        current = response.current(to_tx, field)
        for i, r in enumerate(received):
            out[..., i, j] = _dot(r, current) / (2 * np.sqrt(np.pi))
    return (out + out.swapaxes(-1, -2)) / 2 if to_rx is to_tx else out  # one antenna


def fringe_current(wedge: WedgeShape, to_tx: np.ndarray, to_rx: np.ndarray, field: np.ndarray) -> np.ndarray:
    """k K of both faces, complex128 (..., 3), for an incident electric field (..., 3) of unit amplitude."""
    return _StripResponse.of(wedge, to_tx, to_rx, (1, -1)).current(to_tx, field)


def strip_current(
    wedge: WedgeShape, to_tx: np.ndarray, to_rx: np.ndarray, field: np.ndarray, *, optics: bool = False
) -> np.ndarray:
    """k K of the currents on both faces, complex128 (..., 3), all of them or those of physical optics."""
    return _StripResponse.of(wedge, to_tx, to_rx, (0, 1) if optics else (1, 0)).current(to_tx, field)


@dataclass(frozen=True, eq=False)
class _StripResponse:
    """Currents of both faces for any incident field: for each face its axes x and t (..., 3), and what multiplies H_t
    in K_x, and H_t and E_t in K_t (...)."""

    faces: tuple[tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]], ...]

    @classmethod
    def of(cls, wedge: WedgeShape, to_tx: np.ndarray, to_rx: np.ndarray, shares: tuple[int, int]) -> _StripResponse:
        """shares  of all currents, and of those of physical optics, in the sum"""
        t, n, outside = wedge.tangent, wedge.normal, np.pi * wedge.number
        other = np.cos(outside)[..., None] * wedge.inward + np.sin(outside)[..., None] * n  # x_2
        above = _dot(n, to_tx)
        angle = np.arctan2(above, _dot(wedge.inward, to_tx)) % (2 * np.pi)
        in_plane = (np.abs(above) < IN_PLANE) & (wedge.number == 2)
        is_outside, faces = angle <= outside, []
        for x, along, phi in ((wedge.inward, t, angle), (other, -t, outside - angle)):
            cosine = -_dot(to_tx, along)
            sine = np.maximum(np.sqrt(np.maximum(1 - cosine**2, 0)), LEAST_SINE)
            mu = (_dot(to_rx, x) + cosine / sine * (_dot(to_rx, along) - cosine)) / sine
            strip = sine[..., None] * x + cosine[..., None] * along
            beside = np.linalg.norm(strip - to_rx, axis=-1) / sine  # 1 - mu = beside^2/2, to the last digit
            sides = np.clip([phi, outside - phi] if in_plane.any() else [phi], 0, outside)
            each = [_factors(side, (mu, beside), cosine, sine, wedge.number, shares) for side in sides]
            factors = [np.where(in_plane, (one + other) / 2, one) for one, other in zip(each[0], each[-1], strict=True)]
            faces.append((x, along, tuple(np.where(is_outside, one, 0) for one in factors)))
        return cls(tuple(faces))

    def current(self, to_tx: np.ndarray, field: np.ndarray) -> np.ndarray:
        """k K, complex128 (..., 3), for an incident electric field (..., 3)."""
        magnetic, out = cross(-to_tx, field), np.zeros((), complex)
        for x, t, (x_h, t_h, t_e) in self.faces:
            h_t = _dot(magnetic, t)
            out = out + (x_h * h_t)[..., None] * x + (t_h * h_t + t_e * _dot(field, t))[..., None] * t
        return np.asarray(out)


def _factors(
    phi: np.ndarray,
    look: tuple[np.ndarray, np.ndarray],
    cosine: np.ndarray,
    sine: np.ndarray,
    number: np.ndarray,
    shares: tuple[int, int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What multiplies H_t in K_x, and H_t and E_t in K_t, complex128 (...), of one face.

    look    mu, and the root of 2 (1 - mu), for receivers so near to the strip that mu has no digits for them
    shares  of all currents, and of those of physical optics
    """
    mu, beside = look
    alpha = np.arccos(-mu - 0j)  # from below the cut: a wave along the strip decays
    alpha = np.where(np.abs(alpha) < LEAST_ANGLE, alpha - LEAST_ANGLE, alpha)
    grazing = np.where(mu > 0, 2 * np.arcsin(np.clip(beside / 2, LEAST_GRAZING / 2, 1)), np.pi - alpha)
    alpha = np.pi - grazing
    every, lit = shares[0], shares[1] * (phi < np.pi)
    one, two = (_poles(angle, number, every, lit) for angle in (alpha - phi, alpha + phi))
    x_h = 1j / (sine * np.sin(grazing)) * (one + two)  # sin(alpha)
    t_h = -1j * cosine * (2 * (every / number + lit) + 1j * mu * sine * x_h) / sine**2
    return x_h, t_h, 1j * (one - two) / sine**2


def _poles(angle: np.ndarray, number: np.ndarray, every: int, lit: np.ndarray) -> np.ndarray:
    """every cot(x/2N)/N + lit cot(x/2), complex128 (...): where they cancel at small x, by their series."""
    x = np.where(np.abs(angle) < LEAST_ANGLE, LEAST_ANGLE, angle)
    direct = every / (number * np.tan(x / (2 * number))) + np.where(lit != 0, lit / np.tan(x / 2), 0)
    series = sum(x**m / d * (1 - number ** -(m + 1.0)) for m, d in ((1, 6), (3, 360), (5, 15120)))
    return np.asarray(np.where((np.abs(x) < NEAR) & (every + lit == 0), series, direct))


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray((a * b).sum(axis=-1))
