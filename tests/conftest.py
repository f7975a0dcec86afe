"""Fixtures: every OpenCL device on the machine, with and without float64, and the folder of outside data."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sarcl.opencl.choose_device import REMEDY, open_device
from sarcl.opencl.device_list import devices


def _devices():
    """Every working device, each once more without float64, and CPUs once more with one lane, as GPUs run."""
    found = []
    for info in devices():
        if info.works:
            name = f"{info.index}-{info.kind}"
            found.append(pytest.param((info.index, None), id=name))
            if info.fp64:
                found.append(pytest.param((info.index, "without_fp64"), id=f"{name}-no-fp64"))
            if info.vector_width > 1:
                found.append(pytest.param((info.index, "one_lane"), id=f"{name}-one-lane"))
    if not found:
        found.append(pytest.param(None, id="none"))
    return found


@pytest.fixture(params=_devices())
def device(request):
    """An open device; a kernel that fails on it fails the test."""
    if request.param is None:
        pytest.fail(f"no OpenCL device works. {REMEDY}")
    index, twin = request.param
    opened = open_device(index)
    return getattr(opened, twin)() if twin else opened


@pytest.fixture
def double(device):
    """Every device that has float64; the others are refused, as a test of its own says."""
    if not device.info.fp64:
        pytest.skip("no float64")
    return device


@pytest.fixture(scope="session")
def data_folder():
    """Measured data that nobody here made: SARCL_DATA, or ../shared/data beside the repository."""
    folder = Path(os.environ.get("SARCL_DATA") or Path(__file__).parents[2] / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no data folder {folder.name!r}: set SARCL_DATA")
    return folder
