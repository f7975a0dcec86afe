"""Which method makes an image: each offers a plan for the task, the cheapest that meets the tolerance is taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..numerics import error_bounds
from ..numerics.plan import LEAST_TOLERANCE
from ..opencl.device import Device
from . import profile_energy
from .direct import direct, tile_kernels
from .factorized import factorized
from .factorized import plan as factorized_plan
from .float64 import direct as float64_direct
from .float64 import plan as float64_plan
from .focusing_task import Engine, Task
from .tiling import GridTiling

METHODS = ("auto", "direct", "factorized")
WORTH = 0.8  # of the direct method's cost, below which sub-apertures are taken
FLOAT64 = 1.3  # cost of sarcl/imaging/float64/plan.py's unit
TINY = 1e-35  # of samples, below which pixels come near complex64's smallest numbers
SMALL = 3e7  # pairs below which looking for sub-apertures takes longer than they save


@dataclass(frozen=True, eq=False)
class Choice:
    """A method, its plan and tiling for one task, and what makes its engine on a device.

    engine           called as engine(device, task, plan, tiling)
    predicted_error  of the plan, for what the pixels see of the rows' energy
    cost             of a contribution, relative to one by the hat and float32 ranges
    """

    method: str
    plan: Any
    tiling: GridTiling
    engine: Any
    predicted_error: float
    cost: float

    @property
    def dtype(self) -> Any:
        """Of the pixels."""
        return self.engine.dtype

    @property
    def unit(self) -> int:
        """Bands that share work: cutting between them costs time."""
        return int(self.plan.factors[0]) if self.method == "factorized" and self.tiling.grid.is_plane else 1

    def on(self, device: Device, task: Task) -> Engine:
        """The engine on one device."""
        made: Engine = self.engine(device, task, self.plan, self.tiling)
        return made


def choose(task: Task, method: str, tolerance: float, lanes: bool = True, float64: bool = True) -> Choice:
    """The cheapest way to `tolerance` among `method`, or among all for "auto"; ValueError names the best there is.

    lanes    the devices work on vectors of pixels, as CPUs do
    float64  they have it, so that what complex64 cannot meet may be met
    """
    if tolerance < LEAST_TOLERANCE:
        if method == "factorized":
            raise ValueError(f"tolerance {tolerance:.1e} cannot be met with sub-apertures; method='direct' can")
        return _precise(task, tolerance)
    strongest = float(profile_energy.row_norms(task).max()) / np.sqrt(task.raw.n_samples)
    if 0 < strongest < TINY:
        raise ValueError(
            f"samples times weights reach {strongest:.1e}; complex64 loses digits below {TINY:.0e}: scale the samples "
            f"up, or ask for a tolerance below {LEAST_TOLERANCE:.0e}, which is met in complex128"
        )
    # errors are relative to what interpolation reads and transforms round, a tolerance to what pixels see
    seen = profile_energy.seen(task)
    near = max(1.0, seen.near if seen.near > 1.25 else 1.0)
    rounding = error_bounds.sum_rounding(tile_kernels.CHUNK, task.raw.n_samples) * max(seen.whole - near, 0.0)
    inner = (tolerance - rounding) / near

    def offer(name: str, made: tuple[Any, GridTiling], engine: Any) -> Choice:
        error = min(near * made[0].predicted_error + rounding, tolerance)
        return Choice(name, *made, engine, error, made[0].cost)

    if method == "factorized":
        if rounding > 0.5 * tolerance:
            raise ValueError(f"tolerance {tolerance:.1e} cannot be met with sub-apertures; method='direct' may")
        return offer(method, factorized_plan.make_plan(task, inner, lanes), factorized.Factorized)
    try:
        if rounding > 0.5 * tolerance:
            raise ValueError(
                f"tolerance {tolerance:.1e} cannot be met in complex64: these pixels are "
                f"{20 * np.log10(seen.whole):.0f} dB darker than what else is in the same rows; the best here is "
                f"{2.5 * rounding:.1e}"
            )
        straight = offer("direct", direct.make_plan(task, inner, lanes), direct.Direct)
    except ValueError as exc:
        if not float64:
            raise
        try:
            return _precise(task, tolerance)
        except ValueError:
            raise exc from None
    if method == "direct" or task.pairs < SMALL:
        return straight
    try:
        fewer = offer("factorized", factorized_plan.make_plan(task, inner, lanes), factorized.Factorized)
    except ValueError:
        return straight
    return fewer if fewer.cost < WORTH * straight.cost else straight


def _precise(task: Task, tolerance: float) -> Choice:
    """In float64."""
    plan, tiling = float64_plan.make_plan(task, tolerance)
    return Choice(
        "direct", plan, tiling, float64_direct.Precise, plan.predicted_error, FLOAT64 * plan.cost / task.grid.size
    )
