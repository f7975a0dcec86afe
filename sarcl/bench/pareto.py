"""Rate against achieved error, both logarithmic: a panel a case, a curve a library, device and method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..figures.axes import FAINT, INK, PAPER, Sheet
from . import _figures

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

WIDTH, HEIGHT, FINE = 860, 520, 2  # of a frame, pixels; everything is drawn FINE times larger
LABEL = 0.62  # size of a point's label, of the axes' font
OURS = [(22, 82, 148), (196, 68, 24), (90, 150, 215), (232, 140, 90)]
THEIRS = [(16, 124, 88), (132, 70, 150), (184, 134, 11), (110, 110, 110), (60, 160, 170), (170, 60, 110)]
MARKS = ("square", "diamond", "triangle", "cross")

Series = dict[str, list[_figures.Row]]
Style = tuple[tuple[int, int, int], str]  # colour, mark


def picture(cases: list[_figures.Result]) -> Picture:
    """The picture of a document's cases; those without a row that ran are left out.

    ValueError where none has any.
    """
    from PIL import Image

    styles = _styles(cases)
    panels = [_panel(case, styles) for case in cases if _figures.ran(case)]
    if not panels:
        raise ValueError("no case has a row that ran; there is nothing to draw")
    columns = 1 if len(panels) < 4 else 2
    width = max(p.width for p in panels)
    height = max(p.height for p in panels)
    whole = Image.new("RGB", (columns * width, -(-len(panels) // columns) * height), PAPER)
    for i, panel in enumerate(panels):
        whole.paste(panel, (i % columns * width, i // columns * height))
    return whole.reduce(FINE)


def series(case: _figures.Result) -> Series:
    """The rows of each curve, by its label; sarcl's first, the exact peers' by kind of interpolation."""
    found: Series = {}
    for row in sorted(_figures.ran(case), key=lambda row: not _figures.is_ours(row)):
        label = f"{row['who']} {row['method']}"
        if _figures.is_ours(row):
            label += f", {row['device']}"
        elif row["method"] == "direct":
            label += f", {row['setting'].split(',')[0]}"
        found.setdefault(label, []).append(row)
    return found


def _panel(case: _figures.Result, styles: dict[str, Style]) -> Picture:
    curves = series(case)
    rows = _figures.ran(case)
    x = np.log10([row["error"] for row in rows])
    y = np.log10([_figures.rate(case, row) for row in rows])
    low, high = float(np.floor(x.min() - 0.1)), float(np.ceil(x.max() + 0.1))
    bottom, top = float(y.min() - 0.2), float(y.max() + 0.3)
    sheet = Sheet(
        WIDTH * FINE,
        HEIGHT * FINE,
        ("relative L2 error against the exact sum", low, high, 1.0),
        ("Gbp/s, 1e9 pulses x pixels a second", bottom, top, 0.0),
        f"{case['scene']}, {case['data']}, n = {case['n']}: up and left is better",
        15.5,
    )
    _axes(sheet)
    taken: list[tuple[float, ...]] = []
    for label, points in curves.items():
        colour, mark = styles[label]
        places = [_place(sheet, row, case) for row in points]
        if _figures.is_ours(points[0]) or points[0]["method"] == "direct":
            sheet.draw.line(places, fill=colour, width=2 * FINE, joint="curve")
        for place, row in zip(places, points, strict=True):
            _mark(sheet, place, mark, colour)
            _label(sheet, place, row, colour, taken)
        _legend(sheet, list(curves).index(label), label, mark, colour)
    return sheet.image


def _styles(cases: list[_figures.Result]) -> dict[str, Style]:
    """Colour and mark of every curve, the same in all panels."""
    found: dict[str, Style] = {}
    ours = theirs = 0
    for case in cases:
        for label, rows in series(case).items():
            if label in found:
                continue
            if _figures.is_ours(rows[0]):
                found[label] = OURS[ours % len(OURS)], "circle"
                ours += 1
            else:
                found[label] = THEIRS[theirs % len(THEIRS)], MARKS[theirs % len(MARKS)]
                theirs += 1
    return found


def _place(sheet: Sheet, row: _figures.Row, case: _figures.Result) -> tuple[float, float]:
    left, top, right, bottom = sheet.frame
    (_, low, high, _), (_, least, most, _) = sheet.across, sheet.up
    x = (np.log10(row["error"]) - low) / (high - low)
    y = (np.log10(_figures.rate(case, row)) - least) / (most - least)
    return left + x * (right - left), bottom - y * (bottom - top)


def _axes(sheet: Sheet) -> None:
    """Decades across, 1, 2, 5 upwards, and the labels: Sheet's own ticks are linear."""
    from PIL import Image, ImageDraw

    left, top, right, bottom = sheet.frame
    (xlabel, low, high, _), (ylabel, least, most, _) = sheet.across, sheet.up
    draw, u, font = sheet.draw, sheet.unit, sheet.font
    for k in range(round(low), round(high) + 1):
        x = left + (k - low) / (high - low) * (right - left)
        draw.line([(x, top), (x, bottom)], fill=FAINT, width=sheet.line)
        draw.text((x, bottom + sheet.tick), f"1e{k}", INK, font, anchor="mt")
    for value in _steps(10**least, 10**most):
        y = bottom - (np.log10(value) - least) / (most - least) * (bottom - top)
        draw.line([(left, y), (right, y)], fill=FAINT, width=sheet.line)
        draw.text((left - sheet.tick, y), f"{value:g}", INK, font, anchor="rm")
    draw.text(((left + right) / 2, bottom + 1.9 * u + sheet.tick), xlabel, INK, font, anchor="mt")
    turned = Image.new("L", (int(font.getlength(ylabel)) + u, 2 * u))
    ImageDraw.Draw(turned).text((turned.width / 2, turned.height / 2), ylabel, 255, font, anchor="mm")
    turned = turned.rotate(90, expand=True)
    sheet.image.paste(INK, (round(0.1 * u), (top + bottom - turned.height) // 2), turned)
    sheet.box(sheet.frame)


def _steps(low: float, high: float) -> list[float]:
    """1, 2, 5 times powers of ten within [low, high]; only powers of ten where those are many."""
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    digits = (1, 2, 5) if len(powers) < 6 else (1,)
    return [m * 10.0**k for k in powers for m in digits if low <= m * 10.0**k <= high]


def _mark(sheet: Sheet, place: tuple[float, float], mark: str, colour: Any) -> None:
    x, y = place
    r = 5.5 * FINE
    if mark == "circle":
        sheet.draw.ellipse((x - r, y - r, x + r, y + r), fill=colour)
    elif mark == "square":
        sheet.draw.rectangle((x - r, y - r, x + r, y + r), fill=colour)
    elif mark == "diamond":
        sheet.draw.polygon([(x, y - 1.3 * r), (x + 1.3 * r, y), (x, y + 1.3 * r), (x - 1.3 * r, y)], fill=colour)
    elif mark == "triangle":
        sheet.draw.polygon([(x, y - 1.2 * r), (x + 1.2 * r, y + r), (x - 1.2 * r, y + r)], fill=colour)
    else:
        sheet.draw.line([(x - r, y - r), (x + r, y + r)], fill=colour, width=3 * FINE)
        sheet.draw.line([(x - r, y + r), (x + r, y - r)], fill=colour, width=3 * FINE)


def _label(
    sheet: Sheet, place: tuple[float, float], row: _figures.Row, colour: Any, taken: list[tuple[float, ...]]
) -> None:
    """sarcl's tolerance above its point, the exact peers' upsampling below theirs; where others stand, the other way.

    taken  boxes of the labels there are; added to
    """
    from PIL import ImageFont

    above, below = (-8 * FINE, "mb"), (9 * FINE, "mt")
    if _figures.is_ours(row):
        text, ways = row["setting"].replace("e-0", "e-"), (above, below)
    elif row["method"] == "direct":
        text, ways = row["setting"].split(";")[0].split(", ")[-1], (below, above)
    else:
        return
    font: Any = ImageFont.load_default(round(LABEL * sheet.unit))
    for shift, anchor in ways:
        at = place[0], place[1] + shift
        box = sheet.draw.textbbox(at, text, font, anchor=anchor)
        if not any(box[0] < t[2] and t[0] < box[2] and box[1] < t[3] and t[1] < box[3] for t in taken):
            sheet.draw.text(at, text, colour, font, anchor=anchor)
            taken.append(box)
            return


def _legend(sheet: Sheet, index: int, label: str, mark: str, colour: Any) -> None:
    """The curve's name, in lines that fit right of the frame."""
    from PIL import ImageFont

    font: Any = ImageFont.load_default(round(0.72 * sheet.unit))
    left = sheet.frame[2] + 0.8 * sheet.unit
    y = sheet.frame[1] + (0.6 + 2.3 * index) * sheet.unit
    _mark(sheet, (left, y), mark, colour)
    room = sheet.image.width - left - 1.2 * sheet.unit
    lines = [""]
    for word in label.split():
        joined = f"{lines[-1]} {word}".strip()
        if font.getlength(joined) > room and lines[-1]:
            lines.append(word)
        else:
            lines[-1] = joined
    sheet.draw.multiline_text(
        (left + 0.7 * sheet.unit, y - 0.4 * sheet.unit), "\n".join(lines[:2]), INK, font, spacing=0.2 * sheet.unit
    )
