"""Pictures of decibels, with Pillow and nothing else: grey images with axes and a scale, and line plots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import validation
from .axes import INK, Sheet, image_axis, number, ticks_between

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

SMALLEST, LARGEST = 500, 2400  # pixels along the longer side of what is drawn
THINNEST = 1 / 6  # shorter side over longer side at least: a strip any thinner shows nothing
CURVE = (22, 82, 148)


def picture(
    db: Any,
    spacing: Any = None,
    floor_db: float = -50.0,
    title: str | None = None,
    *,
    origin: tuple[float, float] = (0.0, 0.0),
    names: tuple[str, str] = ("y", "x"),
) -> Picture:
    """Draw decibels (rows, columns) in grey, or as a line where there is one row or one column.

    db        dB, real; row 0 is drawn at the bottom; -inf is nothing
    spacing   (row, column) m; None: axes count pixels
    origin    (row, column) coordinates, m, of pixel [rows//2, columns//2]; names  what they are called
    floor_db  black, in dB below the brightest pixel, which is white; negative

    Returns a PIL.Image; its info["frame"] is the box (left, top, right, bottom) in which the data are drawn.
    Small images are enlarged, by a whole factor along an axis where the spacings allow it. Large ones are
    reduced by averaging power, which keeps the brightness of speckle; white is then the brightest average.
    ValueError when db has not two axes, is empty, holds NaN or +Inf (first index named), floor_db is not
    negative or a spacing not positive.
    """
    db = np.asarray(db)
    if db.ndim != 2 or db.size == 0:
        raise ValueError(f"db has shape {db.shape}, wanted (rows, columns), neither zero")
    if db.dtype.kind not in "fiu":
        raise ValueError(f"db has type {db.dtype}, wanted real decibels: 20 log10 of a modulus")
    if not (db < np.inf).all():
        at = np.unravel_index(int(np.argmin(db < np.inf)), db.shape)
        raise ValueError(f"db[{at[0]}, {at[1]}] is {db[at]}; decibels are finite, or -inf for nothing")
    floor_db = validation.number("floor_db", floor_db)
    if not floor_db < 0:
        raise ValueError(f"floor_db is {floor_db:g}; it counts down from the brightest pixel: give e.g. -50")
    if spacing is not None:
        dy, dx = spacing if np.ndim(spacing) else (spacing, spacing)
        spacing = validation.number("spacing[0]", dy, above=0), validation.number("spacing[1]", dx, above=0)
    if 1 in db.shape and db.size > 1:
        return _line_plot(db, (spacing, origin, names), floor_db, title)
    return _grey_image(db, (spacing, origin, names), floor_db, title)


def write_png(picture: Picture, path: Any) -> None:
    """Write a PNG that appears whole or not at all; raises what `output_paths.check_writable` raises."""
    from ..io import output_paths

    with output_paths.atomic(path) as part:
        picture.save(part, format="PNG")


def drawn_shape(shape: tuple[int, int], spacing: tuple[float, float] | None) -> tuple[int, int]:
    """Pixels (rows, columns) in which an image is drawn: as wide to high as its extent in metres is."""
    dy, dx = spacing or (1.0, 1.0)
    extent = np.array([shape[0] * dy, shape[1] * dx])
    n = extent / min(dy, dx)  # in steps of the finer spacing
    scale = 1 / np.ceil(n.max() / LARGEST) if n.max() > LARGEST else np.ceil(SMALLEST / n.max())
    n = np.maximum(n, n.max() * THINNEST) * scale
    return _whole(shape[0], n[0]), _whole(shape[1], n[1])


def _whole(old: int, wanted: float) -> int:
    """`wanted` pixels for `old`, moved by up to 1 % where that makes the factor between them whole."""
    near = old * round(wanted / old) if wanted >= old else -(-old // round(old / wanted))
    return near if abs(near - wanted) <= 0.01 * wanted + 1 else round(wanted)


def grey_levels(db: np.ndarray, floor_db: float, shape: tuple[int, int]) -> np.ndarray:
    """Decibels (rows, columns) as grey levels, uint8 of `shape`, row 0 last; 255 the brightest, 0 the floor.

    An axis that grows by a whole factor repeats its pixels; any other is resampled by averaging power.
    """
    top = float(db.max())
    if top == -np.inf:
        return np.zeros(shape, np.uint8)
    if any(new % old for new, old in zip(shape, db.shape, strict=True)):
        with np.errstate(divide="ignore"):
            relative = 10 * np.log10(_average_power(db, top, shape))
        relative -= relative.max()
    else:
        relative = np.asarray(db, np.float64) - top
    level = np.clip(np.rint(255 - 255 / floor_db * relative), 0, 255).astype(np.uint8)
    for axis in (0, 1):
        level = np.repeat(level, shape[axis] // level.shape[axis], axis=axis)
    return level[::-1]


def _average_power(db: np.ndarray, top: float, shape: tuple[int, int]) -> np.ndarray:
    """Power relative to `top` dB, resampled to `shape`: each new pixel is the mean over its own area."""
    out = np.empty((db.shape[0], shape[1]))
    for a in range(0, len(db), 256):  # in blocks: a large image is not held in float64
        out[a : a + 256] = _means(10 ** ((db[a : a + 256].astype(np.float64) - top) / 10), shape[1])
    return _means(out.T, shape[0]).T


def _means(power: np.ndarray, n: int) -> np.ndarray:
    """Means over n pieces of the last axis; a sample on a border counts in both pieces by its share."""
    old = power.shape[-1]
    k = -(-old // n)
    edge = np.arange(n + 1) * (old / n)
    if old > n and k * n - old <= 0.01 * old:
        # Whole blocks, the last one short: shares would smooth speckle here more than there.
        edge = np.minimum(np.arange(n + 1) * k, old)
    whole = np.minimum(edge.astype(int), old - 1)
    total = np.zeros((*power.shape[:-1], old + 1))
    np.cumsum(power, axis=-1, out=total[..., 1:])
    # Differences of sums can round to just below zero.
    sums = np.maximum(np.diff(total[..., whole] + (edge - whole) * power[..., whole]), 0)
    return sums / np.diff(edge)


def _grey_image(db: np.ndarray, axes: tuple[Any, Any, Any], floor_db: float, title: str | None) -> Picture:
    from PIL import Image

    height, width = drawn_shape(db.shape, axes[0])
    across, up = image_axis(db.shape[1], 1, *axes), image_axis(db.shape[0], 0, *axes)
    ratio = (up[2] - up[1]) / (across[2] - across[1])
    if ratio < THINNEST:
        up = (up[0] + ", stretched", *up[1:])
    elif 1 / ratio < THINNEST:
        across = (across[0] + ", stretched", *across[1:])
    sheet = Sheet(width, height, across, up, title, 7.0)
    left, top, right, bottom = sheet.frame
    levels = grey_levels(db, floor_db, (height, width))
    sheet.image.paste(Image.fromarray(levels), (left, top))
    sheet.axes()

    u, line = sheet.unit, sheet.line
    x0, x1 = right + round(1.4 * u), right + round(2.4 * u)
    ramp = np.rint(np.linspace(255, 0, height)).astype(np.uint8)
    sheet.image.paste(Image.fromarray(np.repeat(ramp[:, None], x1 - x0, axis=1)), (x0, top))
    sheet.box((x0, top, x1, bottom))
    step, ticks = ticks_between(floor_db, 0.0, height / (3.6 * u))
    for tick in ticks:
        y = top + round(tick / floor_db * (height - 1))
        sheet.draw.line([(x1, y), (x1 + sheet.tick, y)], fill=INK, width=line)
        text = number(tick, step) + (" dB" if tick == ticks[-1] else "")
        sheet.draw.text((x1 + 2 * sheet.tick, y), text, INK, sheet.font, anchor="lm")
    return sheet.image


def _line_plot(db: np.ndarray, axes: tuple[Any, Any, Any], floor_db: float, title: str | None) -> Picture:
    from PIL import Image, ImageDraw

    along = int(db.shape[0] > 1)  # 1: one column, drawn along its rows
    axis = image_axis(db.size, 1 - along, *axes)
    width, height, fine = 960, 540, 4  # the curve is drawn four times finer, for a smooth edge
    sheet = Sheet(width, height, axis, ("relative to the maximum (dB)", floor_db, -0.04 * floor_db, 0.0), title, 1.5)
    sheet.axes(grid=True)
    values = db.ravel()[None, :]
    if values.shape[1] > 10 * width:
        with np.errstate(divide="ignore"):
            values = 10 * np.log10(_average_power(values, max(float(values.max()), -1e300), (1, 10 * width)))
    peak = float(values.max())
    relative = np.full(values.size, 2 * floor_db) if peak == -np.inf else values[0] - peak
    n = len(relative)
    x = (np.arange(n) + 0.5) / n * width * fine
    low, high = floor_db, -0.04 * floor_db
    y = (high - np.maximum(relative, 2 * floor_db)) / (high - low) * height * fine
    curve = Image.new("L", (width * fine, height * fine))
    draw = ImageDraw.Draw(curve)
    points = list(zip(x.tolist(), y.tolist(), strict=True))
    draw.line(points, fill=255, width=9, joint="curve")
    if n <= 64:  # few enough to show each
        for px, py in points:
            draw.ellipse((px - 14, py - 14, px + 14, py + 14), fill=255)
    sheet.image.paste(CURVE, sheet.frame[:2], curve.reduce(fine))
    return sheet.image
