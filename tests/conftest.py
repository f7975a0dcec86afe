"""Fixtures: every OpenCL device on the machine and its twins, and the folder of outside data."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from helpers.devices import opened, variants


def pytest_collection_modifyitems(config, items):
    """Leave out repeated tests on twins of devices: these run every value of every parameter with quick partners."""
    left_out = [item for item in items if item.get_closest_marker("repeated") and _on_a_twin(item)]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in set(left_out)]


def _on_a_twin(item):
    return any(name in ("device", "double") and value and value[1] for name, value in item.callspec.params.items())


@pytest.fixture(params=variants())
def device(request):
    """An open device; a kernel that fails on it fails the test."""
    return opened(request.param)


@pytest.fixture(params=variants(slow=()))
def every_device(request):
    """As `device`, with no twin left to the slow tests: where the branches themselves are tested, at little cost."""
    return opened(request.param)


@pytest.fixture(params=variants(fp64=True))
def double(request):
    """Every device that has float64, and its twin of one lane."""
    if request.param is None:
        pytest.skip("no float64")
    return opened(request.param)


@pytest.fixture(scope="session")
def data_folder():
    """Measured data that nobody here made: SARCL_DATA, or ../shared/data beside the repository."""
    folder = Path(os.environ.get("SARCL_DATA") or Path(__file__).parents[2] / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no data folder {folder.name!r}: set SARCL_DATA")
    return folder
