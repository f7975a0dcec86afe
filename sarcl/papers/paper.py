"""A reproduced paper: sections with rows of published and measured values, paragraphs and figures; the page of them."""

from __future__ import annotations

import functools
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pkgutil import get_data
from typing import Any, Literal

import numpy as np

from ..base.text import duration
from ..figures import html
from ..figures.html import Block, heading, listed, page, strip, table, terms, words
from ..figures.plots import Curve, Limits
from . import PAPERS

Ends = tuple[float, float]
Basis = Literal["paper", "geometry", "theory"]
BASES: dict[Basis, str] = {
    "paper": "printed in the paper",
    "geometry": "follows from the dimensions that this page chose",
    "theory": "a law, a closed form, or the tolerance that was asked for",
}
Cause = Literal["", "error in print", "interpretation"]
CAUSES: tuple[tuple[Cause, str], ...] = (
    (
        "error in print",
        "Errors in print: a sign, a subscript or a number of the paper contradicts the paper itself or physics",
    ),
    (
        "interpretation",
        "Differences of interpretation: nothing is misprinted; the statement depends on an "
        "approximation of the paper, or on what is measured and how",
    ),
    ("", "Other differences"),
)


@dataclass(frozen=True)
class Row:
    """One expected value or statement, and the value measured here.

    item, source  what it is; its figure, table or equation
    expected      the expected value or statement in words
    measured      the measured value in words;  value: as a number or several, for JSON
    holds         whether the measured value agrees with the expected one
    why           where it does not: the reason; else a remark
    rule          what counts as agreement, for the page alone
    cause         where it does not agree: a misprint, or another reading of the paper; "" where neither is known
    basis         where the expected value comes from: a key of BASES. Only those of the paper count as published
    """

    item: str
    source: str
    expected: str
    measured: str
    holds: bool
    why: str = ""
    value: object = None
    rule: str = ""
    cause: Cause = ""
    basis: Basis = "paper"

    def document(self) -> dict[str, Any]:
        """The row in JSON. The expected value is called `published` where the paper prints it."""
        out = asdict(self)
        del out["rule"]
        return {"published" if name == "expected" and self.basis == "paper" else name: out[name] for name in out}


ROW_TEXTS = {"item", "source", "expected", "measured", "why", "rule", "cause", "basis"}


@functools.cache
def _texts(paper: str) -> dict[str, Any]:
    """Texts of a paper's page: NAME.toml beside this file."""
    return tomllib.loads((get_data(__package__, f"{paper}.toml") or b"").decode())


@dataclass
class Section:
    """A section as it grows: rows, blocks of the page, and numbers for JSON.

    texts  its paragraphs, and for each item of a row a table of published value, source, criterion and remarks
    words  what stands in the {} of texts, beside the words of a call
    """

    key: str
    title: str
    texts: dict[str, Any] = field(default_factory=dict)
    words: dict[str, object] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)
    parts: list[Block] = field(default_factory=list)
    numbers: dict[str, Any] = field(default_factory=dict)
    seconds: float = 0.0

    @classmethod
    def of(cls, paper: str, key: str, **words: object) -> Section:
        """A section with the texts of its paper's file; words fill all of them."""
        texts = _texts(paper)[key]
        return cls(key, texts["title"].format(**words), texts, words)

    def number(self, item: str, measured: float, **words: object) -> None:
        """A row that holds where `measured` lies `within` so much of the expected number; words: as `states` has them,
        and form and unit of both numbers."""
        text = {"unit": "", "form": ".3f", **self.texts.get(item, {}), **words}
        printed, value = (f"{v:{text['form']}} {text['unit']}".strip() for v in (text["expected"], measured))
        rule = f"within {text['within']:.3g} {text['unit']}".strip()
        holds = abs(measured - text["expected"]) <= text["within"]
        self.states(item, measured, holds, **{**words, "expected": printed, "measured": value, "rule": rule})

    def states(self, item: str, value: object, holds: object, **words: Any) -> None:
        """A row. `holds`: whether the measured value agrees, by the criterion `rule`.

        The texts of the row are those of the item in the paper's file. In {} they name the value and the words; a
        word that is called as a text stands in its place.
        """
        texts = {"item": item, "source": "", **self.texts.get(item, {})}
        filled = {
            name: text.format(value=value, **self.words | words)
            for name, text in texts.items()
            if isinstance(text, str)
        }
        row = {name: text for name, text in {**filled, **words}.items() if name in ROW_TEXTS}
        self.rows.append(
            Row(**row | {"cause": "" if holds else row.get("cause", "")}, holds=bool(holds), value=plain(value))
        )

    def say(self, key: str = "text", **words: object) -> None:
        """A paragraph of the paper's file, with the words in its {}."""
        self.parts.append(html.words(self.texts[key].format(**self.words | words)))

    def list(self, key: str = "errors") -> None:
        """A list of paragraphs of the paper's file."""
        self.parts.append(listed(self.texts[key]))

    def draw(self, *figures: Block) -> None:
        """Figures."""
        self.parts += figures

    def _figure(self, key: str, words: Mapping[str, object]) -> dict[str, Any]:
        """Texts of a figure or table of the paper's file: names of axes or a head, and a caption."""
        texts, words = {"caption": "", **self.texts["figures"][key]}, self.words | dict(words)
        head = [text.format(**words) for text in texts.pop("head", [])]
        return {name: text.format(**words) for name, text in texts.items()} | {"head": head}

    def plot(
        self,
        key: str,
        curves: Sequence[Curve],
        dots: bool | Sequence[str] = False,
        log_x: bool = False,
        limits: Limits = (None, None),
        **words: object,
    ) -> None:
        """A figure of curves; words fill its texts."""
        texts = self._figure(key, words)
        self.parts.append(
            html.plot(curves, texts["x"], texts["y"], texts["caption"], dots=dots, log_x=log_x, limits=limits)
        )

    def picture(
        self, key: str, values: np.ndarray, x: Ends, y: Ends, words: Mapping[str, object] | None = None, **look: Any
    ) -> None:
        """A figure of values between the ends of x and y, in grey; words fill its texts."""
        texts = self._figure(key, words or {})
        self.parts.append(html.picture(values, x, y, texts["x"], texts["y"], texts["caption"], **look))

    def table(self, key: str, rows: Sequence[Sequence[Any]], text: bool = False, **words: object) -> None:
        """A table; words fill its texts."""
        texts = self._figure(key, words)
        self.parts.append(table(texts["head"], rows, texts["caption"], text=text))

    def keep(self, **numbers: object) -> None:
        """Numbers behind the figures, six digits of each."""
        self.numbers |= {name: plain(value) for name, value in numbers.items()}

    def document(self) -> dict[str, Any]:
        """The section in JSON."""
        out = {name: getattr(self, name) for name in ("key", "title", "seconds", "numbers")}
        return out | {"rows": [row.document() for row in self.rows]}


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

    @classmethod
    def of(
        cls,
        name: str,
        lab: Callable[..., Any],
        sections: tuple[Callable[[Any], Section], ...],
        long: bool = False,
        **words: object,
    ) -> Paper:
        """A paper with the texts of its file; words fill that of a quick run."""
        texts = _texts(name)
        about, quick = texts["about"].format(source=PAPERS[name]), texts["quick"].format(**words)
        return cls(
            name, texts["title"], about, lab, sections, quick, tuple(texts["terms"].items()), tuple(texts["main"]), long
        )

    def run(self, lab: object) -> Iterator[Section]:
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
        """The page of the finished sections: pictures, terms, the table of all rows, sections with figures, about.

        command  the line that made the page, printed on it
        """
        figures = [block for section in sections for block in (heading(section.title), *section.parts)]
        blocks = []
        missing = len(self.sections) - len(sections)
        if missing:
            blocks.append(words(f"Not finished: {missing} section{'s follow' if missing > 1 else ' follows'}.", True))
        if quick:
            blocks.append(words(f"A quick run: {self.quick}", True))
        rows = [row for section in sections for row in section.rows]
        defined = [terms(self.terms, "Terms that this page uses")] if self.terms else []
        blocks += [*strip(figures), *defined, *_conclusion(rows, self.main), *figures]
        blocks += [heading("About this page"), words(self.about)]
        blocks.append(words(f"Measured in {duration(sum(s.seconds for s in sections))}.", True))
        return page(self.title, blocks, command)


