"""One HTML page, whole in one file: headings, words, tables and drawings. Reports and papers share it."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.25rem; margin-top: 2.5rem; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #e4e4e4; }
th:first-child, td:first-child { text-align: left; } th { font-weight: 600; }
table.text th, table.text td { text-align: left; vertical-align: top; } td.errs { color: #c0392b; }
figure { display: inline-block; margin: .5rem 1rem .5rem 0; }
figcaption { max-width: 400px; font-size: .85rem; color: #555; }
svg text { font: 11px system-ui, sans-serif; fill: #444; } .note { color: #555; }
"""
COLORS = ("#1f4e9c", "#c0392b", "#1d8348", "#8e44ad", "#b9770e", "#34495e")
WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 400, 270, 56, 36, 12


def page(title: str, parts: Sequence[str]) -> str:
    """The whole file."""
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n</body></html>\n"
    )


def heading(text: str) -> str:
    """A section begins."""
    return f"<h2>{escape(text)}</h2>"


def words(text: str, note: bool = False) -> str:
    """A paragraph."""
    return f"<p>{escape(text)}</p>" if not note else _note(text)


def _note(text: str) -> str:
    return f'<p class="note">{escape(text)}</p>'


def listed(texts: Sequence[str]) -> str:
    """Paragraphs as a list."""
    return "<ul>" + "".join(f"<li>{escape(text)}</li>" for text in texts) + "</ul>"


def table(head: Sequence[str], rows: Sequence[Sequence[Any]], text: bool = False) -> str:
    """Rows of numbers, each under its head; text: of words, all set to the left."""
    line = "".join(f"<th>{escape(str(h))}</th>" for h in head)
    cells = ("".join(f"<td>{escape(str(c))}</td>" for c in row) for row in rows)
    kind = ' class="text"' if text else ""
    return f"<table{kind}><tr>{line}</tr>\n" + "\n".join(f"<tr>{c}</tr>" for c in cells) + "</table>"


def plot(
    curves: Sequence[tuple[str, Any, Any]], x_name: str, y_name: str, caption: str, *,
    dots: bool | Sequence[str] = False, same_scale: bool = False, log_x: bool = False,
) -> str:  # fmt: skip
    """Curves (name, x (n,), y (n,)) or clouds of dots in one frame, with a caption.

    dots  True: all are dots; names: those are, and larger;  log_x  x > 0, in decades
    """
    xs, ys = (np.concatenate([np.asarray(c[i], float) for c in curves]) for i in (1, 2))
    (x0, x1), (y0, y1) = (_range(v) for v in (np.log10(xs) if log_x else xs, ys))
    wide, high = WIDTH - LEFT - 10, HEIGHT - BOTTOM - TOP
    if same_scale:
        scale = max((x1 - x0) / wide, (y1 - y0) / high)
        x0, x1 = ((x0 + x1) / 2 + s * scale * wide / 2 for s in (-1, 1))
        y0, y1 = ((y0 + y1) / 2 + s * scale * high / 2 for s in (-1, 1))
    out = [_axes((x0, x1), (y0, y1), log_x)]
    for i, (name, x, y) in enumerate(curves):
        px, py = _at(np.log10(x) if log_x else x, y, (x0, x1), (y0, y1))
        color, pairs = COLORS[i % len(COLORS)], zip(px.tolist(), py.tolist(), strict=True)
        if dots is True or (dots and name in dots):
            path, size = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in pairs), 2 if dots is True else 6
            out.append(f'<path d="{path}" stroke="{color}" stroke-width="{size}" stroke-linecap="round" opacity=".6"/>')
        else:
            line = " ".join(f"{a:.1f},{min(max(b, TOP), TOP + high):.1f}" for a, b in pairs)
            out.append(f'<polyline points="{line}" fill="none" stroke="{color}" stroke-width="1.5"/>')
    names = " ".join(
        f'<span style="color:{COLORS[i % len(COLORS)]}">{escape(c[0])}</span>' for i, c in enumerate(curves)
    )
    return _figure(out, x_name, y_name, f"{names}<br/>{escape(caption)}")


