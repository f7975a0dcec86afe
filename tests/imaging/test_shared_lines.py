"""Lines of pixels that a work-group shares: right at every tolerance and edge, and with pulses that no line holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_history, noise_on, straight
from helpers.devices import opened, variants

import sarcl
from sarcl.base.stage_timer import Clock
from sarcl.imaging.direct import _line_curvature, _shared_line_plan, direct, tile_kernels
from sarcl.imaging.direct._shared_line_plan import SharedLinePlan
from sarcl.imaging.focusing_task import make_task
from sarcl.numerics import cost_model, error_bounds, interpolation
from sarcl.numerics.cost_model import DeviceClass
from sarcl.opencl import native_functions
from sarcl.opencl.device import Device

SLOW = pytest.mark.slow
WIDE = DeviceClass(lanes=False, local_memory=cost_model.MOST_LOCAL, gathering=cost_model.ON_GPU)
PLANE = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(65, 70), spacing=(0.3, 0.2))


@pytest.fixture(params=variants(("no-fp64",)))
def wide(request):
    """Every device as GPUs are, with one lane per work-item; also without float64."""
    device = opened(request.param)
    return device.one_lane() if device.info.vector_width > 1 else device


def planned(raw, grid, tolerance, *, wrap=False, skip=True, beam=None, on=WIDE, **limits):
    """A task, its plan by shared lines with some of its limits changed, and the tiling."""
    task = make_task(raw, grid, None, None, wrap, skip, beam)
    made = _shared_line_plan.choose(task, tolerance, on)
    assert isinstance(made, SharedLinePlan), "no plan by shared lines meets the tolerance"
    made = replace(made, limits={**made.limits, **limits})
    return task, made, direct.LineTiling(grid, made.side)


def focused(device, task, plan, tiling):
    """The image of a plan, and the pairs that were skipped."""
    data = np.empty(task.grid.shape, np.complex64)
    skipped = direct.Direct(device, task, plan, tiling).fill(0, tiling.n_bands, data, 2**28, Clock(), lambda rows: None)
    return sarcl.Image(data, task.grid), skipped


def spaceborne(n_rows=40, squint=0.0, bistatic=False, **fields):
    """Pulses from 770 km, as near to one another as 11 000 are that resolve a pixel of 0.25 m."""
    tx = straight(n_rows, aperture=4.3 * n_rows, distance=770e3, squint=squint)
    rx = tx + np.array([3e4, 5e4, 0.0]) if bistatic else None
    return noise_on(tx, rx, **{"bandwidth": 600e6, "n_samples": 128, **fields})


def near(squint):
    """Pulses from 10 km: lines run across the range, or obliquely where the squint is large."""
    return noise_on(straight(40, aperture=2.0, squint=squint), bandwidth=600e6, n_samples=256)


CASES = {
    "1e-1": (lambda: spaceborne(), 1e-1, {}),
    "1e-2 squinted, columns": (lambda: spaceborne(squint=1.0), 1e-2, {}),
    "1e-3": (lambda: spaceborne(), 1e-3, {}),
    "1e-4 bistatic": (lambda: spaceborne(bistatic=True), 1e-4, {}),
    "3e-5": (lambda: spaceborne(), 3e-5, {}),
    "3e-5 oblique, slopes": (lambda: spaceborne(squint=0.5, n_samples=200), 3e-5, {}),
    "1e-5": (lambda: spaceborne(seed=3), 1e-5, {}),
    "10 km oblique, slopes": (lambda: near(0.35), 1e-3, {}),
    "10 km, slopes": (lambda: near(0.15), 1e-4, {}),
    "3 km bistatic, slopes": (
        lambda: noise_history(distance=3e3, bistatic=True, n_rows=70, arc=0.0003, n_samples=256),
        1e-2,
        {},
    ),
    "3 km bistatic, groups of 8": (lambda: noise_history(distance=3e3, bistatic=True, n_rows=70, arc=0.03), 1e-2, {}),
    "wrap": (lambda: spaceborne(n_samples=16), 1e-3, {"wrap": True}),
    "window": (lambda: spaceborne(n_samples=32), 1e-3, {}),
    "window, nothing skipped": (lambda: spaceborne(n_samples=32), 1e-3, {"skip": False}),
    "short last group": (lambda: spaceborne(n_rows=67), 1e-3, {}),
}
QUICK = ("1e-3", "10 km, slopes", "window")
BY_PIXELS = ("window", "groups of 8")  # cases whose pulses no line holds, or whose windows end in every tile


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in QUICK else SLOW) for n in CASES])
def test_shared_lines_meet_what_is_predicted(wide, monkeypatch, name):
    make, tolerance, options = CASES[name]
    raw = make()
    counts = pixel_by_pixel(monkeypatch)
    task, plan, tiling = planned(raw, PLANE, tolerance, **options)
    image, _ = focused(wide, task, plan, tiling)
    error = image_error(image, raw, most=600, wrap=options.get("wrap", False))
    assert error <= plan.predicted_error <= tolerance
    assert (plan.slopes is not None) == ("slopes" in name) or "groups of 8" in name
    assert (np.sum(counts, axis=0)[0] > 0) != any(words in name for words in BY_PIXELS)


@SLOW
@pytest.mark.parametrize("tolerance", [1e-1, 1e-3])
def test_shared_lines_in_a_beam_leave_out_what_no_pixel_needs(wide, tolerance):
    raw = noise_history(arc=0.002, n_samples=64)
    angle = 2 * np.arctan(7.0 / 10e3)
    toward = np.array([1.0, 2, 0]) + np.linspace(-9, 9, 40)[:, None] * [0, 1, 0] - raw.tx
    task, plan, tiling = planned(raw, PLANE, tolerance, beam=(angle, toward))
    image, skipped = focused(wide, task, plan, tiling)
    assert image_error(image, raw, most=600, beam=(angle, toward)) <= plan.predicted_error
    assert skipped.beam > 0
    task, plan, tiling = planned(raw, PLANE, tolerance, beam=(angle, toward), skip=False)
    whole, none = focused(wide, task, plan, tiling)
    assert (none.window, none.beam) == (0, 0)
    assert np.linalg.norm(whole.data - image.data) <= 1e-5 * np.linalg.norm(image.data)


def pixel_by_pixel(monkeypatch):
    """A list that gets, per launch, how many pulses of all tiles are added by lines and how many pixel by pixel."""
    counts, add = [], tile_kernels.SharedLineKernel.add

    def counted(kernel, on, low, high, pulses, *rest, **options):
        buffers, run = {}, kernel.device.run

        def keep(made, size, group, *args, **how):
            buffers[made.function_name] = args[-1], size
            run(made, size, group, *args, **how)

        with monkeypatch.context() as patch:
            patch.setattr(kernel.device, "run", keep)
            add(kernel, on, low, high, pulses, *rest, **options)
        schedule, (groups, tiles) = buffers["schedule_pulses"]
        heads = np.empty((groups * tiles, 4 + tile_kernels.ENTRY * kernel.plan.group), np.int32)
        kernel.device.download(schedule, heads)
        counts.append((int(heads[:, 0].sum()), int(heads[:, 1].sum())))

    monkeypatch.setattr(tile_kernels.SharedLineKernel, "add", counted)
    return counts


@pytest.mark.parametrize("most", [64, pytest.param(16, marks=SLOW)])
def test_groups_are_as_small_as_the_driver_wants_them_for_this_kernel(wide, monkeypatch, most):
    task, plan, tiling = planned(spaceborne(), PLANE, 1e-3)
    expected, _ = focused(wide, task, plan, tiling)
    monkeypatch.setattr(Device, "max_group", lambda self, kernel: most)
    sizes = launches(monkeypatch)
    image, _ = focused(wide, task, plan, tiling)
    assert {group for _, group in sizes} == {(most, 1, 1)} and plan.items > most
    assert np.linalg.norm(image.data - expected.data) <= 1e-6 * np.linalg.norm(expected.data)


def test_devices_of_small_groups_take_small_tiles():
    task = make_task(spaceborne(), PLANE, None, None, False, True)
    plan = _shared_line_plan.choose(task, 1e-3, WIDE._replace(most_items=64))
    assert plan is not None and plan.side == 32 and plan.items == 64
    assert _shared_line_plan.choose(task, 1e-3, WIDE._replace(most_items=63)) is None


def test_few_tiles_share_the_pulses_among_work_groups_that_occupy_a_device(wide, monkeypatch):
    raw = spaceborne(n_rows=150)
    task, plan, tiling = planned(raw, PLANE, 1e-3)
    plan = replace(plan, group=16)
    alone, skipped = focused(wide, task, plan, tiling)
    many = Device(replace(wide.info, units=132), wide._raw)
    sizes = launches(monkeypatch)
    images = [focused(many, task, plan, tiling) for _ in range(2)]
    # blocks of 128 rows: a part of the sums for each group of 16, in each of four tiles
    assert [size[1:] for size, _ in sizes] == 2 * [(4, 8), (4, 2)]
    assert np.array_equal(images[0][0].data, images[1][0].data) and images[0][1] == skipped
    assert image_error(images[0][0], raw, most=600) <= plan.predicted_error
    assert np.linalg.norm(images[0][0].data - alone.data) <= 1e-6 * np.linalg.norm(alone.data)


def launches(monkeypatch):
    """A list that gets the global size, and the size of groups, of each launch of the kernel by lines."""
    made, run = [], Device.run

    def kept(device, kernel, size, group, *args, **options):
        if kernel.function_name == "backproject_shared_lines":
            made.append((size, group))
        run(device, kernel, size, group, *args, **options)

    monkeypatch.setattr(Device, "run", kept)
    return made


FALLBACKS = {
    "curvature": {"limit_cycles": 0.0},
    "step": {"limit_step": 1e-9},
    "some": {"limit_cycles": 3e-7},
}


@pytest.mark.parametrize("name", ["some", *(pytest.param(n, marks=SLOW) for n in ("curvature", "step"))])
def test_pulses_that_no_line_holds_are_added_pixel_by_pixel_and_counted(wide, monkeypatch, name):
    raw = spaceborne(n_rows=30)
    counts = pixel_by_pixel(monkeypatch)
    task, plan, tiling = planned(raw, PLANE, 1e-3, **FALLBACKS[name])
    image, _ = focused(wide, task, plan, tiling)
    assert image_error(image, raw, most=600) <= plan.predicted_error
    by_lines, by_pixels = np.sum(counts, axis=0)
    assert by_lines + by_pixels == 30 * 4 and by_pixels > 0  # of four tiles
    assert (by_lines > 0) == (name == "some")


@SLOW
def test_pulses_from_everywhere_run_their_lines_along_rows_and_along_columns(wide, monkeypatch):
    # a whole circle: lines change their axis four times, and pulses where the axis changes are steep for their groups
    angle = np.linspace(0, 2 * np.pi, 512, endpoint=False)
    tx = 770e3 * np.stack([0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(512, 0.714)], axis=1)
    raw = noise_on(tx, bandwidth=600e6, n_samples=512)
    task, plan, tiling = planned(raw, PLANE, 1e-1)
    counts = pixel_by_pixel(monkeypatch)
    image, _ = focused(wide, task, plan, tiling)
    assert image_error(image, raw, most=300) <= plan.predicted_error
    assert np.sum(counts, axis=0)[0] > 0.5 * 512 * 4


@SLOW
def test_energy_at_the_bands_edge_and_wide_tiles_keep_90_db(wide):
    # positions in a tile of 64 pixels, rounded to float32, would have an error above this
    raw = spaceborne(n_rows=24, n_samples=512)
    samples = np.zeros_like(raw.samples)
    samples[:, [0, -1]] = 1
    grid = sarcl.ImageGrid.plane(shape=(64, 64), spacing=0.25)
    task, plan, tiling = planned(replace(raw, samples=samples), grid, 3e-5)
    assert plan.side == 64 and error_bounds.position_rounding(tiling.radius, 600e6, False) > 3e-5
    image, _ = focused(wide, task, plan, tiling)
    assert image_error(image, replace(raw, samples=samples)) <= plan.predicted_error <= 3e-5


def test_the_error_of_a_devices_own_sine_and_cosine_is_measured(wide):
    assert 0 < native_functions.sincos_error(wide) < 1e-5


@SLOW
def test_a_devices_own_sine_and_cosine_are_taken_where_their_error_is_small(wide):
    on = WIDE._replace(native_error=native_functions.sincos_error(wide))
    raw = spaceborne()
    task, plan, tiling = planned(raw, PLANE, 1e-3, on=on)
    assert plan.native and plan.predicted_error > planned(raw, PLANE, 1e-3)[1].predicted_error
    image, _ = focused(wide, task, plan, tiling)
    assert image_error(image, raw, most=600) <= plan.predicted_error
    pixels, tiles = direct.make_plan(task, 1e-3, on._replace(local_memory=0))
    assert pixels.native
    image, _ = focused(wide, task, pixels, tiles)
    assert image_error(image, raw, most=600) <= pixels.predicted_error
    assert not planned(raw, PLANE, 1e-3, on=WIDE._replace(native_error=1e-4))[1].native


def test_devices_with_one_lane_take_shared_lines_where_they_pay_and_their_memory_holds_them():
    raw = spaceborne(n_rows=64)
    grid = sarcl.ImageGrid.plane(shape=(600, 600), spacing=0.25)
    task = make_task(raw, grid, None, None, False, True)
    plan, tiling = direct.make_plan(task, 1e-3, WIDE)
    assert isinstance(plan, SharedLinePlan) and tiling.side == plan.side
    assert plan.local_bytes <= WIDE.local_memory
    small, _ = direct.make_plan(task, 1e-3, WIDE._replace(local_memory=plan.local_bytes - 1))
    assert small.cost > plan.cost
    assert not isinstance(direct.make_plan(task, 1e-3, WIDE._replace(local_memory=0))[0], SharedLinePlan)
    few = make_task(spaceborne(n_rows=8), PLANE, None, None, False, True)
    assert few.pairs < cost_model.SHARING_PAYS
    assert not isinstance(direct.make_plan(few, 1e-3, WIDE)[0], SharedLinePlan)


@pytest.mark.parametrize(
    "squint, bistatic, left",
    [(0.0, False, 0.001), (0.1, False, 0.8), (0.5, False, 0.6), (0.0, True, 0.5), (0.1, True, 1.0), (0.5, True, 0.6)],
)
def test_the_profile_of_a_line_holds_its_curvature(squint, left, bistatic):
    """Half paths in float64: along a line they grow by a step and by the bend; what is left is what is predicted."""
    raw = spaceborne(n_rows=9, squint=squint, bistatic=bistatic)
    antennas, side = make_task(raw, PLANE, None, None, False, True).antennas, 64
    steps = _line_curvature.steps(sarcl.ImageGrid.plane(shape=(64, 64), spacing=PLANE.spacing))
    directions = _line_curvature.SampledDirections.at(np.zeros((1, 3)), antennas.ends, steps)
    bend = directions.bend(PLANE.spacing)
    held, rest = directions.bent_part(side, PLANE.spacing, bend), directions.rest(side, PLANE.spacing)
    mean = directions.along.mean(axis=2)[0]
    turned = np.abs(mean[:, 1]) > np.abs(mean[:, 0])
    i, j = side / 2 * _line_curvature.EDGE

    def half_path(row, i, j):
        x, y = np.where(turned[row], i, j) * PLANE.spacing[1], np.where(turned[row], j, i) * PLANE.spacing[0]
        ends = np.stack([x, y, 0 * x], axis=-1)
        return sum(np.linalg.norm(a[row] - ends, axis=-1) for a in (antennas.tx, antennas.rx)) / 2

    for row in range(9):
        along, across = -mean[row][::-1] if turned[row] else -mean[row]
        place = i * across / along
        grown = along * j + bend[0, row] * ((place + j) ** 2 - place**2)
        exact = half_path(row, i, j) - half_path(row, i, 0 * j)
        assert np.abs(exact - grown - (rest - held)[0, row]).max() < 1e-8
    plain, bent = (_line_curvature.unmodelled_shift(r) for r in (rest, rest - held))
    assert bent < left * plain


def test_slopes_of_weights_are_their_derivatives():
    made = interpolation.line_interpolator(4, 4.0)
    z, h = np.linspace(-0.4, 0.4, 9), 1e-6
    wanted = (made.weights(z + h) - made.weights(z - h)) / (2 * h)
    assert np.abs(interpolation._slopes(made.table, z) - wanted).max() < 1e-8
    # the derivative of the highest frequency, from two neighbours: their difference, x/sin(x) times too small at best
    x = np.pi / 2 / 4.0
    assert interpolation.slope_error(interpolation.line_interpolator(2, 4.0)) > (1 - np.sin(x / 2) / (x / 2)) / 2
    assert interpolation.slope_error(interpolation.line_interpolator(6, 4.0)) < 1e-3
