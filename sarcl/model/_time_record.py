"""Records of samples in time, as PhaseHistory.from_time takes them: checked, with their axes of time and frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation
from ..base.types import LazyRows
from .waveform import Waveform

LONGEST_DELAY = 1e9  # s, of a start: no echo takes as long
ROUNDING = 1e-9  # relative difference of frequencies that count as equal
KINDS = ("compressed", "dechirped", "chirped", "rf")


@dataclass(frozen=True, eq=False, kw_only=True)
class TimeRecord:
    """Arguments of PhaseHistory.from_time, which documents them, as the user gave them."""

    samples: ArrayLike | LazyRows
    kind: Literal["compressed", "dechirped", "chirped", "rf"]
    rate: float
    start: ArrayLike
    carrier: ArrayLike | None
    bandwidth: float | tuple[float, float] | None
    waveform: Waveform | None
    pulse_time: Literal["start", "middle"]
    sweep_rate: float | None
    beat: Literal["positive", "negative"] | None
    reference_range: ArrayLike
    scene_range: ArrayLike | None


@dataclass(frozen=True, eq=False)
class Signal:
    """Checked samples (n_rows, n) at a rate, Hz, with their axes of time and frequency.

    kind     "compressed", "chirped" or "dechirped"; are_rf  whether they are real ones of the received signal itself
    start    s (n_rows,), of sample 0 after the transmission, or after the reference sweep passed `carrier`
    carrier  Hz (n_rows,), mixed to 0, or to be mixed to 0 where are_rf
    bandwidth  Hz, asked for of compressed samples; None: all there is
    sweep    the reference of dechirped samples; None of others
    """

    samples: LazyRows
    kind: str
    rate: float
    start: np.ndarray
    carrier: np.ndarray
    bandwidth: object
    are_rf: bool
    sweep: Sweep | None = None

    @property
    def n(self) -> int:
        """Number of samples of a row."""
        return self.samples.shape[1]


@dataclass(frozen=True, eq=False)
class Sweep:
    """The reference of dechirped samples.

    rate       Hz/s, negative for a sweep that falls
    beat       sign of the beat frequency of an echo behind the reference; None: real samples
    reference  m (n_rows,), half the path of the reference sweep
    scene      m (n_rows,): the new reference, at which no video phase remains; None: the filter is applied
    """

    rate: float
    beat: str | None
    reference: np.ndarray
    scene: np.ndarray | None


def signal_of(record: TimeRecord) -> Signal:
    """The samples of a record with their axes; ValueError names a wrong argument, or one of another kind."""
    kind = validation.choice("kind", record.kind, KINDS)
    samples = _checked_samples(record)
    rate = validation.number("rate", record.rate, above=0)
    if record.waveform is not None:
        validation.instance("waveform", record.waveform, Waveform)
    _check_kind(record)
    carrier, bandwidth = record.carrier, record.bandwidth
    if record.kind == "rf":
        low, high = _rf_band(record, samples, rate)
        carrier, bandwidth = (low + high) / 2, high - low
        kind = "compressed" if record.waveform is None else "chirped"
    carriers = _checked_carriers(carrier, record.waveform, samples.shape[0])
    starts = _per_row("start", record.start, samples.shape[0])
    if np.abs(starts).max() > LONGEST_DELAY:
        raise ValueError(f"start reaches {np.abs(starts).max():g} s, longer than any echo takes; give seconds")
    sweep = _checked_sweep(record, samples) if kind == "dechirped" else None
    signal = Signal(samples, kind, rate, starts, carriers, bandwidth, record.kind == "rf", sweep)
    if sweep is None:
        _check_pulses(record, signal)
    return signal


def _checked_samples(record: TimeRecord) -> LazyRows:
    """Samples as an array, or as given where they are read row by row; ValueError for another shape or type."""
    if isinstance(record.samples, (list, tuple)):
        validation.ndim("samples", record.samples)
        samples: LazyRows = np.asarray(record.samples)
    else:
        samples = cast("LazyRows", record.samples)
    if len(np.shape(samples)) != 2 or 0 in samples.shape:
        raise ValueError(f"samples has shape {np.shape(samples)}, wanted (n_rows, n_times), neither zero")
    if np.dtype(samples.dtype).kind not in "ciuf":
        raise ValueError(f"samples has type {samples.dtype}, wanted numbers")
    if samples.shape[1] < 2:
        raise ValueError(f"samples has one time per row; {record.kind} records need at least 2")
    return samples


def _check_kind(record: TimeRecord) -> None:
    """Raise ValueError for arguments of another kind."""
    validation.choice("pulse_time", record.pulse_time, ("start", "middle"))
    validation.ndim("reference_range", record.reference_range)
    is_rf = record.kind == "rf"
    for name, is_used, owner in (
        ("bandwidth", record.bandwidth is not None and not is_rf, "compressed"),
        ("pulse_time", record.pulse_time != "start" and not is_rf, "chirped"),
        ("sweep_rate", record.sweep_rate is not None, "dechirped"),
        ("reference_range", bool(np.any(np.asarray(record.reference_range) != 0)), "dechirped"),
        ("scene_range", record.scene_range is not None, "dechirped"),
    ):
        if is_used and record.kind != owner:
            raise ValueError(f"{name} is for {owner} samples, and kind is {record.kind!r}; leave it out")


def _rf_band(record: TimeRecord, samples: LazyRows, rate: float) -> tuple[float, float]:
    """The band (low, high), Hz, of real samples of the signal itself."""
    waveform, bandwidth = record.waveform, record.bandwidth
    if not _is_real(samples):
        raise ValueError(f'samples are {samples.dtype}, and kind "rf" is for real ones; complex ones have other kinds')
    if record.carrier is not None:
        raise ValueError("carrier is the middle of bandwidth=(low, high) where kind is 'rf'; leave it out")
    if waveform is None and record.pulse_time != "start":
        raise ValueError(
            f"pulse_time is {record.pulse_time!r}, and without waveform= samples are compressed; leave it out"
        )
    if waveform is not None and bandwidth is not None:
        raise ValueError("bandwidth and waveform are both given, and the band is the waveform's; leave bandwidth out")
    if waveform is not None:
        bandwidth = waveform.center - waveform.bandwidth / 2, waveform.center + waveform.bandwidth / 2
    elif bandwidth is None or validation.ndim("bandwidth", bandwidth) != 1:
        raise ValueError(f"bandwidth is {bandwidth!r:.60}; kind 'rf' needs bandwidth=(low, high), Hz")
    low, high = (float(f) for f in validation.array("bandwidth", bandwidth, np.float64, (2,)))
    if not 0 < low < high <= rate / 2 * (1 + ROUNDING):
        raise ValueError(
            f"bandwidth is ({low:g}, {high:g}) Hz; wanted 0 < low < high, and high at most half of rate, "
            f"{rate / 2:g} Hz"
        )
    return low, high


def _checked_carriers(carrier: ArrayLike | None, waveform: Waveform | None, n_rows: int) -> np.ndarray:
    """Carriers, Hz (n_rows,): the waveform's centre where none is given."""
    if carrier is None and waveform is None:
        raise ValueError("carrier is None and there is no waveform to take it from; give carrier=, Hz")
    carriers = _per_row("carrier", waveform.center if waveform is not None and carrier is None else carrier, n_rows)
    if not (carriers > 0).all():
        raise ValueError(f"carrier[{int(np.argmin(carriers))}] is {carriers.min():g} Hz; it must be positive")
    return carriers


