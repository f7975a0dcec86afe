"""Antennas while a pulse is on its way: the light-time equations in an inertial frame, in extended precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl.earth.light_time import antennas_in_flight

L = np.longdouble
C, RATE = L(299_792_458), L("7.292115e-5")
ORBIT = sarcl.Orbit.kepler(7.17e6, 0.002, 1.71, 0.4, 1.0, 0.2)
CHIRP = sarcl.Waveform.chirp(center=5.4e9, bandwidth=20e6, duration=20e-6)
TOLERANCE = {"path": 2e-9}  # m: float64 positions at 7e6 m


def inertial(t, x):
    """Earth-fixed positions (n, 3), m, in the inertial frame of time 0."""
    c, s = np.cos(RATE * L(1) * t), np.sin(RATE * L(1) * t)
    return np.stack([c * x[..., 0] - s * x[..., 1], s * x[..., 0] + c * x[..., 1], L(1) * x[..., 2] + 0 * c], axis=-1)


def length(d):
    return np.sqrt((d * d).sum(axis=-1))


def exact_half_path(times, point):
    """Half the paths, m, of light from the orbit at times over a point of the rotating Earth and back to the orbit."""
    t = np.asarray(times, L)
    sent = inertial(t, ORBIT.positions(times).astype(L))
    down = np.full(len(t), L(0.003))
    for _ in range(12):
        down = length(inertial(t + down, np.asarray(point, L)[None]) - sent) / C
    met = inertial(t + down, np.asarray(point, L)[None])
    up = down
    for _ in range(12):
        after = t + down + up
        # the orbit at the arrival: states at a nearby time that float64 holds, and the rest by their own motion
        near = after.astype(np.float64)
        p, v = ORBIT.positions(near).astype(L), ORBIT.velocities(near).astype(L)
        up = length(inertial(after, p + (after - near)[:, None] * v) - met) / C
    return (C * (down + up) / 2).astype(L)


def point_below(t=0.0):
    return ORBIT.geolocate(t, 8.9e5, 100.0)


def test_paths_to_the_point_are_those_of_light():
    track = ORBIT.trajectory(start=-1.0, prf=50.0, n_pulses=101)
    x = point_below()
    tx, rx, down, up = antennas_in_flight(track.positions, track.velocities, track.accelerations, x)
    wanted = exact_half_path(track.times, x)
    half = (length(tx.astype(L) - x) + length(rx.astype(L) - x)) / 2
    assert np.abs(half - wanted).max() <= TOLERANCE["path"]
    assert np.abs(299_792_458 * (down + up) / 2 - wanted).max() <= TOLERANCE["path"]


def test_stop_and_go_leaves_out_centimetres():
    track = ORBIT.trajectory(start=-1.0, prf=50.0, n_pulses=101)
    x = point_below()
    still = np.linalg.norm(track.positions - x, axis=1)
    assert 1e-2 < np.abs(still - exact_half_path(track.times, x)).max() < 1


def test_echoes_of_an_orbit_have_the_phase_of_the_true_path():
    track = ORBIT.trajectory(start=-0.02, prf=500.0, n_pulses=21)
    x = point_below()
    raw = sarcl.echo(sarcl.Scene.points([x], [1.0]), CHIRP, track, reference=x, tolerance=1e-5)
    assert np.abs(raw.reference_range - exact_half_path(track.times, x)).max() <= TOLERANCE["path"]
    assert not raw.is_monostatic and np.array_equal(raw.time, track.times)
    assert np.abs(raw.samples - 1).max() <= 1e-5
    plan = raw.report.plan
    assert plan["receiver"] == "at the echo's arrival"
    off = np.abs(np.linalg.norm(track.positions - x, axis=1) - exact_half_path(track.times, x)).max()
    assert plan["stop_and_go_error_m"] == pytest.approx(float(off), rel=1e-2)
    image = sarcl.backproject(raw, sarcl.ImageGrid.points([[x]]), tolerance=1e-4)
    assert abs(image.data[0, 0] / image.gain) == pytest.approx(1, abs=1e-4)


def test_the_error_over_the_scene_is_said():
    track = ORBIT.trajectory(start=-1.0, prf=20.0, n_pulses=41)
    x = point_below()
    corner = ORBIT.geolocate(0.3, 8.92e5, 100.0)
    scene = sarcl.Scene.points([x, corner], [1.0, 1.0])
    raw = sarcl.echo(scene, CHIRP, track, reference=x, tolerance=1e-3)
    used = (np.linalg.norm(raw.tx - corner, axis=1) + np.linalg.norm(raw.rx - corner, axis=1)) / 2
    off = float(np.abs(used - exact_half_path(track.times, corner)).max())
    assert 0 < off <= raw.report.plan["arrival_error_m"] < 0.02 < raw.report.plan["stop_and_go_error_m"]


def test_a_receiver_that_is_given_wins_and_other_tracks_stop_and_go():
    x = point_below()
    scene = sarcl.Scene.points([x], [1.0])
    track = ORBIT.trajectory(start=0.0, prf=500.0, n_pulses=5)
    given = sarcl.echo(scene, CHIRP, track, receiver=track)
    assert given.is_monostatic and np.array_equal(given.tx, track.positions)
    assert given.report.plan["receiver"] == "a track of its own"
    still = sarcl.echo(scene, CHIRP, replace(track, stop_and_go=True))
    assert still.is_monostatic and still.report.plan["receiver"] == "stop and go"
    assert 0 < still.report.plan["stop_and_go_error_m"] < 1
    plain = sarcl.echo(scene, CHIRP, sarcl.Trajectory(track.times, track.positions))
    assert "stop_and_go_error_m" not in plain.report.plan and plain.report.plan["receiver"] == "stop and go"


def test_a_processor_s_positions_arrive_too():
    """motion.with_positions has no reference point, but the delays that the reference ranges are."""
    x = point_below()
    track = ORBIT.trajectory(start=0.0, prf=500.0, n_pulses=5)
    raw = sarcl.echo(sarcl.Scene.points([x], [1.0]), CHIRP, track, polarization=("HH", "VV"), reference=x)
    again = sarcl.motion.with_positions(raw, track)
    assert np.abs(again.tx - raw.tx).max() < 1e-6 and np.abs(again.rx - raw.rx).max() < 1e-5
    path = np.linalg.norm(again.tx - x, axis=1) + np.linalg.norm(again.rx - x, axis=1)
    assert np.abs(path / 2 - raw.reference_range).max() < 1e-7  # m: tau_1 and tau_2 are not equal
    assert np.abs(again.rx_velocity - raw.rx_velocity).max() < 1e-6


def test_the_track_of_a_moving_target_has_its_accelerations():
    track = ORBIT.trajectory(start=0.0, prf=10.0, n_pulses=21)
    x = point_below()
    body = dict(velocity=(30, -20, 5), acceleration=(0.3, 0.1, 0), rotation=(0.01, 0.02, 0.03), center=x, epoch=0.7)
    moved = sarcl.motion.relative(track, **body)
    for of, slope in ((moved.positions, moved.velocities), (moved.velocities, moved.accelerations)):
        derived = (of[2:] - of[:-2]) / 0.2
        assert np.abs(derived - slope[1:-1]).max() < 1e-4 * np.abs(slope).max()
    raw = sarcl.echo(sarcl.Scene.points([x], [1.0]), CHIRP, moved, reference=x)
    assert raw.report.plan["receiver"] == "at the echo's arrival" and raw.report.plan["stop_and_go_error_m"] < 1


def test_scenes_that_the_track_never_sees_are_refused():
    track = ORBIT.trajectory(start=0.0, prf=500.0, n_pulses=5)
    with pytest.raises(ValueError, match=r"m under the ellipsoid, but .*Earth-fixed.*from_dem\(frame='ecef'\)"):
        sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, track)
    with pytest.raises(ValueError, match=r"behind the horizon at every pulse; Orbit\.locate gives the times"):
        sarcl.echo(sarcl.Scene.points([-point_below()], [1.0]), CHIRP, track)


def test_channels_of_an_array_and_forecasts_follow_the_same_rule():
    x = point_below()
    scene = sarcl.Scene.points([x], [1.0])
    track = ORBIT.trajectory(start=0.0, prf=500.0, n_pulses=5, attitude="zero-doppler", look=0.5)
    array = sarcl.AntennaArray.linear(2, spacing=1.0, frequency_step=0.0, axis=(0, 1, 0))
    raw = sarcl.echo(scene, CHIRP, track, array=array, channels="separated", receive="all", reference=x)
    assert raw.report.plan["receiver"] == "at the echo's arrival"
    one = sarcl.echo(scene, CHIRP, track, reference=x)
    first = (raw.tx_channel == 0) & (raw.rx_channel == 0)
    assert np.abs(raw.tx[first] - one.tx).max() < 1e-8 and np.abs(raw.rx[first] - one.rx).max() < 1e-8
    assert sarcl.plan(sarcl.echo, scene, CHIRP, track, reference=x).plan["receiver"] == "at the echo's arrival"
