"""Plans: the cheapest way to meet a tolerance, and its predicted error. Shared by echo and backproject."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import ToleranceUnreachable
from ..base.text import shown
from ..base.tolerances import rounded_up
from . import cost_model, error_bounds, interpolator_choice
from .interpolation import Interpolator

LEAST_TOLERANCE = 1e-6  # smallest tolerance of complex64 results

FIXED = 0.8  # largest share of a tolerance for the errors of ranges and sums; the rest is for interpolation
LEAST_TAPS = 1.0  # cost of the cheapest interpolator
PROFILES = "float32 range profiles"


@dataclass(frozen=True)
class Near:
    """Tiles of at most a radius, m, whose ranges are computed in float32, by a series of some order; 0: no tiles.

    share  of the tiles that are so small
    """

    radius: float = 0.0
    order: int = 0
    share: float = 0.0


NO_TILES = Near()


@dataclass(frozen=True, eq=False)
class Plan:
    """How a result is computed: interpolator and profile length, points per tile, range mode and series order.

    cost    per contribution, relative to one with the hat and ranges in float32
    native  sine and cosine are the device's own, in kernels/backproject.cl
    steps   of the high parts of directions, cycles/m, and of offsets, m: where the linear term is in two parts
    near    tiles that are so small that float32 carries their ranges
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
    near: Near = NO_TILES

    def describe(self, method: str) -> dict[str, Any]:
        """The plan in words and numbers, for a report."""
        ranges = ("float32", "wide linear term", "wide", "linear term in two parts")[self.range_mode]
        series = series_words(self.order)
        if self.near.order:
            tiles = f"of {100 * self.near.share:.0f} % of the tiles"
            ranges, series = f"float32 {tiles}, else {ranges}", f"order {self.near.order} {tiles}, else {series}"
        return plan_words(method, self.interpolator, self.length, self.per_tile, ranges, series)

    def macros(self, bistatic: bool, wrap: bool = False) -> dict[str, int]:
        """Build-time macros of the kernels' headers."""
        of_profile = profile_macros(self.interpolator, self.length, wrap, self.order)
        return {"BISTATIC": int(bistatic), **of_profile, "RANGE": self.range_mode, "NEAR": self.near.order}

    def components(self, bistatic: bool, beam: bool = False) -> int:
        """Floats of a (tile, pulse) record: N_CONST of kernels/geometry.clh."""
        return (32 if bistatic else 24 if self.range_mode in (1, 3) else 16) + 8 * beam


def series_words(order: int) -> str:
    """The order of a range series in words; 0 or less: exact."""
    return f"order {order}" if order > 0 else "exact"


def plan_words(
    method: str, interpolator: Interpolator, length: int, per_tile: int, ranges: str, series: str
) -> dict[str, object]:
    """A plan by range profiles of `length` samples in words and numbers, for a report."""
    words = {"method": method, "taps": interpolator.taps, "profile samples": length, "points per tile": per_tile}
    return {**words, "ranges": ranges, "series": series}


def profile_macros(interpolator: Interpolator, length: int, wrap: bool, order: int) -> dict[str, int]:
    """Build-time macros of kernels that read range profiles of `length` samples, of which wrap=True repeats ranges."""
    return {"WRAP": length if wrap else 0, "TAPS": interpolator.taps, "TERMS": interpolator.terms, "ORDER": order}


class ProfileSums(NamedTuple):
    """Sums over points and range profiles that a plan is made for.

    distance        smallest from an antenna to the scene, m;  frequency  the highest, Hz;  bandwidth  Hz
    n_samples       of a row;  points_per_row  that read its profile;  chunk  rows or points summed in float32
    carrier         Hz, from which images of the kernel keep away (interpolator_choice.off_carrier); 0: from none
    """

    distance: float
    frequency: float
    bandwidth: float
    n_samples: int
    points_per_row: int
    chunk: int
    carrier: float = 0.0


