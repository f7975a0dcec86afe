"""Plans of factorised backprojection: decimation of the pulses, level by level, within a tolerance."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import ToleranceUnreachable
from ...numerics import cost_model, error_bounds, interpolation
from ...numerics.cost_model import CPU, DeviceClass
from ...numerics.interpolation import Interpolator
from ...numerics.plan import Plan, ProfileSums, cheapest
from ...numerics.pulse_geometry import PulseGeometry
from ...numerics.subapertures import Decimation, decimated, filter_error, rate
from ...opencl import fft
from ..direct import line_plan
from ..direct.line_plan import LinePlan
from ..direct.tile_kernels import CHUNK
from ..focusing_task import FocusingTask
from ..kept_results import per_task
from ..tiling.of_grid import tiling_of
from ..tiling.plane import LineTiling
from ..tiling.tiling import Tiling
from ._tile_chains import chains, runs_of

SPACINGS = (1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)  # profile samples per 1/bandwidth
TAPS = (4, 6, 8)  # taps of the interpolators along range and along the track
TRIES = 8  # candidates whose errors are computed in full
MERGING_SHARE = 0.75  # share of the tolerance for merging; the rest is for the step from leaves to pixels
SHARE_SLACK = 1.3  # ratio of a filter's error to its share, at most: other errors are often below theirs
SMALLER_RATIO = 0.75  # factor on a decimation ratio whose error is too large
MOST_MERGED = 4096  # pulses between two kept pulses at most: more would not reduce the cost
GUARD, LEAF_GUARD = 14, 8  # samples beyond a tile that interpolation and whole vectors may read


@dataclass(frozen=True, eq=False)
class Level:
    """One level of the tree: tiles of side x side pixels and `radius` m, and the decimation of the pulses there.

    reach  samples of a profile on each side of the tile's centre
    """

    side: int
    radius: float
    reach: int
    decimation: Decimation

    def n_bytes(self, stride: int) -> int:
        """Bytes of a tile's profiles of `stride` samples."""
        return 8 * stride * len(self.decimation.kept)


@dataclass(frozen=True, eq=False)
class FactorPlan:
    """Plan of an image by the factorised method: the levels from roots to leaves, and the step from leaves to pixels.

    factors  leaves along a side of a tile, for each level
    first    interpolator of the range profiles of the rows, `length` samples long; between: that between two levels
    leaf     plan from the profiles of a leaf to its pixels
    edge     direct plan for roots that lie only in part in the range window and beam of a row
    cost     per contribution, relative to one with linear interpolation and ranges in float32
    order    (n_rows,): order of the rows in which those of a smooth run are consecutive
    """

    levels: tuple[Level, ...]
    factors: tuple[int, ...]
    first: Interpolator
    between: Interpolator
    length: int
    leaf: LinePlan | Plan
    edge: LinePlan | Plan
    predicted_error: float
    cost: float
    order: np.ndarray

    def describe(self, method: str) -> dict[str, object]:
        """The plan in words and numbers, for a report."""
        return {
            "method": method,
            "tiles": " > ".join(str(level.side) for level in self.levels),
            "pulses per tile": " > ".join(
                str(n) for n in [len(self.order), *(len(v.decimation.kept) for v in self.levels)]
            ),
            "taps": self.between.taps,
            "profile samples": self.length,
            "leaves": self.leaf.describe(method)["ranges"],
        }


def make_plan(task: FocusingTask, tolerance: float, on: DeviceClass = CPU) -> tuple[FactorPlan, Tiling]:
    """The cheapest plan whose predicted error is at most `tolerance`.

    on  the devices that follow the plan
    ToleranceUnreachable where sub-apertures cannot meet it, with the reason, but without a best tolerance, which takes
    a search.
    """
    reason = ""
    # near an antenna, lines are curved too much
    for lines in (True, False) if line_plan.possible(task.grid, on) else (False,):
        case = _Case(task, tolerance, lines)
        tried = sorted(case.candidates(), key=lambda candidate: candidate.cost)[:TRIES]
        for candidate in tried:
            plan = case.build(candidate)
            if not isinstance(plan, str):
                return plan
            reason = plan
        if not tried and not reason:
            reason = case.obstacle()
    raise ToleranceUnreachable(tolerance, None, reason, how=f"with sub-apertures here: {reason}")


