"""Large echoes keep to the memory that they are given."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest


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
