"""What is asked of all channels of echoes alike: options of the verbs that make echoes, for one device."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base import host_memory
from ..base.stage_timer import Clock
from ..numerics.run_options import Progress as Progress
from ..opencl.choose_device import open_device
from ..opencl.device import Device
from ..opencl.memory_budget import budget
from ..scattering.facet_plan import MOST_FACETS
from ..scattering.pulse_nodes import WORTH
from ..scene.scene import Scene
from .scene_options import SceneOptions

# Memory for facets that are cut: a share of the machine's, or max_bytes, but no less than the process takes anyway
HOST_SHARE, LEAST_HOST = 0.25, 2.0**28


@dataclass(frozen=True)
class EchoLimits:
    """Where plans of echoes change their way.

    few_looks         pairs of piece and pulse, up to which rough facets are clipped too: about ten seconds
    most_looks        such pairs, up to which they are clipped where samples do not meet the tolerance: about a minute
    prepared_share    of the modelled job, and
    prepared_seconds  s: a forecast may take the larger of these to prepare the scene
    facets            number into which a scene may be cut
    float64_terms     facets times pulses times samples that may be added up in float64, in about a second
    kept_pieces       share of the memory for blocks: where pieces of rough facets take more of the device, they are
                      made anew for each block of pulses
    own_amplitudes    pairs of facet and pulse, below which every pulse has amplitudes of its own
    checked_facets    facets times samples that are recomputed to check echoes: two or three seconds
    """

    few_looks: float = 2e6
    most_looks: float = 5e7
    prepared_share: float = 0.06
    prepared_seconds: float = 0.025
    facets: float = MOST_FACETS
    float64_terms: float = 4e6
    kept_pieces: float = 0.5
    own_amplitudes: float = WORTH
    checked_facets: float = 256 * 20_000


@dataclass(frozen=True, eq=False)
class EchoRequest:
    """What is asked for, of every channel alike.

    tolerance  of each channel;  vertical  (3,);  budget  bytes on the device;  host  bytes for facets that are cut
    method     by which points are added: "direct", "factorized" or "auto";  bounces  reflections that are followed
    crease     rad, angle between normals of facets at an edge, at least; None: edges do not diffract
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
    limits: EchoLimits = EchoLimits()
    method: str = "direct"
    crease: float | None = None
    bounces: int = 1

    @classmethod
    def of(cls, options: SceneOptions, scene: Scene, device: Device | None = None) -> EchoRequest:
        """The request of a verb's options for a scene; opens the device where none is given."""
        device, most = open_device(options.device) if device is None else device, options.max_bytes
        return cls(
            device=device,
            tolerance=options.tolerance,
            budget=budget(device, most),
            host=max(LEAST_HOST, HOST_SHARE * host_memory.installed() if most is None else most),
            skips=set(options.skip) if not isinstance(options.skip, bool) else set(),
            bounces=options.bounces,
            polarizations=tuple(options.polarization),
            vertical=options.vertical_at(scene.center),
            max_edge=options.max_edge,
            shadows=options.shadows,
            seed=options.seed,
            progress=options.progress,
        )

    def __getstate__(self) -> dict[str, Any]:
        """In another process the device is another one, and nobody asks for progress."""
        return {**self.__dict__, "device": None, "progress": None}

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
