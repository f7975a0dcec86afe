"""Quantities and suggestions as text for messages; objects as tables for notebooks, which Jupyter shows."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape


def size_text(nbytes: float) -> str:
    """A number of bytes with three digits and a unit: "6.1 GB"."""
    units = ("B", "kB", "MB", "GB", "TB")
    power = 0
    while nbytes >= 1000 and power < len(units) - 1:
        nbytes, power = nbytes / 1000, power + 1
    return f"{nbytes:.3g} {units[power]}"


def tolerance_text(value: float) -> str:
    """A tolerance with all its digits, at least two: 1.0e-03."""
    shown = (f"{value:.{digits}e}" for digits in range(1, 17))
    return next((text for text in shown if float(text) == value), f"{value:.17e}")


def duration(seconds: float) -> str:
    """A duration that a person can plan with, with the digits an estimate has: "25 ms", "2.5 s", "3 h 20 min"."""
    if seconds < 120:
        text = f"{seconds:.2g} s" if seconds < 9.95 else f"{seconds:.0f} s"
        return f"{1e3 * seconds:.2g} ms" if 0 < seconds < 0.0995 else text
    if seconds < 7170:
        return f"{seconds / 60:.0f} min"
    hours, minutes = divmod(round(seconds / 600) * 10, 60)
    if hours >= 48:
        return f"{seconds / 86400:.2g} days" if seconds < 99.5 * 86400 else f"{seconds / 86400:.0f} days"
    return f"{hours} h {minutes} min" if minutes and hours < 10 else f"{round(seconds / 3600)} h"


def detail_text(name: str, value: object) -> str:
    """A detail of a plan or report: its name and value; floats with four digits, seconds as a duration."""
    if isinstance(value, float):
        value = duration(value) if name.endswith("seconds") else f"{value:.4g}"
    return f"{name} {value}"


def rate_text(rate: float) -> str:
    """A rate as text a person reads, per second or, where it is slow, per minute: "850/s", "1.2 k/s", "7.5/min"."""
    if rate < 0.5:
        return f"{60 * rate:.3g}/min"
    for unit in ("", " k", " M"):
        if rate < 999.5:
            return f"{rate:.3g}{unit}/s"
        rate /= 1000
    return f"{rate:.4g} G/s"


def unknown(key: str, known: list[str], what: str) -> str:
    """Message for an unknown key: the closest known one as a suggestion, and all that are known."""
    from difflib import get_close_matches

    close = get_close_matches(key, known, 1)
    guess = f"; did you mean {close[0]!r}?" if close else ";"
    return f"unknown {what} {key!r}{guess} known: {', '.join(known) or 'none'}"


def shown(value: object, most: int = 60) -> str:
    """A value as Python writes it, on one line, at most so many characters."""
    return f"{' '.join(repr(value).split()):.{most}}"


def first_line(error: BaseException) -> str:
    """First line of the message of an error, at most 200 characters; the name of its class when it has none."""
    text = str(error).strip()
    return text.splitlines()[0][:200] if text else type(error).__name__


class NotebookTable:
    """An object that notebooks show as a table of `_notebook_rows`."""

    def _notebook_rows(self) -> Iterable[tuple[str, str]]:
        """(quantity, value) of every row, as plain text."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        return table(type(self).__name__, self._notebook_rows())


def table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """HTML of a table under a title; texts are escaped."""
    cell = "<td style='text-align: left'>"
    head = cell.replace("td", "th")
    lines = (f"<tr>{head}{escape(name)}</th>{cell}{escape(value)}</td></tr>" for name, value in rows)
    return f"<table><caption>sarcl.{escape(title)}</caption>{''.join(lines)}</table>"


def interval(values: Iterable[float], unit: str, digits: int = 6) -> str:
    """The least and the greatest of some values, or one number where both agree to `digits`."""
    ordered = sorted(values)
    first, last = f"{ordered[0]:.{digits}g}", f"{ordered[-1]:.{digits}g}"
    return f"{first} {unit}" if first == last else f"{first} to {last} {unit}"
