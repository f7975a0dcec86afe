"""Motion errors, unknown positions, moving targets and motion within a pulse, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special
from scipy.spatial.transform import Rotation

import sarcl
from sarcl import motion, pointing
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.effects import stop_and_go
from sarcl.reference.equations import point_echo as exact

FC = 9.6e9
WAVE = SPEED_OF_LIGHT / FC
CHIRP = sarcl.Waveform.chirp(center=FC, bandwidth=100e6, duration=40e-6)
RANGE, SPEED, PRF = 9e3, 120.0, 150.0
LOOK = np.array([-0.8, 0, 0.6])
TRACK = sarcl.Trajectory.line(
    start=RANGE * LOOK - (0, SPEED * 150 / PRF, 0), velocity=(0, SPEED, 0), prf=PRF, n_pulses=301
)
LONG = sarcl.Trajectory(np.arange(40000) * 0.05, np.zeros((40000, 3)))


def test_random_errors_have_their_deviation_and_correlation_time():
    rms = np.array([0.1, 0.0, 3.0])
    moved = motion.perturbed(LONG, rms=rms, correlation_time=2.0, seed=5).positions
    assert np.abs(moved.std(axis=0) - rms).max() < 0.05 * rms.max() and not moved[:, 1].any()
    z = moved[:, 2] / 3.0
    for lag in (10, 20, 40, 80):  # 0.5 to 4 s
        assert (z[lag:] * z[:-lag]).mean() == pytest.approx(np.exp(-((lag * 0.05 / 2) ** 2)), abs=0.05)
    assert abs((moved[:, 0] * z).mean()) < 0.1 * 0.1 * 3  # axes are independent
    assert (z**4).mean() == pytest.approx(3, abs=0.4)  # frequencies that nearly meet beat for long


def test_random_errors_follow_a_spectrum():
    # 1 mm^2/Hz from 1 to 2 Hz, nothing elsewhere
    moved = motion.perturbed(LONG, rms=1e-3, spectrum=([0.99, 1, 2, 2.01], [0, 1, 1, 0]), seed=1).positions[:, 0]
    power = np.abs(np.fft.rfft(moved * np.hanning(len(moved)))) ** 2
    f = np.fft.rfftfreq(len(moved), 0.05)
    assert power[(f > 0.985) & (f < 2.015)].sum() > 0.999 * power.sum()
    assert power[(f > 1) & (f < 1.5)].sum() == pytest.approx(power.sum() / 2, rel=0.1)


def test_errors_belong_to_times_and_seeds():
    options = dict(rms=0.01, correlation_time=0.3)
    whole = motion.perturbed(TRACK, seed=7, **options)
    part = sarcl.Trajectory(TRACK.times[100:200:2], TRACK.positions[100:200:2], TRACK.velocities[100:200:2])
    again = motion.perturbed(part, seed=7, **options)
    assert np.array_equal(again.positions, whole.positions[100:200:2])
    pair = [motion.perturbed(LONG, seed=seed, **options).positions[:, 0] for seed in (7, 8)]
    assert abs(np.corrcoef(*pair)[0, 1]) < 0.05
    assert np.allclose(np.gradient(whole.positions, TRACK.times, axis=0)[1:-1], whole.velocities[1:-1], atol=2e-4)


def test_errors_in_the_track_s_frame_turn_with_it():
    ring = sarcl.Trajectory.circle(radius=1e3, height=500, arc=3.0, n_pulses=2001, prf=100)
    moved = motion.perturbed(ring, rms=(0.5, 0, 0), correlation_time=1.0, frame="track", seed=2)
    off = moved.positions - ring.positions
    assert np.allclose(np.linalg.norm(np.cross(off, ring.velocities), axis=1), 0, atol=1e-6)
    left = motion.sinusoidal(ring, amplitude=(0, 2, 0), frequency=0.2, phase=np.pi / 2, frame="track")
    inward = np.linalg.norm(left.positions[:, :2], axis=1) - 1e3
    assert np.allclose(inward, -2 * np.cos(2 * np.pi * 0.2 * ring.times))  # anticlockwise: the centre is left
    for track in (moved, left):
        slope = np.gradient(track.positions, ring.times, axis=0)
        assert np.allclose(slope[2:-2], track.velocities[2:-2], atol=2e-3)


def test_attitude_errors_turn_the_body_about_its_axes():
    aimed = pointing.stripmap(sarcl.Trajectory.line(start=(0, 0, 5e3), velocity=(0, 9, 0), prf=5, n_pulses=4000), 0.6)
    moved = motion.perturbed(aimed, attitude_rms=(0, 0, 1e-3), correlation_time=1.0, seed=3)
    assert np.array_equal(moved.positions, aimed.positions)
    turn = Rotation.from_matrix(np.swapaxes(aimed.attitude, 1, 2) @ moved.attitude).as_rotvec()
    assert np.allclose(turn[:, :2], 0, atol=1e-9) and turn[:, 2].std() == pytest.approx(1e-3, rel=0.1)
    with pytest.raises(ValueError, match="aim it first"):
        motion.perturbed(TRACK, attitude_rms=1e-3, correlation_time=1.0)


def test_a_sinusoidal_error_makes_paired_echoes_of_bessel_s_height():
    a, f = 0.4e-3, 3.0
    true = motion.sinusoidal(TRACK, amplitude=a * LOOK, frequency=f)
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, true, tolerance=1e-5)
    along = f * WAVE * RANGE / (2 * SPEED)
    places = sarcl.ImageGrid.points(np.array([[0, 0, 0], [0, along, 0], [0, -along, 0], [0, 1.5 * along, 0]], float))
    seen = np.abs(sarcl.backproject(motion.with_positions(raw, TRACK), places, window="hamming", tolerance=1e-4).data)
    m = 4 * np.pi * a / WAVE
    assert seen[1:3] / seen[0] == pytest.approx(special.j1(m) / special.j0(m), rel=0.03)
    assert seen[3] < 0.1 * seen[1]
    known = np.abs(sarcl.backproject(raw, places, window="hamming", tolerance=1e-4).data)
    assert known[1:].max() < 0.1 * seen[1]


def test_unknown_positions_defocus_and_known_ones_do_not():
    true = motion.perturbed(TRACK, rms=3e-3, correlation_time=0.3, seed=4)
    x = np.array([[10.0, 5, 0]])
    raw = sarcl.echo(sarcl.Scene.points(x, [1.0]), CHIRP, true, tolerance=1e-5)
    grid = sarcl.ImageGrid.points(x)
    peak = {}
    for name, given in (("true", raw), ("nominal", motion.with_positions(raw, TRACK))):
        image = sarcl.backproject(given, grid, tolerance=1e-4)
        peak[name] = complex(image.data[0] / image.gain)
    error = np.linalg.norm(true.positions - x, axis=1) - np.linalg.norm(TRACK.positions - x, axis=1)
    assert peak["true"] == pytest.approx(1, abs=1e-4)
    wanted = np.exp(-4j * np.pi * error / WAVE).mean()
    assert peak["nominal"] == pytest.approx(wanted, abs=0.01) and abs(wanted) < 0.7


def test_positions_are_given_to_rows_by_their_time():
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, TRACK, polarization=("HH", "VV"))
    moved = motion.sinusoidal(TRACK, amplitude=(0, 0, 1.0), frequency=0.3)
    given = motion.with_positions(raw[::-1], moved)
    assert np.array_equal(given.tx, np.repeat(moved.positions, 2, axis=0)[::-1]) and given.is_monostatic
    assert np.array_equal(given.tx_velocity, np.repeat(moved.velocities, 2, axis=0)[::-1])
    both = sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, TRACK, receiver=moved)
    kept = motion.with_positions(both, moved)
    assert np.array_equal(kept.rx, moved.positions) and not np.array_equal(kept.tx, TRACK.positions)
    swapped = motion.with_positions(both, moved, receiver=TRACK)
    assert np.array_equal(swapped.rx, TRACK.positions)
    late = replace(moved, times=moved.times + 1e-3)
    with pytest.raises(ValueError, match="no pulse"):
        motion.with_positions(raw, late)
    with pytest.raises(ValueError, match="no times"):
        motion.with_positions(replace(raw, time=None), TRACK)


MOVES = dict(
    velocity=(3.0, -2, 0.5), acceleration=(0.3, 0.1, -1.0), rotation=(0.02, -0.1, 0.4), center=(5.0, 1, 2), epoch=0.7
)


def place(x, t):
    """Where a body's point x, at `epoch`, is at time t."""
    c, s = np.array(MOVES["center"]), t - MOVES["epoch"]
    turn = Rotation.from_rotvec(np.array(MOVES["rotation"]) * s)
    return c + turn.apply(x - c) + np.array(MOVES["velocity"]) * s + np.array(MOVES["acceleration"]) * s**2 / 2


