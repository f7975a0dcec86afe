"""A CRSD file of the echoes of chirps as the fields of a compressed phase history. Equations: _pulses.py."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import IO, Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ..formats import Make, T
from ..sarkit_library import Element, Reader, Refused, made_of, opened, parsing, text_of
from ..sarkit_library import library as sarkit_module
from ._channels import ENDS, Channel, chosen
from ._pulses import Records
from ._reading import header, image_area, joined, refuse_any, text
from ._signal_rows import VectorRows
from .crsd_writing import since

FINITE = ("TxTime", "TxPos", "TxVel", "RcvStart", "RcvPos", "RcvVel", "FRCV1", "FRCV2", "RefPhi0", "PhiX0")
POSITIVE = ("TXmt", "FxFreq0", "RefFreq", "AmpSF", "FRCV1")
STEPS = 4  # iterations of the time at which the echo of the reference point arrives: 1e-5 of the error before, each


def load(
    source: Path | IO[bytes], make: Make[T], channel: str | int | None = None, polarization: str | None = None
) -> T:
    """make("phase history", fields) of a CRSD file; samples stay in it, and are compressed when they are read.

    source, channel, polarization   as of CPHD
    ValueError, which names the file: truncated, damaged, another version or kind, pulses that are no chirps, dechirped
    or compressed signals, parameters that are not finite, channels that do not fit. ImportError without sarkit.
    """
    library = sarkit_module("crsd")
    with opened(source) as (file, name):
        with parsing(name):
            reader, first = _reader(library, file)
            tree = reader.metadata.xmltree
            selection = chosen(_channels(tree.getroot()), channel, polarization)
            parts = [_rows(reader, file, first, each) for each in selection]
            fields = {field: joined([part[field] for part in parts]) for field in parts[0] if field != "waveform"}
            pulses = [part["waveform"] for part in parts]
            if all(each == pulses[0] for each in pulses):
                fields["waveform"] = pulses[0]
            if np.abs(fields["rx"] - fields["tx"]).max() < 4 * np.spacing(np.abs(fields["tx"]).max()):
                fields["rx"] = None
            fields |= {"image_area": image_area(library, tree), "metadata": text(reader)}
        return made_of(make, "phase history", fields, name)


def _reader(library: ModuleType, file: IO[bytes]) -> tuple[Reader, int]:
    """sarkit's reader of an open file with all its blocks, and the byte at which its signals begin."""
    keys = header(library, file, ("CRSDsar/1.0",), ("XML", "SUPPORT", "PPP", "PVP", "SIGNAL"))
    reader = library.Reader(file)
    root = reader.metadata.xmltree.getroot()
    if root.find("{*}Data/{*}Receive/{*}SignalCompression") is not None:
        raise Refused("has a compressed signal, which CRSD leaves to each producer; have it written uncompressed")
    if text_of(root, "TxSequence/TxWFType") != "LFM":
        raise Refused(f"has pulses of type {text_of(root, 'TxSequence/TxWFType')!r:.20}; sarcl reads chirps, LFM")
    row = library.binary_format_string_to_dtype(text_of(root, "Data/Receive/SignalArrayFormat")).itemsize
    for each in root.findall("{*}Data/{*}Receive/{*}Channel"):
        n, size = (int(text_of(each, f"Num{of}")) for of in ("Vectors", "Samples"))
        at = int(text_of(each, "SignalArrayByteOffset"))
        if at < 0 or at + n * size * row > int(keys["SIGNAL_BLOCK_SIZE"]):
            raise Refused(f"is damaged: its Signal array of channel {text_of(each, 'ChId')!r} leaves its block")
    return reader, int(keys["SIGNAL_BLOCK_BYTE_OFFSET"])


def _parameters(root: Element, group: str, name: str) -> Element:
    return next(each for each in root.findall(f"{{*}}{group}/{{*}}Parameters") if text_of(each, "Identifier") == name)


