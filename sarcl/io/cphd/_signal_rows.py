"""Rows of the signal arrays of a CPHD file, read when they are asked for. Imported late: it loads NumPy."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import IO, NoReturn

import numpy as np

from ..sarkit_library import Reader, stamp
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
        if samples.dtype.names:  # pairs of integers
            samples = samples["real"].astype(np.float32) + 1j * samples["imag"].astype(np.float32)
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


class SignalRows:
    """FX samples (n_rows, n_samples), complex64, of one channel; a slice reads its rows.

    filename  of the file, where it is one on a disk
    OSError where the file has changed since it was opened, or ends too early.
    """

    dtype = np.dtype(np.complex64)

    def __init__(
        self, reader: Reader, file: IO[bytes], channel: str, vectors: np.ndarray, how: Conversion, n: int
    ) -> None:
        """reader  sarkit's, of the open file;  vectors  of each row, increasing;  n  frequencies of a row"""
        self._reader, self._file, self._channel, self._vectors, self._how = reader, file, channel, vectors, how
        self.shape = (len(vectors), n)
        self._lock, self._stamp = threading.Lock(), stamp(file)
        name = getattr(file, "name", None)
        self.filename = name if isinstance(name, str) and self._stamp is not None else None

    def __getitem__(self, rows: slice) -> np.ndarray:
        start, stop, _ = rows.indices(self.shape[0])
        if stop <= start:
            return np.empty((0, self.shape[1]), self.dtype)
        vectors = self._vectors[start:stop]
        first = int(vectors[0])
        with self._lock:
            self._check()
            try:
                samples = self._reader.read_signal(self._channel, start_vector=first, stop_vector=int(vectors[-1]) + 1)
            except Exception as exc:  # of the library and of file objects, which fail in many ways
                raise OSError(
                    f"{self._name} cannot be read at vectors {first} to {int(vectors[-1])} of channel "
                    f"{self._channel!r} ({exc}); it is truncated, or was closed: copy it again, or open it again"
                ) from exc
            self._check()
        if len(vectors) < len(samples):  # some have no signal
            samples = samples[vectors - first]
        return self._how.converted(samples, slice(start, stop), self.shape[1])

    def __reduce__(self) -> NoReturn:
        """Refused: copy, pickle and multiprocessing cannot hand an open file on."""
        raise TypeError(
            f"the samples are rows of the open file {self._name}, which cannot be copied or sent to another process: "
            "read the file there, sarcl.read(path), or take them into memory first, such as "
            "dataclasses.replace(raw, samples=raw.read(0, raw.n_rows))"
        )

    @property
    def _name(self) -> str:
        return repr(getattr(self._file, "name", "the file object"))

    def _check(self) -> None:
        if stamp(self._file) != self._stamp:
            raise OSError(f"{self._name} has changed since it was opened; read it again with sarcl.read")
