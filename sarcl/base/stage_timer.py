"""Seconds per stage of a computation."""

from __future__ import annotations

from collections.abc import Mapping


class Clock:
    """Seconds since the last lap, added up by stage to those `before`."""

    def __init__(self, before: Mapping[str, float] | None = None) -> None:
        import time

        self._now = time.perf_counter
        self.seconds: dict[str, float] = dict(before or {})
        self._last = self._now()

    def lap(self, stage: str) -> None:
        """Add the seconds since the last lap to a stage."""
        now = self._now()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
