"""Workers of a dask.distributed cluster, each with a device of its own. Needs sarcl[dask].

Dask schedules the blocks. A worker receives the recipe of the engine once, opens its device in its own process with the
first block, and returns the values of every block. Samples in a file are read from the file by each
worker, so all workers must find the file under the same name.
"""

from __future__ import annotations

import os
import secrets
import threading
from collections.abc import Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import DTypeLike

from ..base.stage_timer import Clock
from ..base.types import LazyRows
from ..io import sarcl_hdf5
from ..model.lazy_rows import Picked, Stacked
from ..numerics.cost_model import DeviceClass
from ..opencl.choose_device import open_device, split_choice
from ..opencl.device import Device, DeviceChoice
from ..opencl.device_list import DeviceInfo
from ..opencl.failures import DeviceFailed
from .bands import BandBuffer, Bands, Engine, Recipe, Run, Tally
from .block_job import BlockJob
from .workers import FinishedBlock, Work, cut

if TYPE_CHECKING:
    from distributed import Client

Devices: TypeAlias = DeviceChoice | Sequence[DeviceChoice] | None  # as verbs that compute in blocks take `device`
BLOCKS_EACH = 4  # blocks per worker, so that no worker waits long for the slowest


@dataclass(frozen=True, eq=False)
class WorkerTask:
    """Data that every worker receives once: how it makes its engine, the bands, and the choice of its device."""

    recipe: Recipe
    bands: Bands
    dtype: DTypeLike
    tally: type[Tally]
    device: Devices
    name: str


class DaskWorkers:
    """The workers of a distributed.Client; see workers.WorkerPool."""

    least = 0.0

    def __init__(self, client: Client, job: BlockJob, recipe: Recipe, device: Devices, most: float) -> None:
        """most  units of work of a block, whose values return to the caller's memory"""
        self.client, self.job, self.most = client, job, most
        self.places = _places(client)
        self.size = len(self.places)
        self.names: list[str] = []
        self.worker_task = WorkerTask(recipe, job.bands, job.dtype, job.tally, device, secrets.token_hex(8))

    def compute(self, work: Work) -> Generator[FinishedBlock, None, None]:
        """See WorkerPool; progress is reported block by block."""
        from distributed import as_completed

        lost = _losses()
        bands, most = self.job.bands, min(work.most, self.most)
        if self.size > 1:
            most = min(most, sum(bands.count(*run) for run in work.todo) / (BLOCKS_EACH * self.size))
        blocks = cut(bands, work.todo, most, set(), work.unit)
        work.on_progress(0)
        if not blocks:
            return
        futures: list[Any] = []
        contributions = done = 0
        try:
            worker_task = self.client.scatter(self.worker_task, broadcast=True, hash=False)
            futures = self.client.map(_make, blocks, worker_task=worker_task, places=self.places, pure=False)
            run_of = dict(zip((f.key for f in futures), blocks, strict=True))
            for future in as_completed(futures):
                first, last = run_of[future.key]
                values, tally, name = future.result()
                future.release()
                self.names = sorted({*self.names, name})
                flat = work.output_for(first, last)
                flat[bands.extent(first, last)] = values
                work.clock.lap(self.job.stage)
                contributions += self.job.passes * bands.count(first, last)
                done += 1
                work.on_progress(contributions)
                yield first, last, flat, tally
        except lost as exc:
            raise DeviceFailed(
                f"the workers of the cluster were lost, with {done} of {len(blocks)} blocks finished "
                f"({type(exc).__name__}); look into their logs for memory that ran out, start workers, and repeat the "
                "call: with out= it continues from the finished blocks, which are kept but with resume=False"
            ) from exc
        finally:
            with suppress(*lost):
                self.client.cancel(futures)


