"""The grid's own error, predicted from a run with larger cells.

    error(cells) ~ |a(cells) - a(cells/ratio)| / (ratio^ORDER - 1)

for an error that falls with the ORDER-th power of the cells per wavelength (Richardson's extrapolation). It depends as
much on where the sides of a body lie between the nodes: the ratio is therefore chosen so that the sides of the scene's
box lie alike on both grids. Echoes at many pulses count, formed from one anchor: more directions make the estimate
steadier, and forming changes both alike.
"""

from __future__ import annotations

import numpy as np

from .. import runs
from ._fullwave_task import FullwaveTask
from ._run_progress import RunProgress

RATIO = 1.5  # of the cells, about: such a run takes a fifth of the time, 1.5^-4
NEAR = 0.15  # from RATIO: the ratios among which one is chosen
APART = 0.3  # weight of a ratio's distance from RATIO against distances of sides, in cells
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
    ratio = chosen_ratio(task.scene.bounds, task.lattice.cell)
    coarse, _ = task.coarser(ratio).formed(pulse, sent, received, some, progress)
    weight = np.abs(task.spectrum)
    change = float((np.abs((coarse - echoes[some]) * weight) ** 2).sum())
    power = float((np.abs(echoes[some] * weight) ** 2).sum())
    return change / (ratio**ORDER - 1) ** 2, power


def chosen_ratio(bounds: np.ndarray, cell: float) -> float:
    """The ratio at which the sides of a box, m (2, 3), lie most alike between the nodes of both grids."""
    ratios = np.linspace(RATIO - NEAR, RATIO + NEAR, 121)
    fine = _from_node(bounds, cell)
    apart = [np.abs((_from_node(bounds, cell * ratio) - fine + 0.5) % 1 - 0.5) for ratio in ratios]
    return float(ratios[np.argmin((np.array(apart) ** 2).sum(axis=1) + APART * (ratios - RATIO) ** 2)])


def _from_node(bounds: np.ndarray, cell: float) -> np.ndarray:
    """How far the sides of a box are from a node of its grid, in cells (3,): `runs.grid_about` has the box's centre."""
    return np.asarray((runs.grid_shape(bounds, cell) - (bounds[1] - bounds[0]) / cell) / 2 % 1)
