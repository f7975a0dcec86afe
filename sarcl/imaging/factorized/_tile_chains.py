"""Sides of tiles level by level, and the smooth runs of rows that are decimated."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...base.rows import groups
from ...model.phase_history import PhaseHistory
from ...numerics.subapertures import smooth_runs


def runs_of(raw: PhaseHistory) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """An order of the rows, (n,), in which the rows of a run are consecutive; and the runs (first, stop).

    A run is smooth: its rows share channel and frequency, and follow one another without a gap in the track.
    """
    channel = raw.tx_channel, raw.rx_channel, raw.polarization
    group = groups(raw.n_rows, raw.frequency, raw.frequency_step, *channel)
    time = np.arange(raw.n_rows) if raw.time is None else raw.time
    order = np.lexsort((np.arange(raw.n_rows), time, group))
    return order, smooth_runs(raw.tx[order], raw.rx[order], group[order])


def chains(leaf: int, largest: int) -> Iterator[tuple[int, ...]]:
    """Sides of the tiles of each level, from the root to the leaf: ratios of 2 to 16, at most four levels."""
    yield (leaf,)
    for ratio in (2, 4, 8, 16):
        if leaf * ratio >= 2 * largest:
            return
        yield (leaf * ratio, leaf)
        for second in (4, 8, 16):
            if leaf * ratio * second < 2 * largest:
                yield (leaf * ratio * second, leaf * ratio, leaf)
                if leaf * ratio * second * 8 < 2 * largest:
                    yield (leaf * ratio * second * 8, leaf * ratio * second, leaf * ratio, leaf)