def _losses() -> tuple[type[BaseException], ...]:
    """Exceptions of dask where workers are lost and none can repeat their blocks, or where the scheduler is lost."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker
    from distributed.client import ClosedClientError
    from distributed.comm import CommClosedError

    return CancelledError, KilledWorker, CommClosedError, ClosedClientError


def checked(client: object) -> Client:
    """`client`, a distributed.Client: ImportError without dask, TypeError for another kind of client, RuntimeError
    where it has no workers."""
    try:
        from distributed import Client
    except ImportError as exc:
        raise ImportError(f"cluster= needs dask ({exc}): pip install 'sarcl[dask]'") from None
    if not isinstance(client, Client):
        raise TypeError(f"cluster is a {type(client).__name__}; wanted a dask.distributed.Client")
    if not client.nthreads():
        raise RuntimeError("cluster has no workers; start some, and client.wait_for_workers(1)")
    return client


def device_class(client: Client, device: Devices) -> DeviceClass:
    """Class of the devices of all workers together, for plans. Opens the devices; raises what `checked` does."""
    places = _places(checked(client))
    infos = [client.submit(_info, device, place, workers=[w], pure=False) for w, place in places.items()]
    return DeviceClass.of(client.gather(infos))


def _places(client: Client) -> dict[str, int]:
    """Address of each worker, and its number on its machine, by which it chooses among the devices there."""
    workers = sorted(client.nthreads())
    hosts = [address.rpartition(":")[0] for address in workers]
    return {address: hosts[:i].count(hosts[i]) for i, address in enumerate(workers)}


class InFile:
    """Rows of an HDF5 dataset, which is opened in the process that reads it."""

    def __init__(self, file: str, name: str, shape: tuple[int, ...], dtype: np.dtype) -> None:
        self.file, self.name, self.shape, self.dtype = file, name, shape, dtype
        self._open: LazyRows | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_open": None}

    def __getitem__(self, rows: slice) -> np.ndarray:
        if self._open is None:
            try:
                rows_in_file = sarcl_hdf5.open_rows(self.file, self.name)
            except (OSError, KeyError) as exc:
                raise OSError(f"{self.file!r} cannot be read here ({exc}); every worker needs it") from None
            if rows_in_file.shape != self.shape or rows_in_file.dtype != self.dtype:
                raise ValueError(
                    f"{self.file!r} is another file here, of {self.name} {rows_in_file.shape} {rows_in_file.dtype}"
                )
            self._open = rows_in_file
        return np.asarray(self._open[rows])


def portable(samples: LazyRows) -> LazyRows:
    """Samples that another process can read: arrays as they are, datasets by the names of file and dataset."""
    if isinstance(samples, Picked):
        return Picked(portable(samples.source), samples.index)
    if isinstance(samples, Stacked):
        return Stacked([portable(s) for s in samples.sources])
    if hasattr(samples, "file") and hasattr(samples, "name"):  # an h5py.Dataset
        return InFile(os.path.abspath(samples.file.filename), samples.name, samples.shape, samples.dtype)
    return samples


_lock = threading.Lock()  # the threads of a worker share one device
_engine: tuple[str, Engine, Device] | None = None


def _open(choice: Devices, place: int) -> Device:
    """In a worker: its device, by the number of the worker on its machine."""
    choices = split_choice(choice)
    return open_device(choices[place % len(choices)])


def _info(choice: Devices, place: int) -> DeviceInfo:
    """In a worker: what is known of its device."""
    with _lock:
        return _open(choice, place).info


def _make(run: Run, *, worker_task: WorkerTask, places: dict[str, int]) -> tuple[np.ndarray, Tally, str]:
    """In a worker: values of a run of bands, their tally, and the device's name."""
    global _engine
    from distributed import get_worker

    with _lock:
        if _engine is None or _engine[0] != worker_task.name:
            device = _open(worker_task.device, places.get(get_worker().address, 0))
            _engine = None  # frees what an earlier result holds on the device
            _engine = worker_task.name, worker_task.recipe.on(device), device
        _, engine, device = _engine
        budget = worker_task.recipe.budget(device)
        values, tally = BandBuffer(worker_task.bands, *run, worker_task.dtype), worker_task.tally()
        ends = {last for _, last in engine.blocks(budget)}
        for first, last in cut(worker_task.bands, [run], float("inf"), ends):
            tally = tally + engine.fill(first, last, values, budget, Clock(), lambda _: None)
        return values.values, tally, device.info.name
