"""Echoes of materials whose permittivity is close to 1, such as foams, within their tolerance."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest

import sarcl
from sarcl.scattering.physical_optics import fresnel

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
TRIANGLE = np.array([[[-0.01, -0.01, 0], [0.02, -0.01, 0], [-0.01, 0.02, 0.0]]])


@pytest.mark.parametrize("contrast", [2.0**-12, 2.0**-30, 2.0**-50])
@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.125])
def test_fresnels_coefficients_keep_their_digits_beside_vacuum(cosine, contrast):
    """With 60 digits by the differences of SARAS (A.7), of which float64 leaves no digit at a contrast of 2^-50."""
    with localcontext(prec=60):
        c, eps = Decimal(cosine), 1 + Decimal(contrast)
        root = (eps - 1 + c * c).sqrt()
        wanted = float((c - root) / (c + root)), float((eps * c - root) / (eps * c + root))
    np.testing.assert_allclose(np.real(fresnel(cosine, 1 + contrast)), wanted, rtol=1e-12)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
@pytest.mark.parametrize("eps", [1.003, 1.0001, 1.00001])
def test_a_facet_at_normal_incidence_sends_back_fresnels_share_of_a_conductors_echo(eps, tolerance):
    """1/sqrt(eps) in float32 left errors of 1.4e-5, 2.4e-4 and 1.4e-3, whatever the tolerance was."""
    track = sarcl.Trajectory([0.0], [[0, 0, 2e4]])

    def echo(material, tolerance):
        scene = sarcl.Scene.facets(TRIANGLE, material=material, two_sided=False)
        return sarcl.echo(scene, CHIRP, track, tolerance=tolerance, check=False)

    metal, raw = echo(sarcl.Material(), 1e-5), echo(sarcl.Material(eps), tolerance)
    share = (eps - 1) / (np.sqrt(eps) + 1) ** 2
    wanted = share * np.abs(np.asarray(metal.samples, complex))
    error = np.linalg.norm(np.abs(np.asarray(raw.samples, complex)) - wanted) / np.linalg.norm(wanted)
    assert raw.report.predicted_error <= tolerance
    assert error <= raw.report.predicted_error + metal.report.predicted_error
