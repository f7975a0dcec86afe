"""Grids that installed packages add (docs/developers/extensions.md): positions of their pixels, by blocks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..base import validation
from ..base.text import unknown
from . import entry_points

AT_ONCE = 2**20  # pixels of a block: 24 MB of positions, beside those of the grid


def positions_of(name: str, options: Mapping[str, object]) -> np.ndarray:
    """Positions of all pixels, m (..., 3), of the grid of this name, asked for in blocks of rows.

    ValueError for a name that no package adds, and for a block of another shape; MemoryError: too many pixels.
    """
    make = entry_points.added("grids", name)
    if not callable(make):
        raise ValueError(unknown(name, entry_points.names("grids"), "grid of an installed package"))
    source = make(**options)
    shape = tuple(validation.count(f"shape[{i}] of the grid {name!r}", n) for i, n in enumerate(source.shape))
    size = float(np.prod(shape, dtype=np.float64))
    validation.room(f"positions of {size:.3g} pixels", 24.0 * size, "take a smaller grid")
    out, rows = np.empty((*shape, 3)), max(1, int(AT_ONCE * shape[0] / size))
    for first in range(0, shape[0], rows):
        part, stop = out[first : first + rows], min(first + rows, shape[0])
        block = np.asarray(source.positions(first, stop), np.float64)
        if block.shape != part.shape:
            text = f"grid {name!r}: positions({first}, {stop}) has shape {block.shape}, wanted {part.shape}"
            raise ValueError(text)
        part[:] = block
    return out
