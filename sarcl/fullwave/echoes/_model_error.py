"""The grid's own error, predicted from a run with larger cells.

    error(cell) ~ |a(cell) - a(ratio cell)| / (ratio^ORDER - 1)

for an error that falls with the ORDER-th power of the size of cells (Richardson's extrapolation). It depends as much on
where flat sides lie between nodes: `runs.grid_about` lays them on nodes in both grids. Echoes at many pulses count,
formed from one anchor: more directions make the estimate steadier, and forming changes both alike.
"""

from __future__ import annotations

import numpy as np

from ._fullwave_task import FullwaveTask
from ._run_progress import RunProgress

RATIO = 1.5  # of the cells, about: such a run takes a fifth of the time, 1.5^-4
FINER = 1.15  # by which its cells may be smaller, so that flat sides lie on nodes
ORDER = 1.5  # measured on spheres, boxes, a cylinder and a cone: docs/theory/full_wave.md
MOST_PULSES = 32  # at which echoes are compared


def grid_error(
    task: FullwaveTask, pulse: int, sent: str, received: list[str], echoes: np.ndarray, progress: RunProgress
) -> tuple[float, float]:
    """Predicted power of the error of samples (P, Q, F) formed from one anchor at a pulse, and their power.

    echoes  formed from this anchor
    """
    n = len(echoes)
    some = np.unique(np.append(np.linspace(0, n - 1, min(MOST_PULSES, n)).round().astype(int), pulse))
    larger = task.coarser(RATIO, FINER)
    ratio = larger.lattice.cell / task.lattice.cell
    (coarse,), _ = larger.formed(pulse, sent, received, some, progress)
    weight = np.abs(task.spectrum)
    change = float((np.abs((coarse - echoes[some]) * weight) ** 2).sum())
    power = float((np.abs(echoes[some] * weight) ** 2).sum())
    return change / (ratio**ORDER - 1) ** 2, power
