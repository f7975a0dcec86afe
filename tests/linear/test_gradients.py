"""Echoes.gradients: the derivatives of Re <y, A x> with respect to amplitudes and to what moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.antenna_cases import everyone
from helpers.cases import noise_history, quick_of

import sarcl
from sarcl.imaging.antenna_beam import antenna_of
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference.linear import gradients, matrix

GRID = sarcl.ImageGrid.plane(shape=(7, 6), spacing=0.4, normal=(0.3, 0.2, 1.0))
KINDS = ("amplitudes", "positions", "heights", "tx", "reference_range", "phase")


def random_vector(n, seed=0):
    random = np.random.default_rng(seed)
    return random.standard_normal(n) + 1j * random.standard_normal(n)


def closed_form(like, m, x, y):
    """The derivatives in float64 with phases in extended precision, for the grid above."""
    out = gradients(like, GRID.positions.reshape(-1, 3), np.broadcast_to(m, y.shape), x, y)
    if like.rx is like.tx:
        out["tx"] = out["tx"] + out.pop("rx")
    return out | {"heights": out["positions"] @ np.cross(GRID.x_axis, GRID.y_axis)}


@pytest.mark.parametrize("bistatic", [False, True])
@pytest.mark.parametrize("distance", [30.0, 10e3, pytest.param(7e5, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("options", "gate"),
    [({"tolerance": 1e-5}, 1e-4), ({"exact": True, "tolerance": 1e-9}, 1e-7)],
    ids=["fast", "exact"],
)
def test_gradients_are_those_of_the_closed_form(options, gate, distance, bistatic):
    kinds = (*KINDS, "rx") if bistatic else KINDS
    for seed in range(3):
        like = noise_history(n_rows=13, n_samples=24, distance=distance, bistatic=bistatic, seed=seed)
        x, y = random_vector(GRID.size, seed), random_vector(13 * 24, seed + 9)
        got = sarcl.linear.Echoes(GRID, like, **options).gradients(x, y, of=kinds)
        expected = closed_form(like, 1.0, x, y.reshape(13, 24))
        assert tuple(got) == kinds
        for kind in kinds:
            assert got[kind].shape == expected[kind].shape
            assert got[kind].dtype == (np.float64 if kind != "amplitudes" else np.result_type(got[kind]))
            assert np.linalg.norm(got[kind] - expected[kind]) < gate * np.linalg.norm(expected[kind]), kind


@pytest.mark.slow
def test_gradients_of_random_tasks():
    """50 tasks from 30 m to orbit, of 1 to 13 rows and 1 to 24 samples."""
    worst = [0.0, 0.0]
    for seed in range(50):
        random, bistatic = np.random.default_rng(seed), bool(seed % 2)
        distance = float(random.choice([30.0, 1e3, 1e4, 7e5]))
        n_rows, n = int(random.choice([1, 2, 13])), int(random.choice([1, 24]))
        like = noise_history(n_rows=n_rows, n_samples=n, distance=distance, bistatic=bistatic, seed=seed)
        x, y = random_vector(GRID.size, seed), random_vector(n_rows * n, seed + 9)
        expected = closed_form(like, 1.0, x, y.reshape(n_rows, n))
        del expected["pointing"]  # without an antenna there is none
        for i, options in enumerate(({"tolerance": 1e-5}, {"exact": True, "tolerance": 1e-9})):
            got = sarcl.linear.Echoes(GRID, like, **options).gradients(x, y, of=[*expected])
            error = max(np.linalg.norm(got[k] - expected[k]) / np.linalg.norm(expected[k]) for k in expected)
            worst[i] = max(worst[i], error)
            assert error < (1e-4, 1e-7)[i], (seed, i)
    print("largest relative errors of gradients, complex64 and complex128:", worst)


def test_heights_of_a_surface_are_along_the_vertical():
    positions = GRID.positions + np.sin(GRID.positions[..., :1]) * np.array([0.1, 0, 0.5])
    valid = np.random.default_rng(0).random(GRID.shape) > 0.3
    A = sarcl.linear.Echoes(sarcl.ImageGrid.points(positions, valid=valid), noise_history(n_rows=5, n_samples=12))
    got = A.gradients(random_vector(42), random_vector(60), of=("heights", "positions"))
    assert np.array_equal(got["heights"], got["positions"][:, 2])
    assert (got["heights"] != 0).tolist() == valid.ravel().tolist()


def test_gradients_hold_weights_windows_and_the_waveform(double):
    like, weights = noise_history(n_rows=13, n_samples=24, bistatic=True), np.linspace(0.2, 1.3, 13)
    waveform = sarcl.Waveform.tone(center=9.6e9, duration=3e-9)
    window = np.linspace(0.5, 1.0, 24)
    m = waveform.matched_spectrum(like.frequency[0] + np.arange(24) * like.frequency_step[0])
    options = {"weights": weights, "window": (window, None), "waveform": waveform}
    A = sarcl.linear.Echoes(GRID, like, exact=True, tolerance=1e-8, device=double, **options)
    x, y = random_vector(GRID.size), random_vector(13 * 24, 1)
    expected = closed_form(like, weights[:, None] * m * window, x, y.reshape(13, 24))
    for kind, value in A.gradients(x, y, of=(*KINDS, "rx")).items():
        assert np.linalg.norm(value - expected[kind]) < 1e-7 * np.linalg.norm(expected[kind]), kind


@pytest.mark.parametrize("kind", ["positions", "tx", "rx", "reference_range"])
@pytest.mark.parametrize("bistatic", [False, True])
def test_differences_of_operators_at_other_values_are_the_gradients(kind, bistatic):
    if kind == "rx" and not bistatic:
        pytest.skip("one antenna")
    like = noise_history(n_rows=5, n_samples=12, bistatic=bistatic)
    A = sarcl.linear.Echoes(GRID.positions.reshape(-1, 3), like, exact=True, tolerance=1e-10)
    x, y = random_vector(A.shape[1]), random_vector(A.shape[0], 1)
    values = {"positions": GRID.positions.reshape(-1, 3), "tx": like.tx, "rx": like.rx}
    values["reference_range"] = like.reference_range
    step = 1e-5 * np.random.default_rng(2).standard_normal(values[kind].shape)
    up, down = (np.vdot(y, A.at(**{kind: values[kind] + s * step}) @ x).real for s in (1, -1))
    expected = (A.gradients(x, y, of=kind)[kind] * step).sum()
    scale = np.linalg.norm(A.gradients(x, y, of=kind)[kind]) * np.linalg.norm(step)
    assert abs((up - down) / 2 - expected) < 1e-4 * scale


def test_phases_turn_samples_of_a_row():
    like = noise_history(n_rows=5, n_samples=12)
    A = sarcl.linear.Echoes(GRID, like, exact=True, tolerance=1e-9)
    x, y, step = random_vector(A.shape[1]), random_vector(A.shape[0], 1), 1e-4 * np.arange(5.0)
    samples = (A @ x).reshape(5, 12)
    up, down = (np.vdot(y, (samples * np.exp(1j * s * step)[:, None]).ravel()).real for s in (1, -1))
    assert np.isclose((up - down) / 2, A.gradients(x, y, of=["phase"])["phase"] @ step, rtol=1e-6)


def test_amplitudes_have_the_adjoint_as_gradient():
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=5, n_samples=12))
    x, y = random_vector(A.shape[1]), random_vector(A.shape[0], 1)
    assert np.array_equal(A.gradients(x, y, of="amplitudes")["amplitudes"], A.H @ y)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"of": "pointing"}, "give antenna="),
        ({"of": "rx"}, "one antenna"),
        ({"x": np.ones(3), "of": "tx"}, r"x has shape \(3,\)"),
        ({"y": np.full(60, np.nan), "of": "tx"}, r"y\[0\]"),
    ],
)
def test_gradients_that_are_not_there_are_refused(arguments, match):
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=5, n_samples=12))
    with pytest.raises(ValueError, match=match):
        A.gradients(**({"x": random_vector(42), "y": random_vector(60)} | arguments))


def antenna_case(name, bistatic, distance=100.0, n_rows=9):
    """A history, the argument antenna=, and its gains, of beams whose flanks lie over the grid."""
    like = noise_history(n_rows=n_rows, n_samples=24, distance=distance, bandwidth=100e6)
    if bistatic:
        rx = like.tx + 0.05 * distance * np.array([0.6, -1.0, 0.2])
        ranges = [np.linalg.norm(end, axis=1) for end in (like.tx, rx)]
        like = replace(like, rx=rx, reference_range=np.mean(ranges, axis=0))
    attitude = sarcl.pointing.spotlight(sarcl.Trajectory(None, like.tx), np.array([1.0, 0.5, 0.0])).attitude
    antenna = everyone()[name], attitude
    return like, antenna, antenna_of(like, antenna, np.zeros(3), "antenna")


def gradient_errors(A, like, gains, seed=0):
    """Relative error of each kind against the reference."""
    x, y = random_vector(A.shape[1], seed), random_vector(A.shape[0], seed + 9)
    weights = np.broadcast_to(np.linspace(0.5, 1.2, like.n_rows)[:, None], (like.n_rows, 24))
    expected = gradients(like, GRID.positions.reshape(-1, 3), weights, x, y.reshape(-1, 24), gains)
    if like.rx is like.tx:
        expected["tx"] = expected["tx"] + expected.pop("rx")
    expected["heights"] = expected["positions"] @ np.cross(GRID.x_axis, GRID.y_axis)
    got = A.gradients(x, y)
    assert got.keys() == expected.keys()
    return {kind: np.linalg.norm(got[kind] - e) / np.linalg.norm(e) for kind, e in expected.items()}


@pytest.mark.parametrize(
    "name, bistatic",
    quick_of(
        [("tapered", True), ("table", False)],
        [(name, two) for name in ("tapered", "gaussian", "table") for two in (False, True)],
    ),
)
def test_gradients_with_an_antenna_are_those_of_its_gains(name, bistatic):
    """All kinds, against differences of sixth order of the gains in float64."""
    like, antenna, gains = antenna_case(name, bistatic)
    for options, gate in (({"tolerance": 1e-5}, 1e-4), ({"tolerance": 1e-9, "exact": True}, 1e-7)):
        A = sarcl.linear.Echoes(GRID, like, antenna=antenna, weights=np.linspace(0.5, 1.2, 9), **options)
        for kind, error in gradient_errors(A, like, gains).items():
            assert error < gate, (kind, options)


@pytest.mark.slow
def test_gradients_of_random_tasks_with_antennas():
    worst = [0.0, 0.0]
    for seed in range(50):
        random = np.random.default_rng(seed)
        name = str(random.choice(["aperture", "tapered", "gaussian", "wide gaussian", "table", "table that shrinks"]))
        n_rows = int(random.choice([1, 2, 13]))
        like, antenna, gains = antenna_case(name, bool(seed % 2), float(random.choice([40.0, 1e3, 1e4])), n_rows)
        for i, options in enumerate(({"tolerance": 1e-5}, {"exact": True, "tolerance": 1e-9})):
            A = sarcl.linear.Echoes(GRID, like, antenna=antenna, weights=np.linspace(0.5, 1.2, n_rows), **options)
            error = max(gradient_errors(A, like, gains, seed).values())
            worst[i] = max(worst[i], error)
            assert error < (1e-4, 1e-7)[i], (seed, i)
    print("largest relative errors of gradients with antennas, complex64 and complex128:", worst)


@pytest.mark.parametrize("kind", ["positions", "tx"])
def test_operators_with_an_antenna_at_other_values_keep_its_axes(kind):
    like, _, _ = antenna_case("gaussian", False, distance=50.0)
    points, antenna = GRID.positions.reshape(-1, 3), everyone()["gaussian"]
    gains = antenna_of(like, antenna, (points.min(axis=0) + points.max(axis=0)) / 2, "antenna")
    A, x = sarcl.linear.Echoes(points, like, antenna=antenna, tolerance=1e-9), random_vector(len(points))
    value = (points if kind == "positions" else like.tx) + 0.3 * np.random.default_rng(2).standard_normal(3)
    moved, points = (like, value) if kind == "positions" else (replace(like, tx=value), points)
    gains = gains.at(PulseGeometry(moved.tx, moved.rx))
    share = np.stack([gains.weights(points, p, gains.frequency) for p in range(9)], axis=1)
    expected = (matrix(moved, points, share=share) @ x).ravel()
    assert np.linalg.norm(A.at(**{kind: value}) @ x - expected) < 1e-8 * np.linalg.norm(expected)


def test_antennas_with_the_same_gain_everywhere_have_no_gradient_of_pointing():
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=5, n_samples=12), antenna=sarcl.Antenna.isotropic())
    assert not A.gradients(random_vector(42), random_vector(60), of="pointing")["pointing"].any()


def test_operators_at_other_values_check_them():
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=5, n_samples=12))
    with pytest.raises(ValueError, match="tx"):
        A.at(tx=np.zeros((4, 3)))
    moved = A.at(positions=GRID.positions.reshape(-1, 3) + np.array([0, 0, 1.0]))
    assert moved.shape == A.shape and moved.tolerance == A.tolerance


def test_the_reference_is_the_derivative_of_the_matrix():
    like = noise_history(n_rows=3, n_samples=4, bistatic=True)
    points, m = GRID.positions.reshape(-1, 3), np.ones((3, 4))
    x, y, random = random_vector(len(points)), random_vector(12, 1).reshape(3, 4), np.random.default_rng(0)
    derivatives = gradients(like, points, m, x, y)

    def value(raw, places):
        return (y.conj() * (matrix(raw, places) @ x)).sum().real

    for kind in ("positions", "tx", "rx", "reference_range"):
        start = points if kind == "positions" else getattr(like, kind)
        step = 1e-6 * random.standard_normal(start.shape)
        ends = [start + s * step for s in (1, -1)]
        if kind == "positions":
            up, down = (value(like, end) for end in ends)
        else:
            up, down = (value(replace(like, **{kind: end}), points) for end in ends)
        assert np.isclose((up - down) / 2, (derivatives[kind] * step).sum(), rtol=1e-3)
