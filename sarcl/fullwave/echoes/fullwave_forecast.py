"""Forecast of full-wave echoes before any run: memory, seconds, number of runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np

from ...base import arguments
from ...base.constants import SPEED_OF_LIGHT
from ...base.text import duration, size_text
from ...base.validation import instance
from ...io import sarcl_hdf5
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...scene.scene import Scene
from ...simulation.echo import echo_request
from ._formed_samples import checked_anchors
from ._fullwave_task import FullwaveTask, fullwave_task
from ._grid_choice import SHARE
from ._model_error import RATIO, coarse_task
from ._run_speed import run_speed
from .fullwave_echo import TOLERANCE, FullwaveOptions, fullwave_echo

MOST_CELLS = 5e7  # of a grid by which a forecast cuts the bodies: seconds, and some gigabytes
FEWEST = 5  # anchors before any interval is bisected, where there are as many pulses
# Spacing of anchors, in wavelengths over the length of the target, that has an error: boxes and cones of 3 wavelengths
# and more; the error falls with about the fourth power of the spacing
ERROR, SPACING, WIDEST = 3e-2, 0.75, 1.5

# options that make up the request, and those of the task
REQUEST = {"polarization", "vertical", "max_bytes", "tolerance", "device"}
TASK = {"receiver", "reference", "range_window", "compressed", "cells", "max_bytes"}


@dataclass(frozen=True, eq=False)
class FullwaveForecast:
    """Forecast of `fullwave_echo` with the same arguments.

    n_rows, n_samples  of the phase history;  bytes  of its samples and geometry, in a file or in memory
    runs               about the number of runs of the grid: anchors times polarisations sent times parts of the band
    run_bytes          memory of one run on the device;  run_seconds  about, on this device at its present speed
    seconds            about, of all runs, and of those for the model error and the check
    max_bytes          memory that a run was allowed to take: as given, or a part of what is installed, not of the free.
                       With less, the band is divided into more parts; the same max_bytes gives the same number of runs
    plan               anchors, parts of the band, grid, cells, time steps
    """

    n_rows: int
    n_samples: int
    bytes: float
    runs: int
    run_bytes: float
    run_seconds: float
    seconds: float
    max_bytes: float
    plan: dict[str, object]

    def __str__(self) -> str:
        return (
            f"{self.n_rows} rows of {self.n_samples} samples: {size_text(self.bytes)}\n"
            f"about {self.runs} runs of {self.plan['grid']} cells and {self.plan['steps']} steps: "
            f"{size_text(self.run_bytes)}, {duration(self.run_seconds)} each, about {duration(self.seconds)} in all\n"
            f"with at most {size_text(self.max_bytes)} per run (max_bytes, {self.plan['memory']}): the band takes "
            f"{self.plan['parts']} runs per anchor"
        )


def plan_fullwave_echo(
    scene: Scene, waveform: Waveform, track: Trajectory, **options: Unpack[FullwaveOptions]
) -> FullwaveForecast:
    """Forecast of `fullwave_echo(scene, waveform, track, ...)` with these options, as a FullwaveForecast.

    No run is done; a small grid is timed, which takes about a second, and bodies are cut by the grid, up to 5e7 cells.
    The number of anchors is estimated from the length of the target in wavelengths, the angle that the track covers and
    the tolerance: with anchors="auto" the runs themselves decide. Raises and warns as `fullwave_echo` does; `out` is
    not written.
    """
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
    arguments.keywords(fullwave_echo, options)
    given: dict[str, Any] = {"tolerance": TOLERANCE, **options}
    request = echo_request(scene, (), **{k: v for k, v in given.items() if k in REQUEST})
    task = fullwave_task(scene, waveform, track, request, **{k: v for k, v in given.items() if k in TASK})
    cut = float(np.prod(task.lattice.shape)) <= MOST_CELLS
    also = 1.0 if given.get("check", False) else 0.0  # runs for each polarisation that is sent, beside those of anchors
    predicts = bool(given.get("model_error", True))
    also += predicts * RATIO**-4 * (2 if task.losses else 1)
    if cut:
        task.warn_of_gaps()
        if predicts:
            coarse_task(task)
    parts, n_rows, n_samples = task.parts(), len(track) * len(request.polarizations), len(task.frequencies)
    n_anchors = expected_anchors(task, options.get("anchors", "auto"), request.tolerance)
    sent = len(list(task.sendings()))
    speed = run_speed(task.device)
    entries = task.cost.entries * n_samples / len(parts)
    cells = float(np.prod(task.lattice.shape))
    run_seconds = task.cost.steps * (cells / speed.cells + entries / speed.sums)
    runs = n_anchors * sent * len(parts)
    plan: dict[str, object] = {
        "anchors": n_anchors,
        "parts": len(parts),
        "memory": "as given" if given.get("max_bytes") is not None else f"{SHARE:g} of what is installed",
        "cells": float(f"{task.carried_cells:.4g}"),
        "cell_m": float(f"{task.lattice.cell:.4g}"),
        "grid": " x ".join(map(str, task.lattice.shape)),
        "steps": task.cost.steps,
        **(task.strips if cut else {"bodies": "not looked at on so large a grid"}),
        **task.losses,
        **task.motion,
    }
    return FullwaveForecast(
        n_rows, n_samples, n_rows * (8.0 * n_samples + sarcl_hdf5.ROW_BYTES), runs, task.cost.bytes(parts[0].stop),
        run_seconds, (runs + also * sent * len(parts)) * run_seconds, task.max_bytes, plan,
    )  # fmt: skip


def expected_anchors(task: FullwaveTask, anchors: Any, tolerance: float) -> int:
    """About the number of anchors; as asked, unless that is "auto"."""
    anchors = checked_anchors(anchors, len(task.along))
    if not isinstance(anchors, str):
        return anchors if isinstance(anchors, int) else len(anchors)
    length = float(np.linalg.norm(task.scene.bounds[1] - task.scene.bounds[0]))
    wavelength = SPEED_OF_LIGHT / float(task.frequencies[-1])
    spacing = min(SPACING * (tolerance / ERROR) ** 0.25, WIDEST) * wavelength / length
    return min(len(task.along), max(FEWEST, 1 + int(np.ceil(float(np.ptp(task.along)) / spacing))))