def test_a_moving_body_sees_the_antennas_as_it_is_seen_by_them():
    aimed = pointing.stripmap(TRACK, 0.9)
    seen = motion.relative(aimed, **MOVES)
    x = np.array([7.0, -3, 4])
    for p in (0, 100, 300):
        there = place(x, TRACK.times[p])
        away = there - TRACK.positions[p]
        assert np.linalg.norm(seen.positions[p] - x) == pytest.approx(np.linalg.norm(away), rel=1e-14)
        # the point stands at the same place in the antenna's axes
        assert np.allclose((x - seen.positions[p]) @ seen.attitude[p], away @ aimed.attitude[p], atol=1e-8)
    slope = np.gradient(seen.positions, TRACK.times, axis=0)
    assert np.allclose(slope[1:-1], seen.velocities[1:-1], rtol=1e-4, atol=0.05)


def test_echoes_of_standing_and_moving_parts_add_to_the_exact_sum():
    still, body = np.array([[0.0, 0, 0], [20, -15, 0]]), np.array([[5.0, 1, 2], [7, -3, 4], [2, 4, 1]])
    amplitude = np.array([1, 0.5j, 2.0])
    options = dict(range_window=(-80, 80), tolerance=1e-5)
    standing = sarcl.echo(sarcl.Scene.points(still, [1.0, 1j]), CHIRP, TRACK, **options)
    moving = sarcl.echo(sarcl.Scene.points(body, amplitude), CHIRP, motion.relative(TRACK, **MOVES), **options)
    both = motion.combined([standing, moving])
    f = both.frequency[0] + both.frequency_step[0] * np.arange(both.n_samples)
    wrong = right = 0.0
    for p in range(0, 301, 50):
        now = np.array([place(x, TRACK.times[p]) for x in body])
        tx, reference = TRACK.positions[p], float(both.reference_range[p])
        wanted = exact(np.concatenate([still, now]), np.array([1, 1j, *amplitude]), f, tx, tx, reference)
        wrong += np.linalg.norm(both.read(p, p + 1)[0] - wanted) ** 2
        right += np.linalg.norm(wanted) ** 2
    assert np.sqrt(wrong / right) < 3e-5 and np.array_equal(both.tx, standing.tx)


