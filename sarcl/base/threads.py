"""How many processors computations of this process use, and NumPy on all of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import numpy as np

COPIED = 2**22  # bytes that a thread copies at least: starting it takes about as long
Part = TypeVar("Part")
Made = TypeVar("Made")


def threads() -> int:
    """SARCL_THREADS, or the number of processors this process may use."""
    text = os.environ.get("SARCL_THREADS", "")
    if text and not (text.isdigit() and int(text) > 0):
        raise ValueError(f"SARCL_THREADS is {text!r}; give a whole number of at least 1, or unset it")
    return (
        int(text) if text else len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )


def of_each(function: Callable[[Part], Made], parts: Sequence[Part]) -> list[Made]:
    """The function of each part, in their order, by up to `threads()` threads.

    Starting these takes about 0.2 ms. It pays where the function spends its time in NumPy, with arrays of thousands of
    values, during which other threads run.
    """
    workers = min(threads(), len(parts))
    if workers < 2:
        return [function(part) for part in parts]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(function, parts))


def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Copy an array into another one of its shape; rows of large ones by several threads."""
    parts = min(source.nbytes // COPIED, len(source)) if source.ndim else 1
    if parts < 2 or (parts := min(parts, threads())) < 2:
        target[...] = source
        return
    edges = [len(source) * n // parts for n in range(parts + 1)]

    def copy_rows(n: int) -> None:
        target[edges[n] : edges[n + 1]] = source[edges[n] : edges[n + 1]]

    of_each(copy_rows, range(parts))
