"""Factorised echoes: the exact sum within the tolerance on every kind of track, or directly where not possible."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from helpers.cases import thinned

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.errors import NotApplicable
from sarcl.base.morton import morton_codes
from sarcl.numerics.device_profiles import SpreadSamples
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference.equations import point_echo as exact_echo
from sarcl.reference.merge import expand, merge
from sarcl.scattering.antenna_weights import AntennaWeights
from sarcl.simulation.factorized._ascent import Ascent
from sarcl.simulation.factorized.cells import ScattererCells, scatterers_in_window
from sarcl.simulation.factorized.levels import COSTS_MORE, Amplitudes, plan_levels
from sarcl.simulation.factorized.scatterers import Channel, Scatterers
from sarcl.simulation.points import point_plan
from sarcl.simulation.spreading import Band

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=2e-6)
SIZE, RANGE = 40.0, 4e3


def line(n=200, aperture=200.0, distance=RANGE):
    y = (np.arange(n) - (n - 1) / 2) * aperture / n
    return np.stack([np.full(n, -0.8 * distance), y, np.full(n, 0.6 * distance)], axis=1)


def circle(n=200, arc=0.3):
    angle = arc * np.linspace(-0.5, 0.5, n)
    return RANGE * np.stack([-0.8 * np.cos(angle), 0.8 * np.sin(angle), np.full(n, 0.6)], axis=1)


def gap():
    positions = line()
    positions[100:, 1] += 100.0
    return positions


def passes():
    positions = line()
    positions[100:] += [30.0, -100.0, 20.0]
    return positions


def curved(n=300):
    t = np.linspace(0, 1, n)[:, None]
    return line(n) + np.sin(2 * np.pi * t * np.arange(1, 4)) @ np.random.default_rng(3).standard_normal((3, 3))


TRACKS = {
    "line": line(),
    "circle": circle(),
    "gap": gap(),
    "two passes": passes(),
    "curved": curved(),
    "orbit": line(300, aperture=4e5, distance=3.6e7),
}


def cloud(n=3000, flat=True, seed=0):
    random = np.random.default_rng(seed)
    positions = random.uniform(-SIZE, SIZE, (n, 3)) * [1, 1, 0.05 if flat else 1]
    return sarcl.Scene.points(positions, random.standard_normal(n) + 1j * random.standard_normal(n))


def lattice(n=50):
    step = np.arange(n) * 0.5 * SPEED_OF_LIGHT / CHIRP.center
    y, x = np.meshgrid(step, step)
    return sarcl.Scene.points(np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1), np.ones(n * n))


SCENES = {
    "flat": cloud(),
    "volume": cloud(flat=False, seed=1),
    "lattice": lattice(),
    "row": sarcl.Scene.points(cloud(seed=2).positions * [1, 0, 0], cloud(seed=2).amplitudes),
    "one place": sarcl.Scene.points(np.tile([3.0, -2.0, 1.0], (3000, 1)), cloud().amplitudes),
}


def trajectory(positions):
    return sarcl.Trajectory(np.arange(len(positions)) * 1e-3, positions)


def error_of(raw, scene, is_seen=None, pulses=12):
    """L2 error of all samples of `pulses` pulses against the exact sum; is_seen (delta) -> points that count."""
    wrong = right = 0.0
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    for p in np.unique(np.linspace(0, raw.n_rows - 1, pulses).astype(int)):
        a = scene.amplitudes
        if is_seen is not None:
            away = [np.linalg.norm(end[p] - scene.positions, axis=1) for end in (raw.tx, raw.rx)]
            a = a * is_seen(sum(away) / 2 - raw.reference_range[p])
        wanted = exact_echo(scene.positions, a, f, raw.tx[p], raw.rx[p], raw.reference_range[p])
        wrong += np.linalg.norm(raw.samples[p] - wanted) ** 2
        right += np.linalg.norm(wanted) ** 2
    return np.sqrt(wrong / right)


def factorized_echo(scene, positions, tolerance=1e-3, **options):
    options = {"method": "factorized", "check": False, **options}
    return sarcl.echo(scene, CHIRP, trajectory(positions), tolerance=tolerance, **options)


@pytest.mark.parametrize(
    "scene, track, tolerance",
    thinned(
        [(scene, track) for scene in SCENES for track in TRACKS], [1e-1, 1e-2, 1e-3, 1e-4, 1e-5], every=9, slow=(1, 4)
    ),
)
def test_error_is_below_prediction_and_prediction_below_tolerance(device, scene, track, tolerance):
    raw = factorized_echo(SCENES[scene], TRACKS[track], tolerance, device=device)
    assert raw.report.plan["method"] == "factorized"
    assert error_of(raw, SCENES[scene]) <= raw.report.predicted_error <= tolerance


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_receivers_elsewhere(device, tolerance):
    receiver = trajectory(line() + np.array([300.0, 900.0, 0]) + np.linspace(0, 20, 200)[:, None])
    raw = factorized_echo(cloud(), line(), tolerance, device=device, receiver=receiver)
    assert error_of(raw, cloud()) <= raw.report.predicted_error <= tolerance


@pytest.mark.costly
def test_devices_with_one_lane_and_without_float64(device):
    raw = factorized_echo(cloud(), line(), 1e-4, device=device)
    for other in (device.one_lane(), device.without_fp64()):
        same = factorized_echo(cloud(), line(), 1e-4, device=other)
        assert error_of(same, cloud()) <= same.report.predicted_error
        assert np.linalg.norm(same.samples - raw.samples) <= 2e-5 * np.linalg.norm(raw.samples)


@pytest.mark.costly
def test_points_that_some_pulses_do_not_see_are_added_directly(device):
    scene, window, track = cloud(), (-12.0, 9.0), circle(400)
    raw = factorized_echo(scene, track, 1e-3, device=device, range_window=window)
    assert error_of(raw, scene, lambda delta: (delta >= window[0]) & (delta <= window[1])) <= 1e-3
    direct = factorized_echo(scene, track, 1e-3, device=device, range_window=window, method="direct")
    for counts in ("contributions_done", "contributions_skipped"):
        assert getattr(raw.report, counts) == getattr(direct.report, counts)
    assert raw.report.plan["method"] == "factorized" != direct.report.plan["method"]


@pytest.mark.parametrize("beyond", [0.05, 0.5, 0.9, 1.4])
def test_points_at_the_ends_of_a_profile(device, beyond):
    scene = cloud(800)
    delta = np.linalg.norm(line()[:, None] - scene.positions, axis=-1) - np.linalg.norm(line(), axis=1)[:, None]
    window = float(delta.min()) - beyond, float(delta.max()) + beyond
    options = {"range_window": window, "reference": (0.0, 0.0, 0.0), "device": device}
    raw = factorized_echo(scene, line(), 1e-3, **options)
    assert error_of(raw, scene) <= raw.report.predicted_error


def test_points_in_the_window_are_judged_safely():
    positions, track = cloud().positions, circle(arc=0.6)
    ranges = np.linalg.norm(track, axis=1)
    antennas = PulseGeometry(track, track, ranges, near=np.full(200, -12.0), far=np.full(200, 9.0))
    cells = ScattererCells(positions)
    inside = scatterers_in_window(cells, antennas)
    delta = np.linalg.norm(track[:, None] - positions[cells.order], axis=-1) - ranges[:, None]
    sees = ((delta >= -12) & (delta <= 9)).all(axis=0)
    assert not (inside & ~sees).any()
    assert inside.sum() > 0.6 * sees.sum()  # cells at the edge are left to the direct method
    assert not antennas.holds(cells.bounds)


@pytest.mark.parametrize("less, holds", [((0, 0), True), ((1e-9, 0), False), ((0, 1e-9), False)])
def test_a_window_holds_a_box_up_to_its_nearest_and_farthest_points(less, holds):
    track, bounds = np.array([[-3.0, 5.0, 4.0]]), np.array([[0.0, 0.0, 0.0], [2.0, 2.0, 1.0]])
    near, far = np.sqrt([3**2 + 3**2 + 3**2, 5**2 + 5**2 + 4**2])
    antennas = PulseGeometry(track, track, near=np.full(1, near + less[0]), far=np.full(1, far - less[1]))
    assert antennas.holds(bounds) is holds


def test_cells_hold_their_points():
    positions = cloud(flat=False).positions
    cells = ScattererCells(positions)
    codes, edge = morton_codes(positions)
    assert edge == pytest.approx(np.ptp(positions, axis=0).max())
    assert (np.diff(codes[cells.order].astype(float)) >= 0).all()
    small = cells.level(4)
    large = cells.joined(2, small)
    for level, depth in ((small, 4), (large, 2), (cells.joined(0, large), 0)):
        assert (level.first == cells.first(depth)).all()
        cell = np.repeat(np.arange(len(level)), np.diff(level.first))
        away = np.linalg.norm(cells.positions - level.centers[cell], axis=1)
        assert (away <= level.radii[cell] * (1 + 1e-12)).all()
        assert (np.ptp(cells.positions[cell == 0], axis=0) <= edge / 2**depth * (1 + 1e-5)).all()
    parents, children = large.parents_of(small), large.children_in(small)
    assert (parents == np.repeat(np.arange(len(large)), np.diff(children))).all()


@pytest.mark.parametrize("n", [3000, 200_000])
@pytest.mark.parametrize("flat", [True, False])
def test_numbers_of_cells_are_estimated_from_a_sample(n, flat):
    cells = ScattererCells(cloud(n, flat).positions)
    numbers = [len(cells.first(depth)) - 1 for depth in range(len(cells.numbers))]
    assert cells.numbers == pytest.approx(numbers, rel=1e-9 if n == 3000 else 0.15)
    evenly = ScattererCells(lattice(500).positions)
    assert evenly.numbers[6] == pytest.approx(len(evenly.first(6)) - 1, rel=0.1)


@pytest.mark.costly
def test_profiles_are_moved_and_interpolated_between_pulses_as_by_the_twin(device):
    scene, positions = cloud(), line(48, aperture=80.0)
    raw = factorized_echo(scene, positions, 1e-2, device=device)
    antennas = PulseGeometry.sampled(
        raw.tx, raw.tx, raw.reference_range, first=raw.frequency[0], step=raw.frequency_step[0],
        n_samples=raw.n_samples, window=(-1e3, 1e3),
    )  # fmt: skip
    cells = ScattererCells(scene.positions)
    plan = plan_levels(
        cells, antennas, Band(raw.n_samples, 300e6, 9.6e9), 1e-3, Amplitudes(lambda leaf: leaf.interpolator.error)
    )
    amplitudes = scene.amplitudes[cells.order]
    scatterers = Scatterers(
        cells, np.stack([amplitudes.real, amplitudes.imag]), (Channel((0,)),), AntennaWeights(antennas, 9.6e9)
    )
    ascent, root = Ascent(device, plan, scatterers, antennas, raw.n_samples, 2e9), plan.levels[0]
    shape = len(root.cells), len(root.decimation.kept), root.stride
    random = np.random.default_rng(1)
    smooth = np.zeros(shape, np.complex64)  # a few scatterers in each cell, spread by a long window
    grid = np.arange(root.stride) - root.reach
    for at in random.uniform(-root.reach / 3, root.reach / 3, 3):
        smooth += (np.sinc((grid - at) / 3) * np.hanning(root.stride)).astype(np.complex64)
    smooth *= np.exp(2j * np.pi * random.random(shape[:2]))[..., None].astype(np.complex64)
    rows = ascent.rows(device.upload(smooth), (0, shape[0]), range(48))
    length, kernel = plan.leaf.length, plan.leaf.interpolator
    got = SpreadSamples(device, raw.n_samples, kernel, length).of(rows, 1, 48)
    k = np.arange(raw.n_samples) - raw.n_samples // 2
    got = got * kernel.transform(k / length)  # the twin's profiles are not deconvolved
    sigma = 2 * raw.frequency_step[0] * length / SPEED_OF_LIGHT
    first, rows_of_filter = root.decimation.neighbours.T
    weights = root.decimation.filter[rows_of_filter]
    kept = first[:, None] + np.arange(weights.shape[1])
    wanted = sum(
        expand(smooth[i], grid / sigma, raw, center + cells.center, kept, weights)
        for i, center in enumerate(root.cells.centers)
    )
    inner = slice(raw.n_samples // 8, -raw.n_samples // 8)  # the window's spectrum
    error = np.linalg.norm((got - wanted)[:, inner]) / np.linalg.norm(wanted[:, inner])
    assert error <= 3 * plan.between.error + 2e-6


def test_the_twin_is_the_adjoint_of_the_twin_of_images():
    raw = sarcl.echo(cloud(20), CHIRP, trajectory(line(12)), range_window=(-20, 20), check=False)
    random, m = np.random.default_rng(0), np.linspace(-3, 3, 7)
    weights = random.standard_normal((12, 4))
    blocks = np.array([[0, 6, 0, 0], [6, 6, 1, 6]])
    kept = np.repeat([0, 1], 6)[:, None] + np.arange(4)
    center, profiles = np.array([1.0, 2.0, 0.5]), random.standard_normal((5, 7)) + 1j * random.standard_normal((5, 7))
    forward = merge(raw, center, m, blocks, weights, 5)
    back = expand(profiles, m, raw, center, kept, weights)
    assert np.vdot(profiles, forward) == pytest.approx(np.vdot(back, raw.samples.astype(np.complex128)), rel=1e-12)


def test_memory_does_not_change_the_echoes(device):
    scene = cloud(20_000)
    raw = factorized_echo(scene, line(), 1e-3, device=device)
    for most in (3e7, 3e6):
        small = factorized_echo(scene, line(), 1e-3, device=device, max_bytes=most)
        assert np.linalg.norm(small.samples - raw.samples) <= 1e-6 * np.linalg.norm(raw.samples)


def test_a_file_is_filled_in_blocks_of_pulses(device, tmp_path):
    raw = factorized_echo(cloud(), line(1000), 1e-2, device=device)
    stored = factorized_echo(cloud(), line(1000), 1e-2, device=device, out=tmp_path / "a.h5", max_bytes=1e6)
    assert np.linalg.norm(stored.read(0, 1000) - raw.samples) <= 1e-6 * np.linalg.norm(raw.samples)


def test_all_polarisations_and_progress(device):
    told = []
    options = {"polarization": ("HH", "HV", "VV"), "device": device, "progress": lambda *a: told.append(a)}
    raw = factorized_echo(cloud(), line(), 1e-3, **options)
    one = factorized_echo(cloud(), line(), 1e-3, device=device)
    rows = raw.samples.reshape(200, 3, -1)
    assert (rows[:, 0] == one.samples).all() and (rows[:, 2] == rows[:, 0]).all() and not rows[:, 1].any()
    done = [n for stage, n, _ in told if stage == "echo"]
    assert done == sorted(done) and done[-1] == 200 * 3000


@pytest.mark.costly
def test_auto_takes_levels_where_they_cost_less(device):
    many, positions = cloud(40_000), line(1000)
    raw = factorized_echo(many, positions, 1e-2, device=device, method="auto")
    assert raw.report.plan["method"] == "factorized"
    direct = factorized_echo(many, positions, 1e-2, device=device, method="direct")
    assert np.linalg.norm(raw.samples - direct.samples) <= 1e-2 * np.linalg.norm(direct.samples)
    few = factorized_echo(many, line(6), 1e-2, device=device, method="auto")
    assert few.report.plan["method"] == "spread"
    assert error_of(raw, many, pulses=4) <= raw.report.predicted_error


def test_plans_that_cost_more_than_the_direct_method_are_given_up():
    scene, positions = cloud(), line(600)
    antennas = PulseGeometry.sampled(
        positions,
        positions,
        np.linalg.norm(positions, axis=1),
        first=9.5e9,
        step=1e6,
        n_samples=300,
        window=(-1e3, 1e3),
    )
    task = ScattererCells(scene.positions), antennas, Band(300, 300e6, 9.65e9), 1e-2
    amplitudes = Amplitudes(lambda leaf: leaf.interpolator.error)
    plan = plan_levels(*task, amplitudes)
    assert plan_levels(*task, amplitudes, most=plan.cost).cost == plan.cost
    # the cheapest candidate is refused by its own cost, and by what its ratios of decimation become
    for most in (0.0, 0.5 * plan.cost, 0.999 * plan.cost):
        assert plan_levels(*task, amplitudes, most=most) == COSTS_MORE

    def positions_that_nobody_needs():
        raise AssertionError

    unsorted = ScattererCells(positions_that_nobody_needs, task[0].sample)
    assert plan_levels(unsorted, *task[1:], amplitudes, most=0.0) == COSTS_MORE


def test_points_are_freed_with_their_cells_and_plans():
    def planned():
        cells, positions = ScattererCells(cloud().positions), line(300)
        antennas = PulseGeometry(positions, positions, frequency=9.6e9, frequency_step=1e6)
        assert plan_levels(cells, antennas, Band(300, 300e6, 9.6e9), 1e-2, Amplitudes(lambda leaf: 0.0)).cost > 0
        return weakref.ref(cells)

    reference = planned()
    gc.collect()
    assert reference() is None


@pytest.mark.parametrize("carrier", [9.6e9, 9.6123456789e9])
def test_echoes_of_points_are_planned_once(monkeypatch, carrier):
    calls, of_levels = [], point_plan.plan_levels
    monkeypatch.setattr(point_plan, "plan_levels", lambda *a, **k: calls.append(a) or of_levels(*a, **k))
    pulse = sarcl.Waveform.chirp(center=carrier, bandwidth=300e6, duration=1e-6)
    track = sarcl.Trajectory(np.arange(997) / 997, line(997))
    raw = sarcl.echo(cloud(40_000), pulse, track, tolerance=1e-2, method="factorized", check=False)
    assert raw.report.plan["method"] == "factorized" and len(calls) == 1


@pytest.mark.costly
def test_facets_beside_points_are_added_directly(device):
    facets = sarcl.shapes.plate((2.0, 1.0)).moved((0, 0, 5))
    both = facets + cloud()
    options = {"range_window": (-70.0, 70.0), "reference": (0.0, 0.0, 0.0), "device": device}
    raw = factorized_echo(both, line(), 1e-3, **options)
    direct = factorized_echo(both, line(), 1e-4, method="direct", **options)
    assert np.linalg.norm(raw.samples - direct.samples) <= 1.1e-3 * np.linalg.norm(direct.samples)


@pytest.mark.costly
def test_what_cannot_be_factorised_is_refused_with_the_reason_and_added_directly_by_auto(device):
    shaken = line() + np.random.default_rng(4).standard_normal((200, 3)) * 5
    near = np.stack([np.full(200, -30.0), np.linspace(-100, 100, 200), np.full(200, 30.0)], axis=1)
    for positions in (shaken, near, np.tile(line(1), (200, 1)) + 0.0 * shaken, line(6)):
        try:
            raw = factorized_echo(cloud(), positions, 1e-3, device=device)
        except NotApplicable as refused:
            assert 'method="factorized" is not possible: ' in str(refused)
            raw = factorized_echo(cloud(), positions, 1e-3, device=device, method="auto")
            assert raw.report.plan["method"] == "spread"
        assert error_of(raw, cloud()) <= 1e-3
    with pytest.raises(ValueError, match="method"):
        factorized_echo(cloud(), line(), method="quick")


def test_the_forecast_of_factorised_echoes_is_that_of_their_run(device):
    arguments = cloud(40_000), CHIRP, trajectory(line(1000))
    forecast = sarcl.plan(sarcl.echo, *arguments, tolerance=1e-2, device=device, check=False)
    raw = forecast.run()
    assert forecast.method == forecast.plan["method"] == raw.report.plan["method"] == "factorized"
    assert forecast.predicted_error == raw.report.predicted_error
    assert forecast.plan["contributions"] == raw.report.contributions_done == 40_000 * 1000
    assert (sarcl.echo(*arguments, tolerance=1e-2, device=device, check=False).samples == raw.samples).all()


@pytest.mark.costly
def test_channels_of_an_array(device):
    options = {"array": sarcl.AntennaArray.linear(2, spacing=0.5), "channels": "separated", "device": device}
    raw = factorized_echo(cloud(), line(), 1e-3, **options)
    direct = factorized_echo(cloud(), line(), 1e-4, method="direct", **options)
    assert raw.report.plan["method"] != direct.report.plan["method"]
    assert np.linalg.norm(raw.samples - direct.samples) <= 1.1e-3 * np.linalg.norm(direct.samples)
