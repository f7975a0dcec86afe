"""Options that every verb has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

from ..base import arguments, validation
from ..base.options import Options, option, or_none
from ..opencl.device import DeviceChoice

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class RunOptions(Options):
    """Options that every verb has: its error, and where and how it runs."""

    tolerance: float = option(
        1e-3,
        "L2 error allowed, relative to the larger of the norm of the result and the norm that it would have if "
        "contributions added with random phases",
        lambda name, value: validation.tolerance(value),
    )
    max_bytes: float | None = option(
        None, "memory for blocks on each device; default 1 GiB on a CPU, half the memory of a GPU"
    )
    check: bool | None = option(
        None,
        "recompute 256 random values of the result exactly: report.measured_error; None: where that costs less than "
        "2 %",
        or_none(validation.flag),
    )
    device: DeviceChoice | None = option(None, "see `sarcl.devices`", in_files=False)
    progress: Progress | None = option(
        None, "called as progress(stage, done, total)", lambda name, value: arguments.progress(value), in_files=False
    )

    def portable(self) -> Self:
        """The same for another process: without what belongs to this one."""
        return replace(self, device=None, progress=None)