def picture(
    db: Any, x: tuple[float, float], y: tuple[float, float], x_name: str, y_name: str, caption: str, *,
    floor_db: float = -40.0, box: tuple[float, float] | None = None,
) -> str:  # fmt: skip
    """Decibels (rows, columns) in grey, white the largest and black `floor_db` under it, row 0 at the bottom.

    x, y  the frame's edges;  box  half widths along x and y of a dashed rectangle about the origin
    """
    from .decibels import grey_levels

    db = np.asarray(db, np.float64)
    wide, high = WIDTH - LEFT - 10, HEIGHT - BOTTOM - TOP
    place = f'x="{LEFT}" y="{TOP}" width="{wide}" height="{high}" preserveAspectRatio="none"'
    out = [f'<image {place} href="{_png(grey_levels(db, float(db.max()), floor_db, db.shape))}"/>', _axes(x, y, False)]
    if box is not None:
        (left, right), (low, top) = (v.tolist() for v in _at([-box[0], box[0]], [-box[1], box[1]], x, y))
        out.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{low - top:.1f}" fill="none" '
            'stroke="#2ecc71" stroke-width="1.5" stroke-dasharray="4 3"/>'
        )
    return _figure(out, x_name, y_name, f"{escape(caption)} White to black: 0 to {floor_db:g} dB.")


def _png(levels: np.ndarray) -> str:
    """Grey levels, uint8 (rows, columns), as a data address."""
    from base64 import b64encode
    from io import BytesIO

    from PIL import Image

    file = BytesIO()
    Image.fromarray(np.ascontiguousarray(levels)).save(file, "PNG", optimize=True)
    return "data:image/png;base64," + b64encode(file.getvalue()).decode("ascii")


def _at(x: Any, y: Any, x_range: tuple[float, float], y_range: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Where in the drawing a place in the frame lies."""
    (x0, x1), (y0, y1) = x_range, y_range
    wide, high = WIDTH - LEFT - 10, HEIGHT - BOTTOM - TOP
    return (
        LEFT + (np.asarray(x, float) - x0) / (x1 - x0) * wide,
        TOP + high - (np.asarray(y, float) - y0) / (y1 - y0) * high,
    )


def _axes(x_range: tuple[float, float], y_range: tuple[float, float], log_x: bool) -> str:
    """The frame and its ticks."""
    wide, high = WIDTH - LEFT - 10, HEIGHT - BOTTOM - TOP
    (x0, x1), (y0, y1) = x_range, y_range
    out = [f'<rect x="{LEFT}" y="{TOP}" width="{wide}" height="{high}" fill="none" stroke="#bbb"/>']
    for value in _decades(x0, x1) if log_x else _ticks(x0, x1):
        tick = float(_at(value, y0, x_range, y_range)[0])
        text = f"{10**value if log_x else value:.4g}"
        out.append(f'<text x="{tick:.1f}" y="{TOP + high + 14}" text-anchor="middle">{text}</text>')
        out.append(f'<path d="M{tick:.1f} {TOP + high}v-4" stroke="#bbb"/>')
    for value in _ticks(y0, y1):
        tick = float(_at(x0, value, x_range, y_range)[1])
        out.append(f'<text x="{LEFT - 5}" y="{tick + 4:.1f}" text-anchor="end">{value:.4g}</text>')
        out.append(f'<path d="M{LEFT} {tick:.1f}h4" stroke="#bbb"/>')
    return "".join(out)


def _figure(out: list[str], x_name: str, y_name: str, caption: str) -> str:
    """A drawing with the names of its axes and a caption, the caption as HTML."""
    wide, high = WIDTH - LEFT - 10, HEIGHT - BOTTOM - TOP
    out.append(f'<text x="{LEFT + wide / 2}" y="{HEIGHT - 6}" text-anchor="middle">{escape(x_name)}</text>')
    out.append(
        f'<text transform="translate(12 {TOP + high / 2}) rotate(-90)" text-anchor="middle">{escape(y_name)}</text>'
    )
    drawing = f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img">{"".join(out)}</svg>'
    return f"<figure>{drawing}<figcaption>{caption}</figcaption></figure>"


def _range(values: np.ndarray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    room = 0.04 * (high - low) or 0.5 * max(abs(high), 1.0)
    return low - room, high + room


def _ticks(low: float, high: float) -> list[float]:
    """Three to six round numbers between low and high."""
    step = 10.0 ** np.floor(np.log10((high - low) / 3))
    step *= next(m for m in (5, 2, 1) if (high - low) / (m * step) >= 3)
    first = np.ceil(low / step)
    return [float(i * step) + 0.0 for i in np.arange(first, np.floor(high / step) + 1)]


def _decades(low: float, high: float) -> list[float]:
    """Logarithms of 1, 2 and 5 10^k between low and high."""
    every = [k + float(np.log10(m)) for k in range(int(np.floor(low)), int(np.ceil(high)) + 1) for m in (1, 2, 5)]
    return [v for v in every if low <= v <= high]
