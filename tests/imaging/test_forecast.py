"""`plan`: cost, memory and error of an image, before the computation."""

from __future__ import annotations

import re

import numpy as np
import pytest
from helpers.cases import noise_history

import sarcl
from sarcl.cli.parser import main
from sarcl.imaging.backproject_options import BackprojectOptions
from sarcl.opencl.choose_device import open_device

GRID = sarcl.ImageGrid.plane(shape=(200, 200), spacing=0.2)


def work(forecast):
    """Seconds without those of planning, which vary from call to call."""
    return forecast.seconds - forecast.planning


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5, 1e-8])
def test_the_plan_is_the_one_that_is_carried_out(tolerance):
    raw = noise_history(n_rows=120)
    forecast = sarcl.plan(raw, GRID, tolerance=tolerance)
    image = sarcl.backproject(raw, GRID, tolerance=tolerance, check=False)
    assert forecast.method == image.report.plan["method"]
    assert forecast.plan == dict(image.report.plan)
    assert forecast.predicted_error == image.report.predicted_error <= tolerance
    assert forecast.bytes >= image.data.nbytes
    assert 0 < forecast.seconds < 60


def test_the_next_cheaper_plan_errs_more_and_takes_less():
    forecast = sarcl.plan(noise_history(n_rows=120), GRID, tolerance=1e-5)
    error, seconds = forecast.cheaper
    assert error > forecast.predicted_error and seconds < forecast.seconds
    assert "next cheaper plan" in str(forecast) and f"{forecast.predicted_error:.1e}" in str(forecast)


def test_time_grows_with_the_work_and_memory_with_what_is_allowed():
    raw = noise_history(n_rows=120)
    small, large = (sarcl.plan(raw, sarcl.ImageGrid.plane(shape=(n, n), spacing=0.2), wrap=True) for n in (100, 2000))
    assert work(large) > 50 * work(small) and large.bytes > 50 * small.bytes
    tight = sarcl.plan(raw, sarcl.ImageGrid.plane(shape=(2000, 2000), spacing=0.2), wrap=True, max_bytes=2e7)
    assert tight.bytes < large.bytes and work(tight) > work(large)


@pytest.mark.parametrize("method", ["direct", "factorized"])
@pytest.mark.parametrize("max_bytes", [1e9, 2e7, 6e6])
def test_what_blocks_make_again_is_forecast(method, max_bytes, monkeypatch):
    from helpers.cases import noise_on, straight

    from sarcl.imaging.engine import RowProfiles

    raw, grid = noise_on(straight(512), n_samples=512), sarcl.ImageGrid.plane(shape=(512, 512), spacing=0.2)
    options = BackprojectOptions(tolerance=1e-2, method=method, max_bytes=max_bytes)
    device = open_device(None)
    _, task = options.task(raw, grid)
    engine = options.choose(task, [device]).on(device, task)
    rows, upload = [], RowProfiles.upload
    monkeypatch.setattr(RowProfiles, "upload", lambda self, a, b: (rows.append(b - a), upload(self, a, b))[1])
    sarcl.backproject(raw, grid, tolerance=1e-2, method=method, max_bytes=max_bytes, check=False)
    again = engine.repeated(options.budget(device)) / engine.profiles.cost
    passes = sum(rows) / raw.n_rows
    assert passes - 1 <= again <= 2 * (passes - 1) + 1
    assert (passes > 2) == (max_bytes == 6e6 and method == "factorized")


def test_auto_takes_the_direct_method_where_sub_apertures_lack_memory():
    from helpers.cases import noise_on, straight

    raw, grid = noise_on(straight(512), n_samples=512), sarcl.ImageGrid.plane(shape=(1024, 1024), spacing=0.1)
    with pytest.raises(MemoryError, match="method='direct'"):
        sarcl.plan(raw, grid, tolerance=1e-2, method="factorized", max_bytes=1.2e6)
    assert sarcl.plan(raw, grid, tolerance=1e-2, max_bytes=1e9).method == "factorized"
    forecast = sarcl.plan(raw, grid, tolerance=1e-2, max_bytes=1.2e6)
    image = sarcl.backproject(raw, grid, tolerance=1e-2, max_bytes=1.2e6, check=False)
    assert forecast.method == image.report.plan["method"] == "direct"


def test_what_a_beam_leaves_out_takes_no_time():
    raw, grid = noise_history(n_rows=120), sarcl.ImageGrid.plane(shape=(400, 400), spacing=0.2)
    beam = 20 / np.linalg.norm(raw.tx[0])  # a cone of 20 m, the grid has 80
    whole, lit = (sarcl.plan(raw, grid, method="direct", wrap=True, beam=b) for b in (None, beam))
    image = sarcl.backproject(raw, grid, method="direct", wrap=True, beam=beam, check=False)
    assert image.report.contributions_skipped["beam"] > 0.5 * raw.n_rows * grid.size
    assert work(lit) < 0.5 * work(whole)


def test_tiles_that_reach_beyond_a_narrow_grid_take_their_time():
    """Tiles of 16 x 16 pixels and more: of eight rows, half and more of each tile is thrown away."""
    from helpers.cases import noise_on, straight

    raw = noise_on(straight(400), n_samples=256)
    narrow, square = (sarcl.ImageGrid.plane(shape=shape, spacing=0.1) for shape in ((8, 8192), (256, 256)))
    for method in ("direct", "factorized"):
        options = {"method": method, "tolerance": 1e-2, "wrap": True}
        long, compact = (sarcl.plan(raw, grid, **options) for grid in (narrow, square))
        assert work(long) > 1.7 * work(compact)


