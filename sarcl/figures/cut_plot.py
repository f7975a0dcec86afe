"""Curves in decibels in one frame, drawn with Pillow: cuts through a point response."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base import validation
from ._axes import Axis, CurveAxes

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

COLOURS = ((22, 82, 148), (192, 57, 43), (29, 131, 72), (142, 68, 173))


def curves(
    curves: Sequence[tuple[str, np.ndarray, np.ndarray]], x_name: str, floor_db: float, title: str | None, caption: str
) -> Picture:
    """Curves (name, x (n,), decibels (n,)) from floor_db to a little above 0, with their names in their colours.

    ValueError for a floor_db that is not below 0.
    """
    if not validation.number("floor_db", floor_db) < 0:
        raise ValueError(f"floor_db is {floor_db:g}; the frame ends that many dB below the peak: give e.g. -50")
    first, last = (float(pick([pick(x) for _, x, _ in curves])) for pick in (np.min, np.max))
    drawing = CurveAxes(Axis(x_name, first, last), "the peak", floor_db, title, caption)
    for i, (name, x, db) in enumerate(curves):
        colour = COLOURS[i % len(COLOURS)]
        drawing.curve((np.asarray(x) - first) / (last - first), db, colour)
        corner = drawing.frame[0] + drawing.unit, drawing.frame[1] + round((0.6 + 1.3 * i) * drawing.unit)
        drawing.draw.text(corner, name, colour, drawing.font, anchor="lt")
    drawing.image.info |= {"floor_db": float(floor_db)}
    return drawing.image
