"""Pixels outside the range window of every row: their share, the cause and the cure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..numerics.pulse_geometry import half_path
from .focusing_task import FocusingTask

PIXELS, ROWS = 4096, 512  # pixels and rows that are tried, at most; fewer pixels than that: all of them
FIRST = 32  # rows that every pixel is tried with; the others see only the pixels that are left
WORTH_SAYING = 0.01  # share of the pixels from which a warning is given: corners of a square grid are cut off often
NEAR_ZERO = 0.25  # share of the window at negative ranges: more comes of a reference near 0; records have none


@dataclass(frozen=True)
class UnseenPixels:
    """Pixels outside the range window of every row.

    count, tried   how many of those tried are unseen
    ranges         least and largest half path to them, m
    window         least and largest range of the windows of all rows, m
    """

    count: int
    tried: int
    ranges: tuple[float, float]
    window: tuple[float, float]

    @property
    def share(self) -> float:
        return self.count / self.tried

    def describe(self) -> str:
        """For a report."""
        return f"{self.count} of {self.tried} tried, {self.share:.1%}"

    def warning(self, wraps: bool = True) -> str:
        """Share, cause and cure, in words; empty where so few are unseen that nothing need be said.

        wraps  False for functions that have no argument `wrap`
        """
        if self.share < WORTH_SAYING:
            return ""
        (near, far), (low, high) = self.ranges, self.window
        is_near_zero = low < -NEAR_ZERO * (high - low)
        middle = (
            "make the data with a reference amid the ranges (records in time by PhaseHistory.from_time, dechirped ones "
            "with scene_range=)"
        )
        if not wraps:
            cure = "Move the grid into the window" + (f", or {middle}" if is_near_zero else "")
        elif is_near_zero:
            cure = (
                "That window begins at negative ranges, because the reference lies near range 0: pass wrap=True for "
                f"data that start at range 0, or {middle}"
            )
        else:
            cure = "Move the grid into the window, or pass wrap=True for data that repeat beyond it"
        return (
            f"{self.share:.0%} of the pixels lie outside the range window of every row, and are 0: the rows hold "
            f"{low:.6g} to {high:.6g} m, their reference_range +- c/(4 frequency_step), and these pixels lie at "
            f"{near:.6g} to {far:.6g} m. {cure}"
        )


def unseen_pixels(task: FocusingTask) -> UnseenPixels | None:
    """Pixels that no row's range window holds, from up to 4096 pixels and 512 rows; None where every pixel is held."""
    if task.wrap:
        return None
    raw = task.raw
    half = SPEED_OF_LIGHT / (4 * raw.frequency_step)
    _, x = task.grid.sample(PIXELS, seed=2)
    rows = spread_over(raw.n_rows, ROWS)
    first = rows[spread_over(len(rows), FIRST)]
    unseen, nearest = np.arange(len(x)), np.full(len(x), np.inf)
    farthest = np.zeros(len(x))
    for row in (*first, *np.setdiff1d(rows, first)):
        if len(unseen) == 0:
            return None
        path = half_path(raw.tx[row], raw.rx[row], x[unseen])
        nearest[unseen], farthest[unseen] = np.minimum(nearest[unseen], path), np.maximum(farthest[unseen], path)
        unseen = unseen[np.abs(path - raw.reference_range[row]) > half[row] * (1 + 1e-9)]
    if len(unseen) == 0:
        return None
    window = float((raw.reference_range - half).min()), float((raw.reference_range + half).max())
    return UnseenPixels(len(unseen), len(x), (float(nearest[unseen].min()), float(farthest[unseen].max())), window)