def test_a_target_that_recedes_is_displaced_along_the_track():
    recede = 0.8  # m/s along the line of sight, at the middle of the aperture
    seen = motion.relative(TRACK, velocity=-recede * LOOK, epoch=TRACK.times[150])
    options = dict(range_window=(-60, 60))
    raw = motion.combined(
        [
            sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1e-6]), CHIRP, TRACK, **options),
            sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, seen, **options),
        ]
    )
    grid = sarcl.ImageGrid.plane(center=(0, -60, 0), shape=(241, 9), spacing=(0.1, 0.5))
    image = np.abs(sarcl.backproject(raw, grid).data).max(axis=1)
    y = -60 + 0.1 * (int(np.argmax(image)) - 120)
    # its Doppler shift -2 v/lambda is that of a point farther back: y = -R v/V (Raney 1971)
    assert y == pytest.approx(-RANGE * recede / SPEED, abs=0.3)


def test_parts_that_cannot_be_added_are_refused():
    point = sarcl.Scene.points([[0, 0, 0]], [1.0])
    one = sarcl.echo(point, CHIRP, TRACK, range_window=(-40, 40))
    far = sarcl.echo(point, CHIRP, motion.relative(TRACK, velocity=60 * LOOK), range_window=(-40, 40))
    with pytest.raises(ValueError, match="outside part 0's range window at row"):
        motion.combined([one, far])
    with pytest.raises(ValueError, match="range_window"):
        motion.combined([one, sarcl.echo(point, CHIRP, TRACK, range_window=(-50, 50))])
    with pytest.raises(ValueError, match="polarization"):
        motion.combined([one, sarcl.echo(point, CHIRP, TRACK, polarization="VV", range_window=(-40, 40))])
    with pytest.raises(ValueError, match="at least one"):
        motion.combined([])


