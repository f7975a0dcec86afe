"""SARAS: errors in print, each with its effect on the numbers."""

from __future__ import annotations

import numpy as np

from ...figures import html
from ...scattering.physical_optics import scattering_matrix
from ..lab import Lab
from ..paper import Section

LOOK = np.radians(35)
A2, B2, EPS, XI = 150.0, 200.0, 0.05, 60.0  # normalised quantities of equations 28 and 29
BAND_EDGE = 1.98 * B2  # eta


def section(lab: Lab) -> Section:
    """Equations whose sign or subscript is wrong."""
    out = Section("errata", "Errors in print")
    out.parts.append(html.listed((
        "Equation A.7: R_q is damaged, and has the wrong sign for A.13 to A.15. With R_p = (cos d - q)/(cos d + q), "
        "R_q = (eps cos d - q)/(eps cos d + q), q = sqrt(eps - sin^2 d), a perfect conductor has no HV, as it must.",
        "Equation A.15 is S_VV; it is printed as S_VH. Equation A.12 has k x x where A.9 and A.10 use x x k, which "
        "changes the sign of HV.",
        "Equations A.1 and A.8 need the unit normal that points out of the ground, and cos d = -n.k.",
        "Equations 2, 3 and 8 to 10: the phase of a point rho of a facet is exp(-2j k.rho), with k along the "
        "propagation. A rectangle about its centre does not show the difference; a triangle does.",
        "Equations 27, 34 and 36: both azimuth terms have the wrong sign. The stationary phase of equation 22 gives "
        "G ~ exp(-j eta^2/4b^2 + j [chi xi + xi^2 (1 + beta r)/(4 a^2 (1 + eps eta/2b^2))]), so that "
        "eta' = eta - beta xi^2/4a^2.",
        "Equation 22 contains only the change of range; the reflectivity therefore has the factor "
        "exp(-j 4 pi (R0 + r)/lambda).",
    )))  # fmt: skip
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
        "HV over HH of tilted facets of a perfect conductor", "equations A.7 and A.14",
        f"up to {printed:.2f} with R_q as printed", f"{right:g} with the other sign; {measured:.1g} in sarcl",
        abs(measured - printed) < 0.05,
        "R_q has the wrong sign; the physical-optics integral of a conductor does not depend on polarisation",
        [printed, right, measured], rule="the same within 0.05", cause="error in print",
    )  # fmt: skip


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
    out.states(
        "phase of a triangle's integral about its centroid", "equation 3", f"{phases[1]:.2f} rad with exp(+2j k.rho)",
        f"{phases[-1]:.2f} rad with exp(-2j k.rho), the two-way delay of each point",
        abs(phases[1] - phases[-1]) < 0.05, "the sign of the exponent is wrong", list(phases.values()),
        rule="the same phase within 0.05 rad", cause="error in print",
    )  # fmt: skip


def _transfer_function(out: Section) -> None:
    """Phase of equation 27 at the edge of the band, less that in the middle, and by a numerical transform."""
    x = np.linspace(-4, 4, 400_001)  # of a Gaussian beam, in units of its width X
    beam = np.exp(-2 * x**2)

    def transformed(eta: float) -> complex:
        return complex((beam * np.exp(-1j * (A2 * (1 + EPS * eta / (2 * B2)) * x**2 + XI * x))).sum())

    measured = float(np.angle(transformed(BAND_EDGE) / transformed(0.0)))
    change = XI**2 / (4 * A2) * (1 / (1 + EPS * BAND_EDGE / (2 * B2)) - 1)
    item = "range-azimuth coupling at the edge of the band, xi 60"
    why = f"both azimuth terms have the wrong sign; with the other one {change:.3f} rad"
    out.number(item, "equation 27", -change, measured, 0.02, "rad", why=why, cause="error in print")
