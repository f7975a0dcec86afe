"""Plans: the cheapest way to meet a tolerance, and its predicted error. Shared by echo and backproject."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import ToleranceUnreachable
from ..base.tolerances import rounded_up
from . import cost_model, error_bounds, interpolator_choice
from .interpolation import Interpolator

LEAST_TOLERANCE = 1e-6  # smallest tolerance of complex64 results

FIXED = 0.8  # largest share of a tolerance for the errors of ranges and sums; the rest is for interpolation
PROFILES = "float32 range profiles"


@dataclass(frozen=True, eq=False)
class Plan:
    """How a result is computed: interpolator and profile length, points per tile, range mode and series order.

    cost    per contribution, relative to one with the hat and ranges in float32
    native  sine and cosine are the device's own, in kernels/backproject.cl
    steps   of the high parts of directions, cycles/m, and of offsets, m: where the linear term is in two parts
    """

    interpolator: Interpolator
    length: int
    per_tile: int
    range_mode: int
    order: int
    predicted_error: float
    cost: float = 1.0
    native: bool = False
    steps: tuple[float, float] = (0.0, 0.0)

    def describe(self, method: str) -> dict[str, Any]:
        """The plan in words and numbers, for a report."""
        return {
            "method": method,
            "taps": self.interpolator.taps,
            "profile samples": self.length,
            "points per tile": self.per_tile,
            "ranges": ("float32", "wide linear term", "wide", "linear term in two parts")[self.range_mode],
            "series": f"order {self.order}" if self.order else "exact",
        }

    def macros(self, bistatic: bool, wrap: bool = False) -> dict[str, int]:
        """Build-time macros of the kernels' headers."""
        return {
            "BISTATIC": int(bistatic),
            "WRAP": self.length if wrap else 0,
            "TAPS": self.interpolator.taps,
            "TERMS": self.interpolator.terms,
            "RANGE": self.range_mode,
            "ORDER": self.order,
        }

    def components(self, bistatic: bool, beam: bool = False) -> int:
        """Floats of a (tile, pulse) record: N_CONST of kernels/geometry.clh."""
        return (32 if bistatic else 24 if self.range_mode in (1, 3) else 16) + 8 * beam


def cheapest(
    tolerance: float,
    tiles: Iterable[tuple[int, float]],
    *,
    distance: float,
    frequency: float,
    bandwidth: float,
    n_samples: int,
    points_per_row: int,
    chunk: int,
    least_tolerance: float = LEAST_TOLERANCE,
    carrier: float = 0.0,
    image_gain: float = 1.0,
    gathering: cost_model.Gathering = cost_model.ON_CPU,
    native_error: float | None = None,
) -> Plan:
    """The cheapest plan whose predicted error is at most `tolerance`.

    tiles        choices of (points per tile, radius of the largest tile in m)
    distance     smallest from an antenna to the scene, m; frequency the highest, Hz
    chunk        rows or points summed in float32; least_tolerance: a tolerance below it is refused
    carrier      Hz, from which images of the kernel keep away (interpolator_choice.off_carrier); 0: no such condition
    image_gain   factor on the interpolator's error, for scatterers on which the images of its kernel add up
    gathering    costs on the devices that follow the plan
    native_error  of their own sine and cosine, rad, which the plan takes; None: it takes polynomials
    ToleranceUnreachable names the smallest tolerance that can be met.
    """
    best: tuple[float, Plan] | None = None
    steps = carrier_steps(carrier, n_samples, bandwidth)
    for per_tile, radius in tiles:
        for mode, range_cost in enumerate(gathering.range_mode):
            for order in (2, 3, 0) if mode != 2 else (0,):
                fixed = error_bounds.range_error(radius, distance, frequency, bandwidth, mode, order)
                fixed += error_bounds.sum_rounding(chunk, n_samples) + (native_error or 0.0)
                if not fixed <= FIXED * tolerance:
                    continue
                try:
                    interpolator, length, cost = interpolator_choice.choose_interpolator(
                        (tolerance - fixed) / image_gain, n_samples, points_per_row, steps, gathering
                    )
                except ToleranceUnreachable:  # another range mode may leave more of the tolerance to the interpolator
                    continue
                sigma = 2 * bandwidth / n_samples * length / SPEED_OF_LIGHT
                if mode in (0, 3) and radius * max(sigma, 2 * frequency / SPEED_OF_LIGHT) > 2**20:
                    continue  # positions or cycles in a tile would not fit float32
                cost += range_cost - 1 + cost_model.TILE / per_tile
                cost += cost_model.SERIES[order] - 1 if mode != 2 else 0.0
                if best is None or cost < best[0]:
                    error = fixed + image_gain * interpolator.error
                    native = native_error is not None
                    parts = error_bounds.two_part_steps(radius, frequency) if mode == 3 else (0.0, 0.0)
                    best = cost, Plan(interpolator, length, per_tile, mode, order, error, cost, native, parts)
    if best is None or tolerance < least_tolerance:
        reach = rounded_up(max(least_tolerance, least(n_samples, chunk, steps)))
        raise ToleranceUnreachable(tolerance, reach, PROFILES, how="in complex64")
    return best[1]


def carrier_steps(carrier: float, n_samples: int, bandwidth: float) -> float:
    """A carrier, Hz, in steps between the n_samples of a band, Hz: as interpolator_choice.off_carrier takes it."""
    return carrier * n_samples / bandwidth if bandwidth else 0.0


def least(n_samples: int, chunk: int, steps: float = 0.0) -> float:
    """The smallest tolerance that `cheapest` meets, at any position of antennas and scatterers.

    Ranges in wide numbers have the smallest error, and the same one in a tile of any size.
    """
    fixed = error_bounds.range_error(0.0, np.inf, 0.0, 0.0, 2, 0) + error_bounds.sum_rounding(chunk, n_samples)
    return float(max(fixed / FIXED, fixed + interpolator_choice.least_error(n_samples, steps)) * (1 + 1e-9))


def skips(skip: object, known: tuple[str, ...]) -> set[str]:
    """The reasons to skip, of True (all), False (none) or a set of names; ValueError lists the known ones."""
    if isinstance(skip, (bool, np.bool_)):
        return set(known) if skip else set()
    names: list[Any] = list(skip) if isinstance(skip, (list, tuple, set, frozenset)) else [None]
    if not all(isinstance(name, str) and name in known for name in names):
        shown = " ".join(repr(skip).split())
        raise ValueError(f"skip is {shown:.60}; give True, False or a set of {', '.join(map(repr, known))}")
    return set(names)
