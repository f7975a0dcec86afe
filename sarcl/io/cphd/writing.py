"""A CPHD file of a collection: channels, per-vector parameters, XML, and samples by blocks of rows.

Equations: docs/theory/cphd.md.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import IO

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.types import PathLike
from .. import output_paths
from ..sarkit_library import library as sarkit_module
from ._domains import records
from ._product import SIZES, ChannelRows, kind_of, product

OVERSAMPLING = 1.2  # of samples over the band or swath that is declared: the standard wants 1.1 at least, better 1.2
ROUNDING = 4  # of ranges, in units of the last place of Earth-fixed coordinates, in which they are computed
BLOCK_BYTES = 2**24  # bytes of samples of a block of rows, about


@dataclass(frozen=True, eq=False)
class Collection:
    """What a CPHD file says, Earth-fixed, SI units; arrays have one entry per row.

    channels     rows (increasing) of each channel, with its name and the names of its polarisations
    time         of transmission, s after `start`;  reference_point  m (3,)
    surface      unit vectors of the plane through the reference point, along x and y (2, 3)
    area         (x1, y1), (x2, y2) of the image area on it, m
    names        text of CollectionID by element
    """

    channels: tuple[ChannelRows, ...]
    n_samples: int
    frequency: np.ndarray
    frequency_step: np.ndarray
    reference_range: np.ndarray
    time: np.ndarray
    tx: np.ndarray
    rx: np.ndarray
    tx_velocity: np.ndarray
    rx_velocity: np.ndarray
    reference_point: np.ndarray
    surface: np.ndarray
    area: np.ndarray
    start: np.datetime64
    names: dict[str, str]
    domain: str
    sgn: int
    version: str

    @cached_property
    def delay(self) -> np.ndarray:
        """Delay of the reference point, s (n_rows,)."""
        point = self.reference_point
        path = np.linalg.norm(self.tx - point, axis=1) + np.linalg.norm(point - self.rx, axis=1)
        return np.asarray(path / SPEED_OF_LIGHT)

    @cached_property
    def advance(self) -> np.ndarray:
        """Delay of the reference of the samples after that of the reference point, s (n_rows,); 0 if it is rounding."""
        later = 2 * self.reference_range / SPEED_OF_LIGHT - self.delay
        return np.where(np.abs(later) <= ROUNDING * np.spacing(np.abs(self.tx).max()) / SPEED_OF_LIGHT, 0.0, later)

    @property
    def n_stored(self) -> int:
        """Samples of a vector in the file."""
        return self.n_samples if self.domain == "FX" else max(2, int(np.ceil(OVERSAMPLING * self.n_samples)))


def save(path: PathLike, collection: Collection, read: Callable[[int, int], np.ndarray]) -> None:
    """Write a collection to `path`, whole or not at all; read(start, stop) gives samples of rows."""
    library = sarkit_module("cphd")
    pvps = [_parameters(collection, library, each.rows) for each in collection.channels]
    tree = product(library, collection, pvps)
    n_rows = len(collection.time)
    with output_paths.atomic(path, 8 * n_rows * collection.n_stored) as part, open(part, "r+b") as file:
        writer = library.Writer(file, library.Metadata(xmltree=tree))
        for channel, pvp in zip(collection.channels, pvps, strict=True):
            writer.write_pvp(channel.name, pvp)
        for offset, block in _blocks(file, library, collection, read):
            file.seek(offset)
            file.write(block.astype(">c8").tobytes())


def _blocks(
    file: IO[bytes], library: ModuleType, collection: Collection, read: Callable[[int, int], np.ndarray]
) -> Iterator[tuple[int, np.ndarray]]:
    """Byte offsets and samples of consecutive vectors."""
    file.seek(0)
    _, keys = library.read_file_header(io.BytesIO(file.read(2**16)))
    start, vector = int(keys["SIGNAL_BLOCK_BYTE_OFFSET"]), 8 * collection.n_stored
    n_rows = len(collection.time)
    step = max(1, BLOCK_BYTES // vector)
    for a in range(0, n_rows, step):
        b = min(a + step, n_rows)
        samples = _stored(collection, read(a, b), slice(a, b))
        first = start
        for channel in collection.channels:
            low, high = np.searchsorted(channel.rows, (a, b))
            if high > low:
                yield first + int(low) * vector, samples[channel.rows[low:high] - a]
            first += len(channel.rows) * vector


def _stored(collection: Collection, samples: np.ndarray, rows: slice) -> np.ndarray:
    """Samples of some rows relative to the reference point, in the domain and of the sign of the file."""
    step, advance = collection.frequency_step[rows], collection.advance[rows]
    if advance.any():
        frequency = collection.frequency[rows, None] + np.arange(collection.n_samples) * step[:, None]
        cycles = frequency * advance[:, None]
        samples = samples * np.exp(-2j * np.pi * (cycles - np.rint(cycles)))
    if collection.domain == "TOA":
        samples = records(samples, step, advance, collection.n_stored)
    return samples.conj() if collection.sgn > 0 else samples


def _parameters(collection: Collection, library: ModuleType, rows: np.ndarray) -> np.ndarray:
    """Per-vector parameters of some rows."""
    pvp = np.zeros(len(rows), np.dtype([(name, kind_of(name)) for name in SIZES]))
    step, low = collection.frequency_step[rows], collection.frequency[rows]
    tx, rx, point = collection.tx[rows], collection.rx[rows], collection.reference_point
    pvp["TxTime"], pvp["RcvTime"] = collection.time[rows], collection.time[rows] + collection.delay[rows]
    pvp["TxPos"], pvp["RcvPos"], pvp["SRPPos"] = tx, rx, point
    pvp["TxVel"], pvp["RcvVel"] = collection.tx_velocity[rows], collection.rx_velocity[rows]
    n, half = collection.n_samples, 1 / (2 * OVERSAMPLING * step)
    advance = collection.advance[rows]
    pvp["TOA1"], pvp["TOA2"] = advance - half, advance + half
    if collection.domain == "FX":
        beyond = step / 2 if n == 1 else 0.0  # one sample is a band of a step: FX2 must exceed FX1
        pvp["FX1"], pvp["FX2"], pvp["SC0"], pvp["SCSS"] = low - beyond, low + (n - 1) * step + beyond, low, step
    else:
        spacing = 1 / (collection.n_stored * step)
        pvp["FX1"], pvp["FX2"] = low - step / 2, low + (n - 0.5) * step
        pvp["SC0"], pvp["SCSS"] = advance - collection.n_stored // 2 * spacing, spacing
    pvp["SIGNAL"] = 1
    return pvp
