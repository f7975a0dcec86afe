"""Memory limits: kept, and without effect on the image; repeated calls give the same bits."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from helpers.cases import image_error, noise_history, noise_on, straight, thinned

import sarcl
from sarcl.imaging import choose_method
from sarcl.imaging.factorized import factorized
from sarcl.imaging.focusing_task import make_task
from sarcl.imaging.tiling.tiling import Part
from sarcl.opencl.choose_device import open_device

WIDE = sarcl.ImageGrid.plane(shape=(150, 1700), spacing=0.25)
TALL = sarcl.ImageGrid.plane(shape=(900, 300), spacing=0.25)
LISTED = sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-20, 20, (30_000, 3)) * [1, 1, 0])
GRIDS = {"wide": WIDE, "tall": TALL, "listed": LISTED}


@pytest.fixture(scope="module")
def raw():
    return noise_on(straight(400), n_samples=256)


def engine_of(raw, grid, tolerance=1e-2):
    """The engine that focuses by sub-apertures, and its tiling."""
    task = make_task(raw, grid, None, None, False, True)
    chosen = choose_method.choose(task, "factorized", tolerance)
    return chosen.on(open_device(), task), chosen.tiling


def least_of(raw, grid):
    """The least max_bytes that sub-apertures take, as the message says."""
    with pytest.raises(
        MemoryError, match=r"max_bytes is 1 kB but .* need .*; give max_bytes=.* or method='direct'"
    ) as e:
        engine_of(raw, grid)[0].blocks(1e3)
    return float(str(e.value).rpartition("max_bytes=")[2].split()[0])


def focused(raw, grid, **options):
    return sarcl.backproject(raw, grid, tolerance=1e-2, check=False, **options)


@pytest.mark.parametrize("name, method", thinned(GRIDS, ["direct", "factorized"]))
def test_images_do_not_depend_on_memory_and_repeat_to_the_bit(raw, name, method):
    grid = GRIDS[name]
    few = raw[:130] if method == "direct" else raw
    whole = focused(few, grid, method=method)
    least = max(1e6, least_of(raw, grid)) if method == "factorized" else 1e6
    for max_bytes in (least, 3 * least):
        calls = []
        tight = focused(few, grid, method=method, max_bytes=max_bytes, progress=lambda *a, c=calls: c.append(a[1:]))
        assert np.linalg.norm(tight.data - whole.data) <= 1e-6 * np.linalg.norm(whole.data)
        assert tight.report.contributions_skipped == whole.report.contributions_skipped
        done = [n for n, _ in calls]
        assert done == sorted(set(done)) and calls[-1] == (few.n_rows * grid.size,) * 2
        assert np.array_equal(focused(few, grid, method=method, max_bytes=max_bytes).data, tight.data)
    assert np.array_equal(focused(few, grid, method=method).data, whole.data)
    assert image_error(whole, few, most=100) <= 1e-2


def test_parts_are_all_leaves_once_and_fit(raw):
    for grid in (WIDE, TALL):
        engine, tiling = engine_of(raw, grid)
        least = least_of(raw, grid)
        for nbytes in (least, 1.5 * least, 4 * least, 20 * least, 1e9):
            seen = np.zeros((tiling.n_bands, tiling.across), int)
            for first, last in engine.blocks(nbytes):
                for a, b, left, right in engine.memory.parts(first, last, nbytes):
                    seen[a:b, left:right] += 1
                    assert left % engine.plan.factors[0] == 0
                    size = tiling.part_size(Part(a, b, left, right), engine.plan.factors[0])
                    assert size[1] == (b - a) * (right - left) * tiling.per_tile
                    assert engine.memory.n_bytes(*size) <= nbytes / 2
            assert (seen == 1).all()
        assert len(list(engine.memory.parts(0, tiling.n_bands, least))) > 4
        assert list(engine.memory.parts(0, tiling.n_bands, 1e9)) == [(0, tiling.n_bands, 0, tiling.across)]


@pytest.mark.parametrize("grid", [WIDE, LISTED], ids=["wide", "listed"])
def test_levels_below_are_made_in_runs_where_one_tile_is_too_large(raw, grid, monkeypatch):
    whole = focused(raw, grid, method="factorized")
    monkeypatch.setattr(factorized.MemoryPlan, "at_once", lambda self, tree, budget: (1, 2e5, 1e5))
    assert np.array_equal(focused(raw, grid, method="factorized").data, whole.data)


def test_columns_of_a_plane_are_where_they_were():
    grid = sarcl.ImageGrid.plane(center=(1e6, 3, 7), shape=(5, 101), spacing=(0.3, 0.7), normal=(1, 2, 3))
    part = grid.columns(37, 80)
    assert part.shape == (5, 43) and np.array_equal(part.positions, grid.positions[:, 37:80])
    assert np.allclose(part.index(part.positions[2, 9]), (2, 9), atol=1e-6)


LIMITED = """
import json, sys
from pathlib import Path
import numpy as np
import sarcl
from helpers.cases import noise_on, straight

