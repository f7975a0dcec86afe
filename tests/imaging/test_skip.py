"""Skipped contributions are zero and counted by reason: beams, range windows, weights, empty cells."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import REPEATED, noise_history, thinned

import sarcl
from sarcl.base.stage_timer import Clock
from sarcl.imaging import choose_method
from sarcl.imaging.direct import direct
from sarcl.imaging.engine import Skipped
from sarcl.imaging.focusing_task import BEAM_EDGE, SKIPS, make_task
from sarcl.model.image_grid import ImageGrid
from sarcl.numerics.cost_model import DeviceClass
from sarcl.opencl.choose_device import open_device
from sarcl.reference.backproject import backproject as exact

PLANE = ImageGrid.plane(shape=(90, 110), spacing=0.5)
POINTS = ImageGrid.points(
    PLANE.positions[::2, ::2] + np.random.default_rng(3).uniform(-0.2, 0.2, (45, 55, 3)) * [1, 1, 10]
)


def aimed(raw, target, sweep=0.0):
    """Directions from every transmitter to `target`, m (3,), which moves by `sweep` m along y over the aperture."""
    along = np.linspace(-sweep / 2, sweep / 2, raw.n_rows)[:, None] * [0, 1, 0]
    return np.asarray(target) + along - raw.tx


def spread(distance, width):
    """The full angle under which `width` m are seen at `distance` m."""
    return 2 * np.arctan(width / 2 / distance)


def oracle(raw, grid, beam=None, most=400, **options):
    """Index of pixels that are not empty, their exact values, and the norm errors are relative to."""
    index, places = grid.sample(most, seed=9)
    wanted, norm = exact(raw, places, beam=beam, **options)
    return index, wanted, max(float(np.linalg.norm(wanted[np.isfinite(wanted)])), norm)


def near(image, raw, beam=None, **options):
    """The error of an image, and what it may be."""
    index, wanted, norm = oracle(raw, image.grid, beam, **options)
    clear = np.isfinite(wanted)  # pixels farther than `edge`, an option, from the edge of the beam
    return np.linalg.norm(np.asarray(image.data)[index][clear] - wanted[clear]) / norm


def change(a, b):
    """Relative difference of two images."""
    return np.linalg.norm(a.data - b.data) / np.linalg.norm(a.data)


def total(image):
    """All (row, pixel) pairs of a report, done or not."""
    return image.report.contributions_done + sum(image.report.contributions_skipped.values())


@pytest.mark.parametrize("grid, bistatic", thinned([PLANE, POINTS], [False, True]))
def test_a_beam_is_part_of_the_model_and_leaving_pairs_out_is_not(device, grid, bistatic):
    raw = noise_history(n_rows=24, bistatic=bistatic)
    angle, toward = spread(10e3, 16.0), aimed(raw, (4, -3, 0), sweep=30.0)
    options = {"beam": (angle, toward), "tolerance": 1e-4, "device": device, "method": "direct"}
    image = sarcl.backproject(raw, grid, **options)
    whole = sarcl.backproject(raw, grid, skip=False, **options)
    assert near(image, raw, (angle, toward)) <= 1e-4 and change(whole, image) <= 1e-6
    skipped = image.report.contributions_skipped
    assert skipped["beam"] > 0.1 * 24 * grid.size and total(image) == 24 * grid.size
    assert sum(whole.report.contributions_skipped.values()) == 0
    # and it is not the image without a beam
    assert change(sarcl.backproject(raw, grid, tolerance=1e-4, device=device), image) > 0.1


def test_a_spotlight_is_aimed_at_the_grids_centre(device):
    raw = noise_history(n_rows=20)
    grid = ImageGrid.plane(center=(3, 5, 1), shape=(100, 100), spacing=0.4)
    # the pixel at `center`, with an even number of pixels not the middle of the bounds
    angle, middle = spread(10e3, 15.0), np.array([3.0, 5.0, 1.0])
    assert np.abs(grid.bounds.mean(axis=0) - middle).max() == pytest.approx(0.2)
    image = sarcl.backproject(raw, grid, beam=angle, tolerance=1e-3, device=device)
    assert near(image, raw, (angle, middle - raw.tx)) <= 1e-3
    pointed = sarcl.backproject(raw, grid, beam=(angle, middle - raw.tx), tolerance=1e-3, device=device)
    assert (pointed.data == image.data).all()
    assert not image.data[0, 0] and image.data[50, 50]
    assert image.report.contributions_skipped["beam"] > 0


@pytest.mark.parametrize(
    "lanes, bistatic, tolerance",
    thinned([(True, False), (False, False), (False, True), (True, True)], [1e-1, 1e-3, 1e-5], every=3, slow=(1,)),
)
def test_both_kernels_see_the_same_beam_and_window(lanes, tolerance, bistatic):
    raw = noise_history(n_rows=33, n_samples=32, bistatic=bistatic)  # a swath of +-4 m
    beam = spread(10e3, 14.0), aimed(raw, (0, 2, 0), sweep=20.0)
    device = open_device()
    counts, images = {}, {}
    for skip in (True, False, {"beam"}, {"range window"}):
        task = make_task(raw, PLANE, None, None, False, skip, beam)
        plan, tiling = direct.make_plan(task, tolerance, DeviceClass(lanes))
        data = np.empty(PLANE.shape, np.complex64)
        engine = direct.Direct(device, task, plan, tiling)
        skipped = engine.fill(0, tiling.n_bands, data, 2**28, Clock(), lambda rows: None)
        counts[str(skip)] = skipped.window, skipped.beam
        images[str(skip)] = sarcl.Image(data, PLANE)
    assert near(images["True"], raw, beam) <= tolerance
    for other in images.values():
        assert change(images["True"], other) <= 1e-6
    (window, lit), none = counts["True"], counts["False"]
    assert window > 0 and lit > 0 and none == (0, 0)
    # a pair that both would leave out is the window's
    assert counts["{'range window'}"] == (window, 0)
    assert counts["{'beam'}"][0] == 0 and counts["{'beam'}"][1] > lit


@pytest.mark.parametrize(
    "distance, width, grid", thinned([(10e3, 8.0), (36e6, 800.0), (770e3, 8.0)], [PLANE, POINTS])[:5]
)
def test_the_edge_of_a_narrow_beam_is_in_place_at_any_distance(device, grid, distance, width):
    # positions and directions in pairs of float32 place the edge to 1e-14 rad over half the angle; directions in
    # float32, of which it is the small difference, would move it by 1e-7 rad: 0.1 m and 4 m at the larger distances
    raw, angle = noise_history(n_rows=24, distance=distance, arc=700 / distance), spread(distance, width)
    beam = angle, aimed(raw, (4, -3 - width / 2, 0), sweep=30.0)
    edge = 1e-14 / (angle / 2)
    assert np.isfinite(oracle(raw, grid, beam, most=3000, edge=edge)[1]).mean() > 0.9
    for tolerance in (1e-3, 1e-5):
        image = sarcl.backproject(raw, grid, beam=beam, tolerance=tolerance, device=device, method="direct")
        assert (np.asarray(image.data) == 0).any()
        assert near(image, raw, beam, most=3000, edge=edge) <= tolerance


def test_pairs_left_out_are_pairs_that_no_pulse_sees():
    # counted by hand, pixel by pixel: what is skipped lies outside, and most of what lies outside is skipped
    raw = noise_history(n_rows=10, n_samples=32)
    beam = spread(10e3, 12.0), aimed(raw, (0, 0, 0), sweep=10.0)
    image = sarcl.backproject(raw, PLANE, beam=beam, tolerance=1e-3)
    x = PLANE.positions.reshape(-1, 3)
    outside = unlit = 0
    for p in range(raw.n_rows):
        late = 2 / 299792458.0 * (np.linalg.norm(x - raw.tx[p], axis=1) - raw.reference_range[p])
        away = x - raw.tx[p]
        cosine = away @ beam[1][p] / np.linalg.norm(away, axis=1) / np.linalg.norm(beam[1][p])
        gated = abs(late) > 1 / (2 * raw.frequency_step[p])
        outside, unlit = outside + gated.sum(), unlit + (~gated & (cosine < np.cos(beam[0] / 2))).sum()
    skipped = image.report.contributions_skipped
    assert 0.5 * outside < skipped["range window"] <= outside
    assert 0.3 * (outside + unlit) < skipped["range window"] + skipped["beam"] <= outside + unlit


@pytest.mark.parametrize("distance, angle", thinned([8.0, 60.0, 800e3], [0.02, 1.0, np.pi, 4.0, 6.2]))
def test_any_angle_at_any_distance(device, angle, distance):
    # antennas over, in and beside the scene: points ahead of them, behind them, and at the cone's tip
    raw = noise_history(n_rows=8, n_samples=32, distance=distance, bandwidth=100e6)
    toward = (0.3, -0.2, -1.0)
    random, extent = np.random.default_rng(1), min(30.0, 0.3 * distance)
    axis = np.array(toward) / np.linalg.norm(toward)
    lit = raw.tx[3] + distance * axis + random.uniform(-1, 1, (200, 3)) * np.minimum(extent, distance * angle)
    behind = raw.tx[5] - random.uniform(0.05, 0.1, (20, 1)) * extent * axis
    grid = ImageGrid.points(
        np.concatenate([random.uniform(-extent, extent, (400, 3)), lit, behind, [raw.tx[2] + 0.01]])
    )
    raw = replace(raw, reference_range=np.linalg.norm(raw.tx - lit.mean(axis=0), axis=1))
    image = sarcl.backproject(raw, grid, beam=(angle, toward), tolerance=1e-3, device=device)
    assert near(image, raw, (angle, toward), most=700, edge=BEAM_EDGE) <= 1e-3
    plain = sarcl.backproject(raw, grid, beam=(angle, toward), tolerance=1e-3, device=device, skip=False)
    assert np.linalg.norm(plain.data - image.data) <= 1e-6 * np.linalg.norm(plain.data)


def test_a_beam_and_a_profile_that_repeats(device):
    raw = noise_history(n_rows=12, n_samples=16)
    beam = spread(10e3, 18.0), aimed(raw, (0, 3, 0))
    image = sarcl.backproject(raw, PLANE, beam=beam, wrap=True, tolerance=1e-3, device=device)
    assert near(image, raw, beam, wrap=True) <= 1e-3
    assert image.report.contributions_skipped["range window"] == 0 < image.report.contributions_skipped["beam"]


def strip_history(n=400, n_samples=96, length=60.0, distance=10e3):
    """White noise along a straight line in y that looks towards +x."""
    y = length * (np.arange(n) / (n - 1) - 0.5)
    tx = np.stack([np.full(n, -0.7 * distance), y, np.full(n, 0.714 * distance)], axis=1)
    raw = noise_history(n_rows=n, n_samples=n_samples, bandwidth=300e6)
    return sarcl.PhaseHistory(
        raw.samples, frequency=raw.frequency, frequency_step=raw.frequency_step, tx=tx,
        reference_range=np.linalg.norm(tx * [1, 0, 1], axis=1),
    )  # fmt: skip


BROADSIDE = (0.7, 0.0, -0.714)


def looked_at(chosen, task):
    """How the factorised method sees a whole task."""
    engine = chosen.on(open_device(), task)
    parts = engine.memory.parts(0, chosen.tiling.n_bands, 1e12)
    return engine._coverage(next(chosen.tiling.sections(parts, chosen.plan.factors)).roots)


@pytest.mark.parametrize("listed", [False, pytest.param(True, marks=REPEATED)], ids=["plane", "points"])
@pytest.mark.costly
def test_sub_apertures_merge_rows_that_see_a_tile_whole_and_add_the_others_directly(device, listed):
    # a beam 130 m wide passes over the scene: every tile sees some pulses whole, some in part, some not at all
    raw, beam = strip_history(n=900, n_samples=256, length=260.0), (spread(10e3, 130.0), BROADSIDE)
    grid = ImageGrid.plane(shape=(240, 100), spacing=0.25)
    grid = ImageGrid.points(grid.positions) if listed else grid
    task = make_task(raw, grid, None, None, False, True, beam)
    sight = looked_at(choose_method.choose(task, "factorized", 1e-2), task)
    assert sight.merged.any() and any(rows is not None for _, rows in sight.directly) and sight.missed[1].any()
    options = {"tolerance": 1e-2, "beam": beam, "method": "factorized", "device": device}
    image = sarcl.backproject(raw, grid, **options)
    assert near(image, raw, beam, most=100) <= image.report.predicted_error <= 1e-2
    whole = sarcl.backproject(raw, grid, skip=False, **options)
    assert change(whole, image) <= 1e-6
    assert image.report.contributions_skipped["beam"] > 0.1 * raw.n_rows * grid.size
    assert sum(whole.report.contributions_skipped.values()) == 0 and total(image) == raw.n_rows * grid.size


def test_bytes_do_not_change_what_sub_apertures_make_of_a_stripmap():
    raw, beam = strip_history(n=900, n_samples=256, length=260.0), (spread(10e3, 130.0), BROADSIDE)
    grid = ImageGrid.plane(shape=(300, 160), spacing=0.25)
    images = [
        sarcl.backproject(raw, grid, beam=beam, tolerance=1e-2, method="factorized", max_bytes=b) for b in (None, 2e7)
    ]
    assert change(*images) <= 1e-6 and near(images[0], raw, beam, most=100) <= 1e-2
    assert images[0].report.contributions_skipped == images[1].report.contributions_skipped


def test_tiles_that_few_rows_see_whole_are_left_to_the_direct_method():
    raw, beam = strip_history(length=140.0), (spread(10e3, 30.0), BROADSIDE)
    grid = ImageGrid.plane(shape=(240, 100), spacing=0.3)
    task = make_task(raw, grid, None, None, False, True, beam)
    sight = looked_at(choose_method.choose(task, "factorized", 1e-2), task)
    assert not sight.merged.any() and [rows for _, rows in sight.directly] == [None]
    image = sarcl.backproject(raw, grid, beam=beam, tolerance=1e-2, method="factorized")
    assert near(image, raw, beam) <= 1e-2 and total(image) == raw.n_rows * grid.size


def test_sub_apertures_take_rows_that_see_a_tile_whole_and_no_others():
    # half of the pulses look elsewhere: every tile is merged from the other half
    raw = strip_history(n_samples=384, length=20.0)  # its window holds the scene
    toward = np.where((np.arange(raw.n_rows) % 100 < 50)[:, None], BROADSIDE, (-1.0, 0.0, 0.0))
    beam, grid = (0.2, toward), ImageGrid.plane(shape=(150, 170), spacing=0.25)
    task = make_task(raw, grid, None, None, False, True, beam)
    chosen = choose_method.choose(task, "factorized", 1e-2)
    sight = looked_at(chosen, task)
    assert sight.merged.all() and not sight.directly and all(rows.sum() == 200 for rows in sight.left_out)
    assert (sight.missed == [[0], [200]]).all()
    image = sarcl.backproject(raw, grid, beam=beam, tolerance=1e-2, method="factorized")
    assert near(image, raw, beam, most=100) <= 1e-2
    assert image.report.contributions_skipped["beam"] == 200 * grid.size
    # with a beam that contains no pixel, no contribution is computed
    dark = sarcl.backproject(raw, grid, beam=(0.2, (-1, 0, 0)), tolerance=1e-2, method="factorized")
    assert not dark.data.any() and dark.report.contributions_done == 0


def test_sub_apertures_with_a_window_and_a_beam():
    raw, beam = strip_history(n_samples=40, length=140.0), (spread(10e3, 30.0), BROADSIDE)
    grid = ImageGrid.plane(shape=(200, 300), spacing=0.3)
    image = sarcl.backproject(raw, grid, beam=beam, tolerance=1e-2, method="factorized")
    straight = sarcl.backproject(raw, grid, beam=beam, tolerance=1e-2, method="direct")
    assert near(image, raw, beam, most=200) <= 1e-2 and near(straight, raw, beam, most=200) <= 1e-2
    for made in (image, straight):
        assert min(made.report.contributions_skipped[r] for r in ("range window", "beam")) > 0
        assert total(made) == raw.n_rows * grid.size


def test_a_beam_without_any_pixel_is_reported(caplog):
    raw = noise_history(n_rows=5)
    with caplog.at_level(logging.WARNING, "sarcl"):
        image = sarcl.backproject(raw, PLANE, beam=(0.01, (0, 0, 1)))
    assert not image.data.any() and image.report.contributions_done == 0
    assert "range window and beam of any row" in caplog.text


@pytest.mark.parametrize("beam", [2 * np.pi, (2 * np.pi, (0, 0, 1)), 0.5, (3.5, (0, 0, -1))])
def test_a_beam_that_contains_every_pixel_changes_nothing(device, beam):
    raw = noise_history(n_rows=12)
    plain = sarcl.backproject(raw, PLANE, tolerance=1e-4, device=device)
    image = sarcl.backproject(raw, PLANE, beam=beam, tolerance=1e-4, device=device)
    assert change(plain, image) <= 1e-6 and image.report.contributions_skipped["beam"] == 0


def test_rows_of_weight_zero_take_their_beams_with_them():
    raw = noise_history(n_rows=21)
    beam = spread(10e3, 16.0), aimed(raw, (0, 0, 0), sweep=30.0)
    weights = np.arange(21) % 3
    image = sarcl.backproject(raw, PLANE, beam=beam, weights=weights, tolerance=1e-4)
    whole = sarcl.backproject(raw, PLANE, beam=beam, weights=weights, tolerance=1e-4, skip=SKIPS[:2])
    assert near(image, raw, beam, row_weight=weights) <= 1e-4 and change(whole, image) <= 1e-6
    assert image.report.contributions_skipped["zero weight"] == 7 * PLANE.size
    assert whole.report.contributions_skipped["zero weight"] == 0


def holed(grid, share=0.3, seed=4):
    """Positions of a grid as a height model has them: no data in single cells and in one corner."""
    positions = np.array(grid.positions)
    gone = np.random.default_rng(seed).uniform(size=grid.shape) < share
    gone[:20, :25] = True
    positions[gone] = np.nan
    return positions, gone


@pytest.mark.parametrize("method", ["direct", "factorized"])
def test_empty_cells_are_zero_counted_and_change_no_other_pixel(device, method):
    raw = strip_history(n_samples=64)
    positions, gone = holed(ImageGrid.plane(shape=(120, 140), spacing=0.3))
    grid = ImageGrid.points(positions)
    # at 1e-3 plans for all pixels and for those with data are the same; at 1e-2 two plans cost GPUs nearly the same
    options = {"tolerance": 1e-3 if method == "direct" else 1e-2, "method": method, "device": device}
    image = sarcl.backproject(raw, grid, **options)
    assert not image.data[gone].any() and np.isfinite(image.data).all()
    assert near(image, raw) <= image.report.predicted_error <= options["tolerance"]
    assert image.report.contributions_skipped["no data"] == raw.n_rows * gone.sum()
    assert total(image) == raw.n_rows * grid.size
    # without them, the same pixels
    if method == "direct":
        only = sarcl.backproject(raw, ImageGrid.points(positions[~gone]), **options)
        assert np.linalg.norm(only.data - image.data[~gone]) <= 1e-5 * np.linalg.norm(only.data)


@pytest.mark.costly
def test_empty_cells_that_are_not_skipped_are_zero_all_the_same(device):
    raw = noise_history(n_rows=15)
    positions, gone = holed(PLANE)
    grid = ImageGrid.points(positions)
    image = sarcl.backproject(raw, grid, tolerance=1e-5, device=device, check=True)
    for skip in (False, {"range window", "zero weight"}):
        whole = sarcl.backproject(raw, grid, tolerance=1e-5, skip=skip, device=device, check=True)
        assert not whole.data[gone].any() and whole.report.contributions_skipped["no data"] == 0
        assert total(whole) == 15 * grid.size and max(whole.report.measured_error, near(whole, raw)) <= 1e-5
        assert change(whole, image) <= 1e-6 * 4  # other tiles: both are within 1e-5 of the exact sum


def test_every_reason_at_once(device):
    raw = replace(noise_history(n_rows=30, n_samples=32), weight=np.arange(30) % 3)
    positions, gone = holed(ImageGrid.plane(shape=(180, 220), spacing=1.0), share=0.1)
    grid, beam = ImageGrid.points(positions), (spread(10e3, 14.0), aimed(noise_history(n_rows=30), (0, 2, 0)))
    image = sarcl.backproject(raw, grid, beam=beam, tolerance=1e-4, device=device)
    skipped = image.report.contributions_skipped
    assert near(image, raw, beam, row_weight=raw.weight) <= 1e-4
    assert set(skipped) == set(SKIPS) and all(skipped.values())
    assert skipped["zero weight"] == 10 * grid.size and skipped["no data"] == 20 * gone.sum()
    assert total(image) == 30 * grid.size


def test_bands_without_any_data():
    # bands of 2**18 points: the first and the third hold none
    raw = noise_history(n_rows=10)
    positions = np.full((2**20, 3), np.nan)
    positions[2**18 + 100 :][:110] = positions[-110:] = np.random.default_rng(2).uniform(-3, 3, (110, 3))
    for device in (open_device(), open_device().without_fp64()):
        image = sarcl.backproject(raw, ImageGrid.points(positions), tolerance=1e-4, max_bytes=1e6, device=device)
        assert near(image, raw) <= 1e-4
        assert (image.data == 0).tolist() == np.isnan(positions[:, 0]).tolist()
        assert image.report.contributions_skipped["no data"] == 10 * (2**20 - 220)
        assert image.report.contributions_done == 10 * 220


def test_an_image_with_empty_cells_goes_to_a_file_and_a_picture(tmp_path):
    raw = noise_history(n_rows=10)
    positions, gone = holed(PLANE)
    grid = ImageGrid.points(positions)
    image = sarcl.backproject(raw, grid, tolerance=1e-3, out=tmp_path / "image.h5")
    again = sarcl.read(tmp_path / "image.h5")
    assert np.array_equal(again.grid.positions, positions, equal_nan=True)
    assert (again.grid.empty == gone).all() and (again.data[...] == image.data[...]).all()
    levels = np.asarray(again.show().convert("L"))
    left, top, right, bottom = again.show().info["frame"]
    shown = levels[top:bottom, left:right][::-1]
    rows, columns = (np.array(shown.shape) // grid.shape).tolist()
    assert (shown[rows // 2 :: rows, columns // 2 :: columns][gone] == 0).all()
    assert shown.max() == 255
    again.save(tmp_path / "image.png")


def test_a_mask_says_the_same_as_positions_that_are_not_numbers():
    positions, gone = holed(PLANE)
    filled = np.where(gone[..., None], -9999.0, positions)
    filled[5, 5] = gone[5, 5] or filled[5, 5]
    masked, plain = ImageGrid.points(filled, valid=~gone), ImageGrid.points(positions)
    assert np.array_equal(masked.positions, plain.positions, equal_nan=True)
    assert (masked.empty == gone).all() and (masked.bounds == plain.bounds).all() and masked.size == gone.size
    assert (plain.bounds == [positions[~gone].min(axis=0), positions[~gone].max(axis=0)]).all()
    whole = plain.filled()
    assert whole.empty is None and (whole.positions[~gone] == positions[~gone]).all()
    assert whole.filled() is whole and ImageGrid.points(filled).empty is None and PLANE.empty is None
    index, places = plain.sample(10**6, seed=1)
    assert not gone[index].any() and len(places) == (~gone).sum()


BAD_CELLS = {
    "one coordinate": (lambda x: x.__setitem__((1, 2, 0), np.nan), {}, r"positions\[1, 2, 0\] is nan.*all three"),
    "two coordinates": (lambda x: x.__setitem__((0, 1, [0, 2]), np.nan), {}, r"positions\[0, 1, 0\] is nan"),
    "infinite": (lambda x: x.__setitem__((2, 3), np.inf), {}, r"positions\[2, 3, 0\] is inf"),
    "all empty": (lambda x: x.fill(np.nan), {}, "every cell of the grid is empty"),
    "nothing valid": (lambda x: None, {"valid": np.zeros((3, 4), bool)}, "every cell of the grid is empty"),
    "mask of numbers": (lambda x: None, {"valid": np.ones((3, 4))}, "valid is float64.*wanted bool"),
    "mask of another shape": (lambda x: None, {"valid": np.ones((4, 3), bool)}, r"valid is bool of shape \(4, 3\)"),
}


@pytest.mark.parametrize("name", BAD_CELLS)
def test_bad_cells_say_what_was_wanted(name):
    spoil, options, message = BAD_CELLS[name]
    positions = np.ones((3, 4, 3))
    spoil(positions)
    with pytest.raises(ValueError, match=message):
        ImageGrid.points(positions, **options)


def test_tolerances_below_complex64_know_beams_and_empty_cells():
    device = next((d for d in map(open_device, range(len(sarcl.devices()))) if d.info.fp64), None)
    if device is None:
        pytest.skip("no float64")
    raw = noise_history(n_rows=12, n_samples=32)
    positions, gone = holed(ImageGrid.plane(shape=(90, 110), spacing=1.0))
    beam = spread(10e3, 14.0), aimed(raw, (0, 2, 0))
    options = {"beam": beam, "tolerance": 1e-9, "device": device}
    image = sarcl.backproject(raw, ImageGrid.points(positions), **options)
    assert image.data.dtype == np.complex128 and near(image, raw, beam) <= 1e-9 and not image.data[gone].any()
    skipped = image.report.contributions_skipped
    assert skipped["beam"] > 0 and skipped["range window"] > 0 and total(image) == 12 * gone.size
    whole = sarcl.backproject(raw, ImageGrid.points(positions), skip=False, **options)
    assert change(image, whole) <= 1e-9 and sum(whole.report.contributions_skipped.values()) == 0


def test_counts_of_skipped_pairs_add_up_by_reason():
    missed, sizes = np.array([[3, 0], [1, 2]]), np.array([2**40, 5])
    assert Skipped.of_tiles(missed, sizes) + Skipped.of_tiles(missed, sizes) == Skipped(6 * 2**40, 2 * 2**40 + 20)


BAD_BEAMS = {
    "zero": (0, "beam is 0; it must be greater than 0"),
    "negative": (-0.1, "beam is -0.1; it must be greater than 0"),
    "not a number": (np.nan, "beam is nan; it must be finite"),
    "degrees": (30, "beam is 30 rad; a full angle is at most 2 pi"),
    "text": ("wide", "beam must be a number, got 'wide'"),
    "an array": (np.ones(3), "beam must be a number"),
    "three parts": ((0.1, 0.2, (0, 0, 1)), "beam has 3 parts"),
    "pair, zero": ((0, (0, 0, 1)), r"beam\[0\] is 0; it must be greater than 0"),
    "no direction": ((0.1, (0, 0, 0)), r"beam\[1\] is \(0, 0, 0\); a direction needs a length"),
    "one zero direction": ((0.1, np.eye(3)[[0, 1]] * [[1], [0]]), r"beam\[1\]\[1\] is \(0, 0, 0\)"),
    "direction not finite": ((0.1, (0, np.nan, 1)), r"beam\[1\]\[1\] is nan"),
    "wrong shape": ((0.1, np.ones((4, 3))), r"beam\[1\] has shape \(4, 3\), wanted .* per row \(2, 3\)"),
    "flat": ((0.1, (1, 0)), r"beam\[1\] has shape \(2,\)"),
    "ragged": ((0.1, ((1, 0, 0), (1, 0))), r"beam\[1\]"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_BEAMS)
def test_bad_beams_say_what_was_wanted(name):
    beam, message = BAD_BEAMS[name]
    with pytest.raises(ValueError, match=message):
        sarcl.backproject(noise_history(n_rows=2), PLANE, beam=beam)


def test_an_antenna_at_the_grids_centre_has_no_spotlight():
    raw = noise_history(n_rows=2)
    grid = ImageGrid.plane(center=raw.tx[1], shape=(3, 3), spacing=1.0)
    with pytest.raises(ValueError, match=r"tx\[1\] is at the grid's centre"):
        sarcl.backproject(raw, grid, beam=0.1)


def test_an_unknown_reason_lists_the_known():
    with pytest.raises(ValueError, match="'range window', 'beam', 'zero weight', 'no data'"):
        sarcl.backproject(noise_history(n_rows=2), PLANE, skip={"night"})
