"""Layover, shadow and incidence of ramps, hills and walls, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.earth.layers import layers

LONGITUDE, LATITUDE = 10.0, 45.0
ORIGIN = sarcl.wgs84.ecef(LONGITUDE, LATITUDE, 0.0)
AXES = sarcl.wgs84.local_axes(LONGITUDE, LATITUDE)  # rows east, north, up
RANGE = 1e6  # m, from the origin: wavefronts are straight over a few hundred metres
INCIDENCE = np.radians(40)
X = np.arange(-400.0, 400.5)  # m, east
HEIGHT = 100.0


def terrain(profile, posts=401):
    """Heights that depend on the distance to the east alone; a post lies at 0."""
    longitude = LONGITUDE + np.linspace(-0.02, 0.02, posts)
    latitude = LATITUDE + np.linspace(-0.005, 0.005, 5)
    x = (sarcl.wgs84.ecef(*np.meshgrid(longitude, latitude), 0.0) - ORIGIN) @ AXES[0]
    return sarcl.ElevationModel(longitude, latitude, profile(x))


def antenna(incidence, distance=RANGE):
    return ORIGIN + distance * (-np.sin(incidence) * AXES[0] + np.cos(incidence) * AXES[2])


def seen(model, incidence=INCIDENCE, other=None, *, moves=True, distance=RANGE):
    points = ORIGIN + X[:, None] * AXES[0]
    ends = [
        np.broadcast_to(antenna(a, distance), points.shape) for a in (incidence, incidence if other is None else other)
    ]
    return layers(model, points, (ends[0], ends[1]), (7e3 * AXES[1], 7e3 * AXES[1]) if moves else None)


def between(low, high):
    """True for points between two edges; points within 1 m of an edge are left out by `same`."""
    return (X > low) & (X < high), np.minimum(np.abs(X - low), np.abs(X - high)) > 1.0


def same(mask, wanted):
    expected, is_clear = wanted
    return bool((mask == expected)[is_clear].all()) and is_clear.sum() > len(X) - 8


def hill(front, back):
    """A crest of HEIGHT at 0, with slopes that rise towards it, rad."""
    return lambda x: np.maximum(HEIGHT - np.where(x < 0, -x * np.tan(front), x * np.tan(back)), 0.0)


@pytest.mark.parametrize("slope", [-0.9, -0.3, 0.0, 0.3, 0.6, 0.8])
def test_a_ramp_is_seen_under_its_slope_and_lays_over_or_shades_itself(slope):
    """A foreslope steeper than the incidence lies over itself, a backslope steeper than 90 degrees less it is dark."""
    got = seen(terrain(lambda x: x * np.tan(slope)))
    assert np.abs(got.incidence - np.abs(INCIDENCE - slope)).max() < 8e-4  # the look turns over 700 m at 1000 km
    assert (got.shadow == (slope < INCIDENCE - np.pi / 2)).all()
    assert (got.layover == (slope > INCIDENCE)).all()


@pytest.mark.parametrize("moves", [True, False])
def test_a_hill_lays_over_the_plain_before_it_and_shades_the_one_behind(moves):
    front, back = np.radians(60), np.radians(70)
    got = seen(terrain(hill(front, back)), moves=moves)
    foot = -HEIGHT / np.tan(front)
    # the far edge is the point behind the crest at the range of the foot: x tan(40) from there up, the back slope down
    last = (HEIGHT + foot * np.tan(INCIDENCE)) / (np.tan(back) + np.tan(INCIDENCE))
    first = -HEIGHT / np.tan(INCIDENCE)  # the point of the plain at the range of the crest
    spacing = 2.0  # m: corners of the profile lie between posts
    low, high = X < first + 1, X > last + spacing
    assert not got.layover[(X < first - 1) | high].any()
    assert got.layover[~low & (X < last - spacing)].all()
    assert same(got.shadow, between(0.0, HEIGHT * np.tan(INCIDENCE)))


def test_a_gentle_hill_has_neither():
    got = seen(terrain(hill(np.radians(35), np.radians(45))))
    assert not got.layover.any() and not got.shadow.any()
    place = np.abs(X + 50) < 20
    assert np.allclose(got.incidence[place], INCIDENCE - np.radians(35), atol=1e-3)


def test_a_slope_is_half_shadowed_by_the_hill_before_it():
    """A hill of 100 m shades 83.9 m of a plain; of a slope that falls behind it more, of one that rises less."""
    for slope in (-0.4, 0.0, 0.5):
        profile = hill(np.radians(20), np.radians(75))
        got = seen(
            terrain(
                lambda x, slope=slope, profile=profile: np.maximum(profile(x), 0) + np.maximum(x, 0) * np.tan(slope)
            )
        )
        # sun's ray from the crest: z = HEIGHT - x / tan(incidence); the ground: z = x tan(slope)
        end = HEIGHT / (1 / np.tan(INCIDENCE) + np.tan(slope))
        inside, is_clear = between(0.0, end)
        is_clear &= X > -40
        assert (got.shadow == inside)[is_clear].all(), slope


def test_a_wall_thinner_than_the_model_is_as_high_as_its_posts():
    got = seen(terrain(lambda x: np.where(np.abs(x) < 4, HEIGHT, 0.0)))
    inside, is_clear = between(0.0, HEIGHT * np.tan(INCIDENCE))
    assert (got.shadow == inside)[is_clear].all()
    front = X < -HEIGHT / np.tan(INCIDENCE) - 1
    assert not got.layover[front].any() and got.layover[(X > -118) & (X < -1)].all()


def test_a_receiver_elsewhere_adds_its_own_shadow_and_shares_the_slope():
    """Antennas on both sides: either shades its own side; incidence is from the normal to the middle of both."""
    model = terrain(hill(np.radians(70), np.radians(70)))
    got = seen(model, np.radians(40), np.radians(-50))
    low, high = -HEIGHT * np.tan(np.radians(50)), HEIGHT * np.tan(np.radians(40))
    inside, is_clear = between(low, high)
    is_clear &= np.abs(X) > 1  # both see the crest
    assert (got.shadow == inside)[is_clear].all()
    assert np.abs(got.incidence[np.abs(X) > 150] - np.radians(5)).max() < 6e-4


def test_layover_of_a_near_antenna_follows_circles_about_the_track():
    """A track 1 km away: the circle through the crest meets the plain beside the straight line of far antennas."""
    distance = 1e3
    got = seen(terrain(hill(np.radians(60), np.radians(70))), distance=distance)
    x, z = -distance * np.sin(INCIDENCE), distance * np.cos(INCIDENCE)
    crest = np.hypot(x, z - HEIGHT)
    first = x + np.sqrt(crest**2 - z**2)
    straight = -HEIGHT / np.tan(INCIDENCE)
    assert abs(first - straight) > 3.0
    assert not got.layover[X < first - 0.6].any() and got.layover[(X > first + 0.6) & (X < 0)].all()


def test_layover_about_a_straight_track_does_not_depend_on_squint():
    """The circle about the track stays in the plane across it, wherever on the track the antenna is."""
    model, points = terrain(hill(np.radians(60), np.radians(70))), ORIGIN + X[:, None] * AXES[0]
    speeds = 7e3 * AXES[1], 7e3 * AXES[1]
    masks = []
    for ahead in (0.0, 3e3, -6e3):
        ends = np.broadcast_to(antenna(INCIDENCE, 5e3) + ahead * AXES[1], points.shape)
        masks.append(layers(model, points, (ends, ends), speeds).layover)
    assert masks[0].sum() > 100 and (masks[1] == masks[0]).all() and (masks[2] == masks[0]).all()


def test_bistatic_layover_is_where_two_points_have_one_path_and_one_rate():
    """Against a search over all points of a ridge: for each x the y of equal rate, and there the path."""
    profile = hill(np.radians(60), np.radians(60))
    x, velocities = np.arange(-400.0, 400.5, 1.0), np.array([[0, 200.0, 0], [60.0, 150.0, 0]])
    antennas = np.array([[-4e3, -3e3, 5e3], [-3e3, 5e3, 4e3]])

    def path_and_rate(y, places):
        way = antennas[:, None] - np.stack([places, y, profile(places)], axis=-1)
        r = np.linalg.norm(way, axis=-1)
        return r.sum(axis=0), ((way / r[..., None]) * velocities[:, None]).sum(axis=(0, 2))

    picked = np.arange(-300.0, 300.0, 10.0) + 0.5
    wanted = []
    for place in picked:
        first_path, first_rate = path_and_rate(np.zeros(1), np.array([place]))
        y = np.zeros(len(x))
        for _ in range(20):
            rate, ahead = path_and_rate(y, x)[1], path_and_rate(y + 1.0, x)[1]
            y -= (rate - first_rate) / (ahead - rate)
        excess = path_and_rate(y, x)[0] - first_path
        crossings = x[:-1][np.diff(np.sign(excess)) != 0]
        wanted.append((np.abs(crossings - place) > 3).any())
    points = ORIGIN + picked[:, None] * AXES[0]
    ends = tuple(np.broadcast_to(ORIGIN + a @ AXES, points.shape) for a in antennas)
    got = layers(terrain(profile, posts=1601), points, ends, tuple(v @ AXES for v in velocities)).layover
    assert (got == wanted).sum() >= len(picked) - 1 and 10 < got.sum() < 40


def test_a_long_shadow_ends_where_the_ray_meets_the_curved_earth():
    """A crest of 500 m, seen 5 degrees above the horizon: its shadow is 30 m longer than on a flat Earth."""
    longitude, latitude = LONGITUDE + np.linspace(-0.1, 0.1, 801), LATITUDE + np.linspace(-0.005, 0.005, 5)
    height = np.zeros((5, 801))
    height[:, 400] = 500.0
    incidence = np.radians(85)
    direction = antenna(incidence) - ORIGIN - 500 * AXES[2]
    ray = ORIGIN + 500 * AXES[2] - np.linspace(5e3, 7e3, 20_001)[:, None] * direction / np.linalg.norm(direction)
    below = np.argmax(sarcl.wgs84.geodetic(ray)[2] < 0)
    end = float((ray[below] - ORIGIN) @ AXES[0])
    x = np.arange(5000.0, 7000.0, 2.0)
    points = ORIGIN + x[:, None] * AXES[0]
    ends = np.broadcast_to(antenna(incidence), points.shape)
    got = layers(sarcl.ElevationModel(longitude, latitude, height), points, (ends, ends), None)
    last = x[got.shadow].max()
    assert abs(last - end) < 4.0 and abs(end - 500 * np.tan(incidence)) > 20


def test_points_beyond_the_model_are_neither_dark_nor_seen():
    model = terrain(hill(np.radians(60), np.radians(70)))
    far = ORIGIN + np.array([[5e3, 0, 0], [0, 0, 0]]) @ AXES
    ends = np.broadcast_to(antenna(INCIDENCE), far.shape)
    got = layers(model, far, (ends, ends), None)
    assert not got.shadow[0] and not got.layover[0] and np.isnan(got.incidence[0]) and np.isfinite(got.incidence[1])
