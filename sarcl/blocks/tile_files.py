"""Finished bands in files beside an unfinished result: a killed run can be continued, and several runs share it.

PATH.parts/ holds job.json, which describes the job, and files bands-FIRST-LAST.tiles, each with the values of some
bands of the result. A file gets its name when it is complete. It holds the fingerprint of its job and a
checksum; a file where either does not match is not used.
"""

from __future__ import annotations

import json
import logging
import math
import os
import re
import secrets
import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from ..base.fingerprint import as_bytes, checker, checksum
from ..base.types import PathLike
from ..io import output_paths
from .bands import Run, Tally
from .block_job import BlockJob

log = logging.getLogger(__name__)

MAGIC = b"sarcl tiles 3\n"
NAME = re.compile(r"bands-(\d+)-(\d+)\.tiles")
DIGEST = 32  # bytes
FOREIGN = "belongs to another job"  # reason why a file is left alone
# entries of a description that a message shows; of others it says that they differ
PLAIN = ("sarcl", "method", "tolerance", "pixels", "wrap", "skip", "polarization", "seed", "variant", "cells")


def folder_of(path: PathLike, job: BlockJob) -> Path:
    """The folder for the tile files of a job, whose result is `path`."""
    return Path(f"{output_paths.place(path)}{job.folder}")


