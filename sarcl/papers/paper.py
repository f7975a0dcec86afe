"""A reproduced paper: sections with rows of published and measured values, paragraphs and figures; the page of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from ..figures.html import Block, heading, listed, page, table, terms, words

Cause = Literal["", "error in print", "interpretation"]
CAUSES: tuple[tuple[Cause, str], ...] = (
    ("error in print", "Errors in print: a sign, a subscript or a number of the paper contradicts the paper itself or "
     "physics"),
    ("interpretation", "Differences of interpretation: nothing is misprinted; the statement depends on an "
     "approximation of the paper, or on what is measured and how"),
    ("", "Other differences"),
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One published value or statement, and the value measured here.

    item, source  what it is; its figure, table or equation
    published     as printed
    measured      the measured value in words;  value: as a number or several, for JSON
    holds         whether the measured value agrees with the published one
    why           where it does not: the reason; else a remark
    rule          what counts as agreement, for the page alone
    cause         where it does not agree: a misprint, or another reading of the paper; "" where neither is known
    """

    item: str
    source: str
    published: str
    measured: str
    holds: bool
    why: str = ""
    value: Any = None
    rule: str = ""
    cause: Cause = ""


@dataclass
class Section:
    """A section as it grows: rows, blocks of the page, and numbers for JSON."""

    key: str
    title: str
    rows: list[Row] = field(default_factory=list)
    parts: list[Block] = field(default_factory=list)
    numbers: dict[str, Any] = field(default_factory=dict)
    seconds: float = 0.0

    def number(
        self, item: str, source: str, published: float, measured: float, within: float, unit: str = "",
        form: str = ".3f", why: str = "", cause: Cause = "",
    ) -> None:  # fmt: skip
        """A row that holds where `measured` lies within `within` of the number printed."""
        here, printed = (f"{v:{form}} {unit}".strip() for v in (measured, published))
        holds, rule = bool(abs(measured - published) <= within), f"within {within:.3g} {unit}".strip()
        self.rows.append(Row(item, source, printed, here, holds, why, plain(measured), rule, "" if holds else cause))

    def states(
        self, item: str, source: str, published: str, measured: str, holds: Any, why: str = "", value: Any = None,
        *, rule: str, cause: Cause = "",
    ) -> None:  # fmt: skip
        """A row for a statement in words. `holds`: whether the measured value agrees, by the criterion `rule`."""
        cause = "" if holds else cause
        self.rows.append(Row(item, source, published, measured, bool(holds), why, plain(value), rule, cause))

    def say(self, text: str) -> None:
        """A paragraph."""
        self.parts.append(words(text))

    def draw(self, *figures: Block) -> None:
        """Figures."""
        self.parts += figures

    def keep(self, **numbers: Any) -> None:
        """Numbers behind the figures, six digits of each."""
        self.numbers |= {name: plain(value) for name, value in numbers.items()}

    def document(self) -> dict[str, Any]:
        """The section in JSON."""
        out = {name: getattr(self, name) for name in ("key", "title", "seconds", "numbers")}
        rows = [asdict(row) for row in self.rows]
        return out | {"rows": [{name: row[name] for name in row if name != "rule"} for row in rows]}


@dataclass(frozen=True)
class Paper:
    """A paper: its name on the command line, title, a paragraph about it, sections, terms.

    lab       makes what the sections share, from an OpenCL device and whether the run is a quick one
    sections  functions of it, one for each section
    quick     what a quick run leaves out, a sentence
    main      items of the rows that a reader should see first
    long      whether a full run takes hours: `lab` then also takes `folder`, in which it keeps what is finished, so
              that a stopped run goes on, and `progress`
    """

    name: str
    title: str
    about: str
    lab: Callable[..., Any]
    sections: tuple[Callable[[Any], Section], ...]
    quick: str
    terms: tuple[tuple[str, str], ...] = ()
    main: tuple[str, ...] = ()
    long: bool = False

    def run(self, lab: Any) -> Iterator[Section]:
        """Its sections, one after the other, timed; lab: as `self.lab` makes it."""
        for make in self.sections:
            start = time.monotonic()
            section = make(lab)
            section.seconds = round(time.monotonic() - start, 2)
            yield section

    def document(self, sections: Sequence[Section], quick: bool) -> dict[str, Any]:
        """The numbers of the sections there are."""
        return {
            "paper": self.name,
            "title": self.title,
            "quick": quick,
            "finished": len(sections) == len(self.sections),
            "seconds": round(sum(s.seconds for s in sections), 2),
            "sections": [s.document() for s in sections],
        }

    def html(self, sections: Sequence[Section], quick: bool, command: str = "") -> str:
        """The page of the finished sections: conclusion, terms, sections with figures, then the table of all rows.

        command  the line that made the page, printed on it
        """
        rows = [row for section in sections for row in section.rows]
        different = [row for row in rows if not row.holds]
        blocks = [words(self.about)]
        missing = len(self.sections) - len(sections)
        if missing:
            blocks.append(words(f"Not finished: {missing} section{'s follow' if missing > 1 else ' follows'}.", True))
        if quick:
            blocks.append(words(f"A quick run: {self.quick}", True))
        first = [row for item in self.main for row in rows if row.item == item]
        if first:
            blocks += [heading("Main results"), listed([f"{_verdict(row)}: {_in_words(row)}" for row in first])]
        blocks += [
            heading("Conclusion"),
            words(
                f"{len(rows) - len(different)} of {len(rows)} published values and statements agree with what was "
                f"measured in this run. {len(different)} differ{':' if different else '.'}"
            ),
        ]
        for cause, meaning in CAUSES:
            of_cause = [row for row in different if row.cause == cause]
            if of_cause:
                blocks += [words(f"{meaning} ({len(of_cause)})."), listed([_in_words(row) for row in of_cause])]
        if self.terms:
            blocks += [heading("Terms"), terms(self.terms)]
        for section in sections:
            blocks += [heading(section.title), *section.parts]
        blocks += [
            heading("Published and measured"),
            table(
                ["item", "published", "measured", "accepted if", "verdict"],
                [_cells(row) for row in rows],
                "All published values and statements. The third column was measured in this run; the fourth is the "
                "criterion behind the verdict: ok, or differs with its cause.",
                text=True,
                marked=[i for i, row in enumerate(rows) if not row.holds],
            ),
            words(f"Measured in {sum(s.seconds for s in sections):.0f} s.", True),
        ]
        return page(self.title, blocks, command)


def _verdict(row: Row) -> str:
    return "ok" if row.holds else f"differs ({row.cause})" if row.cause else "differs"


def _in_words(row: Row) -> str:
    """A row as a paragraph."""
    text = f"{row.item} ({row.source}). Published: {row.published}. Measured: {row.measured}."
    return f"{text} {row.why[:1].upper()}{row.why[1:]}.".replace("..", ".") if row.why else text


def _cells(row: Row) -> list[str]:
    verdict = _verdict(row) + (f": {row.why}" if row.why else "")
    return [row.item, f"{row.published} ({row.source})", row.measured, row.rule, verdict]


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