def _spacing(taps: int, error: float) -> float | None:
    """The widest spacing at which the error of so many taps is at most `error`; None: none."""
    return next((s for s in SPACINGS if interpolation.line_interpolator(taps, s).error <= error), None)


class _Candidate(NamedTuple):
    """A tree of tiles to be planned.

    chain          sides of the tiles, from roots to leaves, pixels
    taps, spacing  of the interpolators along range, and samples per 1/bandwidth
    filter_taps, fine  of the filters over the pulses, and kept pulses per Nyquist interval
    share          of the tolerance, for each of the errors
    cost, ratios   estimated, in contributions; decimation ratio of each level
    """

    chain: tuple[int, ...]
    taps: int
    spacing: float
    filter_taps: int
    fine: float
    share: float
    cost: float
    ratios: list[int]


@per_task
def _smooth_track(task: FocusingTask) -> tuple[PulseGeometry, np.ndarray, float]:
    """The rows' geometry with smooth runs, the order of rows in which these are consecutive, and the largest change of
    the gradient of range from one row to the next."""
    order, runs = runs_of(task.raw)
    track, tiling = replace(task.antennas.picked(order), runs=tuple(runs)), tiling_of(task.grid, 16)
    return track, order, rate(track, tiling.outline(), tiling.axes)


@per_task
def _filter_errors(task: FocusingTask) -> dict[tuple[float, ...], float]:
    """Errors of decimations, by what determines them: candidates share most, at other tolerances too."""
    return {}


