"""sarcl's own HDF5 file: a phase history or an image, every number as it was, to the bit.

Root attributes: sarcl_file = "phase_history" or "image", format = 1. Fields are datasets and attributes of
the nouns' own names; a field that is None is left out. Samples and image data lie row after row,
uncompressed, and are written and read in blocks of rows; a loaded noun keeps the file open and reads what is
asked for.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..base.types import PathLike
    from .image import Image
    from .phase_history import PhaseHistory

from typing import TYPE_CHECKING, Any

import numpy as np

from ..io import hdf5
from ..io.partial_hdf5 import Unfinished

FILE_BYTES = 2**17  # of the rest: a waveform, a report, HDF5's own
ROW_BYTES = 130  # of a row: its geometry, numbers and the name of its polarisation

if TYPE_CHECKING:
    from .image import Image
    from .image_grid import ImageGrid
    from .phase_history import PhaseHistory


def save_phase_history(raw: PhaseHistory, path: Any) -> None:
    """Write a PhaseHistory, its samples in blocks of rows. `path` may be the file its samples are read from.

    ValueError for a NaN or Inf in lazily read samples; FileNotFoundError, PermissionError and the like before
    anything is written. On any exception `path` is as it was.
    """

    writer = EchoWriter(path, raw.n_rows, raw.n_samples, raw.samples.dtype)
    try:
        for a, b in hdf5.blocks(writer.samples):
            writer.samples[a:b] = raw.read(a, b)
        writer.close(raw)
    finally:
        writer.abandon()


def _put_phase_history(file: Any, raw: PhaseHistory) -> None:
    """All but the samples."""
    from .phase_history import PER_ROW

    for name in ("frequency", "frequency_step", "reference_range", "tx", *PER_ROW):
        hdf5.put(file, name, getattr(raw, name))
    if raw.rx is not raw.tx:
        hdf5.put(file, "rx", raw.rx)
    file.attrs["compressed"] = bool(raw.compressed)
    for name, noun in (("waveform", raw.waveform), ("array", raw.array)):
        if noun is not None:
            group = file.create_group(name)
            for field in noun.__dataclass_fields__:
                hdf5.put(group, field, getattr(noun, field))
    hdf5.put_report(file, raw.report)


def save_image(image: Image, path: Any) -> None:
    """Write an Image, complex or real, in blocks of rows; on any exception `path` is as it was."""
    with image_writer(path, image.grid, image.data.dtype) as out:
        for a, b in hdf5.blocks(out.data):
            out.data[a:b] = np.asarray(image.data[a:b])
        out.close(**{name: getattr(image, name) for name in ("gain", "frequency", "tx", "rx", "report")})


def load(path: Any) -> PhaseHistory | Image:
    """Open a file of sarcl's, read-only: samples or data stay in it as an h5py.Dataset that keeps it open.

    ValueError when the file is not HDF5, is truncated or damaged, is not sarcl's, or is of a newer format.
    """
    import h5py

    name = str(path)
    with open(path, "rb"):
        pass  # FileNotFoundError and its like, as Python words them
    try:
        file = h5py.File(path, "r", locking="best-effort")
    except OSError as exc:
        what = "truncated" if "truncated" in str(exc) else "not an HDF5 file, or damaged"
        raise ValueError(f"{name!r} is {what} ({exc}); copy it again or give a file saved by sarcl") from None
    try:
        kind, version = file.attrs.get("sarcl_file"), file.attrs.get("format")
        if not isinstance(kind, str) or kind not in _LOADERS or version is None:
            raise ValueError(f"{name!r} is HDF5 but not sarcl's (it has no sarcl_file mark); sarcl reads what it saved")
        if version != hdf5.FORMAT:
            raise ValueError(f"{name!r} has format {version}, this sarcl reads format {hdf5.FORMAT}; update sarcl")
        try:
            return _LOADERS[kind](file)
        except (KeyError, OSError, RuntimeError, TypeError, ValueError, AttributeError) as exc:
            raise ValueError(f"{name!r} is damaged: it holds no whole {kind} ({exc}); save or copy it again") from exc
    except BaseException:
        file.close()
        raise


class ImageWriter:
    """An image file in the making, for images larger than memory. Made by `image_writer`.

    data   of the grid's shape and dtype, read and written in slices like an h5py.Dataset, zero until written; write
           whole rows where you can
    finish(...) puts the file in its place; abandon() removes it. As a context manager it abandons what was
    not finished. With `claim`, one run at a time makes this file, and takes over what a killed one left.
    """

    def __init__(self, path: Any, grid: ImageGrid, dtype: Any, claim: bool = False) -> None:
        self.path, self.grid = Path(path), grid
        self._made = Unfinished(path, "image", grid.size * np.dtype(dtype).itemsize, claim)
        try:
            with self._made.writing():
                group = self._made.file.create_group("grid")
                for name in grid.__dataclass_fields__:
                    hdf5.put(group, name, getattr(grid, name))
            self.data = self._made.dataset("data", tuple(grid.shape), dtype)
        except BaseException:
            self.abandon()
            raise

    def mark(self, job: str) -> None:
        """Note which job made this file, for `job_of`."""
        with self._made.writing():
            self._made.file.attrs["job"] = job

    def finish(
        self, *, gain: float = 1.0, frequency: Any = None, tx: Any = None, rx: Any = None, report: Any = None
    ) -> Image:
        """Complete the file, move it to its path and return the Image, read from there as it is needed."""
        self.close(gain=gain, frequency=frequency, tx=tx, rx=rx, report=report)
        image: Any = load(self.path)
        return image

    def close(self, **fields: Any) -> None:
        """Complete the file and move it to its path."""
        from .image import Image

        if not self._made.is_open:
            raise ValueError(f"the image file {str(self.path)!r} was finished or abandoned already")
        try:
            image = Image(self.data, self.grid, **fields)  # checks the fields
            with self._made.writing():
                for name in ("gain", "frequency", "tx", "rx"):
                    hdf5.put(self._made.file, name, getattr(image, name))
                hdf5.put_report(self._made.file, image.report)
            self._made.commit()
        except BaseException:
            self.abandon()
            raise

    def abandon(self) -> None:
        """Remove the unfinished file; `path` is as it was. Nothing happens after `finish`."""
        self._made.abandon()

    def __enter__(self) -> ImageWriter:
        return self

    def __exit__(self, *exc: object) -> None:
        self.abandon()


class EchoWriter:
    """A file of echoes in the making: `samples` (n_rows, n_samples), zero until written; then `finish` or `abandon`."""

    def __init__(self, path: Any, n_rows: int, n_samples: int, dtype: Any = np.complex64) -> None:
        self.path, nbytes = Path(path), n_rows * n_samples * np.dtype(dtype).itemsize
        self._made = Unfinished(path, "phase_history", nbytes + n_rows * ROW_BYTES)
        try:
            self.samples = self._made.dataset("samples", (n_rows, n_samples), dtype)
            self._made.reserve(nbytes + n_rows * ROW_BYTES)
        except BaseException:
            self.abandon()
            raise

    def close(self, raw: PhaseHistory) -> None:
        """Complete the file with all of `raw` but its samples, and move it to its path."""
        try:
            array = (
                0 if raw.array is None else sum(np.size(getattr(raw.array, n)) for n in raw.array.__dataclass_fields__)
            )
            self._made.reserve(raw.n_rows * ROW_BYTES + 16 * array + FILE_BYTES)
            with self._made.writing():
                _put_phase_history(self._made.file, raw)
            self._made.commit()
        except BaseException:
            self.abandon()
            raise

    def finish(self, **fields: Any) -> PhaseHistory:
        """Complete the file with the other fields of a PhaseHistory, and return that, read as it is needed."""
        from .phase_history import PhaseHistory

        self.close(PhaseHistory(self.samples, **fields))
        raw: Any = load(self.path)
        return raw

    def abandon(self) -> None:
        """Remove the unfinished file; `path` is as it was. Nothing happens after `close`."""
        self._made.abandon()


def image_writer(path: Any, grid: ImageGrid, dtype: Any = np.complex64, claim: bool = False) -> ImageWriter:
    """Begin an image file of grid.shape and dtype; raises what `paths.check_writable` does, before work."""
    return ImageWriter(path, grid, dtype, claim)


def job_of(path: Any) -> str | None:
    """The mark of the job that made an image file; None where there is no such file, or no mark in it."""
    import h5py

    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            job = file.attrs.get("job")
            return job if isinstance(job, str) else None
    except OSError:
        return None


def _load_phase_history(file: Any) -> PhaseHistory:
    from .antenna_array import AntennaArray
    from .phase_history import PER_ROW, PhaseHistory
    from .waveform import Waveform

    waveform = None
    if "waveform" in file:
        waveform = Waveform(**{n: hdf5.get(file["waveform"], n) for n in Waveform.__dataclass_fields__})
    array = None
    if "array" in file:
        array = AntennaArray(**{n: hdf5.get(file["array"], n) for n in AntennaArray.__dataclass_fields__})
    optional = {n: hdf5.get(file, n) for n in ("rx", *PER_ROW)}
    needed = {n: file[n][...] for n in ("frequency", "frequency_step", "tx", "reference_range")}
    return PhaseHistory(
        file["samples"],
        **needed,
        **optional,
        waveform=waveform,
        array=array,
        compressed=bool(file.attrs["compressed"]),
        report=hdf5.get_report(file),
    )


def _load_image(file: Any) -> Image:
    from .image import Image
    from .image_grid import ImageGrid

    stored = {n: hdf5.get(file["grid"], n) for n in ImageGrid.__dataclass_fields__}
    plane = ("center", "spacing", "x_axis", "y_axis")
    if stored["listed"] is None and any(stored[n] is None for n in plane):
        raise KeyError("its grid is neither a plane nor a list of points")
    stored["shape"] = tuple(int(n) for n in stored["shape"])
    if stored["spacing"] is not None:
        stored["spacing"] = tuple(float(d) for d in stored["spacing"])
    for value in stored.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    fields = {n: hdf5.get(file, n) for n in ("gain", "frequency", "tx", "rx")}
    return Image(file["data"], ImageGrid(**stored), report=hdf5.get_report(file), **fields)


_LOADERS: dict[str, Any] = {"phase_history": _load_phase_history, "image": _load_image}


READABLE = "sarcl's own HDF5 files (raw.save, image.save) and AFRL Gotcha .mat files (MATLAB 5)"


def read(path: PathLike | Sequence[PathLike], *, autofocus: bool = False) -> PhaseHistory | Image:
    """Read a file, or several as one phase history, rows in the order given.

    What a file is follows from its first bytes, not its name. HDF5 written by sarcl gives the PhaseHistory or
    Image it holds, its samples left in the file until they are used; an AFRL Gotcha .mat gives a
    PhaseHistory, with autofocus=True the file's own corrections (af.r_correct, af.ph_correct) applied where it
    has them. They are off by default: measured on azimuth 1-2 deg they sharpen the one reflector they were made
    from, blur the others by 6 % and move the scene by 0.7 m.
    FileNotFoundError names the missing file; ValueError the file that is of no known kind, truncated or
    damaged, or does not fit the others.
    """
    if isinstance(path, (list, tuple)):
        from .phase_history import PhaseHistory, concatenate

        if not path:
            raise ValueError("read was given an empty list of files; give at least one (does the pattern match?)")
        parts = [read(p, autofocus=autofocus) for p in path]
        for name, part in zip(path, parts, strict=True):
            if not isinstance(part, PhaseHistory):
                raise ValueError(f"{str(name)!r} holds an image; only phase histories are read together: read it alone")
        return parts[0] if len(parts) == 1 else concatenate(parts)  # type: ignore[arg-type]
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"path is a {type(path).__name__}; give a file name or a list of file names")
    path = Path(path)
    kind = _kind(path)
    if kind == "hdf5":
        return load(path)
    from ..io import gotcha
    from .phase_history import PhaseHistory

    return PhaseHistory(**gotcha.load(path, autofocus))


def _kind(path: Path) -> str:
    """ "hdf5" or "mat", from the first bytes; ValueError for anything else."""
    if path.is_dir():
        raise IsADirectoryError(
            f"{str(path)!r} is a folder; give the files in it, e.g. sorted(Path(folder).glob('*.mat'))"
        )
    try:
        with open(path, "rb") as file:
            head = file.read(520)
    except FileNotFoundError:
        raise FileNotFoundError(f"{str(path)!r} does not exist; check the name and the folder") from None
    if head.startswith(b"\x89HDF\r\n\x1a\n"):
        return "hdf5"
    if head.startswith(b"MATLAB 5.0 MAT-file"):
        return "mat"
    if not head:
        what = "is empty"
    elif head.startswith(b"MATLAB 7.3"):
        what = "is a MATLAB 7.3 file (save it again with -v7)"
    elif head.startswith(b"CPHD/"):
        what = "is a CPHD file, which sarcl does not read yet"
    else:
        what = f"starts with {head[:12]!r}, which is no file kind sarcl knows"
    named = f" although its name ends in {path.suffix!r}" if path.suffix.lower() in (".h5", ".hdf5", ".mat") else ""
    raise ValueError(f"{str(path)!r} {what}{named}; sarcl reads {READABLE}")
