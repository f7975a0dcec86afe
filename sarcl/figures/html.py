"""A page in one HTML file: headings, paragraphs, tables and figures, which the template page.html.j2 lays out.

Needs the extra `plots`. The functions below make a page's blocks; text is escaped by the template.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..base.version import __version__
from . import plots

Block = dict[str, Any]


def page(title: str, blocks: Sequence[Block], command: str = "") -> str:
    """The whole file; `command` is the line that made it, which the page shows with the size of the file."""
    from jinja2 import Environment, StrictUndefined

    source = Path(__file__).with_name("page.html.j2").read_text(encoding="utf-8")
    template = Environment(autoescape=True, undefined=StrictUndefined).from_string(source)
    contents = {"title": title, "blocks": blocks, "command": command, "version": __version__}
    size = len(template.render(**contents, megabytes="0.0").encode())
    return template.render(**contents, megabytes=f"{size / 1e6:.1f}" if size > 5e4 else f"{size / 1e6:.2f}")


def heading(text: str, level: int = 2, anchor: str = "") -> Block:
    """A heading of level 2 or below; anchor: its id."""
    return {"kind": "heading", "text": text, "level": level, "anchor": anchor}


def words(text: str, note: bool = False) -> Block:
    """A paragraph, or a note in smaller print."""
    return {"kind": "words", "text": text, "note": note}


def listed(texts: Sequence[str]) -> Block:
    """A list of paragraphs."""
    return {"kind": "listed", "texts": texts}


def terms(pairs: Sequence[tuple[str, str]]) -> Block:
    """Terms with what they mean."""
    return {"kind": "terms", "pairs": pairs}


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[Any]],
    caption: str = "",
    *,
    text: bool = False,
    marked: Collection[int] = (),
) -> Block:
    """Rows of numbers under their heads; text: rows of words, aligned left; marked: indices of rows to be shaded."""
    return {"kind": "table", "head": head, "rows": rows, "caption": caption, "text": text, "marked": marked}


def plot(
    curves: Sequence[plots.Curve],
    x_name: str,
    y_name: str,
    caption: str,
    *,
    dots: bool | Sequence[str] = False,
    log_x: bool = False,
) -> Block:
    """A figure of curves or dots; see `plots.curves`."""
    names = ", ".join(name for name, _, _ in curves)
    data = plots.curves(curves, x_name, y_name, dots=dots, log_x=log_x)
    return _figure(data, caption, f"{y_name} against {x_name}: {names}")


def picture(
    db: ArrayLike,
    x: tuple[float, float],
    y: tuple[float, float],
    x_name: str,
    y_name: str,
    caption: str,
    *,
    percentile: float = 100.0,
    **look: Unpack[plots.PictureLook],
) -> Block:
    """A figure of decibels in grey, or of values of another unit; see `plots.picture`.

    percentile  of the values at which the scale has white
    """
    db = np.asarray(db, np.float64)
    top = float(np.percentile(db, percentile))
    data = plots.picture(np.minimum(db, top), plots.PlotAxis(x_name, *x), plots.PlotAxis(y_name, *y), **look)
    floor_db, unit = look.get("floor_db", plots.FLOOR_DB), look.get("unit", "dB")
    white = "the largest value" if percentile == 100 else f"the percentile {percentile:g} of the values"
    scale = f"White: {white}; black: {-floor_db:g} dB below."
    if not unit.startswith("dB"):
        scale = f"White: {top:.2g}; black: {top + floor_db:.2g} {unit}."
    return _figure(data, f"{caption} {scale}", f"Levels over {x_name} and {y_name}")


def _figure(data: bytes, caption: str, alt: str) -> Block:
    return {"kind": "figure", "data": b64encode(data).decode("ascii"), "caption": caption, "alt": alt}
