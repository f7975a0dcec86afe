"""Runs that are computed in blocks: their files, their ends, and what computes them. Modules import the fixtures."""

from __future__ import annotations

import pytest

from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device


class Stopped(Exception):
    """What ends a run from its progress function."""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def tiles(folder, ending="parts"):
    """Tile files of the results in a folder."""
    return sorted(folder.glob(f"*.{ending}/bands-*.tiles"))


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
