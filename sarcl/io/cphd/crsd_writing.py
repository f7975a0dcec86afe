"""A CRSD file of a collection: records of the chirps that an antenna would receive of it, by blocks of rows.

Equations: docs/theory/cphd.md, _pulses.py.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.types import PathLike
from .. import output_paths
from ..sarkit_library import library as sarkit_module
from ._product import ChannelRows
from ._pulses import Records
from .writing import BLOCK_BYTES, OVERSAMPLING, Collection

PAIR = np.dtype([("Int", np.int64), ("Frac", np.float64)])
VECTOR, COSINES = np.dtype((np.float64, (3,))), np.dtype((np.float64, (2,)))
# parameters of pulses and of vectors in the order of the file; those that are no float64
PULSE = "TxTime TxPos TxVel FX1 FX2 TXmt PhiX0 FxFreq0 FxRate TxRadInt TxACX TxACY TxEB FxResponseIndex".split()
RECEIVED = (
    "RcvStart RcvPos RcvVel FRCV1 FRCV2 RefPhi0 RefFreq DFIC0 FICRate RcvACX RcvACY RcvEB SIGNAL AmpSF DGRGC".split()
)
KINDS: dict[str, np.dtype[Any]] = dict.fromkeys(("TxTime", "PhiX0", "RcvStart", "RefPhi0"), PAIR)
KINDS |= dict.fromkeys(("TxEB", "RcvEB"), COSINES)
KINDS |= dict.fromkeys("TxPos TxVel TxACX TxACY RcvPos RcvVel RcvACX RcvACY".split(), VECTOR)
KINDS |= dict.fromkeys(("FxResponseIndex", "SIGNAL", "TxPulseIndex"), np.dtype(np.int64))


@dataclass(frozen=True, eq=False)
class Signals:
    """What a CRSD file says beyond its collection: the pulses that were sent, and radiometry.

    duration, sweep, bandwidth   of the chirps, s, Hz/s, Hz;  carrier  Hz (n_rows,)
    numbers  by the names of their elements
    """

    duration: float
    sweep: float
    bandwidth: float
    carrier: np.ndarray
    numbers: dict[str, float]


def kinds_of(names: list[str]) -> np.dtype[Any]:
    """Type of the parameters of a pulse, or of a vector."""
    return np.dtype([(name, KINDS.get(name, np.dtype(np.float64))) for name in names])


@dataclass(frozen=True, eq=False)
class SentPulses:
    """A sequence of pulses of one antenna: its Identifier, polarisation, and a row of the collection for each."""

    name: str
    polarization: str
    rows: np.ndarray


@dataclass(frozen=True, eq=False)
class ReceivedChannel:
    """A channel, the sequence of its pulses, their numbers in it, and its records."""

    rows: ChannelRows
    sequence: SentPulses
    pulses: np.ndarray
    records: Records


@dataclass(frozen=True, eq=False)
class Crsd:
    """A collection and its signals, as a CRSD file has them."""

    library: ModuleType
    collection: Collection
    signals: Signals

    @cached_property
    def sequences(self) -> list[SentPulses]:
        """Pulses by antenna, polarisation and carrier; ValueError where pulses of one time are not one pulse."""
        c, members = self.collection, dict[tuple[int, str, float], list[np.ndarray]]()
        for each in c.channels:
            members.setdefault(self._key(each), []).append(each.rows)
        sequences = []
        for number, (key, parts) in enumerate(members.items()):
            rows = np.concatenate(parts)
            _, first, which = np.unique(c.time[rows], return_index=True, return_inverse=True)
            for name, values in (("tx", c.tx), ("carrier", self.signals.carrier[:, None])):
                if np.abs(values[rows] - values[rows[first]][which]).max() > 1e-6:
                    raise ValueError(f"rows of one time and transmitting channel, {key[0]}, differ in {name}")
            sequences.append(SentPulses(f"{number + 1}", key[1], rows[first]))
        return sequences

    def _key(self, channel: ChannelRows) -> tuple[int, str, float]:
        return channel.antennas[0], channel.polarizations[0], float(self.signals.carrier[channel.rows[0]])

    @cached_property
    def channels(self) -> list[ReceivedChannel]:
        """Channels with their records, whose samples lie on one clock each."""
        keys = list(dict.fromkeys(self._key(each) for each in self.collection.channels))
        return [self._channel(each, self.sequences[keys.index(self._key(each))]) for each in self.collection.channels]

    def _channel(self, channel: ChannelRows, sequence: SentPulses) -> ReceivedChannel:
        c, rows = self.collection, channel.rows
        step = float(c.frequency_step[rows[0]])
        if np.ptp(c.frequency_step[rows]):
            raise ValueError("frequency_step differs from row to row, and a CRSD channel has one sampling rate")
        n = max(2, int(np.ceil(OVERSAMPLING * c.n_samples)))
        offset = c.frequency[rows] - self.signals.carrier[rows]
        empty = Records(n * step, 0, self.signals.duration, self.signals.sweep, np.zeros(0), offset)
        n, rate = n + empty.n_zeros, empty.rate
        delay = 2 * c.reference_range[rows] / SPEED_OF_LIGHT
        wanted = c.time[rows] + delay - n // 2 / rate
        start = wanted[0] + np.rint((wanted - wanted[0]) * rate) / rate
        if len(rows) > 1 and np.diff(start).min() < n / rate:
            raise ValueError(
                f"pulses follow after {np.diff(c.time[rows]).min():g} s, and records of the swath and the pulse last "
                f"{n / rate:g} s, which CRSD wants apart; give a shorter TXmt or duration, or rows of a smaller swath"
            )
        after = since(pairs(start), pairs(c.time[rows]))
        records = Records(rate, n, self.signals.duration, self.signals.sweep, after - delay, offset)
        pulses = np.searchsorted(c.time[sequence.rows], c.time[rows])
        return ReceivedChannel(channel, sequence, pulses, records)

    def pulses_of(self, sequence: SentPulses) -> np.ndarray:
        """Parameters of the pulses of a sequence."""
        c, rows = self.collection, sequence.rows
        ppp = np.zeros(len(rows), kinds_of(PULSE))
        carrier, half = self.signals.carrier[rows], self.signals.bandwidth / 2
        ppp["TxTime"], ppp["TxPos"], ppp["TxVel"] = pairs(c.time[rows]), c.tx[rows], c.tx_velocity[rows]
        ppp["FX1"], ppp["FX2"], ppp["TXmt"] = carrier - half, carrier + half, self.signals.duration
        ppp["FxFreq0"], ppp["FxRate"] = carrier, self.signals.sweep
        ppp["TxRadInt"] = self.signals.numbers["TxRefRadIntensity"]
        ppp["TxACX"], ppp["TxACY"], _ = self.library.compute_h_v_los_unit_vectors(c.tx[rows], c.reference_point)
        return ppp

    def vectors_of(self, channel: ReceivedChannel) -> np.ndarray:
        """Parameters of the vectors of a channel."""
        c, rows, records = self.collection, channel.rows.rows, channel.records
        pvp = np.zeros(len(rows), kinds_of([*RECEIVED, "TxPulseIndex"]))
        after = records.start + 2 * c.reference_range[rows] / SPEED_OF_LIGHT  # s, of sample 0 after the pulse
        pvp["RcvStart"] = pairs(c.time[rows], after)
        late = after - c.delay[rows]  # s, of sample 0 after the echo of the reference point
        pvp["RcvPos"] = c.rx[rows] + c.rx_velocity[rows] * late[:, None]
        pvp["RcvVel"] = c.rx_velocity[rows]
        step = c.frequency_step[rows]
        pvp["FRCV1"] = c.frequency[rows] - step / 2
        pvp["FRCV2"] = c.frequency[rows] + (c.n_samples - 0.5) * step
        pvp["RefPhi0"] = pairs(self.signals.carrier[rows] * records.start)
        pvp["RefFreq"], pvp["SIGNAL"], pvp["AmpSF"] = self.signals.carrier[rows], 1, 1.0
        pvp["RcvACX"], pvp["RcvACY"], _ = self.library.compute_h_v_los_unit_vectors(pvp["RcvPos"], c.reference_point)
        pvp["TxPulseIndex"] = channel.pulses
        return pvp


def pairs(values: np.ndarray, more: np.ndarray | float = 0.0) -> np.ndarray:
    """Whole numbers and fractions, 0 <= fraction < 1, of values + more: as exact as `more` where values are large."""
    out = np.zeros(len(values), PAIR)
    integers = np.floor(values)
    part = values - integers + more
    out["Int"], out["Frac"] = integers + np.floor(part), part - np.floor(part)
    out["Int"] += out["Frac"] >= 1
    out["Frac"][out["Frac"] >= 1] = 0.0
    return out


def since(late: np.ndarray, early: np.ndarray) -> np.ndarray:
    """Differences of pairs."""
    return np.asarray((late["Int"] - early["Int"]) + (late["Frac"] - early["Frac"]))


def save(path: PathLike, collection: Collection, signals: Signals, read: Callable[[int, int], np.ndarray]) -> None:
    """Write a collection to `path`, whole or not at all; read(start, stop) gives samples of rows."""
    from ._crsd_product import FLAT, LEVEL, product

    library = sarkit_module("crsd")
    crsd = Crsd(library, collection, signals)
    tree = product(crsd)
    n_bytes = sum(8 * len(each.rows.rows) * each.records.n for each in crsd.channels)
    with output_paths.atomic(path, n_bytes) as part, open(part, "r+b") as file:
        writer = library.Writer(file, library.Metadata(xmltree=tree))
        writer.write_support_array(FLAT, np.zeros((3, 3), [("Gain", "f4"), ("Phase", "f4")]))
        for sequence in crsd.sequences:
            level = np.array([[(1, 0)] * 3], [("Amp", "f4"), ("Phase", "f4")])
            writer.write_support_array(f"{LEVEL}{sequence.name}", level)
            writer.write_ppp(sequence.name, crsd.pulses_of(sequence))
        for channel in crsd.channels:
            writer.write_pvp(channel.rows.name, crsd.vectors_of(channel))
        file.seek(0)
        _, keys = library.read_file_header(io.BytesIO(file.read(2**16)))
        for offset, block in _blocks(crsd, read):
            file.seek(int(keys["SIGNAL_BLOCK_BYTE_OFFSET"]) + offset)
            file.write(block.astype(">c8").tobytes())


def _blocks(crsd: Crsd, read: Callable[[int, int], np.ndarray]) -> Iterator[tuple[int, np.ndarray]]:
    """Byte offsets in the signal block, and records of consecutive vectors."""
    n_rows = len(crsd.collection.time)
    step = max(1, BLOCK_BYTES // (8 * max(each.records.n for each in crsd.channels)))
    for a in range(0, n_rows, step):
        samples = read(a, min(a + step, n_rows))
        first = 0
        for channel in crsd.channels:
            rows, vector = channel.rows.rows, 8 * channel.records.n
            low, high = (int(k) for k in np.searchsorted(rows, (a, a + step)))
            if high > low:
                yield first + low * vector, channel.records.received(samples[rows[low:high] - a], slice(low, high))
            first += len(rows) * vector
