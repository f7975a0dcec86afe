"""Plots as PNG files, drawn by matplotlib on canvases of their own: nothing of pyplot, no global state.

Needs the extra `plots`. Curves differ in colour, line style and marker, so that a legend can be read without colours.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal, TypedDict, cast

import numpy as np
from numpy.typing import ArrayLike

from ._axes import Axis as PlotAxis
from ._axes import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

FLOOR_DB = -40.0  # dB, black below white
SIZE, DPI = (5.6, 4.0), 120  # size of a figure, inches; pixels per inch
LEFT, BOTTOM, WIDTH, HEIGHT = 0.14, 0.13, 0.83, 0.83  # place of the axes, relative to the figure
GREY_WIDTH = 0.76  # width of a picture with its scale, relative to the figure
SCALE_SHARE, SCALE_GAP = 0.11, 0.03  # widths over that one: scale and gap together, and the gap alone
LOWEST, HIGHEST = 2.4, 5.4  # heights of a picture whose axes have equal units, inches
LEGEND_LINE = 0.055  # height of a line of the legend above the axes, relative to the figure
COLORS = ("#1f4e9c", "#c0392b", "#1d8348", "#8e44ad", "#b9770e", "#34495e", "#0e8f9c")
LINES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (7, 2)), (0, (4, 1, 1, 1, 1, 1)), (0, (2, 1)))
MARKERS = ("o", "s", "^", "D", "v", "x", "P")
Curve = tuple[str, ArrayLike, ArrayLike]  # name, x (n,), y (n,)
ALL_MARKED = 24  # points; of a longer curve only about eight points are marked
MARGIN = 0.05  # space beyond the values at either end of an axis, over their span
LEAST_SPAN = 1e-3  # shortest axis over the largest value on it: smaller differences are rounding, no curve
Limits = tuple[tuple[float, float] | None, tuple[float, float] | None]  # ends of x and y; None: those of the curves


class PictureLook(TypedDict, total=False):
    """Options of `picture`."""

    floor_db: float
    box: tuple[float, float] | None
    lines: Sequence[Curve]
    unit: str
    equal: bool


def require(what: str) -> None:
    """ImportError with the command that installs them where matplotlib or jinja2 is missing; `what` needs them."""
    from importlib.util import find_spec

    missing = [name for name in ("matplotlib", "jinja2") if find_spec(name) is None]
    if missing:
        raise ImportError(f"{what} needs {' and '.join(missing)}, of the extra plots: pip install 'sarcl[plots]'")


def figure(size: tuple[float, float] = SIZE) -> Figure:
    """An empty figure of (width, height) inches on an Agg canvas."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    empty = Figure(figsize=size, dpi=DPI)
    FigureCanvasAgg(empty)
    return empty


def png(figure: Figure, colours: int = 64) -> bytes:
    """A figure of `figure` as a PNG file of so many colours, 256 at most."""
    from PIL import Image

    canvas = cast("FigureCanvasAgg", figure.canvas)
    canvas.draw()
    pixels = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
    file = BytesIO()
    pixels.quantize(colours, method=Image.Quantize.MEDIANCUT).save(file, "PNG")
    return file.getvalue()


def style(i: int) -> dict[str, Any]:
    """Colour, line style and marker of curve i, as matplotlib's options.

    Lines get thinner and hollow markers smaller from curve to curve, so that curves that coincide can all be seen.
    Where colours repeat, line style and marker are those of other colours.
    """
    lap, k = divmod(i, len(COLORS))
    return {
        "color": COLORS[k],
        "linestyle": LINES[(k + lap) % len(LINES)],
        "linewidth": 2.6 - 0.3 * k,
        "marker": MARKERS[(k + 3 * lap) % len(MARKERS)],
        "markersize": 9.0 - k,
        "markerfacecolor": "none",
    }


