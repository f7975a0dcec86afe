"""Look angles and arcs on the ellipsoid, against geometry made another way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from sarcl.base import wgs84
from sarcl.earth.viewing import ground_range, view

A, F = 6378137.0, 1 / 298.257223563  # WGS 84
E2 = F * (2 - F)


@pytest.mark.parametrize("latitude", [-0.7, 0.0, 0.3, 0.8, 1.5])
def test_look_angles_count_from_the_ellipsoid_s_normal(latitude):
    """A point straight below along the normal is seen at 0; the centre of the Earth lies up to 3.4 mrad beside it."""
    above, below, beside = (
        wgs84.ecef(*np.degrees((0.4, lat)), height)
        for lat, height in ((latitude, 700e3), (latitude, 0.0), (latitude - 0.05, 0.0))
    )
    still = np.zeros(3)
    seen = view(above, np.array([0.0, 7e3, 0.0]), still, below)
    assert seen.look < 1e-9 and seen.incidence < 1e-9
    seen = view(above, np.array([0.0, 7e3, 0.0]), still, beside)
    normal = np.array([np.cos(latitude) * np.cos(0.4), np.cos(latitude) * np.sin(0.4), np.sin(latitude)])
    path = (beside - above) / np.linalg.norm(beside - above)
    assert seen.look == pytest.approx(np.arccos(-normal @ path), abs=1e-9)


@pytest.mark.parametrize(("first", "last"), [(0.0, 0.2), (0.6, 0.75), (-0.9, -0.6), (1.4, 1.55)])
def test_arcs_along_a_meridian_have_the_length_of_the_ellipse(first, last):
    wanted, _ = quad(lambda lat: A * (1 - E2) / (1 - E2 * np.sin(lat) ** 2) ** 1.5, first, last, epsabs=1e-7)
    ends = (wgs84.ecef(*np.degrees((2.0, lat)), height) for lat, height in ((first, 600e3), (last, 200.0)))
    assert ground_range(*ends) == pytest.approx(wanted, abs=1e-3)