BAD = [
    (lambda: motion.perturbed(TRACK, rms=1.0), "one of them"),
    (lambda: motion.perturbed(TRACK, rms=-1.0, correlation_time=1), "not negative"),
    (lambda: motion.perturbed(TRACK, rms=1.0, correlation_time=0), "greater than 0"),
    (lambda: motion.perturbed(TRACK, rms=1.0, spectrum=([2, 1], [1, 1])), "rising"),
    (lambda: motion.perturbed(TRACK, rms=1.0, spectrum=([1, 2], [0, 0])), "not all 0"),
    (lambda: motion.perturbed(TRACK, rms=1.0, correlation_time=1, frame="body"), "choose one of"),
    (lambda: motion.perturbed(LONG, rms=1.0, correlation_time=1, frame="track"), "stands still"),
    (lambda: motion.sinusoidal(TRACK, amplitude=1.0, frequency=1), "shape"),
    (lambda: motion.relative(TRACK, velocity=(np.nan, 0, 0)), "finite"),
]


@pytest.mark.parametrize("make, says", BAD, ids=[says for _, says in BAD])
def test_motion_that_makes_no_sense_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()


ORBIT = sarcl.Trajectory.line(start=(-500e3, -3.8e3, 514e3), velocity=(0, 7600.0, 0), prf=100, n_pulses=101)


def flown(track, x):
    """tau of a monostatic antenna on a straight track: (c tau - R)^2 = |D + V tau|^2."""
    d, v, c = track.positions - x, track.velocities, SPEED_OF_LIGHT
    return 2 * (c * np.linalg.norm(d, axis=1) + (d * v).sum(axis=1)) / (c**2 - (v**2).sum(axis=1))


def test_the_flight_error_is_that_of_the_moved_receiver():
    x = np.array([[0.0, 0, 0], [3e3, 2e3, 0]])
    error = stop_and_go.stop_and_go_error(ORBIT, x, CHIRP)
    for i in range(2):
        wanted = SPEED_OF_LIGHT * flown(ORBIT, x[i]) / 2 - np.linalg.norm(ORBIT.positions - x[i], axis=1)
        assert np.abs(error.flight[:, i] - wanted).max() < 1e-9
    # (u.V) tau/2 + V^2 tau^2/(4 R), tau = 2 R/c, to terms of (V/c)^3
    r = np.linalg.norm(ORBIT.positions, axis=1)
    series = (ORBIT.positions @ [0, 7600.0, 0]) / SPEED_OF_LIGHT + r * (7600 / SPEED_OF_LIGHT) ** 2
    assert np.abs(error.flight[:, 0] - series).max() < 1e-5
    # tens of radians, but nearly straight over the pulses: the point is displaced, by V R/c, and hardly blurred
    assert (np.abs(error.phase).max(axis=0) > 30).all() and (error.defocus < 0.01).all()


