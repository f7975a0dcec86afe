"""An open device: its programs, each built once, its buffers and its queue."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import host_memory
from ..base.text import first_line, size_text
from ..base.threads import threads
from ._host_arrays import HostArrays, PageLocked, copy_in_pieces
from ._launches import Launches, fixed_axes, in_groups
from .device_list import DeviceInfo
from .failures import buffer_bytes, explained
from .programs import build, kernels_of, names_in, quiet, source

if TYPE_CHECKING:
    import pyopencl
    from pyopencl import Buffer as Buffer  # returned by upload, zeros and empty
    from pyopencl import Kernel as Kernel
else:
    Buffer = Kernel = Any  # in annotations alone: pyopencl is loaded with the first device

GROUP = 16  # work-items per group of large launches on a CPU (1 where the size does not divide by it)
LARGE = 4096  # work-items of a launch for which groups of 1 take 35 us longer; building a kernel for both takes 0.2 s


@dataclass(frozen=True)
class Limits:
    """Sizes of what a device does at a time.

    upload     bytes of samples that go up at a time to a GPU: it computes with these while the host uploads as many
    download   bytes of an array that leave a GPU at a time through page-locked memory, while the host copies as many
    transform  most samples of a batch of FFTs: they fill a GPU, and larger ones gain nothing
    launches   of a kernel, after which pyopencl is told the types of its numbers. A launch of a struct and 16 buffers
               then takes 23 us of processor time instead of 33 us; telling takes 0.4 ms
    """

    upload: int = 2**26
    download: int = 2**25
    transform: int = 2**22
    launches: int = 20


class Device:
    """An open device: context, queue, programs and buffers. choose_device.open_device gives one.

    info.fast_fp64 chooses the wide number type of every kernel built here: float64, or pairs of float32 where those are
    faster. `without_fp64()` gives a twin that has only pairs, to run (or test) what a device without float64 runs.
    Several threads may use a device: launches take turns, as a kernel's arguments are set before it is enqueued.
    """

    def __init__(self, info: DeviceInfo, raw: Any, limits: Limits = Limits()) -> None:
        import pyopencl

        self.info, self.limits = info, limits
        self._raw, self._cl = raw, pyopencl
        if info.kind == "cpu" and threads() < info.units and os.environ.get("SARCL_THREADS"):
            try:
                raw = raw.create_sub_devices([self._cl.device_partition_property.BY_COUNTS, threads()])[0]
            except self._cl.Error as exc:
                raise RuntimeError(
                    f"{info.name} cannot be limited to SARCL_THREADS={threads()} ({first_line(exc)}); unset it"
                ) from None
        with explained(self.info, "a context"):
            self.context = self._cl.Context([raw])
            self.queue = self._timed_queue(raw)
        self._kernels: dict[tuple[Any, ...], dict[str, Any]] = {}
        self._counts: dict[Any, int] = {}  # launches of each kernel
        self._fixed: dict[Any, frozenset[int]] = {}  # axes of each kernel along which it must not be cut
        self._launches, self._arrays, self._lock = Launches(), HostArrays(), threading.RLock()
        self._page_locked = PageLocked(4 * limits.upload)
        self._last = ""  # kernel that was launched last and the bytes of its buffers, as text: not on CPUs

    def _timed_queue(self, raw: pyopencl.Device) -> pyopencl.CommandQueue:
        """The queue of commands; on devices other than CPUs with a clock for launches, where the driver has one."""
        if not self.is_cpu:
            with suppress(self._cl.Error):
                clock = self._cl.command_queue_properties.PROFILING_ENABLE
                return self._cl.CommandQueue(self.context, raw, properties=clock)
        return self._cl.CommandQueue(self.context, raw)

    @property
    def is_cpu(self) -> bool:
        """True for CPU devices, whose buffers share the host's memory."""
        return self.info.kind == "cpu"

    @property
    def bounds_registers(self) -> bool:
        """Whether the macro REGISTERS of a kernel bounds the registers of a work-item: NVIDIA's driver does so, where a
        kernel does not require the size of its groups."""
        return self.info.platform.startswith("NVIDIA")

    def without_fp64(self) -> Device:
        """The same device, its kernels built without float64."""
        return _twin(self, fp64=False, fast_fp64=False)

    def one_lane(self) -> Device:
        """The same device, its kernels built with one lane per work-item, as GPUs run them."""
        return _twin(self, vector_width=1)

    def kernel(self, file: str, name: str, **macros: int) -> pyopencl.Kernel:
        """Kernel `name` of kernels/`file`, built once for each set of integer macros."""
        wide = self.info.fp64 and self.info.fast_fp64
        macros = {"VW": self.info.vector_width, "FP64": int(wide), **macros}
        key = (file, *sorted(macros.items()))
        with self._lock:
            if key not in self._kernels:
                self._kernels[key] = self._build(file, macros)
            return self._kernels[key][name]

    def _build(self, file: str, macros: dict[str, int]) -> dict[str, Any]:
        text = source(file)
        # a macro that the code does not name would only make the driver's cache hold the same binary twice
        options = [f"-D{k}={int(v)}" for k, v in sorted(macros.items()) if k in names_in(text)]
        if macros.get("REGISTERS"):
            options.append(f"-cl-nv-maxrregcount={macros['REGISTERS']}")
        try:
            with quiet():
                program = build(self.context, text, options)
        except self._cl.Error as exc:
            raise RuntimeError(
                f"kernels/{file} does not build on {self.info.name!r} ({self.info.driver}) with {' '.join(options)}: "
                f"{str(exc).strip()[:2000]}\nChoose another device (sarcl devices) and report this message"
            ) from exc
        made = kernels_of(program)
        self._fixed |= dict.fromkeys(made.values(), fixed_axes(text))
        return made

    def upload(self, array: np.ndarray) -> Buffer:
        """A read-only buffer with the contents of `array`, which must not change while the buffer is used.

        On CPUs it shares the array's memory, and the device keeps the array until the kernels that read it have ended.
        """
        array = np.ascontiguousarray(array)
        self._check_size(array.nbytes)
        with explained(self.info, "a buffer", array.nbytes):
            if self.is_cpu:
                return self._arrays.shared(self.context, array)
            memory = self._cl.mem_flags
            return self._cl.Buffer(self.context, memory.READ_ONLY | memory.COPY_HOST_PTR, hostbuf=array)

    def output(self, array: np.ndarray) -> Buffer:
        """A buffer of the size of a contiguous `array`, for `download` to it: on CPUs it shares the array's memory."""
        if not self.is_cpu:
            return self.empty(array.nbytes)
        self._check_size(array.nbytes)
        with explained(self.info, "a buffer", array.nbytes):
            return self._arrays.shared(self.context, array, writable=True)

    def copied(self, array: np.ndarray) -> Buffer:
        """A buffer with a copy of `array`, which may change at once, and which kernels may write to."""
        buffer = self.empty(array.nbytes)
        self.write(buffer, array)
        return buffer

    def zeros(self, nbytes: int) -> Buffer:
        """A buffer of `nbytes` zero bytes."""
        buffer = self.empty(nbytes)
        with explained(self.info, "a buffer", nbytes):
            # some drivers fill with one byte at a time; the size must be a multiple of the pattern's
            pattern = np.zeros(next(n for n in (16, 4, 1) if nbytes % n == 0), np.uint8)
            self._cl.enqueue_fill_buffer(self.queue, buffer, pattern, 0, nbytes)
        return buffer

    def empty(self, nbytes: int) -> Buffer:
        """A buffer of `nbytes` bytes, not initialised."""
        self._check_size(nbytes)
        with explained(self.info, "a buffer", nbytes):
            return self._cl.Buffer(self.context, self._cl.mem_flags.READ_WRITE, nbytes)

    def release(self, nbytes: float, least: float = host_memory.LEAST_RELEASED) -> None:
        """Before blocks of so many bytes: on CPUs, what was freed goes back to the system (host_memory.release)."""
        if self.is_cpu:
            host_memory.release(nbytes, least)

    def write(self, buffer: Any, values: np.ndarray) -> None:
        """Copy `values` into a buffer, from its beginning on."""
        with explained(self.info, "a copy", values.nbytes):
            self._cl.enqueue_copy(self.queue, buffer, np.ascontiguousarray(values))

    def another_queue(self) -> pyopencl.CommandQueue:
        """A queue of commands beside the device's own, for `write_behind`."""
        with explained(self.info, "a queue"):
            return self._cl.CommandQueue(self.context, self.queue.device)

    def page_locked(self, queue: pyopencl.CommandQueue, nbytes: int) -> np.ndarray:
        """Memory of the host, uint8, of nbytes or more, from which the driver copies without the processor's help."""
        return self._page_locked.take(nbytes, functools.partial(self._lock_pages, queue))

    def give_back(self, memory: np.ndarray) -> None:
        """Memory of `page_locked` that nothing reads or writes any more may be used again."""
        self._page_locked.give_back(memory)

    def _lock_pages(self, queue: pyopencl.CommandQueue, nbytes: int) -> np.ndarray:
        memory = self._cl.mem_flags
        with explained(self.info, "page-locked memory", nbytes):
            buffer = self._cl.Buffer(self.context, memory.READ_WRITE | memory.ALLOC_HOST_PTR, nbytes)
            both: Any = self._cl.map_flags.READ | self._cl.map_flags.WRITE
            return np.asarray(self._cl.enqueue_map_buffer(queue, buffer, both, 0, (nbytes,), np.dtype(np.uint8))[0])

    def write_behind(self, queue: pyopencl.CommandQueue, buffer: pyopencl.Buffer, values: np.ndarray) -> pyopencl.Event:
        """Copy `values` into a buffer on a queue of `another_queue`, while the device's own queue goes on.

        Returns at once an event that ends with the copy. What is enqueued on the device after this call waits for it.
        The event keeps `values`; an event that is dropped is waited for.
        """
        with explained(self.info, "a copy", values.nbytes):
            copied = self._cl.enqueue_copy(queue, buffer, values, is_blocking=False)
            queue.flush()
            self._cl.enqueue_barrier(self.queue, wait_for=[copied])
            return copied

    def mark(self) -> pyopencl.Event:
        """An event that ends with everything enqueued so far, which begins to run now."""
        with explained(self.info, "running"):
            event = self._cl.enqueue_marker(self.queue)
            self.queue.flush()
            return event

    def wait(self, event: pyopencl.Event) -> None:
        """Wait for an event of `mark`."""
        with explained(self.info, "running"):
            event.wait()

    def download(self, buffer: Any, out: np.ndarray, offset: int = 0) -> np.ndarray:
        """Copy a buffer, from byte `offset` on, into `out` and return it."""
        with self._lock:  # whatever is counted is enqueued
            enqueued = self._arrays.enqueued
        with explained(self.info, "a copy", out.nbytes):
            if getattr(buffer, "array", None) is out:  # of `output`: the driver puts the contents where they belong
                read, byte = self._cl.map_flags.READ, np.dtype(np.uint8)
                mapped, _ = self._cl.enqueue_map_buffer(self.queue, buffer, read, offset, (out.nbytes,), byte)
                mapped.base.release()
            elif not self._download_in_pieces(buffer, out, offset):
                self._cl.enqueue_copy(self.queue, out, buffer, src_offset=offset)
        self._ended(enqueued)
        return out

    def _download_in_pieces(self, buffer: Buffer, out: np.ndarray, offset: int) -> bool:
        """`download` through page-locked memory; False where that does not pay, or the driver gives none."""
        if self.is_cpu or out.nbytes <= self.limits.download or not out.flags.c_contiguous:
            return False
        pieces: list[np.ndarray] = []
        try:
            for _ in range(2):
                pieces.append(self.page_locked(self.queue, self.limits.download))
        except MemoryError:
            for memory in pieces:
                self.give_back(memory)
            return False

        def fill(piece: np.ndarray, first: int) -> pyopencl.Event:
            event = self._cl.enqueue_copy(self.queue, piece, buffer, src_offset=offset + first, is_blocking=False)
            self.queue.flush()
            return event

        copy_in_pieces(fill, [memory[: self.limits.download] for memory in pieces], out.reshape(-1).view(np.uint8))
        for memory in pieces:
            self.give_back(memory)
        return True

    def run(
        self, kernel: Any, size: tuple[int, ...], group: tuple[int, ...] | None, *args: Any, steps: float = 1
    ) -> None:
        """Enqueue a kernel; Python ints become int32, buffers and numpy scalars go as they are.

        group None: the driver chooses; on CPUs it is 1, from LARGE work-items on GROUP: PoCL builds for each size anew
        steps  about how many steps the longest loop of a work-item has: on devices other than CPUs a launch is cut into
               parts of 0.2 s (_launches.py), by the time per work-item and step of those before
        """
        if group is None and self.is_cpu:
            group = (GROUP if prod(size) >= LARGE and size[0] % GROUP == 0 else 1, *(1 for _ in size[1:]))
        arguments = [np.int32(a) if isinstance(a, int) else a for a in args]
        with explained(self.info, f"kernel {kernel.function_name}", arguments), self._lock:
            count = self._counts[kernel] = self._counts.get(kernel, 0) + 1
            if count == 1 and kernel.num_args != len(arguments):  # some drivers end the process
                raise TypeError(f"{kernel.function_name} takes {kernel.num_args} arguments, not {len(arguments)}")
            if count == self.limits.launches:
                kernel.set_scalar_arg_dtypes([_type_of(a) for a in arguments])
            self._arrays.enqueued += 1
            if self.is_cpu:
                kernel(self.queue, size, group, *arguments)
                return
            need = size_text(buffer_bytes(arguments))
            self._last = f"kernel {kernel.function_name} or those before it, with buffers of {need},"

            def enqueue(first: int, size: tuple[int, ...], offset: tuple[int, ...] | None) -> pyopencl.Event:
                if first:
                    at, *others = offset or (0,) * len(size)
                    offset = (first + at, *others)
                return kernel(self.queue, size, group, *arguments, global_offset=offset)

            fixed = self._fixed.get(kernel, frozenset(range(len(size))))
            for first, n in in_groups(size, group, fixed):
                launched = kernel, (n, *size[1:]), group, fixed, float(steps), functools.partial(enqueue, first)
                self._launches.launch(*launched, self.queue.flush)

    def finish(self) -> None:
        """Wait until everything enqueued is done."""
        with self._lock:  # whatever is counted is enqueued
            enqueued = self._arrays.enqueued
        # some drivers allocate buffers when they are used first, and say only here that they do not fit
        with explained(self.info, self._last or "running"):
            self.queue.finish()
        self._ended(enqueued)

    def _ended(self, enqueued: int) -> None:
        """So many launches have ended."""
        with self._lock:
            self._arrays.finished(enqueued)

    def max_group(self, kernel: pyopencl.Kernel) -> int:
        """Most work-items of `kernel` in one group."""
        return int(kernel.get_work_group_info(self._cl.kernel_work_group_info.WORK_GROUP_SIZE, self.queue.device))

    def shares(self, nbytes: int, items: int) -> bool:
        """Whether kernels in which so many work-items share so many bytes of local memory are the better ones.

        Never on CPU devices: there a work-item keeps its sums in a cache.
        """
        return not self.is_cpu and self.info.local_memory >= nbytes and self.info.max_group >= items

    def _check_size(self, nbytes: int) -> None:
        if nbytes > self.info.max_alloc:
            raise MemoryError(
                f"a block needs {size_text(nbytes)}, {self.info.name!r} allows {size_text(self.info.max_alloc)} "
                "per buffer; pass a smaller max_bytes=..."
            )


def _type_of(argument: Any) -> np.dtype | None:
    """The type of a number, or of a struct of `launch_numbers`; None for a buffer or a table."""
    by_value = isinstance(argument, np.generic) or (isinstance(argument, np.ndarray) and argument.dtype.names)
    return argument.dtype if by_value else None


DeviceChoice = Device | int | str  # what `open_device` takes, or None: its own choice


_opening = threading.RLock()


def once(make: Callable[..., Device]) -> Callable[..., Device]:
    """`make` with its results kept: several threads that ask for one device get one."""
    kept = functools.cache(make)

    @functools.wraps(make)
    def found(*args: object, **options: object) -> Device:
        with _opening:
            return kept(*args, **options)

    return found


@once
def _twin(device: Device, **changes: Any) -> Device:
    return Device(replace(device.info, **changes), device._raw, device.limits)
