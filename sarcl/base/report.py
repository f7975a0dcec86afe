"""Report: how a result was computed, its errors, and the seconds it took."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from types import MappingProxyType
from typing import Any

from .text import NotebookTable, detail_text, duration

SHOWN = 1e-2  # of the predicted error: smaller terms are left out of the text of a report
SMALLER_TOLERANCE = "a smaller tolerance"  # the remedy of an error term that a plan makes as large as it may be


@dataclass(frozen=True)
class ErrorTerm:
    """A part of a predicted error: relative, like the whole; the parts' squares add up to its square.

    remedy  what makes it smaller
    """

    name: str
    value: float
    remedy: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", float(self.value))  # NumPy's numbers too


def root_sum_square(terms: Iterable[ErrorTerm]) -> float:
    """Root of the sum of the squares of terms."""
    return math.sqrt(sum(term.value**2 for term in terms))


def terms_of_sum(errors: Mapping[str, float]) -> tuple[ErrorTerm, ...]:
    """Terms of errors by cause that add up as they are: each has its part of the square of the sum, so that the terms
    too add up by their squares. Causes without error are left out."""
    total = sum(errors.values())
    return tuple(
        ErrorTerm(name, math.sqrt(value * total), SMALLER_TOLERANCE) for name, value in errors.items() if value > 0
    )


@dataclass(frozen=True, eq=False)
class Report(NotebookTable):
    """How a result was computed.

    plan                   the choices made, name -> value
    tolerance              relative L2 error asked for
    predicted_error        bound from the error formulas, <= tolerance
    measured_error         against the exact sum at random outputs, or None when not checked
    contributions_done     pulse x pixel (or pulse x scatterer) pairs computed, or cells x time steps of a grid
    contributions_skipped  reason -> pairs left out
    seconds                stage -> s
    device                 the device's name
    seed                   of the random numbers, or None
    model_error            predicted relative L2 error of the model itself, which no tolerance bounds: of the grid of
                           `fullwave_echo`; None where the model has no error of its own, or none was predicted
    error_terms            parts of predicted_error, which is the root of the sum of their squares

    >>> image.report.predicted_error <= image.report.tolerance, image.report.contributions_done
    (True, 1048576)
    >>> image.report.to_dict()["tolerance"] == image.report.tolerance
    True
    """

    plan: Mapping[str, object] = field(default_factory=dict)
    tolerance: float = 0.0
    predicted_error: float = 0.0
    measured_error: float | None = None
    contributions_done: int = 0
    contributions_skipped: Mapping[str, int] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    device: str = ""
    seed: int | None = None
    model_error: float | None = None
    error_terms: tuple[ErrorTerm, ...] = ()

    def __post_init__(self) -> None:
        terms = tuple(ErrorTerm(**term) if isinstance(term, Mapping) else term for term in self.error_terms)
        object.__setattr__(self, "error_terms", terms)
        for name in ("plan", "contributions_skipped", "seconds"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def dynamic_range_db(self) -> float:
        """Ratio of the brightest response to the predicted error, dB: a response weaker by more may be an error."""
        return -20 * math.log10(self.predicted_error) if self.predicted_error > 0 else math.inf

    def __reduce__(self) -> tuple[Any, ...]:
        return Report, tuple(self.to_dict().values())  # a MappingProxyType cannot be copied or pickled

    def to_dict(self) -> dict[str, Any]:
        """The report as plain numbers and strings, ready for JSON."""
        plain = {k: getattr(self, k) for k in self.__dataclass_fields__}
        plain["error_terms"] = tuple(asdict(term) for term in self.error_terms)
        return {k: dict(v) if isinstance(v, MappingProxyType) else v for k, v in plain.items()}

    def _notebook_rows(self) -> Iterator[tuple[str, str]]:
        yield "device", self.device
        yield "plan", ", ".join(detail_text(name, value) for name, value in self.plan.items())
        error = "not measured" if self.measured_error is None else f"{self.measured_error:.1e} measured"
        yield "error", f"{self.tolerance:.1e} asked, {self.predicted_error:.1e} predicted, {error}"
        terms = [term for term in self.error_terms if term.value >= SHOWN * self.predicted_error]
        if len(terms) > 1:
            yield "of which", ", ".join(f"{term.name} {term.value:.1e}" for term in terms)
        if self.model_error is not None:
            yield "model", f"{self.model_error:.1e} predicted for the model itself"
        if self.predicted_error > 0:
            yield "contrast", f"trusted down to {self.dynamic_range_db:.0f} dB below what is bright in the same rows"
        yield "done", f"{self.contributions_done:.3e} contributions"
        yield from (("skipped", f"{n:.3e} {why}") for why, n in self.contributions_skipped.items() if n)
        yield "time", ", ".join(f"{stage} {duration(s)}" for stage, s in self.seconds.items())

    def __str__(self) -> str:
        return "\n".join(f"{name:<12}{value}" for name, value in self._notebook_rows())
