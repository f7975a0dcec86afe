"""Options of the verbs whose results are computed in blocks: their records contain these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from ..base.options import option, or_none
from ..base.validation import count, instance
from ..numerics.run_options import RunOptions
from ..opencl.choose_device import open_device, open_devices, split_choice
from ..opencl.device import Device, DeviceChoice
from .bands import Engine, Recipe
from .block_job import BlockJob
from .workers import LocalWorkers, WorkerPool, rates_of, speedup

if TYPE_CHECKING:
    import distributed

Tile = Sequence[int] | np.ndarray  # (i, n): piece i of n


def _resume(name: str, value: object) -> object:
    instance(name, value, bool)
    return value


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockOptions(RunOptions):
    """Options of every verb whose result is computed in blocks."""

    resume: bool | None = option(
        None,
        'whether finished tiles of a result at a path are kept in "PATH.parts", where the same call finds them if the '
        "run is killed. None: they are kept from the first second on; True: also when the run ends in an exception; "
        "False: they are not kept, and those of earlier runs are deleted",
        or_none(_resume),
        in_files=False,
    )
    tile: Tile | None = option(
        None,
        '(i, n): compute only piece i of n, 1 <= i <= n, and keep its tiles in "PATH.parts"; the run that completes '
        "the result assembles and returns it, the others return None",
        in_files=False,
    )
    device: DeviceChoice | Sequence[DeviceChoice] | None = option(  # type: ignore[assignment]  # wider than others'
        None, 'see `sarcl.devices`; a list of devices, or "all", for several at once', in_files=False
    )
    cluster: distributed.Client | None = option(
        None, "a dask.distributed.Client whose workers compute the tiles, each on a device of its own", in_files=False
    )

    def portable(self) -> Self:
        """See RunOptions."""
        return replace(super().portable(), cluster=None)

    def devices(self) -> tuple[Device, ...]:
        """Devices of this process; with a cluster, which is checked, one: it plans and checks."""
        if self.cluster is None:
            return tuple(open_devices(self.device))
        from .dask_workers import checked

        checked(self.cluster)
        return (open_device(split_choice(self.device)[0]),)

    def workers(self, job: BlockJob, recipe: Recipe, devices: Sequence[Device], first: Engine) -> WorkerPool:
        """The workers of the cluster, or engines on the devices;  first  that of the first device."""
        if self.cluster is not None:
            from .dask_workers import DaskWorkers

            return DaskWorkers(self.cluster, job, recipe, self.device, first.most)
        engines = [first, *(recipe.on(device) for device in devices[1:])]
        infos = [device.info for device in devices]
        budgets = [recipe.budget(device) for device in devices]
        return LocalWorkers(job, engines, budgets, [info.name for info in infos], rates_of(infos))

    def speedup(self, devices: Sequence[Device]) -> float:
        """How many times as fast as the first device all are that share the work; workers of a cluster count as one."""
        if self.cluster is not None:
            return float(max(1, len(self.cluster.nthreads())))
        return speedup([device.info for device in devices])

    def piece(self, has_path: bool, example: str) -> tuple[int, int] | None:
        """`tile` as (i, n), 0 <= i <= n, or None; ValueError for options that do not go together.

        has_path  whether the result has a path;  example  of one, for messages
        """
        tile, resume = self.tile, self.resume
        if (tile is not None or resume) and not has_path:
            name, value = ("tile", tile) if tile is not None else ("resume", resume)
            raise ValueError(
                f'{name} is {" ".join(repr(value).split()):.60} but out is no path; give out="{example}": tiles are '
                "kept beside it"
            )
        if tile is None:
            return None
        if resume is False:
            raise ValueError(
                "tile and resume=False do not go together: a piece would delete the tiles of the other pieces"
            )
        if not isinstance(tile, (tuple, list)) or len(tile) != 2:
            raise ValueError(f"tile is {' '.join(repr(tile).split()):.60}; wanted (i, n): piece i of n")
        i, n = count("tile[0]", tile[0], least=0), count("tile[1]", tile[1])
        if i > n:
            raise ValueError(f"tile is {tile!r}; pieces of {n} are numbered 1 to {n}")
        return i, n
