"""Waiting until other programs leave the processors idle."""

from __future__ import annotations

import time
from pathlib import Path

LOOK = 0.2  # s over which the idle share is measured
ENOUGH = 0.93  # share of the processors' time that must be idle


def wait(patience: float) -> bool:
    """Wait up to `patience` s until the machine is idle; True when it is, or where the system does not say."""
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
    """Clock ticks of all processors since the system started: idle, total; None where the system does not say."""
    try:
        ticks = [int(v) for v in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    except (OSError, ValueError):
        return None
    return ticks[3] + ticks[4], sum(ticks[:8])
