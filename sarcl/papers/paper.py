"""A paper done again: sections that hold rows of published beside measured, words and drawings; the page of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..figures.html import heading, page, table, words
from .lab import Lab


@dataclass(frozen=True)
class Row:
    """One figure or statement of a paper, and what comes out here.

    item, source  what it is, and its figure, table or equation
    published     as printed
    measured      the same here, in words;  value  as a number or several, for JSON
    holds         whether what is printed is what comes out
    why           where it is not: the reason; else a remark
    """

    item: str
    source: str
    published: str
    measured: str
    holds: bool
    why: str = ""
    value: Any = None


@dataclass
class Section:
    """A section as it grows: rows, the page's parts, and numbers for JSON."""

    key: str
    title: str
    rows: list[Row] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)
    numbers: dict[str, Any] = field(default_factory=dict)
    seconds: float = 0.0

    def number(
        self, item: str, source: str, published: float, measured: float, within: float, unit: str = "",
        form: str = ".3f", why: str = "",
    ) -> None:  # fmt: skip
        """A row that holds where `measured` lies within `within` of the number printed."""
        here, printed = (f"{v:{form}} {unit}".strip() for v in (measured, published))
        self.rows.append(
            Row(item, source, printed, here, bool(abs(measured - published) <= within), why, plain(measured))
        )

    def states(
        self, item: str, source: str, published: str, measured: str, holds: Any, why: str = "", value: Any = None
    ) -> None:
        """A row of words; the caller measured whether they hold."""
        self.rows.append(Row(item, source, published, measured, bool(holds), why, plain(value)))

    def say(self, text: str) -> None:
        """A paragraph."""
        self.parts.append(words(text))

    def draw(self, *figures: str) -> None:
        """Drawings."""
        self.parts += figures

    def keep(self, **numbers: Any) -> None:
        """Numbers behind the drawings, six digits of each."""
        self.numbers |= {name: plain(value) for name, value in numbers.items()}

    def document(self) -> dict[str, Any]:
        """What JSON holds of it."""
        out = {name: getattr(self, name) for name in ("key", "title", "seconds", "numbers")}
        return out | {"rows": [asdict(row) for row in self.rows]}


Make = Callable[[Lab], Section]


@dataclass(frozen=True)
class Paper:
    """A paper: its name on the command line, title, a paragraph, and what makes its sections."""

    name: str
    title: str
    about: str
    sections: tuple[Make, ...]

    def run(self, lab: Lab) -> Iterator[Section]:
        """Its sections, one after the other, timed."""
        for make in self.sections:
            start = time.monotonic()
            section = make(lab)
            section.seconds = round(time.monotonic() - start, 2)
            yield section

    def document(self, sections: Sequence[Section], lab: Lab) -> dict[str, Any]:
        """The numbers of the sections there are."""
        return {
            "paper": self.name,
            "title": self.title,
            "quick": lab.quick,
            "finished": len(sections) == len(self.sections),
            "seconds": round(sum(s.seconds for s in sections), 2),
            "sections": [s.document() for s in sections],
        }

    def html(self, sections: Sequence[Section], lab: Lab) -> str:
        """The page of the sections there are: the table of all rows first."""
        rows = [row for section in sections for row in section.rows]
        fine = sum(row.holds for row in rows)
        parts = [words(self.about)]
        missing = len(self.sections) - len(sections)
        if missing:
            parts.append(words(f"Not finished: {missing} sections are still to come.", True))
        if lab.quick:
            parts.append(words("A quick run: the largest arrays were left out.", True))
        parts += [
            heading("Published and measured"),
            words(
                f"{fine} of {len(rows)} figures and statements come out as printed. Where one errs, the last column "
                "says why. All of the third column was measured in this run."
            ),
            table(["item", "published", "measured", "verdict"], [_cells(row) for row in rows], text=True).replace(
                "<td>errs", '<td class="errs">errs'
            ),
        ]  # fmt: skip
        for section in sections:
            parts += [heading(section.title), *section.parts]
        seconds = sum(s.seconds for s in sections)
        parts.append(words(f"Made in {seconds:.0f} s.", True))
        return page(self.title, parts)


def _cells(row: Row) -> list[str]:
    verdict = ("ok" if row.holds else "errs") + (f": {row.why}" if row.why else "")
    return [row.item, f"{row.published} ({row.source})", row.measured, verdict]


def plain(value: Any) -> Any:
    """Numbers as JSON takes them, floats of six digits; NaN and Inf as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value