def cheapest(
    tolerance: float,
    tiles: Iterable[tuple[int, float]],
    sums: ProfileSums,
    *,
    least_tolerance: float = LEAST_TOLERANCE,
    image_gain: float = 1.0,
    gathering: cost_model.Gathering = cost_model.ON_CPU,
    native_error: float | None = None,
    near: Mapping[int, Sequence[tuple[float, float]]] = MappingProxyType({}),
) -> Plan:
    """The cheapest plan whose predicted error is at most `tolerance`.

    tiles        choices of (points per tile, radius of the largest tile in m)
    least_tolerance  a tolerance below it is refused
    image_gain   factor on the interpolator's error, for scatterers on which the images of its kernel add up
    gathering    costs on the devices that follow the plan
    native_error  of their own sine and cosine, rad, which the plan takes; None: it takes polynomials
    near         by points per tile: radii, m, and the share of the tiles that are no larger
    ToleranceUnreachable names the smallest tolerance that can be met.
    """
    best: tuple[float, Plan] | None = None
    distance, frequency, bandwidth, n_samples, points_per_row, chunk, carrier = sums
    steps = carrier_steps(carrier, n_samples, bandwidth)
    wavenumber = 2 * frequency / SPEED_OF_LIGHT

    def error(radius: float, mode: int, order: int) -> float:
        return error_bounds.range_error(radius, distance, frequency, bandwidth, mode, order)

    for per_tile, radius in tiles:
        for ranges in _ranges(radius, near.get(per_tile, ()), gathering, error):
            fixed = ranges.error + error_bounds.sum_rounding(chunk, n_samples) + (native_error or 0.0)
            beside = ranges.cost + cost_model.TILE / per_tile
            if not fixed <= FIXED * tolerance or (best and best[0] <= beside + LEAST_TAPS):
                continue
            try:
                interpolator, length, cost = interpolator_choice.choose_interpolator(
                    (tolerance - fixed) / image_gain, n_samples, points_per_row, steps, gathering
                )
            except ToleranceUnreachable:  # another range mode may leave more of the tolerance to the interpolator
                continue
            sigma = 2 * bandwidth / n_samples * length / SPEED_OF_LIGHT
            if ranges.in_float32 * max(sigma, wavenumber) > 2**20:
                continue  # positions or cycles in a tile would not fit float32
            if best is None or cost + beside < best[0]:
                parts = error_bounds.two_part_steps(radius, frequency) if ranges.mode == 3 else (0.0, 0.0)
                best = cost + beside, Plan(
                    interpolator, length, per_tile, ranges.mode, ranges.order, fixed + image_gain * interpolator.error,
                    cost + beside, native_error is not None, parts, ranges.near,
                )  # fmt: skip
    if best is None or tolerance < least_tolerance:
        reach = rounded_up(max(least_tolerance, least(n_samples, chunk, steps)))
        raise ToleranceUnreachable(tolerance, reach, PROFILES, how="in complex64")
    return best[1]


class _Ranges(NamedTuple):
    """A way to compute the ranges of all tiles: its error, rad, its cost beside that of the first mode, and the largest
    radius of a tile whose positions are in float32, m."""

    mode: int
    order: int
    near: Near
    error: float
    cost: float
    in_float32: float


def _ranges(
    radius: float,
    near: Sequence[tuple[float, float]],
    gathering: cost_model.Gathering,
    error: Callable[[float, int, int], float],
) -> Iterator[_Ranges]:
    """Ways to compute ranges in tiles of up to `radius` m; near, gathering  as `cheapest` takes them."""
    series = dict(gathering.series)
    for mode, mode_cost in enumerate(gathering.range_mode):
        for order in series if mode != 2 else (0,):
            cost = mode_cost - 1 + (series[order] - 1 if mode != 2 else 0.0)
            far = error(radius, mode, order)
            yield _Ranges(mode, order, NO_TILES, far, cost, radius if mode in (0, 3) else 0.0)
            for limit, share in near if mode in (1, 2) else ():
                for low in filter(None, series):
                    both = share * (series[low] - 1) + (1 - share) * cost
                    small = Near(limit, low, share)
                    yield _Ranges(mode, order, small, max(far, error(limit, 0, low)), both, limit)


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
        raise ValueError(f"skip is {shown(skip)}; give True, False or a set of {', '.join(map(repr, known))}")
    return set(names)
