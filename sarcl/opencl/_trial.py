"""Trial of a device: small kernels whose results are known. A driver that gets one wrong is never used.

Drivers list devices that build nothing, and some build kernels that compute something else: Mesa 22.3's rusticl passes
wrong structs where a function gets them by pointer, so that path lengths are metres off, and says nothing.
"""

from __future__ import annotations

import contextlib
import hashlib
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import float_pairs
from ..base.text import first_line, size_text
from .programs import build, kernels_of, quiet, source

if TYPE_CHECKING:
    import pyopencl
    from numpy.typing import DTypeLike


FILE = "trial.cl"
N = 64  # numbers and points of the trial
RADIUS, DISTANCE = 500.0, 8e5  # m: points about the scene's centre, and the antenna's distance from it
PULSE = 10  # components of kernels/geometry.clh's pulse without receiver and beam: N_PULSE
LOCAL_MOST = 2**16  # bytes of local memory that are tried, the most that a plan uses
LOCAL_LEAST = 2**12  # bytes; a device with less is taken for one without local memory
GROUP = 256  # most work-items of the groups that are tried
GROUPS = 3
LASTS = 2e-3  # s: a timed launch is made longer until it lasts that
ITEMS, STEPS = 2**18, 2**14  # most work-items, and most steps of each, of a timed launch
CHAINS = 8  # of kernels/trial.cl
GIVEN = np.arange(1, 31, dtype=np.float32) ** 2  # numbers of its struct by value: sums of them are exact
SLOW = 6.0  # a hot loop has a float64 operation for six of float32 that pairs of float32 take more


class Result(NamedTuple):
    """A number that the trial computes: as it is stored, and by how much it may differ.

    rows  1: a float32, or an int32 by its bits; 2: hi and lo float32
    allowed, relative  largest difference, and the same relative to the result; both 0: the bits must agree
    """

    name: str
    rows: int
    allowed: float
    relative: float


WIDE = 16 * 2.0**-48  # the least exact operation of kernels/doubleword.clh without float64 differs by 12 * 2^-48
RESULTS = (
    Result("the float32 sum", 1, 0, 0),
    Result("the rounding error of a float32 sum", 1, 0, 0),
    Result("the float32 product", 1, 0, 0),
    Result("the rounding error of a float32 product, by fma", 1, 0, 0),
    Result("the sum of wide numbers", 2, 0, WIDE),
    Result("the product of wide numbers", 2, 0, WIDE),
    Result("the quotient of wide numbers", 2, 0, WIDE),
    Result("the square root of a wide number", 2, 0, WIDE),
    Result("the whole cycles of a wide number", 1, 0, 0),
    Result("the fraction of a cycle of a wide number", 1, 1e-6, 0),
    Result("the sine of cycles", 1, 1e-5, 0),  # of the fraction above, whose difference it takes times 2 pi
    Result("the cosine of cycles", 1, 1e-5, 0),
    Result("path_difference (m)", 2, 1e-9, 0),
    Result("the distance of path_difference (m)", 2, 0, WIDE),
    Result("the vector of path_difference (m)", 2, 1e-7, 0),
    Result("the sum of the numbers of a struct by value", 1, 0, 0),
    Result("the float32 sum with a product", 1, 0, 0),
    Result("the rounding error of a float32 sum with a product", 1, 0, 0),
)


@dataclass(frozen=True)
class Outcome:
    """What a trial found.

    settled       another trial would find the same: no error was raised, which may have been by chance
    why           what went wrong; empty where the device may be used
    fp64, why64   float64 kernels gave the right numbers; else what went wrong where float64 is offered
    fast_fp64     a float64 operation takes at most SLOW times as long as one in float32
    rate          float32 multiplications with additions per second
    local_memory  bytes of local memory per work-group that were used in the trial
    warp          work-items that run in step, as the compiler says
    """

    settled: bool = True
    why: str = ""
    fp64: bool = False
    why64: str = ""
    fast_fp64: bool = False
    rate: float = 0.0
    local_memory: int = 0
    warp: int = 1