def test_a_receiver_at_arrival_has_no_error_at_its_point_and_little_elsewhere():
    center, x = np.zeros(3), np.array([[0.0, 0, 0], [5e3, 0, 0]])
    used = stop_and_go.receiver_at_arrival(ORBIT, center)
    tau = flown(ORBIT, center)
    assert np.abs(used.positions - (ORBIT.positions + tau[:, None] * ORBIT.velocities)).max() < 1e-6
    left, bare = (stop_and_go.stop_and_go_error(ORBIT, x, CHIRP, used=u) for u in (used, None))
    assert np.abs(left.flight[:, 0]).max() < 1e-9
    # the other's echo arrives d tau later: (u.V) d tau/2
    later = flown(ORBIT, x[1]) - tau
    wanted = ((used.positions - x[1]) @ [0, 7600.0, 0]) / np.linalg.norm(used.positions - x[1], axis=1) * later / 2
    assert np.abs(left.flight[:, 1] - wanted).max() < 1e-6
    assert np.abs(left.flight[:, 1]).max() < 0.01 * np.abs(bare.flight[:, 1]).max()


def test_an_echo_with_that_receiver_has_the_true_delay():
    used = stop_and_go.receiver_at_arrival(ORBIT, (0, 0, 0))
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, ORBIT, receiver=used)
    delay = 2 * raw.reference_range / SPEED_OF_LIGHT  # the point is the reference
    assert np.abs(delay - flown(ORBIT, np.zeros(3))).max() * SPEED_OF_LIGHT < 1e-8


def test_bistatic_and_curved_tracks_meet_the_equation_of_flight():
    tx = sarcl.Trajectory.circle(radius=30e3, height=700e3, arc=0.3, n_pulses=41, prf=1.5)
    rx = sarcl.Trajectory.line(start=(40e3, 0, 9e3), velocity=(100, 200, 3), prf=1.5, n_pulses=41)
    used = stop_and_go.receiver_at_arrival(tx, (100, 50, 0), receiver=rx)
    x = np.array([100, 50, 0])
    tau = (np.linalg.norm(tx.positions - x, axis=1) + np.linalg.norm(used.positions - x, axis=1)) / SPEED_OF_LIGHT
    assert np.abs(used.positions - (rx.positions + tau[:, None] * rx.velocities)).max() < 1e-6
    # without velocities the path is interpolated
    bare = stop_and_go.receiver_at_arrival(sarcl.Trajectory(tx.times, tx.positions), x)
    with_velocities = stop_and_go.receiver_at_arrival(tx, x)
    assert np.abs(bare.positions - with_velocities.positions).max() < 1e-2  # of 60 m/s x 5 ms on a coarse track


