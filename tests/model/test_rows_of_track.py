"""Records of a satellite take their positions from the orbit's track; positions alone are warned of."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.effects import motion

RATE, CARRIER, N = 60e6, 5.4e9, 1024
EARTH = 7.292115e-5  # rad/s, GRS 80


def turned_with_the_earth(places, t):
    """Places that are fixed to the Earth, in the axes that do not turn: m (n, 3), s (n,)."""
    c, s = np.cos(EARTH * t), np.sin(EARTH * t)
    return np.stack([c * places[:, 0] - s * places[:, 1], s * places[:, 0] + c * places[:, 1], places[:, 2]], axis=1)


def two_way(orbit, t, point):
    """Delays, s (n,), of echoes of pulses sent at t: straight lines in axes that do not turn, light at one speed."""
    sent = turned_with_the_earth(orbit.positions(t), t)
    down = np.zeros(len(t))
    up = np.zeros(len(t))
    for _ in range(8):
        there = turned_with_the_earth(np.tile(point, (len(t), 1)), t + down)
        down = np.linalg.norm(there - sent, axis=1) / SPEED_OF_LIGHT
        back = turned_with_the_earth(orbit.positions(t + down + up), t + down + up)
        up = np.linalg.norm(back - there, axis=1) / SPEED_OF_LIGHT
    return down + up


@pytest.fixture(scope="module")
def record():
    """A track, a point, and its compressed echoes in time."""
    orbit = sarcl.Orbit.kepler(semi_major_axis=7071e3, eccentricity=0.001, inclination=1.7)
    track = orbit.trajectory(center=0.0, prf=300.0, n_pulses=241)
    point = orbit.geolocate([0.0], [850e3], side="right")[0]
    tau = two_way(orbit, track.times, point)
    start = float(tau.mean()) - N / 2 / RATE
    t = start + np.arange(N) / RATE
    samples = np.sinc(RATE * (t - tau[:, None])) * np.exp(-2j * np.pi * CARRIER * tau)[:, None]
    return track, point, samples, {"rate": RATE, "start": start, "carrier": CARRIER}


def place(raw, track, point):
    """Where the point is focused, m along the track and towards the radar from its place."""
    velocity = track.velocities[len(track) // 2]
    along = velocity / np.linalg.norm(velocity)
    away = track.positions[len(track) // 2] - point
    away -= (away @ along) * along
    away /= np.linalg.norm(away)
    steps = np.arange(-30, 30.1, 0.5)
    listed = point + steps[:, None, None] * along + np.arange(-3, 3.1, 0.5)[:, None] * away
    image = sarcl.backproject(raw, sarcl.ImageGrid.points(listed), tolerance=1e-3, check=False)
    at = np.unravel_index(np.abs(image.data).argmax(), image.data.shape)
    return steps[at[0]], np.abs(image.data).max() / raw.n_rows


def test_a_track_puts_the_point_of_an_orbit_where_it_is(record):
    track, point, samples, given = record
    with warnings.catch_warnings():
        warnings.simplefilter("error", sarcl.SarclWarning)
        raw = sarcl.PhaseHistory.from_time(samples, track=track, **given)
    off, level = place(raw, track, point)
    assert abs(off) <= 0.5 and level > 0.98
    assert (raw.time == track.times).all() and not raw.is_monostatic
    bare = sarcl.PhaseHistory.from_time(samples, tx=track.positions, **given)
    same = motion.with_positions(bare, track)
    assert (same.tx == raw.tx).all() and (same.rx == raw.rx).all()


def test_positions_of_a_satellite_alone_are_warned_of_with_the_metres(record):
    track, point, samples, given = record
    with pytest.warns(sarcl.SarclWarning, match=r"tx moves at 7\.\d+ km/s.*lies (\S+) m off.*track=") as warned:
        raw = sarcl.PhaseHistory.from_time(samples, tx=track.positions, time=track.times, **given)
    assert len(warned) == 1
    metres = float(str(warned[0].message).split("lies ")[1].split(" m")[0])
    off, _ = place(raw, track, point)
    assert 15 < abs(off) == pytest.approx(metres, rel=0.15)


def test_near_or_slow_positions_and_two_antennas_are_not_warned_of(record):
    track, _, samples, given = record
    with warnings.catch_warnings():
        warnings.simplefilter("error", sarcl.SarclWarning)
        near = track.positions - track.positions[0]
        sarcl.PhaseHistory.from_time(samples, tx=near, time=track.times, **given)
        sarcl.PhaseHistory.from_time(samples, tx=track.positions, time=100 * track.times, **given)
        sarcl.PhaseHistory.from_time(samples, tx=track.positions, rx=track.positions + 40, time=track.times, **given)


def test_a_straight_track_gives_positions_and_times():
    track = sarcl.Trajectory.line(start=(0, 0, 100), velocity=(0, 10, 0), prf=10, n_pulses=3)
    raw = sarcl.PhaseHistory.from_time(np.ones((3, 8), complex), rate=1e6, carrier=1e9, track=track)
    assert raw.is_monostatic and (raw.tx == track.positions).all() and (raw.time == track.times).all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "tx and track are both None; give exactly one"),
        ({"tx": np.zeros((3, 3)), "track": 3}, "tx and track are both given; give exactly one"),
        ({"track": 4}, "samples has 3 rows but track 4 pulses; give a track with a pulse per row"),
        ({"track": 3, "rx": np.zeros((3, 3))}, "rx is given, and so is track"),
        ({"track": 3, "time": np.arange(3)}, "time is given, and so is track"),
        ({"track": 3, "tx_velocity": np.ones((3, 3))}, "tx_velocity is given, and so is track"),
    ],
)
def test_tracks_that_do_not_fit_are_refused(given, message):
    if isinstance(given.get("track"), int):
        line = sarcl.Trajectory.line(start=(0, 0, 100), velocity=(0, 10, 0), prf=10, n_pulses=given["track"])
        given = {**given, "track": line}
    with pytest.raises(ValueError, match=message):
        sarcl.PhaseHistory.from_time(np.ones((3, 8), complex), rate=1e6, carrier=1e9, **given)


def test_a_track_of_another_type_is_refused():
    with pytest.raises(TypeError, match="track"):
        sarcl.PhaseHistory.from_time(np.ones((3, 8), complex), rate=1e6, carrier=1e9, track=np.zeros((3, 3)))
