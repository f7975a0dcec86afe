"""SARAS: errors in print, each with its effect on the numbers."""

from __future__ import annotations

import numpy as np

from ...scattering.physical_optics import scattering_matrix
from ..lab import Lab
from ..paper import Section

LOOK = np.radians(35)
A2, B2, EPS, XI = 150.0, 200.0, 0.05, 60.0  # normalised quantities of equations 28 and 29
BAND_EDGE = 1.98 * B2  # eta


def section(lab: Lab) -> Section:
    """Equations whose sign or subscript is wrong."""
    out = Section.of("saras", "errata")
    out.list()
    _conductor(out)
    _phase_of_a_facet(out)
    _transfer_function(out)
    return out


def _conductor(out: Section) -> None:
    """HV of tilted facets of a perfect conductor, with both signs of R_q, and by the vector formula."""
    rng = np.random.default_rng(0)
    normal = np.column_stack([rng.uniform(-0.4, 0.4, (100, 2)), np.ones(100)])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    sight = np.array([0, -np.sin(LOOK), np.cos(LOOK)])  # from the ground to the radar; x is the direction of flight
    cosine = normal @ sight
    rotated = np.array([0, np.cos(LOOK), np.sin(LOOK)])  # c cos D + b sin D of the Appendix: across the line of sight
    a, s = normal[:, 0], normal @ rotated
    cross = np.abs(2 * a * cosine * s / (a**2 + s**2))  # |S_HV|/|R_p + R_q|, equation A.14
    printed, right = float((cross * abs(-1 - 1) / (2 * cosine)).max()), float((cross * abs(-1 + 1)).max())
    own = scattering_matrix(normal, sight, sight, np.full(100, np.inf, complex))
    measured = float((np.abs(own[:, 0, 1]) / (2 * cosine)).max())
    out.states(
        "HV over HH of tilted facets of a perfect conductor", [printed, right, measured], abs(measured - printed) < 0.05
    )


def _phase_of_a_facet(out: Section) -> None:
    """The integral over a triangle by brute force, with the printed sign and the other one."""
    triangle = np.array([[0.0, 0, 0], [0.09, 0.01, 0], [0.02, 0.12, 0.01]])
    k = 2 * np.pi / 0.03 * np.array([0.3, -0.4, -np.sqrt(0.75)])
    n = 400
    i, j = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n, indexing="ij")
    inside = i + j < 1
    rho = (i[inside, None] * (triangle[1] - triangle[0]) + j[inside, None] * (triangle[2] - triangle[0])) - (
        triangle.mean(axis=0) - triangle[0]
    )
    sums = {sign: np.exp(sign * 2j * (rho @ k)).mean() for sign in (1, -1)}
    phases = {sign: float(np.angle(value)) for sign, value in sums.items()}
    plus, minus = phases.values()
    out.states("phase of a triangle's integral about its centroid", [plus, minus], abs(plus - minus) < 0.05)


def _transfer_function(out: Section) -> None:
    """Phase of equation 27 at the edge of the band, less that in the middle, and by a numerical transform."""
    x = np.linspace(-4, 4, 400_001)  # of a Gaussian beam, in units of its width X
    beam = np.exp(-2 * x**2)

    def transformed(eta: float) -> complex:
        return complex((beam * np.exp(-1j * (A2 * (1 + EPS * eta / (2 * B2)) * x**2 + XI * x))).sum())

    change = XI**2 / (4 * A2) * (1 / (1 + EPS * BAND_EDGE / (2 * B2)) - 1)
    measured = float(np.angle(transformed(BAND_EDGE) / transformed(0.0)))
    item = "range-azimuth coupling at the edge of the band, xi 60"
    out.number(item, measured, expected=-change, change=change)
