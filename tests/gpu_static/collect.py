"""Which programs sarcl's plans build for a GPU: plans are made, and run on a device of paper.

The device of paper computes nothing. It records each program that would be built, and the sizes of each launch; every
number that is read back from it is 1. Its own sine and cosine have the error of NVIDIA's. So tasks take the time of the
host's part alone, and no OpenCL driver is needed.
"""

from __future__ import annotations

import os
import re
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from types import MappingProxyType, SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np

from sarcl import ToleranceMissed, ToleranceUnreachable
from sarcl.opencl import choose_device, fft, native_functions
from sarcl.opencl.device import Device, Limits, PageLocked
from sarcl.opencl.device_list import DeviceInfo
from sarcl.opencl.launch_numbers import struct_layout
from sarcl.opencl.native_functions import sincos_error
from sarcl.opencl.programs import names_in, source
from sarcl.visibility import lit_parts

KERNEL = re.compile(r"__kernel\s+(?:__attribute__\(\(.*?\)\)\s+)?void\s+(\w+)\s*\(")
PAPER = DeviceInfo(
    index=0, platform="paper", name="GPU of paper", kind="gpu", works=True, why="", fp64=True, vector_width=1,
    memory=16 * 2**30, max_alloc=4 * 2**30, units=132, driver="none", local_memory=48 * 1024, max_group=256, warp=32,
    fast_fp64=True,
    rate=1e13,
    pci="",
)  # fmt: skip
NATIVE_ERROR = 5.3e-7  # rad, of sine and cosine: measured on an H100 (bench/results/gpu/h100.json)
WITHOUT_FP64 = replace(PAPER, fp64=False, fast_fp64=False)


@dataclass(frozen=True, order=True)
class Variant:
    """A program: a file of kernels/, and the macros that the file names, by name."""

    file: str
    macros: tuple[tuple[str, int], ...]

    @property
    def name(self) -> str:
        """File and macros, as figures and messages name the variant."""
        return " ".join([self.file, *(f"{name}={value}" for name, value in self.macros)])

    @classmethod
    def named(cls, name: str) -> Variant:
        """The variant of a name."""
        file, *macros = name.split()
        return cls(file, tuple(sorted((k, int(v)) for k, v in (macro.split("=") for macro in macros))))


class Enough(Exception):
    """The launch that a task is wanted up to."""


@dataclass
class Use:
    """What plans do with a variant: tasks that build it, and the launches of each kernel.

    groups  work-items per group of each kernel; 0 where the driver chooses
    """

    tasks: list[str] = field(default_factory=list)
    groups: dict[str, set[int]] = field(default_factory=dict)


def numbers_of(file: str, text: str, kernel: str) -> np.dtype | None:
    """The type of the struct that a kernel takes its numbers in; None for a kernel that takes each by its place."""
    found = re.search(rf"void\s+{kernel}\s*\(\s*(\w+_numbers) given\b", text)
    return found and struct_layout(file, found[1])


def kernels_in(text: str) -> list[str]:
    """Names of the kernels in source text."""
    return KERNEL.findall(text)