class _Case:
    """A task at a tolerance, with what all candidates of its plan share."""

    def __init__(self, task: FocusingTask, tolerance: float, lines: bool) -> None:
        grid = task.grid
        self.task, self.tolerance, self.lines = task, tolerance, lines
        self.track, self.order, change = _smooth_track(task)
        self.highest, self.bandwidth = task.highest, task.bandwidth
        self.distance = task.antennas.distance(grid.bounds)
        tiling = tiling_of(grid, 16)
        self.axes, self.points, self.largest = tiling.axes, tiling.outline(), tiling.longest_side
        self.leaves = {side: tiling.leaf_radius(side) for side in (cost_model.LEAF if lines else tiling.leaf_sides)}
        self.turning = change * 2 * self.highest / SPEED_OF_LIGHT  # cycles per row and metre

    def candidates(self) -> Iterator[_Candidate]:
        """All candidates, with their estimated costs."""
        for leaf in self.leaves:
            for chain in chains(leaf, self.largest):
                share = MERGING_SHARE * self.tolerance / (2 * len(chain) + 1)
                spacings = [(taps, spacing) for taps in TAPS if (spacing := _spacing(taps, share)) is not None]
                for (taps, spacing), (filter_taps, fine) in itertools.product(spacings, spacings):
                    estimate = self._cost(chain, taps, spacing, filter_taps, fine)
                    if estimate:
                        yield _Candidate(chain, taps, spacing, filter_taps, fine, share, *estimate)

    def obstacle(self) -> str:
        """The reason why there is no candidate at all."""
        share = MERGING_SHARE * self.tolerance / 3  # of a tree of one level, which has the fewest errors
        fine = [s for s in (_spacing(filter_taps, share) for filter_taps in TAPS) if s is not None]
        if not fine:
            return f"the error of a filter of {TAPS[-1]} taps over the pulses is above its share of the tolerance"
        n_rows, leaf = self.task.raw.n_rows, min(self.leaves.values())
        if n_rows < 4:
            return f"the aperture has {n_rows} pulses; at least 4 are needed to merge any"
        return (
            f"neighbouring pulses see the smallest tiles, of {leaf:.3g} m radius, from directions that differ too "
            "much to be merged"
        )

    def _cost(
        self, chain: tuple[int, ...], taps: int, spacing: float, filter_taps: int, fine: float
    ) -> tuple[float, list[int]] | None:
        """Cost in contributions, and the decimation ratio of each level; None where a level cannot decimate."""
        n_rows, size = self.task.raw.n_rows, self.task.grid.size
        sigma = 2 * self.bandwidth / SPEED_OF_LIGHT * spacing
        sources, total, spaced, ratios = float(n_rows), 0.0, 1.0, []
        for side in chain:
            radius = self.leaves[chain[-1]] * side / chain[-1]
            resolved = 1 / max(2 * fine * self.turning * radius * spaced, 1e-30)  # of one point, any number
            ratio = int(min(resolved, max(1, sources // 2), MOST_MERGED))
            if ratio < 2:
                return None
            ratios.append(ratio)
            total += size / side**2 * sources * moving_cost(2 * radius * sigma + 2 * GUARD, taps, filter_taps)
            sources, spaced = sources / ratio + filter_taps, spaced * ratio
        leaf = cost_model.LEAF[chain[-1]] if self.lines else cost_model.TAPS[taps] + cost_model.LEAF_PIXELS
        total += size * sources * leaf
        return total + n_rows * cost_model.MERGED_PROFILE * spacing * self.task.raw.n_samples, ratios

    def build(self, candidate: _Candidate) -> tuple[FactorPlan, Tiling] | str:
        """The plan of a candidate, its errors computed for the track as it is; or the reason why they are too large."""
        raw, grid, chain, share = self.task.raw, self.task.grid, candidate.chain, candidate.share
        taps, spacing = candidate.taps, candidate.spacing
        filter_taps, fine = candidate.filter_taps, candidate.fine
        between = interpolation.line_interpolator(taps, spacing)
        length = 2 * fft.good_length(int(np.ceil(spacing * raw.n_samples / 2)))
        sigma = 2 * float(raw.frequency_step.max()) * length / SPEED_OF_LIGHT
        fits = (interpolation.interpolator(t, length / raw.n_samples) for t in interpolation.TERMS)
        first = next((i for i in fits if i.error <= share), None)
        if first is None:
            return f"interpolation of range profiles with {max(interpolation.TERMS)} taps has an error above its share"
        tiling = LineTiling(grid, chain[-1]) if self.lines else tiling_of(grid, chain[-1])
        if not self.task.resolves_beam(tiling.radius):
            return f"beam is narrower than float32 resolves in tiles of {tiling.radius:.3g} m so near a track"
        factors = tuple(side // chain[-1] for side in chain)
        radii = tiling.level_radii(factors)
        decimations: list[Decimation] = []
        filter_errors = _filter_errors(self.task)
        error, source = first.error + error_bounds.sum_rounding(64, raw.n_samples) * len(chain), self.track
        for radius, ratio in zip(radii, candidate.ratios, strict=True):
            above = tuple(d.ratio for d in decimations)
            while True:
                key, decimation = (filter_taps, fine, *above, ratio, radius), None
                if key not in filter_errors:
                    decimation = decimated(source, ratio, filter_taps, fine)
                    filter_errors[key] = filter_error(source, decimation, self.points, radius, self.highest, self.axes)
                if filter_errors[key] <= SHARE_SLACK * share or ratio <= 2:
                    break
                ratio = max(2, int(ratio * SMALLER_RATIO))
            error += filter_errors[key] + (between.error if decimations else 0.0)
            decimations.append(decimation or decimated(source, ratio, filter_taps, fine))
            source = decimations[-1].kept
        leaf = self._leaf(self.tolerance - error, source, (between, length), tiling)
        if leaf is None:
            return "decimation of the pulses leaves too small a share of the tolerance for the pixels"
        edge = self._edge(tiling)
        if edge is None:
            return f"tiles at the edge of the range window cannot be focused{' by lines' if self.lines else ''}"
        reach = _reaches(tiling, radii, sigma)
        if self.task.wrap and reach[-1] + 4 * GUARD > length:
            return "the largest tiles are wider than the period in which ranges repeat"
        levels = tuple(Level(*v) for v in zip(chain, radii, reach[::-1], decimations, strict=True))
        sources = [raw.n_rows, *(len(v.decimation.kept) for v in levels)]
        cost = grid.size * sources[-1] * leaf.cost + raw.n_rows * cost_model.MERGED_PROFILE * spacing * raw.n_samples
        for v, n in zip(levels, sources, strict=False):
            cost += grid.size / v.side**2 * n * moving_cost(2 * v.reach, taps, filter_taps)
        plan = FactorPlan(
            levels=levels,
            factors=factors,
            first=first,
            between=between,
            length=length,
            leaf=leaf,
            edge=edge,
            # a row is merged into a tile or added directly
            predicted_error=max(error + leaf.predicted_error, edge.predicted_error),
            cost=cost / (raw.n_rows * grid.size),
            order=self.order,
        )
        return plan, tiling

    def _leaf(
        self, tolerance: float, kept: PulseGeometry, source: tuple[Interpolator, int], tiling: Tiling
    ) -> LinePlan | Plan | None:
        """Plan from leaves to pixels within a tolerance; None: there is none."""
        raw = self.task.raw
        if tolerance <= 0:
            return None
        if self.lines:
            return line_plan.choose(self.task, kept, tolerance, source=source, sides=(tiling.side,))
        best = None
        for mode in (0, 1):
            for order, of_series in cost_model.SERIES.items():
                error = error_bounds.range_error(
                    tiling.radius, self.distance, self.highest, self.bandwidth, mode, order
                )
                error += error_bounds.sum_rounding(CHUNK, raw.n_samples) + source[0].error
                cost = cost_model.TAPS[source[0].taps] + cost_model.RANGE_MODE[mode] + of_series - 2
                if error <= tolerance and (best is None or cost < best.cost):
                    best = Plan(*source, tiling.per_tile, mode, order, error, cost)
        return best

    def _edge(self, tiling: Tiling) -> LinePlan | Plan | None:
        """Direct plan, on the same leaves, for tiles only partly in a range window or beam; None: there is none."""
        raw = self.task.raw
        if self.lines:
            return line_plan.choose(self.task, self.task.antennas, self.tolerance, sides=(tiling.side,))
        try:
            sums = ProfileSums(self.distance, self.highest, self.bandwidth, raw.n_samples, self.task.grid.size, CHUNK)
            return cheapest(self.tolerance, [(tiling.per_tile, tiling.radius)], sums, least_tolerance=0.0)
        except ToleranceUnreachable:
            return None


def _reaches(tiling: Tiling, radii: list[float], sigma: float) -> list[int]:
    """Samples of profiles on each side of a tile's centre, from the leaves up: the profiles of a tile cover those of
    its children and what their interpolation reads; sigma: samples per metre."""
    reach = [int(np.ceil(radii[-1] * sigma)) + LEAF_GUARD]
    for below, radius in zip(radii[:0:-1], radii[-2::-1], strict=True):
        apart = tiling.child_distance(radius, below)
        reach.append(int(np.ceil(apart * sigma)) + reach[-1] + GUARD)
    return reach


def moving_cost(samples: float, taps: int, filter_taps: int) -> float:
    """Cost of moving the profile of a pulse to a new tile and adding it to the pulses that are kept there."""
    return samples * (taps * cost_model.MOVE_TAP + filter_taps * cost_model.MOVE_FILTER_TAP) + cost_model.MOVE_PULSE
