"""Fixtures: every OpenCL device on the machine and its twins, and the folder of outside data."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from helpers.devices import opened, variants


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
