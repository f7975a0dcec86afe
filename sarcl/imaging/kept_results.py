"""Results that are kept: all of one task, or the last ones under some keys."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from .focusing_task import FocusingTask

Others = ParamSpec("Others")
Key = TypeVar("Key")
Result = TypeVar("Result")
MOST = 8  # results under several keys: plans for the same geometry, choices and windows for the same samples


def per_task(
    compute: Callable[Concatenate[FocusingTask, Others], Result],
) -> Callable[Concatenate[FocusingTask, Others], Result]:
    """Decorator of a function of a task and other arguments, all hashable and by position: its results are kept with
    the task, because several plans are made for it."""
    results: WeakKeyDictionary[FocusingTask, dict[object, Result]] = WeakKeyDictionary()

    @functools.wraps(compute)
    def kept(task: FocusingTask, *others: Others.args, **named: Others.kwargs) -> Result:
        known = results.setdefault(task, {})
        if others not in known:
            known[others] = compute(task, *others, **named)
        return known[others]

    return kept


def kept(known: dict[Key, Result], key: Key, make: Callable[[], Result]) -> Result:
    """The result of a key, made where it is not known; the last MOST are kept."""
    result = known.pop(key, None)
    known[key] = result = make() if result is None else result  # the last one
    for oldest in list(known)[:-MOST]:  # a copy: other threads may ask at the same time
        known.pop(oldest, None)
    return result
