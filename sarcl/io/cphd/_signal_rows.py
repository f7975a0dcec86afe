"""Rows of the signal arrays of a CPHD file, read when they are asked for. Imported late: it loads NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import IO

import numpy as np

from ..sarkit_library import FileRows, Reader
from . import _domains


@dataclass(frozen=True, eq=False)
class Conversion:
    """What turns samples of a channel into those of a phase history; arrays have one entry per row.

    is_conjugate    the phase of a return rises with frequency, SGN = +1
    amplitude       AmpSF, or 1
    frequency, frequency_step   of the FX samples, Hz
    advance         s: delay of the new reference after that of the file
    toa             of TOA samples: SC0 and SCSS, s, and FX2 - FX1, Hz; None: FX samples
    """

    is_conjugate: bool
    amplitude: np.ndarray
    frequency: np.ndarray
    frequency_step: np.ndarray
    advance: np.ndarray
    toa: tuple[np.ndarray, np.ndarray, np.ndarray] | None

    def converted(self, samples: np.ndarray, rows: slice, n: int) -> np.ndarray:
        """FX samples (k, n), complex64, relative to the new reference, of k rows of the file."""
        if self.is_conjugate:
            samples = samples.conj()
        if self.toa is not None:
            first, step, bandwidth = (values[rows] for values in self.toa)
            samples = _domains.spectra(samples, first, step, bandwidth, n)
        if self.advance[rows].any():
            frequency = self.frequency[rows, None] + np.arange(n) * self.frequency_step[rows, None]
            cycles = frequency * self.advance[rows, None]
            samples = samples * np.exp(2j * np.pi * (cycles - np.rint(cycles)))
        if (self.amplitude[rows] != 1).any():
            samples = samples * self.amplitude[rows, None]
        return samples.astype(np.complex64)


class VectorRows(FileRows):
    """Samples (n_rows, n), complex64, of the rows of one channel; a slice reads its rows.

    filename  of the file, where it is one on a disk
    """

    dtype = np.dtype(np.complex64)

    def __init__(self, file: IO[bytes], channel: str, vectors: np.ndarray, n: int) -> None:
        """vectors  of each row, increasing;  n  samples of a row"""
        super().__init__(file, "samples", "dataclasses.replace(raw, samples=raw.read(0, raw.n_rows))")
        self._name_of_channel, self._vectors = channel, vectors
        self.shape = (len(vectors), n)
        name = getattr(file, "name", None)
        self.filename = name if isinstance(name, str) and self._stamp is not None else None

    def __getitem__(self, rows: slice) -> np.ndarray:
        start, stop, _ = rows.indices(self.shape[0])
        if stop <= start:
            return np.empty((0, self.shape[1]), self.dtype)
        vectors = self._vectors[start:stop]
        first, last = int(vectors[0]), int(vectors[-1])
        samples = self._of_file(
            f"vectors {first} to {last} of channel {self._name_of_channel!r}", lambda: self._read(first, last + 1)
        )
        if len(vectors) < len(samples):  # some have no signal
            samples = samples[vectors - first]
        if samples.dtype.names:  # pairs of integers
            samples = samples["real"].astype(np.float32) + 1j * samples["imag"].astype(np.float32)
        return self._converted(samples, slice(start, stop))

    def _read(self, low: int, high: int) -> np.ndarray:
        """Samples of vectors low ... high - 1 as the file has them."""
        raise NotImplementedError

    def _converted(self, samples: np.ndarray, rows: slice) -> np.ndarray:
        """The samples (k, n), complex64, of k rows, from numbers in the file."""
        raise NotImplementedError


class SignalRows(VectorRows):
    """FX samples of one channel of a CPHD file."""

    def __init__(
        self, reader: Reader, file: IO[bytes], channel: str, vectors: np.ndarray, how: Conversion, n: int
    ) -> None:
        """reader  sarkit's, of the open file;  n  frequencies of a row"""
        super().__init__(file, channel, vectors, n)
        self._reader, self._how = reader, how

    def _read(self, low: int, high: int) -> np.ndarray:
        return np.asarray(self._reader.read_signal(self._name_of_channel, start_vector=low, stop_vector=high))

    def _converted(self, samples: np.ndarray, rows: slice) -> np.ndarray:
        return self._how.converted(samples, rows, self.shape[1])
