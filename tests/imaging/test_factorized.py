"""Sub-apertures against the exact sum: any track, any grid, at the tolerance asked."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import image_error, noise_on, straight

import sarcl
from sarcl.imaging import choose_method
from sarcl.imaging.factorized import plan as factorized_plan
from sarcl.imaging.focusing_task import make_task
from sarcl.numerics.subapertures import smooth_runs

SLOW = pytest.mark.slow


def check(raw, grid, tolerance, *, device=None, **options):
    """Focus with sub-apertures and hold the contract; the image."""
    image = sarcl.backproject(
        raw, grid, tolerance=tolerance, method="factorized", device=device, check=False, **options
    )
    assert image.report.plan["method"] == "factorized"
    error = image_error(image, raw, most=150, wrap=options.get("wrap", False))
    assert error <= image.report.predicted_error <= tolerance
    return image


GRID = sarcl.ImageGrid.plane(shape=(150, 170), spacing=0.25)


@pytest.mark.parametrize("tolerance", [pytest.param(1e-1, marks=SLOW), 1e-2, 1e-3])
def test_contract_on_every_device(device, tolerance):
    check(noise_on(straight(400)), GRID, tolerance, device=device)


@pytest.mark.parametrize("squint", [pytest.param(0.5, marks=SLOW), 1.0])
def test_squint(squint):
    check(noise_on(straight(400, squint=squint)), GRID, 1e-2)


@pytest.mark.parametrize("distance", [300.0, pytest.param(10e3, marks=SLOW), 800e3])
def test_error_does_not_depend_on_the_range(distance):
    check(noise_on(straight(400, aperture=6e-3 * distance, distance=distance)), GRID, 1e-2)


def test_bistatic():
    tx = straight(400)
    check(noise_on(tx, tx * [1, 1, 0.5] + [3e3, 2e3, 0]), GRID, 1e-2)


def test_a_wide_circle():
    track = sarcl.Trajectory.circle(radius=300, height=200, arc=1.0, n_pulses=1200)
    grid = sarcl.ImageGrid.plane(shape=(64, 64), spacing=0.1)
    check(noise_on(track.positions, bandwidth=600e6), grid, 1e-2)


def test_a_curved_bumpy_track():
    tx = straight(500)
    t = np.linspace(0, 1, 500)[:, None]
    bumps = np.random.default_rng(3).standard_normal((6, 3)) * 2.0
    tx = tx + np.sin(2 * np.pi * t * np.arange(1, 7)) @ bumps
    check(noise_on(tx), GRID, 1e-2)


def test_a_track_that_jitters_is_thinned_out_less_or_refused_never_wrong():
    tx = straight(400) + np.random.default_rng(4).standard_normal((400, 3)) * 2e-3
    raw = noise_on(tx)
    try:
        check(raw, GRID, 3e-2)
    except ValueError as exc:
        assert "sub-apertures" in str(exc)
    wild = noise_on(straight(400) + np.random.default_rng(4).standard_normal((400, 3)) * 5)
    with pytest.raises(ValueError, match="cannot be met with sub-apertures"):
        sarcl.backproject(wild, GRID, tolerance=1e-2, method="factorized")
    image = sarcl.backproject(wild, GRID, tolerance=1e-2)
    assert image.report.plan["method"] == "direct"


def test_rows_of_several_channels_in_turns_and_a_gap():
    tx = straight(600)
    tx = np.delete(tx, slice(200, 260), axis=0)
    n = len(tx)
    channel = np.arange(n) % 2
    raw = noise_on(tx, tx + np.array([[0, 0, 0], [0, 40.0, 0]])[channel], rx_channel=channel)
    order = np.argsort(channel, kind="stable")
    assert len(smooth_runs(raw.tx[order], raw.rx[order], channel[order])) == 4
    check(raw, GRID, 1e-2)


def test_rows_with_frequency_plans_of_their_own():
    tx = straight(400)
    raw = noise_on(tx)
    plan = np.arange(400) % 2 * 50e6
    raw = sarcl.PhaseHistory(
        raw.samples, frequency=raw.frequency + plan, frequency_step=raw.frequency_step, tx=tx,
        reference_range=raw.reference_range,
    )  # fmt: skip
    check(raw, GRID, 1e-2)


def test_listed_points(device):
    random = np.random.default_rng(6)
    y, x = np.meshgrid(np.arange(120) * 0.3 - 18, np.arange(140) * 0.3 - 21, indexing="ij")
    points = np.stack([x, y, 2 * np.sin(x / 4) + 0.05 * random.standard_normal(x.shape)], axis=-1)
    check(noise_on(straight(400)), sarcl.ImageGrid.points(points), 1e-2, device=device)


@pytest.mark.parametrize("wrap", [False, True])
def test_a_scene_wider_than_the_range_window(wrap):
    raw = noise_on(straight(400), n_samples=48)  # window +-12 m, a third of the scene's reach
    grid = sarcl.ImageGrid.plane(shape=(200, 400), spacing=0.25)
    image = check(raw, grid, 1e-2, wrap=wrap)
    assert (image.report.contributions_skipped["range window"] > 0) != wrap
    everything = check(raw, grid, 1e-2, wrap=wrap, skip=False)
    assert np.linalg.norm(everything.data - image.data) <= 1e-6 * np.linalg.norm(image.data)


def test_bytes_do_not_change_the_image():
    raw = noise_on(straight(400))
    images = [check(raw, GRID, 1e-2, max_bytes=b).data for b in (None, 2e7, 2e7)]
    assert np.linalg.norm(images[1] - images[0]) <= 1e-6 * np.linalg.norm(images[0])
    assert (images[1] == images[2]).all()


def test_auto_takes_sub_apertures_where_they_cost_less():
    raw = noise_on(straight(1500, aperture=100.0), n_samples=64)
    grid = sarcl.ImageGrid.plane(shape=(256, 256), spacing=0.25)
    image = sarcl.backproject(raw, grid, tolerance=1e-2, check=False)
    assert image.report.plan["method"] == "factorized"
    few = sarcl.backproject(raw[:20], grid, tolerance=1e-2, check=False)
    assert few.report.plan["method"] == "direct"


def test_cost_grows_much_slower_than_the_cube():
    costs = []
    for n in (1024, 2048, 4096, 8192):
        tx = straight(n, aperture=300.0)
        raw = sarcl.PhaseHistory(
            np.lib.stride_tricks.as_strided(np.ones(1, np.complex64), (n, n), (0, 0)),
            frequency=9.9e9, frequency_step=300e6 / n, tx=tx, reference_range=np.linalg.norm(tx, axis=1),
        )  # fmt: skip
        grid = sarcl.ImageGrid.plane(shape=(n, n), spacing=0.25)
        plan, _ = factorized_plan.make_plan(make_task(raw, grid, None, None, False, True), 3e-2)
        costs.append(plan.cost * float(n) ** 3)
    exponent = np.polyfit(np.log2([1024, 2048, 4096, 8192]), np.log2(costs), 1)[0]
    assert exponent < 2.35


def test_tolerances_below_complex64_name_the_method_that_meets_them():
    with pytest.raises(ValueError, match="method='direct' can"):
        choose_method.choose(make_task(noise_on(straight(40)), GRID, None, None, False, True), "factorized", 1e-8)


@pytest.mark.costly
def test_profiles_of_kept_pulses_are_those_of_the_twin(device):
    from sarcl.base.constants import SPEED_OF_LIGHT
    from sarcl.base.stage_timer import Clock
    from sarcl.imaging.factorized.factorized import Factorized
    from sarcl.reference.merge import merge

    raw = noise_on(straight(120), n_samples=256)
    task = make_task(raw, GRID, None, None, False, True)
    plan, tiling = factorized_plan.make_plan(task, 1e-3)
    engine, seen = Factorized(device, task, plan, tiling), []
    descend = engine._descend

    def spy(down, level, low, high, source, first, *rest):
        shape = (high - first, engine.kept[level][2], engine.strides[level])
        seen.append((level, low, first, device.download(source, np.empty(shape, np.complex64))))
        descend(down, level, low, high, source, first, *rest)

    engine._descend = spy
    engine.fill(0, tiling.n_bands, np.empty(GRID.shape, np.complex64), 2**29, Clock(), lambda rows: None)
    _, low, first, got = next(s for s in seen if s[0] == 0)
    made, sigma = plan.levels[0], 2 * raw.frequency_step[0] * plan.length / SPEED_OF_LIGHT
    m = np.arange(2 * made.reach + 1) - made.reach
    center = tiling.tree(0, tiling.n_bands, plan.factors).centers[0][low] + tiling.center
    wanted = merge(raw, center, m / sigma, made.decimation.blocks, made.decimation.filter, got.shape[1])
    error = got[low - first][:, : len(m)] - wanted
    assert np.linalg.norm(error) <= 1e-3 * np.linalg.norm(wanted)