def _channels(root: Element) -> list[Channel]:
    """All channels; their numbers of antennas are those that sarcl wrote, or count their phase centres."""
    centres: tuple[dict[str, int], dict[str, int]] = ({}, {})
    channels = []
    for size in root.findall("{*}Data/{*}Receive/{*}Channel"):
        name = text_of(size, "ChId")
        received = _parameters(root, "Channel", name)
        sent = _parameters(root, "TxSequence", text_of(received, "SARImage/TxId"))
        known = {each.get("name"): each.text or "" for each in received.findall("{*}Parameter")}
        ends = text_of(sent, "TxAPCId"), text_of(received, "RcvAPCId")
        numbers = [
            int(known.get(key, ids.setdefault(end, len(ids))))
            for key, ids, end in zip(ENDS, centres, ends, strict=True)
        ]
        kinds = text_of(sent, "TxPolarization/PolarizationID"), text_of(received, "RcvPolarization/PolarizationID")
        channels.append(
            Channel(name, int(text_of(size, "NumVectors")), int(text_of(size, "NumSamples")), kinds, *numbers)
        )
    return channels


def _rows(reader: Reader, file: IO[bytes], first: int, channel: Channel) -> dict[str, Any]:
    """Fields of the rows of a channel, but those without a signal or a pulse."""
    root = reader.metadata.xmltree.getroot()
    received = _parameters(root, "Channel", channel.name)
    pvp = reader.read_pvps(channel.name)
    pvp = pvp.astype(pvp.dtype.newbyteorder("="))
    vectors = np.flatnonzero((pvp["SIGNAL"] == 1) & (pvp["TxPulseIndex"] >= 0))
    if not len(vectors):
        raise Refused(f"has no vector with a signal of a pulse in channel {channel.name!r}; give another channel=")
    pvp = pvp[vectors]
    ppp = reader.read_ppps(text_of(received, "SARImage/TxId"))
    ppp = ppp.astype(ppp.dtype.newbyteorder("="))[pvp["TxPulseIndex"]]
    _check(pvp, ppp, vectors, channel)
    rate = float(text_of(received, "Fs"))
    tx, srp = np.array(ppp["TxPos"]), np.array([float(text_of(received, f"RcvRefPoint/ECF/{axis}")) for axis in "XYZ"])
    after = since(pvp["RcvStart"], ppp["TxTime"])
    rx = np.array(pvp["RcvPos"])
    for _ in range(STEPS):  # where the receiver is when the echo of the reference point arrives
        delay = (np.linalg.norm(tx - srp, axis=1) + np.linalg.norm(srp - rx, axis=1)) / SPEED_OF_LIGHT
        rx = pvp["RcvPos"] + pvp["RcvVel"] * (delay - after)[:, None]
    pulse, sweep = float(ppp["TXmt"][0]), float(ppp["FxRate"][0])
    late = after + channel.n_samples // 2 / rate - delay  # of the middle of the record
    delay += np.where(np.abs(late) <= 1.5 / rate, 0.0, late)
    records = Records(rate, channel.n_samples, pulse, sweep, after - delay, np.zeros(0))
    if records.n_profile < 1:
        raise Refused(f"has records of {channel.n_samples / rate:g} s in channel {channel.name!r}, shorter than pulses")
    n = int(np.clip(np.rint(((pvp["FRCV2"] - pvp["FRCV1"]) / records.step).max()), 1, records.n_profile))
    frequency = (pvp["FRCV1"] + pvp["FRCV2"]) / 2 - (n - 1) / 2 * records.step
    # the mixer follows RefFreq, and the filter of chirps is about FxFreq0
    offset, carrier = frequency - ppp["FxFreq0"], np.array(ppp["FxFreq0"])
    records = Records(rate, channel.n_samples, pulse, sweep, records.start, offset)
    cycles = since(pvp["RefPhi0"], ppp["PhiX0"]) - pvp["RefFreq"] * records.start
    rows = CompressedRows(file, first + _offset(root, channel), channel, vectors, records, (n, _dtype(root)))
    rows.phase = np.exp(2j * np.pi * (cycles - np.rint(cycles)))
    rows.mixer, rows.amplitude = np.array(pvp["RefFreq"]) - carrier, np.array(pvp["AmpSF"])
    return {
        "samples": rows,
        "frequency": np.array(frequency),
        "frequency_step": np.full(len(vectors), records.step),
        "tx": tx,
        "rx": rx,
        "reference_range": SPEED_OF_LIGHT * delay / 2,
        "time": np.array(ppp["TxTime"]["Int"] + ppp["TxTime"]["Frac"]),
        "tx_velocity": np.array(ppp["TxVel"]),
        "rx_velocity": np.array(pvp["RcvVel"]),
        **channel.fields(len(vectors)),
        "waveform": {
            "center": float((ppp["FX1"] + ppp["FX2"])[0] / 2),
            "bandwidth": float((ppp["FX2"] - ppp["FX1"])[0]),
            "duration": pulse,
            "kind": "chirp" if sweep > 0 else "down-chirp",
        },
    }


