"""When the currents of a run have decayed, by how much their phasors still change."""

from __future__ import annotations

from math import ceil, log

import numpy as np

SPAN = 256  # steps that are taken together: phasors of low frequencies change unevenly from window to window
SLOWEST = 0.98  # from one span to the next: changes that fall less do not fall
ROUNDING = 1e-5  # changes per window that may be rounding of float32 fields: 4e-6 were found beside spheres


class Decay:
    """What windows of equal length add to phasors, and what all later ones will.

    For each frequency, with S the phasors of all cells, the change is |S(after a window) - S(before)|/|S(after)|. The
    largest changes of the last n windows (SPAN steps), a, and of the n windows before, b, give the ratio r = a/b. If it
    stays, later windows add at most n a (r + r^2 + ...) = n a r/(1 - r), which adds changes as if they all had the same
    phase: true for a resonance at that frequency, and too much for others.

    left   largest of these estimates over frequencies; 1 before there are enough windows
    ended  "decayed": left <= tolerance;  None: not yet
           "rounding": changes are below ROUNDING and do not fall. They are fields that stand still where rounding left
           them, whose sums over time do not grow: left is n a.
    """

    def __init__(self, tolerance: float, window: int) -> None:
        self._tolerance, self._windows = tolerance, max(1, SPAN // window)
        self._changes: list[np.ndarray] = []
        self.left, self._ratio = 1.0, 1.0
        self.ended: str | None = None

    def add(self, changes: np.ndarray, sums: np.ndarray) -> None:
        """Take |change|^2 and |S|^2, summed over all cells, of a window (F,) each."""
        self._changes = [*self._changes[1 - 2 * self._windows :], np.sqrt(changes)]
        self.ended = None
        if len(self._changes) < 2 * self._windows:
            return
        size = np.sqrt(sums)
        if not size.any():  # nothing scatters
            self.left, self.ended, self._ratio = 0.0, "decayed", 0.0
            return
        n = self._windows
        before, last = (np.max(part, axis=0) for part in (self._changes[:n], self._changes[n:]))
        last, ratio = last / size, last / np.where(before > 0, before, 1)
        self._ratio = float(ratio.max())
        falling = np.minimum(ratio, SLOWEST)
        left = n * last * falling / (1 - falling)
        self.left = float(left.max())
        if self.left <= self._tolerance and (ratio < 1).all():
            self.ended = "decayed"
        elif ((left <= self._tolerance) | ((last < ROUNDING) & (ratio > SLOWEST))).all():
            self.left, self.ended = float((n * last).max()), "rounding"

    def missing_steps(self) -> int:
        """Steps until `left` is as small as asked for, if changes go on falling as they do; 0 where they do not."""
        if self.left <= self._tolerance or not 0 < self._ratio < SLOWEST:
            return 0
        return ceil(log(self._tolerance / self.left) / log(self._ratio)) * SPAN
