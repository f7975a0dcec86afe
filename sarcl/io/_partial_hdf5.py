"""An HDF5 file that is being written: it lies beside its path, and is moved there when it is complete."""

from __future__ import annotations

import errno
import logging
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from . import _checksums, hdf5, output_paths

if TYPE_CHECKING:
    import h5py
    from numpy.typing import ArrayLike, DTypeLike

    from ..base.types import PathLike

log = logging.getLogger(__name__)


class Unfinished:
    """A file of sarcl's that is being written; `file` is its h5py.File, until `commit` or `abandon`.

    kind     what it will hold, for hdf5.sign and in messages;  n_bytes  about its size
    resumes  the run that makes it goes on from its tiles, for the message of a full disk
    One run, or thread, at a time writes a path: FileExistsError tells the others. A write that fails, as on a full
    disk, raises OSError with the remedy. Raises what `output_paths.check_writable` does.
    """

    def __init__(self, path: PathLike, kind: str, n_bytes: int, resumes: bool = False) -> None:
        import h5py

        self.path, self.kind, self.n_bytes, self.resumes = Path(path), kind, n_bytes, resumes
        self._rows: tuple[str, _checksums.RunningSums] | None = None
        self._part: output_paths.Part | None = output_paths.begin(path, n_bytes, alone=True)
        try:
            with self.writing():
                # our own lock is held already, and HDF5's would collide with it
                self.file = h5py.File(self._part.path, "w", locking=False)
                hdf5.sign(self.file, kind)
        except BaseException:
            self.abandon()
            raise

    @property
    def is_open(self) -> bool:
        """Neither committed nor abandoned."""
        return self._part is not None

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turn an error of HDF5 about a failed write into one that names the file, the space and the remedy."""
        try:
            yield
        except (OSError, RuntimeError) as exc:  # h5py raises either for the same full disk
            match = re.search(r"errno = (\d+)", str(exc))
            number = int(match[1]) if match else getattr(exc, "errno", None)
            why = os.strerror(number) if number else " ".join(str(exc).split())[:100]
            more = " and give the same call again"
            if self.resumes:
                more += "; it goes on from its tiles where some were kept"
            what = f"the {self.kind.replace('_', ' ')}"
            raise output_paths.no_room(self.path, OSError(number, why), self.n_bytes, what, more) from exc

    def dataset(self, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> Filled:
        """The dataset of the file's rows, zero until written; it gets checksums by blocks."""
        sums = _checksums.RunningSums(shape, dtype)
        self._rows = name, sums
        with self.writing():
            return Filled(self, self.file.create_dataset(name, shape, dtype), sums)

    def reserve(self, n_bytes: int) -> None:
        """Allocate n_bytes more on the disk. Without them HDF5 may lose data, or crash, when it closes a dataset."""
        if not hasattr(os, "posix_fallocate"):
            return
        with self.writing():
            self.file.flush()
            descriptor = self.file.id.get_vfd_handle()
            try:
                os.posix_fallocate(descriptor, os.fstat(descriptor).st_size, n_bytes)
            except OSError as exc:
                if exc.errno not in (errno.EOPNOTSUPP, errno.EINVAL):
                    raise

    def commit(self) -> None:
        """Close the file and move it to its path."""
        assert self._part is not None
        with self.writing():
            self.file.flush()
            sums = _checksums.layout(self.file, self.file.id.get_filesize(), *(self._rows or ("", None)))
            self.file.close()
            self._part.restore()
            os.truncate(self._part.path, sums.size)  # releases the bytes that were reserved and not used
            _checksums.append(self._part.path, sums)
        self._part.commit()
        self._part = None

    def abandon(self) -> None:
        """Remove the file; `path` is as it was. Nothing happens after `commit`."""
        if self._part is not None:
            part, self._part = self._part, None
            try:
                if hasattr(self, "file") and self.file:
                    self._forget()
                    self.file.close()
            except (OSError, RuntimeError) as exc:  # HDF5 cannot write its buffers; the file is removed anyway
                log.debug("%s could not be closed in order: %s", part.path, exc)
            finally:
                part.remove()

    def _forget(self) -> None:
        """Redirect the remaining writes to the null device: on a full disk HDF5 crashes when it closes its file."""
        try:
            nowhere = os.open(os.devnull, os.O_RDWR)
            os.dup2(nowhere, self.file.id.get_vfd_handle())
            os.close(nowhere)
        except (OSError, RuntimeError, TypeError, NotImplementedError) as exc:
            log.debug("%s is closed as it is: %s", self.path, exc)


class Filled:
    """A dataset of an unfinished file, read and written in slices like an h5py.Dataset."""

    def __init__(self, owner: Unfinished, dataset: h5py.Dataset, sums: _checksums.RunningSums) -> None:
        self.owner, self.dataset, self.sums = owner, dataset, sums
        self.shape, self.dtype = dataset.shape, np.dtype(dataset.dtype)

    def __getitem__(self, at: object) -> np.ndarray:
        return self.dataset[at]

    def __setitem__(self, at: object, values: ArrayLike) -> None:
        with self.owner.writing():
            self.dataset[at] = values
        self.sums.wrote(at, values)
