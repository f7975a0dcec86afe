"""sarcl's own HDF5 file: a phase history or an image, every number as it was, to the bit.

Root attributes: sarcl_file = "phase_history" or "image", format = 1. Fields are datasets and attributes of
the nouns' own names; a field that is None is left out. Samples and image data lie row after row,
uncompressed, and are written and read in blocks of rows; a loaded noun keeps the file open and reads what is
asked for.
"""

from __future__ import annotations

import errno
import logging
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import hdf5, paths

log = logging.getLogger(__name__)

if TYPE_CHECKING:
    from ..grid import ImageGrid
    from ..image import Image
    from ..phase_history import PhaseHistory


def save_phase_history(raw: PhaseHistory, path: Any) -> None:
    """Write a PhaseHistory, its samples in blocks of rows. `path` may be the file its samples are read from.

    ValueError for a NaN or Inf in lazily read samples; FileNotFoundError, PermissionError and the like before
    anything is written. On any exception `path` is as it was.
    """
    import h5py

    from ..phase_history import PER_ROW

    dtype = np.dtype(raw.samples.dtype)
    with (
        paths.atomic(path, raw.n_rows * raw.n_samples * dtype.itemsize) as part,
        h5py.File(part, "w") as file,
    ):
        hdf5.sign(file, "phase_history")
        for name in ("frequency", "frequency_step", "reference_range", "tx", *PER_ROW):
            hdf5.put(file, name, getattr(raw, name))
        if raw.rx is not raw.tx:
            hdf5.put(file, "rx", raw.rx)
        file.attrs["compressed"] = bool(raw.compressed)
        if raw.waveform is not None:
            group = file.create_group("waveform")
            for name in raw.waveform.__dataclass_fields__:
                hdf5.put(group, name, getattr(raw.waveform, name))
        if raw.array is not None:
            group = file.create_group("array")
            for name in raw.array.__dataclass_fields__:
                hdf5.put(group, name, getattr(raw.array, name))
        hdf5.put_report(file, raw.report)
        samples = file.create_dataset("samples", (raw.n_rows, raw.n_samples), dtype)
        for a, b in hdf5.blocks(samples):
            samples[a:b] = raw.read(a, b)


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
    A write that fails, on a full disk, raises OSError with what would do.
    finish(...) puts the file in its place; abandon() removes it. As a context manager it abandons what was
    not finished. With `claim`, one run at a time makes this file, and takes over what a killed one left.
    """

    def __init__(self, path: Any, grid: ImageGrid, dtype: Any, claim: bool = False) -> None:
        import h5py

        self.path, self.grid = Path(path), grid
        dtype = np.dtype(dtype)
        nbytes = self._wanted = grid.size * dtype.itemsize
        self._part: Path | None
        self._lock: int | None
        self._part, self._lock = paths.claim(path, nbytes) if claim else (paths.begin(path, nbytes), None)
        try:
            with self._writing():
                # our own lock is held already, and HDF5's would collide with it
                self._file = h5py.File(self._part, "w", locking=False if claim else None)
                hdf5.sign(self._file, "image")
                group = self._file.create_group("grid")
                for name in grid.__dataclass_fields__:
                    hdf5.put(group, name, getattr(grid, name))
                self.data = _Pixels(self, self._file.create_dataset("data", tuple(grid.shape), dtype))
        except BaseException:
            self.abandon()
            raise

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Turn what HDF5 says of a failed write into what to do about it."""
        try:
            yield
        except (OSError, RuntimeError) as exc:  # h5py raises either for the same full disk
            found = re.search(r"errno = (\d+)", str(exc))
            number = int(found[1]) if found else getattr(exc, "errno", None)
            why = os.strerror(number) if number else " ".join(str(exc).split())[:100]
            free, wanted = shutil.disk_usage(self.path.parent or ".").free, self._wanted
            room = "raise the limit on files' sizes (ulimit -f)" if number == errno.EFBIG else "make room there"
            remedy = f"{room} for {wanted / 1e9:.2f} GB and give the same call again"
            if self._lock is not None:
                remedy += "; it goes on from its tiles where some were kept"
            text = f"cannot write {str(self.path)!r}: {why}; the image needs {wanted / 1e9:.2f} GB, its disk has "
            text += f"{free / 1e9:.2f} GB free: {remedy}"
            raise OSError(text) from exc

    def mark(self, job: str) -> None:
        """Note which job made this file, for `job_of`."""
        with self._writing():
            self._file.attrs["job"] = job

    def finish(
        self, *, gain: float = 1.0, frequency: Any = None, tx: Any = None, rx: Any = None, report: Any = None
    ) -> Image:
        """Complete the file, move it to its path and return the Image, read from there as it is needed."""
        self.close(gain=gain, frequency=frequency, tx=tx, rx=rx, report=report)
        image: Any = load(self.path)
        return image

    def close(self, **fields: Any) -> None:
        """Complete the file and move it to its path."""
        from ..image import Image

        if self._part is None:
            raise ValueError(f"the image file {str(self.path)!r} was finished or abandoned already")
        try:
            image = Image(self.data, self.grid, **fields)  # checks the fields
            with self._writing():
                for name in ("gain", "frequency", "tx", "rx"):
                    hdf5.put(self._file, name, getattr(image, name))
                hdf5.put_report(self._file, image.report)
                self._file.close()
            paths.commit(self._part, self.path)
            self._part = None
            self._unlock()
        except BaseException:
            self.abandon()
            raise

    def abandon(self) -> None:
        """Remove the unfinished file; `path` is as it was. Nothing happens after `finish`."""
        if self._part is not None:
            part, self._part = self._part, None
            try:
                if hasattr(self, "_file"):
                    self._file.close()
            except (OSError, RuntimeError) as exc:  # HDF5 cannot write what it still holds: nobody wants it
                log.debug("%s could not be closed in order: %s", part, exc)
            finally:
                part.unlink(missing_ok=True)
                self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> ImageWriter:
        return self

    def __exit__(self, *exc: object) -> None:
        self.abandon()


class _Pixels:
    """The dataset of an image in the making."""

    def __init__(self, writer: ImageWriter, dataset: Any) -> None:
        self.writer, self.dataset = writer, dataset
        self.shape, self.dtype = dataset.shape, dataset.dtype

    def __getitem__(self, at: Any) -> Any:
        return self.dataset[at]

    def __setitem__(self, at: Any, values: Any) -> None:
        with self.writer._writing():
            self.dataset[at] = values


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
    from ..array import AntennaArray
    from ..phase_history import PER_ROW, PhaseHistory
    from ..waveform import Waveform

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
    from ..grid import ImageGrid
    from ..image import Image

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
