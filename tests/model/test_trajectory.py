"""Trajectories: positions in closed form, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl

TOLERANCE = {
    "position": 1e-12,  # float64, relative to the largest coordinate
    "velocity": 1e-6,  # against central differences of positions a microradian apart
}


def line(**changed):
    given = {"start": (1, -50, 5e3), "velocity": (3, 100, -1), "prf": 500.0, "n_pulses": 512}
    return sarcl.Trajectory.line(**{**given, **changed})


def circle(**changed):
    given = {"radius": 7e3, "height": 5e3, "start": 0.3, "arc": 0.07, "n_pulses": 512}
    return sarcl.Trajectory.circle(**{**given, **changed})


def test_pulse_i_of_a_line_is_at_start_plus_i_velocity_over_prf():
    track = line()
    i = np.arange(512)[:, None]
    wanted = np.array([1, -50, 5e3]) + i / 500.0 * np.array([3, 100, -1])
    assert np.abs(track.positions - wanted).max() <= TOLERANCE["position"] * 5e3
    assert np.abs(track.times - np.arange(512) / 500.0).max() <= TOLERANCE["position"]
    assert (track.velocities == (3, 100, -1)).all()


def test_a_circle_begins_at_start_and_ends_at_start_plus_arc():
    track = circle(center=(10, 20, 30))
    angle = 0.3 + 0.07 * np.arange(512) / 511
    wanted = np.stack([10 + 7e3 * np.cos(angle), 20 + 7e3 * np.sin(angle), np.full(512, 5030.0)], axis=1)
    assert np.abs(track.positions - wanted).max() <= TOLERANCE["position"] * 7e3


def test_a_circle_turns_from_x_towards_y_and_a_negative_arc_turns_back():
    ahead, back = circle(start=0, arc=np.pi / 2, n_pulses=3), circle(start=0, arc=-np.pi / 2, n_pulses=3)
    assert ahead.positions[-1] == pytest.approx([0, 7e3, 5e3], abs=1e-8)
    assert back.positions[-1] == pytest.approx([0, -7e3, 5e3], abs=1e-8)


def test_a_circles_velocity_is_its_positions_derivative():
    track = circle(prf=250.0)
    fine = circle(prf=250.0, n_pulses=511 * 100 + 1)
    at = 100 * np.arange(1, 511)
    slope = (fine.positions[at + 1] - fine.positions[at - 1]) / 2 * (100 * 250.0)
    assert np.abs(track.velocities[1:-1] - slope).max() <= TOLERANCE["velocity"] * np.abs(slope).max()


def test_a_circle_is_full_unless_told_otherwise():
    track = sarcl.Trajectory.circle(radius=10, height=0, n_pulses=5)
    assert track.positions[[0, 2]] == pytest.approx(np.array([[10, 0, 0], [-10, 0, 0]]), abs=1e-14)


@pytest.mark.parametrize(
    "track",
    [
        line(n_pulses=1),
        line(n_pulses=1, velocity=(0, 0, 0)),
        circle(n_pulses=1),
        circle(n_pulses=1, arc=0),
        sarcl.Trajectory([0], [[1, 2, 3]]),
    ],
)
def test_one_pulse_is_a_track(track):
    assert len(track) == 1 and track.positions.shape == (1, 3) and np.isfinite(track.positions).all()


def test_the_first_pulse_does_not_depend_on_how_many_follow():
    assert (circle(n_pulses=1).positions[0] == circle().positions[0]).all()
    assert (line(n_pulses=1).positions[0] == line().positions[0]).all()


def test_any_array_of_numbers_makes_the_same_track():
    positions = np.arange(12.0).reshape(4, 3)
    reversed_twice = positions[::-1].copy()[::-1]
    for given in (positions.tolist(), positions.astype(int), positions.astype("f4"), np.asfortranarray(positions),
                  reversed_twice, positions.astype(">f8")):  # fmt: skip
        track = sarcl.Trajectory(range(4), given)
        assert (track.positions == positions).all() and track.positions.dtype == np.float64
        assert track.positions.flags.c_contiguous


def test_the_callers_arrays_are_neither_frozen_nor_followed():
    times, positions, velocities = np.arange(4.0), np.ones((4, 3)), np.ones((4, 3))
    attitude = np.tile(np.eye(3), (4, 1, 1))
    track = sarcl.Trajectory(times, positions, velocities, attitude)
    for name, given in (
        ("times", times),
        ("positions", positions),
        ("velocities", velocities),
        ("attitude", attitude),
    ):
        before = getattr(track, name).copy()
        given += 7
        assert (getattr(track, name) == before).all() and given.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            getattr(track, name)[0] = 0


def test_the_repr_of_a_track_is_a_line_whatever_its_length():
    long = sarcl.Trajectory(None, np.linspace([0, -30, 1e3], [0, 30, 1e3], 500))
    assert repr(long) == "Trajectory(500 pulses without times, from (0, -30, 1000) to (0, 30, 1000) m)"
    timed = sarcl.Trajectory(
        np.arange(600) / 300, np.ones((600, 3)), np.ones((600, 3)), np.tile(np.eye(3), (600, 1, 1))
    )
    assert repr(timed) == ("Trajectory(600 pulses over 1.99667 s, from (1, 1, 1) to (1, 1, 1) m, velocities, attitude)")
    moving = sarcl.Trajectory([0, 1], np.ones((2, 3)), np.ones((2, 3)), None, np.ones((2, 3)), stop_and_go=False)
    assert repr(moving).endswith("m, velocities, accelerations, not stop-and-go)")


def track(times=(0, 1, 2), positions=((0, 0, 0),) * 3, **more):
    return sarcl.Trajectory(times, positions, **more)


BAD = {
    "time repeated": (lambda: track((0, 1, 1)), r"times\[2\] is 1 after 1; times must increase"),
    "time going back": (lambda: track((0, 2, 1)), r"times\[2\] is 1 after 2"),
    "time not finite": (lambda: track((0, np.inf, 2)), r"times\[1\] is inf"),
    "too few times": (lambda: track((0, 1)), r"trajectory times has shape \(2,\), wanted \(3,\)"),
    "positions of two axes": (
        lambda: track(positions=np.zeros((3, 2))),
        r"trajectory positions has shape \(3, 2\), wanted \(n_pulses, 3\)",
    ),
    "positions turned": (lambda: track(range(5), np.zeros((3, 5))), r"positions has shape \(3, 5\)"),
    "positions not finite": (
        lambda: track(positions=[[0, 0, 0], [0, 0, 0], [0, np.nan, np.inf]]),
        r"trajectory positions\[2, 1\] is nan; every value must be finite: remove or replace it",
    ),
    "complex positions": (lambda: track(positions=np.zeros((3, 3)) + 1j), "must be numbers that fit float64"),
    "words": (lambda: track(positions=[["1", "2", "3"]] * 3), "must be numbers"),
    "ragged": (lambda: track(positions=[[1, 2, 3], [1, 2], [3]]), "positions is .* whose rows differ in length"),
    "huge": (lambda: track(positions=[[10**400, 0, 0]] * 3), "must be numbers that fit float64"),
    "empty": (lambda: track([], np.zeros((0, 3))), "trajectory positions is empty"),
    "velocities of other length": (
        lambda: track(velocities=np.zeros((2, 3))),
        r"trajectory velocities has shape \(2, 3\), wanted \(3, 3\)",
    ),
    "attitude of wrong shape": (lambda: track(attitude=np.eye(3)), r"attitude has shape \(3, 3\), wanted \(3, 3, 3\)"),
    "line at rest": (
        lambda: line(velocity=(0, 0, 0)),
        r"velocity is \(0, 0, 0\); .* positions of several pulses must differ",
    ),
    "line without prf": (lambda: line(prf=0), "prf is 0; it must be greater than 0"),
    "line without pulses": (lambda: line(n_pulses=0), "n_pulses is 0; it must be at least 1"),
    "line of half pulses": (lambda: line(n_pulses=2.5), "n_pulses must be a whole number, got 2.5"),
    "line of true pulses": (lambda: line(n_pulses=True), "n_pulses must be a whole number, got True"),
    "line from nowhere": (lambda: line(start=(np.nan, 0, 0)), r"start\[0\] is nan"),
    "line in the plane": (lambda: line(start=(0, 0)), r"start has shape \(2,\), wanted \(3,\)"),
    "circle without arc": (lambda: circle(arc=0), "arc is 0; .* positions of several pulses must differ"),
    "circle without radius": (lambda: circle(radius=0), "radius is 0; it must be greater than 0"),
    "prf and speed": (lambda: circle(prf=100.0, speed=50.0), "both give the times; give one of them"),
    "speed of one pulse": (lambda: circle(n_pulses=1, speed=50.0), "n_pulses is 1; give prf instead"),
    "velocities without times": (
        lambda: sarcl.Trajectory(None, [[1, 2, 3]], [[1, 0, 0]]),
        "without times has no velocities and no accelerations; give times too",
    ),
    "circle not finite": (lambda: circle(height=np.inf), "height is inf; it must be finite"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_tracks_say_what_was_wanted(name):
    make, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        make()


def test_a_circle_without_prf_or_speed_has_no_times_and_echoes_say_so():
    still = circle()
    assert len(still) == circle(prf=1.0).positions.shape[0] and (still.positions == circle(prf=1.0).positions).all()
    assert still.times is None and still.velocities is None and still.picked(slice(3, 5)).times is None
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=100e6, duration=1e-6)
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), chirp, still.picked(slice(0, 3)))
    assert raw.time is None and raw.tx_velocity is None
    assert raw.report.plan["receiver"] == "stop and go"
    assert raw.report.plan["stop_and_go_error_m"] == "unknown: the track has no times"
    with pytest.raises(ValueError, match="the track has no times, which this needs"):
        sarcl.motion.sinusoidal(still, amplitude=(0.01, 0, 0), frequency=1.0)


def test_a_circle_flies_at_the_speed_asked_for():
    track = circle(speed=120.0)
    assert np.linalg.norm(track.velocities, axis=1) == pytest.approx(120.0, rel=1e-12)
    step = np.linalg.norm(np.diff(track.positions, axis=0), axis=1) / np.diff(track.times)
    assert step == pytest.approx(120.0, rel=1e-6)
