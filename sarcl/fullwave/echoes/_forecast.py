"""Forecast of full-wave echoes before any run: memory, seconds, number of runs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.forecast import Forecast
from ...base.report import root_sum_square
from ...base.text import duration, size_text
from ...io import sarcl_hdf5
from ...model.phase_history import PhaseHistory
from ..anchors import ENOUGH, FIRST
from ._formed_samples import error_terms
from ._fullwave_task import LEFT, FullwaveTask
from ._grid_choice import SHARE
from ._run_speed import RunSpeed, run_speed

MOST_CELLS = 5e7  # of a grid by which a forecast cuts the bodies: seconds, and some gigabytes
FEWEST = 5  # anchors before any interval is bisected, where there are as many pulses
# Spacing of anchors, in wavelengths over the length of the target, that has an error: boxes and cones of 3 wavelengths
# and more; the error falls with about the fourth power of the spacing
ERROR, SPACING, WIDEST = 3e-2, 0.75, 1.5


def forecast_of(
    task: FullwaveTask,
    coarse: FullwaveTask | None,
    anchors: str | int | np.ndarray,
    planning: float,
    run: Callable[[], PhaseHistory],
) -> Forecast[PhaseHistory]:
    """Forecast of `run`, which makes the echoes of a task.

    coarse  the task on larger cells that predicts the error of the grid, or None;  planning  seconds so far
    """
    speed, n_sent = run_speed(task.device), len(task.sendings)
    n_anchors, n_parts = expected_anchors(task, anchors), len(task.parts)
    n_runs, each = n_anchors * n_sent * n_parts, run_seconds(task, speed)
    others = [each * n_parts] * (task.options.check * n_sent)
    if coarse:
        others += [run_seconds(coarse, speed) * len(coarse.parts)] * ((2 if task.losses else 1) * n_sent)
    lanes = task.options.speedup(task.devices)
    seconds = sum(max(sum(r) / lanes, max(r)) for r in rounds(anchors, n_anchors, n_sent, each * n_parts, others) if r)
    n_rows, n_samples = len(task.tx) * len(task.polarizations), len(task.frequencies)
    memory = f"{SHARE:g} of what is installed" if task.options.max_bytes is None else "as given"
    plan: dict[str, object] = {
        "anchors": n_anchors,
        "runs": n_runs,
        **task.grid_choices,
        "steps": task.cost.steps,
        "run_bytes": task.run_bytes,
        "max_bytes": task.max_bytes,
        "memory": memory,
        "parts": n_parts,
        "run_seconds": each,
        **(task.strips if is_cut(task) else {"bodies": "not looked at on so large a grid"}),
        **task.losses,
        **task.motion,
    }
    terms = error_terms(expected_error(task, anchors), LEFT * task.options.tolerance, task.options)
    return Forecast(
        method="full wave",
        plan=plan,
        seconds=planning + seconds,
        bytes=task.run_bytes + n_rows * (8.0 * n_samples + sarcl_hdf5.ROW_BYTES) + echo_bytes(task, n_anchors),
        predicted_error=root_sum_square(terms),
        error_terms=terms,
        n_rows=n_rows,
        n_samples=n_samples,
        work=(
            f"about {n_runs} runs of {plan['grid']} cells and {task.cost.steps} steps, {size_text(task.run_bytes)} and "
            f"{duration(each)} each; band in {n_parts} parts, with at most {size_text(task.max_bytes)} per run "
            f"(max_bytes, {memory})"
        ),
        planning=planning,
        run=run,
    )


def rounds(
    anchors: str | int | np.ndarray, n_anchors: int, n_sent: int, each: float, others: list[float]
) -> list[list[float]]:
    """Seconds of runs that can be computed at the same time, of those after them, and so on.

    each  seconds of the run of an anchor;  others  of the runs that anchors are compared with
    """
    if not isinstance(anchors, str):
        return [[each] * (n_anchors * n_sent) + others]
    first = min(n_anchors, len(FIRST))
    return [[each] * (first * n_sent), *([each] * n_sent for _ in range(n_anchors - first)), others]


def echo_bytes(task: FullwaveTask, n_anchors: int) -> float:
    """Memory of the echoes of all pulses formed from each anchor, and of a copy of them, which are interpolated."""
    return 2.0 * 8 * n_anchors * len(task.tx) * len(task.polarizations) * len(task.frequencies)


def is_cut(task: FullwaveTask) -> bool:
    """Whether a forecast cuts the bodies by the grid."""
    return task.n_cells <= MOST_CELLS


def run_seconds(task: FullwaveTask, speed: RunSpeed) -> float:
    """Seconds of a run, about."""
    entries = task.cost.entries * len(task.frequencies) / len(task.parts)
    return task.cost.steps * (task.n_cells / speed.cells + entries / speed.sums)


def expected_error(task: FullwaveTask, anchors: str | int | np.ndarray) -> float:
    """Bound of the error of waveform forming; nan where anchors are given: the runs alone say what these reach."""
    if not np.ptp(task.along):  # one run is that of every pulse
        return 0.0
    return ENOUGH * task.options.tolerance if isinstance(anchors, str) else np.nan


def expected_anchors(task: FullwaveTask, anchors: str | int | np.ndarray) -> int:
    """Number of anchors, about; as asked, unless that is "auto"."""
    if not isinstance(anchors, str):
        return anchors if isinstance(anchors, int) else len(anchors)
    length = float(np.linalg.norm(task.scene.bounds[1] - task.scene.bounds[0]))
    wavelength = SPEED_OF_LIGHT / float(task.frequencies[-1])
    spacing = min(SPACING * (task.options.tolerance / ERROR) ** 0.25, WIDEST) * wavelength / length
    return min(len(task.along), max(FEWEST, 1 + int(np.ceil(float(np.ptp(task.along)) / spacing))))