def test_the_error_told_is_that_of_rows_added_directly_too():
    from helpers.cases import noise_on, straight

    from sarcl.imaging.factorized import plan as factorized_plan
    from sarcl.imaging.focusing_task import make_task

    for tolerance in (1e-1, 1e-2, 1e-3):
        task = make_task(noise_on(straight(400)), GRID, None, None, False, True)
        made, _ = factorized_plan.make_plan(task, tolerance)
        assert made.edge.predicted_error <= made.predicted_error <= tolerance


@pytest.mark.parametrize("tolerance", [1, 2.5, 1e9])
def test_an_error_as_large_as_the_image_is_refused(tolerance):
    with pytest.raises(ValueError, match=r"tolerance is .*; an error above 0.3 of the norm leaves no image"):
        sarcl.plan(noise_history(n_rows=4), GRID, tolerance=tolerance)


@pytest.mark.parametrize("tolerance", [0, -1e-3, float("nan"), 1e-30])
def test_what_backproject_refuses_is_refused(tolerance):
    raw = noise_history(n_rows=4)
    for verb in (sarcl.plan, sarcl.backproject):
        with pytest.raises(ValueError, match="tolerance"):
            verb(raw, GRID, tolerance=tolerance)


def test_dry_run_says_it_and_writes_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    raw = noise_history(n_rows=60)
    raw.save("raw.h5")
    before = sorted(p.name for p in tmp_path.iterdir())
    args = ["focus", "raw.h5", "--center", "0", "0", "0", "--shape", "64", "64", "--spacing", "0.2", "0.2", "--dry-run"]
    assert main(args) == 0
    out = capsys.readouterr().out
    assert "error below" in out and ("direct" in out or "factorized" in out)
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_a_mapped_image_is_planned_as_it_is_made(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tone = sarcl.Waveform.tone(center=10e9, duration=5e-8)
    track = sarcl.Trajectory.line(start=(-5000, -100, 0), velocity=(0, 100, 0), prf=10.0, n_pulses=20)
    array = sarcl.AntennaArray.linear(9, spacing=0.015, frequency_step=20e6, axis=(0, -1, 0))
    raw = sarcl.echo(
        sarcl.Scene.points([[0.0, 0, 0], [1, 0.5, 0]]), tone, track, array=array, reference=(0, 0, 0),
        range_window=(-3.5, 3.5), receive="reference",
    )  # fmt: skip
    raw.save("raw.h5")
    grid = sarcl.ImageGrid.plane(shape=(16, 16), spacing=0.2)
    where = ["--center", "0", "0", "0", "--shape", "16", "16", "--spacing", "0.2", "0.2"]
    for mapping in ("channels", "corrected"):
        forecast = sarcl.plan(raw, grid, mapping=mapping)
        image = sarcl.backproject(raw, grid, mapping=mapping)
        assert forecast.plan == dict(image.report.plan)
        assert forecast.predicted_error == image.report.predicted_error
        assert main(["focus", "raw.h5", *where, "--mapping", mapping, "--dry-run"]) == 0
        said, wanted = (
            re.sub(r"[\d.e+-]+ m?s\b", "... s", text) for text in (capsys.readouterr().out, f"{forecast}\n")
        )
        assert said.endswith(wanted)  # but for the time that planning took
        assert main(["focus", "raw.h5", *where, "--mapping", mapping, "-o", "image.h5"]) == 0
        assert (np.asarray(sarcl.read("image.h5").data) == image.data).all()
        capsys.readouterr()
    for verb in (sarcl.plan, sarcl.backproject):
        with pytest.raises(ValueError, match="array"):
            verb(noise_history(n_rows=4), grid, mapping="channels")


def test_method_is_checked():
    with pytest.raises(ValueError, match="method is 'fast'"):
        sarcl.plan(noise_history(n_rows=4), GRID, method="fast")
    forecast = sarcl.plan(noise_history(n_rows=64), GRID, tolerance=1e-1, method="direct")
    assert forecast.method == "direct" and np.isfinite(forecast.seconds)


def test_a_beam_is_given_in_degrees(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    raw = noise_history(n_rows=60)
    raw.save("raw.h5")
    where = ["--center", "0", "0", "0", "--shape", "96", "96", "--spacing", "0.4", "0.4"]
    assert main(["focus", "raw.h5", "-o", "image.h5", *where, "--beam", "0.02"]) == 0
    image = sarcl.read("image.h5")
    grid = sarcl.ImageGrid.plane(shape=(96, 96), spacing=0.4)
    wanted = sarcl.backproject(raw, grid, beam=np.radians(0.02))
    assert image.report.contributions_skipped["beam"] == wanted.report.contributions_skipped["beam"] > 0
    assert (np.asarray(image.data) == wanted.data).all()
    for bad in ("0", "-1", "nan", "400"):
        assert main(["focus", "raw.h5", "-o", "bad.h5", *where, "--beam", bad]) == 2
        assert "beam" in capsys.readouterr().err