class TileStore:
    """The tile files of one job. The constructor creates `folder` and writes the description of the job there.

    ValueError where the folder belongs to another job, OSError where it cannot be created.
    """

    def __init__(self, folder: Path, job: BlockJob) -> None:
        described = job.describe()
        self.folder, self.bands, self.dtype, self.tally = folder, job.bands, np.dtype(job.dtype), job.tally
        self.mark = mark(described)
        try:
            folder.mkdir(exist_ok=True)
        except FileExistsError:
            raise NotADirectoryError(
                f"{str(folder)!r} is a file, and finished tiles are kept in a folder of that name; move it away"
            ) from None
        self._sign(described)

    def runs(self) -> list[Run]:
        """Runs of bands that have a file, by the names of the files."""
        return sorted(run for path in _tiles(self.folder) if (run := self._named(path)))

    def found(self, first: int, last: int) -> Iterator[tuple[Run, np.ndarray, Tally]]:
        """Complete files of this job with any of bands first ... last - 1, no band twice: (run, values, tally).

        A damaged file is removed, a file of another job is left alone; the log warns of both.
        """
        end = 0
        for a, b in self.runs():
            if a < end or b <= first or a >= last:
                continue
            path = self._path(a, b)
            values, tally, why = self._read(path, a, b)
            if values is None or tally is None:
                log.warning("%s %s: its tiles are made again", path, why)
                if why != FOREIGN:
                    path.unlink(missing_ok=True)
                continue
            end = b
            yield (a, b), values, tally

    def save(self, first: int, last: int, parts: Iterable[np.ndarray], tally: Tally) -> None:
        """Write the values of bands first ... last - 1, given in parts, to a file, completely or not at all."""
        head = {"job": self.mark, "first": first, "last": last, "dtype": self.dtype.str, "tally": asdict(tally)}  # type: ignore[call-overload]
        text = json.dumps(head, default=_plain).encode()
        check = checker()
        temporary = self.folder / f".{secrets.token_hex(8)}.tmp"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)  # it may have been deleted meanwhile
            with open(temporary, "wb") as file:
                start: tuple[Any, ...] = (MAGIC, struct.pack("<Q", len(text)), text)
                for part in chain(start, (as_bytes(p.astype(self.dtype, copy=False)) for p in parts)):
                    file.write(part)
                    check.update(part)
                file.write(check.digest())
            os.replace(temporary, self._path(first, last))
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise

    def clear(self) -> None:
        """Remove the files, and the folder unless something else is in it."""
        discard(self.folder)

    def _path(self, first: int, last: int) -> Path:
        return self.folder / f"bands-{first:06d}-{last:06d}.tiles"

    def _named(self, path: Path) -> Run | None:
        match = NAME.fullmatch(path.name)
        first, last = (int(match[1]), int(match[2])) if match else (0, 0)
        return (first, last) if first < last <= self.bands.n_bands and path == self._path(first, last) else None

    def _sign(self, job: dict[str, Any]) -> None:
        """Write job.json where there is none; ValueError where the job.json of the folder describes another job."""
        path = self.folder / "job.json"
        temporary = self.folder / f".{secrets.token_hex(8)}.tmp"
        temporary.write_text(json.dumps({"fingerprint": self.mark, **job}, indent=1) + "\n")
        try:
            try:
                os.link(temporary, path)  # the first of several runs wins
            except FileExistsError:
                pass
            except OSError:  # a file system without hard links
                if not path.exists():
                    os.replace(temporary, path)
            try:
                there = json.loads(path.read_text())
                other = there.pop("fingerprint") != self.mark
            except (ValueError, KeyError, TypeError, AttributeError, OSError):
                log.warning("%s is damaged and written again; only tiles of this job are used", path)
                os.replace(temporary, path)
                return
        finally:
            temporary.unlink(missing_ok=True)
        if other:
            raise ValueError(
                f"{str(self.folder)!r} holds finished tiles of another job: {difference(there, job)}. Give the "
                "arguments of that job to continue it, or resume=False (--no-resume) to delete its tiles"
            )

    def _read(self, path: Path, first: int, last: int) -> tuple[np.ndarray | None, Tally | None, str]:
        """Values, tally and ""; or None and the reason why the file cannot be used."""
        try:
            data = path.read_bytes()
        except OSError as exc:
            return None, None, f"cannot be read ({exc.strerror})"
        view = memoryview(data)
        start = len(MAGIC) + 8
        if len(data) < start + DIGEST or not data.startswith(MAGIC):
            return None, None, "is truncated or damaged"
        if checker(view[:-DIGEST]).digest() != data[-DIGEST:]:
            return None, None, "is truncated or damaged (its checksum differs)"
        start += struct.unpack("<Q", data[len(MAGIC) : start])[0]
        head = json.loads(data[len(MAGIC) + 8 : start])
        if head["job"] != self.mark:
            return None, None, FOREIGN
        extent = self.bands.extent(first, last)
        shape = extent.stop - extent.start, *self.bands.row_shape
        size = math.prod(shape) * self.dtype.itemsize
        fits = len(data) - DIGEST - start == size and head["dtype"] == self.dtype.str
        if not fits or (head["first"], head["last"]) != (first, last):
            return None, None, "does not hold what its name says"
        values = np.frombuffer(data, self.dtype, size // self.dtype.itemsize, start)
        return values.reshape(shape), self.tally(**head["tally"]), ""


def discard(folder: Path) -> None:
    """Remove all tile files, of any job, from a folder, and the folder if it is empty then."""
    for path in [*_tiles(folder), *folder.glob(".*.tmp"), folder / "job.json"]:
        path.unlink(missing_ok=True)
    try:
        folder.rmdir()
    except FileNotFoundError:
        pass
    except OSError:
        log.warning("%s holds files that are not from sarcl and is not removed", folder)


def share(n_bands: int, i: int, n: int, unit: int = 1) -> Run:
    """Piece i of n of so many bands; i runs from 1 to n, or from 0 to n - 1: 0 and n are the same piece.

    Shares begin at multiples of `unit` bands, unless there are more pieces than units.
    """
    i, units = (i - 1) % n, -(-n_bands // unit)
    if units < n:
        unit, units = 1, n_bands
    return i * units // n * unit, min((i + 1) * units // n * unit, n_bands)


def part(runs: Sequence[Run], first: int, last: int) -> list[Run]:
    """Bands of `runs`, counted one run after the other, from number `first` to number last - 1."""
    out, before = [], 0
    for a, b in runs:
        begin, end = max(a, a + first - before), min(b, a + last - before)
        if begin < end:
            out.append((begin, end))
        before += b - a
    return out


def gaps(runs: list[Run], first: int, last: int) -> list[Run]:
    """Bands first ... last - 1 that are in none of `runs`, in runs."""
    missing = []
    for a, b in sorted(runs):
        if a > first:
            missing.append((first, min(a, last)))
        first = max(first, b)
        if first >= last:
            return missing
    return [*missing, (first, last)] if first < last else missing


def _plain(value: object) -> object:
    """A number of NumPy's as JSON takes it."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot be kept in a file of tiles")


def _tiles(folder: Path) -> list[Path]:
    return [path for path in folder.glob("bands-*.tiles") if NAME.fullmatch(path.name)]


def mark(job: dict[str, Any]) -> str:
    """The job's fingerprint."""
    return checksum(json.dumps(job, sort_keys=True))


def difference(stored: dict[str, Any], job: dict[str, Any]) -> str:
    """The differences between two jobs, in words."""
    differences = []
    for name, value in job.items():
        if stored.get(name) != value:
            plain = name in PLAIN
            differences.append(f"{name} was {stored.get(name)}, is {value}" if plain else f"other {name}")
    return "; ".join(differences) or "other options"
