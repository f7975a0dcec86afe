"""PhaseHistory: echoes by row and frequency, with the geometry of their collection."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import arguments, constants, validation
from ..base.report import Report
from ..base.text import interval, size_text
from ..io import formats, hdf5
from ._echo_rows import EchoRows
from ._row_fields import PER_ROW, RowFields, check_axis, one_per_row
from .lazy_rows import in_memory

if TYPE_CHECKING:
    import xarray

    from ..base.types import LazyRows, PathLike
    from .antenna_array import AntennaArray
    from .trajectory import Trajectory
    from .waveform import Waveform


@dataclass(frozen=True, eq=False)
class PhaseHistory(EchoRows):
    """Echoes s (n_rows, n_samples); a row is one (pulse, transmit channel, receive channel, polarisation).

    samples          complex; an array, memmap, HDF5 dataset or anything with shape, dtype and row slicing.
                     A writeable array is copied, a read-only one is not
    frequency        of sample 0, Hz, one or per row
    frequency_step   Hz, one or per row, positive, at least 1e-20
    tx, rx           antenna positions, m (n_rows, 3); rx=None: one antenna. Such data stay monostatic:
                     dataclasses.replace(raw, tx=...) moves rx too, for a receiver that stays give rx=raw.rx.copy()
    reference_range  m, one or per row: half the two-way path whose phase is already removed
    time, tx_channel, rx_channel, polarization, weight, tx_velocity, rx_velocity   optional, one per row
    waveform         the transmitted Waveform, or None;  array  the AntennaArray that transmitted, or None: one antenna
    compressed       False for data that still have the spectrum of the pulse (see `compress`)
    image_area       m (3, 3): centre of the area to image, and from there to the middles of its sides along x and y,
                     where the file that was read names one;  metadata  its XML

    A point of amplitude a at x gives a exp(-j 2 pi f (tau - tau_ref)), tau = (|tx - x| + |x - rx|)/c,
    tau_ref = 2 reference_range/c. ValueError names a field of wrong shape or value; samples that are
    read lazily are checked for NaN and Inf when they are read.

    >>> measured = sarcl.PhaseHistory(
    ...     raw.samples, frequency=raw.frequency, frequency_step=raw.frequency_step,
    ...     tx=raw.tx, reference_range=raw.reference_range,
    ... )
    >>> measured.n_rows, measured.n_samples == raw.n_samples
    (64, True)
    >>> raw.read(8, 16).shape  # rows 8 ... 15
    (8, 64)
    >>> delay, signal = raw.time_signal(oversample=2)  # s about the delay of reference_range
    >>> raw.save("echoes.h5")
    >>> dataset = raw.to_xarray()  # needs sarcl[xarray]
    >>> pulses = np.zeros((64, 256), np.complex64)  # receiver's samples, compressed in range
    >>> sampled = sarcl.PhaseHistory.from_time(
    ...     pulses, rate=400e6, start=4.7e-5, carrier=9.6e9, track=track, polarization=["HH", "HV"] * 32
    ... )
    >>> sampled.select(polarization="HV").n_rows
    32
    """

    samples: Any
    frequency: NDArray[np.float64]
    frequency_step: NDArray[np.float64]
    tx: NDArray[np.float64]
    reference_range: NDArray[np.float64]
    rx: NDArray[np.float64] = None  # type: ignore[assignment]
    time: NDArray[np.float64] | None = None
    tx_channel: NDArray[np.int64] | None = None
    rx_channel: NDArray[np.int64] | None = None
    polarization: NDArray[np.str_] | None = None
    weight: NDArray[np.float64] | None = None
    tx_velocity: NDArray[np.float64] | None = None
    rx_velocity: NDArray[np.float64] | None = None
    waveform: Waveform | None = None
    array: AntennaArray | None = None
    compressed: bool = True
    report: Report | None = None
    image_area: NDArray[np.float64] | None = None
    metadata: str | None = None
    # the array that rx is where it was given as None; dataclasses.replace hands it on, and tells a new rx from the old
    _rx_of_tx: NDArray[np.float64] | None = field(default=None, repr=False)

    if TYPE_CHECKING:  # types of the arguments; the fields above have the types after conversion

        def __init__(
            self,
            samples: ArrayLike | LazyRows,
            frequency: ArrayLike,
            frequency_step: ArrayLike,
            tx: ArrayLike,
            reference_range: ArrayLike,
            rx: ArrayLike | None = None,
            time: ArrayLike | None = None,
            tx_channel: ArrayLike | None = None,
            rx_channel: ArrayLike | None = None,
            polarization: ArrayLike | None = None,
            weight: ArrayLike | None = None,
            tx_velocity: ArrayLike | None = None,
            rx_velocity: ArrayLike | None = None,
            waveform: Waveform | None = None,
            array: AntennaArray | None = None,
            compressed: bool = True,
            report: Report | None = None,
            image_area: ArrayLike | None = None,
            metadata: str | None = None,
            _rx_of_tx: ArrayLike | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        if isinstance(self.samples, PhaseHistory):
            raise TypeError(
                "samples is a PhaseHistory; give its samples (raw.samples), or dataclasses.replace(raw, ...)"
            )
        samples = validation.unmasked("samples", self.samples)
        if isinstance(samples, (list, tuple)) or (in_memory(samples) and samples.dtype.kind in "iuf"):
            samples = validation.sealed(validation.converted("samples", samples, np.complex128))
        if len(np.shape(samples)) != 2 or 0 in samples.shape:
            raise ValueError(f"samples has shape {np.shape(samples)}, wanted (n_rows, n_samples), neither zero")
        if np.dtype(samples.dtype).newbyteorder("=") not in (np.complex64, np.complex128):
            raise ValueError(f"samples has type {samples.dtype}, wanted complex64 or complex128")
        if in_memory(samples):
            validation.finite("samples", samples)
            if samples.flags.writeable or not samples.dtype.isnative:
                samples = validation.sealed(np.array(samples, samples.dtype.newbyteorder("="), order="C"))
        self._set("samples", samples)
        n = samples.shape[0]
        if self.tx_channel is None and self.rx_channel is None:
            check_axis(self.frequency, self.frequency_step, samples.shape)
        for name in ("frequency", "frequency_step", "reference_range"):
            self._set(name, one_per_row(name, getattr(self, name), n, np.float64, spread=True))
        if not (self.frequency_step > 0).all():
            raise ValueError(
                f"frequency_step[{int(np.argmin(self.frequency_step))}] is {self.frequency_step.min():g} Hz; "
                "it must be positive: reverse the samples of a falling sweep"
            )
        if not (self.frequency_step >= constants.LEAST_STEP).all():
            step = float(self.frequency_step.min())
            raise ValueError(
                f"frequency_step is {step:g} Hz, a swath of {constants.SPEED_OF_LIGHT / 2 / step:.2g} m; steps are at "
                f"least {constants.LEAST_STEP:g} Hz, swaths at most {constants.WIDEST_SWATH:g} m: is it in MHz? Give "
                f"{1e6 * step:g}"
            )
        if not (self.frequency > 0).all():
            bad = int(np.argmin(self.frequency))
            raise ValueError(f"frequency[{bad}] is {self.frequency[bad]:g} Hz; it must be positive")
        with np.errstate(over="ignore"):
            last = self.frequency + (samples.shape[1] - 1) * self.frequency_step
        if not np.isfinite(last).all():
            raise ValueError(
                f"frequency_step is {self.frequency_step.max():g} Hz, and the last frequency infinite; give Hz"
            )
        self._set("tx", one_per_row("tx", self.tx, n, np.float64, (3,)))
        if self.rx is None or self.rx is self._rx_of_tx:
            self._set("rx", self.tx)
            self._set("_rx_of_tx", self.tx)
        else:
            self._set("rx", one_per_row("rx", self.rx, n, np.float64, (3,)))
            self._set("_rx_of_tx", None)
        for name, (dtype, tail) in PER_ROW.items():
            if getattr(self, name) is not None:
                self._set(name, one_per_row(name, getattr(self, name), n, dtype, tail, spread=tail == ()))
        if self.weight is not None and (self.weight < 0).any():
            bad = int(np.argmin(self.weight))
            raise ValueError(f"weight[{bad}] is {self.weight[bad]:g}; it cannot be negative")
        self._set("compressed", validation.flag("compressed", self.compressed))
        self._check_origin()

    def _check_origin(self) -> None:
        """Checks of what the echoes come from: fields that are not of rows."""
        if self.report is not None:
            validation.instance("report", self.report, Report)
        if self.image_area is not None:
            area = validation.array("image_area", self.image_area, np.float64, (3, 3))
            if not np.linalg.norm(np.cross(area[1], area[2])) > 0:
                raise ValueError(f"image_area has the sides {area[1]} and {area[2]}, which span no plane")
            self._set("image_area", validation.sealed(area))
        if self.metadata is not None:
            validation.instance("metadata", self.metadata, str)
        if self.waveform is not None and not hasattr(self.waveform, "matched_spectrum"):
            raise TypeError(f"waveform is a {type(self.waveform).__name__}; give a sarcl.Waveform or None")
        if self.array is not None and not hasattr(self.array, "offsets_at"):
            raise TypeError(f"array is a {type(self.array).__name__}; give a sarcl.AntennaArray or None")

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    @classmethod
    def from_time(
        cls,
        samples: ArrayLike | LazyRows,
        *,
        rate: float,
        start: ArrayLike = 0.0,
        carrier: ArrayLike | None = None,
        tx: ArrayLike | None = None,
        rx: ArrayLike | None = None,
        track: Trajectory | None = None,
        kind: Literal["compressed", "dechirped", "chirped", "rf"] = "compressed",
        bandwidth: float | tuple[float, float] | None = None,
        waveform: Waveform | None = None,
        pulse_time: Literal["start", "middle"] = "start",
        sweep_rate: float | None = None,
        beat: Literal["positive", "negative"] | None = None,
        reference_range: ArrayLike = 0.0,
        scene_range: ArrayLike | None = None,
        **rows: Unpack[RowFields],
    ) -> PhaseHistory:
        """Echoes sampled in time, (n_rows, n), as a phase history; the samples are copied.

        rate      sampling rate, Hz
        start     s, one or per row: the delay of sample 0, counted from the transmission; of dechirped samples its time
                  after the instant at which the reference sweep passes `carrier`
        carrier   Hz, one or per row: the frequency that was mixed to 0; of dechirped samples that of the sweep at
                  time 0. None: waveform.center
        tx, rx    antenna positions, m (n_rows, 3); rx None: one antenna. Of a satellite the receiver has moved on when
                  the echo arrives, and the Earth has turned: give track
        track     in place of tx and rx, a Trajectory with a pulse per row: its positions and times. From
                  `Orbit.trajectory` it gives the places of both antennas, at the delays of the reference ranges
        kind      "compressed": complex, a pulse of peak |a| at the delay of a point of amplitude a
                  "chirped": complex, a pulse of modulus |a| as it was sent; the result awaits `sarcl.compress`
                  "dechirped": the echo of a linear sweep times the sweep itself, complex or real (FMCW, stretch)
                  "rf": real samples of the received signal itself, such as those of an impulse radar: compressed, or
                  with `waveform` as they were sent. Their analytic signal is formed and mixed to the middle of the band
        bandwidth      Hz, of compressed samples: the frequencies that are kept, about the carrier. None: those of the
                       waveform, or all, `rate`. Of "rf" samples (low, high), Hz
        waveform       the Waveform that was sent; of chirped samples it must be given
        pulse_time     of chirped samples: `start` is counted from the "start" or the "middle" of the pulse sent
        sweep_rate     of dechirped samples: Hz/s, negative where the frequency falls
        beat           of complex dechirped samples: the sign that the beat frequency has for echoes behind the
                       reference, "positive" or "negative"; of real samples: None
        reference_range  of dechirped samples: m, one or per row, half the path for which the reference sweep was
                       delayed; 0 where the sweep that is sent is the reference itself
        scene_range    of dechirped samples: m, one or per row, the range of the scene's middle, which becomes the
                       reference. The residual video phase pi K (tau - tau_ref)^2 is 0 there, exactly. None: a filter
                       removes it at all ranges, and disturbs a few times rate/sqrt(|K|) samples at either end
        rows           time, polarization, ... : the optional fields with one entry per row

        The phase of a return is exp(-j 2 pi carrier tau): give the conjugate of samples that have the other sign.
        Carrier phases are exact before they are rounded to float64. Compressed and chirped samples get reference ranges
        at the middle of the record. ValueError: samples, arguments or a waveform that the kind does not have, and rates
        below the bandwidth. SarclWarning: most of the energy lies at negative ranges.
        docs/guide/your_own_data.md has a recipe for each kind.
        """
        from ._time_record import TimeRecord
        from ._time_samples import spectra_of
        from .row_positions import check_orbit, rows_of_track

        if (tx is None) == (track is None):
            raise ValueError(
                f"{'tx and track are both None' if tx is None else 'tx and track are both given'}; give exactly one: "
                "positions, m (n_rows, 3), or a Trajectory"
            )
        spectra = spectra_of(
            TimeRecord(
                samples=samples,
                kind=kind,
                rate=rate,
                start=start,
                carrier=carrier,
                bandwidth=bandwidth,
                waveform=waveform,
                pulse_time=pulse_time,
                sweep_rate=sweep_rate,
                beat=beat,
                reference_range=reference_range,
                scene_range=scene_range,
            )
        )
        places: dict[str, Any] = {"tx": tx, "rx": rx, **rows}
        if track is not None:
            places = rows_of_track(track, rx, spectra.reference_range, rows)
        compressed = kind != "chirped" and not (kind == "rf" and waveform is not None)
        raw = cls(**spectra._asdict(), waveform=waveform, compressed=compressed, **places)
        if track is None:
            check_orbit(raw)
        return raw

    def __repr__(self) -> str:
        low = self.frequency.min() / 1e9
        high = (self.frequency + (self.n_samples - 1) * self.frequency_step).max() / 1e9
        state = "" if self.compressed else ", not compressed"
        return (
            f"PhaseHistory({self.n_rows} rows of {self.n_samples} {self.samples.dtype} samples, "
            f"{low:.6g} to {high:.6g} GHz, swath {self.swath.min():.4g} m{state})"
        )

    def _notebook_rows(self) -> Iterator[tuple[str, str]]:
        yield "samples", f"{self.n_rows} rows of {self.n_samples}, {self.samples.dtype}, {size_text(self.nbytes)}"
        ends = self.frequency.min(), (self.frequency + (self.n_samples - 1) * self.frequency_step).max()
        yield "frequencies", interval((f / 1e9 for f in ends), "GHz")
        yield "resolution in range", interval(constants.SPEED_OF_LIGHT / (2 * self.bandwidth), "m", 4)
        yield "swath", interval(self.swath, "m", 4)
        yield "reference range", interval(self.reference_range, "m")
        if self.time is not None:
            yield "times", interval(self.time, "s", 9)
        for name in ("polarization", "tx_channel", "rx_channel"):
            if getattr(self, name) is not None:
                yield name, ", ".join(map(str, np.unique(getattr(self, name))))
        yield "antennas", "one for both" if np.array_equal(self.tx, self.rx) else "apart"
        yield "compressed", "yes" if self.compressed else "no: sarcl.compress(raw)"

    def to_xarray(self) -> xarray.Dataset:
        """The samples (row, sample) as an xarray.Dataset in memory, with the rows' coordinates (sarcl[xarray]).

        frequency, Hz, is that of each sample, per row where rows differ; tx and rx (row, axis), m. Units are
        attributes. ImportError names the extra.
        """
        from ._labelled import phase_history_dataset

        return phase_history_dataset(self)

    def save(
        self,
        path: PathLike,
        *,
        origin: ArrayLike | None = None,
        axes: ArrayLike | None = None,
        metadata: Mapping[str, ArrayLike | np.datetime64] | None = None,
        domain: Literal["FX", "TOA"] = "FX",
        sgn: Literal[-1, 1] = -1,
        version: Literal["1.0.1", "1.1.0"] = "1.1.0",
    ) -> None:
        """Write a lossless HDF5 file, or a CPHD file, that `sarcl.read` opens; samples are copied in blocks of rows.

        CPHD (a path that ends in .cphd; pip install sarcl[formats]) keeps samples in complex64, geometry, times and
        polarisations, in Earth-fixed coordinates, and takes

        origin    (latitude, longitude, height), degrees and m on WGS84, of local coordinates; none for Earth-fixed ones
        axes      Earth-fixed unit vectors along local x, y, z (3, 3); None: east, north, up at the origin
        metadata  by CPHD's own names: CollectorName, CoreName, ModeType, Classification, ReleaseInfo, CollectionStart
                  (UTC of time 0), and where the echoes lack them TxPol, RcvPol; TxTime (n_rows,), TxVel and RcvVel
                  (n_rows, 3); SRPPos (3,), in their coordinates. ImageArea ((x1, y1), (x2, y2)), m, IlluminatorName,
                  ModeID, CountryCode and CollectType may be given
        domain    "FX" or "TOA": samples by frequency, or by time of arrival
        sgn       -1 or +1: the sign of the phase of a return
        version   "1.1.0" or "1.0.1"

        CRSD (a path that ends in .crsd) holds received signals: the echoes of the chirp that was sent, `waveform`, from
        which compression made these samples. It takes origin, axes and metadata as CPHD does, and in metadata too
        TxRefRadIntensity, TxRadIntErrorStdDev, TxRefLAtm, RcvRefIrradiance, RcvIrradianceErrorStdDev, RcvRefLAtm,
        PNCRSD and BNCRSD, in CRSD's units; where the echoes have no waveform TXmt, s, and FxRate, Hz/s, of the chirp.

        ValueError for what a file must have and the echoes lack, with the key of metadata= that gives it.
        `path` may be the file that the samples are read from. Raises ValueError for a NaN or Inf in lazily read
        samples, and FileNotFoundError, PermissionError and the like before anything is written. On any exception `path`
        is unchanged.
        """
        form = formats.named(arguments.path("path", path), [formats.CPHD, formats.CRSD])
        is_plain = (domain, sgn, version) == ("FX", -1, "1.1.0")
        if form is formats.CPHD:
            from ..io.cphd import writing
            from .cphd.collection import CphdOptions, collection_of

            options = CphdOptions(origin, axes, metadata, domain, sgn, version)
            writing.save(path, collection_of(self, options), self.read)
            return
        if (form is None and not origin is axes is metadata is None) or not is_plain:
            raise ValueError(
                f"origin, axes, metadata, domain, sgn and version are for CPHD (of CRSD the first three), and "
                f"{str(path)!r} does not end so"
            )
        if form is formats.CRSD:
            from ..io.cphd import crsd_writing
            from .cphd.collection import CphdOptions
            from .cphd.signals import crsd_of

            options = CphdOptions(origin, axes, metadata, domain, sgn, version, "CRSD")
            crsd_writing.save(path, *crsd_of(self, options), self.read)
            return
        if formats.save_added(path, self):
            return
        writer = formats.writer_functions(path, "phase history").EchoWriter(
            path, self.n_rows, self.n_samples, self.samples.dtype
        )
        try:
            for a, b in hdf5.blocks(writer.samples):
                writer.samples[a:b] = self.read(a, b)
            writer.close(phase_history_fields(self))
        finally:
            writer.abandon()


def phase_history_fields(raw: PhaseHistory) -> dict[str, Any]:
    """All fields except the samples, by name, as sarcl's files hold them: rx is None where it is tx."""
    names = ("frequency", "frequency_step", "reference_range", "tx", *PER_ROW)
    return {
        **{name: getattr(raw, name) for name in names},
        "rx": None if raw.rx is raw.tx else raw.rx,
        "compressed": bool(raw.compressed),
        "waveform": None if raw.waveform is None else formats.fields_of(raw.waveform),
        "array": None if raw.array is None else formats.fields_of(raw.array),
        "report": raw.report,
        "image_area": raw.image_area,
        "metadata": raw.metadata,
    }
