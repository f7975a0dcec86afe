"""Destination of the pixels of an image."""

from __future__ import annotations

import os
from contextlib import ExitStack
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import DTypeLike

from ..base.text import size_text
from ..base.types import PathLike, WritableArray
from ..blocks.bands import FlatArray
from ..io import formats
from ..model import store
from ..model.image import Image
from ..model.image_grid import ImageGrid
from .tiling.tiling import Tiling


class ImageOutput:
    """Destination of the pixels: memory, an array of the caller's, or a file that appears only when it is complete.

    data  the image, of grid.shape
    flat  where engines write: the rows of a plane, or the points of a list in their order
    """

    def __init__(
        self,
        grid: ImageGrid,
        tiling: Tiling,
        out: PathLike | WritableArray | None,
        stack: ExitStack,
        dtype: DTypeLike = np.complex64,
    ) -> None:
        self.grid, self.writer = grid, None
        self.data: Any  # pixels are also read from it, which a WritableArray need not allow
        if out is None:
            nbytes = float(grid.size * np.dtype(dtype).itemsize)
            try:
                self.data = np.empty(grid.shape, dtype)
            except (MemoryError, ValueError):  # the latter where sizes overflow
                raise MemoryError(
                    f"an image of {' x '.join(map(str, grid.shape))} needs {size_text(nbytes)} of memory; "
                    'take a smaller shape, or out="image.h5" to make it in a file'
                ) from None
        elif is_path(out):
            self.writer = formats.writer_functions(out, "image").ImageWriter(
                out, formats.fields_of(grid), dtype, resumes=True
            )
            stack.callback(self.writer.abandon)  # does nothing once finished
            self.data = self.writer.data
        else:
            array = _writable(out)
            if tuple(array.shape) != tuple(grid.shape) or np.dtype(array.dtype).kind != "c":
                raise ValueError(f"out has shape {array.shape} and type {array.dtype}, wanted complex of {grid.shape}")
            if np.dtype(array.dtype).itemsize < np.dtype(dtype).itemsize:
                raise ValueError(f"out has type {array.dtype}; this tolerance makes {np.dtype(dtype)}; give that")
            self.data = array
        # engines write rows of a plane to the image itself; listed points are copied at the end
        self._points = None if tiling.in_rows else np.empty(grid.size, dtype)
        self.flat: FlatArray = self.data if self._points is None else self._points

    def finish(self) -> None:
        """Complete `data`: all pixels have been written to `flat`."""
        if self._points is not None:
            if self.grid.empty is not None:
                self._points[self.grid.empty.ravel()] = 0  # where empty cells are not skipped, they were focused
            self.data[...] = self._points.reshape(self.grid.shape)

    def image(self, job: str | None = None, **fields: Any) -> Image:
        """The finished Image; a file gets its name, and the fingerprint of its job, only now."""
        if self.writer is not None:
            if job is not None:
                self.writer.mark(job)
            return store.finish_image(self.writer, self.grid, **fields)
        return Image(self.data, self.grid, **fields)


def is_path(out: object) -> TypeGuard[PathLike]:
    """True for the name of an image's file; ValueError where no format that is written block by block ends so."""
    if not isinstance(out, str) and not hasattr(out, "__fspath__"):
        return False
    name = os.fspath(out)
    among = formats.writing("image", by_blocks=True)
    if not isinstance(name, str) or formats.named(name, among) is None:
        endings = formats.suggested(among)
        raise ValueError(f"out is {name!r}; images are made in HDF5 files: give a name that ends in {endings}")
    return True


def _writable(out: object) -> WritableArray:
    """`out`: TypeError unless it is an array or a file's dataset, ValueError unless it can be written to."""
    if not all(hasattr(out, name) for name in ("shape", "dtype", "__setitem__")):
        what = f"{' '.join(repr(out).split()):.40} ({type(out).__name__})"
        raise TypeError(f'out is {what}; wanted None, a complex array of the grid\'s shape, or a path like "image.h5"')
    file = getattr(out, "file", None)
    if isinstance(out, np.ndarray) and not out.flags.writeable:
        raise ValueError("out is a read-only array; give one that can be written to (a memmap: mode='r+')")
    if file is not None and getattr(file, "mode", "r+") == "r":
        raise ValueError(f"out is a dataset of {file.filename!r}, which is open for reading; open it with mode 'r+'")
    return out  # type: ignore[return-value]
