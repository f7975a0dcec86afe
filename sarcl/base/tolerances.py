"""Tolerances that a refusal names: rounded so that the printed number suffices, and tried until one is met."""

from __future__ import annotations

import decimal
from collections.abc import Callable

from .errors import ToleranceUnreachable

_UP = decimal.Context(prec=2, rounding=decimal.ROUND_CEILING)


def rounded_up(value: float) -> float:
    """A positive number rounded up to two digits, so that what is printed is enough."""
    return float(_UP.create_decimal(decimal.Decimal(float(value))))


def reachable(plan: Callable[[float], object], above: float) -> float | None:
    """The smallest tolerance found for which `plan` raises no ToleranceUnreachable; None where none below 1 is found.

    Tried are, from `above` on, the best tolerances that `plan` itself names, else tolerances a quarter larger each.
    """
    best = rounded_up(above)
    while best < 1:
        try:
            plan(best)
        except ToleranceUnreachable as refused:
            named = 0.0 if refused.best is None else refused.best * best / refused.asked
            best = rounded_up(named if named > best else 1.25 * best)
        else:
            return best
    return None
