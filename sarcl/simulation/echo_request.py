"""What is asked of all channels of echoes alike: arguments of the verbs that make echoes, checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ..base import arguments, host_memory, wgs84
from ..base.stage_timer import Clock
from ..base.validation import choice, count, direction, flag, number
from ..base.validation import tolerance as allowed_error
from ..numerics import plan
from ..opencl.choose_device import open_device
from ..opencl.device import Device, DeviceChoice
from ..opencl.memory_budget import budget
from ..scattering.facets import POLARIZATIONS
from ..scene.scene import Scene

Polarization = Literal["HH", "HV", "VH", "VV"]
Progress = Callable[[str, int, int], None]

# Memory for facets that are cut: a share of the machine's, or max_bytes, but no less than the process takes anyway
HOST_SHARE, LEAST_HOST = 0.25, 2.0**28


@dataclass(frozen=True, eq=False)
class EchoRequest:
    """What is asked for, of every channel alike: arguments of `sarcl.echo`, checked.

    tolerance  of each channel;  vertical  (3,);  budget  bytes on the device;  host  bytes for facets that are cut
    """

    device: Device
    tolerance: float
    budget: float
    host: float
    skips: set[str]
    polarizations: tuple[str, ...]
    vertical: np.ndarray
    max_edge: float | str | None
    shadows: bool
    seed: int
    progress: Progress | None
    clock: Clock = field(default_factory=Clock)

    @property
    def same(self) -> list[int]:
        """Indices of the polarisations in which points send something back."""
        return [i for i, name in enumerate(self.polarizations) if name[0] == name[1]]

    @property
    def gated(self) -> bool:
        """Whether scatterers outside the range window are left out."""
        return "range window" in self.skips

    def report(self, stage: str, done: int, total: int) -> None:
        """Call `progress`, where it is given."""
        if self.progress:
            self.progress(stage, done, total)


def echo_request(
    scene: Scene, skips: tuple[str, ...], *, polarization: Any = "HH", vertical: Any = None,
    shadows: Any = True, seed: int = 0, skip: Any = True, max_edge: Any = "auto", max_bytes: float | None = None,
    tolerance: float = 1e-3, device: DeviceChoice | None = None, progress: Progress | None = None,
) -> EchoRequest:  # fmt: skip
    """The options of `echo` that all its methods share, checked; skips  the reasons that `skip` may name."""
    seed = count("seed", seed, 0)
    if isinstance(shadows, str) and shadows == "embree":
        raise ValueError(
            "shadows is 'embree'; rays of Embree were taken out, since sarcl's own became faster and exact: give True"
        )
    shadows = flag("shadows", shadows)
    arguments.progress(progress)
    if isinstance(max_edge, str):
        choice("max_edge", max_edge, ("auto",))
    elif max_edge is not None:
        max_edge = number("max_edge", max_edge, above=0)
    opened = open_device(device)
    return EchoRequest(
        opened, allowed_error(tolerance), budget(opened, max_bytes),
        max(LEAST_HOST, HOST_SHARE * host_memory.installed() if max_bytes is None else max_bytes),
        plan.skips(skip, skips),
        _polarizations(polarization), _vertical(vertical, scene.center), max_edge, shadows, seed,
        progress,
    )  # fmt: skip


def _polarizations(asked: Any) -> tuple[str, ...]:
    """Names in the order of a pulse's rows; ValueError for unknown, repeated or none."""
    if isinstance(asked, str):
        asked = POLARIZATIONS if asked == "all" else (asked,)
    names = tuple(asked) if isinstance(asked, Sequence) else ()
    for name in names:
        choice("polarization", name, POLARIZATIONS)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"polarization is {asked!r:.60}; give at least one, and each once")
    return names


def _vertical(asked: Any, center: np.ndarray) -> np.ndarray:
    """Unit vector (3,): as asked, the ellipsoid's normal at an Earth-centred `center`, m (3,), or z."""
    if asked is not None:
        return direction("vertical", asked)
    normal = wgs84.vertical_at(center)
    return np.array([0.0, 0.0, 1.0]) if normal is None else normal