def peak():
    line = next(t for t in Path("/proc/self/status").read_text().splitlines() if t.startswith("VmHWM"))
    return int(line.split()[1]) * 1024

raw = noise_on(straight(64, aperture=20.0), n_samples=128)
options = {"tolerance": 1e-2, "method": sys.argv[1], "check": False, "resume": False}
warm, wide = (sarcl.ImageGrid.plane(shape=shape, spacing=5e-4) for shape in ((256, 2000), (256, 80_000)))
sarcl.backproject(raw, warm, out="warm.h5", max_bytes=8e6, **options)
before = peak()
image = sarcl.backproject(raw, wide, out="image.h5", max_bytes=2e7, **options)
rows = np.array([0, 100, 255])
print(json.dumps({"bytes": peak() - before, "forecast": sarcl.plan(raw, wide, max_bytes=2e7, tolerance=1e-2,
      method=sys.argv[1]).bytes, "filled": bool((image.data[rows] != 0).all())}))
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("method", ["direct", pytest.param("factorized", marks=pytest.mark.slow)])
def test_a_wide_grid_takes_no_more_memory_than_it_was_given(method, tmp_path, pytestconfig):
    """20 million pixels: sums of all would take 330 MB, and fetching them as much again."""
    for _ in range(2):  # a first process may have to compile kernels: the compiler's memory is not the grid's
        done = subprocess.run(
            [sys.executable, "-c", LIMITED, method], cwd=tmp_path, capture_output=True, text=True, timeout=120,
            env={**os.environ, "PYTHONPATH": str(pytestconfig.rootpath / "tests")},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout.splitlines()[-1])
        if found["bytes"] < 2e7 + 8e7:
            break
    # besides the blocks: kernels of this plan, HDF5's and the driver's own
    assert found["bytes"] < 2e7 + 8e7
    assert found["filled"] and 8 * 256 * 80_000 < found["forecast"] <= 8 * 256 * 80_000 + 2e7


def test_less_than_a_largest_tile_is_refused_before_the_work(raw):
    big = sarcl.ImageGrid.plane(shape=(2000, 2000), spacing=0.02)
    for verb in (sarcl.plan, sarcl.backproject):
        with pytest.raises(MemoryError, match=r"max_bytes is 1 MB but .*a tile of \d+ pixels.* give max_bytes="):
            verb(raw, big, tolerance=1e-2, method="factorized", max_bytes=1e6)


@pytest.mark.parametrize("side", [10**9, 10**10])
def test_forecasts_of_endless_grids_cost_nothing_and_images_are_refused(side, tmp_path):
    raw, grid = noise_history(n_rows=40), sarcl.ImageGrid.plane(shape=(side, side), spacing=1 / side)
    tracemalloc.start()
    forecast = sarcl.plan(raw, grid, method="direct", tolerance=0.1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert forecast.bytes >= 8 * side**2 and forecast.seconds > 1e6
    # as much as the tiles of a few bands; listing all bands would take gigabytes
    assert peak < 1e8
    with pytest.raises(MemoryError, match=f"{side} x {side} needs .* of memory"):
        sarcl.backproject(raw, grid, method="direct", tolerance=0.1)
    with pytest.raises(OSError, match="GB free"):
        sarcl.backproject(raw, grid, method="direct", tolerance=0.1, out=tmp_path / "a.h5")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "bad", [{"spacing": 1e300}, {"spacing": 1.0, "center": (0, -1e200, 0)}], ids=["spacing", "center"]
)
def test_planes_beyond_all_numbers_are_refused(bad):
    with pytest.raises(ValueError, match=r"reach beyond 1e\+150 m"):
        sarcl.ImageGrid.plane(**{"shape": 5, **bad})
    with pytest.raises(ValueError, match=r"positions\[1, 1\] is .* m, where distances overflow"):
        sarcl.ImageGrid.points([[0, 0, 0], [0, 1e200, 0]])