def _conclusion(rows: Sequence[Row], main: Sequence[str]) -> list[Block]:
    """Numbers of rows that agree, and the table of all rows; main: items of the rows that come first."""
    published, others = ([row for row in rows if (row.basis == "paper") == printed] for printed in (True, False))
    of_cause = {meaning: [row for row in published if not row.holds and row.cause == c] for c, meaning in CAUSES}
    counts = ", ".join(_counted(len(of), meaning.split(":")[0].lower()) for meaning, of in of_cause.items() if of)
    n_right = sum(row.holds for row in published)
    n_wrong = len(published) - n_right
    ordered: list[Row] = []
    heads = {}
    groups = [
        ("Main results", [row for item in main for row in rows if row.item == item]),
        *((f"{meaning} ({len(of)}).", of) for meaning, of in of_cause.items()),
        ("Published values and statements that agree.", [row for row in published if row.holds]),
        (_meaning(others), sorted(others, key=lambda row: row.holds)),
    ]
    for head, members in groups:
        rest = [row for row in members if all(row is not earlier for earlier in ordered)]
        if rest:
            heads[len(ordered)] = head + (" Main results among them stand above." if len(rest) < len(members) else "")
            ordered += rest
    return [
        heading("Conclusion"),
        words(
            f"{n_right} of {len(published)} published values and statements agree with what was measured in this run. "
            f"{n_wrong} {'differs' if n_wrong == 1 else 'differ'}{f': {counts}' if counts else ''}."
        ),
        table(
            ["item", "published or expected" if others else "published", "measured", "verdict", "why"],
            [_cells(row) for row in ordered],
            text=True,
            marked=[i for i, row in enumerate(ordered) if not row.holds],
            groups=heads,
        ),
    ]


def _counted(n: int, plural: str) -> str:
    """A number of things; the first word of `plural` loses its s where there is one thing."""
    noun, *others = plural.split()
    return " ".join([str(n), noun.removesuffix("s") if n == 1 else noun, *others])


def _meaning(others: Sequence[Row]) -> str:
    """Number of values that agree though the paper does not print them, and what they come from."""
    meanings = "; ".join(f"{basis}: {BASES[basis]}" for basis in BASES if basis != "paper")
    n_right = sum(row.holds for row in others)
    return (
        f"{n_right} of {len(others)} further values, which the paper does not print, agree with geometry or theory: "
        f"{meanings}."
    )


def _verdict(row: Row) -> str:
    return "ok" if row.holds else f"differs ({row.cause})" if row.cause else "differs"


def _source(row: Row) -> str:
    """Figure, table or equation, and the basis of values that the paper does not print."""
    return row.source if row.basis == "paper" else ", ".join(filter(None, (row.basis, row.source)))


def _cells(row: Row) -> list[object]:
    """Cells of the table: each with its source or its criterion in small print."""
    criterion = f"(criterion: {row.rule})" if row.rule else ""
    return [row.item, (row.expected, f"({_source(row)})"), row.measured, (_verdict(row), criterion), row.why]


def plain(value: object) -> Any:  # what JSON takes
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
