"""Polar format images: the sum of plane waves within the tolerance, and the plane-wave error as predicted."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from helpers.cases import image_error, noise_on, straight, thinned
from helpers.contract_cases import build, draw
from helpers.devices import as_gpu

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.stage_timer import Clock
from sarcl.imaging.polar_format import _wavefront, polar_format
from sarcl.imaging.polar_format._wavefront import curvature, waves_about
from sarcl.numerics import nufft2d, shared_tile
from sarcl.numerics.interpolation import interpolator
from sarcl.opencl import fft
from sarcl.reference.polar_format import polar_format as plane_sum
from sarcl.reference.polar_format import spread

ARC = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.1, n_pulses=60).positions
BUMPY = straight(60) + np.random.default_rng(1).standard_normal((60, 3)) * [3.0, 0.3, 3.0]
TRACKS = {
    "straight": straight(60),
    "squinted": straight(60, squint=1.0),
    "arc": ARC,
    "steep and bumpy": BUMPY * [0.3, 1, 1.3],
    "climbing": straight(60) + np.linspace(-300, 300, 60)[:, None] * [0, 0, 1],
}
GRID = sarcl.ImageGrid.plane(shape=(51, 64), spacing=(0.3, 0.25))
TILTED = sarcl.ImageGrid.plane(shape=(40, 33), spacing=0.3, normal=(0.3, -0.2, 1), x_axis=(1, 1, 0))


def error_of(image, raw, center=None, **model):
    """Error against the exact sum of plane waves, relative as `polar_format` says."""
    center = image.grid.at(*(n // 2 for n in image.grid.shape)) if center is None else center
    return image_error(image, raw, most=200, exact=partial(plane_sum, center=center), **model)


def hold(raw, grid, tolerance, **options):
    image = sarcl.polar_format(raw, grid, tolerance=tolerance, check=False, **options)
    assert error_of(image, raw) <= image.report.predicted_error <= tolerance
    return image


@pytest.mark.parametrize("track, tolerance", thinned(TRACKS, [1e-1, 1e-2, 1e-3, 1e-4, 1e-5]))
def test_contract_on_any_track(track, tolerance):
    for grid in (GRID, TILTED):
        hold(noise_on(TRACKS[track]), grid, tolerance)


@pytest.mark.parametrize("scale", [1e-26, 1.0, 1e16, 1e25])
def test_the_norm_of_a_dark_image_is_that_of_any_other_scale(scale):
    """Squares of float32 overflow from 2e19 on, and vanish below 1e-23; a warning is an error here."""
    raw = noise_on(TRACKS["arc"])
    beside = sarcl.ImageGrid.plane(center=(7, 6, 0), shape=(20, 20), spacing=0.1)
    dark = replace(raw, samples=np.ones_like(raw.samples))  # a point at the references
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plans = [
            sarcl.polar_format(replace(dark, samples=dark.samples * np.complex64(s)), beside).report.plan
            for s in (1.0, scale)
        ]
    assert "error of a dark image" in plans[0] and plans[1] == plans[0]


RECEIVERS = {
    "moved on": ARC + np.array([0, 40.0, 0]),
    "on a track of its own": ARC[::-1] * [0.6, 1, 1.4],
    "at rest nearby": np.tile([900.0, 300, 80], (60, 1)),
}


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
@pytest.mark.parametrize("name", RECEIVERS)
def test_contract_with_a_receiver_elsewhere(name, tolerance):
    receiver = RECEIVERS[name]
    raw = noise_on(ARC, receiver)
    for grid in (GRID, TILTED):
        assert (hold(raw, grid, tolerance).rx == receiver[30]).all()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
def test_contract_on_every_device(device, tolerance):
    hold(noise_on(ARC), GRID, tolerance, device=device)


@pytest.mark.parametrize(
    ("shape", "spacing"), [((1, 1), 0.3), ((1, 90), 0.3), ((130, 140), 0.03), ((60, 40), 0.9), ((2, 3), 7.0)], ids=str
)
def test_contract_from_pixels_far_finer_to_far_coarser_than_the_resolution(shape, spacing):
    grid = sarcl.ImageGrid.plane(shape=shape, spacing=spacing)
    for tolerance in (1e-1, 1e-4):
        hold(noise_on(ARC), grid, tolerance)


@pytest.mark.parametrize("x", [8.3, 16.0, 24.0])
def test_contract_where_the_only_bright_point_lies_outside_of_the_grid(x):
    # just beside its border of 8 m, and where the grid of wavenumbers, 1.5 times finer, takes it for one inside
    reference = np.linalg.norm(ARC, axis=1)
    frequency, toward = 9.45e9 + np.arange(400) * 0.75e6, ARC / reference[:, None]
    samples = np.exp(4j * np.pi * np.outer(toward @ [x, 0, 0], frequency) / SPEED_OF_LIGHT)
    raw = sarcl.PhaseHistory(samples, frequency=frequency[0], frequency_step=0.75e6, tx=ARC, reference_range=reference)
    shares = []
    for tolerance in (1e-1, 1e-3):
        image = hold(raw, GRID, tolerance)
        shares.append(error_of(image, raw) / image.report.predicted_error)
        assert float(image.report.plan["error of a dark image"]) > image.report.predicted_error
    print(f"{x} m: shares of the prediction {shares}")
    assert x != 24 or max(shares) > 0.3  # the check is needed


@pytest.mark.parametrize(
    "seeds", [range(0, 250, 3), pytest.param(range(250), marks=pytest.mark.slow)], ids=["every third", "all"]
)
def test_contract_on_random_tasks(seeds):
    held = 0
    for seed in seeds:
        case = draw(seed, 1e5, -6.0)
        raw, grid = build(case)
        if grid.is_plane and raw.n_rows > 1:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", sarcl.SarclWarning)  # close by, most are blurred
                try:
                    hold(raw, grid, case.tolerance)
                except ValueError as exc:
                    assert case.tolerance < 1e-5 and "the best here" in str(exc), str(exc)
                    continue
            held += 1
    assert held > 0.32 * len(seeds)


def test_contract_of_rows_with_frequencies_of_their_own_in_two_channels():
    raw = noise_on(np.repeat(ARC, 2, axis=0), rx_channel=np.arange(120) % 2)
    n = np.arange(120)
    raw = replace(raw, frequency=raw.frequency + n % 3 * 40e6, frequency_step=raw.frequency_step * (1 + n % 2 / 10))
    hold(raw, GRID, 1e-3)


def test_weights_and_windows_are_those_of_backproject():
    raw = noise_on(ARC, weight=np.linspace(0.5, 1, 60))
    weights = np.arange(60) % 4 / 3.0
    image = sarcl.polar_format(raw, GRID, tolerance=1e-4, window="hamming", weights=weights, check=True)
    assert image.report.measured_error <= image.report.predicted_error
    from sarcl.imaging.focusing_task import weigh

    samples, rows = weigh(raw, "hamming", weights)
    assert error_of(image, raw, sample_weight=samples, row_weight=rows) <= 1e-4
    assert image.gain == sarcl.backproject(raw, GRID, window="hamming", weights=weights).gain
    assert image.report.contributions_skipped["zero weight"] == 15 * GRID.size


def test_any_reference_and_any_centre_will_do():
    raw = noise_on(ARC)
    moved = replace(raw, reference_range=raw.reference_range + np.linspace(-3, 3, 60))
    away = sarcl.ImageGrid.plane(center=(4, -7, 3), shape=(40, 40), spacing=0.25)
    for grid in (away, GRID.columns(5, 30)):
        hold(moved, grid, 1e-4)


class Uploaded:
    """Samples that the host makes: `read(start, stop)` is complex64."""

    row_bytes, held = 0.0, True

    def __init__(self, device, read):
        self.device, self.read = device, read

    def buffer(self, pipeline, start, stop):
        return self.device.upload(self.read(start, stop))


@pytest.mark.parametrize("tile", [*nufft2d.CELLS, pytest.param(shared_tile.CELLS, marks=pytest.mark.slow)])
def test_samples_are_spread_as_the_twin_says(device, tile, monkeypatch):
    monkeypatch.setattr(nufft2d, "tile_of", lambda device: tile)
    if tile == shared_tile.CELLS:
        device = as_gpu(device)
        assert shared_tile.used_by(device)
    raw = noise_on(ARC, n_samples=90)
    waves = waves_about(raw, GRID.center)
    for scale in (1.0, 7.0):  # wavenumbers that wrap once, and again and again
        turns, step = (scale * v for v in waves.pixel_cycles(raw, GRID))
        for taps in (2, 4, 6, 8):
            plan = nufft2d.GridPlan(interpolator(taps, 2.0), (126, 150), 1.0, 1.0, 1.0)
            seen = []

            def rows(device, data, seen=seen, **options):
                seen.append(data.copy())
                return np.fft.ifft(data, axis=1, norm="forward").astype(np.complex64)

            monkeypatch.setattr(fft, "rows", rows)
            monkeypatch.setattr(fft, "on_device", lambda *given: False)
            engine = nufft2d.Gridder(device, plan, turns, step, raw.n_samples)
            engine.image(Uploaded(device, raw.read), GRID.shape, 1e9, Clock(), lambda share: None)
            n = np.arange(90) - 45
            place = (turns[:, None] + step[:, None] * n[:, None]) % 1 * plan.length
            wanted = spread(raw.samples.ravel(), place.reshape(-1, 2), plan.interpolator, plan.length)
            assert np.linalg.norm(seen[0] - wanted) <= 3e-6 * np.linalg.norm(wanted)


def test_tiles_that_a_work_group_shares_are_those_of_single_work_items(device, monkeypatch):
    """Bit by bit, in bands of tiles and blocks of rows: both add samples up in the same order."""
    raw, gpu = noise_on(ARC, n_samples=90), as_gpu(device)
    turns, step = (7 * v for v in waves_about(raw, GRID.center).pixel_cycles(raw, GRID))
    plan, seen = nufft2d.GridPlan(interpolator(6, 2.0), (126, 150), 1.0, 1.0, 1.0), {}
    for shared in (True, False):
        found = seen[shared] = []

        def rows(device, data, found=found, **options):
            found.append(data.copy())
            return data

        monkeypatch.setattr(fft, "rows", rows)
        monkeypatch.setattr(fft, "on_device", lambda *given: False)
        monkeypatch.setattr(shared_tile, "used_by", lambda device, shared=shared: shared)
        monkeypatch.setattr(nufft2d, "tile_of", lambda device: shared_tile.CELLS)
        engine = nufft2d.Gridder(gpu, plan, turns, step, raw.n_samples)
        assert engine.blocks(57200, GRID.shape) == (1, 25)
        engine.image(Uploaded(gpu, raw.read), GRID.shape, 57200, Clock(), lambda share: None)
    for got, wanted in zip(seen[True], seen[False], strict=True):
        assert np.array_equal(got, wanted)


def test_a_point_at_the_centre_is_as_sharp_as_theory_says():
    center, bandwidth, arc, n, grazing = 9.6e9, 600e6, np.radians(4), 512, np.radians(35)
    track = sarcl.Trajectory.circle(
        radius=10e3 * np.cos(grazing), height=10e3 * np.sin(grazing), start=-arc / 2, arc=arc, n_pulses=n
    )
    chirp = sarcl.Waveform.chirp(center=center, bandwidth=bandwidth, duration=2e-6)
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), chirp, track, range_window=(-60, 60), tolerance=1e-3)
    image = sarcl.polar_format(raw, sarcl.ImageGrid.plane(shape=(129, 129), spacing=(0.08, 0.1)), tolerance=1e-3)
    response = sarcl.measure(image, near=(0, 0, 0))
    irw_range = 0.886 * SPEED_OF_LIGHT / (2 * bandwidth) / np.cos(grazing)
    irw_cross = 0.886 * SPEED_OF_LIGHT / center / (2 * arc * n / (n - 1)) / np.cos(grazing)
    assert response.irw == pytest.approx((irw_range, irw_cross), rel=0.01)
    assert response.pslr == pytest.approx((-13.26, -13.26), abs=0.1)
    assert np.linalg.norm(response.position) <= 0.01 * min(irw_range, irw_cross)
    assert image.data[64, 64] == pytest.approx(image.gain, rel=3e-3)


def points_seen(tx, points, bandwidth=300e6):
    """Echoes of unit points from a formula, not from `sarcl.echo`."""
    n = 512
    frequency = 9.6e9 - bandwidth / 2 + np.arange(n) * bandwidth / n
    reference = np.linalg.norm(tx, axis=1)
    samples = np.zeros((len(tx), n), complex)
    for point in points:
        path = 2 * (np.linalg.norm(tx - point, axis=1) - reference)
        samples += np.exp(-2j * np.pi * np.outer(path, frequency) / SPEED_OF_LIGHT)
    return sarcl.PhaseHistory(
        samples, frequency=frequency[0], frequency_step=bandwidth / n, tx=tx, reference_range=reference
    )


@pytest.mark.parametrize("squint", [0.0, 0.8])
def test_points_are_displaced_as_predicted_and_within_the_wavefronts_bend(squint):
    middle = 5e3 * np.array([-np.cos(squint), -np.sin(squint), 0.8])
    track = middle + np.linspace(-80, 80, 200)[:, None] * [0, 1, 0]
    for point in ((0, 25.0, 0), (20.0, 20.0, 0), (-30.0, 5.0, 0)):
        raw = points_seen(track, [point])
        # the image is made about 0; only its part near the point is looked at
        whole = sarcl.ImageGrid.plane(shape=(360, 360), spacing=0.2)
        image = sarcl.polar_format(raw, whole, tolerance=1e-3, check=False)
        # the part of the wavefront's bend that is a shift, at this place
        looked = _wavefront._NeglectedPhase(raw, waves_about(raw, np.zeros(3)), whole, np.arange(200))
        predicted = float(looked(np.array([point]))[2][0])
        moved = float(np.linalg.norm(sarcl.measure(image, near=point).position - point))
        r, distance = np.linalg.norm(point), np.linalg.norm(middle)
        print(f"{point}: moved {moved:.4f} m, predicted {predicted:.4f} m")
        assert moved == pytest.approx(predicted, abs=0.01)
        assert 0.02 < moved
        assert predicted <= 1.5 * r**2 / (2 * distance) / np.cos(np.arctan(0.8)) ** 2


def test_a_small_scene_agrees_with_backproject_as_the_curvature_says():
    raw = noise_on(ARC)
    for spacing in (0.02, 0.06, 0.2):
        grid = sarcl.ImageGrid.plane(shape=(40, 40), spacing=spacing)
        image, oracle = (f(raw, grid, tolerance=1e-4) for f in (sarcl.polar_format, sarcl.backproject))
        difference = np.linalg.norm(image.data - oracle.data) / np.linalg.norm(oracle.data)
        phase = curvature(raw, waves_about(raw, GRID.center), grid).phase
        print(f"spacing {spacing}: {difference:.2e}, curvature at most {phase:.2e} rad")
        assert phase / 20 < difference <= phase + 2e-4
        assert (image.gain, image.frequency) == (oracle.gain, oracle.frequency)
        assert (image.tx == oracle.tx).all() and (image.rx == oracle.rx).all()


def test_from_afar_it_is_backproject():
    track = sarcl.Trajectory.circle(radius=800e3, height=600e3, arc=0.05, n_pulses=60).positions
    raw = noise_on(track, center=1.3e9, bandwidth=200e6)
    grid = sarcl.ImageGrid.plane(shape=(64, 64), spacing=0.1)
    image, oracle = (f(raw, grid, tolerance=1e-4) for f in (sarcl.polar_format, sarcl.backproject))
    assert np.linalg.norm(image.data - oracle.data) <= 1e-3 * np.linalg.norm(oracle.data)


def test_the_phase_that_planes_lack_is_that_of_the_paths():
    raw, center = noise_on(ARC), np.zeros(3)
    border = GRID.at(np.array([0, 0, 25, 50, 50]), np.array([0, 63, 0, 0, 63])).astype(np.longdouble)
    tx = raw.tx.astype(np.longdouble)
    r = np.sqrt((tx**2).sum(axis=1))
    bend = np.sqrt(((tx[:, None] - border) ** 2).sum(axis=2)) - r[:, None] + (tx / r[:, None]) @ border.T
    highest = raw.frequency[0] + 95 * raw.frequency_step[0]
    wanted = float((4 * np.pi * highest / SPEED_OF_LIGHT * bend).max())
    assert curvature(raw, waves_about(raw, center), GRID).phase == pytest.approx(wanted, rel=1e-6)


def test_the_phase_that_planes_lack_is_that_of_both_paths():
    raw, center = noise_on(ARC, ARC[::-1] * [0.6, 1, 1.4]), np.zeros(3)
    border = GRID.at(np.array([0, 0, 25, 50, 50]), np.array([0, 63, 0, 0, 63])).astype(np.longdouble)
    bend = 0.0
    for ends in (raw.tx.astype(np.longdouble), raw.rx.astype(np.longdouble)):
        r = np.sqrt((ends**2).sum(axis=1))
        bend += np.sqrt(((ends[:, None] - border) ** 2).sum(axis=2)) - r[:, None] + (ends / r[:, None]) @ border.T
    highest = raw.frequency[0] + 95 * raw.frequency_step[0]
    wanted = float((2 * np.pi * highest / SPEED_OF_LIGHT * bend).max())
    assert curvature(raw, waves_about(raw, center), GRID).phase == pytest.approx(wanted, rel=1e-6)


def test_echoes_of_an_orbit_are_focused_as_backproject_does():
    orbit = sarcl.Orbit.kepler(7.171e6, 0.001, 1.72, span=(-60, 60))
    track = orbit.trajectory(start=0.0, prf=1500.0, n_pulses=256)
    x = orbit.geolocate(0.085, 1e6, heights=200.0)
    axes = sarcl.wgs84.local_axes(*sarcl.wgs84.geodetic(x)[:2])  # east, north, up
    points = x + np.array([[0, 0, 0], [7.0, -5, 0]]) @ axes
    chirp = sarcl.Waveform.chirp(center=5.4e9, bandwidth=100e6, duration=10e-6)
    raw = sarcl.echo(sarcl.Scene.points(points), chirp, track, range_window=(-60, 60), reference=x, tolerance=1e-4)
    assert 30 < np.linalg.norm(raw.rx - raw.tx, axis=1).min()  # the receiver has moved on
    grid = sarcl.ImageGrid.plane(center=x, shape=(20, 20), spacing=1.0, normal=axes[2], x_axis=axes[0])
    image = hold(raw, grid, 1e-4)
    oracle = sarcl.backproject(raw, grid, tolerance=1e-4)
    neglected = float(image.report.plan["plane-wave phase error"].split()[0])
    difference = np.linalg.norm(image.data - oracle.data) / np.linalg.norm(oracle.data)
    print(f"{difference:.2e}, plane-wave phase error {neglected:.2e} rad")
    assert difference <= neglected + 2e-4 and neglected < 0.05
    assert image.gain == oracle.gain and (image.tx == oracle.tx).all() and (image.rx == oracle.rx).all()
    # with the transmitter alone the image lies elsewhere: the range to the receiver changes it
    wrong = sarcl.polar_format(replace(raw, rx=raw.tx), grid, tolerance=1e-4)
    assert np.linalg.norm(wrong.data - oracle.data) > 0.5 * np.linalg.norm(oracle.data)


def test_points_are_sharp_within_the_radius_named_and_blurred_far_beyond():
    track = sarcl.Trajectory.circle(radius=700, height=500, arc=0.3, n_pulses=300).positions
    raw = points_seen(track, [(0, 0, 0)])
    grid = sarcl.ImageGrid.plane(shape=(64, 64), spacing=0.1)
    radius = curvature(raw, waves_about(raw, np.zeros(3)), grid).radius
    assert 3 < radius < 30
    level = {}
    for share in (0.9, 3.0):
        point = np.array([0.6, 0.8, 0]) * share * radius
        raw = points_seen(track, [point])
        n = 2 * int(np.ceil(abs(point).max() + 6)) * 10
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = sarcl.polar_format(raw, sarcl.ImageGrid.plane(shape=(n, n), spacing=0.1), check=False)
        level[share] = np.abs(image.data).max() / image.gain
    print(f"radius {radius:.1f} m, peaks {level}")
    assert level[0.9] > 0.85
    assert level[3.0] < 0.6


def test_a_grid_that_is_blurred_at_its_border_is_warned_of():
    track = sarcl.Trajectory.circle(radius=700, height=500, arc=0.3, n_pulses=300).positions
    raw = points_seen(track, [(0, 0, 0)])
    radius = curvature(raw, waves_about(raw, np.zeros(3)), GRID).radius
    with pytest.warns(sarcl.SarclWarning, match=rf"focuses within {radius:.3g} m.*backproject"):
        image = sarcl.polar_format(raw, sarcl.ImageGrid.plane(shape=(200, 200), spacing=0.5), check=False)
    assert image.report.plan["sharp within"] == f"{radius:.3g} m"
    sarcl.polar_format(raw, sarcl.ImageGrid.plane(shape=(20, 20), spacing=0.3), check=False)  # none: it would raise


def test_a_grid_beyond_the_range_window_is_warned_of():
    raw = noise_on(ARC, n_samples=24)  # +-6 m
    with pytest.warns(sarcl.SarclWarning, match=r"range window ends at 5.996 m.*repeats"):
        sarcl.polar_format(raw, GRID, tolerance=1e-2, check=False)


def test_bytes_do_not_change_the_image_and_too_few_are_refused(monkeypatch):
    raw = noise_on(ARC, n_samples=2000)
    grid = sarcl.ImageGrid.plane(shape=(300, 280), spacing=0.04)
    whole = hold(raw, grid, 1e-3)
    asked, read = [], sarcl.PhaseHistory.read
    monkeypatch.setattr(sarcl.PhaseHistory, "read", lambda raw, *rows: asked.append(rows) or read(raw, *rows))
    image = sarcl.polar_format(raw, grid, tolerance=1e-3, max_bytes=1e6, check=False)
    assert len(set(asked)) > 1 and len(asked) > len(set(asked))  # blocks of rows, for bands of the grid each
    assert np.linalg.norm(image.data - whole.data) <= 1e-6 * np.linalg.norm(whole.data)
    assert image.report.plan == whole.report.plan
    wide = sarcl.ImageGrid.plane(shape=(2, 9000), spacing=0.001)
    with pytest.raises(MemoryError, match="raise max_bytes"):
        sarcl.polar_format(raw, wide, max_bytes=1e6)


def test_progress_of_polar_format_is_reported_up_to_its_end():
    said = []
    sarcl.polar_format(noise_on(ARC), GRID, progress=lambda *a: said.append(a), check=False)
    stages, done, totals = zip(*said, strict=True)
    assert set(stages) == {"polar format"} and set(totals) == {1000}
    assert list(done) == sorted(done) and done[-1] == 1000


def test_a_plan_is_the_same_when_more_interpolation_tables_are_made(monkeypatch):
    cycles, step = np.linspace(-0.3, 0.3, 80).reshape(40, 2), np.full((40, 2), 8e-4)
    tables = []

    def counted(taps, oversample):
        tables.append((taps, oversample))
        return interpolator(taps, oversample)

    def plan(tolerance):
        tables.clear()
        try:
            made = nufft2d.make_plan(tolerance, (60, 70), cycles, step, 64, 8)
        except sarcl.ToleranceUnreachable as refused:
            return refused.best, len(tables)
        return (made.interpolator.taps, made.length, made.predicted_error, made.cost), len(tables)

    monkeypatch.setattr(nufft2d, "interpolator", counted)
    for tolerance in (0.5, 1e-1, 1e-3, 1e-5, 1e-6, 1e-7):
        chosen, few = plan(tolerance)
        with monkeypatch.context() as patch:
            patch.setattr(nufft2d, "lower_bound", lambda taps, oversample: 0.0)  # no candidate is passed over
            every, many = plan(tolerance)
        assert chosen == every and few <= min(many, 12)
    assert many == 48


def test_an_image_of_larger_error_than_its_tolerance_is_an_error(monkeypatch):
    plan = nufft2d.make_plan

    def poor(*args):
        return replace(plan(*args), interpolator=interpolator(2, 1.25))

    monkeypatch.setattr(polar_format, "make_plan", poor)
    with pytest.raises(sarcl.ToleranceMissed) as missed:
        sarcl.polar_format(noise_on(ARC), GRID, tolerance=1e-3, check=True)
    assert missed.value.measured > 1e-3 and missed.value.image.data.shape == GRID.shape


def test_a_dark_image_is_reported():
    raw = points_seen(ARC, [(60.0, 0, 0)])
    image = sarcl.polar_format(raw, sarcl.ImageGrid.plane(shape=(20, 20), spacing=0.5), tolerance=1e-3)
    assert float(image.report.plan["error of a dark image"]) > image.report.predicted_error


def test_bad_input_names_what_is_wrong_and_what_to_do():
    raw = noise_on(ARC)
    received_there = noise_on(ARC, np.concatenate([ARC[:5], np.zeros((1, 3)), ARC[6:]]))
    for bad, grid, match in (
        (received_there, GRID, r"rx\[5\] is at the grid's centre"),
        (replace(raw, compressed=False), GRID, "call sarcl.compress"),
        (raw[:1], GRID, "at least 2"),
        (replace(raw, weight=(np.arange(60) == 3).astype(float)), GRID, "1 row of weight > 0"),
        (raw, sarcl.ImageGrid.points(GRID.positions), "ImageGrid.plane: use backproject"),
        (raw, sarcl.ImageGrid.plane(center=ARC[7], shape=(4, 4), spacing=1), r"tx\[7\] is at the grid's centre"),
        (replace(raw, samples=raw.samples * np.complex64(1e34)), GRID, "scale the samples down"),
    ):
        with pytest.raises(ValueError, match=match):
            sarcl.polar_format(bad, grid)
    with pytest.raises(ValueError, match=r"cannot be met.*the best here is 1.0e-06: backproject"):
        sarcl.polar_format(raw, GRID, tolerance=1e-9)
    with pytest.raises(ValueError, match="tolerance"):
        sarcl.polar_format(raw, GRID, tolerance=2)
    with pytest.raises(TypeError, match="PhaseHistory"):
        sarcl.polar_format(raw.samples, GRID)


def test_measured_data_look_as_backproject_shows_them(data_folder):
    folder = data_folder / "gotcha"
    if not folder.is_dir():
        pytest.skip("no Gotcha data in the data folder")
    raw = sarcl.read(sorted(folder.glob("*.mat")))
    grid = sarcl.ImageGrid.plane(shape=(64, 64), spacing=0.2)
    image, oracle = (np.abs(f(raw, grid, tolerance=1e-3).data) for f in (sarcl.polar_format, sarcl.backproject))
    alike = np.corrcoef(image.ravel(), oracle.ravel())[0, 1]
    print(f"correlation {alike:.4f}")
    assert alike > 0.9


def test_the_forecast_is_of_the_plan_that_is_carried_out():
    raw = noise_on(ARC)
    forecast = sarcl.plan(sarcl.polar_format, raw, GRID, tolerance=1e-3)
    report = sarcl.polar_format(raw, GRID, tolerance=1e-3, check=False).report
    assert forecast.predicted_error == report.predicted_error and forecast.method == "polar format"
    assert {k: report.plan[k] for k in forecast.plan} == forecast.plan
    assert 8 * GRID.size < forecast.bytes and 0 < forecast.seconds < 60
    more = sarcl.plan(sarcl.polar_format, noise_on(ARC, n_samples=960), GRID, tolerance=1e-3)
    assert more.seconds - more.planning > 2 * (forecast.seconds - forecast.planning)
    with pytest.raises(ValueError, match="tolerance"):
        sarcl.plan(sarcl.polar_format, raw, GRID, tolerance=2)
