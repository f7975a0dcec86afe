"""The grid's own error, predicted from a run with larger cells.

    error(cells) ~ |a(cells) - a(cells/RATIO)| / (RATIO^ORDER - 1)

for an error that falls with the ORDER-th power of the cells per wavelength (Richardson's extrapolation). Echoes at all
pulses count, formed from one anchor: more directions make the estimate steadier, and forming changes both alike.
"""

from __future__ import annotations

import numpy as np

from ._fullwave_task import FullwaveTask
from ._run_progress import RunProgress

RATIO = 1.5  # of the cells: a run takes a fifth of the time, 1.5^-4
ORDER = 1.5  # measured on spheres, boxes and the almond: docs/theory/full_wave.md
MOST_PULSES = 32  # at which echoes are compared


def grid_error(
    task: FullwaveTask, pulse: int, sent: str, received: list[str], echoes: np.ndarray, progress: RunProgress
) -> tuple[float, float]:
    """Predicted power of the error of samples (P, Q, F) formed from one anchor at a pulse, and their power.

    echoes  formed from this anchor
    """
    n = len(echoes)
    some = np.unique(np.append(np.linspace(0, n - 1, min(MOST_PULSES, n)).round().astype(int), pulse))
    coarse, _ = task.coarser(RATIO).formed(pulse, sent, received, some, progress)
    weight = np.abs(task.spectrum)
    change = float((np.abs((coarse - echoes[some]) * weight) ** 2).sum())
    power = float((np.abs(echoes[some] * weight) ** 2).sum())
    return change / (RATIO**ORDER - 1) ** 2, power
