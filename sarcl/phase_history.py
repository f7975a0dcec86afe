"""PhaseHistory: echoes by row and frequency, with the geometry that made them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from . import check

if TYPE_CHECKING:
    from .report import Report
    from .waveform import Waveform

# Optional arrays with one entry a row: name -> (dtype, trailing shape).
PER_ROW = {
    "time": (np.float64, ()),
    "tx_channel": (np.int64, ()),
    "rx_channel": (np.int64, ()),
    "polarization": ("U2", ()),
    "weight": (np.float64, ()),
    "tx_velocity": (np.float64, (3,)),
    "rx_velocity": (np.float64, (3,)),
}


@dataclass(frozen=True, eq=False)
class PhaseHistory:
    """Echoes s (n_rows, n_samples); a row is one (pulse, transmit channel, receive channel, polarisation).

    samples          complex; an array, memmap, HDF5 dataset or anything with shape, dtype and row slicing
    frequency        of sample 0, Hz, one or per row
    frequency_step   Hz, one or per row, positive
    tx, rx           antenna positions, m (n_rows, 3); rx defaults to tx
    reference_range  m, one or per row: half the two-way path whose phase is already removed
    time, tx_channel, rx_channel, polarization, weight, tx_velocity, rx_velocity   optional, one a row
    waveform         the Waveform sent, or None
    compressed       False while the pulse's own spectrum is still in the data (see `compress`)

    A point of amplitude a at x gives a exp(-j 2 pi f (tau - tau_ref)), tau = (|tx - x| + |x - rx|)/c,
    tau_ref = 2 reference_range/c. ValueError names the field whose shape or value does not fit; samples that
    are read lazily are checked for NaN and Inf when they are read.
    """

    samples: Any
    frequency: Any
    frequency_step: Any
    tx: Any
    reference_range: Any
    rx: Any = None
    time: Any = None
    tx_channel: Any = None
    rx_channel: Any = None
    polarization: Any = None
    weight: Any = None
    tx_velocity: Any = None
    rx_velocity: Any = None
    waveform: Waveform | None = None
    array: Any = None
    compressed: bool = True
    report: Report | None = None

    def __post_init__(self) -> None:
        samples = self.samples
        if isinstance(samples, (list, tuple)) or (isinstance(samples, np.ndarray) and samples.dtype.kind in "iuf"):
            samples = np.asarray(samples, np.complex128)
        if len(np.shape(samples)) != 2 or 0 in samples.shape:
            raise ValueError(f"samples has shape {np.shape(samples)}, wanted (n_rows, n_samples), neither zero")
        if np.dtype(samples.dtype).kind != "c":
            raise ValueError(f"samples has type {samples.dtype}, wanted complex64 or complex128")
        # A memmap is a file: like every lazy source it is checked as it is read.
        if isinstance(samples, np.ndarray) and not isinstance(samples, np.memmap):
            check.finite("samples", samples)
            samples = samples.view()
            samples.flags.writeable = False
        self._set("samples", samples)
        n = samples.shape[0]
        for name in ("frequency", "frequency_step", "reference_range"):
            self._set(name, self._rows(name, getattr(self, name), np.float64, (), spread=True))
        if not (self.frequency_step > 0).all():
            raise ValueError(
                f"frequency_step[{int(np.argmin(self.frequency_step))}] is {self.frequency_step.min():g} Hz; "
                "it must be positive: reverse the samples of a falling sweep"
            )
        if not (self.frequency > 0).all():
            bad = int(np.argmin(self.frequency))
            raise ValueError(f"frequency[{bad}] is {self.frequency[bad]:g} Hz; it must be positive")
        self._set("tx", self._rows("tx", self.tx, np.float64, (3,)))
        self._set("rx", self.tx if self.rx is None else self._rows("rx", self.rx, np.float64, (3,)))
        for name, (dtype, tail) in PER_ROW.items():
            if getattr(self, name) is not None:
                self._set(name, self._rows(name, getattr(self, name), dtype, tail, spread=tail == ()))
        if self.weight is not None and (self.weight < 0).any():
            raise ValueError(f"weight[{int(np.argmin(self.weight))}] is {self.weight.min():g}; it cannot be negative")
        assert n == self.n_rows

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _rows(self, name: str, value: Any, dtype: Any, tail: tuple[int, ...], spread: bool = False) -> np.ndarray:
        """`value` with one entry a row; a single entry serves all rows where `spread`."""
        n = self.samples.shape[0]
        if spread and np.ndim(value) == 0:
            value = np.full(n, value)
        out = np.array(value) if dtype == "U2" else np.array(value, dtype)
        if out.ndim != 1 + len(tail) or out.shape[1:] != tail:
            raise ValueError(f"{name} has shape {out.shape}, wanted {(n, *tail)}")
        if len(out) != n:
            raise ValueError(f"samples has {n} rows but {name} has {len(out)}; give one {name} per row")
        if out.dtype.kind in "fc":
            check.finite(name, out)
        out.flags.writeable = False
        return out

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return int(self.samples.shape[0])

    @property
    def n_samples(self) -> int:
        """Number of frequencies in a row."""
        return int(self.samples.shape[1])

    @property
    def bandwidth(self) -> np.ndarray:
        """n_samples frequency_step, Hz (n_rows,)."""
        return self.n_samples * self.frequency_step

    @property
    def center_frequency(self) -> np.ndarray:
        """Middle of the sampled band, Hz (n_rows,)."""
        return self.frequency + (self.n_samples - 1) / 2 * self.frequency_step

    @property
    def swath(self) -> np.ndarray:
        """Unambiguous range about the reference, m (n_rows,): +- half of c / (2 frequency_step)."""
        return check.SPEED_OF_LIGHT / (2 * self.frequency_step)

    @property
    def is_monostatic(self) -> bool:
        """True where transmitter and receiver share every position."""
        return self.rx is self.tx or np.array_equal(self.rx, self.tx)

    def read(self, start: int, stop: int) -> np.ndarray:
        """Samples of rows start ... stop - 1 in memory; a NaN or Inf raises ValueError with its index."""
        block = np.asarray(self.samples[start:stop])
        if block.shape != (stop - start, self.n_samples):
            raise ValueError(f"samples[{start}:{stop}] gave shape {block.shape}, wanted {(stop - start, self.n_samples)}")
        check.finite("samples", block, first_row=start)
        return block

    def __getitem__(self, rows: Any) -> PhaseHistory:
        """The chosen rows (slice, index array or mask); a lazy source stays lazy."""
        index = np.arange(self.n_rows)[rows]
        index = np.atleast_1d(index)
        if index.size == 0:
            raise ValueError(f"no row is left of {self.n_rows}; choose at least one")
        picked = {n: getattr(self, n) for n in ("frequency", "frequency_step", "tx", "rx", "reference_range", *PER_ROW)}
        picked = {n: v[index] for n, v in picked.items() if v is not None}
        if self.rx is self.tx:
            picked["rx"] = None
        samples = self.samples[index] if isinstance(self.samples, np.ndarray) else RowView(self.samples, index)
        return replace(self, samples=samples, **picked)

    def select(self, *, polarization: str | None = None, channel: int | None = None) -> PhaseHistory:
        """Rows of one polarisation ("HV") and/or one receive channel. ValueError lists what there is."""
        keep = np.ones(self.n_rows, bool)
        for name, field, wanted in (
            ("polarization", self.polarization, polarization),
            ("channel", self.rx_channel, channel),
        ):
            if wanted is None:
                continue
            if field is None:
                raise ValueError(f"these data name no {name}; every row is alike")
            if not (field == wanted).any():
                raise ValueError(f"{name} {wanted!r} is not in these data; there are {sorted(set(field.tolist()))}")
            keep &= field == wanted
        return self[keep]

    def time_signal(self, oversample: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Baseband signals in time: (delay about tau_ref, s (n,) or (n_rows, n); complex (n_rows, n)).

        s~_p(t) = sum_n s_p(f_n) exp(+j 2 pi (f_n - fc) t), not normalised, fc the frequency of sample
        n_samples//2. One delay axis where every row has the same frequency step.
        """
        n = self.n_samples * check.count("oversample", oversample)
        lag = np.arange(n) - n // 2
        step = self.frequency_step if np.ptp(self.frequency_step) else self.frequency_step[:1]
        delay = lag / (n * step[:, None])
        spectrum = np.zeros((self.n_rows, n), np.complex128)
        spectrum[:, np.arange(self.n_samples) - self.n_samples // 2] = self.read(0, self.n_rows)
        signal = np.fft.fftshift(np.fft.ifft(spectrum, axis=1), axes=1) * n
        return (delay if len(delay) > 1 else delay[0]), signal

    def save(self, path: Any) -> None:
        """Write a lossless HDF5 file that `sarcl.read` opens; samples are copied in blocks of rows."""
        from .files import store

        store.save_phase_history(self, path)


class RowView:
    """Chosen rows of a lazy source; reads what a slice asks for, in as few reads as runs of rows allow."""

    def __init__(self, source: Any, index: np.ndarray) -> None:
        self.source, self.index = source, index
        self.shape = (len(index), *source.shape[1:])
        self.dtype = source.dtype

    def __getitem__(self, rows: slice) -> np.ndarray:
        index = self.index[rows]
        if len(index) == 0:
            return np.empty((0, *self.shape[1:]), self.dtype)
        runs = np.split(index, np.flatnonzero(np.diff(index) != 1) + 1)
        return np.concatenate([np.asarray(self.source[int(r[0]) : int(r[-1]) + 1]) for r in runs])


def concatenate(parts: Sequence[PhaseHistory]) -> PhaseHistory:
    """Rows of several phase histories in one, in order; all need the same number of samples.

    Optional per-row fields are kept where every part has them. ValueError names the part that does not fit.
    """
    parts = list(parts)
    if not parts:
        raise ValueError("concatenate was given no phase history; give at least one")
    for i, part in enumerate(parts):
        if part.n_samples != parts[0].n_samples:
            raise ValueError(f"part {i} has {part.n_samples} samples a row, part 0 has {parts[0].n_samples}")
        if part.compressed != parts[0].compressed:
            raise ValueError(f"part {i} and part 0 differ: one is compressed, one is not; call compress on it first")
    joined: dict[str, Any] = {}
    for field in fields(PhaseHistory):
        values = [getattr(p, field.name) for p in parts]
        if field.name == "samples":
            joined["samples"] = np.concatenate([p.read(0, p.n_rows) for p in parts])
        elif isinstance(values[0], np.ndarray) and all(v is not None for v in values):
            joined[field.name] = np.concatenate(values)
        elif field.name in ("waveform", "array") and all(v is values[0] for v in values):
            joined[field.name] = values[0]
    return PhaseHistory(**joined, compressed=parts[0].compressed)
