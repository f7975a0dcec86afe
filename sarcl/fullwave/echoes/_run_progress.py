"""Progress of several runs of the grid, in time steps, for the callback `progress` of a verb."""

from __future__ import annotations

from collections.abc import Callable

STAGE = "full-wave runs"


class RunProgress:
    """Reports steps done of all that are expected; more runs than expected enlarge the total.

    report  called as report(stage, done, total), or None;  runs, steps  expected, and the steps of each
    """

    def __init__(self, report: Callable[[str, int, int], None] | None, runs: int, steps: int) -> None:
        self._report, self._runs, self._steps = report or _silent, runs, max(steps, 1)
        self._finished, self._share = 0, 0.0  # runs that are done, and the part of the one that runs
        self._report(STAGE, 0, runs * self._steps)

    def __call__(self, steps: int, expected: int) -> None:
        """A run has done so many steps of those that it expects now."""
        self._runs = max(self._runs, self._finished + 1)
        # a run may take longer than expected: its share is full then, but not the whole
        self._share = max(self._share, min(steps / max(expected, 1), 0.999))
        done = self._finished * self._steps + int(self._share * self._steps)
        self._report(STAGE, done, self._runs * self._steps)

    def run_done(self, runs: int = 1) -> None:
        """So many runs are done, or were done before."""
        self._finished, self._share = self._finished + runs, 0.0
        self._runs = max(self._runs, self._finished + 1)
        self._report(STAGE, self._finished * self._steps, self._runs * self._steps)

    def finish(self) -> None:
        """No run follows."""
        total = max(self._finished, 1) * self._steps
        self._report(STAGE, total, total)


def _silent(stage: str, done: int, total: int) -> None:
    """Progress that nobody asked for."""
