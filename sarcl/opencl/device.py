"""OpenCL devices that passed a trial build, the choice among them, programs built once, buffers, memory budget.

The only importer of pyopencl; reikna is imported here and in fft.py.
"""

from __future__ import annotations

import functools
import os
import re
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ..base.text import size_text
from ..base.validation import number

REMEDY = "On Debian or Ubuntu: sudo apt-get install -y pocl-opencl-icd"

GROUP = 16  # work-items of a group on a CPU, or 1, where a kernel does not care
STALE = 5.0  # s, after which a lock on the cache of binaries is nobody's


class NoDeviceError(RuntimeError):
    """No OpenCL device fits: none works, or none matches what was asked for."""


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
    return tuple(info for info, _ in _probe())


@functools.cache
def _probe() -> tuple[tuple[DeviceInfo, Any], ...]:
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
            return _first_line(exc)
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


def open_device(choice: DeviceChoice | None = None) -> Device:
    """The device to use: `choice`, else SARCL_DEVICE, else the GPU with most compute units, else a CPU.

    choice  a Device (returned as it is), an index, "cpu", "gpu", or any part of a platform's or device's name.
    SARCL_DEVICE may name several, for `backproject` ("all", or "0,1"): here the first of them that works.
    NoDeviceError lists what there is when nothing works or nothing matches. Never asks.
    """
    if isinstance(choice, Device):
        return choice
    source = "device"
    if choice is None:
        choice, source = os.environ.get("SARCL_DEVICE") or None, "SARCL_DEVICE"
    working = [(info, raw) for info, raw in _probe() if info.works]
    if not working:
        raise NoDeviceError(f"no OpenCL device could build a kernel. Found: {_listing()}. {REMEDY}")
    if choice is not None and not (source == "SARCL_DEVICE" and str(choice).strip().lower() == "all"):
        names = [n for n in str(choice).split(",") if n.strip()] if source == "SARCL_DEVICE" else [choice]
        each = ([(i, raw) for i, raw in working if _matches(i, name)] for name in names)
        matching = next((found for found in each if found), [])
        if not matching:
            raise NoDeviceError(f"{source} {choice!r} matches no working OpenCL device. Found: {_listing()}")
        working = matching
    order = {"gpu": 0, "accelerator": 1, "cpu": 2}
    best = min((i for i, _ in working), key=lambda i: (order[i.kind], -i.units, i.index))
    return _open(best.index)


def _matches(info: DeviceInfo, choice: Any) -> bool:
    text = str(choice).strip().lower()
    if text.isdigit():
        return info.index == int(text)
    return text == info.kind or text in f"{info.platform} {info.name}".lower()


def _listing() -> str:
    infos = devices()
    if not infos:
        return "no OpenCL platform at all"
    return "; ".join(f"{i.index}: {i.name} ({i.platform}{'' if i.works else ': ' + i.why})" for i in infos)


def threads() -> int:
    """SARCL_THREADS, or the number of processors this process may use."""
    text = os.environ.get("SARCL_THREADS", "")
    if text and not (text.isdigit() and int(text) > 0):
        raise ValueError(f"SARCL_THREADS is {text!r}; give a whole number of at least 1, or unset it")
    return (
        int(text) if text else len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )


@functools.cache
def _open(index: int) -> Device:
    info, raw = _probe()[index]
    return Device(info, raw)


