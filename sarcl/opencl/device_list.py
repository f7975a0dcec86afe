"""OpenCL devices of this machine, each tried with a small kernel."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.text import first_line
from ._programs import quiet


@dataclass(frozen=True)
class DeviceInfo:
    """What is known of one OpenCL device after a trial build.

    index, platform, name, kind   as listed; kind is "gpu", "cpu" or "accelerator"
    works, why                    True when a trial kernel built and gave the right numbers, else the reason
    fp64                          a float64 kernel built and gave the right numbers
    vector_width                  lanes a work-item computes: 1 on GPUs, 8 on CPUs
    memory, max_alloc             bytes of the device and of its largest buffer
    units, driver                 compute units; driver version
    """

    index: int
    platform: str
    name: str
    kind: str
    works: bool
    why: str
    fp64: bool
    vector_width: int
    memory: int
    max_alloc: int
    units: int
    driver: str


def devices() -> tuple[DeviceInfo, ...]:
    """Every OpenCL device that is listed, tried once a process; empty where there is no platform."""
    return tuple(info for info, _ in probe())


@functools.cache
def probe() -> tuple[tuple[DeviceInfo, Any], ...]:
    import pyopencl

    try:
        platforms = pyopencl.get_platforms()
    except pyopencl.Error:  # the loader knows no platform
        return ()
    found: list[tuple[DeviceInfo, Any]] = []
    for platform in platforms:
        try:
            listed = platform.get_devices()
        except pyopencl.Error:
            continue
        for device in listed:
            found.append((_try_device(len(found), platform, device), device))
    return tuple(found)


_TRIAL = """
#if FP64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
typedef double number;
#else
typedef float number;
#endif
__kernel void trial(__global number *x) { size_t i = get_global_id(0); x[i] = sqrt(x[i]) + (number)i; }
"""


def _try_device(index: int, platform: Any, device: Any) -> DeviceInfo:
    """Build and run a kernel in float32 and float64: enumeration proves nothing."""
    import pyopencl

    def trial(dtype: Any) -> str:
        try:
            context = pyopencl.Context([device])
            queue = pyopencl.CommandQueue(context)
            x = np.arange(1, 9, dtype=dtype) ** 2
            with quiet():
                program = pyopencl.Program(context, _TRIAL).build([f"-DFP64={int(dtype is np.float64)}"])
            buffer = pyopencl.Buffer(context, pyopencl.mem_flags.COPY_HOST_PTR, hostbuf=x)
            program.trial(queue, x.shape, None, buffer)
            out = np.empty_like(x)
            pyopencl.enqueue_copy(queue, out, buffer)
        except Exception as exc:
            return first_line(exc)
        wanted = np.arange(1, 9) + np.arange(8)
        return "" if np.allclose(out, wanted) else f"a trial kernel gave {out.tolist()}, not {wanted.tolist()}"

    kinds = {pyopencl.device_type.GPU: "gpu", pyopencl.device_type.CPU: "cpu"}
    kind = next((name for flag, name in kinds.items() if device.type & flag), "accelerator")
    why = trial(np.float32)
    fp64 = not why and bool(device.double_fp_config) and not trial(np.float64)
    return DeviceInfo(
        index=index,
        platform=platform.name.strip(),
        name=device.name.strip(),
        kind=kind,
        works=not why,
        why=why,
        fp64=fp64,
        vector_width=8 if kind == "cpu" else 1,
        memory=device.global_mem_size,
        max_alloc=device.max_mem_alloc_size,
        units=device.max_compute_units,
        driver=device.driver_version.strip(),
    )
