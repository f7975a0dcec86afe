"""`measure` where pixels are seen by rows of their own, on listed grids, and for many points in a call."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers import strip_map

import sarcl
from sarcl.analysis.point_response import Cut
from sarcl.base.constants import SPEED_OF_LIGHT


@pytest.fixture(scope="module")
def scene():
    return sarcl.backproject(strip_map.unit_points(), strip_map.scene_grid(), beam=strip_map.BEAM, tolerance=1e-3)


def test_unit_points_of_a_strip_map_read_0_dbsm_wherever_all_of_their_rows_are(scene):
    measured = sarcl.measure(scene, near=strip_map.POINTS)
    assert isinstance(measured, tuple) and len(measured) == 4
    for point, seen in zip(strip_map.POINTS, measured, strict=True):
        print(f"{10 * np.log10(seen.rcs):+.4f} dBsm, PSLR {seen.pslr}")
        assert abs(10 * np.log10(seen.rcs)) <= 0.05
        assert seen.pslr == pytest.approx((-13.26, -13.26), abs=0.1)
        assert np.linalg.norm(seen.position - point) <= 0.02
        rows = strip_map.seen(point[None])[0].sum()
        across = 0.886 * SPEED_OF_LIGHT / strip_map.CARRIER / 2 / (2 * np.sin(strip_map.ANGLE / 2))
        # rows are the middles of their steps: the aperture is one step longer than from the first row to the last
        assert seen.irw[1] == pytest.approx(across * (rows - 1) / rows, rel=0.01)
    # what was seen at -12.99 dBsm: divided by the weights of all rows instead of those that saw the point
    whole = scene.report.plan and strip_map.N_ROWS * 256
    assert 20 * np.log10(abs(measured[1].peak) / whole) < -9


def test_raw_records_of_a_down_chirp_read_0_dbsm_too():
    raw, near = strip_map.history(strip_map.POINTS[3:]), strip_map.POINTS[3]
    grid = sarcl.ImageGrid.plane(center=near, shape=(96, 80), spacing=(0.35, 1.0))
    seen = sarcl.measure(sarcl.backproject(raw, grid, beam=strip_map.BEAM), near=near)
    assert abs(10 * np.log10(seen.rcs)) <= 0.02


def test_the_carrier_is_that_of_the_rows_that_saw_the_point(scene):
    # from the antennas in the middle of the whole track the response lies at the edge of the band, or beyond it
    near = strip_map.POINTS[0]
    seen, other = sarcl.measure(scene, near=near), sarcl.measure(replace(scene, aperture=None), near=near)
    assert other.irw == pytest.approx(seen.irw, rel=5e-3) and abs(other.peak) == pytest.approx(abs(seen.peak), rel=1e-3)
    assert abs(np.angle(seen.peak)) < 0.05  # the phase is that of the point itself


def test_a_scene_in_a_file_is_measured_as_in_memory(scene, tmp_path):
    scene.save(tmp_path / "a.h5")
    again = sarcl.read(tmp_path / "a.h5")
    assert np.array_equal(again.aperture, scene.aperture) and scene.aperture.shape == (256, 13)
    assert str(sarcl.measure(again, near=strip_map.POINTS[3])) == str(sarcl.measure(scene, near=strip_map.POINTS[3]))


def spotlight(grid, point):
    track = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.03, n_pulses=96)
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=2e-6)
    raw = sarcl.echo(sarcl.Scene.points([point]), chirp, track, range_window=(-40, 40), tolerance=1e-4)
    return sarcl.backproject(raw, grid, tolerance=1e-4)


PLANE = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(96, 96), spacing=(0.25, 0.25), normal=(0.1, 0.2, 1))


def test_listed_points_of_a_plane_are_measured_as_the_plane():
    point = PLANE.at(50, 45)
    one, two = (spotlight(grid, point) for grid in (PLANE, sarcl.ImageGrid.points(PLANE.positions)))
    for near in (None, point, point + PLANE.normal):
        a, b = sarcl.measure(one, near=near), sarcl.measure(two, near=near)
        assert b.position == pytest.approx(a.position, abs=1e-4)
        assert b.irw == pytest.approx(a.irw, rel=1e-3) and b.pslr == pytest.approx(a.pslr, abs=0.01)
        assert b.peak == pytest.approx(a.peak, rel=1e-3)


def test_points_on_a_curved_surface_are_measured_on_the_plane_that_touches_it():
    x, y = np.meshgrid(np.arange(-64, 64) * 0.2, np.arange(-64, 64) * 0.2)
    bowl = sarcl.ImageGrid.points(np.stack([x, y, (x**2 + y**2) / 400], axis=-1))
    point = bowl.positions[70, 52]
    image = spotlight(bowl, point)
    seen = sarcl.measure(image, near=point)
    flat = sarcl.measure(spotlight(sarcl.ImageGrid.plane(center=point, shape=(128, 128), spacing=0.2), point))
    assert np.linalg.norm(seen.position - point) < 0.02
    assert 10 * np.log10(seen.rcs) == pytest.approx(0, abs=0.05)
    assert seen.irw == pytest.approx(flat.irw, rel=0.02)


@pytest.mark.parametrize("at", [(0.1, 0.5), (2.5, 0.43)])
def test_a_point_between_the_pixels_of_a_curved_surface_is_found_on_the_surface(at):
    x, y = np.meshgrid(np.arange(-64, 64) * 0.2, np.arange(-64, 64) * 0.2)
    waves = sarcl.ImageGrid.points(np.stack([x, y, 0.3 * np.sin(x)], axis=-1))
    point = np.array([*at, 0.3 * np.sin(at[0])])
    seen = sarcl.measure(spotlight(waves, point))
    assert np.linalg.norm(seen.position - point) < 2e-4  # interpolation error, 3e-4 of a cell
    assert abs(np.angle(seen.peak)) < 0.05  # 2 k times that; the tangent at the nearest pixel is 14 mm off, 2.8 rad
    slope = np.array([-0.3 * np.cos(at[0]), 0, 1])
    plane = sarcl.ImageGrid.plane(center=point, shape=(128, 128), spacing=0.2, normal=slope)
    assert seen.irw == pytest.approx(sarcl.measure(spotlight(plane, point)).irw, rel=0.01)


@pytest.mark.parametrize("center", [(0, 0, 0), (0.1, 0.05, 0), (0.003, 0.002, 0)])
@pytest.mark.parametrize("shape, spacing", [(64, 0.01), (128, 0.01), (256, 0.0025)])
def test_an_image_within_the_main_lobe_is_said_to_be_too_small(shape, spacing, center):
    image = spotlight(sarcl.ImageGrid.plane(center=center, shape=shape, spacing=spacing), (0, 0, 0))
    with pytest.raises(ValueError, match="in range the image holds less than 3 IRW on each side of the peak; focus a"):
        sarcl.measure(image)


def test_a_point_is_found_where_a_pixel_is_a_fiftieth_of_its_width():
    grid = sarcl.ImageGrid.plane(center=(0.1, 0.05, 0), shape=512, spacing=0.01)
    seen = sarcl.measure(spotlight(grid, (0, 0, 0)))
    coarse = sarcl.measure(spotlight(replace(grid, spacing=(0.1, 0.1)), (0, 0, 0)))
    assert np.linalg.norm(seen.position) < 2e-3 and seen.irw == pytest.approx(coarse.irw, rel=2e-3)


def test_of_a_side_lobe_the_main_lobe_is_named_however_many_lobes_lie_between():
    image = spotlight(sarcl.ImageGrid.plane(shape=256, spacing=0.15), (0, 0, 0))
    named = 0
    for a, b in np.mgrid[-12:13:4, -12:13:4].reshape(2, -1).T:
        near = np.array([np.sign(a) * (abs(a) + 0.45) * 0.624, np.sign(b) * (abs(b) + 0.45) * 0.644, 0])  # of cells
        if a and b:
            try:
                sarcl.measure(image, near=near)
            except ValueError as exc:
                if "near=" in str(exc):
                    there = np.fromstring(str(exc).partition("near=(")[2].rstrip(")"), sep=",")
                    assert np.linalg.norm(there) < 0.01, f"{near}: {exc}"
                    named += 1
    assert named > 20


def test_cuts_are_returned_and_drawn():
    image = spotlight(PLANE, PLANE.at(48, 48))
    seen = sarcl.measure(image)
    for cut, irw, pslr, reach in zip(seen.cuts, seen.irw, seen.pslr, seen.reach, strict=True):
        assert isinstance(cut, Cut) and cut.distance[-1] == pytest.approx(reach * irw)
        db = cut.decibels()
        assert db[len(db) // 2] == 0 and np.abs(db[np.abs(np.abs(cut.distance) - irw / 2).argmin()] + 3.01) < 0.3
        far = np.abs(cut.distance) > 1.3 * irw
        assert db[far].max() == pytest.approx(pslr, abs=0.1)
    assert [cut.name for cut in seen.cuts] == ["range", "cross-range"]
    picture = seen.show(title="a point")
    assert "PSLR" in picture.info["caption"] and picture.info["title"] == "a point"
    with pytest.raises(ValueError, match="floor_db is 3"):
        seen.show(3)
    with pytest.raises(ValueError, match="has no cuts"):
        replace(seen, cuts=None).show()


def bad_grids():
    line = sarcl.ImageGrid.points(PLANE.positions[40])
    holed = sarcl.ImageGrid.points(PLANE.positions, valid=np.arange(96)[:, None] + 0 * np.arange(96) != 60)
    folded = sarcl.ImageGrid.points(PLANE.positions[:, :1] + np.zeros((96, 96, 1)))
    return {
        "line": (line, r"lists points of shape \(96,\); cuts need rows and columns"),
        "holed": (holed, "are empty; a point is measured where all pixels about it have data"),
        "folded": (folded, "span no plane"),
    }


@pytest.mark.parametrize("name", ["line", "holed", "folded"])
def test_lists_that_are_no_surface_say_so(name):
    grid, message = bad_grids()[name]
    data = np.zeros(grid.shape, np.complex64)
    data[(48,) * len(grid.shape)] = 1
    image = sarcl.Image(data, grid, frequency=9.6e9, tx=(8e3, 0, 6e3))
    with pytest.raises(ValueError, match=message):
        sarcl.measure(image)


def test_every_point_of_a_list_is_checked(scene):
    with pytest.raises(ValueError, match="outside the image"):
        sarcl.measure(scene, near=[strip_map.POINTS[0], (0, 0, 0)])
    with pytest.raises(ValueError, match=r"near has shape \(2, 2\), wanted \(n, 3\)|near has shape \(2, 2\)"):
        sarcl.measure(scene, near=np.zeros((2, 2)))
