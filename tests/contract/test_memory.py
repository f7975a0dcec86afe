"""Large images need little memory: they are computed in blocks, with raw data and image in files. No call keeps any."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

CALLS = 60
PER_CALL = 4096  # bytes: an array, a buffer or a file that stays would be more
NOISE = 2**20  # bytes by which allocators and caches change without any leak
OF_FILES = 8 * 2**20 / 2**30  # GiB: rows on their way to and from files, of any image

BENCH = Path(__file__).parents[2] / "bench" / "memory.py"


def run(*arguments):
    done = subprocess.run([sys.executable, BENCH, *arguments], capture_output=True, text=True, timeout=1500)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_small_limit_is_kept_and_changes_nothing():
    # 2048 x 2048 pixels are 64 MiB of accumulators; 20 MB allow a third of them at once
    image = "--pulses", "64", "--samples", "256", "--size", "2048", "--max-bytes", "20e6"
    assert run(*image, "--compare")["relative_difference"] <= 1e-6  # it leaves its kernels in the driver's cache, too
    assert run(*image)["peak_gib"] <= 20e6 / 2**30 + OF_FILES


@pytest.mark.slow
def test_the_peak_stays_below_the_limit_as_images_grow():
    same = "--pulses", "512", "--samples", "1024", "--tolerance", "0.1", "--max-bytes", "1e8"
    for where in ((), ("--in-memory",)):
        peaks = [run("--size", size, *same, *where)["peak_gib"] for size in ("2048", "4096", "8192")]
        assert max(peaks) <= 1e8 / 2**30, peaks


@pytest.mark.slow
def test_4096_pixels_squared_and_2048_pulses_take_less_than_2_gib():
    result = run("--compare")
    assert result["peak_gib"] <= 1.05
    assert result["relative_difference"] <= 1e-6


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="Linux alone")
def test_memory_is_flat_over_many_calls_of_every_verb():
    command = [sys.executable, "-m", "helpers.memory_calls", str(CALLS)]
    done = subprocess.run(command, cwd=BENCH.parents[1] / "tests", capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    print("\n".join(f"{x['verb']:24} {x['growth'] / 1024:8.0f} KiB over {CALLS // 2} calls" for x in found))
    assert len(found) > 25
    leaks = {x["verb"]: x["growth"] for x in found if x["growth"] > NOISE + PER_CALL * CALLS / 2}
    assert not leaks, leaks
