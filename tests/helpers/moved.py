"""Bytes that a computation moves between the host and a device, and the most that its buffers take there."""

from __future__ import annotations

import weakref
from contextlib import contextmanager
from types import SimpleNamespace
from unittest import mock

from sarcl.opencl.device import Device


@contextmanager
def moved_bytes():
    """Context whose value has the bytes moved so far: `up`, to the device, and `down`.

    On a CPU that stands in for a GPU copies are counted as a GPU would make them.
    """
    moved = SimpleNamespace(up=0, down=0)

    def counted(name, direction, size):
        method = getattr(Device, name)

        def call(self, *given):
            setattr(moved, direction, getattr(moved, direction) + size(*given))
            return method(self, *given)

        return mock.patch.object(Device, name, call)

    with (
        counted("upload", "up", lambda array: array.nbytes),
        counted("write", "up", lambda buffer, values: values.nbytes),
        counted("write_behind", "up", lambda queue, buffer, values: values.nbytes),
        counted("download", "down", lambda buffer, out, *offset: out.nbytes),
    ):
        yield moved


@contextmanager
def held_bytes(monkeypatch):
    """Context whose value has the most bytes on the device at a time, `most`."""
    import pyopencl

    held, now, whole = SimpleNamespace(most=0), [0], pyopencl.Buffer

    class Buffer(whole):
        def __init__(self, context, flags, size=0, hostbuf=None):
            super().__init__(context, flags, size, hostbuf)
            if not flags & pyopencl.mem_flags.ALLOC_HOST_PTR:  # memory of the host
                nbytes = self.size
                now[0] += nbytes
                held.most = max(held.most, now[0])
                weakref.finalize(self, lambda: now.__setitem__(0, now[0] - nbytes))

    with monkeypatch.context() as patch:
        patch.setattr(pyopencl, "Buffer", Buffer)
        yield held
