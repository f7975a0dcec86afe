"""Options of backproject, and what follows from them: the task, and the method for some devices."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

from ..arrays.map_aperture import MapApertureOptions, MapKind, map_aperture
from ..base.options import option
from ..base.types import PathLike, WritableArray
from ..base.validation import choice, flag, instance
from ..blocks.block_options import BlockOptions
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..numerics import cost_model
from ..numerics.cost_model import DeviceClass
from ..opencl import native_functions
from ..opencl.device import Device
from .choose_method import METHODS, choose
from .focus_options import GridOptions
from .focusing_task import BeamCone, FocusingTask, Skip, make_task
from .method_choice import MethodChoice


@dataclass(frozen=True, eq=False, kw_only=True)
class BackprojectOptions(GridOptions, BlockOptions):
    """Options of `backproject`."""

    method: Literal["auto", "direct", "factorized"] = option(
        "auto",
        '"direct": every pair that is not skipped; "factorized": sub-apertures; "auto": the cheapest',
        lambda name, value: choice(name, value, METHODS),
    )
    beam: BeamCone | None = option(
        None,
        "None, or the cone in which v_p(x) is 1: its full angle, rad, about the line from the transmitter to the "
        "grid's centre (spotlight), or (angle, direction), direction (3,) or (n_rows, 3) (stripmap). Or an Antenna, "
        "aimed at the grid's centre, (antenna, direction) or (antenna, attitude), attitude (n_rows, 3, 3) or a "
        "Trajectory that has one: rows are weighted by the conjugate of its gain towards the pixel, transmit times "
        "receive (matched filter)",
    )
    mapping: MapKind | MapApertureOptions | None = option(
        None,
        "for echoes of a frequency-diverse array: the mapping that `sarcl.map_aperture` applies first, "
        '"corrected", "apparent" or "channels", or a dict of its arguments, such as {"mapping": "apparent", "center": '
        "(0, 0, 5)}",
    )
    wrap: bool = option(
        False,
        "False: a row covers only |tau - tau_ref| <= 1/(2 frequency_step); True: it repeats with that period",
        flag,
    )
    skip: bool | Collection[Skip] = option(
        True,
        'True, False or a set of reasons ("range window", "beam", "zero weight", "no data"): pairs of rows and pixels '
        "that add nothing for these reasons are left out instead of computed; the image is the same",
    )
    out: PathLike | WritableArray | None = option(  # type: ignore[assignment]  # wider than others'
        None,
        'None, a writable complex array of grid.shape (memmap, HDF5 dataset), or a path ending in ".h5"',
        in_files=False,
    )

    def task(self, raw: PhaseHistory, grid: ImageGrid) -> tuple[PhaseHistory, FocusingTask]:
        """The echoes, mapped where a mapping is asked for, and the image to be made of them."""
        instance("raw", raw, PhaseHistory)
        instance("grid", grid, ImageGrid)
        if self.mapping is not None:
            if isinstance(self.mapping, dict) and "mapping" not in self.mapping:
                raise ValueError(f"mapping is {self.mapping!r:.60}; a dict needs the kind: {{'mapping': 'apparent'}}")
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
