"""The table that `sarcl measure` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .image import Image


def brightest(image: Image) -> tuple[float, float, float]:
    """Position, m, of the brightest pixel; rows are read in blocks."""
    rows = max(1, 2**24 // max(1, int(np.prod(image.grid.shape[1:], dtype=np.int64))))
    best, at = -1.0, (0,) * len(image.grid.shape)
    for first in range(0, image.grid.shape[0], rows):
        level = np.abs(np.asarray(image.data[first : first + rows]))
        top = np.unravel_index(int(np.argmax(level)), level.shape)
        if level[top] > best:
            best, at = float(level[top]), (int(top[0]) + first, *(int(i) for i in top[1:]))
    listed = image.grid.listed
    x, y, z = image.grid.at(*at) if listed is None else listed[at]
    return float(x), float(y), float(z)


def point_table(response: Any, gain: float) -> str:
    """A PointResponse in lines; `gain` is the image's, so that a unit point peaks at 0 dB."""
    x, y, z = response.position
    peak = complex(response.peak) / gain
    level = 20 * np.log10(max(abs(peak), 1e-300))
    lines = [
        f"position    {x:.4f} {y:.4f} {z:.4f} m",
        f"peak        {level:.2f} dB (of a unit point), phase {np.angle(peak):.4f} rad",
        "            range        cross-range",
    ]
    for name, values, unit in (
        ("resolution", response.irw, "m"),
        ("PSLR", response.pslr, "dB"),
        ("ISLR", response.islr, "dB"),
    ):
        cells = [f"{v:.4g} {unit}" if unit == "m" else f"{v:.2f} {unit}" for v in values]
        lines.append(f"{name:10}  {cells[0]:11}  {cells[1]}")
    return "\n".join(lines)
