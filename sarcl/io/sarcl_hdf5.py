"""sarcl's own HDF5 file, read and written: a phase history or an image, every number as it was, to the bit.

Root attributes: sarcl_file = "phase_history" or "image", format = 1. Every field is an attribute (a number or a
word), a dataset (an array) or a group of these (a grid, a waveform, an array of antennas), named as the field of
the Python object; a field that is None is left out. Samples and image data lie row after row, uncompressed, and
are written in blocks of rows. Checksums lie behind the end of the HDF5 file (_checksums.py). Only plain values
come in and out; sarcl/model/store.py makes objects of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _checksums, _hdf5_safety, hdf5, labelled_files
from ._partial_hdf5 import Unfinished
from .formats import Kind, Make, T

if TYPE_CHECKING:
    import h5py
    from numpy.typing import DTypeLike

    from ..base.types import PathLike

FILE_BYTES = 2**17  # bytes of all that is no row and no array: a waveform, a report, HDF5's own tables
ROW_BYTES = 130  # bytes per row besides its samples: its geometry, numbers and the name of its polarisation
# what a file's mark says it holds, and the dataset of that which stays in the file
ROWS: dict[str, tuple[Kind, str]] = {"phase_history": ("phase history", "samples"), "image": ("image", "data")}


def load(path: PathLike, make: Make[T], external: bool = False) -> T:
    """make(kind, fields) of a file of sarcl's; samples or data stay in it as an h5py.Dataset that keeps it open.

    A group of the file is a mapping among the fields; what the file leaves out is no field.
    external  follow links and datasets that lead into other files; sarcl writes none
    Checksums are compared where the file has them: of all but the rows now, of rows when they are read, then OSError.
    ValueError when the file is not HDF5, is truncated or damaged, is not sarcl's, is of a newer format, or leads into
    other files.
    """
    name = str(path)
    sums = _verify_checksums(path)
    file = _open_file(path)
    try:
        try:
            mark, version = file.attrs.get("sarcl_file"), file.attrs.get("format")
            is_netcdf = "_NCProperties" in file.attrs  # NetCDF-4
        except (KeyError, OSError, RuntimeError, TypeError, ValueError) as exc:
            raise ValueError(f"{name!r} is damaged: its attributes cannot be read ({exc}); copy it again") from None
        if not is_netcdf and (not isinstance(mark, str) or mark not in ROWS or version is None):
            raise ValueError(f"{name!r} is HDF5 but not sarcl's (it has no sarcl_file mark); sarcl reads what it saved")
        if not is_netcdf and (np.ndim(version) or version != hdf5.FORMAT):
            raise ValueError(f"{name!r} has format {version}, this sarcl reads format {hdf5.FORMAT}; update sarcl")
        kind, rows = ROWS["image" if is_netcdf else mark]
        try:
            if not external:
                _hdf5_safety.check_links(file)
            if not is_netcdf:
                dataset = _with_checksums(file[rows], sums)
                fields = {**hdf5.get_all(file, leave=("report", rows)), rows: dataset, "report": hdf5.get_report(file)}
                return make(kind, fields)
        except _hdf5_safety.Refused as exc:
            raise ValueError(f"{name!r} {exc}") from None
        except MemoryError as exc:
            raise MemoryError(f"{name!r} holds arrays too large for memory ({exc}); read it elsewhere") from None
        except Exception as exc:  # h5py, json and the objects that are made fail in many ways on a damaged file
            raise ValueError(f"{name!r} is damaged: it holds no whole {kind} ({exc}); save or copy it again") from exc
        file.close()
        return labelled_files.load(Path(path), make)
    except BaseException:
        file.close()
        raise


def open_rows(path: PathLike, name: str) -> h5py.Dataset:
    """The dataset `name` of a file of sarcl's, or of another HDF5 file, with the checksums that the file has for it.

    ValueError where the file is damaged, OSError or KeyError where there is no such file or dataset.
    """
    sums = _verify_checksums(path)
    return _with_checksums(_open_file(path)[name], sums)


def _verify_checksums(path: PathLike) -> _checksums.Checksums | None:
    """Checksums of a file after a check of all but its rows; None where it has none."""
    try:
        return _checksums.of(Path(path))
    except _checksums.Truncated as exc:
        raise ValueError(f"{str(path)!r} is truncated or damaged: {exc}; copy it again") from None
    except _checksums.Damaged as exc:
        raise ValueError(f"{str(path)!r} is damaged: {exc}; save or copy it again") from None


def _open_file(path: PathLike) -> h5py.File:
    import h5py

    try:
        return h5py.File(path, "r", locking="best-effort")
    except OSError as exc:
        what = "truncated" if "truncated" in str(exc) else "not an HDF5 file, or damaged"
        raise ValueError(f"{str(path)!r} is {what} ({exc}); copy it again or give a file saved by sarcl") from None


def _with_checksums(dataset: h5py.Dataset, sums: _checksums.Checksums | None) -> h5py.Dataset:
    """The dataset, with the checksums that a file has for it."""
    from ._checked_rows import CheckedRows

    has_sums = sums is not None and sums.rows is not None and sums.rows[0] == dataset.name.strip("/")
    return CheckedRows(dataset, sums) if sums is not None and has_sums else dataset


def job_of(path: PathLike) -> str | None:
    """The mark of the job that made a file; None where there is no such file, or no mark in a whole file."""
    try:
        _verify_checksums(path)
        with _open_file(path) as file:
            job = file.attrs.get("job")
            return job if isinstance(job, str) else None
    except (OSError, KeyError, RuntimeError, ValueError):
        return None


class _Writer:
    """A file in the making, removed when a step of it fails."""

    _unfinished: Unfinished

    def mark(self, job: str) -> None:
        """Note which job made this file, for `job_of`."""
        with self._unfinished.writing():
            self._unfinished.file.attrs["job"] = job

    def abandon(self) -> None:
        """Remove the unfinished file; `path` is as it was. Nothing happens after `close`."""
        self._unfinished.abandon()

    @contextmanager
    def _abandoned_on_error(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            self.abandon()
            raise

    def _complete(self, fields: Mapping[str, Any]) -> None:
        with self._unfinished.writing():
            _put_fields(self._unfinished.file, fields)
        self._unfinished.commit()


class ImageWriter(_Writer):
    """An image file in the making, also for images larger than memory.

    grid   the fields of the ImageGrid by name; the image has the shape grid["shape"]
    dtype  the type of the pixels
    resumes  the run that makes it goes on from its tiles, for the message of a full disk
    data   of the grid's shape and dtype, read and written in slices like an h5py.Dataset, zero until written; write
           whole rows where you can

    `close` puts the file in its place; `abandon` removes it. As a context manager it abandons what was not closed.
    Raises what `output_paths.check_writable` does, before anything is written, and FileExistsError while another run
    writes the same path.
    """

    def __init__(
        self, path: PathLike, grid: Mapping[str, Any], dtype: DTypeLike = np.complex64, resumes: bool = False
    ) -> None:
        self.path, shape = Path(path), tuple(grid["shape"])
        self._unfinished = Unfinished(path, "image", math.prod(shape) * np.dtype(dtype).itemsize, resumes)
        with self._abandoned_on_error():
            with self._unfinished.writing():
                _put_group(self._unfinished.file, "grid", grid)
            self.data = self._unfinished.dataset("data", shape, dtype)

    def check_open(self) -> None:
        """ValueError where the file was finished or abandoned already."""
        if not self._unfinished.is_open:
            raise ValueError(f"the image file {str(self.path)!r} was finished or abandoned already")

    def close(self, fields: Mapping[str, Any]) -> None:
        """Complete the file with all fields of the image but data and grid, and move it to its path."""
        self.check_open()
        with self._abandoned_on_error():
            self._complete(fields)

    def __enter__(self) -> ImageWriter:
        return self

    def __exit__(self, *exc: object) -> None:
        self.abandon()


class EchoWriter(_Writer):
    """A file of echoes in the making: `samples` (n_rows, n_samples), zero until written; then `close` or `abandon`."""

    def __init__(
        self, path: PathLike, n_rows: int, n_samples: int, dtype: DTypeLike = np.complex64, resumes: bool = False
    ) -> None:
        """resumes  as of ImageWriter"""
        nbytes = n_rows * n_samples * np.dtype(dtype).itemsize
        self.path, self._row_bytes = Path(path), n_rows * ROW_BYTES
        self._unfinished = Unfinished(path, "phase_history", nbytes + self._row_bytes, resumes)
        with self._abandoned_on_error():
            self.samples = self._unfinished.dataset("samples", (n_rows, n_samples), dtype)
            self._unfinished.reserve(nbytes + self._row_bytes)

    def close(self, fields: Mapping[str, Any]) -> None:
        """Complete the file with all fields of the phase history but its samples, and move it to its path."""
        with self._abandoned_on_error():
            array = sum(np.size(value) for value in (fields["array"] or {}).values())
            self._unfinished.reserve(self._row_bytes + 16 * array + FILE_BYTES)
            self._complete(fields)


def _put_fields(file: h5py.File, fields: Mapping[str, Any]) -> None:
    """Write fields in the order given: a mapping as a group, the report as JSON, any other value as `hdf5.put` does."""
    for name, value in fields.items():
        if name == "report":
            hdf5.put_report(file, value)
        elif isinstance(value, Mapping):
            _put_group(file, name, value)
        else:
            hdf5.put(file, name, value)


def _put_group(file: h5py.File, name: str, fields: Mapping[str, Any]) -> None:
    group = file.create_group(name)
    for field, value in fields.items():
        hdf5.put(group, field, value)