def version() -> str:
    """Name of this trial: it changes with its kernels, their headers and these bounds."""
    import inspect
    import sys

    text = source(FILE) + inspect.getsource(sys.modules[__name__])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def trial(handle: pyopencl.Device, lanes: int, fp64: bool, local_memory: int, max_group: int) -> Outcome:
    """Build and run the trial's kernels on a device as sarcl uses it.

    lanes  per work-item;  fp64, local_memory, max_group  as the driver offers them
    """
    import pyopencl

    try:
        context = pyopencl.Context([handle])  # kept by name: Intel's CPU runtime frees one that only a queue holds
        queue = pyopencl.CommandQueue(context)
        kernels = _built(queue, lanes, 0)
        why = _wrong_numbers(queue, kernels["compute"], lanes)
        if why:
            return Outcome(why=why)
        local, why = _local_memory(queue, kernels["exchange"], local_memory, max_group)
        if why:
            return Outcome(why=why)
        rate, warp = _rate(queue, kernels["chains"], lanes, np.float32), _warp(handle, kernels["compute"])
    except Exception as exc:
        return Outcome(settled=False, why=first_line(exc))
    passed = Outcome(rate=rate, local_memory=local, warp=warp)
    if not fp64:
        return passed
    try:
        kernels = _built(queue, lanes, 1)
        why = _wrong_numbers(queue, kernels["compute"], lanes)
        # vectors of a CPU have half as many lanes in float64: what is timed there is what else runs
        fast = not why and (lanes > 1 or SLOW * _rate(queue, kernels["chains"], lanes, np.float64) >= rate)
    except Exception as exc:
        return replace(passed, settled=False, why64=first_line(exc))
    return replace(passed, fp64=not why, why64=why, fast_fp64=fast)


def _built(queue: pyopencl.CommandQueue, lanes: int, fp64: int) -> dict[str, Any]:
    with quiet():
        program = build(queue.context, source(FILE), [f"-DVW={lanes}", f"-DFP64={fp64}", f"-DNUMBER64={fp64}"])
    return kernels_of(program)


def _given() -> tuple[np.ndarray, np.ndarray]:
    """What the kernel `compute` gets: x (10, N) and antenna (2, PULSE) float32."""
    random = np.random.default_rng(18)
    a, b = (random.uniform(1, 2, N) * 10.0 ** random.integers(-3, 8, N) for _ in range(2))
    points = float_pairs.wide(random.uniform(-RADIUS, RADIUS, (3, N)))
    antenna = np.zeros(PULSE)
    antenna[:3] = np.array([0.6, -0.3, 0.74]) * DISTANCE
    hi, lo = float_pairs.wide(antenna)
    exact = hi[:3].astype(np.longdouble) + lo[:3]
    hi[3], lo[3] = float_pairs.wide(np.sqrt(exact @ exact))
    return np.concatenate([float_pairs.wide(a), float_pairs.wide(b), *points]), np.stack([hi, lo])


def wanted(x: np.ndarray, antenna: np.ndarray) -> list[np.ndarray]:
    """The RESULTS of the kernel `compute`, in extended precision; those whose bits must agree as float32 or int32."""
    high, other = x[0], x[2]
    product = high * other
    a, b = (x[i].astype(np.longdouble) + x[i + 1] for i in (0, 2))
    integer = np.rint(a)
    angle = 2 * np.pi * (a - integer)
    points, at = x[4:7].astype(np.longdouble) + x[7:], antenna[0, :3].astype(np.longdouble) + antenna[1, :3]
    vector = at[:, None] - points
    distance, length = np.sqrt((vector**2).sum(axis=0)), np.sqrt((at**2).sum())
    return [
        *float_pairs.exact_sum(high, other), product, (high.astype(np.float64) * other - product).astype(np.float32),
        a + b, a * b, a / b, np.sqrt(a),
        integer.astype(np.int64).astype(np.int32), a - integer, np.sin(angle), np.cos(angle),
        ((points**2).sum(axis=0) - 2 * at @ points) / (distance + length), distance, vector[1],
        np.full(N, np.arange(1, len(GIVEN) + 1) @ GIVEN, np.float32),
        *float_pairs.exact_sum(product, other),
    ]  # fmt: skip


