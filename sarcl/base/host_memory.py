"""Memory of the host: how much there is, and arrays that go to temporary files where they would take too much of it."""

from __future__ import annotations

import ctypes
import os
import shutil
import tempfile
from typing import TYPE_CHECKING

from .text import size_text

if TYPE_CHECKING:
    import numpy as np

LEAST_RELEASED = 2**23  # bytes of blocks: small images, of 0.1 s, do not pay for a release, of 1 ms or more
LEAST_WRITTEN = 2**20  # bytes of blocks that are written to files, which takes longer than a release


def installed() -> float:
    """Bytes of memory of this machine, inf where it is not known."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return float("inf")


def release(nbytes: float, least: float = LEAST_RELEASED) -> None:
    """Give memory that was freed back to the system, where the C library keeps it (glibc): blocks of another size would
    come on top of it, up to two thirds as much again.

    nbytes  bytes of the blocks that are computed now; below `least` nothing happens
    """
    if nbytes >= least and os.name == "posix":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


def zeros(shape: tuple[int, ...], limit: float, what: str) -> np.ndarray:
    """Zeros, complex64: in memory up to `limit` bytes, else in a temporary file that vanishes with the array.

    MemoryError with the bytes that `what` needs, where the folder of temporary files has no room.
    """
    import numpy as np

    nbytes = 8.0 * float(np.prod(shape, dtype=np.float64))
    if nbytes <= limit:
        return np.zeros(shape, np.complex64)
    folder = tempfile.gettempdir()
    free = shutil.disk_usage(folder).free
    if nbytes > free:
        raise MemoryError(
            f"{what} need {size_text(nbytes)}; {size_text(limit)} of memory are allowed for them, and {folder} has "
            f"{size_text(free)} left: raise max_bytes, or set TMPDIR to a folder with room"
        )
    with tempfile.TemporaryFile() as file:  # the map keeps the file after it is closed
        return np.memmap(file, np.complex64, "w+", shape=shape)
