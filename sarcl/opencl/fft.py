"""One FFT of rows: reikna on GPUs; on CPU devices that of SciPy, where reikna is 3 to 20 times slower."""

from __future__ import annotations

import atexit
import functools
import importlib.util
import threading
import time
from collections.abc import Callable
from importlib.machinery import PathFinder
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.threads import threads
from ._launches import LASTS, lasted
from .device import Device
from .programs import quiet

if TYPE_CHECKING:
    from numpy.typing import DTypeLike

    from .device import Buffer


# Multiplications with additions, at the speed of a device's trial, in whose time a launch takes a sample on: an FFT
# waits for memory, so this is many times what it computes. Launches that take longer make the next batches smaller.
SAMPLE = 200.0

_turns = threading.Lock()  # a plan's kernels get their arguments before they are enqueued: one thread at a time
_slow: dict[Device, float] = {}  # samples of a batch whose launches last LASTS, of devices whose launches lasted longer


@functools.lru_cache(maxsize=4096)
def good_length(n: int) -> int:
    """Smallest length >= n whose FFT is fast (factors 2, 3, 5, 7 and 11)."""
    odd = [1]
    for factor in (3, 5, 7, 11):
        powers = [factor**k for k in range(n.bit_length())]
        odd = [one * power for one in odd for power in powers if one * power < 2 * n]
    return min(one << (-(-n // one) - 1).bit_length() for one in odd)


def rows(
    device: Device | None,
    data: np.ndarray,
    *,
    inverse: bool = False,
    overwrite: bool = False,
) -> np.ndarray:
    """FFT of every row of complex (n, m) `data`, not normalised in either direction; the type is kept.

    device  by `reikna_rows` where it transforms rows of this length (`on_device`); else, and None: on the host
    overwrite  `data` may be changed, and the result may lie there
    """
    if device is not None and on_device(device, data.shape[1], data.dtype):
        return reikna_rows(device, data, inverse)
    return _scipy_transform()(data, (1,), not inverse, 0, data if overwrite else None, threads())


@functools.cache
def _scipy_transform() -> Callable[..., np.ndarray]:
    """c2c(data, axes, forward, norm, out, threads) of SciPy's extension, with the bits of scipy.fft.

    The extension is loaded by itself: importing scipy.fft imports scipy.special, 0.2 s of processor time. A SciPy that
    keeps it elsewhere gives scipy.fft.
    """
    try:
        scipy: Any = importlib.util.find_spec("scipy")
        spec: Any = PathFinder.find_spec("pypocketfft", [str(Path(scipy.origin).parent / "fft" / "_pocketfft")])
        extension: Any = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(extension)
        return extension.c2c
    except (AttributeError, ImportError, TypeError):
        from scipy.fft import fft, ifft

        def transform(
            data: np.ndarray, axes: tuple[int], forward: bool, norm: int, out: np.ndarray | None, workers: int
        ) -> np.ndarray:
            options = {"axis": axes[0], "workers": workers, "overwrite_x": out is not None}
            return np.asarray(fft(data, **options) if forward else ifft(data, norm="forward", **options))

        return transform


def on_device(device: Device, length: int, dtype: DTypeLike) -> bool:
    """Whether `rows` of this length and complex type are transformed on the device, and not on the host.

    Of complex128 rows of a power of two alone: of other lengths the error is 1e-16 times the length (9e-12 at 98 304).
    """
    double = device.info.fp64 and length & (length - 1) == 0
    return not device.is_cpu and (dtype == np.complex64 or double)


def in_place(device: Device, buffer: Buffer, shape: tuple[int, int], dtype: DTypeLike) -> None:
    """Enqueue the FFT of every row of a buffer of `shape`, complex64 or complex128, not normalised, in its place.

    Where `on_device`. The first call for a shape builds programs; a plan holds `temporary_bytes` for each row.
    """
    with _turns:
        thread, compiled = compiled_plan(device, shape, np.dtype(dtype).char)
        rows = thread.array(shape, np.dtype(dtype), base=buffer)
        compiled(rows, rows)


def temporary_bytes(length: int, dtype: DTypeLike) -> int:
    """Bytes per row, at most, that `in_place` takes on the device beside the row itself."""
    power = 1 << (length - 1).bit_length()
    longest = power if power == length else 2 * power  # other lengths are convolved with a chirp, in powers of two
    return 2 * longest * np.dtype(dtype).itemsize


def rows_at_once(device: Device, length: int) -> int:
    """Rows of a batch on a device, whose launches are short (_launches.LASTS) by the speed that was measured."""
    most = device.limits.transform
    samples = min(most, LASTS * device.info.rate / SAMPLE, _slow.get(device, most))
    return max(1, int(samples) // length)


def reikna_rows(device: Device, data: np.ndarray, inverse: bool) -> np.ndarray:
    """The FFT in batches of one size, for which one program is built; the last batch is filled with what was there."""
    data, out = np.ascontiguousarray(data), np.empty(data.shape, data.dtype)
    n, length = data.shape
    start, buffer, shape = 0, None, (0, length)
    while start < n:
        most = min(n, rows_at_once(device, length))
        if most != shape[0]:
            shape, buffer = (most, length), None
            buffer = device.empty(most * length * data.itemsize)
        part = slice(start, start + most)
        device.write(buffer, data[part])
        with _turns:
            thread, compiled = compiled_plan(device, shape, data.dtype.char)
            rows = thread.array(shape, data.dtype, base=buffer)
            enqueued = time.perf_counter()
            launches = compiled(rows, rows, inverse)
        device.download(buffer, out[part])
        seconds = max(lasted(launch, enqueued) for launch in launches)
        if seconds > LASTS:
            _slow[device] = most * length * LASTS / seconds
        start += most
    if inverse:
        out *= data.real.dtype.type(length)
    return out


@functools.lru_cache(maxsize=16)
def compiled_plan(device: Device, shape: tuple[int, ...], kind: str) -> tuple[Any, Any]:
    """Thread and compiled FFT of reikna for batches of this shape and type (`kind`: NumPy's character of it)."""
    from reikna.cluda import ocl_api
    from reikna.core import Type
    from reikna.fft import FFT

    # plans hold buffers that must go before the interpreter takes down what frees them
    atexit.register(compiled_plan.cache_clear)
    thread = ocl_api().Thread(device.queue)
    with quiet():
        return thread, FFT(Type(np.dtype(kind), shape), axes=(1,)).compile(thread)
