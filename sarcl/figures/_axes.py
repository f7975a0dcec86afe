"""Frame, axes with round ticks, title and caption of a picture, drawn with Pillow."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

WHITE, INK, FAINT = (255, 255, 255), (38, 38, 38), (226, 226, 226)
CURVE_WIDTH, CURVE_HEIGHT = 960, 540  # pixels of a frame of curves
FINE = 4  # times finer than the frame, in which curves are drawn, for smooth edges
HEADROOM = -0.04  # ratio of the highest level, dB above the peak, to the lowest one


class Axis(NamedTuple):
    """An axis of a frame: its label, the values at its ends, and the least step of its ticks."""

    label: str
    low: float
    high: float
    least_step: float = 0.0


class Axes:
    """White background with a frame of (width, height) pixels for the data, axes, a title above and a caption below.

    across, up   the two axes
    side         space right of the frame, in units of the font size
    """

    def __init__(
        self, width: int, height: int, across: Axis, up: Axis, title: str | None, side: float, caption: str
    ) -> None:
        from PIL import Image, ImageDraw, ImageFont

        self.unit = u = int(np.clip(round(max(width, height) / 40), 15, 40))
        self.line, self.tick = max(1, round(u / 14)), round(u * 0.4)
        self.font = ImageFont.load_default(u)
        self.across, self.up = across, up
        self.across_ticks = self._ticks(across, width, across=True)
        self.up_ticks = self._ticks(up, height, across=False)
        widest = max((self.font.getlength(number(t, self.up_ticks[0])) for t in self.up_ticks[1]), default=0)
        left = round(2 * self.tick + widest + 2.2 * u)
        top = round(2.6 * u if title else 1.2 * u)
        self.frame = (left, top, left + width, top + height)
        small = ImageFont.load_default(round(0.85 * u))
        room_below: float = width + round(side * u) + left - u
        lines = wrapped(caption, room_below, small.getlength)
        below = top + height + round(3.9 * u)
        size = (left + width + round(side * u), below + round((1.2 * len(lines) + 0.4) * u))
        self.image = Image.new("RGB", size, WHITE)
        self.image.info |= {"frame": self.frame, "caption": caption}
        self.draw = ImageDraw.Draw(self.image)
        for i, line in enumerate(lines):
            self.draw.text((0.5 * u, below + round(1.2 * i * u)), line, INK, small, anchor="lt")
        if title:
            self.image.info["title"] = title
            # The font that comes with Pillow has one dash.
            title = " ".join(str(title).split()).translate(dict.fromkeys(map(ord, "‐‑‒–—−"), "-"))
            room = size[0] - left - 0.5 * u
            font = ImageFont.load_default(round(1.2 * u))
            if font.getlength(title) > room:
                font = self.font
            while font.getlength(title) > room:
                title = title[:-2].rstrip() + "…"
            self.draw.text((left, top - round(0.75 * u)), title, INK, font, anchor="ls")

    def _ticks(self, axis: Axis, length: int, across: bool) -> tuple[float, list[float]]:
        """(step, values) of an axis `length` pixels long, as many as its labels leave room for."""
        _, low, high, least = axis
        most = max(length / (4.2 * self.unit), 5.0)
        while True:
            step, ticks = ticks_between(low, high, most, least)
            widest = max((self.font.getlength(number(t, step)) for t in ticks), default=0) if across else 0
            if len(ticks) < 2 or step / (high - low) * length >= widest + (0.6 if across else 1.2) * self.unit:
                return step, ticks
            most /= 1.5

    def axes(self, grid: bool = False) -> None:
        """Draw frame, ticks and labels; with `grid`, faint lines at the ticks too."""
        from PIL import Image, ImageDraw

        left, top, right, bottom = self.frame
        u, draw, line = self.unit, self.draw, self.line
        (xlabel, low, high, _), (step, ticks) = self.across, self.across_ticks
        for t in ticks:
            x = left + round((t - low) / (high - low) * (right - left))
            if grid:
                draw.line([(x, top), (x, bottom - 1)], fill=FAINT, width=line)
            draw.line([(x, bottom + line), (x, bottom + self.tick)], fill=INK, width=line)
            draw.text((x, bottom + 1.6 * self.tick), number(t, step), INK, self.font, anchor="mt")
        draw.text(((left + right) / 2, bottom + 1.9 * u + self.tick), xlabel, INK, self.font, anchor="mt")
        (ylabel, low, high, _), (step, ticks) = self.up, self.up_ticks
        for t in ticks:
            y = bottom - round((t - low) / (high - low) * (bottom - top))
            if grid:
                draw.line([(left, y), (right - 1, y)], fill=FAINT, width=line)
            draw.line([(left - self.tick, y), (left - line - 1, y)], fill=INK, width=line)
            draw.text((left - 1.7 * self.tick, y), number(t, step), INK, self.font, anchor="rm")
        self.box(self.frame)
        label = Image.new("L", (int(self.font.getlength(ylabel)) + u, 2 * u))
        middle = (label.width / 2, label.height / 2)
        ImageDraw.Draw(label).text(middle, ylabel, 255, self.font, anchor="mm")
        label = label.rotate(90, expand=True)
        self.image.paste(INK, (round(0.2 * u), (top + bottom - label.height) // 2), label)

    def box(self, frame: tuple[int, int, int, int]) -> None:
        """A thin frame just outside `frame`, so that it covers no data."""
        w = self.line
        left, top, right, bottom = frame
        self.draw.rectangle((left - w, top - w, right + w - 1, bottom + w - 1), outline=INK, width=w)


class CurveAxes(Axes):
    """A frame of curves from floor_db to a little above 0 dB, relative to what `reference` names."""

    def __init__(self, across: Axis, reference: str, floor_db: float, title: str | None, caption: str) -> None:
        up = Axis(f"relative to {reference} (dB)", floor_db, HEADROOM * floor_db)
        super().__init__(CURVE_WIDTH, CURVE_HEIGHT, across, up, title, 1.5, caption)
        self.axes(grid=True)

    def curve(self, fraction: np.ndarray, db: np.ndarray, colour: tuple[int, int, int], has_dots: bool = False) -> None:
        """A curve of levels, dB (n,), at fractions of the width (n,); has_dots: with a dot at each."""
        from PIL import Image, ImageDraw

        _, low, high, _ = self.up
        x = fraction * CURVE_WIDTH * FINE
        y = (high - np.clip(db, 2 * low, 2 * high)) / (high - low) * CURVE_HEIGHT * FINE
        canvas = Image.new("L", (CURVE_WIDTH * FINE, CURVE_HEIGHT * FINE))
        draw = ImageDraw.Draw(canvas)
        points = list(zip(x.tolist(), y.tolist(), strict=True))
        draw.line(points, fill=255, width=9, joint="curve")
        for px, py in points if has_dots else ():
            draw.ellipse((px - 14, py - 14, px + 14, py + 14), fill=255)
        self.image.paste(colour, self.frame[:2], canvas.reduce(FINE))


def wrapped(text: str, room: float, length: Callable[[str], float]) -> list[str]:
    """Lines of `text` of at most `room` pixels each, broken between words; `length` measures a line, pixels."""
    lines = [""]
    for word in text.split():
        joined = f"{lines[-1]} {word}".strip()
        if lines[-1] and length(joined) > room:
            lines.append(word)
        else:
            lines[-1] = joined
    return lines


def ticks_between(low: float, high: float, most: float, least: float = 0.0) -> tuple[float, list[float]]:
    """(step, values): multiples of 1, 2 or 5 10^k in [low, high], about `most` of them."""
    rough = max((high - low) / most, least)
    power = 10.0 ** np.floor(np.log10(rough))
    step = float(power * next(m for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9)))
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return step, [float(k * step) for k in np.arange(first, last + 1)]


def number(value: float, step: float) -> str:
    """A tick's number with the decimals its step needs."""
    if max(abs(value), step) >= 1e6 or (step < 1e-4 and abs(value) < 1):
        return f"{value:.6g}"
    decimals = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    return f"{round(value, decimals) + 0.0:.{decimals}f}"