class PaperDevice(Device):
    """A GPU that records programs and launches in `found`, and computes nothing.

    AssertionError: a launch whose numbers are not the struct that its kernel takes.
    """

    def __init__(self, info: DeviceInfo, found: dict[Variant, Use]) -> None:
        self.info, self.limits, self.found, self.task, self.until = info, Limits(), found, "", ""
        self._raw = self.context = self.queue = None
        self._kernels: dict[tuple[Any, ...], dict[str, Any]] = {}
        self._lock, self._page_locked = threading.RLock(), PageLocked(4 * self.limits.upload)

    def begin(self, task: str, until: str = "") -> None:
        """Name the task that the programs built from now on are for, and the beginning of the last kernel's name."""
        self.task, self.until = task, until
        self._kernels.clear()

    def _build(self, file: str, macros: dict[str, int]) -> dict[str, Any]:
        text = source(file)
        known = names_in(text)
        variant = Variant(file, tuple(sorted((k, int(v)) for k, v in macros.items() if k in known)))
        use = self.found.setdefault(variant, Use())
        use.tasks.append(self.task)
        return {
            name: SimpleNamespace(function_name=name, use=use, numbers=numbers_of(file, text, name))
            for name in kernels_in(text)
        }

    def upload(self, array: np.ndarray) -> Any:
        return self.empty(array.nbytes)

    def zeros(self, nbytes: int) -> Any:
        return self.empty(nbytes)

    def empty(self, nbytes: int) -> Any:
        self._check_size(nbytes)
        return SimpleNamespace(size=nbytes)

    def write(self, buffer: Any, values: np.ndarray) -> None:
        pass

    def another_queue(self) -> Any:
        return None

    def _lock_pages(self, queue: Any, nbytes: int) -> np.ndarray:
        return np.zeros(nbytes, np.uint8)

    def write_behind(self, queue: Any, buffer: Any, values: np.ndarray) -> Any:
        return None

    def mark(self) -> Any:
        return None

    def wait(self, event: Any) -> None:
        pass

    def download(self, buffer: Any, out: np.ndarray, offset: int = 0) -> np.ndarray:
        out[...] = 1
        return out

    def run(
        self, kernel: Any, size: tuple[int, ...], group: tuple[int, ...] | None, *args: Any, **options: Any
    ) -> None:
        given = args[0].dtype if isinstance(args[0], np.ndarray) and args[0].dtype.names else None
        assert given == kernel.numbers, f"{kernel.function_name} takes {kernel.numbers} first, not {given}"
        items = 0 if group is None else int(np.prod(group))
        kernel.use.groups.setdefault(kernel.function_name, set()).add(items)
        if self.until and kernel.function_name.startswith(self.until):
            raise Enough

    def finish(self) -> None:
        pass

    @property
    def bounds_registers(self) -> bool:
        """As NVIDIA's driver."""
        return True

    def max_group(self, kernel: Any) -> int:
        return self.info.max_group


@contextmanager
def on_paper(device: PaperDevice) -> Iterator[None]:
    """Context in which sarcl finds one device, which is made of paper."""
    with (
        mock.patch.object(choose_device, "listed", lambda: ((device.info, None),)),
        mock.patch.object(choose_device, "tried", lambda index: device.info),
        mock.patch.object(choose_device, "devices", lambda: (device.info,)),
        mock.patch.object(choose_device, "open_listed", lambda index: device),
        mock.patch.object(lit_parts, "with_float64", lambda chosen: chosen),  # another device's work on a real machine
        mock.patch.object(fft, "reikna_rows", lambda device, data, inverse: data),
        mock.patch.object(fft, "in_place", lambda device, buffer, shape, dtype: None),
        mock.patch.object(native_functions, "sincos_error", lambda device: (sincos_error(device), NATIVE_ERROR)[1]),
        mock.patch.dict(os.environ),
        warnings.catch_warnings(),
        np.errstate(all="ignore"),
    ):
        os.environ.pop("SARCL_DEVICE", None)
        warnings.simplefilter("ignore")
        yield


def collected(
    tasks: Mapping[str, Callable[[], Any]], info: DeviceInfo = PAPER, until: Mapping[str, str] = MappingProxyType({})
) -> dict[Variant, Use]:
    """Variants that tasks build on a GPU as `info` describes it, and what they do with them.

    until  {beginning of the names of tasks: beginning of the name of the kernel whose first launch ends them}

    Tasks that no plan can do without float64 are passed over where the GPU has none. RuntimeError names tasks that fail
    for another reason than that numbers of paper miss a tolerance.
    """
    found: dict[Variant, Use] = {}
    device = PaperDevice(info, found)
    failed = []
    with on_paper(device):
        for name, task in tasks.items():
            device.begin(name, next((kernel for first, kernel in until.items() if name.startswith(first)), ""))
            try:
                task()
            except (ToleranceMissed, Enough):
                pass
            except Exception as exc:
                if isinstance(exc, ToleranceUnreachable) and not info.fp64:
                    continue
                failed.append(f"{name!r}: {type(exc).__name__}: {str(exc)[:300]}")
    if failed:
        raise RuntimeError(
            "tasks whose plans are wanted failed on a device that computes nothing; leave out what cannot run there "
            "(tests/gpu_static/tasks.py), or mend PaperDevice (tests/gpu_static/collect.py):\n" + "\n".join(failed[:10])
        )
    return found
