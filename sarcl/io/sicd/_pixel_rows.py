"""Rows of pixels of a SICD file, read when they are asked for. Imported late: it loads NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from numpy.typing import DTypeLike

from ..sarkit_library import FileRows, Reader

NEGLIGIBLE = 1e-12  # of a cycle, by which a frequency misses a whole number of quarters per pixel: rounding


@dataclass(frozen=True, eq=False)
class Phase:
    """What turns pixels of the file into those of an image.

    amplitudes     of AMP8I_PHS8I pixels (256,), or None: they are as they stand
    is_conjugate   Sgn = +1: the phase of a wave falls along its direction
    cycles         of the carrier per row and per column of the file;  origin  row and column where its phase is 0
    """

    amplitudes: np.ndarray | None
    is_conjugate: bool
    cycles: tuple[float, float]
    origin: tuple[float, float]

    @property
    def is_in_quarters(self) -> bool:
        """Whether the carrier turns by quarters of a cycle from pixel to pixel, and from phase 0."""
        return all(
            abs(4 * cycles - np.rint(4 * cycles)) < NEGLIGIBLE and origin == round(origin)
            for cycles, origin in zip(self.cycles, self.origin, strict=True)
        )

    def converted(self, pixels: np.ndarray, first: int) -> np.ndarray:
        """complex64 pixels of rows from `first` on."""
        names = pixels.dtype.names or ()
        if "amp" in names:
            amplitude = pixels["amp"].astype(np.float32)
            if self.amplitudes is not None:
                amplitude = self.amplitudes.astype(np.float32)[pixels["amp"]]
            values = amplitude * np.exp(2j * np.pi / 256 * np.arange(256))[pixels["phase"]]
        elif names:
            values = pixels["real"].astype(np.float32) + 1j * pixels["imag"].astype(np.float32)
        else:
            values = pixels
        if self.is_conjugate:
            values = values.conj()
        rows, columns = (
            cycles * (np.arange(start, start + n) - origin)
            for cycles, origin, start, n in zip(self.cycles, self.origin, (first, 0), values.shape, strict=True)
        )
        if self.is_in_quarters:
            return turned(values.astype(np.complex64), np.rint(4 * rows), np.rint(4 * columns))
        waves = (np.exp(2j * np.pi * (turns - np.rint(turns))) for turns in (rows, columns))
        values = values * next(waves)[:, None] * next(waves)
        return np.ascontiguousarray(values, np.complex64)


def turned(values: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """complex64 values (m, n) times exp(j pi/2 (rows + columns)), whole numbers (m,) and (n,): not rounded."""
    quarters = (rows[:, None] + columns).astype(np.int64) % 4
    if not quarters.any():
        return values
    out = np.array(values)
    for k in (1, 2, 3):
        at = quarters == k
        real, imaginary = values.real[at], values.imag[at]
        out.real[at], out.imag[at] = ((-imaginary, real), (-real, -imaginary), (imaginary, -real))[k - 1]
    return out


class PixelRows(FileRows):
    """Pixels (rows, columns), complex64, the last row of the file first; a slice reads its rows.

    ValueError names a pixel that is not finite.
    """

    dtype = np.dtype(np.complex64)
    ndim = 2

    def __init__(self, reader: Reader, file: IO[bytes], shape: tuple[int, int], phase: Phase) -> None:
        super().__init__(file, "pixels", "dataclasses.replace(image, data=numpy.asarray(image))")
        self._reader, self._phase, self.shape = reader, phase, shape

    def __getitem__(self, index: Any) -> np.ndarray:
        first, rest = (index[0], index[1:]) if isinstance(index, tuple) and index else (index, ())
        if not isinstance(first, slice):
            return np.asarray(np.asarray(self)[index])
        wanted = range(self.shape[0])[first]
        if not wanted:
            return np.empty((0, self.shape[1]), self.dtype)[(slice(None), *rest)]
        low, high = min(wanted), max(wanted) + 1
        rows = self._rows(low, high)[:: wanted.step]
        return np.asarray(rows[(slice(None), *rest)])

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self._rows(0, self.shape[0]), dtype)

    def __len__(self) -> int:
        return self.shape[0]

    def _rows(self, low: int, high: int) -> np.ndarray:
        start, stop = self.shape[0] - high, self.shape[0] - low
        pixels = self._of_file(
            f"rows {start} to {stop - 1}", lambda: self._reader.read_sub_image(start_row=start, stop_row=stop)[0]
        )
        values = self._phase.converted(pixels, start)[::-1]
        if not np.isfinite(values).all():
            row, column = (int(k) for k in np.argwhere(~np.isfinite(values))[0])
            raise ValueError(
                f"{self._name} has the pixel {values[row, column]} in row {stop - 1 - row}, column {column}, wanted a "
                "finite one; read other rows, or have it written with 0 there"
            )
        return values