class Device:
    """An open device: context, queue, programs and buffers. Get one from `open_device`.

    info.fp64 chooses the wide number type of every kernel built here; `without_fp64()` gives a twin that uses
    pairs of float32, to run (or test) what a device without float64 runs.
    """

    def __init__(self, info: DeviceInfo, raw: Any) -> None:
        import pyopencl

        self.info = info
        self._raw = raw
        if info.kind == "cpu" and threads() < info.units and os.environ.get("SARCL_THREADS"):
            try:
                raw = raw.create_sub_devices([pyopencl.device_partition_property.BY_COUNTS, threads()])[0]
            except pyopencl.Error as exc:
                raise RuntimeError(
                    f"{info.name} cannot be limited to SARCL_THREADS={threads()} ({_first_line(exc)}); unset it"
                ) from None
        with self._explain("a context"):
            self.context = pyopencl.Context([raw])
            self.queue = pyopencl.CommandQueue(self.context, raw)
        self._kernels: dict[tuple[Any, ...], dict[str, Any]] = {}

    @property
    def is_cpu(self) -> bool:
        """True where buffers can stand in the host's memory."""
        return self.info.kind == "cpu"

    def without_fp64(self) -> Device:
        """The same device, its kernels built without float64."""
        return _twin(self, fp64=False)

    def one_lane(self) -> Device:
        """The same device, its kernels built with one lane a work-item, as GPUs run them."""
        return _twin(self, vector_width=1)

    def kernel(self, file: str, name: str, **macros: int) -> Any:
        """Kernel `name` of kernels/`file`, built once for each set of integer macros."""
        macros = {"VW": self.info.vector_width, "FP64": int(self.info.fp64), **macros}
        key = (file, *sorted(macros.items()))
        if key not in self._kernels:
            self._kernels[key] = self._build(file, macros)
        return self._kernels[key][name]

    def _build(self, file: str, macros: dict[str, int]) -> dict[str, Any]:
        import pyopencl

        options = [f"-D{k}={int(v)}" for k, v in sorted(macros.items())]
        try:
            with quiet():
                program = pyopencl.Program(self.context, source(file)).build(options)
        except pyopencl.Error as exc:
            raise RuntimeError(
                f"kernels/{file} does not build on {self.info.name!r} ({self.info.driver}) with {' '.join(options)}: "
                f"{str(exc).strip()[:2000]}\nChoose another device (sarcl devices) and report this message"
            ) from exc
        return {k.function_name: k for k in program.all_kernels()}

    def upload(self, array: np.ndarray) -> Any:
        """A read-only buffer with the contents of `array`; on CPUs it shares the array's memory."""
        import pyopencl

        array = np.ascontiguousarray(array)
        memory = pyopencl.mem_flags
        flags = memory.READ_ONLY | (memory.USE_HOST_PTR if self.is_cpu else memory.COPY_HOST_PTR)
        self._check_size(array.nbytes)
        with self._explain("a buffer", array.nbytes):
            return pyopencl.Buffer(self.context, flags, hostbuf=array)

    def zeros(self, nbytes: int) -> Any:
        """A buffer of `nbytes` zero bytes."""
        import pyopencl

        buffer = self.empty(nbytes)
        with self._explain("a buffer", nbytes):
            pyopencl.enqueue_fill_buffer(self.queue, buffer, np.zeros(1, np.uint8), 0, nbytes)
        return buffer

    def empty(self, nbytes: int) -> Any:
        """A buffer of `nbytes` bytes of no particular value."""
        import pyopencl

        self._check_size(nbytes)
        with self._explain("a buffer", nbytes):
            return pyopencl.Buffer(self.context, pyopencl.mem_flags.READ_WRITE, nbytes)

    def download(self, buffer: Any, out: np.ndarray, offset: int = 0) -> np.ndarray:
        """Copy a buffer, from byte `offset` on, into `out` and return it."""
        import pyopencl

        with self._explain("a copy", out.nbytes):
            pyopencl.enqueue_copy(self.queue, out, buffer, src_offset=offset)
        return out

    def run(self, kernel: Any, size: tuple[int, ...], group: tuple[int, ...] | None, *args: Any) -> None:
        """Enqueue a kernel; Python ints become int32, buffers and numpy scalars go as they are.

        group None: the driver's choice, on CPUs one of two sizes: PoCL builds a kernel anew for every size of group.
        """
        if group is None and self.is_cpu:
            group = (1 if size[0] % GROUP else GROUP, *(1 for _ in size[1:]))
        with self._explain(f"kernel {kernel.function_name}"):
            kernel(self.queue, size, group, *(np.int32(a) if isinstance(a, int) else a for a in args))

    def finish(self) -> None:
        """Wait until everything enqueued is done."""
        with self._explain("running"):
            self.queue.finish()

    def max_group(self, kernel: Any) -> int:
        """Most work-items of `kernel` in one group."""
        import pyopencl

        return int(kernel.get_work_group_info(pyopencl.kernel_work_group_info.WORK_GROUP_SIZE, self.queue.device))

    def reikna_thread(self) -> Any:
        """reikna's handle on this device's queue."""
        from reikna.cluda import ocl_api

        return ocl_api().Thread(self.queue)

    def _check_size(self, nbytes: int) -> None:
        if nbytes > self.info.max_alloc:
            raise MemoryError(
                f"a block needs {size_text(nbytes)}, {self.info.name!r} allows {size_text(self.info.max_alloc)} "
                "per buffer; pass a smaller max_bytes=..."
            )

    @contextmanager
    def _explain(self, what: str, nbytes: int = 0) -> Iterator[None]:
        """Turn an OpenCL error into one that names the device, the need and the remedy."""
        import pyopencl

        try:
            yield
        except pyopencl.MemoryError as exc:
            raise MemoryError(
                f"{what} of {size_text(nbytes)} does not fit on {self.info.name!r}, which has "
                f"{size_text(self.info.memory)} ({_first_line(exc)}); pass a smaller max_bytes=..."
            ) from exc
        except pyopencl.Error as exc:
            raise RuntimeError(
                f"{what} failed on {self.info.name!r} ({self.info.platform}, driver {self.info.driver}): "
                f"{_first_line(exc)}; try another device= (sarcl devices lists them)"
            ) from exc