def _checked_sweep(record: TimeRecord, samples: LazyRows) -> Sweep:
    """The reference sweep of dechirped samples; ValueError where its rate or the sign of the beat is missing."""
    beat, n_rows = record.beat, samples.shape[0]
    rate = 0.0 if record.sweep_rate is None else validation.number("sweep_rate", record.sweep_rate)
    if not rate:
        raise ValueError("dechirped samples need sweep_rate=, Hz/s, not 0: negative where the frequency falls")
    if _is_real(samples):
        if beat is not None:
            raise ValueError(f"beat is {beat!r}, but real samples have beats of both signs; leave it out")
    elif beat is None:
        raise ValueError(
            'complex dechirped samples need beat="positive" or "negative": the sign of the beat frequency of '
            "echoes behind the reference"
        )
    else:
        validation.choice("beat", beat, ("positive", "negative"))
    reference = _per_row("reference_range", record.reference_range, n_rows)
    scene = None if record.scene_range is None else _per_row("scene_range", record.scene_range, n_rows)
    return Sweep(rate, beat, reference, scene)


def _check_pulses(record: TimeRecord, signal: Signal) -> None:
    """Raise ValueError for samples of pulses that have a beat, no phase, or another carrier than their waveform."""
    waveform, carrier, kind = record.waveform, signal.carrier, signal.kind
    if record.beat is not None:
        raise ValueError(f"beat is {record.beat!r}, but {kind} samples have no beat; leave it out")
    if _is_real(signal.samples) and not signal.are_rf:
        raise ValueError(
            f"{kind} samples must be complex, got {signal.samples.dtype}; real samples of the received signal are "
            'kind="rf", with bandwidth=(low, high), Hz'
        )
    if waveform is not None and np.ptp(carrier) == 0 and abs(waveform.center - carrier[0]) > ROUNDING * carrier[0]:
        raise ValueError(
            f"carrier is {carrier[0]:.9g} Hz but waveform.center {waveform.center:.9g} Hz; they must be one frequency"
        )


def _is_real(samples: LazyRows) -> bool:
    return np.dtype(samples.dtype).kind != "c"


def _per_row(name: str, value: object, n_rows: int) -> np.ndarray:
    """A number, or one per row, as float64 (n_rows,)."""
    numbers = validation.converted(name, value, np.float64)
    if numbers.shape not in ((), (n_rows,)):
        raise ValueError(f"{name} has shape {numbers.shape}, wanted one number or one per row, ({n_rows},)")
    validation.finite(name, numbers)
    return np.array(np.broadcast_to(numbers, (n_rows,)))
