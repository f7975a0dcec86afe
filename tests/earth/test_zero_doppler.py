"""Zero-Doppler geometry: closed forms, the grid of a measured product, round trips, and what cannot be seen."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import sarcl
from sarcl.earth import viewing, zero_doppler
from sarcl.earth.state_vectors import StateVectors

C = 299_792_458.0
SENTINEL = "orbits/s1b-iw-grd-vv-20211223t051122-20211223t051147-030148-039993-001.xml"
TOLERANCE = {
    "azimuth": 0.02,  # m: azimuth times of the product are rounded to 1e-6 s, 7 mm
    "range": 0.002,  # m
    "round trip": 1e-6,  # m
    "angle": 1e-7,  # degrees
}
POLAR = sarcl.Orbit.kepler(7.07e6, 0.001, 1.71, span=(-3000, 3000))


@pytest.fixture(scope="module")
def product(data_folder):
    """The orbit of a product, and its grid: times, s, ranges, m, positions, and the other fields, degrees and m."""
    orbit = sarcl.Orbit.read(data_folder / SENTINEL)
    points = list(ElementTree.parse(data_folder / SENTINEL).iter("geolocationGridPoint"))
    field = {
        name: np.array([float(p.findtext(name)) for p in points])
        for name in ("slantRangeTime", "latitude", "longitude", "height", "incidenceAngle", "elevationAngle")
    }
    assert len(points) == 210
    t = orbit.seconds([p.findtext("azimuthTime") for p in points])
    return orbit, t, field["slantRangeTime"] * C / 2, field


def test_the_grid_of_a_sentinel_1_product_is_located(product):
    orbit, t, r, field = product
    found = orbit.locate(sarcl.wgs84.ecef(field["longitude"], field["latitude"], field["height"]))
    speed = np.linalg.norm(orbit.velocities(t), axis=1)
    assert (np.abs(found[0] - t) * speed).max() < TOLERANCE["azimuth"]
    assert np.abs(found[1] - r).max() < TOLERANCE["range"]


def test_the_grid_of_a_sentinel_1_product_is_geolocated(product):
    orbit, t, r, field = product
    wanted = sarcl.wgs84.ecef(field["longitude"], field["latitude"], field["height"])
    assert np.linalg.norm(orbit.geolocate(t, r, field["height"]) - wanted, axis=1).max() < TOLERANCE["azimuth"]
    assert np.linalg.norm(orbit.geolocate(t, r, field["height"], side="left") - wanted, axis=1).min() > 1e5


def test_angles_are_those_of_a_sentinel_1_product(product):
    """The product counts both angles from the direction to the Earth's centre, not from the ellipsoid's normal."""
    orbit, t, _, field = product
    x = sarcl.wgs84.ecef(field["longitude"], field["latitude"], field["height"])
    p, seen = orbit.positions(t), orbit.view(t, x)
    towards = (x - p) / np.linalg.norm(x - p, axis=1)[:, None]
    for given, at, sign, ours in (
        ("incidenceAngle", x, -1, seen.incidence), ("elevationAngle", p, -1, seen.look),
    ):  # fmt: skip
        outwards = at / np.linalg.norm(at, axis=1)[:, None]
        centric = np.degrees(np.arccos(sign * (towards * outwards).sum(axis=1)))
        assert np.abs(centric - field[given]).max() < TOLERANCE["angle"]
        assert np.abs(np.degrees(ours) - field[given]).max() < 0.2  # the normal is at most 0.19 degrees off
    assert np.abs(seen.squint).max() < 1e-6 and np.abs(seen.doppler(5.405e9)).max() < 5e-3  # Hz: 1e-6 s


# closed forms: a satellite that stands over the pole of an Earth that is nearly a sphere there, moving along x


def test_geolocation_meets_the_law_of_cosines_on_a_sphere(monkeypatch):
    radius, height = 6_378_137.0, 700e3
    for name, value in (("FLATTENING", 0.0), ("ECCENTRICITY_SQUARED", 0.0)):
        monkeypatch.setattr(sarcl.wgs84, name, value)
    p, v = np.array([[radius + height, 0, 0]]), np.array([[0.0, 7500, 0]])
    for angle in (0.05, 0.1, 0.3):  # at the Earth's centre
        r = np.sqrt((radius + height) ** 2 + radius**2 - 2 * (radius + height) * radius * np.cos(angle))
        right = zero_doppler.geolocate(p, v, np.array([r]), np.zeros(1), 1.0)[0]
        assert right == pytest.approx([radius * np.cos(angle), 0, -radius * np.sin(angle)], abs=1e-7)
        left = zero_doppler.geolocate(p, v, np.array([r]), np.zeros(1), -1.0)[0]
        assert left == pytest.approx([radius * np.cos(angle), 0, radius * np.sin(angle)], abs=1e-7)
        seen = viewing.view(p[0], v[0], np.array([-8.0, 0, 0]), right)
        look = np.arcsin(radius * np.sin(angle) / r)
        assert seen.look == pytest.approx(look, abs=1e-12) and seen.incidence == pytest.approx(look + angle, abs=1e-12)
        assert seen.ground_range == pytest.approx(radius * angle, abs=1e-6)
        assert seen.range_acceleration == pytest.approx(7500**2 / r - 8 * np.cos(look), rel=1e-12)


def test_a_located_position_is_where_the_distance_is_least():
    x = POLAR.geolocate([-500.0, 321.0], [8.5e5, 9e5], side="right")
    t, r = POLAR.locate(x)
    for i in range(2):
        least = minimize_scalar(
            lambda s, i=i: np.linalg.norm(POLAR.positions(s) - x[i]), bounds=(t[i] - 50, t[i] + 50), method="bounded"
        )
        assert least.x == pytest.approx(t[i], abs=1e-3) and least.fun == pytest.approx(r[i], abs=1e-6)


def test_doppler_frequencies_are_derivatives_of_the_range():
    x = POLAR.geolocate(0.0, 8.5e5)
    t = np.linspace(-2, 2, 9)
    step = 0.05
    seen = POLAR.view(t, x)
    distance = [np.linalg.norm(POLAR.positions(t + d) - x, axis=1) for d in (-step, 0, step)]
    rate, acceleration = (
        (distance[2] - distance[0]) / (2 * step),
        (distance[2] - 2 * distance[1] + distance[0]) / step**2,
    )
    assert seen.range_rate == pytest.approx(rate, abs=2e-5)
    assert seen.range_acceleration == pytest.approx(acceleration, rel=1e-5)
    assert seen.doppler(5.4e9) == pytest.approx(-2 * 5.4e9 / C * rate, abs=1e-3)
    assert seen.squint == pytest.approx(np.arcsin(-rate / np.linalg.norm(POLAR.velocities(t), axis=1)), abs=3e-9)


def test_ground_range_is_the_length_of_the_geodesic():
    pyproj = pytest.importorskip("pyproj", reason="no pyproj")
    r = np.linspace(7.3e5, 1.5e6, 9)
    x, p = POLAR.geolocate(100.0, r), POLAR.positions(100.0)
    lon, lat, _ = sarcl.wgs84.geodetic(x)
    below = [np.full(9, v) for v in sarcl.wgs84.geodetic(p)[:2]]
    _, _, wanted = pyproj.Geod(ellps="WGS84").inv(*below, lon, lat)
    assert np.abs(POLAR.view(100.0, x).ground_range - wanted).max() < 2e-2


# round trips, the poles and the antimeridian


@pytest.mark.parametrize("side", ["right", "left"])
def test_what_is_geolocated_is_located_again(side):
    random = np.random.default_rng(5)
    t, r, h = random.uniform(-2900, 2900, 400), random.uniform(7.3e5, 1.4e6, 400), random.uniform(-400, 9000, 400)
    x = POLAR.geolocate(t, r, h, side=side)
    assert np.isfinite(x).all() and np.abs(sarcl.wgs84.geodetic(x)[2] - h).max() < 1e-8
    found = POLAR.locate(x)
    speed = np.linalg.norm(POLAR.velocities(t), axis=1)
    assert (np.abs(found[0] - t) * speed).max() < TOLERANCE["round trip"]
    assert np.abs(found[1] - r).max() < TOLERANCE["round trip"]


def test_poles_and_antimeridian_are_places_like_others():
    lon = np.array([180.0, -180.0, 179.99999, -179.99999, 0, 0, 45.0])
    lat = np.array([10.0, 10.0, -70.0, -70.0, 90.0, -90.0, 89.9999])
    x = sarcl.wgs84.ecef(lon, lat, 20.0)
    wide = sarcl.Orbit.kepler(7.07e6, 0.001, 1.71, span=(-43200, 43200))
    t, r = wide.locate(x)
    assert t[0] == pytest.approx(t[1], abs=1e-9) and t[2] == pytest.approx(t[3], abs=0.01)
    v, p = wide.velocities(t), wide.positions(t)
    lo, la, _ = sarcl.wgs84.geodetic(p)
    right = ((x - p) * np.cross(v, sarcl.wgs84.up(lo, la))).sum(axis=1) > 0
    for i in range(len(t)):
        back = wide.geolocate(t[i], r[i], 20.0, side="right" if right[i] else "left")
        assert np.linalg.norm(back - x[i]) < 1e-5


def test_the_point_straight_below_is_met():
    orbit = sarcl.Orbit.kepler(7.07e6, 0.0, np.pi / 2, mean_anomaly=np.pi / 2)
    for latitude in (90.0, 89.9999, -90.0, -89.9999):
        for longitude in (0.0, 180.0, -180.0):
            x = sarcl.wgs84.ecef(longitude, latitude, 100.0)
            t, r = orbit.locate(x)
            again = [orbit.geolocate(t, r, 100.0, side) for side in ("left", "right")]
            # the height changes with the square of the angle: 2e-9 m of height are 6 cm there
            assert min(np.linalg.norm(one - x) for one in again) <= 0.1, latitude


def test_the_closest_of_several_passes_counts():
    wide = sarcl.Orbit.kepler(7.07e6, 0.001, 1.71, span=(-43200, 43200))
    x = sarcl.wgs84.ecef(20.0, 60.0, 0.0)
    t, r = wide.locate(x)
    some = np.linspace(-43200, 43200, 86401)
    assert r <= np.linalg.norm(wide.positions(some) - x, axis=1).min() + 1e-6
    other, farther = wide.locate(x, span=(t + 3000, 43200))
    assert other > t and farther > r


def test_shapes_are_kept():
    t, r = POLAR.locate(POLAR.geolocate(np.zeros((2, 1)), np.full(3, 9e5)))
    assert t.shape == r.shape == (2, 3) and POLAR.geolocate(0.0, 9e5).shape == (3,)
    t, r = POLAR.locate(POLAR.geolocate(0.0, 9e5))
    assert t.shape == () and r == pytest.approx(9e5, abs=1e-6)


# beams


def test_a_footprint_is_as_wide_as_the_beam():
    edge = POLAR.footprint(0.0, look=0.5, width=(0.005, 0.1), n=4)
    p, v = POLAR.positions(0.0), POLAR.velocities(0.0)
    seen = POLAR.view(0.0, edge)
    assert np.abs(sarcl.wgs84.geodetic(edge)[2]).max() < 1e-7
    assert seen.squint[[0, 2]] == pytest.approx([0.0025, -0.0025], abs=1e-9)
    towards = (edge - p) / seen.slant_range[:, None]
    assert np.arccos(towards[1] @ towards[3]) == pytest.approx(0.1, abs=1e-7)
    assert np.abs(towards[[1, 3]] @ v / np.linalg.norm(v)).max() < 1e-12
    assert (
        np.abs(sarcl.wgs84.geodetic(POLAR.footprint(0.0, look=0.5, width=(0.01, 0.1), height=3e3))[2] - 3e3).max()
        < 1e-7
    )
    with pytest.raises(ValueError, match=r"over the horizon.*narrower beam"):
        POLAR.footprint(0.0, look=1.1, width=(0.01, 0.2))


def test_the_doppler_centroid_is_that_of_the_boresight():
    t = np.array([-500.0, 700.0])
    for attitude in ("zero-doppler", "yaw", "orbital"):
        x = POLAR.boresight(t, look=0.5, attitude=attitude, height=100.0)
        track = [POLAR.trajectory(start=s, prf=1.0, n_pulses=1, attitude=attitude, look=0.5) for s in t]
        along = np.array([(k.velocities[0] @ k.attitude[0])[0] for k in track])
        seen = POLAR.view(t, x)
        assert seen.doppler(5.4e9) == pytest.approx(2 * 5.4e9 / C * along, abs=1e-5)
        assert seen.look == pytest.approx(0.5, abs=2e-3)  # the zero-Doppler plane is tilted by the climb
        assert np.abs(sarcl.wgs84.geodetic(x)[2] - 100).max() < 1e-7
    assert np.abs(POLAR.view(t, POLAR.boresight(t, look=0.5)).doppler(5.4e9)).max() < 1e-5


# refusals


def test_a_scene_that_is_never_seen_is_refused():
    west = sarcl.Orbit.kepler(7.07e6, 0.001, 0.2, span=(-3000, 3000))  # stays near the equator
    x = sarcl.wgs84.ecef([0.0, 10.0], [1.0, 80.0], 0.0)
    with pytest.raises(
        ValueError, match=r"positions\[1\] \(longitude 10.0000, latitude 80.0000\) is never seen: .*horizon"
    ):
        west.locate(x)
    short = sarcl.Orbit.kepler(7.07e6, 0.001, 1.71, span=(0, 60))
    far = POLAR.geolocate(500.0, 9e5)
    with pytest.raises(ValueError, match=r"no zero-Doppler time .* from 0 to 60 s; give an orbit over a longer span"):
        short.locate(far)
    with pytest.raises(ValueError, match=r"positions\[0, 1\] is inf"):
        short.locate([[0.0, np.inf, 0.0]])
    with pytest.raises(ValueError, match="outside the orbit"):
        short.locate(far, span=(0, 100))


@pytest.mark.parametrize(
    "t, r, heights, wanted",
    [
        (0.0, [9e5, 6e5], 0.0, r"slant range\[1\] = 600000 m does not reach the ground, which is \d+"),
        (0.0, [9e5, 4e6], 0.0, r"slant range\[1\] = 4000000 m meets the ground behind the horizon"),
        (0.0, -5.0, 0.0, "slant ranges are positive"),
        (0.0, [np.nan], 0.0, r"r\[0\] is nan"),
        (0.0, 9e5, [np.inf], r"heights\[0\] is inf"),
        (3001.0, 9e5, 0.0, "outside the orbit"),
        (0.0, 9e5, 2e6, r"heights\[0\] = 2000000 m is above the satellite"),
    ],
)
def test_ranges_that_meet_no_ground_are_refused(t, r, heights, wanted):
    with pytest.raises(ValueError, match=wanted):
        POLAR.geolocate(t, r, heights)
    with pytest.raises(ValueError, match="side is 'up'"):
        POLAR.geolocate(0.0, 9e5, side="up")


def test_a_satellite_that_stands_over_the_ground_has_no_zero_doppler_plane():
    still = sarcl.Orbit.kepler(42_164_170.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="no zero-Doppler plane"):
        still.geolocate(0.0, 3.7e7)


def test_state_vectors_locate_as_the_orbit_they_are_of():
    t = np.arange(-100, 101, 10.0)
    path = StateVectors.fitted(t, POLAR.positions(t), POLAR.velocities(t))
    x = POLAR.geolocate(np.linspace(-90, 90, 50), 9e5)
    found = zero_doppler.locate(path.at, (-100.0, 100.0), x)
    assert np.abs(found[0] - np.linspace(-90, 90, 50)).max() < 1e-9 and np.abs(found[1] - 9e5).max() < 1e-7


def test_the_projections_of_sarkit_agree():
    """A second implementation, of SICD's Volume 3: range and range rate to a surface of constant height."""
    projection = pytest.importorskip("sarkit.sicd.projection", reason="no sarkit")
    t, r, h = np.linspace(-900, 900, 7), np.linspace(7.4e5, 1.2e6, 7), np.linspace(-100, 5000, 7)
    for side, look in (("left", 1), ("right", -1)):
        x = POLAR.geolocate(t, r, h, side=side)
        for i in range(7):
            sets = projection.ProjectionSetsMono(
                t_COA=t[i], ARP_COA=POLAR.positions(t[i]), VARP_COA=POLAR.velocities(t[i]), R_COA=r[i],
                Rdot_COA=np.zeros(()),
            )  # fmt: skip
            there, _, met = projection.r_rdot_to_constant_hae_surface(
                look, x[i] + 500, sets, h[i], delta_hae_max=1e-6, nlim=20
            )
            assert met and np.linalg.norm(there - x[i]) < 1e-7  # m