def curves(
    curves: Sequence[Curve],
    x_name: str,
    y_name: str,
    *,
    dots: bool | Sequence[str] = False,
    log_x: bool = False,
    limits: Limits = (None, None),
) -> bytes:
    """PNG of curves (name, x (n,), y (n,)) in one frame, with a legend above it where there are two or more.

    A curve of one point is a marker, with its value in the legend.

    dots  True: all are clouds of dots; names: these are dots, and larger;  log_x: x > 0, in decades
    limits  of the axes, the same for figures that are compared
    """
    drawing = figure()
    single = any(np.size(x) == 1 for _, x, _ in curves)
    lines = -(-len(curves) // 2) if single or len(curves) > 1 else 0
    axes = drawing.add_axes((LEFT, BOTTOM, WIDTH, HEIGHT - lines * LEGEND_LINE))
    for i, (name, x, y) in enumerate(curves):
        look = style(i)
        if dots is True:
            look |= {"linestyle": "none", "markersize": 2, "markerfacecolor": look["color"], "alpha": 0.6}
        elif np.size(x) == 1 or (dots and name in dots):
            look["linestyle"] = "none"
        elif (n := len(np.asarray(x))) > ALL_MARKED:
            look["markevery"] = (i * n // 40, n // 8)
        label = f"{name}: {float(np.ravel(y)[0]):.4g}" if np.size(x) == 1 else name
        axes.plot(np.asarray(x, float), np.asarray(y, float), label=label, **look)
    if log_x:
        axes.set_xscale("log")
        decades(axes.xaxis)
    names(axes, x_name, y_name)
    _set_limits(axes, limits)
    if lines:
        _legend(axes)
    return png(drawing)


def ends(values: Sequence[ArrayLike]) -> tuple[float, float] | None:
    """Ends of an axis for all the values, with a margin, for figures that are compared; None where there are none."""
    every = np.concatenate([np.zeros(0), *(np.ravel(v) for v in values)])
    if not every.size:
        return None
    low, high = float(every.min()), float(every.max())
    margin = MARGIN * (high - low) or LEAST_SPAN * (abs(high) or 1.0)
    return low - margin, high + margin


def _set_limits(axes: Axes, limits: Limits) -> None:
    """The limits given; an axis of y without is at least LEAST_SPAN of its largest value long."""
    x, y = limits
    if x is not None:
        axes.set_xlim(*x)
    low, high = axes.get_ylim() if y is None else y
    missing = LEAST_SPAN * max(abs(low), abs(high)) - (high - low)
    axes.set_ylim(low - max(missing, 0) / 2, high + max(missing, 0) / 2)


def _legend(axes: Axes) -> None:
    """A legend of two columns above the frame, where it covers no data."""
    axes.legend(loc="lower left", bbox_to_anchor=(-0.12, 1.0), ncols=2, fontsize=9, frameon=False, handlelength=4)


def names(axes: Axes, x_name: str, y_name: str) -> None:
    """Names of the axes, faint lines at their ticks, and the whole value at every tick of a linear axis."""
    axes.set_xlabel(x_name)
    axes.set_ylabel(y_name)
    axes.grid(alpha=0.3)
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "linear":
            plain_numbers(axis)


def plain_numbers(axis: Axis) -> None:
    """The whole value at every tick of a linear axis: no offset and no power of ten beside the axis."""
    from matplotlib.ticker import FuncFormatter

    def text(value: float, _: int | None) -> str:
        places = axis.get_majorticklocs()
        step = float(places[1] - places[0]) if len(places) > 1 else 1.0
        decimals = next(d for d in range(18) if abs(round(step, d) - step) <= 1e-6 * step or d == 17)
        return number(value, max(10.0**-decimals, step * (decimals == 0))).replace("-", "\N{MINUS SIGN}")

    axis.set_major_formatter(FuncFormatter(text))


def decades(axis: Axis) -> None:
    """Ticks of a logarithmic axis at 1, 2 and 5 times powers of ten, written as numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def picture(
    db: ArrayLike,
    across: PlotAxis,
    up: PlotAxis,
    *,
    floor_db: float = FLOOR_DB,
    box: tuple[float, float] | None = None,
    lines: Sequence[Curve] = (),
    unit: str = "dB",
    equal: bool = False,
) -> bytes:
    """PNG of decibels (rows, columns) in grey, row 0 at the bottom: white is the largest value, black floor_db below.

    across, up  edges of the frame;  box: half widths along both of a dashed rectangle about the origin
    lines (name, x (n,), y (n,)) drawn over it, with a legend above;  unit  of the values, where they are not decibels
    equal  a unit of x is as long as a unit of y: the figure is as high as its frame needs
    """
    from matplotlib.patches import Rectangle

    db = np.asarray(db, np.float64)
    top = float(db.max())
    wide, high = SIZE
    besides = 1 - HEIGHT + -(-len(lines) // 2) * LEGEND_LINE
    if equal:
        frame = GREY_WIDTH * (1 - SCALE_SHARE) * wide * abs((up.high - up.low) / (across.high - across.low))
        high = float(np.clip(frame + besides * SIZE[1], LOWEST, HIGHEST))
    margin = SIZE[1] / high
    drawing = figure((wide, high))
    axes = drawing.add_axes((LEFT, BOTTOM * margin, GREY_WIDTH, 1 - besides * margin))
    extent = across.low, across.high, up.low, up.high
    aspect: Literal["equal", "auto"] = "equal" if equal else "auto"
    image = axes.imshow(db, "gray", vmin=top + floor_db, vmax=top, origin="lower", extent=extent, aspect=aspect)
    names(axes, across.label, up.label)
    axes.grid(visible=False)
    scale = drawing.colorbar(image, ax=axes, label=unit, fraction=SCALE_SHARE - SCALE_GAP, pad=SCALE_GAP)
    plain_numbers(scale.ax.yaxis)
    if box is not None:
        corner = -box[0], -box[1]
        axes.add_patch(Rectangle(corner, 2 * box[0], 2 * box[1], fill=False, edgecolor="#2ecc71", linestyle="--"))
    for i, (name, x, y) in enumerate(lines):
        axes.plot(x, y, label=name, **(style(i) | {"marker": ""}))
    if lines:
        _legend(axes)
    return png(drawing, 256)
