"""The grid's own error, predicted from a run with larger cells.

    error(cell) ~ |a(cell) - a(ratio cell)| / (ratio^order - 1)

for an error that falls with a power of the size of cells (Richardson's extrapolation; `order`). It depends as much on
where flat sides lie between nodes: `runs.grid_about` lays them on nodes in both grids. Echoes at many pulses count,
formed from one anchor: more directions make the estimate steadier, and forming changes both alike.

Strips of conductors that are thinner than a cell are sheets in both grids, whose edges are off by parts of a cell: this
error is of first order.

A complex eps_r, whose losses are the same at all frequencies, is a conductivity on the grid, whose losses fall as 1/f.
A run with larger cells and the conductivity that is right at the upper end f_1 of the band, instead of its centre f_0,
says what that does, by a line through both:

    losses(f) ~ (a_1(f) - a_0(f)) (f - f_0) / (f_1 - f_0)

Squares of both errors are added.
"""

from __future__ import annotations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import TooThin
from ._closed_bodies import parts_of
from ._fullwave_task import FullwaveTask
from ._grid_runs import GridRuns
from ._run_bands import COARSE, LOSSES, Run

RATIO = 1.5  # of the cells, about: such a run takes a fifth of the time, 1.5^-4
FINER = 1.15  # by which its cells may be smaller, so that flat sides lie on nodes
# powers of the size of cells with which errors fall, measured: docs/theory/full_wave_bodies.md
CONDUCTOR, SHEETS, DIELECTRIC, LOSSY = 1.5, 1.0, 2.0, 1.25
LOSS = 0.05  # of a permittivity, imaginary over real part, from which on a body counts as lossy


def grid_error(task: FullwaveTask, coarse: FullwaveTask, runs: GridRuns, anchor: Run) -> tuple[float, float]:
    """Predicted power of the error of the samples (P, Q, F) formed from an anchor, and their power."""
    compared = anchor._replace(kind=COARSE)
    coarse_echoes = runs.echoes(compared)
    weight = np.abs(task.spectrum)
    weighted = runs.echoes(anchor)[runs.bands.pulses(compared)] * weight
    ratio = coarse.lattice.cell / task.lattice.cell
    error = float(np.linalg.norm(coarse_echoes * weight - weighted)) / (ratio ** order(task) - 1)
    losses = 0.0
    if task.losses:
        upper, centre = task.band[1], task.waveform.center
        share = (task.frequencies - centre) / (upper - centre)
        upper_echoes = runs.echoes(anchor._replace(kind=LOSSES))
        losses = float(np.linalg.norm((upper_echoes - coarse_echoes) * share * weight))
    return error**2 + losses**2, float(np.linalg.norm(weighted)) ** 2


def check_thickness(coarse: FullwaveTask, cells: float) -> None:
    """Cut the bodies by the larger cells. TooThin, a ValueError, where these do not resolve a part.

    cells  per shortest wavelength of the task itself
    """
    try:
        _ = coarse.target
    except TooThin as thin:
        remedy = "give model_error=False"
        if thin.cell is not None:
            needed = np.ceil(10 * RATIO * SPEED_OF_LIGHT / coarse.band[1] / thin.cell) / 10
            remedy += f", or cells={needed:g}, which are {cells:g} now"
        raise TooThin(
            f"report.model_error takes a run with cells of {coarse.lattice.cell:.3g} m, for which parts of the bodies "
            f"are too thin; {remedy}",
            thin.cell,
        ) from thin


def order(task: FullwaveTask) -> float:
    """The power of the size of cells with which the error falls: the least of those of the materials and of sheets."""
    orders = [SHEETS] if task.target.strip_area else []
    for _, eps in parts_of(task.scene, task.waveform.center):
        orders.append(CONDUCTOR if eps is None else LOSSY if -eps.imag > LOSS * eps.real else DIELECTRIC)
    return min(orders)