def test_positions_above_the_satellite_are_seen():
    orbit = sarcl.Orbit.kepler(7.07e6, 0.001, 1.7)
    time, distance = orbit.locate(1.2 * orbit.positions(5.0))
    assert time == pytest.approx(5.0, abs=0.1) and distance == pytest.approx(0.2 * 7.07e6, rel=2e-3)
    with pytest.raises(ValueError, match="never seen"):
        orbit.locate(-1.2 * orbit.positions(5.0), span=(-100, 100))


@pytest.mark.parametrize("x", [[0.0, 0, 0], [[10.0, -20, 5]], [[7e6, 0, 0], [7070.0, 0, 0]]])
def test_positions_inside_the_earth_are_refused(x):
    orbit = sarcl.Orbit.kepler(7.07e6, 0.001, 1.7)
    for call in (orbit.locate, lambda y: orbit.view(0.0, y)):
        with pytest.raises(ValueError, match=r"positions.* is 6\.\d+e\+06 m under the ellipsoid; wanted Earth-fixed"):
            call(x)


def test_shapes_that_do_not_fit_are_named():
    orbit = sarcl.Orbit.kepler(7.07e6, 0.001, 1.7)
    x = orbit.geolocate([0.0, 1.0], 9e5)
    with pytest.raises(ValueError, match=r"t \(3,\), positions \(2,\)"):
        orbit.view([0.0, 1.0, 2.0], x)
    with pytest.raises(ValueError, match=r"t \(3,\), r \(2,\)"):
        orbit.geolocate([0.0, 1.0, 2.0], [9e5, 9e5])
    with pytest.raises(ValueError, match="own position"):
        orbit.view(0.0, orbit.positions(0.0))
    assert orbit.view([[0.0], [1.0]], x).slant_range.shape == (2, 2)
    with pytest.raises(ValueError, match=r"width has shape \(1,\)"):
        orbit.footprint(0.0, look=0.5, width=(0.1,))
    with pytest.raises(ValueError, match="reaches beyond the Earth; give a shorter range"):
        orbit.geolocate(0.0, 2e7)
