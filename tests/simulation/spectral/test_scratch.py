"""Arrays in temporary files hold what is written to them; large echoes keep to the memory that they are given."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sarcl.simulation.spectral._scratch import Scratch


@pytest.mark.parametrize("room", [0, 1e9])
def test_a_scratch_holds_what_is_written(room, tmp_path):
    random = np.random.default_rng(0)
    wanted = random.normal(size=(37, 11)) + 1j * random.normal(size=(37, 11))
    held = Scratch((37, 11), room, tmp_path)
    assert (held.whole is None) == (room == 0)
    assert not held.rows(0, 37).any()
    held.put(20, wanted[20:].astype(np.complex64))
    held.put(0, wanted[:20])
    rows = held.rows(5, 30)
    assert np.array_equal(rows, wanted[5:30].astype(np.complex64))
    rows *= 2
    held.put(5, rows)
    assert np.allclose(held.columns(3, 7, 200)[5:30], 2 * wanted[5:30, 3:7], rtol=1e-6)
    assert np.allclose(held.columns(0, 11, 1e9)[30:], wanted[30:], rtol=1e-6)
    assert not list(tmp_path.iterdir())  # the file has no name


@pytest.mark.slow
def test_large_echoes_keep_to_their_memory(tmp_path):
    if not Path("/proc/self/status").exists():
        pytest.skip("no /proc")
    script = Path(__file__).parents[3] / "bench" / "spectral_echo.py"
    found = {}
    for limit in (0.0, 4e7):
        command = [sys.executable, str(script), "--one", str(tmp_path), "--memory", "2048", "--max-bytes", str(limit)]
        row = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
        found[limit] = row["bytes"]
        assert row["shape"][0] == 2048
    # planning comes on top, with about 50 MB, and 65 536 points
    assert found[4e7] <= 4e7 + 6e7 < 0.5 * found[0.0]
    whole, limited = (np.load(tmp_path / name) for name in ("whole.npy", "limited.npy"))
    assert np.linalg.norm(limited - whole) <= 1e-6 * np.linalg.norm(whole)
