"""What an array's field errs by, in which numbers it is summed, and in which blocks: docs/theory/fda.md derives it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import ToleranceUnreachable
from ..base.tolerances import rounded_up
from ..opencl.device import Device

FLUSH = 16  # elements added plainly before they join the compensated total
FINE = 1e-6  # tolerance below which results are complex128
U32, U64 = 2.0**-24, 2.0**-53
EXTENDED = float(np.finfo(np.longdouble).eps) / 2
# rounding steps of (length, product, sum) that a path difference goes through, in units of the wide number's roundoff
PATH_STEPS = {True: 16 * 2.0**-53, False: 45 * 2.0**-48}
SHIFT_STEPS = {True: 4 * 2.0**-53, False: 12 * 2.0**-48}
MOST_TURNS = 2.0**30  # that whole turns are counted in
ALLOWED = 5e-7


@dataclass(frozen=True)
class FieldPlan:
    """double: tables and sums in float64;  predicted_error relative to sum |w_n|, a worst case;
    reach: most, in turns, that the offsets make of what a block's times or ranges differ from its middle."""

    double: bool
    predicted_error: float
    reach: float


def make_plan(
    device: Device, tolerance: float, highest: float, extent: float, last_time: float, farthest: float
) -> FieldPlan:
    """The cheapest numbers that meet `tolerance`. ToleranceUnreachable names the best tolerance there is.

    highest carrier, Hz; extent of the array about its reference point, m; latest |t|, s; farthest point, m.
    """
    fp64 = device.info.fp64
    turns = highest * extent / SPEED_OF_LIGHT
    # f t and f R/c on the host; R from differences, squares, their sum and its root
    host = 2 * np.pi * EXTENDED * highest * (2 * last_time + 6 * farthest / SPEED_OF_LIGHT)
    # a path's difference: |p|(|p| + 2 |v|)/(R + r) <= 3 |p|, every step relative to that; then sums of turns
    wide = 2 * np.pi * (turns * (3 * PATH_STEPS[fp64] + SHIFT_STEPS[fp64]) + 2 * SHIFT_STEPS[fp64])
    fixed = np.inf if turns > MOST_TURNS else float(host + wide)

    def met(tolerance: float) -> FieldPlan | None:
        allowed = min(tolerance / 10, ALLOWED)  # for what times and ranges differ from their blocks' middles, together
        numbers = [double for double in (False, True) if (fp64 or not double) and (double or tolerance >= FINE)]
        rounding = U32 if tolerance >= FINE else 0.0  # of the result
        for double in numbers:
            error = fixed + _rounding(double) + rounding + allowed
            if error <= tolerance:
                return FieldPlan(double, error, allowed / (4 * np.pi * SHIFT_STEPS[fp64]))
        return None

    found = met(tolerance)
    if found is not None:
        return found
    least = fixed + _rounding(fp64)
    best = rounded_up(least if fp64 else max(FINE, least + U32))
    while best < 1 and not met(best):
        best = rounded_up(1.05 * best)
    raise ToleranceUnreachable(
        tolerance, best if best < 1 else None, "rounding of path differences",
        how=f"on {device.info.name!r}{'' if fp64 else ' without float64'}, for points "
        f"{highest * farthest / SPEED_OF_LIGHT:.1e} wavelengths away and an array of {turns:.1e}",
    )  # fmt: skip


def _rounding(double: bool) -> float:
    """Two tables' sines, cosines and turns, weights and products, sums of FLUSH elements of two products each."""
    unit = U64 if double else U32
    circle = np.sqrt(2) * 4 * U64 if double else np.sqrt(2) * 4e-7 + 2 * np.pi * 2.0**-26
    return float(2 * circle + 4 * unit + 2 * FLUSH * unit)


def blocks(values: np.ndarray, reach: float, most: int) -> list[np.ndarray]:
    """Indices of `values` (n,) in blocks of at most `most`, none farther than `reach` from its block's middle."""
    n = len(values)
    if np.ptp(values) <= 2 * reach:
        return [np.arange(i, min(i + most, n)) for i in range(0, n, most)]
    order = np.argsort(values, kind="stable")
    rising, out, i = values[order], [], 0
    while i < n:
        end = int(np.searchsorted(rising, rising[i] + 2 * reach, side="right"))
        end = min(max(end, i + 1), i + most)
        out.append(order[i:end])
        i = end
    return out


def middle(values: np.ndarray) -> np.longdouble:
    """What lies between the extremes, in extended precision."""
    return np.longdouble((values.min() + values.max()) / 2)


def whole_turns_off(turns: np.ndarray) -> np.ndarray:
    """Turns less their nearest whole number."""
    return np.asarray(turns - np.rint(turns))
