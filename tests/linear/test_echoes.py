"""sarcl.linear.Echoes: each direction is the exact sum, and one is the adjoint of the other."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import threading
from dataclasses import replace

import numpy as np
import pytest
from helpers.antenna_cases import everyone
from helpers.cases import noise_history, noise_on, quick_of
from scipy.sparse import csr_matrix

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.antenna_beam import antenna_of
from sarcl.opencl.device import Device
from sarcl.opencl.failures import DeviceFailed
from sarcl.reference.equations import point_echo
from sarcl.reference.linear import matrix, spread
from sarcl.simulation import kernel_images
from sarcl.simulation.points.direct import PointSpreader

GRID = sarcl.ImageGrid.plane(shape=(17, 12), spacing=0.25)


def random_vector(n, seed=0, kind=np.complex64):
    random = np.random.default_rng(seed)
    return (random.standard_normal(n) + 1j * random.standard_normal(n)).astype(kind)


def dot_error(A, seed=0, kind=np.complex64):
    """|<y, A x> - <A.H y, x>| over the norms of A x and y, for random x and y."""
    x, y = random_vector(A.shape[1], seed, kind), random_vector(A.shape[0], seed + 1, kind)
    a, b = (A @ x).astype(np.complex128), (A.H @ y).astype(np.complex128)
    return abs(np.vdot(y, a) - np.vdot(b, x)) / max(np.linalg.norm(a) * np.linalg.norm(y), 1e-300)


def errors(A, M, x, y):
    """Relative errors of A x and A.H y, as tolerances are defined, against the matrix M (rows, samples, pixels)."""
    flat = M.reshape(-1, M.shape[-1])
    echoes, image = flat @ x, flat.conj().T @ y
    expected = np.sqrt((abs(flat) ** 2 @ abs(x) ** 2).sum())
    rows = np.einsum("pnx,pn->px", M.conj(), y.reshape(M.shape[:2]))
    forward = np.linalg.norm(A @ x - echoes) / max(np.linalg.norm(echoes), expected)
    return forward, np.linalg.norm(A.H @ y - image) / max(np.linalg.norm(image), np.linalg.norm(rows))


def random_task(seed):
    """A domain, echoes and options, drawn from a number."""
    random = np.random.default_rng(seed)
    kind, n_rows = seed % 6, int(random.integers(1, 30))
    distance = (10e3, 10e3, 30.0, 7e5, 5e3, 10e3)[kind]
    extra = {"arc": 0.3} if kind == 1 else {}
    like = noise_history(n_rows=n_rows, distance=distance, bistatic=bool(seed % 2), seed=seed, n_samples=24, **extra)
    if kind == 4:  # channels of other frequencies
        like = replace(like, frequency=like.frequency + 2e7 * (np.arange(n_rows) % 3), tx_channel=np.arange(n_rows) % 3)
    shape = (1, 1) if kind == 5 else tuple(random.integers(2, 14, 2))
    center = 3 * random.standard_normal(3)
    domain = sarcl.ImageGrid.plane(center=center, shape=shape, spacing=float(random.uniform(0.05, 0.6)))
    if seed % 4 == 0:
        domain = center + 4 * random.standard_normal((int(random.integers(1, 150)), 3))
    options = {"wrap": seed % 5 == 0}
    if seed % 3 == 0:
        options |= {"weights": random.random(n_rows) + 0.1, "window": "hamming"}
    if seed % 7 == 0:
        options["waveform"] = sarcl.Waveform.tone(center=9.6e9, duration=4e-9)
    if seed % 8 == 3:
        options["antenna"] = sarcl.Antenna.gaussian(width=0.5)
    return domain, like, options


@pytest.mark.parametrize("tolerance", quick_of([1e-3], [1e-2, 1e-3, 1e-5]))
@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 200), marks=pytest.mark.slow)])
def test_one_direction_is_the_adjoint_of_the_other(seeds, tolerance):
    worst = 0.0
    for seed in seeds:
        domain, like, options = random_task(seed)
        A = sarcl.linear.Echoes(domain, like, tolerance=tolerance, **options)
        error = dot_error(A, seed)
        worst = max(worst, error / tolerance)
        assert error < tolerance / 10, seed
    print("largest error of the dot test, in tolerances:", worst)


@pytest.mark.parametrize("distance", [30.0, 10e3])
def test_few_numbers_do_not_make_the_dot_test_worse(distance):
    """Errors of few numbers do not cancel in sums: plans of such tasks have smaller ones."""
    like = noise_history(n_rows=9, n_samples=2, distance=distance, bandwidth=100e6)
    for seed in range(6):
        points = 3 * np.random.default_rng(seed).standard_normal((1 + seed, 3))
        A = sarcl.linear.Echoes(points, like, tolerance=2e-4)
        assert max(dot_error(A, s) for s in range(4)) < 2e-5


@pytest.mark.parametrize("seeds", [range(8, 12), pytest.param(range(200), marks=pytest.mark.slow)])
def test_exact_adjoints_are_exact_to_rounding(seeds):
    for seed in seeds:
        domain, like, options = random_task(seed)
        A = sarcl.linear.Echoes(domain, like, exact=True, tolerance=10.0 ** -(2 + seed % 7), **options)
        assert dot_error(A, seed) < 1e-6
        assert dot_error(A, seed, np.complex128) < 1e-12


@pytest.mark.parametrize("beam", [3e-4, (4e-4, (1.0, 0.1, 0.0))])
def test_beams_and_windows_over_the_aperture_of_each_pixel_have_adjoints_too(beam, device):
    like = noise_history(n_rows=25, n_samples=24)
    toward = -like.tx / np.linalg.norm(like.tx, axis=1)[:, None]
    if isinstance(beam, tuple):
        beam = beam[0], toward + 1e-4 * np.array(beam[1])
    if not device.info.fp64:
        with pytest.raises(ValueError, match="float64"):
            sarcl.linear.Echoes(GRID, like, beam=beam, device=device)
        return
    A = sarcl.linear.Echoes(GRID, like, beam=beam, window="hamming", device=device)
    assert dot_error(A) < 1e-6
    cone = (beam, toward) if isinstance(beam, float) else beam
    A = sarcl.linear.Echoes(GRID, like, beam=beam, exact=True, device=device, tolerance=1e-7)
    M = matrix(like, GRID.positions.reshape(-1, 3), beam=cone)
    assert 0.1 < np.abs(M).mean() < 0.95
    x, y = random_vector(A.shape[1]), random_vector(A.shape[0])
    assert max(errors(A, M, x, y)) < 1e-7


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("tolerance", quick_of([1e-1, 1e-3, 1e-6], [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6]))
def test_both_directions_are_the_exact_sums(tolerance, exact):
    like = noise_history(n_rows=33, n_samples=40, bistatic=True)
    A = sarcl.linear.Echoes(GRID, like, tolerance=tolerance, exact=exact)
    M = matrix(like, GRID.positions.reshape(-1, 3))
    y = random_vector(A.shape[0], 1)
    for x in (random_vector(A.shape[1]), np.ones(A.shape[1], np.complex64)):
        assert max(errors(A, M, x, y)) <= A.predicted_error <= tolerance


def test_both_directions_are_the_exact_sums_on_every_device(device):
    like = noise_history(n_rows=9, n_samples=40)
    M, y = matrix(like, GRID.positions.reshape(-1, 3)), random_vector(360, 1)
    for exact in (False, True)[: 1 + device.info.fp64]:
        A = sarcl.linear.Echoes(GRID, like, tolerance=1e-4, exact=exact, device=device)
        assert max(errors(A, M, random_vector(A.shape[1]), y)) <= 1e-4
    if not device.info.fp64:
        with pytest.raises(ValueError, match="exact=True needs float64"):
            sarcl.linear.Echoes(GRID, like, exact=True, device=device)


def test_equal_amplitudes_on_a_lattice_meet_the_tolerance(monkeypatch):
    """240 x 240 points in phase at an image of the interpolation kernel, of profiles of twice the samples."""
    toward = np.array([0.6, 0.5, 0.62])
    like = noise_on(8e3 * toward[None], n_samples=512, bandwidth=200e6)
    frequencies = like.frequency[0] + np.arange(512) * like.frequency_step[0]
    image = 9.6e9 + 1024 * like.frequency_step[0] - 0.4 * 200e6  # of the edge of the band, Hz
    i, j = np.indices((240, 240)).reshape(2, -1) - 119.5
    x, y, _ = toward / np.linalg.norm(toward)
    points = np.stack([i * 5 / x, j * 3 / y, 0 * i], axis=1) * SPEED_OF_LIGHT / (2 * image)
    ones = np.ones(len(points))
    expected = point_echo(points, ones, frequencies, like.tx[0], like.rx[0], like.reference_range[0])
    scale = max(np.linalg.norm(expected), 240 * np.sqrt(512))

    def error_and_prediction():
        A = sarcl.linear.Echoes(points, like, tolerance=1e-4, exact=True)
        return np.linalg.norm(A @ ones - expected) / scale, A.predicted_error

    error, predicted = error_and_prediction()
    assert error <= predicted <= 1e-4
    monkeypatch.setattr(kernel_images.PatchSamples, "error", lambda *_: 0.0)
    assert error_and_prediction()[0] > 1e-4  # without the measured images the lattice breaks the tolerance


def test_the_range_window_cuts_both_directions_alike():
    like = noise_history(n_rows=12, n_samples=24)
    half = 299792458.0 / (4 * like.frequency_step[0])
    grid = sarcl.ImageGrid.plane(shape=(40, 40), spacing=half / 12)
    M = matrix(like, grid.positions.reshape(-1, 3))
    assert 0.1 < np.abs(M).mean() < 0.9
    for options in ({}, {"exact": True}):
        A = sarcl.linear.Echoes(grid, like, **options)
        assert max(errors(A, M, random_vector(A.shape[1]), random_vector(A.shape[0], 1))) < 1e-3


def test_weights_windows_and_the_waveform_are_in_both_directions():
    like, random = noise_history(n_rows=12, n_samples=24), np.random.default_rng(0)
    waveform, rows = sarcl.Waveform.tone(center=9.6e9, duration=3e-9), random.random(12)
    like = replace(like, weight=np.linspace(1, 2, 12))
    frequencies = like.frequency[0] + np.arange(24) * like.frequency_step[0]
    window = np.hamming(24), None
    m = (rows * like.weight)[:, None] * (window[0] * waveform.matched_spectrum(frequencies))
    M = matrix(like, GRID.positions.reshape(-1, 3)) * m[..., None]
    for options in ({"tolerance": 1e-5}, {"exact": True, "tolerance": 1e-5}):
        A = sarcl.linear.Echoes(GRID, like, waveform=waveform, weights=rows, window=window, **options)
        assert max(errors(A, M, random_vector(A.shape[1]), random_vector(A.shape[0], 1))) < 1e-5


@pytest.mark.parametrize(
    "name, bistatic",
    quick_of(
        [("gaussian", False), ("table that shrinks", True)],
        [(name, two) for name in ("tapered", "gaussian", "table that shrinks") for two in (False, True)],
    ),
)
@pytest.mark.costly
def test_antennas_weigh_both_directions_in_float64(name, bistatic, double):
    """Gains at the centre of the band, in the matrix and in A; a beam cuts both."""
    like = noise_history(n_rows=12, n_samples=24, distance=100.0, bandwidth=100e6, bistatic=bistatic)
    gains = antenna_of(like, everyone()[name], np.zeros(3), "antenna")
    share = np.stack([gains.weights(GRID.positions.reshape(-1, 3), p, gains.frequency) for p in range(12)], axis=1)
    M = matrix(like, GRID.positions.reshape(-1, 3), share=share)
    for options, gate in (({"exact": True, "tolerance": 1e-8}, 1e-12), ({"tolerance": 1e-9, "beam": 0.5}, 1e-9)):
        A = sarcl.linear.Echoes(GRID, like, antenna=everyone()[name], device=double, **options)
        x, y = (random_vector(n, k, np.complex128) for k, n in enumerate(A.shape[::-1]))
        assert max(errors(A, M, x, y)) <= A.predicted_error <= A.tolerance
        assert dot_error(A, kind=np.complex128) < gate


def test_gains_that_float32_cannot_hold_take_the_pair_in_float64():
    like = noise_history(n_rows=12, n_samples=24, distance=100.0, bandwidth=100e6)
    A = sarcl.linear.Echoes(GRID, like, antenna=sarcl.Antenna.gaussian(width=0.05), tolerance=1e-6)
    assert A.predicted_error <= 1e-6 and A.dtype == np.complex64
    window = (None, "hann")
    with pytest.raises(ValueError, match="leave one out"):
        sarcl.linear.Echoes(GRID, like, antenna=sarcl.Antenna.isotropic(), beam=0.001, window=window)


def test_antennas_weigh_both_directions():
    like = noise_history(n_rows=20, n_samples=24, distance=100.0, bandwidth=100e6)
    antenna = sarcl.Antenna.gaussian(width=0.1)
    grid = sarcl.ImageGrid.plane(shape=(14, 14), spacing=0.5)
    A = sarcl.linear.Echoes(grid, like, antenna=antenna)
    assert dot_error(A) < 1e-4
    image = sarcl.backproject(replace(like, samples=random_vector(A.shape[0], 1).reshape(20, 24)), grid, beam=antenna)
    difference = A.H @ random_vector(A.shape[0], 1) - image.data.ravel()
    assert np.linalg.norm(difference) < 2e-3 * np.linalg.norm(image.data)


def test_it_is_the_verbs():
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
    track = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=0.03, n_pulses=48)
    positions = GRID.positions.reshape(-1, 3)
    x = random_vector(len(positions), kind=np.complex128)
    raw = sarcl.echo(sarcl.Scene.points(positions, x), chirp, track, range_window=(-40.0, 40.0))
    A = sarcl.linear.Echoes(GRID, raw)
    echoes = raw.samples.ravel()
    assert np.linalg.norm(A @ x - echoes) < 2e-3 * np.linalg.norm(echoes)
    image = sarcl.backproject(raw, GRID).data.ravel()
    assert np.linalg.norm(A.H @ echoes - image) < 2e-3 * np.linalg.norm(image)
    assert np.allclose(A.normal(x), A.H @ (A @ x))


@pytest.mark.slow
def test_factorized_pairs_meet_the_tolerance():
    track = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=0.03, n_pulses=128)
    like = noise_on(track.positions, n_samples=64)
    grid = sarcl.ImageGrid.plane(shape=(48, 48), spacing=0.1)
    M = matrix(like, grid.positions.reshape(-1, 3))
    A = sarcl.linear.Echoes(grid, like, method="factorized", tolerance=1e-2)
    for seed in range(2):  # applications in turn share plans and buffers
        assert max(errors(A, M, random_vector(A.shape[1], seed), random_vector(A.shape[0], seed + 5))) < 1e-2


def test_memory_limits_change_nothing_but_rounding():
    like, grid = noise_history(n_rows=200, n_samples=16), sarcl.ImageGrid.plane(shape=(64, 64), spacing=0.1)
    x, y = random_vector(grid.size), random_vector(200 * 16)
    for exact in (False, True):
        A, B = (sarcl.linear.Echoes(grid, like, exact=exact, max_bytes=m) for m in (None, 1e6))
        for one, other in ((A @ x, B @ x), (A.H @ y, B.H @ y)):
            assert np.linalg.norm(one - other) < 1e-6 * np.linalg.norm(one)
        one, other = (op.gradients(x, y, of="positions")["positions"] for op in (A, B))
        assert np.linalg.norm(one - other) < 1e-9 * np.linalg.norm(one)


@pytest.mark.parametrize("options", [{}, {"exact": True}, {"max_bytes": 1e6}])
def test_normal_makes_each_sample_once_and_in_blocks(options, monkeypatch):
    """Of 256 rows at most; with little memory the image is made in parts, which read samples again."""
    like, side = noise_history(n_rows=600, n_samples=16), 224 if "max_bytes" in options else 40
    grid = sarcl.ImageGrid.plane(shape=(side, side), spacing=0.03)
    A = sarcl.linear.Echoes(grid, like, weights=np.linspace(0.5, 1.5, 600), **{"method": "direct"} | options)
    x, made, add = random_vector(grid.size), [], PointSpreader.add

    def watched(self, samples, pulses, *rest):
        made.append((pulses[0], pulses[-1] + 1))
        return add(self, samples, pulses, *rest)

    monkeypatch.setattr(PointSpreader, "add", watched)
    got = A.normal(x)
    monkeypatch.undo()
    expected = A.H @ (A @ x)
    assert np.linalg.norm(got - expected) < 1e-6 * np.linalg.norm(expected)
    assert made == [(0, 256), (256, 512), (512, 600)] or options
    assert max([b - a for a, b in made], default=0) <= 256
    again = len(made) - len(set(made))
    assert again <= len(set(made)) and (again > 0) == ("max_bytes" in options)
    with pytest.raises(ValueError, match=r"x has shape \(3,\)"):
        A.normal(np.ones(3))


def test_empty_cells_of_a_grid_send_and_get_nothing():
    positions = GRID.positions.copy()
    valid = np.random.default_rng(0).random(GRID.shape) > 0.3
    grid = sarcl.ImageGrid.points(positions, valid=valid)
    like, M = noise_history(n_rows=9, n_samples=24), None
    M = matrix(like, positions.reshape(-1, 3)) * valid.ravel()
    for options in ({}, {"exact": True}):
        A = sarcl.linear.Echoes(grid, like, **options)
        assert max(errors(A, M, random_vector(A.shape[1]), random_vector(A.shape[0], 1))) < 1e-3


def test_numbers_of_any_size_keep_their_precision():
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=9, n_samples=24))
    x, y = random_vector(A.shape[1]), random_vector(A.shape[0])
    for exponent in (-60, 60):
        scale = np.float32(2.0**exponent)
        assert np.array_equal(A @ (x * scale), (A @ x) * scale)
        assert np.array_equal(A.H @ (y * scale), (A.H @ y) * scale)
    assert not (A @ np.zeros_like(x)).any()


def test_types_follow_the_tolerance_and_exact_input():
    like = noise_history(n_rows=5, n_samples=8)
    x = random_vector(GRID.size, kind=np.complex128)
    for options, single, double in (({}, "F", "F"), ({"exact": True}, "F", "D"), ({"tolerance": 1e-7}, "D", "D")):
        A = sarcl.linear.Echoes(GRID, like, **options)
        assert ((A @ x.astype(np.complex64)).dtype.char, (A @ x).dtype.char) == (single, double)
        assert (A @ x.real.astype(np.float32)).dtype.char == single


def test_matrices_norms_and_batches():
    like = noise_history(n_rows=9, n_samples=16)
    A = sarcl.linear.Echoes(GRID, like, exact=True, tolerance=1e-6)
    M = matrix(like, GRID.positions.reshape(-1, 3)).reshape(A.shape)
    X = np.stack([random_vector(A.shape[1], s) for s in range(3)], axis=1)
    assert np.allclose(A @ X, M @ X, atol=1e-4)
    largest = np.linalg.svd(M, compute_uv=False)[0]
    assert largest * (1 - 2e-3) < A.norm() < largest * (1 + 1e-6)
    batch = X.T.reshape(3, 1, *GRID.shape)
    samples = A.A(batch)
    assert samples.shape == (3, 1, 9, 16) and np.allclose(samples.reshape(3, -1), (A @ X).T)
    assert A.A_adjoint(samples).shape == batch.shape
    assert A.H.H is A and (2 * A).shape == A.shape


@pytest.mark.parametrize("exact", [False, True])
def test_the_algebra_of_operators_and_other_input(exact):
    like = noise_history(n_rows=9, n_samples=16)
    A = sarcl.linear.Echoes(GRID, like, exact=exact)
    M = matrix(like, GRID.positions.reshape(-1, 3)).reshape(A.shape)
    x, y = random_vector(A.shape[1]), random_vector(A.shape[0], 1)
    half = -A * 0.5
    for got, expected in (
        (half @ x, -0.5 * M @ x),
        (half.H @ y, -0.5 * M.conj().T @ y),
        ((A.H @ A) @ x, M.conj().T @ (M @ x)),
        ((A.H * A).dot(x), M.conj().T @ (M @ x)),
        (A.T @ y, M.T @ y),
        (y @ A, y @ M),
        (A @ x.real, M @ x.real),
        (A @ np.arange(204, dtype=np.uint8), M @ np.arange(204)),
        (A @ np.repeat(x, 2)[::-2], M @ x[::-1]),
        (A @ x.astype(">c8"), M @ x),
        (A.H @ np.asfortranarray(np.outer(y, [1, 2j])), M.conj().T @ np.outer(y, [1, 2j])),
    ):
        assert np.linalg.norm(got - expected) < 1e-3 * np.linalg.norm(expected)
    assert (A @ np.zeros((204, 0))).shape == (144, 0) and A.A(np.zeros((0, 17, 12))).shape == (0, 9, 16)


def test_reference_sums_are_those_of_the_matrix():
    like = noise_history(n_rows=3, n_samples=5)
    points = GRID.positions.reshape(-1, 3)[:4]
    assert np.allclose(spread(like, points, np.eye(4)[2]), matrix(like, points)[..., 2])


@pytest.mark.parametrize(
    ("wrong", "error", "match"),
    [
        (lambda A: A @ np.ones(3), ValueError, r"\(3,\).*\(144, 204\).*\(204,\)"),
        (lambda A: A.H @ np.ones(204), ValueError, r"\(204,\).*\(204, 144\).*each sample"),
        (lambda A: A @ np.full(204, np.nan), ValueError, r"x\[0\]"),
        (lambda A: A.H @ np.r_[np.zeros(7), np.inf, np.zeros(136)], ValueError, r"y\[7\]"),
        (lambda A: A.A(np.ones((12, 17))), ValueError, "17, 12"),
        (lambda A: A.norm(tolerance=0), ValueError, "tolerance"),
        (lambda A: A @ np.full(204, 1e60), ValueError, r"x has numbers to 1e\+60.*complex64: scale x"),
        (lambda A: A @ np.full(204, 1e-60), ValueError, "scale x"),
        (lambda A: A.H @ np.full(144, 3e38), ValueError, "scale y"),
        (lambda A: A @ csr_matrix(np.ones((204, 1))), TypeError, "toarray"),
        (lambda A: A @ 3.0, ValueError, "Scalar"),
        (lambda A: A.gradients(np.ones(204), np.ones(144), of=3), ValueError, "of is 3; choose"),
        (lambda A: pickle.dumps(A), TypeError, "cannot be pickled"),
        (lambda A: copy.deepcopy(A), TypeError, "make it in the process"),
    ],
)
def test_wrong_input_is_refused(wrong, error, match):
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=9, n_samples=16))
    with pytest.raises(error, match=match):
        wrong(A)


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"tolerance": 1e-17}, ValueError, "tolerance"),
        ({"tolerence": 1e-3}, TypeError, "did you mean 'tolerance'"),
        ({"method": "fast"}, ValueError, "method"),
        ({"exact": "yes"}, TypeError, "exact"),
        ({"exact": True, "method": "factorized"}, ValueError, "float64"),
        ({"weights": np.ones(8)}, ValueError, "weights"),
        ({"beam": sarcl.Antenna.gaussian(width=0.1)}, TypeError, "antenna="),
        ({"antenna": 0.1}, TypeError, "antenna is a float"),
        ({"antenna": (sarcl.Antenna.gaussian(width=0.1), (0, 0))}, ValueError, r"antenna\[1\] has shape \(2,\)"),
        ({"antenna": (sarcl.Antenna.gaussian(width=0.1), (0, 0, 1))}, ValueError, "aim it: give"),
        ({"waveform": sarcl.Waveform.chirp(center=1e9, bandwidth=1e6, duration=1e-6)}, ValueError, "waveform"),
        ({"waveform": "chirp"}, TypeError, "waveform"),
    ],
)
def test_wrong_options_are_refused(options, error, match):
    with pytest.raises(error, match=match):
        sarcl.linear.Echoes(GRID, noise_history(n_rows=9, n_samples=16), **options)


def test_echoes_that_are_not_compressed_are_refused():
    like = replace(noise_history(n_rows=9, n_samples=16), compressed=False)
    with pytest.raises(ValueError, match="compress"):
        sarcl.linear.Echoes(GRID, like)


def test_threads_take_turns():
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=9, n_samples=16))
    vectors = [random_vector(A.shape[1], s) for s in range(8)]
    expected, got = [A.normal(x) for x in vectors], [None] * 8

    def work(i):
        got[i] = A.normal(vectors[i])

    threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(a, b) for a, b in zip(expected, got, strict=True))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_is_refused():
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=9, n_samples=16))
    A @ random_vector(A.shape[1])
    ours, theirs = multiprocessing.Pipe()

    def child():
        try:
            A @ random_vector(A.shape[1])
        except RuntimeError as refused:
            theirs.send(str(refused))
        else:
            theirs.send("")

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    assert ours.poll(60) and "spawn" in ours.recv()
    process.join()


@pytest.mark.parametrize("exact", [False, True])
def test_an_operator_is_right_again_after_its_device_failed(exact, monkeypatch):
    A = sarcl.linear.Echoes(GRID, noise_history(n_rows=9, n_samples=16), exact=exact)
    x, y = random_vector(A.shape[1]), random_vector(A.shape[0], 1)
    uses = (lambda: A @ x, lambda: A.H @ y, lambda: A.normal(x), lambda: A.gradients(x, y, of="tx")["tx"])
    expected, run = [use() for use in uses], Device.run

    def lost(self, kernel, *arguments, **options):
        run(self, kernel, *arguments, **options)
        raise DeviceFailed("lost")

    monkeypatch.setattr(Device, "run", lost)
    for use in uses:
        with pytest.raises(DeviceFailed, match="lost"):
            use()
    monkeypatch.undo()
    for use, value in zip(uses, expected, strict=True):
        assert np.array_equal(use(), value)


@pytest.mark.slow
@pytest.mark.parametrize("exact", [False, True])
def test_a_hundred_applications_leak_nothing(exact):
    like = noise_on(np.tile([[0.0, -7e3, 7e3]], (64, 1)) + np.arange(64)[:, None], n_samples=64)
    A = sarcl.linear.Echoes(sarcl.ImageGrid.plane(shape=(128, 128), spacing=0.3), like, exact=exact)
    x, status = random_vector(A.shape[1]), "/proc/self/statm"
    if not os.path.exists(status):
        pytest.skip("no /proc")

    def resident():
        with open(status) as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    for _ in range(20):
        A.normal(x)
    before = resident()
    for _ in range(100):
        A.normal(x)
    assert resident() - before < 4e6  # bytes; one image more in each application would be 13 MB
