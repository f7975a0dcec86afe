"""Slant ranges that lie in the range window of every row that contributes to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.rows import spread_over
from ...model.phase_history import PhaseHistory
from ._doppler import sine
from ._track import Track
from ._velocity import Hyperbolas, Positions, hyperbolas

ROWS, RANGES = 257, 513  # rows and ranges that are examined
REMEDY = "give echoes of a wider range window, fewer times=, or an azimuth_beam="


@dataclass(frozen=True, eq=False)
class RangeWindow:
    """The range windows of the rows, each half a swath about its reference range.

    speed  effective velocity, m/s
    sines  of the squint angles between which rows contribute
    least  shortest slant range that reaches the ground, m;  about  slant range in the middle, m
    """

    raw: PhaseHistory
    track: Track
    positions: Positions
    speed: float
    sines: tuple[float, float]
    least: float
    about: float

    @property
    def half(self) -> float:
        """Half the swath, m."""
        return float(self.raw.swath[0]) / 2

    def length(self, times: tuple[float, float]) -> float:
        """Length, m, of the longest run of slant ranges that are held; 0 where none is."""
        first, last, candidates, _ = self._run(times)
        return float(candidates[last] - candidates[first]) if first <= last else 0.0

    def longest(self, times: tuple[float, float]) -> tuple[float, float]:
        """The longest run of slant ranges, m, that every contributing row holds at zero-Doppler times (first, last).

        ValueError where there is none.
        """
        first, last, candidates, excess = self._run(times)
        end = float(self.raw.reference_range.max()) + self.half
        if self.least >= end:
            raise ValueError(
                f"the ground is {self.least:.9g} m from the track or more, beyond the range window, which ends at "
                f"{end:.9g} m; correct heights="
            )
        if first >= last:
            walk = float(np.ptp(excess, axis=(0, 1)).min())
            raise ValueError(
                f"the range window of {2 * self.half:.5g} m is too small for the migration, {walk:.5g} m over these "
                f"rows and times: no swath stays in it; {REMEDY}"
            )
        return float(candidates[first]), float(candidates[last])

    def checked(self, asked: tuple[float, float], times: tuple[float, float]) -> tuple[float, float]:
        """The slant ranges asked for; ValueError where some row does not hold them."""
        if asked[0] < self.least:
            raise ValueError(
                f"ranges start at {asked[0]:.9g} m, but the ground is {self.least:.9g} m from the track; give a larger "
                "near range"
            )
        excess, is_held = self._held(np.linspace(*asked, 9), times)
        if not is_held.all():
            raise ValueError(
                f"the range window, +-{self.half:.5g} m about the reference ranges, is too small for slant ranges "
                f"{asked[0]:.9g} to {asked[1]:.9g} m: with their migration they reach {np.abs(excess).max():.5g} m "
                f"from it; {REMEDY}, or leave ranges out for those that are held"
            )
        return asked

    def _run(self, times: tuple[float, float]) -> tuple[int, int, np.ndarray, np.ndarray]:
        """First and last index of the longest run of ranges that are held, the ranges, and their excess."""
        low = max(self.least, self.about - 2 * self.half)
        candidates = np.linspace(low, max(low, self.about) + 2 * self.half, RANGES)
        excess, is_held = self._held(candidates, times)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], is_held.astype(int), [0]])))
        if len(edges) == 0:
            return 0, -1, candidates, excess
        longest = 2 * int(np.argmax(edges[1::2] - edges[::2]))
        return int(edges[longest]), int(edges[longest + 1]) - 1, candidates, excess

    def _held(self, ranges: np.ndarray, times: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Ranges of points less the reference, m (3, rows, n), at three times, and whether all rows hold them (n,)."""
        rows = spread_over(self.track.n_rows, ROWS)
        t, u = self.track.times[rows], np.linspace(*times, 3)
        fit = Hyperbolas(ranges[0], ranges[-1], np.array([[self.speed, 0.0, 0.0]]))
        if not self.track.is_line:
            every = np.arange(self.track.n_rows)
            fit = hyperbolas(self.raw, self.track, self.positions, float(u[1]), ranges[0], ranges[-1], every)
        excess = fit.range(u[:, None, None], ranges, t[:, None]) - self.raw.reference_range[rows][:, None]
        s = sine(u[:, None, None], ranges, t[:, None], self.speed)
        is_held = (np.abs(excess) <= self.half) | (s < self.sines[0]) | (s > self.sines[1])
        return excess, is_held.all(axis=(0, 1))