def _wrong_numbers(queue: pyopencl.CommandQueue, kernel: pyopencl.Kernel, lanes: int) -> str:
    """Run `compute`: which of the RESULTS is wrong and by how much, or nothing."""
    import pyopencl

    x, antenna = _given()
    flags = pyopencl.mem_flags.COPY_HOST_PTR
    buffers = [pyopencl.Buffer(queue.context, flags, hostbuf=np.ascontiguousarray(v)) for v in (x, antenna)]
    rows = np.full((sum(r.rows for r in RESULTS), N), np.nan, np.float32)
    out = pyopencl.Buffer(queue.context, flags, hostbuf=rows)
    kernel(queue, (N // lanes,), None, *buffers, np.int32(N), GIVEN, out)
    pyopencl.enqueue_copy(queue, rows, out)
    at = 0
    for result, right in zip(RESULTS, wanted(x, antenna), strict=True):
        why = compared(result, rows[at : at + result.rows], right)
        if why:
            return why
        at += result.rows
    return ""


def compared(result: Result, rows: np.ndarray, right: np.ndarray) -> str:
    """What is wrong with the rows (result.rows, N) of a result, or nothing."""
    if right.dtype == np.int32:
        got = rows[0].view(np.int32).astype(np.float64)
    else:
        got = rows.astype(np.longdouble).sum(axis=0)
    difference = np.abs(got - right)
    worst = int(np.argmax(np.where(np.isnan(difference), np.inf, difference - result.relative * np.abs(right))))
    bound = result.allowed + result.relative * abs(right[worst])
    if difference[worst] <= bound:
        return ""
    return (
        f"a trial kernel computes wrong numbers: {result.name} is {got[worst]:.9g}, not {right[worst]:.9g}, "
        f"a difference of {difference[worst]:.2g} where {bound:.2g} is allowed"
    )


def _local_memory(queue: pyopencl.CommandQueue, kernel: Any, offered: int, max_group: int) -> tuple[int, str]:
    """Bytes of local memory that the kernel `exchange` runs with, and what it gets wrong with them, or nothing.

    A driver may refuse what it offers. Many keep a few bytes of it for themselves (NVIDIA 16): a little less is tried
    first, then half as much, down to LOCAL_LEAST.
    """
    import pyopencl

    info = pyopencl.kernel_work_group_info.WORK_GROUP_SIZE
    group = min(GROUP, max_group, kernel.get_work_group_info(info, queue.device))
    row = 4 * group
    local = most = min(offered, LOCAL_MOST) // row * row
    while local >= LOCAL_LEAST:
        each = local // row
        numbers = np.zeros((each, GROUPS, group), np.int32)
        try:
            out = pyopencl.Buffer(queue.context, pyopencl.mem_flags.READ_WRITE, numbers.nbytes)
            shared = pyopencl.LocalMemory(local)
            kernel(queue, (GROUPS * group,), (group,), np.int32(each), shared, out)
            pyopencl.enqueue_copy(queue, numbers, out)
        except pyopencl.Error:
            local = most - row if local == most else local // 2 // row * row
            continue
        right = np.arange(numbers.size).reshape(numbers.shape)[..., ::-1]
        if np.array_equal(numbers, right):
            return local, ""
        return 0, (
            f"a trial kernel reads wrong numbers: {size_text(local)} of local memory, shared by {group} work-items "
            f"past a barrier, hold {np.count_nonzero(numbers != right)} wrong of {numbers.size}"
        )
    return 0, ""


def _rate(queue: pyopencl.CommandQueue, kernel: pyopencl.Kernel, lanes: int, dtype: DTypeLike) -> float:
    """Multiplications with additions per second in `chains`: the best of three launches of LASTS seconds or more."""
    import pyopencl

    items, steps, out = 2**10, 1, None
    while True:
        if out is None:
            out = pyopencl.Buffer(
                queue.context, pyopencl.mem_flags.READ_WRITE, items * lanes * np.dtype(dtype).itemsize
            )
        seconds = []
        for _ in range(3):
            queue.finish()
            start = time.perf_counter()
            kernel(queue, (items,), None, np.int32(steps), np.float32(0.999), np.float32(1e-3), out)
            queue.finish()
            seconds.append(time.perf_counter() - start)
        if min(seconds) >= LASTS or steps >= STEPS:
            return float(items * lanes * CHAINS * steps / max(min(seconds), 1e-9))
        if items < ITEMS:
            items, out = 4 * items, None
        steps *= 4


def _warp(handle: pyopencl.Device, kernel: Any) -> int:
    """Work-items that run in step, as the compiler of a kernel says."""
    import pyopencl

    with contextlib.suppress(pyopencl.Error):
        info = pyopencl.kernel_work_group_info.PREFERRED_WORK_GROUP_SIZE_MULTIPLE
        return max(1, int(kernel.get_work_group_info(info, handle)))
    return 1
