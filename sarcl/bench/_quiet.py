"""Waiting for other programs to leave the processors alone."""

from __future__ import annotations

import time
from pathlib import Path

LOOK = 0.2  # s over which idleness is taken
ENOUGH = 0.93  # of the processors' time idle


def wait(patience: float) -> bool:
    """Wait up to `patience` s until the machine is idle; True when it was, or where there is no way to tell."""
    end = time.monotonic() + patience
    while patience > 0:
        before = _idle_and_all()
        if before is None:
            return True
        time.sleep(LOOK)
        after = _idle_and_all()
        if after is None or after[0] - before[0] >= ENOUGH * (after[1] - before[1]):
            return True
        if time.monotonic() > end:
            return False
    return True


def _idle_and_all() -> tuple[int, int] | None:
    """Ticks of all processors since the start: idle, and in all; None where the system does not say."""
    try:
        ticks = [int(v) for v in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    except (OSError, ValueError):
        return None
    return ticks[3] + ticks[4], sum(ticks[:8])
