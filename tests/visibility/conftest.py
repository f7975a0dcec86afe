"""Tests of shadows run on every device, and not on its twins: their kernels are the same binaries there."""

from __future__ import annotations

import pytest
from helpers.devices import opened, variants


@pytest.fixture(params=variants(()))
def device(request):
    """An open device; tests/opencl/test_open_device.py holds that the kernels name nothing that a twin changes."""
    return opened(request.param)
