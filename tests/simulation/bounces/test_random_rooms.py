"""Echoes of several reflections in random rooms against the reference, which follows every sequence of facets."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import quick_of

import sarcl
from sarcl.reference.bounces import bounce_echo, reflectors

MATERIALS = ["metal", sarcl.Material(4.0 - 0.2j), sarcl.Material(5.0, 0.3), sarcl.Material(3.0, height=0.01)]
WAVE = sarcl.Waveform.chirp(center=1e9, bandwidth=20e6, duration=1e-6)
WINDOW = (-20, 20)  # m, holds echoes of three reflections
TOLERANCES = (1e-1, 1e-2, 1e-3)


def room(seed: int) -> tuple[sarcl.Scene, sarcl.Trajectory, sarcl.Trajectory | None]:
    """Up to 12 facets that cross and shade one another, and antennas at 15 m to 30 km; every other room bistatic."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 13))
    scene = sarcl.Scene.facets(
        rng.uniform(-1.2, 1.2, (n, 3, 3)),
        two_sided=rng.random(n) < 0.7,
        material=rng.integers(0, len(MATERIALS), n),
        materials=MATERIALS,
    )
    distance = (15.0, 100.0, 1e3, 3e4)[seed % 4]
    look = rng.normal(size=3)
    look /= np.linalg.norm(look)
    other = look + 0.5 * rng.normal(size=3)
    receiver = sarcl.Trajectory(None, 1.2 * distance * other[None] / np.linalg.norm(other))
    return scene, sarcl.Trajectory(None, distance * look[None]), receiver if seed % 2 else None


def exact(
    scene: sarcl.Scene, raw: sarcl.PhaseHistory, window: tuple[float, float] = WINDOW
) -> tuple[np.ndarray, float]:
    """Samples (4, n) of up to three reflections, and their norm where those of 1, 2 and 3 add at random phases."""
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    on_plane = 1e-6 * float(np.linalg.norm(np.ptp(scene.triangles.reshape(-1, 3), axis=0)))
    orders = bounce_echo(
        reflectors(scene, f), f, (raw.tx[0], raw.rx[0]), raw.reference_range[0], bounces=3, on_plane=on_plane,
        window=window,
    )  # fmt: skip
    spectrum = WAVE.pulse_spectrum(f)
    orders = orders.reshape(3, len(f), 4).swapaxes(1, 2) * np.abs(spectrum) ** 2
    return orders.sum(axis=0), float(np.linalg.norm(orders))


def bodies(seed: int) -> tuple[sarcl.Scene, sarcl.Trajectory, sarcl.Trajectory | None]:
    """Two tetrahedra that may cut each other and the ground of two triangles, and the antennas of a room, above it."""
    rng = np.random.default_rng(1000 + seed)
    faces = []
    for _ in range(2):
        corners = rng.uniform((-1, -1, -0.4), (1, 1, 1.6), (4, 3))
        if np.linalg.det(corners[1:] - corners[0]) > 0:
            corners = corners[[1, 0, 2, 3]]
        faces.append(corners[[(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]])
    ground = np.array([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], float)
    _, track, receiver = room(seed)
    above = [end and sarcl.Trajectory(None, np.abs(end.positions)) for end in (track, receiver)]
    triangles = np.concatenate([*faces, ground[[(0, 1, 2), (0, 2, 3)]]])
    material = np.repeat([0, 1, 2], (4, 4, 2))
    return sarcl.Scene.facets(triangles, material=material, materials=MATERIALS), *above


def check(
    scene: sarcl.Scene, track: sarcl.Trajectory, receiver: sarcl.Trajectory | None, tolerances: tuple[float, ...],
    window: tuple[float, float] = WINDOW,
) -> None:  # fmt: skip
    truth: tuple[np.ndarray, float] | None = None
    for tolerance in tolerances:
        raw = sarcl.echo(
            scene, WAVE, track, receiver=receiver, bounces=3, polarization="all", range_window=window,
            tolerance=tolerance, check=False,
        )  # fmt: skip
        truth = truth or exact(scene, raw, window)
        error = np.linalg.norm(raw.samples - truth[0]) / max(np.linalg.norm(truth[0]), truth[1])
        assert error <= raw.report.predicted_error <= tolerance


@pytest.mark.parametrize("seed", [1, 2, 43])  # 43: a receiver almost in the plane of a last facet
def test_a_random_room_is_within_the_tolerance(seed):
    check(*room(seed), TOLERANCES)


@pytest.mark.parametrize("seed", [1, 2])
def test_closed_bodies_on_ground_are_within_the_tolerance(seed):
    check(*bodies(seed), (1e-3,))


@pytest.mark.parametrize("seed", quick_of([1], range(1, 31)))
def test_a_range_window_may_end_on_what_facets_reflect_to_one_another(seed):
    """Windows that end between the delays of one reflection and of two, and within them."""
    low, width = np.random.default_rng(seed).uniform((-0.8, 0.3), (0.6, 2.0))
    check(*room(seed), TOLERANCES[1:], window=(low, low + width))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 81))
def test_random_rooms_are_within_every_tolerance(seed):
    check(*room(seed), TOLERANCES)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 33))
def test_random_bodies_are_within_the_tolerance(seed):
    check(*bodies(seed), (1e-3,))


def test_the_check_of_an_echo_is_that_of_the_reference():
    scene, track, _ = room(5)
    raw = sarcl.echo(scene, WAVE, track, bounces=3, range_window=WINDOW, tolerance=1e-2, check=True)
    assert raw.report.measured_error is not None
    assert 0 < raw.report.measured_error <= raw.report.predicted_error
