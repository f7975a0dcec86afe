"""Finished tiles in files beside an unfinished image: a killed run can be continued, and several runs share one image.

IMAGE.parts/ holds job.json, which describes the job, and files bands-FIRST-LAST.tiles, each with the pixels of some
bands of the image's tiling. A file gets its name when it is complete. It holds the fingerprint of its job and a
checksum; a file where either does not match is not used.
"""

from __future__ import annotations

import json
import logging
import os
import re
import secrets
import struct
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from ...base.fingerprint import as_bytes, checker, checksum, kernels, leaves
from ...base.types import PathLike
from ...io import output_paths
from ..engine import ImagePlan, Skipped
from ..focusing_task import FocusingTask
from ..tiling.tiling import Run, Tiling

log = logging.getLogger(__name__)

MAGIC = b"sarcl tiles 2\n"
NAME = re.compile(r"bands-(\d+)-(\d+)\.tiles")
DIGEST = 32  # bytes
FOREIGN = "belongs to another job"  # reason why a file is left alone


def folder_of(path: PathLike) -> Path:
    """The folder for the tile files of image `path`."""
    return Path(f"{output_paths.place(path)}.parts")


class TileStore:
    """The tile files of one job. The constructor creates `folder` and writes the description of the job there.

    ValueError where the folder belongs to another job, OSError where it cannot be created.
    """

    def __init__(self, folder: Path, job: dict[str, Any], tiling: Tiling, dtype: DTypeLike) -> None:
        self.folder, self.tiling, self.dtype = folder, tiling, np.dtype(dtype)
        self.mark = mark(job)
        try:
            folder.mkdir(exist_ok=True)
        except FileExistsError:
            raise NotADirectoryError(
                f"{str(folder)!r} is a file, and finished tiles are kept in a folder of that name; move it away"
            ) from None
        self._sign(job)

    def runs(self) -> list[Run]:
        """Runs of bands that have a file, by the names of the files."""
        return sorted(run for path in _tiles(self.folder) if (run := self._named(path)))

    def found(self, first: int, last: int) -> Iterator[tuple[Run, np.ndarray, Skipped]]:
        """Complete files of this job with any of bands first ... last - 1, no band twice: (run, pixels, pairs skipped).

        A damaged file is removed, a file of another job is left alone; the log warns of both.
        """
        end = 0
        for a, b in self.runs():
            if a < end or b <= first or a >= last:
                continue
            path = self._path(a, b)
            values, skipped, why = self._read(path, a, b)
            if values is None:
                log.warning("%s %s: its tiles are made again", path, why)
                if why != FOREIGN:
                    path.unlink(missing_ok=True)
                continue
            end = b
            yield (a, b), values, skipped

    def save(self, first: int, last: int, parts: Iterable[np.ndarray], skipped: Skipped) -> None:
        """Write the pixels of bands first ... last - 1, given in parts, to a file, completely or not at all."""
        head = {"job": self.mark, "first": first, "last": last, "dtype": self.dtype.str, "skipped": asdict(skipped)}
        text = json.dumps(head).encode()
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
        return (first, last) if first < last <= self.tiling.n_bands and path == self._path(first, last) else None

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

    def _read(self, path: Path, first: int, last: int) -> tuple[np.ndarray | None, Skipped, str]:
        """Pixels, pairs skipped and ""; or None and the reason why the file cannot be used."""
        try:
            data = path.read_bytes()
        except OSError as exc:
            return None, Skipped(), f"cannot be read ({exc.strerror})"
        view = memoryview(data)
        start = len(MAGIC) + 8
        if len(data) < start + DIGEST or not data.startswith(MAGIC):
            return None, Skipped(), "is truncated or damaged"
        if checker(view[:-DIGEST]).digest() != data[-DIGEST:]:
            return None, Skipped(), "is truncated or damaged (its checksum differs)"
        start += struct.unpack("<Q", data[len(MAGIC) : start])[0]
        head = json.loads(data[len(MAGIC) + 8 : start])
        if head["job"] != self.mark:
            return None, Skipped(), FOREIGN
        extent = self.tiling.extent(first, last)
        size = self.tiling.count(first, last) * self.dtype.itemsize
        fits = len(data) - DIGEST - start == size and head["dtype"] == self.dtype.str
        if not fits or (head["first"], head["last"]) != (first, last):
            return None, Skipped(), "does not hold what its name says"
        values = np.frombuffer(data, self.dtype, size // self.dtype.itemsize, start)
        return values.reshape(extent.stop - extent.start, *self.tiling.row_shape), Skipped(**head["skipped"]), ""


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
    """Bands of piece i of n; i runs from 1 to n, or from 0 to n - 1: 0 and n are the same piece.

    Shares begin at multiples of `unit` bands, unless there are more pieces than units.
    """
    i, units = (i - 1) % n, -(-n_bands // unit)
    if units < n:
        unit, units = 1, n_bands
    return i * units // n * unit, min((i + 1) * units // n * unit, n_bands)


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


def _tiles(folder: Path) -> list[Path]:
    return [path for path in folder.glob("bands-*.tiles") if NAME.fullmatch(path.name)]


def job_of(
    task: FocusingTask, method: str, tolerance: float, plan: ImagePlan, tiling: Tiling, dtype: DTypeLike
) -> dict[str, Any]:
    """Everything that the pixels depend on, as text and numbers; arrays, and the samples, as checksums.

    The device and its memory are left out: they change nothing but rounding. Reads all samples. TypeError for an option
    that cannot be described.
    """
    from ...base.version import __version__

    raw, grid, antennas = task.raw, task.grid, task.antennas
    samples = checker()
    step = max(1, 2**24 // (raw.n_samples * np.dtype(raw.samples.dtype).itemsize))
    for start in range(0, raw.n_rows, step):
        samples.update(as_bytes(raw.read(start, min(start + step, raw.n_rows))))
    described = {"raw", "grid", "antennas", "sample_weight", "row_weight", "wrap", "skips"}
    others = set(task.__dataclass_fields__) - described
    return {
        "sarcl": f"{__version__}, kernels {kernels()}",
        "method": method,
        "tolerance": tolerance,
        "plan": ", ".join(f"{k} {v}" for k, v in plan.describe(method).items()),
        "pixels": np.dtype(dtype).name,
        "samples": f"{raw.n_rows} x {raw.n_samples} {np.dtype(raw.samples.dtype).name} {samples.hexdigest()[:32]}",
        "antennas": checksum(*leaves(antennas)),
        "weights": checksum(task.sample_weight, task.row_weight),
        "grid": f"{' x '.join(map(str, grid.shape))} {checksum(*leaves(grid))}",
        "bands": tiling.n_bands,
        "wrap": task.wrap,
        "skip": ", ".join(sorted(task.skips)),
        "options": checksum(*(value for name in sorted(others) for value in (name, *leaves(getattr(task, name))))),
    }


def mark(job: dict[str, Any]) -> str:
    """The job's fingerprint."""
    return checksum(json.dumps(job, sort_keys=True))


def difference(stored: dict[str, Any], job: dict[str, Any]) -> str:
    """The differences between two jobs, in words."""
    differences = []
    for name, value in job.items():
        if stored.get(name) != value:
            plain = name in ("sarcl", "method", "tolerance", "pixels", "wrap", "skip")
            differences.append(f"{name} was {stored.get(name)}, is {value}" if plain else f"other {name}")
    return "; ".join(differences) or "other options"
