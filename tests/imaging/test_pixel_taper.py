"""A window in cross-range with a beam: a taper over the rows that see a pixel, from the first to the last of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers import strip_map
from helpers.cases import noise_history, thinned

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.focusing_task import make_task
from sarcl.imaging.pixel_taper import PixelTaper
from sarcl.numerics.windows import weights
from sarcl.reference.backproject import PerPoint
from sarcl.reference.backproject import backproject as exact

TAYLOR = ("taylor", 35, 5)
GRID = sarcl.ImageGrid.plane(center=strip_map.POINTS[1], shape=(64, 64), spacing=(0.7, 2.0))
LISTED = sarcl.ImageGrid.points(
    GRID.positions[::2, ::2] + np.random.default_rng(0).uniform(-1, 1, (32, 32, 3)),
    valid=np.random.default_rng(1).uniform(size=(32, 32)) > 0.2,
)


def seen(points, raw):
    """Whether rows see points, in their beam and their range window: bool (n, n_rows)."""
    reach = np.linalg.norm(points[:, None] - raw.tx, axis=-1)
    inside = np.abs(reach - raw.reference_range) <= SPEED_OF_LIGHT / (4 * raw.frequency_step)
    return inside & strip_map.seen(points, raw.tx)


def shares(points, window, raw):
    """Weights (n, n_rows) by the formula: the window of as many cells as rows see the point."""
    made = np.zeros((len(points), raw.n_rows))
    for one, rows in zip(made, seen(points, raw), strict=True):
        one[rows] = weights(window, max(rows.sum(), 1))[: rows.sum()]
    return made


def compare(image, raw, window, most=60):
    """Error of an image against the exactly tapered sum, and of its gain, relative; at some pixels."""
    across, along = window if isinstance(window, tuple) and len(window) == 2 else (window, window)
    index, points = image.grid.sample(most, seed=3)
    share, sample_weight = shares(points, along, raw), weights(across, raw.n_samples)
    wanted, norm = exact(raw, points, sample_weight, None, False, strip_map.BEAM, 1e-6, PerPoint(share))
    clear = np.isfinite(wanted)
    gain = sample_weight.sum() * share.sum(axis=1)
    error = np.linalg.norm((np.asarray(image.data)[index] - wanted)[clear]) / max(np.linalg.norm(wanted[clear]), norm)
    return error, np.abs(image.gain[index] - gain)[clear].max() / gain.max()


@pytest.fixture(scope="module")
def raw():
    random = np.random.default_rng(7)
    made = strip_map.unit_points(n_samples=48)
    noise = random.standard_normal(made.samples.shape) + 1j * random.standard_normal(made.samples.shape)
    return replace(made, samples=noise.astype(np.complex64))


@pytest.mark.parametrize("tolerance, grid", thinned([1e-2, 1e-5, 1e-8], [LISTED, GRID]))
def test_the_image_is_the_exactly_tapered_sum(device, raw, grid, tolerance):
    if tolerance < 1e-6 and not device.info.fp64:
        pytest.skip("no float64")
    image = sarcl.backproject(raw, grid, beam=strip_map.BEAM, window="hamming", tolerance=tolerance, device=device)
    error, gain = compare(image, raw, "hamming")
    assert error <= image.report.predicted_error <= tolerance
    assert gain <= 1e-7 if tolerance > 1e-6 else gain <= 1e-12


def test_the_check_and_blocks_know_the_taper(raw):
    options = {"beam": strip_map.BEAM, "window": (None, TAYLOR), "tolerance": 1e-3}
    image = sarcl.backproject(raw, GRID, check=True, **options)
    assert 0 < image.report.measured_error <= 1e-3
    assert compare(image, raw, (None, TAYLOR))[0] <= 1e-3
    small = sarcl.backproject(raw, GRID, max_bytes=1e6, **options)
    assert np.linalg.norm(small.data - image.data) <= 1e-6 * np.linalg.norm(image.data)
    assert np.array_equal(small.gain, image.gain)


def test_rows_of_other_weights_times_and_channels(raw):
    # two channels that take turns, in no order of time, with weights of their own
    random = np.random.default_rng(5)
    order = random.permutation(raw.n_rows)
    mixed = replace(raw[order], tx_channel=np.arange(raw.n_rows) % 2)
    weight = random.uniform(0.5, 1.0, raw.n_rows)
    image = sarcl.backproject(mixed, GRID, beam=strip_map.BEAM, window=(None, "hann"), weights=weight, tolerance=1e-8)
    index, points = GRID.sample(30, seed=3)
    share = np.zeros((30, raw.n_rows))
    for i, rows in enumerate(seen(points, mixed)):
        place = np.zeros(raw.n_rows)
        for channel in (0, 1):
            members = np.flatnonzero(mixed.tx_channel == channel)
            place[members[np.argsort(mixed.time[members])]] = np.arange(len(members))
        if not rows.any():
            continue
        first, last = place[rows].min(), place[rows].max()
        share[i] = rows * np.cos(np.pi * ((place - first + 0.5) / (last - first + 1) - 0.5)) ** 2
    wanted, norm = exact(mixed, points, None, weight, False, strip_map.BEAM, 0.0, PerPoint(share))
    assert np.linalg.norm(image.data[index] - wanted) <= 1e-8 * max(norm, np.linalg.norm(wanted))
    assert image.gain[index] == pytest.approx(raw.n_samples * share @ weight, rel=1e-9)


def test_where_every_row_sees_every_pixel_the_window_is_that_of_the_track():
    history = noise_history(n_rows=60)
    grid = sarcl.ImageGrid.plane(shape=(40, 40), spacing=0.1)
    task = make_task(history, grid, TAYLOR, None, False, True, 0.5)
    assert task.taper is None and task.row_weight == pytest.approx(weights(TAYLOR, 60))
    plain = sarcl.backproject(history, grid, window=TAYLOR)
    assert np.array_equal(sarcl.backproject(history, grid, window=TAYLOR, beam=2 * np.pi).data, plain.data)
    # and a taper over apertures of all rows is that window
    tapered = replace(task, taper=np.ones(4), places=np.arange(60.0))
    start, inverse = PixelTaper(tapered).apertures(grid.positions[:2, None, 0])
    assert (start == -0.5).all() and inverse == pytest.approx(1 / 60)


@pytest.fixture(scope="module")
def scenes():
    echoes = strip_map.unit_points()
    options = {"beam": strip_map.BEAM, "tolerance": 1e-3}
    grid = strip_map.scene_grid(along=0.5, across=1.2)
    return echoes, grid, sarcl.backproject(echoes, grid, window=TAYLOR, **options)


def test_points_read_0_dbsm_and_have_the_side_lobes_of_the_window(scenes):
    echoes, grid, image = scenes
    for point, one in zip(strip_map.POINTS, sarcl.measure(image, near=strip_map.POINTS), strict=True):
        print(f"{10 * np.log10(one.rcs):+.4f} dBsm, PSLR {one.pslr}")
        assert abs(10 * np.log10(one.rcs)) <= 0.05
        # beside the point, pixels have apertures of their own, up to 1 % farther on than that of its echoes
        assert one.pslr == pytest.approx((-35.22, -35.22), abs=1.5)
        assert np.linalg.norm(one.position - point) <= 0.02
    # a taper over the track shades the scene instead: what the four points read then
    track = sarcl.backproject(
        echoes,
        grid,
        beam=strip_map.BEAM,
        tolerance=1e-2,
        window=(TAYLOR, None),
        weights=weights(TAYLOR, strip_map.N_ROWS),
    )
    peaks = [abs(seen.peak) for seen in sarcl.measure(track, near=strip_map.POINTS)]
    assert 20 * np.log10(max(peaks) / min(peaks)) > 3


def test_the_entropy_is_that_of_an_exactly_tapered_sum(scenes):
    echoes, _, _ = scenes
    grid = sarcl.ImageGrid.plane(center=strip_map.POINTS[2], shape=(22, 22), spacing=(0.6, 1.5))
    image = sarcl.backproject(echoes, grid, beam=strip_map.BEAM, window=TAYLOR, tolerance=1e-3)
    points = grid.positions.reshape(-1, 3)
    share = shares(points, TAYLOR, echoes)
    wanted, _ = exact(
        echoes, points, weights(TAYLOR, echoes.n_samples), None, False, strip_map.BEAM, 0.0, PerPoint(share)
    )  # fmt: skip

    def entropy(values):
        p = np.abs(values) ** 2 / (np.abs(values) ** 2).sum()
        return float(-(p * np.log(np.maximum(p, 1e-300))).sum())

    print(f"entropy {entropy(np.ravel(image.data)):.6f}, exactly tapered {entropy(wanted):.6f}")
    assert entropy(np.ravel(image.data)) == pytest.approx(entropy(wanted), rel=1e-3)


def test_what_cannot_be_tapered_is_refused(raw):
    with pytest.raises(ValueError, match=r"cannot taper the aperture of each pixel.*method='direct' or 'auto'"):
        sarcl.backproject(raw, GRID, beam=strip_map.BEAM, window="hamming", method="factorized")
    with pytest.raises(ValueError, match="depends on the number of rows"):
        sarcl.plan(raw, GRID, beam=strip_map.BEAM, window=(None, ("gaussian", 40.0)))
    array = np.linspace(1, 2, 7)  # stretched over the aperture of each pixel
    task = make_task(raw, GRID, (None, array), None, False, True, strip_map.BEAM)
    assert task.taper[[0, -1]] == pytest.approx([1, 2]) and (task.row_weight == 1).all()
    assert sarcl.plan(raw, GRID, beam=strip_map.BEAM, window="hamming").method == "direct"
