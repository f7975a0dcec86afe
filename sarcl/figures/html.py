"""A page in one HTML file: headings, paragraphs, tables and figures, which the template page.html.j2 lays out.

Needs the extra `plots`. The functions below make a page's blocks; text is escaped by the template. A page begins with
a strip of its pictures, its terms and one table of its results; sections follow, and explanations end it.
"""

from __future__ import annotations

import itertools
from base64 import b64decode, b64encode
from collections.abc import Collection, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..base.version import __version__
from . import plots

Block = dict[str, Any]
STRIP = 4, 8  # fewest and most pictures in the strip of a page: one or two rows on a wide screen
THUMBNAIL = 400  # pixels, width of these pictures: sharp where they are widest


def page(title: str, blocks: Sequence[Block], command: str = "") -> str:
    """The whole file; `command` is the line that made it, which the page shows with the size of the file."""
    from jinja2 import Environment, StrictUndefined

    source = Path(__file__).with_name("page.html.j2").read_text(encoding="utf-8")
    template = Environment(autoescape=True, undefined=StrictUndefined).from_string(source)
    contents = {"title": title, "blocks": _pictures_first(blocks), "command": command, "version": __version__}
    size = len(template.render(**contents, megabytes="0.0").encode())
    return template.render(**contents, megabytes=f"{size / 1e6:.1f}" if size > 5e4 else f"{size / 1e6:.2f}")


def _pictures_first(blocks: Sequence[Block]) -> list[Block]:
    """The blocks, with pictures before plots where figures follow one another: what is compared stands together."""
    runs = itertools.groupby(blocks, key=lambda block: block["kind"] == "figure")
    return [
        b for is_figure, run in runs for b in (sorted(run, key=lambda figure: not figure["grey"]) if is_figure else run)
    ]


def heading(text: str, level: int = 2, anchor: str = "") -> Block:
    """A heading of level 2 or below; anchor: its id."""
    return {"kind": "heading", "text": text, "level": level, "anchor": anchor}


def words(text: str, note: bool = False) -> Block:
    """A paragraph, or a note in smaller print."""
    return {"kind": "words", "text": text, "note": note}


def listed(texts: Sequence[str]) -> Block:
    """A list of paragraphs."""
    return {"kind": "listed", "texts": texts}


def terms(pairs: Sequence[tuple[str, str]], summary: str = "") -> Block:
    """Terms with what they mean; with a summary folded under that line, which opens them."""
    return {"kind": "terms", "pairs": pairs, "summary": summary}


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[Any]],
    caption: str = "",
    *,
    text: bool = False,
    marked: Collection[int] = (),
    groups: Mapping[int, str] | None = None,
) -> Block:
    """Rows of numbers under their heads.

    text    rows of words, aligned left, lists on a narrow screen. A cell may be (text, note in small print)
    marked  indices of rows to be shaded;  groups  headings across the table, by the index of the row that follows
    """
    contents = {"head": head, "rows": rows, "caption": caption, "text": text, "marked": marked, "groups": groups or {}}
    return {"kind": "table"} | contents


def strip(blocks: Sequence[Block]) -> list[Block]:
    """A row of small pictures that lead to figures of `blocks`; none where there are no figures.

    Every section, by its heading, has one before any has two, chosen pictures first, then grey ones, then plots: one of
    each section, but STRIP[0] to STRIP[1] in all.
    """
    sections: list[tuple[str, list[Block]]] = [("", [])]
    for block in blocks:
        if block["kind"] == "heading":
            sections.append((block["text"], []))
        elif block["kind"] == "figure":
            sections[-1][1].append(block)
    ranks = [
        (rank, not figure["grey"], i, f"{head}: {_title(figure)}", figure)
        for i, (head, figures) in enumerate(sections)
        for rank, figure in enumerate(sorted(figures, key=lambda figure: (not figure["chosen"], not figure["grey"])))
    ]
    most = int(np.clip(sum(bool(figures) for _, figures in sections), *STRIP))
    chosen = sorted(sorted(ranks, key=lambda entry: entry[:3])[:most], key=lambda entry: entry[2])
    titles = [_title(figure) for *_, figure in chosen]
    entries = []
    for i, (*_, full_title, figure) in enumerate(chosen):
        figure["anchor"] = f"figure-{i + 1}"
        text = titles[i] if titles.count(titles[i]) == 1 else full_title
        entries.append((figure["anchor"], _thumbnail(figure), text))
    return [{"kind": "strip", "figures": entries}] if entries else []


def _thumbnail(figure: Block) -> str:
    """PNG in base64 of a figure, THUMBNAIL pixels wide."""
    from PIL import Image

    with Image.open(BytesIO(b64decode(figure["data"]))) as whole:
        size = THUMBNAIL, round(whole.height * THUMBNAIL / whole.width)
        small = whole.convert("RGB").resize(size, Image.Resampling.LANCZOS).quantize(64)
    file = BytesIO()
    small.save(file, "PNG")
    return b64encode(file.getvalue()).decode("ascii")


def _title(figure: Block) -> str:
    """The first sentence of a figure's caption."""
    return str(figure["caption"]).split(". ")[0].rstrip(".")


def plot(
    curves: Sequence[plots.Curve],
    x_name: str,
    y_name: str,
    caption: str,
    *,
    dots: bool | Sequence[str] = False,
    log_x: bool = False,
    limits: plots.Limits = (None, None),
) -> Block:
    """A figure of curves or dots; see `plots.curves`."""
    names = ", ".join(name for name, _, _ in curves)
    data = plots.curves(curves, x_name, y_name, dots=dots, log_x=log_x, limits=limits)
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
    chosen: bool = False,
    **look: Unpack[plots.PictureLook],
) -> Block:
    """A figure of decibels in grey, or of values of another unit; see `plots.picture`.

    percentile  of the values at which the scale has white
    chosen      of the figures of its section, this one stands for the section in `strip`
    """
    db = np.asarray(db, np.float64)
    top = float(np.percentile(db, percentile))
    data = plots.picture(np.minimum(db, top), plots.PlotAxis(x_name, *x), plots.PlotAxis(y_name, *y), **look)
    floor_db, unit = look.get("floor_db", plots.FLOOR_DB), look.get("unit", "dB")
    white = "the largest value" if percentile == 100 else f"the percentile {percentile:g} of the values"
    scale = f"White: {white}; black: {-floor_db:g} dB below."
    if not unit.startswith("dB"):
        scale = f"White: {top:.2g}; black: {top + floor_db:.2g} {unit}."
    return _figure(data, f"{caption} {scale}", f"Levels over {x_name} and {y_name}", grey=True, chosen=chosen)


def _figure(data: bytes, caption: str, alt: str, grey: bool = False, chosen: bool = False) -> Block:
    content = b64encode(data).decode("ascii")
    look = {"grey": grey, "chosen": chosen}
    return {"kind": "figure", "data": content, "caption": caption, "alt": alt, "anchor": "", **look}
