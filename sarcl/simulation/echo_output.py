"""Destination of the samples of echoes, block of pulses by block: memory, or an HDF5 file of sarcl's."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from ..base import host_memory
from ..base.text import size_text
from ..base.types import PathLike
from ..base.validation import sealed
from ..blocks.bands import FlatArray
from ..io import formats
from ..io.sarcl_hdf5 import ROW_BYTES
from ..model import store
from ..model.phase_history import PhaseHistory

log = logging.getLogger(__name__)
COPIES = 3  # of the rows' geometry, while a PhaseHistory is made of it: 320 bytes per row were measured
SHARE = 0.25  # of max_bytes, for samples that are about to be written to a file


def bytes_of(shape: tuple[int, ...]) -> float:
    """Bytes of samples (n_pulses, ..., n_samples), and of the geometry of their rows."""
    return float(np.prod(shape[:-1], dtype=float)) * (8.0 * shape[-1] + ROW_BYTES)


def pulses_at_once(shape: tuple[int, ...], out: object, budget: float) -> int:
    """Pulses whose samples are kept in memory together, of an output to memory or to the file `out`."""
    return shape[0] if out is None else max(1, int(SHARE * budget / (8.0 * np.prod(shape[1:], dtype=float))))


class EchoOutput:
    """Samples (n_pulses, ..., n_samples), complex64; a row is the last axis.

    out  the file they are written to, or None: memory. Its size is logged before the computation starts.
    MemoryError gives the bytes that they would take; for a file, the errors of `output_paths.check_writable`.
    """

    def __init__(
        self, shape: tuple[int, ...], out: PathLike | None, budget: float, window: tuple[float, float]
    ) -> None:
        self.shape, self.writer, self.whole = shape, None, np.zeros(0, np.complex64)
        self.a_pulse = int(np.prod(shape[1:-1], dtype=np.int64))
        self.pulses = pulses_at_once(shape, out, budget)
        n_rows = shape[0] * self.a_pulse
        nbytes = 8.0 * n_rows * shape[-1]
        text = f"{n_rows} rows of {shape[-1]} samples: {size_text(nbytes)}"
        log.info("echoes of %d pulses, %s", shape[0], text + f", and {size_text(n_rows * ROW_BYTES)} of geometry")
        geometry, room = float(COPIES * n_rows * ROW_BYTES), host_memory.installed()
        if geometry > room:
            raise MemoryError(
                f"echoes of {shape[0]} pulses are {n_rows} rows, whose geometry alone takes {size_text(geometry)} of "
                f"the {size_text(room)} of memory here; split the track, or take channels='simultaneous' for arrays: "
                "carriers differ in their frequencies"
            )
        if out is not None:
            functions = formats.writer_functions(out, "phase history")
            self.writer = functions.EchoWriter(out, n_rows, shape[-1], resumes=True)
            return
        try:
            self.whole = np.zeros(shape, np.complex64)
        except (MemoryError, ValueError):
            raise MemoryError(
                f"echoes of {shape[0]} pulses, {text}, do not fit in memory; write them to a file "
                f"(out=...), narrow range_window (now {window[0]:g} to {window[1]:g} m), or split the track"
            ) from None

    @property
    def flat(self) -> FlatArray:
        """The samples (n_rows, n_samples)."""
        return self.whole.reshape(-1, self.shape[-1]) if self.writer is None else self.writer.samples

    def block(self, start: int, stop: int) -> np.ndarray:
        """Zeros for the samples of some pulses, to be filled and given to `keep`."""
        if self.writer is not None:
            return np.zeros((stop - start, *self.shape[1:]), np.complex64)
        self.whole[start:stop] = 0
        return self.whole[start:stop]

    def keep(self, start: int, block: np.ndarray) -> None:
        """Store a block that is filled."""
        if self.writer is not None:
            rows = block.reshape(-1, self.shape[-1])
            self.writer.samples[start * self.a_pulse : start * self.a_pulse + len(rows)] = rows

    def keep_frequencies(self, first: int, block: np.ndarray) -> None:
        """Store the samples of all pulses at some frequencies, (n_pulses, ..., n), from index `first` on."""
        at = slice(first, first + block.shape[-1])
        if self.writer is None:
            self.whole[..., at] = block
        else:
            self.writer.samples[:, at] = block.reshape(-1, block.shape[-1])

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, pulse: int) -> np.ndarray:
        """Samples of one pulse."""
        if self.writer is None:
            return self.whole[pulse]
        rows = self.writer.samples[pulse * self.a_pulse : (pulse + 1) * self.a_pulse]
        return np.asarray(rows).reshape(self.shape[1:])

    def finish(self, job: str | None = None, **fields: Any) -> PhaseHistory:
        """The PhaseHistory of these samples and the other fields; a file gets the fingerprint of its job."""
        if self.writer is not None:
            if job is not None:
                self.writer.mark(job)
            return store.finish_phase_history(self.writer, **fields)
        return PhaseHistory(sealed(self.whole.reshape(-1, self.shape[-1])), **fields)

    def __enter__(self) -> EchoOutput:
        return self

    def __exit__(self, *exc: object) -> None:
        if self.writer is not None:
            self.writer.abandon()