DeviceChoice = Device | int | str  # what `open_device` takes, or None: its own choice


@functools.cache
def _twin(device: Device, **changes: Any) -> Device:
    return Device(replace(device.info, **changes), device._raw)


@functools.cache
def source(file: str) -> str:
    """A kernel file with its #include lines expanded on the host: -I is not portable and breaks on spaces.

    Each header is included once; #line keeps compilers' messages pointing at the real files.
    """
    seen: set[str] = set()

    def expand(name: str) -> str:
        seen.add(name)
        out = [f'#line 1 "{name}"']
        for n, line in enumerate(files("sarcl.kernels").joinpath(name).read_text().splitlines(), 1):
            match = re.match(r'\s*#include "([^"]+)"', line)
            if match and match[1] not in seen:
                out += [expand(match[1]), f'#line {n + 1} "{name}"']
            elif not match:
                out.append(line)
        return "\n".join(out)

    return expand(file)


def _first_line(exc: BaseException) -> str:
    text = str(exc).strip()
    return text.splitlines()[0][:200] if text else type(exc).__name__


@contextmanager
def quiet() -> Iterator[None]:
    """Round every build. Compilers that succeed may still chat; that is not for the user."""
    _drop_stale_lock()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _drop_stale_lock() -> None:
    """Remove the lock that a killed process has left on pyopencl's cache of binaries.

    pyopencl holds it for milliseconds, but waits a minute for one that nobody holds, and then fails.
    """
    import platformdirs

    for lock in Path(platformdirs.user_cache_dir("pyopencl", "pyopencl")).glob("pyopencl-compiler-cache-*/lock"):
        try:
            if time.time() - lock.stat().st_mtime > STALE:
                lock.unlink()
        except OSError:  # gone already, or somebody else's
            pass


def open_devices(choice: Any) -> list[Device]:
    """The devices `choice` stands for: one as `open_device` takes it, a list of such, or "all" that work.

    "0,1" is a list too, as SARCL_DEVICE may hold it. ValueError for a device named twice.
    """
    choices = listed(choice)
    if not choices:
        raise ValueError("device is an empty list; name at least one, or leave it out")
    opened = [open_device(c) for c in choices]
    for i, device in enumerate(opened):
        if device in opened[:i]:
            twice = choices[opened.index(device)]
            raise ValueError(f"device {choices[i]!r} and {twice!r} are both {device.info.name}; name it once")
    return opened


def listed(choice: Any) -> list[Any]:
    """The devices `choice` names, each as `open_device` takes it."""
    if choice is None:
        choice = os.environ.get("SARCL_DEVICE") or None
    if isinstance(choice, str) and choice.strip().lower() == "all":
        return [info.index for info in devices() if info.works] or [None]
    if isinstance(choice, str) and "," in choice:
        return [name.strip() for name in choice.split(",") if name.strip()]
    return list(choice) if isinstance(choice, (list, tuple)) else [choice]


CPU_BYTES = 2**30  # default memory for blocks on a CPU, which shares it with everything else


def budget(device: Device, max_bytes: float | None) -> float:
    """Bytes for blocks on the device: max_bytes, or the default. ValueError below 1 MB."""
    if max_bytes is None:
        return min(CPU_BYTES, device.info.memory / 2) if device.is_cpu else device.info.memory / 2
    return number("max_bytes", max_bytes, least=1e6)
