"""Runs that are computed in blocks: their files, their ends, and what computes them. Modules import the fixtures."""

from __future__ import annotations

import threading

import pytest

from sarcl.blocks.checkpoint import Checkpoint
from sarcl.blocks.workers import LocalWorkers
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device


class Stopped(Exception):
    """What ends a run from its progress function."""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def tiles(folder, ending="parts"):
    """Tile files of the results in a folder."""
    return sorted(folder.glob(f"*.{ending}/bands-*.tiles"))


def begin_earlier(seconds, patch=setattr):
    """Let runs count as begun so many seconds earlier: from 1 s on they write tile files, from 60 s on they keep them.

    patch  monkeypatch.setattr, where the change ends with a test
    """
    begin = Checkpoint.__init__

    def begun_earlier(checkpoint, *args):
        begin(checkpoint, *args)
        checkpoint.begun -= seconds

    patch(Checkpoint, "__init__", begun_earlier)


class Observed:
    """An engine of blocks whose `fill` is replaced by fill(engine, first, last, ...), and `least` by a number."""

    def __init__(self, engine, fill, least):
        self.engine, self.observer = engine, fill
        self.least = engine.least if least is None else least

    def __getattr__(self, name):
        return getattr(self.engine, name)

    def fill(self, *block):
        return self.observer(self.engine, *block)


def observe(fill, patch=setattr, least=None):
    """Let the engines of this process compute blocks through `fill`: see Observed; `patch` as in begin_earlier."""
    begin = LocalWorkers.__init__

    def observed(workers, job, engines, *rest):
        begin(workers, job, [Observed(engine, fill, least) for engine in engines], *rest)

    patch(LocalWorkers, "__init__", observed)


def observe_devices(monkeypatch, wait=True):
    """Engine -> the blocks (first, last) that it computes; none computes a second one before two have begun."""
    blocks, begun = {}, threading.Barrier(2, timeout=60)

    def counting(engine, *block):
        if engine not in blocks:
            blocks[engine] = []
            if wait:
                begun.wait()
        blocks[engine].append(block[:2])
        return engine.fill(*block)

    observe(counting, monkeypatch.setattr)
    return blocks


@pytest.fixture
def pair():
    """Two devices of one kind: one device, and its double."""
    first = open_device()
    return [first, Device(first.info, first._raw)]


@pytest.fixture(scope="module")
def client():
    """Two dask workers, each a process of one thread."""
    distributed = pytest.importorskip("distributed", reason="dask is not installed: pip install 'sarcl[dask]'")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client
