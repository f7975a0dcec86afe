"""Curves in decibels in one frame, drawn with Pillow: cuts through a point response."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base import validation
from ._axes import Axes, Axis

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

WIDTH, HEIGHT, FINE = 960, 540, 4  # of the frame, pixels; curves are drawn finer, for smooth edges
COLOURS = ((22, 82, 148), (192, 57, 43), (29, 131, 72), (142, 68, 173))


def curves(
    curves: Sequence[tuple[str, np.ndarray, np.ndarray]], x_name: str, floor_db: float, title: str | None, caption: str
) -> Picture:
    """Curves (name, x (n,), decibels (n,)) from floor_db to a little above 0, with their names in their colours.

    ValueError for a floor_db that is not below 0.
    """
    from PIL import Image, ImageDraw

    if not validation.number("floor_db", floor_db) < 0:
        raise ValueError(f"floor_db is {floor_db:g}; the frame ends that many dB below the peak: give e.g. -50")
    low, high = floor_db, -0.04 * floor_db
    left, right = (float(pick([pick(x) for _, x, _ in curves])) for pick in (np.min, np.max))
    across = Axis(x_name, left, right)
    drawing = Axes(WIDTH, HEIGHT, across, Axis("relative to the peak (dB)", low, high), title, 1.5, caption)
    drawing.axes(grid=True)
    for i, (name, x, db) in enumerate(curves):
        canvas = Image.new("L", (WIDTH * FINE, HEIGHT * FINE))
        at = (np.asarray(x) - left) / (right - left) * WIDTH * FINE
        up = (high - np.clip(db, 2 * floor_db, 2 * high)) / (high - low) * HEIGHT * FINE
        draw = ImageDraw.Draw(canvas)
        draw.line(list(zip(at.tolist(), up.tolist(), strict=True)), fill=255, width=9, joint="curve")
        drawing.image.paste(COLOURS[i % len(COLOURS)], drawing.frame[:2], canvas.reduce(FINE))
        place = drawing.frame[0] + drawing.unit, drawing.frame[1] + round((0.6 + 1.3 * i) * drawing.unit)
        drawing.draw.text(place, name, COLOURS[i % len(COLOURS)], drawing.font, anchor="lt")
    drawing.image.info |= {"floor_db": float(floor_db)}
    return drawing.image
