"""A verb: a function whose options are a record, and whose work is planned before it runs.

    @verb(PolarFormatOptions)
    def polar_format(raw: PhaseHistory, grid: ImageGrid, options: PolarFormatOptions) -> Plan[Image]:
        ...

is written as the function that plans: arguments -> task -> plan. `polar_format(raw, grid, tolerance=1e-2)` then runs
that plan, and `sarcl.plan(polar_format, raw, grid, tolerance=1e-2)` forecasts it.
"""

from __future__ import annotations

import functools
import inspect
import textwrap
from collections.abc import Callable
from typing import Concatenate, ParamSpec, Protocol, TypeVar, cast

from .forecast import Plan
from .options import Options, described
from .text import unknown

R_co = TypeVar("R_co", covariant=True)
R = TypeVar("R")
P = ParamSpec("P")
S = TypeVar("S")
A = TypeVar("A")
B = TypeVar("B")
C = TypeVar("C")
MARK = "{options}"  # in the docstring of a verb: here its options are listed
WIDTH = 116  # columns of a docstring without its indentation


class Verb(Protocol[R_co]):
    """A verb: called it returns its result.

    planned  called in the same way, returns its Plan;  options  its record
    lists    names of the subject, and of options, that may be lists of as many: a list of results is returned then
    """

    __name__: str
    options: type[Options]
    lists: tuple[str, ...]

    @property
    def planned(self) -> Callable[..., Plan[R_co]]:
        """Its Plan for some arguments."""

    def __call__(self, *args: object, **options: object) -> R_co:
        """The result of the plan for these arguments."""


def verb(
    record: type[Options], lists: tuple[str, ...] = (), plan_list: Callable[..., Plan[object]] | None = None
) -> Callable[[Callable[..., Plan[R]]], Verb[R]]:
    """Decorator that makes a verb, with the options of `record`, of the function that plans it.

    lists      a subject that may be a list, and options that are lists of as many then
    plan_list  plan_list(plan, *subjects, options) plans such a list

    >>> class Count:  # a plan; forecast() of one returns a sarcl.Forecast
    ...     def __init__(self, rows): self.rows = rows
    ...     def run(self): return self.rows
    >>> @sarcl.verb(sarcl.Options)
    ... def count(raw, options):
    ...     return Count(raw.n_rows)
    >>> count(raw)
    64
    """

    def decorate(plan: Callable[..., Plan[R]]) -> Verb[R]:
        signature = inspect.signature(plan)
        subjects = [p for p in signature.parameters.values() if p.name != "options"]
        names = [p.name for p in subjects]

        def planned(*args: object, **given: object) -> Plan[R]:
            own, options = _split(plan.__name__, record, names, len(args), given)
            if plan_list and isinstance((dict(zip(names, args, strict=False)) | own).get(lists[0]), (list, tuple)):
                return plan_list(plan, *args, **own, options=options)  # type: ignore[return-value]  # as the stub says
            return plan(*args, **own, options=options)

        @functools.wraps(plan)
        def function(*args: object, **given: object) -> R:
            return function.planned(*args, **given).run()  # type: ignore[attr-defined]

        function.planned, function.options, function.lists = planned, record, lists  # type: ignore[attr-defined]
        function.__signature__ = signature.replace(  # type: ignore[attr-defined]
            parameters=[*subjects, *_keywords(record)], return_annotation=result_of(signature.return_annotation)
        )
        function.__annotations__ = {p.name: p.annotation for p in subjects}
        function.__doc__ = inspect.cleandoc(plan.__doc__ or "").replace(MARK, listed(record))
        return function  # type: ignore[return-value]

    return decorate


def constructor(
    record: type[Options], call: Callable[P, object]
) -> Callable[[Callable[[S, A, B, C], None]], Callable[Concatenate[S, P], None]]:
    """Decorator of a class's __init__(self, a, b, options), which then takes the options of `record` by name.

    call  what takes `a`, `b` and these options, such as a class of `record` with two more fields: for type checkers
    """

    def decorate(initialize: Callable[[S, A, B, C], None]) -> Callable[Concatenate[S, P], None]:
        signature = inspect.signature(initialize)
        subjects = [p for p in signature.parameters.values() if p.name != "options"]

        @functools.wraps(initialize)
        def function(*args: object, **given: object) -> None:
            own, options = _split(type(args[0]).__name__, record, [p.name for p in subjects], len(args), given)
            initialize(*args, **own, options=options)  # type: ignore[call-arg, arg-type]  # as decorate() says

        parameters = [*subjects, *_keywords(record)]
        function.options = record  # type: ignore[attr-defined]
        function.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        return cast(Callable[Concatenate[S, P], None], function)

    return decorate


def _split(
    name: str, record: type[Options], subjects: list[str], n_given: int, given: dict[str, object]
) -> tuple[dict[str, object], Options]:
    """Arguments given by name: the subjects among them, and the record of the options. TypeError for unknown ones, and
    where more arguments are given by position than there are subjects."""
    if n_given > len(subjects):
        named = ", ".join(subject for subject in subjects if subject != "self")
        raise TypeError(f"{name} takes {named} by position; give options by name")
    known = list(described(record))
    for option in given:
        if option in record.absent and option not in known:
            raise TypeError(f"{name} has no option {option!r}: {record.absent[option]}")
        if option not in known and option not in subjects:
            raise TypeError(f"{name} has {unknown(option, known, 'option')}")
    own = {subject: given.pop(subject) for subject in subjects if subject in given}
    return own, record(**given)


def result_of(annotation: str) -> str:
    """What a plan returns when it runs: "Image" of "Plan[Image]"."""
    return str(annotation).removeprefix("Plan[").removesuffix("]")


def listed(record: type[Options]) -> str:
    """The options of a record, one below the other, as the docstring of its verb has them."""
    texts = {name: details.doc for name, (_, details) in described(record).items()}
    column = max((len(name) for name in texts if len(name) <= 13), default=0) + 2
    lines = []
    for name, text in texts.items():
        lines += textwrap.wrap(
            f"{name:{column - 2}}  {' '.join(text.split())}",
            WIDTH,
            subsequent_indent=" " * column,
            break_long_words=False,
            break_on_hyphens=False,
        )
    return "\n".join(lines)


def _keywords(record: type[Options]) -> list[inspect.Parameter]:
    return [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=own.default, annotation=own.type)
        for name, (own, _) in described(record).items()
    ]
