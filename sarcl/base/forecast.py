"""Forecast: what a verb would do, predicted before the work; and the plan that it carries out."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from math import isnan
from typing import Generic, Protocol, TypeVar

from .report import ErrorTerm
from .text import NotebookTable, detail_text, duration, size_text

R_co = TypeVar("R_co", covariant=True)


@dataclass(frozen=True, eq=False, repr=False)
class Forecast(NotebookTable, Generic[R_co]):
    """Forecast of a verb with the same arguments: `sarcl.plan(verb, ...)` makes it.

    method           such as "direct", "factorized", "polar format", "range-Doppler", "pulse by pulse", "full wave";
                     "pulse by pulse or factorized": echoes of facets that the run cuts before it chooses
    plan             details of the plan, as in a report
    seconds          estimated run time at the present speed of the devices
    bytes            estimated memory: of an image all pixels, and the blocks on every device; of echoes their samples
                     and geometry, in memory or in a file; of cross sections the peak of the run, with edges a bound
    predicted_error  bound of the relative error; nan: known only after the run
    error_terms      parts of predicted_error, which is the root of the sum of their squares
    n_rows, n_samples  of echoes; None for images
    model_error      predicted error of the model itself, which no tolerance bounds; None: it has none, or it is
                     known only after the run
    work             a line of text about the work, where rows and pixels say little of it, such as runs of a grid
    planning         seconds that planning has taken, which `seconds` includes
    run              run() carries out this very plan and returns the verb's result. What was planned from is referred
                     to, not copied: ValueError where a file of it has changed meanwhile
    search_cheaper   gives `cheaper`

    >>> forecast = sarcl.plan(raw, grid, tolerance=1e-2)
    >>> forecast.predicted_error <= 1e-2, forecast.run().shape
    (True, (128, 128))
    """

    method: str
    plan: Mapping[str, object]
    seconds: float
    bytes: float
    predicted_error: float
    run: Callable[[], R_co]
    error_terms: tuple[ErrorTerm, ...] = ()
    n_rows: int | None = None
    n_samples: int | None = None
    model_error: float | None = None
    work: str = ""
    planning: float = 0.0
    search_cheaper: Callable[[], tuple[float, float] | None] = field(default=lambda: None)

    @functools.cached_property
    def cheaper(self) -> tuple[float, float] | None:
        """(predicted error, seconds) of the next cheaper plan, which is planned when it is first asked for; None: none,
        or the verb searches for none."""
        return self.search_cheaper()

    def _notebook_rows(self) -> Iterator[tuple[str, str]]:
        yield "method", self.method
        if self.n_rows is not None:
            yield "result", f"{self.n_rows} rows of {self.n_samples} samples"
        yield "time, memory", f"about {duration(self.seconds)}, {size_text(self.bytes)}"
        yield "error", "known after the run" if isnan(self.predicted_error) else f"below {self.predicted_error:.1e}"
        yield from ((f"of which {term.name}", f"{term.value:.1e}: {term.remedy}") for term in self.error_terms)
        if self.cheaper:
            yield "next cheaper plan", f"{self.cheaper[0]:.1e} in {duration(self.cheaper[1])}"
        yield "plan", ", ".join(detail_text(name, value) for name, value in self.plan.items())
        if self.work:
            yield "work", self.work

    def __str__(self) -> str:
        text = self._summary()
        if self.cheaper:
            text += f" (next cheaper plan: {self.cheaper[0]:.1e} in {duration(self.cheaper[1])})"
        return f"{text}\n{self.work}" if self.work else text

    def __repr__(self) -> str:
        return f"<Forecast {self._summary()}>"

    def _summary(self) -> str:
        rows = "" if self.n_rows is None else f"{self.n_rows} rows of {self.n_samples} samples, "
        error = "known after the run" if isnan(self.predicted_error) else f"below {self.predicted_error:.1e}"
        return f"{self.method}: {rows}about {duration(self.seconds)}, {size_text(self.bytes)}, error {error}"


class Plan(Protocol[R_co]):
    """What a verb has decided about one task: it can be forecast, or run."""

    def forecast(self) -> Forecast[R_co]:
        """Its Forecast."""

    def run(self) -> R_co:
        """The result."""
