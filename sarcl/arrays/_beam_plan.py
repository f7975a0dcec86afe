"""Error, number type and blocks of the field of an array; derived in docs/theory/fda.md."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import ToleranceUnreachable
from ..base.tolerances import askable, rounded_up
from ..base.validation import LARGEST_TOLERANCE
from ..opencl.device import Device

FLUSH = 16  # elements summed plainly before they are added to the compensated total
FINE = 1e-6  # tolerance below which results are complex128
U32, U64 = 2.0**-24, 2.0**-53  # unit roundoffs of float32 and float64
EXTENDED = float(np.finfo(np.longdouble).eps) / 2  # unit roundoff of extended precision
# relative rounding error of a path difference (length, product, sum) with float64 (True), or with pairs of float32
PATH_STEPS = {True: 16 * 2.0**-53, False: 45 * 2.0**-48}
# the same for cycles of a shift in time or range
SHIFT_STEPS = {True: 4 * 2.0**-53, False: 12 * 2.0**-48}
MOST_CYCLES = 2.0**30  # largest number of cycles over the array whose whole part is counted
ALLOWED = 5e-7  # largest error allowed for the differences of times and ranges from their block centres


@dataclass(frozen=True)
class FieldPlan:
    """Number type and blocks of a field.

    double           tables and sums are float64
    predicted_error  bound of the error, relative to sum |w_n|
    reach            cycles, largest phase of a frequency offset between a block's times or ranges and their centre
    """

    double: bool
    predicted_error: float
    reach: float


def make_plan(
    device: Device, tolerance: float, highest: float, extent: float, last_time: float, farthest: float
) -> FieldPlan:
    """The cheapest number type that meets `tolerance`; ToleranceUnreachable names the best tolerance.

    highest  carrier, Hz;  extent  of the array about its reference point, m;  last_time  largest |t|, s
    farthest  distance of a point, m
    """
    fp64 = device.info.fp64
    cycles = highest * extent / SPEED_OF_LIGHT
    # f t and f R/c on the host; R from differences, squares, their sum and its root
    host = 2 * np.pi * EXTENDED * highest * (2 * last_time + 6 * farthest / SPEED_OF_LIGHT)
    # a path difference is |p|(|p| + 2 |v|)/(R + r) <= 3 |p|, and rounding is relative to that; then sums of cycles
    wide = 2 * np.pi * (cycles * (3 * PATH_STEPS[fp64] + SHIFT_STEPS[fp64]) + 2 * SHIFT_STEPS[fp64])
    fixed = np.inf if cycles > MOST_CYCLES else float(host + wide)

    def met(tolerance: float) -> FieldPlan | None:
        allowed = min(tolerance / 10, ALLOWED)  # for differences from the blocks' centres, times and ranges together
        numbers = [double for double in (False, True) if (fp64 or not double) and (double or tolerance >= FINE)]
        rounding = U32 if tolerance >= FINE else 0.0  # of the result to complex64
        for double in numbers:
            error = fixed + _rounding(double) + rounding + allowed
            if error <= tolerance:
                return FieldPlan(double, error, allowed / (4 * np.pi * SHIFT_STEPS[fp64]))
        return None

    plan = met(tolerance)
    if plan is not None:
        return plan
    least = fixed + _rounding(fp64)
    best = rounded_up(least if fp64 else max(FINE, least + U32))
    while best <= LARGEST_TOLERANCE and not met(best):
        best = rounded_up(1.05 * best)
    raise ToleranceUnreachable(
        tolerance,
        askable(best),
        "rounding of path differences",
        how=f"on {device.info.name!r}{'' if fp64 else ' without float64'}, for points "
        f"{highest * farthest / SPEED_OF_LIGHT:.1e} wavelengths away and an array of {cycles:.1e}",
    )


def _rounding(double: bool) -> float:
    """Rounding of both tables' cycles, sines and cosines, of weights and products, and of sums of FLUSH elements."""
    unit = U64 if double else U32
    circle = np.sqrt(2) * 4 * U64 if double else np.sqrt(2) * 4e-7 + 2 * np.pi * 2.0**-26
    return float(2 * circle + 4 * unit + 2 * FLUSH * unit)


def blocks(values: np.ndarray, reach: float, most: int) -> list[np.ndarray]:
    """Indices of `values` (n,) in blocks of at most `most`, none farther than `reach` from its block's centre."""
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
    """Mean of the extremes, in extended precision."""
    return np.longdouble((values.min() + values.max()) / 2)


def fraction(cycles: np.ndarray) -> np.ndarray:
    """Cycles minus their nearest whole number, -1/2 to 1/2."""
    return np.asarray(cycles - np.rint(cycles))