def _offset(root: Element, channel: Channel) -> int:
    sizes = root.findall("{*}Data/{*}Receive/{*}Channel")
    return int(text_of(next(each for each in sizes if text_of(each, "ChId") == channel.name), "SignalArrayByteOffset"))


def _dtype(root: Element) -> np.dtype[Any]:
    """Type of the samples."""
    kind = sarkit_module("crsd").binary_format_string_to_dtype(text_of(root, "Data/Receive/SignalArrayFormat"))
    return np.dtype(kind.newbyteorder(">"))


def _check(pvp: np.ndarray, ppp: np.ndarray, vectors: np.ndarray, channel: Channel) -> None:
    """Refused names a parameter, and the first vector, that is wrong."""
    for name in (*FINITE, *POSITIVE):
        values = (ppp if name in (ppp.dtype.names or ()) else pvp)[name]
        if values.dtype.names:
            values = values["Frac"]
        values = values.reshape(len(pvp), -1)
        is_bad = ~np.isfinite(values).all(axis=1) | ((values <= 0).any(axis=1) if name in POSITIVE else False)
        refuse_any(is_bad, name, values, vectors, channel, "positive" if name in POSITIVE else "finite")
    if pvp["FICRate"].any() or pvp["DFIC0"].any():
        raise Refused("has dechirped records (FICRate, DFIC0), which sarcl does not read; have them written without")
    for name in ("TXmt", "FxRate"):
        if np.ptp(ppp[name]) or not ppp[name][0] or not np.isfinite(ppp[name][0]):
            raise Refused(
                f"has {name} = {ppp[name].min():g} to {ppp[name].max():g} in channel {channel.name!r}, wanted one"
            )
    middle = (ppp["FX1"] + ppp["FX2"]) / 2
    is_off = ~(np.abs(ppp["FxFreq0"] - middle) <= np.abs(ppp["FxRate"]) * ppp["TXmt"] / 4)  # a quarter of the sweep
    if is_off.any():
        i = int(np.argmax(is_off))
        raise Refused(
            f"has FxFreq0 = {ppp['FxFreq0'][i]:.6g} Hz in channel {channel.name!r}, wanted {middle[i]:.6g} Hz, the "
            "middle of FX1 and FX2: FxFreq0 is the frequency at TxTime, the middle of the pulse; have it written so"
        )
    if not (pvp["FRCV1"] < pvp["FRCV2"]).all():
        raise Refused(f"has FRCV2 not above FRCV1 in channel {channel.name!r}: it is damaged")


class CompressedRows(VectorRows):
    """Compressed spectra of the records of one channel.

    phase  factor per row;  mixer  RefFreq - FxFreq0, Hz;  amplitude  AmpSF
    """

    phase: np.ndarray
    mixer: np.ndarray
    amplitude: np.ndarray

    def __init__(
        self,
        file: IO[bytes],
        first: int,
        channel: Channel,
        vectors: np.ndarray,
        records: Records,
        kind: tuple[int, np.dtype[Any]],
    ) -> None:
        """first  byte of the channel's signal;  kind  frequencies of a row, and the type of samples in the file"""
        super().__init__(file, channel.name, vectors, kind[0])
        self._first, self._channel, self._records, self._kind = first, channel, records, kind[1]

    def _read(self, low: int, high: int) -> np.ndarray:
        size = self._channel.n_samples * self._kind.itemsize
        self._file.seek(self._first + low * size)
        data = self._file.read((high - low) * size)
        return np.frombuffer(data, self._kind).reshape(high - low, -1)

    def _converted(self, samples: np.ndarray, rows: slice) -> np.ndarray:
        records = self._records
        time = records.start[rows, None] + np.arange(records.n) / records.rate
        mix = np.exp(2j * np.pi * self.mixer[rows, None] * time) if self.mixer[rows].any() else 1.0
        factor = (self.phase[rows] * self.amplitude[rows])[:, None]
        return records.compressed(samples * (factor * mix), rows, self.shape[1]).astype(np.complex64)
