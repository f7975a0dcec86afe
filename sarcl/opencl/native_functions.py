"""The error of a device's own sine and cosine, which OpenCL leaves to each device: measured once per process."""

from __future__ import annotations

import functools

import numpy as np

from .device import Device

PLACES = 2**16  # of a cycle, at which they are compared with float64
MARGIN = 1.5  # factor on the largest error found, for what lies between


@functools.lru_cache(maxsize=16)
def sincos_error(device: Device) -> float:
    """Bound on the error of kernels/common.clh:sincos_cycles with NATIVE, rad; infinite where it does not build."""
    cycles = np.linspace(-0.5, 0.5, PLACES).astype(np.float32)
    try:
        kernel = device.kernel("native_functions.cl", "native_sincos", NATIVE=1)
        out = device.empty(8 * PLACES)
        device.run(kernel, (PLACES,), None, device.upload(cycles), out)
        sine, cosine = device.download(out, np.empty((2, PLACES), np.float32))
    except RuntimeError:
        return np.inf
    angle = 2 * np.pi * cycles.astype(np.float64)
    error = np.hypot(sine - np.sin(angle), cosine - np.cos(angle)).max()
    return float(MARGIN * error) if np.isfinite(error) else np.inf
