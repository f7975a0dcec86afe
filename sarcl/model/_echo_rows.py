"""Axes, samples and selected rows of a phase history: methods of PhaseHistory that follow from its fields."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from ..base import arguments, constants, validation
from ..base.text import NotebookTable
from ._row_fields import PER_ROW
from .lazy_rows import is_constant, pick

if TYPE_CHECKING:
    from .phase_history import PhaseHistory


class EchoRows(NotebookTable):
    """What a PhaseHistory derives from its fields: shape and bands of the rows, samples in memory, some of the rows."""

    if TYPE_CHECKING:
        samples: Any
        frequency: NDArray[np.float64]
        frequency_step: NDArray[np.float64]
        tx: NDArray[np.float64]
        rx: NDArray[np.float64]
        tx_channel: NDArray[np.int64] | None
        rx_channel: NDArray[np.int64] | None
        polarization: NDArray[np.str_] | None

    @property
    def shape(self) -> tuple[int, int]:
        """(n_rows, n_samples), as of an array."""
        return self.n_rows, self.n_samples

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type of the samples."""
        return np.dtype(self.samples.dtype)

    @property
    def ndim(self) -> int:
        """2: rows and samples."""
        return 2

    @property
    def nbytes(self) -> int:
        """Bytes of the samples, in memory or in a file."""
        return self.n_rows * self.n_samples * self.dtype.itemsize

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return int(self.samples.shape[0])

    @property
    def n_samples(self) -> int:
        """Number of frequencies per row."""
        return int(self.samples.shape[1])

    @property
    def bandwidth(self) -> NDArray[np.float64]:
        """n_samples frequency_step, Hz (n_rows,)."""
        return self.n_samples * self.frequency_step

    @property
    def center_frequency(self) -> NDArray[np.float64]:
        """Centre of the sampled band, Hz (n_rows,)."""
        return self.frequency + (self.n_samples - 1) / 2 * self.frequency_step

    @property
    def swath(self) -> NDArray[np.float64]:
        """Unambiguous range about the reference, m (n_rows,): +- half of c / (2 frequency_step)."""
        return constants.SPEED_OF_LIGHT / (2 * self.frequency_step)

    @property
    def is_monostatic(self) -> bool:
        """Whether transmitter and receiver have equal positions in every row."""
        return self.rx is self.tx or np.array_equal(self.rx, self.tx)

    @functools.cached_property
    def largest_part(self) -> float | None:
        """Largest modulus of the real and imaginary parts of all samples; None where samples may change."""
        if not is_constant(self.samples):
            return None
        step = max(1, 2**17 // self.n_samples)  # rows that a cache holds between the two searches
        blocks = (np.ascontiguousarray(self.samples[at : at + step]) for at in range(0, self.n_rows, step))
        parts = (block.view(block.real.dtype) for block in blocks)
        return max(max(float(part.max()), -float(part.min())) for part in parts)

    def read(self, start: int, stop: int) -> np.ndarray:
        """Samples of rows start ... stop - 1 in memory; a NaN or Inf raises ValueError with its index."""
        start, stop = validation.count("start", start, None), validation.count("stop", stop, None)
        if not 0 <= start <= stop <= self.n_rows:
            raise IndexError(
                f"rows {start} to {stop} were requested, but there are {self.n_rows}; give 0 <= start <= stop <= n_rows"
            )
        block = np.asarray(validation.unmasked("samples", self.samples[start:stop], first_row=start))
        if block.shape != (stop - start, self.n_samples):
            raise ValueError(
                f"samples[{start}:{stop}] gave shape {block.shape}, wanted {(stop - start, self.n_samples)}: "
                "slices of its source do not agree with its shape"
            )
        if not is_constant(self.samples):  # what cannot change was looked at when it was given
            validation.finite("samples", block, first_row=start)
        return block if block.dtype.isnative else block.astype(block.dtype.newbyteorder("="))

    def __getitem__(self, rows: slice | Sequence[int] | np.ndarray) -> PhaseHistory:
        """The selected rows (slice, index array or mask); a lazy source stays lazy."""
        index = arguments.chosen("rows", rows, self.n_rows, "rows")
        if index.size == 0:
            raise ValueError(f"no row is left of {self.n_rows}; choose at least one")
        names = ("frequency", "frequency_step", "tx", "rx", "reference_range", *PER_ROW)
        picked = {n: getattr(self, n)[index] for n in names if getattr(self, n) is not None}
        if self.rx is self.tx:
            picked["rx"] = None
        return replace(cast("PhaseHistory", self), samples=pick(self.samples, index), **picked)

    def select(
        self, *, polarization: str | None = None, channel: int | None = None, sender: int | None = None
    ) -> PhaseHistory:
        """Rows of one `polarization` ("HV"), receive `channel`, transmitting element `sender`. ValueError lists those
        that exist."""
        is_selected, described = np.ones(self.n_rows, bool), "these data"
        for name, values, value in (
            ("polarization", self.polarization, polarization),
            ("channel", self.rx_channel, channel),
            ("sender", self.tx_channel, sender),
        ):
            if value is None:
                continue
            if values is None:
                raise ValueError(f"these data name no {name}; it is the same for every row")
            is_valid = isinstance(value, str) if name == "polarization" else isinstance(value, (int, np.integer))
            if not is_valid or not (is_selected & (values == value)).any():
                raise ValueError(
                    f"{name} {value!r} is not in {described}; there are {sorted(set(values[is_selected].tolist()))}"
                )
            is_selected &= values == value
            described = f"the rows of {name} {value!r}"
        return self[is_selected]

    def time_signal(self, oversample: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Baseband signals in time: (delay about tau_ref, s (n,) or (n_rows, n); complex (n_rows, n)).

        s~_p(t) = sum_n s_p(f_n) exp(+j 2 pi (f_n - fc) t), not normalised, fc the frequency of sample
        n_samples//2. One delay axis where every row has the same frequency step.

        oversample  number of delays over that of samples
        """
        n = self.n_samples * validation.count("oversample", oversample)
        what = f"a signal of {n if n < 2**60 else 2.0**60:.3g} samples or more in {self.n_rows} rows"
        validation.room(what, 48.0 * min(n, 2**60) * self.n_rows, "give a smaller oversample, or select rows")
        lag = np.arange(n) - n // 2
        step = self.frequency_step if np.ptp(self.frequency_step) else self.frequency_step[:1]
        delay = lag / (n * step[:, None])
        spectrum = np.zeros((self.n_rows, n), np.complex128)
        spectrum[:, np.arange(self.n_samples) - self.n_samples // 2] = self.read(0, self.n_rows)
        signal = np.fft.fftshift(np.fft.ifft(spectrum, axis=1), axes=1) * n
        return (delay if len(delay) > 1 else delay[0]), signal
