"""OpenCL devices of this machine, tried with a small kernel before they are used: drivers list devices that fail."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.text import first_line
from . import _after_fork, _cache_folder, _queries, _trial_record
from ._programs import quiet

NOT_TRIED = "not tried"


@dataclass(frozen=True)
class DeviceInfo:
    """One OpenCL device.

    index, platform, name, kind   as the driver lists them; kind is "gpu", "cpu" or "accelerator"
    works, why                    True when a trial kernel built and gave the right numbers, else the reason
    fp64                          a float64 kernel built and gave the right numbers
    vector_width                  lanes per work-item: 1 on GPUs, 8 on CPUs
    memory, max_alloc             bytes of the device and of its largest buffer
    units, driver                 compute units; driver version
    local_memory                  bytes of local memory per work-group
    max_group                     most work-items of a work-group; a kernel may allow fewer (Device.max_group)
    warp                          work-items that run in step: a warp of NVIDIA, a wave of AMD; 1 on CPUs
    fast_fp64                     fp64, and a float64 operation takes at most 6 times as long as one in float32
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
    local_memory: int
    max_group: int
    warp: int
    fast_fp64: bool


def devices() -> tuple[DeviceInfo, ...]:
    """Every OpenCL device of this machine with the result of its trial; empty where there is no OpenCL platform.

    A trial that succeeds is recorded in the user's cache folder (sarcl/devices.json) with the versions of driver and
    platform; later processes do not repeat it. A device whose trial fails, in float32 or in the float64 that it offers,
    is tried again in each process, and `sarcl devices` tries every device again.
    """
    return tuple(tried(info.index) for info, _ in listed())


def tried_again() -> tuple[DeviceInfo, ...]:
    """`devices()` after a new trial of every device, whatever is recorded."""
    _trial_record.clear()
    tried.cache_clear()
    return devices()


def listed() -> tuple[tuple[DeviceInfo, Any], ...]:
    """Every device of every platform before its trial (works is False), with pyopencl's handle."""
    _after_fork.check()
    _cache_folder.prepare()
    return _listed()


@functools.cache
def _listed() -> tuple[tuple[DeviceInfo, Any], ...]:
    found: list[tuple[DeviceInfo, Any]] = []
    for platform, _, handles in _queries.platforms():
        for handle in handles:
            facts = _queries.facts(handle)._asdict()
            facts["why"] = facts["why"] or NOT_TRIED
            info = DeviceInfo(index=len(found), platform=platform, works=False, fp64=False, fast_fp64=False, **facts)
            found.append((info, handle))
    return tuple(found)


@functools.cache
def tried(index: int) -> DeviceInfo:
    """Device `index` with the result of its trial: the recorded one, or that of a trial now."""
    info, handle = listed()[index]
    if info.why != NOT_TRIED:
        return info
    fp64 = _trial_record.find(key := _key(info, handle))
    if fp64 is None:
        why = _trial(handle, np.float32)
        if why:
            return replace(info, why=why)
        offered = bool(_queries.asked(handle, "double_fp_config"))
        fp64 = offered and not _trial(handle, np.float64)
        if fp64 == offered:  # a trial in float64 may have failed by chance: the next process repeats it
            _trial_record.keep(key, fp64)
    return replace(info, works=True, why="", fp64=fp64, fast_fp64=fp64 and info.kind == "cpu")


def _key(info: DeviceInfo, handle: Any) -> str:
    """What the result of a trial depends on: the device, both versions and the kernel of the trial."""
    kernel = hashlib.sha256(_TRIAL.encode()).hexdigest()[:16]
    version = _queries.text_of(_queries.asked(handle, "platform"), "version")
    return f"{info.index} {info.name}, driver {info.driver}, {info.platform} {version}, trial {kernel}"


_TRIAL = """
#if FP64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
typedef double number;
#else
typedef float number;
#endif
__kernel void trial(__global number *x) { size_t i = get_global_id(0); x[i] = sqrt(x[i]) + (number)i; }
"""


def _trial(handle: Any, dtype: Any) -> str:
    """Build and run a kernel on numbers of `dtype`: what went wrong, or nothing."""
    import pyopencl

    try:
        context = pyopencl.Context([handle])
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
