"""The division of a result in bands, and what computes a run of them."""

from __future__ import annotations

import mmap
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol, Self

import numpy as np
from numpy.typing import DTypeLike

from ..base.stage_timer import Clock
from ..base.threads import threads
from ..opencl.device import Device

LEAST_BYTES = 2**24  # of new rows whose memory a thread asks for: below, it takes longer to start one
PAGES_BYTES = 2**26  # of new rows per thread, at least: the system clears them in about 20 ms

Run = tuple[int, int]  # bands first ... last - 1


class FlatArray(Protocol):
    """Rows of a result, in the order of its bands: an array, a dataset of a file, or a BandBuffer."""

    def __getitem__(self, rows: slice, /) -> np.ndarray: ...

    def __setitem__(self, at: slice | tuple[slice, slice], block: np.ndarray, /) -> None: ...


@contextmanager
def pages_in_use(device: Device, flat: FlatArray, rows: slice) -> Iterator[None]:
    """Context for the work of a GPU whose values go to some rows of a new array afterwards.

    The system finds memory for a page when it is first used, and clears it. Threads use each page, so that the copy
    from the device does not wait for them one after another.
    """
    users: list[threading.Thread] = []
    if isinstance(flat, np.ndarray) and not isinstance(flat, np.memmap) and not device.is_cpu:
        block = flat[rows]
        if block.flags.c_contiguous and block.nbytes >= LEAST_BYTES:
            one_of_each = block.reshape(-1).view(np.uint8)[:: mmap.PAGESIZE]
            # half of the processors: the others copy samples
            for pages in np.array_split(one_of_each, max(1, min(threads() // 2, block.nbytes // PAGES_BYTES))):
                users.append(threading.Thread(target=np.bitwise_or, args=(pages, 0, pages)))  # keeps every value
                users[-1].start()
    try:
        yield
    finally:
        for user in users:
            user.join()


class Bands(Protocol):
    """A result divided in bands of consecutive rows.

    Fixed by the task alone, so that results do not depend on how many bands are computed at once.

    row_shape  shape of one row of the flat array
    """

    @property
    def n_bands(self) -> int:
        """Number of bands."""

    @property
    def row_shape(self) -> tuple[int, ...]:
        """Shape of one row of the flat array."""

    def extent(self, first: int, last: int) -> slice:
        """Rows of bands first ... last - 1 in the flat array."""

    def count(self, first: int, last: int) -> int:
        """Size of bands first ... last - 1 in units of work: pixels of an image, pulses of echoes."""


class Tally(Protocol):
    """What is known of a block besides its values: a dataclass of plain values, empty by default, that adds up."""

    def __add__(self, other: Self, /) -> Self: ...


class Engine(Protocol):
    """What computes bands of one result on one device.

    least  units of work that a block should have at least, so that the work which every block repeats stays below a
           tenth; inf: blocks are as large as memory allows, and a killed run loses as much
    most   units of work that a block may have at most, where its values are held in memory
    """

    @property
    def least(self) -> float:
        """Units of work of a block, at least."""

    @property
    def most(self) -> float:
        """Units of work of a block in memory, at most."""

    def blocks(self, nbytes: float) -> list[Run]:
        """Runs of bands that together are all, each to be filled with nbytes on the device.

        MemoryError where nbytes is too little for anything.
        """

    def fill(
        self, first: int, last: int, flat: FlatArray, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> Tally:
        """Write the values of bands first ... last - 1 to their rows in `flat`.

        budget       bytes on the device, all in all
        on_progress  called with the number of passes over these bands that are done, of BlockJob.passes
        """


class Recipe(Protocol):
    """How the engine of a result is made on a device: it can be pickled."""

    def on(self, device: Device) -> Engine:
        """The engine on one device."""

    def budget(self, device: Device) -> float:
        """Bytes that blocks may take on a device."""


class BandBuffer:
    """Buffer for the values of some bands, indexed like the flat array, where there is no memory for all of them."""

    def __init__(self, bands: Bands, first: int, last: int, dtype: DTypeLike) -> None:
        extent = bands.extent(first, last)
        self.start = extent.start
        self.values = np.empty((extent.stop - extent.start, *bands.row_shape), dtype)

    def __getitem__(self, rows: slice) -> np.ndarray:
        return self.values[rows.start - self.start : rows.stop - self.start]

    def __setitem__(self, at: slice | tuple[slice, slice], block: np.ndarray) -> None:
        rows, *rest = at if isinstance(at, tuple) else (at,)
        self.values[(slice(rows.start - self.start, rows.stop - self.start), *rest)] = block
