"""The method that is chosen for a task with its plan, and the last choices and plans, which are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.fingerprint import checksum, leaves
from ..base.report import ErrorTerm
from ..opencl.device import Device
from .engine import Engine, ImagePlan
from .factorized.plan import FactorPlan
from .focusing_task import FocusingTask
from .kept_results import per_task
from .tiling.tiling import Tiling

STEPS = 2**10  # of a tolerance between two powers of 2: of echoes that differ little the plan is the same
Planned: TypeAlias = tuple[ImagePlan, Tiling]
kept_plans: dict[tuple[object, ...], Planned] = {}  # of the last geometries, whatever the samples


@dataclass(frozen=True, eq=False)
class MethodChoice:
    """A method, its plan and tiling for one task, and the class of its engine.

    engine           called as engine(device, task, plan, tiling)
    predicted_error  bound of the relative error, for the energy of these rows at these pixels
    error_terms      its parts
    cost             per contribution, relative to one with linear interpolation and ranges in float32
    """

    method: str
    plan: ImagePlan
    tiling: Tiling
    engine: type[Engine]
    predicted_error: float
    error_terms: tuple[ErrorTerm, ...]
    cost: float

    @property
    def dtype(self) -> type[np.complexfloating]:
        """Data type of the pixels."""
        return self.engine.dtype

    @property
    def unit(self) -> int:
        """Number of consecutive bands that share work: blocks that begin elsewhere cost more time."""
        return self.tiling.root_bands(self.plan.factors[0]) if isinstance(self.plan, FactorPlan) else 1

    def on(self, device: Device, task: FocusingTask) -> Engine:
        """The engine on one device."""
        return self.engine(device, task, self.plan, self.tiling)


Candidate: TypeAlias = (
    MethodChoice | ToleranceUnreachable
)  # a plan, or its refusal: `choose` raises the one that counts


def confirmed(candidate: Candidate) -> MethodChoice:
    """The choice; the refusal is raised."""
    if isinstance(candidate, ToleranceUnreachable):
        raise candidate
    return candidate


@per_task
def conditions(task: FocusingTask) -> str | None:
    """Checksum of all that a choice follows from beside the samples; None where it cannot be kept.

    That is where an option has no checksum, and for listed points, which take memory.
    """
    if not task.grid.is_plane:
        return None
    raw, fields = task.raw, (getattr(task, name) for name in task.__dataclass_fields__ if name != "raw")
    rows = raw.frequency, raw.frequency_step, raw.time, raw.tx_channel, raw.rx_channel, raw.polarization
    try:
        return checksum(*rows, *(leaf for field in fields for leaf in leaves(field)))
    except TypeError:
        return None


def rounded_down(tolerance: float) -> float:
    """The largest tolerance of STEPS between two powers of 2 that is not above `tolerance`."""
    mantissa, exponent = np.frexp(tolerance)
    return float(np.ldexp(np.floor(mantissa * 2 * STEPS) / (2 * STEPS), exponent))
