"""Errors of interpolation that add up over few rows, against what the planner takes them to be."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging import choose_method, profile_energy
from sarcl.imaging.focusing_task import make_task
from sarcl.numerics import interpolation, interpolator_choice
from sarcl.opencl import fft

KERNELS = (4, 2.0), (4, 4.0), (6, 3.0), (2, 16.0), (8, 1.5)
DATA = "noise", "some samples", "one sample alike in all rows", "a point", "the edge of the band alone"


def drawn(seed):
    """A few rows on a line, at one place or scattered, and a few pixels: raw, grid."""
    random = np.random.default_rng(seed)

    def log(low, high):
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    n_rows, n, pixels, bandwidth = int(log(2, 41)), int(log(1, 40)), int(log(1, 6)), 1e10 * log(1e-3, 1.5)
    t, step = np.linspace(-0.5, 0.5, n_rows)[:, None], log(1e-4, 30)
    kind, data = int(random.integers(4)), DATA[int(random.integers(5))]
    ways = 0 * t, t * (0, 1, 0), random.normal(size=(n_rows, 3)), t * (1, 0.3, 0)
    tx = np.array([[-700.0, 0, 700]]) + step * ways[kind]
    samples = random.normal(size=(n_rows, n)) + 1j * random.normal(size=(n_rows, n))
    if data == "some samples":
        samples *= random.random(n) < 0.2
        samples[0, 0] += 1
    elif data == "one sample alike in all rows":
        samples[:, 0] = 2 * samples[0, 0]
    elif data == "a point":
        samples = np.broadcast_to(np.exp(2j * np.pi * random.random() * np.arange(n)), samples.shape)
    elif data == "the edge of the band alone":
        samples = (np.arange(n) == 0) * np.exp(2j * np.pi * random.random((n_rows, 1)))
    raw = sarcl.PhaseHistory(
        samples, frequency=1e10 - bandwidth / 2, frequency_step=bandwidth / n, tx=tx,
        reference_range=np.linalg.norm(tx, axis=1),
    )  # fmt: skip
    cell = SPEED_OF_LIGHT / 2 / bandwidth
    return raw, sarcl.ImageGrid.points(random.normal(size=(pixels, 3)) * cell * random.choice([0.01, 1, 5]))


def waves(task):
    """Waves of all samples at the delays of all pixels (n_rows, n, n_samples), delays and turns of the carrier."""
    raw, k = task.raw, np.arange(task.raw.n_samples) - task.raw.n_samples // 2
    moved = np.linalg.norm(raw.tx[:, None] - task.grid.positions, axis=-1) - raw.reference_range[:, None]
    delays = 2 / SPEED_OF_LIGHT * raw.frequency_step[:, None] * moved
    carrier = raw.frequency + raw.n_samples // 2 * raw.frequency_step
    turns = np.exp(4j * np.pi / SPEED_OF_LIGHT * carrier[:, None] * moved)
    return np.exp(2j * np.pi * delays[..., None] * k), delays, turns


def errors(task):
    """Errors of images whose profiles are interpolated in float64, relative to those of the kernels: length, error."""
    raw, k, found = task.raw, np.arange(task.raw.n_samples) - task.raw.n_samples // 2, []
    exact, delays, turns = waves(task)
    rows = (exact * raw.samples[:, None]).sum(axis=-1) * turns
    scale = max(np.linalg.norm(rows.sum(axis=0)), np.linalg.norm(rows))
    for taps, oversample in KERNELS:
        kernel = interpolation.interpolator(taps, oversample)
        length = interpolator_choice.profile_length(oversample, raw.n_samples, taps)
        place = delays * length - (taps - 1) / 2
        first = np.rint(place)
        read = np.exp(2j * np.pi * (first[..., None] + np.arange(taps))[..., None] * k / length)
        made = (kernel.weights(place - first)[..., None] * read / kernel.transform(k / length)).sum(axis=-2)
        wrong = ((made - exact) * raw.samples[:, None]).sum(axis=-1) * turns
        found.append((length, np.linalg.norm(wrong.sum(axis=0)) / scale / kernel.error))
    return found


def exceeded(seeds):
    """By how much the largest of the errors exceeds what is planned for: the ratios that are above 1."""
    found = []
    for seed in seeds:
        raw, grid = drawn(seed)
        task = make_task(raw, grid, None, None, True, True)
        energy = profile_energy.estimate(task)
        found.append(max(error / energy.darkness(length) for length, error in errors(task)))
    return [ratio for ratio in found if ratio > 1]


@pytest.mark.parametrize("seeds", [range(150), pytest.param(range(1000, 2500), marks=pytest.mark.slow)], ids=str)
def test_errors_of_few_rows_are_those_planned_for(seeds):
    """The largest of five kernels in data made to be hard: 1 in 700 exceeds the estimate, by less than a fifth."""
    above = exceeded(seeds)
    assert len(above) <= 1 + len(seeds) / 500 and max(above, default=0) < 1.2


def test_errors_that_add_up_in_power_alone_would_be_exceeded(monkeypatch):
    monkeypatch.setattr(profile_energy.RowsInPhase, "ratio", lambda self, length: 0.0)
    assert len(exceeded(range(150))) >= 3


@pytest.mark.parametrize("seed", range(12))
def test_the_sums_are_those_of_the_waves(seed):
    raw, grid = drawn(seed)
    weights = np.linspace(1, 2, raw.n_rows)
    task = make_task(raw, grid, None, weights, True, True)
    energy = profile_energy.estimate(task)
    exact, delays, turns = waves(task)
    turns = turns * weights[:, None]
    spectra = exact * raw.samples[:, None] * turns[..., None]  # (n_rows, n, n_samples)
    rows = spectra.sum(axis=-1)
    scale = max(np.linalg.norm(rows.sum(axis=0)), np.linalg.norm(rows))
    n = raw.n_samples
    k, fine = np.arange(n) - n // 2, fft.good_length(max(4 * n, 48))
    edge = [max(abs(i) / max(n // 2, 1), 0.5) if n > 1 else 1.0 for i in k]
    for length in (0, 24, 37):
        most = 0.0
        for image in {0, length, -length}:
            turned = (spectra * edge * np.exp(2j * np.pi * image * delays)[..., None]).sum(axis=0)
            most = max(most, *(np.linalg.norm(turned @ np.exp(2j * np.pi * k * i / fine)) for i in range(-7, 7)))
        assert energy.rows.ratio(length) == pytest.approx(most / scale, rel=1e-6)
        assert energy.near(length) == max(energy.near_pixels, energy.rows.ratio(length))


def test_a_plan_has_the_errors_of_the_length_of_its_profiles(device):
    """Profiles of 30 samples, a rate of 600 MHz, hold an image of the carrier of 620 MHz at 20 MHz, at which rows of a
    point add up tens of metres away from it too, where its image is dark."""
    y = np.linspace(-150, 150, 31)
    tx = np.stack([np.full(31, -5e3), y, np.zeros(31)], axis=1)
    raw = sarcl.PhaseHistory(
        np.ones((31, 15), np.complex64), frequency=620e6 - 140e6, frequency_step=20e6, tx=tx,
        reference_range=np.linalg.norm(tx, axis=1),
    )  # fmt: skip
    grid = sarcl.ImageGrid.plane(shape=(20, 20), spacing=1.0, center=(0, 30, 0))
    task = make_task(raw, grid, None, None, False, True)
    energy = profile_energy.estimate(task)
    assert energy.darkness(30) > 1.5 > 1 == energy.darkness(60)
    assert energy.largest(15) == max(energy.darkness(length) for length in (0, *interpolator_choice.lengths(15)))
    lengths = set()
    for tolerance in (3e-2, 1e-2, 4e-4, 1e-4):
        plan = choose_method.choose(task, "direct", tolerance)
        lengths.add(plan.plan.length)
        assert plan.predicted_error >= energy.darkness(plan.plan.length) * plan.plan.interpolator.error
        report = sarcl.backproject(raw, grid, tolerance=tolerance, check=True).report
        assert report.measured_error <= report.predicted_error <= tolerance
    assert 30 in lengths and len(lengths) > 1
    poor = device.without_fp64()
    with pytest.raises(sarcl.ToleranceUnreachable) as refused:
        sarcl.backproject(raw, grid, tolerance=5e-7, device=poor)
    report = sarcl.backproject(raw, grid, tolerance=refused.value.best, device=poor, check=True).report
    assert report.measured_error <= refused.value.best


def test_what_can_be_met_at_best_is_not_sought_where_a_tolerance_is_met(monkeypatch):
    """The errors of few rows at all lengths of profiles take longer than the rest of a plan."""
    raw, grid = drawn(3)
    task = make_task(raw, grid, None, None, True, True)
    asked = []
    monkeypatch.setattr(profile_energy.ProfileEnergy, "largest", lambda self, n: asked.append(n) or 1.0)
    choose_method.choose(task, "direct", 1e-2)
    assert not asked
    assert choose_method.Float32Methods(task, 1e-2).best() < 1e-2 and asked


def test_a_plan_is_made_again_where_profiles_of_its_length_have_larger_errors(monkeypatch):
    task = make_task(*drawn(3), None, None, True, True)
    first = choose_method.choose(task, "direct", 1e-2).plan
    monkeypatch.setattr(
        profile_energy.ProfileEnergy, "darkness", lambda self, length=0: 5.0 if length == first.length else 1.0
    )
    made = choose_method.choose(task, "direct", 1e-2)
    assert made.plan.length != first.length or made.predicted_error >= 5 * made.plan.interpolator.error
    assert made.plan.interpolator.error < first.interpolator.error
