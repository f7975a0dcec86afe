"""Where an image's pixels go."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np

from .cl import size_text
from .grid import ImageGrid
from .image import Image


class Target:
    """Where pixels go: memory, the caller's array, or a file that appears only when it is complete."""

    def __init__(self, grid: ImageGrid, out: Any, stack: ExitStack) -> None:
        self.grid, self.writer = grid, None
        if out is None:
            try:
                self.data = np.empty(grid.shape, np.complex64)
            except MemoryError:
                raise MemoryError(
                    f"an image of {' x '.join(map(str, grid.shape))} needs {size_text(8.0 * grid.size)} of memory; "
                    'take a smaller shape, or out="image.h5" to make it in a file'
                ) from None
        elif isinstance(out, str) or hasattr(out, "__fspath__"):
            from .files import store

            self.writer = store.image_writer(out, grid, np.complex64)
            stack.callback(self.writer.abandon)  # does nothing once finished
            self.data = self.writer.data
        else:
            if tuple(out.shape) != tuple(grid.shape) or np.dtype(out.dtype).kind != "c":
                raise ValueError(f"out has shape {out.shape} and type {out.dtype}, wanted complex of {grid.shape}")
            self.data = out
        # rows of a plane go straight to their place; listed points arrive along a curve and go there at the end
        self.flat = self.data if grid.is_plane else np.empty(grid.size, np.complex64)

    def finish(self) -> None:
        """Everything has been written to `flat`."""
        if not self.grid.is_plane:
            self.data[...] = self.flat.reshape(self.grid.shape)

    def image(self, **fields: Any) -> Image:
        """The finished Image; a file appears under its name only now."""
        if self.writer is not None:
            return self.writer.finish(**fields)
        return Image(self.data, self.grid, **fields)