@pytest.mark.parametrize("slope", [3e-5, -1e-5])
def test_motion_during_a_chirp_shifts_and_smears_it_as_predicted(slope):
    """The echo p((t - tau)/(1 + tau')) in time, against the phase that pulse_motion gives a point."""
    band, duration, tau = CHIRP.bandwidth, CHIRP.duration, 3e-6
    rate, n = 8 * band, 2**17
    t = (np.arange(n) - n // 2) / rate

    def received(slope):
        sent = (t - tau) / (1 + slope)
        pulse = np.where(np.abs(sent) <= duration / 2, np.exp(1j * np.pi * band / duration * sent**2), 0)
        turns = FC * (sent - t) + FC * tau  # the carrier, less the phase of the delay
        return np.fft.fft(np.fft.ifftshift(pulse * np.exp(2j * np.pi * turns)))

    nu = np.fft.fftfreq(n, 1 / rate)
    keep = np.abs(nu) < 0.4 * band
    got = received(slope)[keep] / received(0.0)[keep]
    # an antenna at 10 km, moving so that the two-way path opens at that rate
    speed = slope * SPEED_OF_LIGHT / (2 + slope)
    track = sarcl.Trajectory([0.0], [[1e4, 0, 0]], velocities=[[speed, 0, 0]])
    error = stop_and_go.stop_and_go_error(track, [[0.0, 0, 0]], CHIRP)
    assert error.doppler[0, 0] == pytest.approx(-FC * slope, rel=1e-9)
    raw = sarcl.PhaseHistory(
        np.ones((1, 801)),
        FC - 0.4 * band,
        0.8 * band / 800,
        track.positions,
        1e4,
        waveform=CHIRP,
        tx_velocity=track.velocities,
    )
    phase = np.unwrap(np.angle(stop_and_go.pulse_motion(raw, (0, 0, 0)).read(0, 1)[0]))
    order = np.argsort(nu[keep])
    f, seen = nu[keep][order], np.unwrap(np.angle(got[order]))
    told = np.interp(f, np.linspace(-0.4, 0.4, 801) * band, phase)
    off = seen - told
    # Fresnel's ripples are not in it: the smooth part, over the band, holds to a hundredth of a radian
    smooth = np.polynomial.Polynomial.fit(f / band, off, 4)(np.linspace(-0.4, 0.4, 9))
    turn = 2 * np.pi * np.rint(off.mean() / (2 * np.pi))
    assert np.abs(off - turn).max() < 0.1 and np.abs(smooth - turn).max() < 0.01 and np.abs(told).max() > 10
    # and the numbers: the slope of the phase is the delay, what is left at the edges the smear
    fit = np.polynomial.Polynomial.fit(f / band, told, 2).convert().coef
    assert -fit[1] / (2 * np.pi * band) * SPEED_OF_LIGHT / 2 == pytest.approx(error.chirp[0, 0], rel=1e-3)
    assert abs(fit[2]) / 4 == pytest.approx(error.smear[0, 0], rel=1e-3)
    assert np.angle(np.exp(1j * (fit[0] + np.pi * (FC * slope) ** 2 * duration / band))) == pytest.approx(0, abs=1e-3)


def test_motion_during_pulses_is_taken_out_again():
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0], [30, 10, 0]], [1.0, 1j]), CHIRP, ORBIT)
    moved = stop_and_go.pulse_motion(raw, (0, 0, 0))
    assert np.abs(moved.read(0, 101) - raw.read(0, 101)).max() > 0.1
    back = stop_and_go.pulse_motion(moved, (0, 0, 0), undo=True)
    assert np.allclose(back.read(0, 101), raw.read(0, 101), atol=1e-6)
    assert np.array_equal(moved[::2].read(3, 7), moved.read(0, 101)[::2][3:7])


def test_what_has_no_speed_or_chirp_is_refused():
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, ORBIT)
    tone = sarcl.Waveform.tone(center=FC, duration=1e-6)
    for make, says in (
        (
            lambda: stop_and_go.pulse_motion(replace(raw, tx_velocity=None, rx_velocity=None), (0, 0, 0)),
            "no velocities",
        ),
        (lambda: stop_and_go.pulse_motion(replace(raw, waveform=None), (0, 0, 0)), "no chirp"),
        (lambda: stop_and_go.stop_and_go_error(ORBIT, [[0, 0, 0]], tone), "'tone'"),
        (lambda: stop_and_go.stop_and_go_error(ORBIT, [[0, 0, 0]], CHIRP, used=TRACK), "one per pulse"),
        (lambda: stop_and_go.stop_and_go_error(ORBIT, ORBIT.positions[:1], CHIRP), "stands on the point"),
        (lambda: stop_and_go.receiver_at_arrival(sarcl.Trajectory([0.0], [[1, 2, 3]]), (0, 0, 0)), "no velocity"),
    ):
        with pytest.raises(ValueError, match=says):
            make()
