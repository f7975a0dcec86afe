"""Tolerances that an error message suggests: rounded up, and tried until a planner can meet one."""

from __future__ import annotations

import decimal
from collections.abc import Callable

from .errors import ToleranceUnreachable
from .validation import LARGEST_TOLERANCE

_UP = decimal.Context(prec=2, rounding=decimal.ROUND_CEILING)


def rounded_up(value: float) -> float:
    """A positive number rounded up to two digits, so that the printed number, passed as it is, is large enough."""
    return float(_UP.create_decimal(decimal.Decimal(float(value))))


def askable(best: float) -> float | None:
    """`best` where a user may ask for it, as a tolerance of at most LARGEST_TOLERANCE; else None."""
    return best if best <= LARGEST_TOLERANCE else None


def reachable(plan: Callable[[float], object], above: float, step: float = 1.25) -> float | None:
    """The smallest tolerance found for which `plan` raises no ToleranceUnreachable; None where none is found
    that may be asked for.

    The search starts at `above`. The next tolerance is the best one that the planner names, else `step` times the last,
    and at last the largest that is allowed.
    """
    best = rounded_up(above)
    while best <= LARGEST_TOLERANCE:
        try:
            plan(best)
        except ToleranceUnreachable as refused:
            named = 0.0 if refused.best is None else refused.best * best / refused.asked
            if best == LARGEST_TOLERANCE:
                return None
            best = rounded_up(named) if named > best else min(rounded_up(step * best), LARGEST_TOLERANCE)
        else:
            return best
    return None
