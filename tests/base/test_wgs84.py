"""WGS84: positions to longitude, latitude and height and back, against extended precision and pyproj."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl import wgs84

L = np.longdouble
A, F = L(6378137), 1 / L("298.257223563")
E2 = F * (2 - F)
DEGREE = np.arctan(L(1)) / 45
TOLERANCE = {
    "height": 1e-9,  # m: the rounding of positions near the Earth
    "position": 5e-9,  # m: the rounding of degrees beyond 128 degrees alone is 1.6e-9 m on the ground
    "far": 1e-15,  # of the distance
}


def position(longitude, latitude, height):
    """The closed form in extended precision."""
    lon, lat, h = (np.asarray(v, L) for v in (longitude, latitude, height))
    s, c = np.sin(lat * DEGREE), np.cos(lat * DEGREE)
    normal = A / np.sqrt(1 - E2 * s * s)
    across = (normal + h) * c
    return np.stack([across * np.cos(lon * DEGREE), across * np.sin(lon * DEGREE), (normal * (1 - E2) + h) * s], -1)


def somewhere(low, high, n=20_000):
    random = np.random.default_rng(1)
    d = random.normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1)[:, None] * random.uniform(low, high, (n, 1))


@pytest.mark.parametrize("low, high", [(1.0, 1e5), (1e5, 6.3e6), (6.3e6, 7.5e6), (7.5e6, 1e8)])
def test_positions_come_back_from_the_centre_to_far_out(low, high):
    x = somewhere(low, high)
    off = np.linalg.norm(position(*wgs84.geodetic(x)) - x, axis=1)
    assert (off <= TOLERANCE["position"] + TOLERANCE["far"] * np.linalg.norm(x, axis=1)).all()


def test_heights_are_exact_to_the_rounding_of_the_position():
    random = np.random.default_rng(2)
    lon, lat, h = random.uniform(-180, 180, 20_000), random.uniform(-90, 90, 20_000), random.uniform(-5e3, 9e5, 20_000)
    assert np.abs(wgs84.geodetic(position(lon, lat, h).astype(float))[2] - h).max() <= TOLERANCE["height"]


def test_heights_are_the_distance_to_the_nearest_point_of_the_ellipsoid():
    """Also inside the evolute, where several normals of the ellipsoid meet."""
    latitude = np.radians(np.linspace(-90, 90, 200_001))
    disc = np.stack([np.cos(latitude), np.sin(latitude)]) * 6378137 / np.sqrt(1 - float(E2) * np.sin(latitude) ** 2)
    disc[1] *= 1 - float(E2)
    for x in ([10.0, 0, 3], [4e4, 0, 100], [1e3, 2e3, -4e4], [5e6, 0, 1e5], [0, 0, 1.0], [3e4, 0, 0]):
        nearest = np.hypot(disc[0] - np.hypot(x[0], x[1]), disc[1] - x[2]).min()
        assert -wgs84.geodetic(x)[2] == pytest.approx(nearest, abs=1e-3)


def test_poles_the_centre_and_the_antimeridian():
    b = 6356752.314245179
    for x, wanted in (
        ([0, 0, b + 7], (0, 90, 7)), ([0, 0, -b], (0, -90, 0)), ([0, 0, 0], (0, 90, -b)),
        ([-6378137.0, 0, 0], (180, 0, 0)), ([0, -6378137 - 1e3, 0], (-90, 0, 1e3)),
    ):  # fmt: skip
        assert wgs84.geodetic(x) == pytest.approx(wanted, abs=2e-9)
    west = wgs84.ecef(-179.9999999, 10.0, 5.0)
    assert wgs84.geodetic(west)[0] == pytest.approx(-179.9999999, abs=1e-12)


def test_pyproj_agrees():
    """Its forward formula is exact anywhere, its inverse a single iteration that is exact near the ground alone."""
    pyproj = pytest.importorskip("pyproj", reason="no pyproj")
    back = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    x = somewhere(6.35e6, 8e6)
    assert np.abs(np.stack(back.transform(*wgs84.geodetic(x)), -1) - x).max() <= 2 * TOLERANCE["position"]
    random = np.random.default_rng(3)
    lon, lat, h = random.uniform(-180, 180, 9999), random.uniform(-90, 90, 9999), random.uniform(-500, 9e3, 9999)
    ground = wgs84.ecef(lon, lat, h)
    there = back.transform(*ground.T, direction="INVERSE")
    for ours, theirs, tolerance in zip(wgs84.geodetic(ground), there, (1e-11, 1e-11, 1e-6), strict=True):  # degrees, m
        assert np.abs(ours - theirs).max() <= tolerance


def test_any_shape_and_a_single_position():
    x = somewhere(6.3e6, 7e6, 6).reshape(2, 3, 3)
    assert [v.shape for v in wgs84.geodetic(x)] == [(2, 3)] * 3
    assert wgs84.geodetic(x[1, 2]) == tuple(v[1, 2] for v in wgs84.geodetic(x))
