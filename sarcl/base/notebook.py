"""Tables of objects for notebooks: Jupyter shows them where an object is the last line of a cell."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape


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
