"""Lobes in which facets send back power to one antenna, as it sees them along a track."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..scene.triangles import cosines_to
from ._aspect_blocks import pulse_blocks
from ._frame import box_of

MOST_TURN = 0.2  # rad, between the directions of pulses that share the cosines of one of them
STEPS = 4096  # of the cosine from 0 to 1, in tables of lobes


def mean_lobes(
    triangles: np.ndarray, two_sided: np.ndarray, antenna: np.ndarray,
    lobes: Sequence[Callable[[np.ndarray], np.ndarray]], lobe: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Means along a track, m (n_pulses, 3), of lobes of cosines of incidence on triangles, m (k, 3, 3): (k,).

    two_sided  (k,) bool: the others send back nothing behind them;  lobe  number of the lobe of each (k,)

    The cosine of a block of pulses is that of the middle one, and counts as no less than the angle, rad, by which their
    directions differ: a facet that is edge-on there is seen at that angle by others.
    """
    if not len(triangles):
        return np.zeros(0)
    blocks, _, turns = pulse_blocks([antenna], box_of(triangles), [MOST_TURN])
    tables, total = np.array([table(np.linspace(0, 1, STEPS + 1)) for table in lobes]), np.zeros(len(triangles))
    for (first, stop), turn in zip(blocks.tolist(), turns.tolist(), strict=True):
        cosine = cosines_to(triangles, antenna[(first + stop) // 2])
        cosine = np.hypot(np.where(two_sided, np.abs(cosine), np.maximum(cosine, 0)), turn / 2)
        step = np.minimum(np.rint(STEPS * cosine).astype(np.int32), STEPS)
        total += (stop - first) * tables[lobe, step]
    return total / len(antenna)
