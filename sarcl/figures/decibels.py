"""Pictures of decibels, drawn with Pillow alone: grey images with axes and a scale, and line plots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base import validation
from ..base.version import __version__
from ._axes import CURVE_WIDTH, INK, Axes, Axis, CurveAxes, number, ticks_between

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from PIL.Image import Image as Picture

    from ..base.types import PathLike

SMALLEST, LARGEST = 500, 2400  # pixels along the longer side of what is drawn
THINNEST = 1 / 6  # smallest ratio of shorter to longer side; a longer strip is stretched across
CURVES = ((22, 82, 148), (192, 57, 43), (29, 131, 72), (142, 68, 173))  # colours of line plots
LINE_SAMPLES = 10  # samples per pixel of a line plot, at most: more are averaged
MOST_DOTS = 64  # samples of a line plot that are shown as dots too
PNG_NOISE, PNG_AXES = 2.2, 6e4  # bytes per pixel of noise, and of axes, caption and scale
MOST_DECIBELS = 1e4  # largest level, dB: float64 holds powers from -3200 to 3100 dB
PERCENTILE = 99.5  # default of white: one in 200 pixels of the scene is clipped
# Levels that tell a scene from an object in front of nothing, dB. FILLED: largest difference of percentile 99.5 and the
# median in a scene. It is 9 dB for speckle and about 20 with shadows, but over 40 for the side lobes of a lone point.
# FAINTEST: a scene that lies farther below the brightest pixel is taken for noise. OBJECT: range of an object's pixels.
FILLED, FAINTEST, OBJECT = 25.0, 40.0, 30.0


class _Scale(NamedTuple):
    """Levels of black and white, as `picture` takes them."""

    floor_db: float
    top_db: float | None
    percentile: float | None

    @property
    def percentile_text(self) -> str:
        value = PERCENTILE if self.percentile is None else self.percentile
        return "the brightest pixel" if value == 100 else f"percentile {value:g} of the scene"


class PixelAxes(NamedTuple):
    """Axes of a picture of pixels.

    spacing  (row, column); None: axes count pixels
    origin   (row, column) coordinates of pixel [rows//2, columns//2];  names: the names of these coordinates
    unit     of both, and metres: how many metres one of it is along (row, column)
    """

    spacing: tuple[float, float] | None = None
    origin: tuple[float, float] = (0.0, 0.0)
    names: tuple[str, str] = ("y", "x")
    unit: str = "m"
    metres: tuple[float, float] = (1.0, 1.0)

    @property
    def lengths(self) -> tuple[float, float] | None:
        """Spacing (row, column), m."""
        return self.spacing and (self.spacing[0] * self.metres[0], self.spacing[1] * self.metres[1])

    def axis(self, n: int, along: int) -> Axis:
        """The axis `along` of n pixels: 0 of the rows, 1 of the columns."""
        if self.spacing is None:
            return Axis(("row", "column")[along], -0.5, n - 0.5, 1.0)
        low = self.origin[along] + (-(n // 2) - 0.5) * self.spacing[along]
        return Axis(f"{self.names[along]} ({self.unit})", low, low + n * self.spacing[along])


def picture(
    db: ArrayLike,
    axes: PixelAxes | None = None,
    floor_db: float = -50.0,
    title: str | None = None,
    *,
    top_db: float | None = None,
    percentile: float | None = None,
    zero: str | None = None,
) -> Picture:
    """Draw decibels (rows, columns) in grey, or as a line where there is one row or one column.

    db          dB, real; row 0 is drawn at the bottom; -inf means no signal
    floor_db    level of black, in dB below white; negative
    top_db      level of white, in dB; None: taken from the data, see `white_level`
    percentile  per cent of the pixels of the scene that are no brighter than white, above 0 to 100; None: 99.5.
                100 makes the brightest pixel white. Not to be given together with top_db
    zero        meaning of 0 dB, for the caption

    Returns a PIL.Image. A caption under the axes says what white and black are. Entries of its `info`: "frame", the
    box (left, top, right, bottom) in which the data are drawn; "caption"; "top_db" and "floor_db", the level of white
    and, relative to that, of black, dB.
    Small images are enlarged, by a whole factor along an axis where the spacings allow it. Large ones are reduced by
    averaging power, which keeps the brightness of speckle; levels are then those of the averages. A line plot is
    relative to its maximum, or to top_db.
    ValueError when db has not two axes, is empty, holds NaN or +Inf (first index named), a spacing is not positive, or
    where `check_scale` refuses the levels.
    """
    db = np.asarray(db)
    if db.ndim != 2 or db.size == 0:
        raise ValueError(f"db has shape {db.shape}, wanted (rows, columns), neither zero")
    if db.dtype.kind not in "fiu":
        raise ValueError(f"db has type {db.dtype}, wanted real decibels: 20 log10 of a modulus")
    if not (db < np.inf).all():
        index = np.unravel_index(int(np.argmin(db < np.inf)), db.shape)
        raise ValueError(f"db[{index[0]}, {index[1]}] is {db[index]}; decibels are finite, or -inf for no signal")
    check_scale(floor_db, top_db, percentile)
    axes = axes or PixelAxes()
    for i, step in enumerate(axes.spacing or ()):
        validation.number(f"spacing[{i}]", step, above=0)
    draw = _line_plot if 1 in db.shape and db.size > 1 else _grey_image
    return draw(db, axes, _Scale(floor_db, top_db, percentile), title, zero)


def check_scale(
    floor_db: float, top_db: float | None, percentile: float | None, names: tuple[str, str, str] | None = None
) -> None:
    """ValueError, with the names of the options, for levels that no picture can have.

    floor_db must be negative, top_db finite, percentile above 0 and at most 100; top_db and percentile exclude each
    other.
    """
    floor_name, top_name, percentile_name = names or ("floor_db", "top_db", "percentile")
    if not -MOST_DECIBELS <= validation.number(floor_name, floor_db) < 0:
        raise ValueError(f"{floor_name} is {floor_db:g}; black is that many dB below white: give e.g. -50")
    if top_db is not None:
        if abs(validation.number(top_name, top_db)) > MOST_DECIBELS:
            raise ValueError(f"{top_name} is {top_db:g} dB; pixels lie within {MOST_DECIBELS:g} dB: give less")
        if percentile is not None:
            raise ValueError(f"{top_name} and {percentile_name} both set the level of white; give one of them")
    if percentile is not None and not validation.number(percentile_name, percentile, above=0) <= 100:
        raise ValueError(
            f"{percentile_name} is {percentile:g}; give at most 100, which makes the brightest pixel white"
        )


def white_level(db: np.ndarray, percentile: float | None = None) -> float:
    """Level of white, dB: a percentile of the pixels of the scene. -inf where no pixel has a signal.

    A scene fills the picture where half of all pixels lie within FILLED dB of percentile 99.5, and that within
    FAINTEST dB of the brightest pixel. Then all pixels with a signal count, and a few bright points are clipped.
    Otherwise the picture shows a point or an object in front of almost nothing. Then only pixels within OBJECT dB of
    the brightest count, so that neither side lobes nor faint noise set the level. With fewer than 200 pixels the
    default clips none.
    """
    signal = db[db > -np.inf]
    if not signal.size:
        return -np.inf
    share, peak = PERCENTILE if percentile is None else percentile, signal.max()
    middle, high, white = np.percentile(signal, (50, PERCENTILE, share), method="higher")
    if middle < high - FILLED or high < peak - FAINTEST:
        white = np.percentile(signal[signal >= peak - OBJECT], share, method="higher")
    return float(white)


def write_png(picture: Picture, path: PathLike) -> None:
    """Write a PNG that appears whole or not at all; raises what `output_paths.check_writable` raises, and
    FileExistsError while another run writes the same path.

    The file's text entries hold what the picture's `info` does: Title, Description (the caption), top_db, floor_db.
    """
    from PIL.PngImagePlugin import PngInfo

    from ..io import output_paths

    text = PngInfo()
    text.add_text("Software", f"sarcl {__version__}")
    for key, name in (("title", "Title"), ("caption", "Description"), ("top_db", "top_db"), ("floor_db", "floor_db")):
        if key in picture.info:
            text.add_text(name, f"{picture.info[key]}")
    with output_paths.atomic(path, alone=True) as part:
        picture.save(part, format="PNG", pnginfo=text)


def picture_bytes(shape: tuple[int, int], spacing: tuple[float, float] | None) -> float:
    """About the most bytes of the PNG of an image: noise, of which PNG makes up to 2.1 bytes per pixel."""
    pixels = min(float(np.prod(shape)), float(np.prod(drawn_shape(shape, spacing))))
    return PNG_NOISE * pixels + PNG_AXES


def drawn_shape(shape: tuple[int, int], spacing: tuple[float, float] | None) -> tuple[int, int]:
    """Pixels (rows, columns) in which an image is drawn: as wide to high as its extent in metres is."""
    dy, dx = spacing or (1.0, 1.0)
    extent = np.array([shape[0] * dy, shape[1] * dx])
    n = extent / min(dy, dx)  # in steps of the finer spacing
    scale = 1 / np.ceil(n.max() / LARGEST) if n.max() > LARGEST else np.ceil(SMALLEST / n.max())
    n = np.maximum(n, n.max() * THINNEST) * scale
    return _whole(shape[0], n[0]), _whole(shape[1], n[1])


def _whole(n_old: int, n_new: float) -> int:
    """`n_new` pixels for `n_old`, changed by up to 1 % where that makes the factor between them whole."""
    multiple = n_old * round(n_new / n_old) if n_new >= n_old else -(-n_old // round(n_old / n_new))
    return multiple if abs(multiple - n_new) <= 0.01 * n_new + 1 else round(n_new)


def resampled(db: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Decibels (rows, columns) averaged in power to `shape`; unchanged where both axes grow by a whole factor."""
    top = float(db.max())
    if not any(new % old for new, old in zip(shape, db.shape, strict=True)):
        return db
    if top == -np.inf:
        return np.full(shape, top)
    with np.errstate(divide="ignore"):
        return np.asarray(top + 10 * np.log10(average_power(db, top, shape)))


def grey_levels(db: np.ndarray, top_db: float, floor_db: float, shape: tuple[int, int]) -> np.ndarray:
    """Decibels (rows, columns) as grey levels, uint8 of `shape`, row 0 last: 255 from top_db up, 0 from
    top_db + floor_db down, in even steps between.

    `shape` is a whole multiple of the rows and columns, which are repeated. top_db -inf (no signal) makes all black.
    """
    if top_db == -np.inf:
        return np.zeros(shape, np.uint8)
    level = np.clip(np.rint(255 - 255 / floor_db * (np.asarray(db, np.float64) - top_db)), 0, 255).astype(np.uint8)
    for axis in (0, 1):
        level = np.repeat(level, shape[axis] // level.shape[axis], axis=axis)
    return level[::-1]


def average_power(db: np.ndarray, top: float, shape: tuple[int, int]) -> np.ndarray:
    """Power relative to `top` dB, resampled to `shape`: each new pixel is the mean over its own area."""
    out = np.empty((db.shape[0], shape[1]))
    for a in range(0, len(db), 256):  # in blocks: a large image is not held in float64
        out[a : a + 256] = _means(10 ** ((db[a : a + 256].astype(np.float64) - top) / 10), shape[1])
    return _means(out.T, shape[0]).T


def _means(power: np.ndarray, n: int) -> np.ndarray:
    """Means over n pieces of the last axis; a sample on a border counts in both pieces by its share."""
    n_old = power.shape[-1]
    k = -(-n_old // n)
    edge = np.arange(n + 1) * (n_old / n)
    if n_old > n and k * n - n_old <= 0.01 * n_old:
        # Whole blocks, the last one short: shares would smooth speckle here more than there.
        edge = np.minimum(np.arange(n + 1) * k, n_old)
    first = np.minimum(edge.astype(int), n_old - 1)
    total = np.zeros((*power.shape[:-1], n_old + 1))
    np.cumsum(power, axis=-1, out=total[..., 1:])
    # Differences of sums can round to just below zero.
    sums = np.maximum(np.diff(total[..., first] + (edge - first) * power[..., first]), 0)
    return sums / np.diff(edge)


def _grey_image(db: np.ndarray, axes: PixelAxes, scale: _Scale, title: str | None, zero: str | None) -> Picture:
    from PIL import Image

    height, width = drawn_shape((db.shape[0], db.shape[1]), axes.lengths)
    across, up = axes.axis(db.shape[1], 1), axes.axis(db.shape[0], 0)
    ratio = (up.high - up.low) * axes.metres[0] / ((across.high - across.low) * axes.metres[1])
    if ratio < THINNEST:
        up = up._replace(label=f"{up.label}, stretched")
    elif 1 / ratio < THINNEST:
        across = across._replace(label=f"{across.label}, stretched")
    drawn = resampled(db, (height, width))
    floor_db, top_db, percentile = scale
    white = white_level(drawn, percentile) if top_db is None else float(top_db)
    origin = scale.percentile_text if top_db is None else "given"
    levels = grey_levels(drawn, white, floor_db, (height, width))
    caption = _caption(white, origin, float(drawn.max()), floor_db, zero)
    drawing = Axes(width, height, across, up, title, 7.0, caption)
    left, top, right, bottom = drawing.frame
    drawing.image.paste(Image.fromarray(levels), (left, top))
    drawing.axes()

    u, line = drawing.unit, drawing.line
    x0, x1 = right + round(1.4 * u), right + round(2.4 * u)
    ramp = np.rint(np.linspace(255, 0, height)).astype(np.uint8)
    drawing.image.paste(Image.fromarray(np.repeat(ramp[:, None], x1 - x0, axis=1)), (x0, top))
    drawing.box((x0, top, x1, bottom))
    highest = white if np.isfinite(white) else 0.0
    step, ticks = ticks_between(highest + floor_db, highest, height / (3.6 * u))
    for tick in ticks:
        y = top + round((tick - highest) / floor_db * (height - 1))
        drawing.draw.line([(x1, y), (x1 + drawing.tick, y)], fill=INK, width=line)
        text = number(tick, step) + (" dB" if tick == ticks[-1] else "")
        drawing.draw.text((x1 + 2 * drawing.tick, y), text, INK, drawing.font, anchor="lm")
    drawing.image.info |= {"top_db": white, "floor_db": float(floor_db)}
    return drawing.image


def _caption(white: float, origin: str, peak: float, floor_db: float, zero: str | None) -> str:
    """Words for white, black and 0 dB; origin  of the level of white."""
    if peak == -np.inf:
        return "No pixel has a signal."
    above = peak - white
    clipped = f"; the brightest pixel is {above:.1f} dB above" if above >= 0.05 else ""
    unit = f" 0 dB: {zero}." if zero else ""
    return f"White: {_decibels(white)} ({origin}{clipped}). Black: {_decibels(white + floor_db)}.{unit}"


def _decibels(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f} dB"


def _line_plot(db: np.ndarray, axes: PixelAxes, scale: _Scale, title: str | None, zero: str | None) -> Picture:
    floor_db, top_db, _ = scale
    along = int(db.shape[0] > 1)  # 1: one column, drawn along its rows
    most = LINE_SAMPLES * CURVE_WIDTH
    values = db.ravel()[None, :]
    if values.shape[1] > most:
        with np.errstate(divide="ignore"):
            highest = max(float(values.max()), -1e300)
            values = highest + 10 * np.log10(average_power(values, highest, (1, most)))
    peak = float(values.max())
    white, reference = (peak, "the maximum") if top_db is None else (float(top_db), _decibels(top_db))
    caption = "No sample has a signal." if peak == -np.inf else f"Maximum: {_decibels(peak)}."
    if zero and peak > -np.inf:
        caption += f" 0 dB: {zero}."
    drawing = CurveAxes(axes.axis(db.size, 1 - along), reference, floor_db, title, caption)
    n = values.size
    relative = np.full(n, 2 * floor_db) if peak == -np.inf else values[0] - white
    drawing.curve((np.arange(n) + 0.5) / n, relative, CURVES[0], has_dots=n <= MOST_DOTS)
    drawing.image.info |= {"top_db": white, "floor_db": float(floor_db)}
    return drawing.image


def curves(
    lines: Sequence[tuple[str, np.ndarray, np.ndarray]], x_name: str, floor_db: float, title: str | None, caption: str
) -> Picture:
    """Lines (name, x (n,), decibels (n,)) in one frame, from floor_db to a little above 0; names in the lines' colours.

    ValueError for a floor_db that is not below 0.
    """
    if not validation.number("floor_db", floor_db) < 0:
        raise ValueError(f"floor_db is {floor_db:g}; the frame ends that many dB below the peak: give e.g. -50")
    first, last = (float(pick([pick(x) for _, x, _ in lines])) for pick in (np.min, np.max))
    drawing = CurveAxes(Axis(x_name, first, last), "the peak", floor_db, title, caption)
    for i, (name, x, db) in enumerate(lines):
        colour = CURVES[i % len(CURVES)]
        drawing.curve((np.asarray(x) - first) / (last - first), db, colour)
        corner = drawing.frame[0] + drawing.unit, drawing.frame[1] + round((0.6 + 1.3 * i) * drawing.unit)
        drawing.draw.text(corner, name, colour, drawing.font, anchor="lt")
    drawing.image.info |= {"floor_db": float(floor_db)}
    return drawing.image
