"""Options that decide how an image is made: those that backproject, plan, the command line and scenarios share."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal, TypedDict

from numpy.typing import ArrayLike

from ..arrays.map_aperture import MapApertureOptions, MapKind, map_aperture
from ..base.validation import choice, flag, instance
from ..base.validation import tolerance as allowed_error
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..numerics import cost_model
from ..numerics.cost_model import DeviceClass
from ..numerics.windows import Window
from ..opencl import native_functions
from ..opencl.device import Device, DeviceChoice
from ..opencl.memory_budget import budget
from .choose_method import METHODS, MethodChoice, choose
from .focusing_task import BeamCone, FocusingTask, Skip, make_task


class FocusKeywords(TypedDict, total=False):
    """FocusOptions as keywords."""

    tolerance: float
    method: Literal["auto", "direct", "factorized"]
    window: Window | None
    weights: ArrayLike | None
    beam: BeamCone | None
    mapping: MapKind | MapApertureOptions | None
    wrap: bool
    skip: bool | Collection[Skip]
    max_bytes: float | None
    device: DeviceChoice | Sequence[DeviceChoice] | None
    sum_polarizations: bool


@dataclass(frozen=True, eq=False)
class FocusOptions:
    """Arguments of `backproject` that a plan depends on, which describes them. ValueError for those that cannot be."""

    tolerance: float = 1e-3
    method: Literal["auto", "direct", "factorized"] = "auto"
    window: Window | None = None
    weights: ArrayLike | None = None
    beam: BeamCone | None = None
    mapping: MapKind | MapApertureOptions | None = None
    wrap: bool = False
    skip: bool | Collection[Skip] = True
    max_bytes: float | None = None
    device: DeviceChoice | Sequence[DeviceChoice] | None = None
    sum_polarizations: bool = False

    def __post_init__(self) -> None:
        choice("method", self.method, METHODS)
        flag("wrap", self.wrap)
        object.__setattr__(self, "tolerance", allowed_error(self.tolerance))

    def task(self, raw: PhaseHistory, grid: ImageGrid) -> tuple[PhaseHistory, FocusingTask]:
        """The echoes, mapped where a mapping is asked for, and what is to be focused."""
        instance("raw", raw, PhaseHistory)
        instance("grid", grid, ImageGrid)
        if self.mapping is not None:
            if isinstance(self.mapping, dict) and "mapping" not in self.mapping:
                raise ValueError(
                    f"mapping is {self.mapping!r:.60}; a dict names the kind too: {{'mapping': 'apparent'}}"
                )
            raw = map_aperture(raw, **(self.mapping if isinstance(self.mapping, dict) else {"mapping": self.mapping}))
        return raw, make_task(
            raw, grid, self.window, self.weights, self.wrap, self.skip, self.beam, self.sum_polarizations
        )

    def choose(self, task: FocusingTask, devices: Sequence[Device], tolerance: float | None = None) -> MethodChoice:
        """The method for these devices together; tolerance: another one than asked for.

        "auto" takes the direct method where a device has too little memory for sub-apertures.
        """
        on, float64 = DeviceClass.of(d.info for d in devices), all(d.info.fp64 for d in devices)
        if on.local_memory and task.pairs >= cost_model.SHARING_PAYS:
            on = on._replace(native_error=max(native_functions.sincos_error(d) for d in devices))
        tolerance = self.tolerance if tolerance is None else tolerance
        chosen = choose(task, self.method, tolerance, on, float64)
        if self.method == "auto" and chosen.method == "factorized":
            try:
                for device in devices:
                    chosen.on(device, task).blocks(self.budget(device))
            except MemoryError:
                return choose(task, "direct", tolerance, on, float64)
        return chosen

    def budget(self, device: Device) -> float:
        """Bytes that blocks may take on a device."""
        return min(budget(device, self.max_bytes), device.info.memory)
