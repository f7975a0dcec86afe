"""Seconds per stage of a computation."""

from __future__ import annotations


class Clock:
    """Seconds since the last lap, added up by stage."""

    def __init__(self) -> None:
        import time

        self._now = time.perf_counter
        self.seconds: dict[str, float] = {}
        self._last = self._now()

    def lap(self, stage: str) -> None:
        """Add the seconds since the last lap to a stage."""
        now = self._now()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
