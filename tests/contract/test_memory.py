"""Large images need little memory: they are computed in blocks, with raw data and image in files."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[2] / "bench" / "memory.py"


def run(*arguments):
    done = subprocess.run([sys.executable, BENCH, *arguments], capture_output=True, text=True, timeout=1500)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_small_limit_is_kept_and_changes_nothing():
    # 2048 x 2048 pixels are 64 MiB of accumulators; 20 MB allow a third of them at once
    result = run("--pulses", "64", "--samples", "256", "--size", "2048", "--max-bytes", "20e6", "--compare")
    assert result["relative_difference"] <= 1e-6
    # besides the blocks: kernels, their compiler and Python's own copies of one block
    assert result["peak_above_idle_gib"] <= 0.35


@pytest.mark.slow
def test_4096_pixels_squared_and_2048_pulses_take_less_than_2_gib():
    result = run("--compare")
    assert result["peak_above_idle_gib"] <= 2.0
    assert result["relative_difference"] <= 1e-6
