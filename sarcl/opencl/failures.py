"""Errors of OpenCL as errors that name the device, the need and the remedy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from ..base.text import first_line, size_text
from . import _after_fork
from .device_list import DeviceInfo


class DeviceFailed(RuntimeError):
    """A device did not do what was asked of it, or is lost; another one may do it."""


def buffer_bytes(args: Iterable[Any]) -> int:
    """Bytes of the buffers among a kernel's arguments."""
    import pyopencl

    return sum(a.size for a in args if isinstance(a, pyopencl.MemoryObject))


@contextmanager
def explained(info: DeviceInfo, what: str, need: int | list[Any] | None = None) -> Iterator[None]:
    """Turn an error of OpenCL into a MemoryError or DeviceFailed.

    what  is asked for
    need  its bytes, or the arguments of a kernel, whose buffers some drivers allocate only then; None: unknown
    """
    import pyopencl

    _after_fork.check()
    try:
        yield
    except pyopencl.MemoryError as exc:
        size = f" of {size_text(need)}" if isinstance(need, int) else ""
        if isinstance(need, list):
            size = f", with buffers of {size_text(buffer_bytes(need))},"
        raise MemoryError(
            f"{what}{size} does not fit on {info.name!r}, which has {size_text(info.memory)} ({first_line(exc)}); "
            "pass a smaller max_bytes=..., or end other programs that use the device"
        ) from exc
    except pyopencl.Error as exc:
        raise DeviceFailed(
            f"{what} failed on {info.name!r} ({info.platform}, driver {info.driver}): {first_line(exc)}; "
            "try another device= (sarcl devices lists them)"
        ) from exc
