"""What the operator is for: sparse imaging, autofocus by gradient, positions and heights to the Cramer-Rao bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import noise_on
from scipy.ndimage import maximum_filter
from scipy.optimize import minimize
from scipy.sparse.linalg import cg

import sarcl
from sarcl.reference.linear import matrix

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def gotcha(data_folder):
    folder = data_folder / "gotcha"
    if not folder.is_dir():
        pytest.skip("no Gotcha data in the data folder")
    return sarcl.read(sorted(str(path) for path in folder.glob("*.mat")))


def brightest(image, n):
    """Places (n, 2), in pixels, of the n brightest pixels that are the largest within 3 pixels."""
    level = np.abs(image)
    peaks = np.argwhere((level == maximum_filter(level, size=7)) & (level > 0))
    return peaks[np.argsort(level[tuple(peaks.T)])[::-1][:n]]


def test_a_point_is_found_to_the_cramer_rao_bound():
    track = sarcl.Trajectory.circle(radius=700.0, height=500.0, arc=1.5, n_pulses=24)
    like = noise_on(track.positions, n_samples=12, bandwidth=600e6)
    truth, random, n = np.zeros(3), np.random.default_rng(0), 24 * 12
    clean = matrix(like, truth[None]).ravel()
    steps = 1e-5 * np.eye(3)  # m
    slopes = np.stack(
        [(matrix(like, (truth + s)[None]) - matrix(like, (truth - s)[None])).ravel() / 2e-5 for s in steps]
    )
    jacobian = np.stack([clean, 1j * clean, *slopes])
    sigma = np.sqrt(n / 100)  # noise of a sample: 20 dB of energy
    bound = np.sqrt(np.diag(np.linalg.inv(2 / sigma**2 * (jacobian.conj() @ jacobian.T).real)))[2:]
    at_start = sarcl.linear.Echoes(truth[None], like, exact=True, tolerance=1e-6)
    wavelength, toward = 299792458.0 / 9.6e9, like.tx.mean(axis=0) / np.linalg.norm(like.tx.mean(axis=0))

    def estimate(data, start):
        def misfit(x):
            A = at_start.at(positions=(x * wavelength)[None])
            amplitude = (A.H @ data) / n
            residual = A @ amplitude - data
            gradient = A.gradients(amplitude, residual, of="positions")["positions"][0]
            return np.linalg.norm(residual) ** 2 / n, 2 * gradient * wavelength / n

        return minimize(misfit, start / wavelength, jac=True, method="BFGS", options={"gtol": 1e-7}).x * wavelength

    errors = []
    for _ in range(200):
        noise = sigma / np.sqrt(2) * (random.standard_normal(n) + 1j * random.standard_normal(n))
        errors.append(estimate(clean + noise, random.uniform(-0.25, 0.25) * wavelength * toward) - truth)
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    print("rms over bound", rms / bound)
    assert np.all(np.abs(rms / bound - 1) < 0.15)


def test_heights_of_a_hill_are_found_from_two_passes():
    """L band, 100 m apart across the line of sight: a height of 8 m is a cycle, and the hill of 3 m is 2.4 rad."""
    along = np.linspace(-300, 300, 20)[:, None] * np.array([0, 1.0, 0])
    first = np.array([-7e3, 0, 7e3])
    second = first + 100 * np.array([1, 0, 1]) / np.sqrt(2)
    like = noise_on(np.concatenate([first + along, second + along]), n_samples=24, bandwidth=80e6)
    like = replace(like, frequency=np.full(40, 1.26e9))
    flat, up = sarcl.ImageGrid.plane(shape=(12, 12), spacing=3.0).positions.reshape(-1, 3), np.array([0, 0, 1.0])
    hill = 3 * np.exp(-(flat[:, 0] ** 2 + flat[:, 1] ** 2) / (2 * 8.0**2))
    random, n = np.random.default_rng(0), len(flat)
    x = (random.standard_normal(n) + 1j * random.standard_normal(n)) / np.sqrt(2)
    M, shift = matrix(like, flat + hill[:, None] * up).reshape(-1, n), 1e-4 * up
    slope = [matrix(like, flat + hill[:, None] * up + s * shift).reshape(-1, n) for s in (1, -1)]
    clean = M @ x
    sigma = np.sqrt(np.mean(np.abs(clean) ** 2) / 100)
    data = clean + sigma / np.sqrt(2) * (random.standard_normal(len(M)) + 1j * random.standard_normal(len(M)))

    def cosines(k):
        c = np.cos(np.outer(np.arange(k), (np.arange(12) + 0.5) * np.pi / 12))
        return np.einsum("ia,jb->abij", c, c).reshape(n, k * k)

    basis = cosines(7)
    J = np.concatenate([M, 1j * M, (slope[0] - slope[1]) / 2e-4 * x @ basis], axis=1)
    covariance = np.linalg.inv(2 / sigma**2 * (J.conj().T @ J).real)[2 * n :, 2 * n :]
    bound = np.sqrt(np.mean(np.einsum("pi,ij,pj->p", basis, covariance, basis)))
    on_plane, amplitudes = sarcl.linear.Echoes(flat, like, exact=True, tolerance=1e-6), np.zeros(n, complex)

    def misfit(coefficients, basis):
        nonlocal amplitudes
        A = on_plane.at(positions=flat + (basis @ coefficients)[:, None] * up)
        amplitudes, _ = cg(A.H @ A, A.H @ data, x0=amplitudes, rtol=1e-6, maxiter=50)
        rest = A @ amplitudes - data
        of_heights = 2 * A.gradients(amplitudes, rest, of="heights")["heights"]
        return np.linalg.norm(rest) ** 2 / sigma**2, of_heights @ basis / sigma**2

    heights = np.zeros(n)
    for k in (1, 2, 3, 5, 7):  # from slow changes to fast ones
        start = np.linalg.lstsq(cosines(k), heights, rcond=None)[0]
        heights = cosines(k) @ minimize(misfit, start, args=(cosines(k),), jac=True, method="L-BFGS-B").x
    error = np.sqrt(np.mean((heights - hill) ** 2))
    print("rms of the heights, m", error, "bound", bound)
    assert error < 2 * bound


def test_l1_of_a_quarter_of_the_pulses_finds_what_all_of_them_show(gotcha):
    grid = sarcl.ImageGrid.plane(shape=(440, 440), spacing=0.25)  # all that is in the range window
    full = sarcl.backproject(gotcha, grid, window="hamming").data
    rows = np.sort(np.random.default_rng(0).permutation(gotcha.n_rows)[: gotcha.n_rows // 4])
    sparse = gotcha[rows]
    A = sarcl.linear.Echoes(grid, sparse, tolerance=1e-2)
    y, step = sparse.samples[:].ravel(), 1 / A.norm() ** 2
    x = np.zeros(A.shape[1], np.complex64)
    least, z, t = 0.01 * np.abs(A.H @ y).max(), x, 1.0
    for _ in range(100):  # FISTA
        moved = z - step * (A.H @ (A @ z - y))
        before, x = x, moved * np.maximum(1 - step * least / np.maximum(np.abs(moved), 1e-30), 0)
        t, t_before = (1 + np.sqrt(1 + 4 * t * t)) / 2, t
        z = x + (t_before - 1) / t * (x - before)
    found, expected = brightest(x.reshape(grid.shape), 100), brightest(full, 20)
    half_cell = 0.5 * np.array([0.24 / 0.7, 0.45]) / 0.25  # pixels
    near = [(np.abs(found - place) <= half_cell.max() + 0.5).all(axis=1).any() for place in expected]
    print("points found", sum(near))
    assert sum(near) >= 18


def test_autofocus_by_the_gradient_of_sharpness(gotcha):
    """The phase of each pulse, as a polynomial: sum |I|^4 is largest, over all that is in the range window."""
    A = sarcl.linear.Echoes(sarcl.ImageGrid.plane(shape=(360, 360), spacing=0.27), gotcha, tolerance=1e-2)
    u = np.linspace(-1, 1, gotcha.n_rows)
    smooth = np.polynomial.legendre.legval(u, [0, 0, 1.0, -0.6, 0.4])
    phase = 6 / np.sqrt(np.mean(smooth**2)) * smooth  # rad
    data = gotcha.samples[:] * np.exp(1j * phase)[:, None]
    scale = np.linalg.norm(A.H @ gotcha.samples[:].ravel())
    basis = np.polynomial.legendre.legvander(u, 5)[:, 2:]

    def sharpness(coefficients):
        y = data * np.exp(-1j * basis[:, : len(coefficients)] @ coefficients)[:, None]
        image = (A.H @ y.ravel()) / scale
        slope = (A @ (4 * np.abs(image) ** 2 * image) / scale).reshape(y.shape)
        of_phase = (slope.conj() * (-1j * y)).sum(axis=1).real
        return -1e3 * (np.abs(image) ** 4).sum(), -1e3 * (of_phase @ basis[:, : len(coefficients)])

    found = np.zeros(0)
    for _ in range(basis.shape[1]):  # sharpness has many maxima: each term is scanned, then all so far are refined
        candidates = [np.append(found, c) for c in np.linspace(-20, 20, 41)]
        best = min(candidates, key=lambda c: sharpness(c)[0])
        found = minimize(sharpness, best, jac=True, method="L-BFGS-B").x
    rest = phase - basis @ found
    rest -= np.polyval(np.polyfit(u, rest, 1), u)
    print("rms of the phase that is left, rad", rest.std())
    assert rest.std() < 0.1
