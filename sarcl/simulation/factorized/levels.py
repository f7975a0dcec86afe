"""Plans of factorised echoes: levels of cells, and the decimation of the pulses at each, within a tolerance."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.rows import groups, spread_over
from ...numerics import cost_model, error_bounds, interpolation
from ...numerics.interpolation import Interpolator
from ...numerics.interpolator_choice import off_carrier, profile_length
from ...numerics.plan import Plan, carrier_steps
from ...numerics.pulse_geometry import PulseGeometry
from ...numerics.subapertures import Decimation, decimated, filter_error, rates, smooth_runs
from ...opencl import fft
from ...scattering.kept_amplitudes import AmplitudeSamples
from ..spreading import Band
from .cells import DEEPEST, CellLevel, ScattererCells

FEWEST_PULSES = 8  # fewer are not decimated
SPACINGS = (1.5, 2.0, 2.5, 3.0, 4.0)  # profile samples per 1/bandwidth
TAPS = (4, 6, 8)  # taps of the interpolators along range and along the track
STEPS = (1, 2, 3, 4)  # depths between two levels
TRIES = 4  # candidates whose errors are computed in full
MOVING_SHARE = 0.7  # share of the tolerance for moving profiles between levels; the rest is for the smallest cells
SPREADING_SHARE = 0.6  # share of that rest for the kernel that spreads points
AMPLITUDE_SHARE = 0.2  # share of the tolerance for amplitudes that change along the track; all else has the rest
SHARE_SLACK = 1.3  # ratio of a filter's error to its share, at most: other errors are often below theirs
SMALLER_RATIO = 0.75  # factor on a decimation ratio whose error is too large
POINTS = 64  # points at which the change of direction is estimated
CENTERS = 4  # cells of a level where directions change fastest, in which a filter's error is computed
COSTS_MORE = "the direct method costs less"
DIRECTIONS = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)], float) - 1
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]


@dataclass(frozen=True, eq=False)
class Level:
    """Cells of one depth, and the antenna positions that are kept there.

    reach  samples of a profile on each side of a cell's centre
    """

    cells: CellLevel
    decimation: Decimation
    reach: int

    @property
    def stride(self) -> int:
        """Samples of a profile."""
        return 2 * self.reach


@dataclass(frozen=True, eq=False)
class FactorizedPlan:
    """Plan of factorised echoes.

    levels   from the largest cells to the smallest;  between  interpolator of profiles that are moved
    leaf     plan by which points are spread into profiles of the smallest cells
    cost     per pair of point and pulse, relative to one spread directly with two taps
    """

    levels: tuple[Level, ...]
    between: Interpolator
    leaf: Plan
    predicted_error: float
    cost: float

    def describe(self, method: str) -> dict[str, object]:
        """The plan in words and numbers, for a report."""
        return {
            "method": "factorized",
            "cells": " > ".join(str(len(level.cells)) for level in self.levels),
            "pulses per cell": " > ".join(str(len(level.decimation.kept)) for level in self.levels),
            "taps": self.leaf.interpolator.taps,
            "taps between levels": self.between.taps,
            "profile samples": self.leaf.length,
        }


class Candidate(NamedTuple):
    """Levels to be planned: depths from the largest cells to the smallest, interpolators, and about their cost.

    filter_taps, fine  of the filters over the pulses, and kept pulses per Nyquist interval;  ratios  of decimation
    share              of the tolerance, for each error of moving profiles
    """

    depths: tuple[int, ...]
    spread: Interpolator
    between: Interpolator
    length: int
    filter_taps: int
    fine: float
    share: float
    ratios: tuple[int, ...]
    cost: float


@dataclass(frozen=True, eq=False)
class Amplitudes:
    """What plans of levels must know of scatterers beside their places.

    image_error  of the kernel of a plan: larger than that of the kernel where scatterers lie evenly
    samples      of amplitudes that change along the track; None: they do not
    channels     in which scatterers are added
    leaf, cell   cost of the amplitude of one at a kept position, and of putting one into cells, in contributions
    """

    image_error: Callable[[Plan], float]
    samples: AmplitudeSamples | None = None
    channels: int = 1
    leaf: float = 0.0
    cell: float = cost_model.CELL_POINT


def plan_levels(
    cells: ScattererCells,
    antennas: PulseGeometry,
    band: Band,
    tolerance: float,
    amplitudes: Amplitudes,
    *,
    most: float = math.inf,
) -> FactorizedPlan | str:
    """The cheapest plan whose predicted error is at most `tolerance`, or the reason why there is none.

    most  cost of a plan, per pair of scatterer and pulse, above which the direct method is taken
    """
    case = _Case(cells, antennas, band, tolerance, amplitudes, most)
    candidates = sorted(case.candidates(), key=lambda candidate: candidate.cost)
    reason = "neighbouring pulses see even the smallest cells of points from directions that differ too much"
    for candidate in candidates[:TRIES]:
        plan = COSTS_MORE if candidate.cost > most else case.build(candidate)
        if not isinstance(plan, str):
            return plan
        reason = plan
    return reason


def expected_cost(
    cells: ScattererCells, antennas: PulseGeometry, band: Band, tolerance: float, amplitudes: Amplitudes
) -> float:
    """About the cost of the cheapest plan, per pair of scatterer and pulse; infinite where no cells are decimated."""
    case = _Case(cells, antennas, band, tolerance, amplitudes, math.inf)
    return min((candidate.cost for candidate in case.candidates()), default=math.inf)


class _Case:
    """Points, pulses and a tolerance, with what all candidates share."""

    def __init__(
        self,
        cells: ScattererCells,
        antennas: PulseGeometry,
        band: Band,
        tolerance: float,
        amplitudes: Amplitudes,
        most: float,
    ) -> None:
        self.cells, self.band, self.amplitudes, self.most = cells, band, amplitudes, most
        self.changing = 0.0 if amplitudes.samples is None else AMPLITUDE_SHARE * tolerance
        self.tolerance = tolerance - self.changing
        group = groups(len(antennas), antennas.frequency, antennas.frequency_step)
        self.antennas = replace(antennas, runs=tuple(smooth_runs(antennas.tx, antennas.rx, group)))
        self.highest = float(antennas.frequency.max()) + band.bandwidth / 2
        points = cells.sample.places[spread_over(len(cells.sample.places), POINTS)]
        fastest = float(rates(self.antennas, points, None, most=256).max())
        self.turning = fastest * 2 * self.highest / SPEED_OF_LIGHT  # cycles per pulse and metre

    def candidates(self) -> Iterator[Candidate]:
        """All candidates, with their estimated costs."""
        shares = [MOVING_SHARE * self.tolerance / (2 * n) for n in (1, 2, 3)]
        kernels = [self._interpolators(share) for share in shares]
        for depths in chains(len(self.cells)):
            share = shares[len(depths) - 1]
            filters = [(taps, fine, self._ratios(depths, fine)) for taps, fine in _filters(share)]
            for spread, between, length in kernels[len(depths) - 1]:
                for filter_taps, fine, ratios in filters:
                    if ratios is not None:
                        cost = self._cost(depths, spread, between, filter_taps, ratios)
                        yield Candidate(depths, spread, between, length, filter_taps, fine, share, ratios, cost)

    def _interpolators(self, share: float) -> list[tuple[Interpolator, Interpolator, int]]:
        """Kernels that spread points, and that move profiles, within their shares, and the length of the profiles: for
        each number of taps the widest spacing of samples."""
        most, kernels = (1 - MOVING_SHARE) * SPREADING_SHARE * self.tolerance, []
        for taps in TAPS:
            spacing = next((s for s in SPACINGS if interpolation.line_interpolator(taps, s).error <= share), None)
            if spacing is None:
                continue
            spread = (interpolation.interpolator(n, spacing) for n in interpolation.TERMS)
            narrowest = next((kernel for kernel in spread if kernel.error <= most), None)
            if narrowest is not None:
                between = interpolation.line_interpolator(taps, spacing)
                kernels.append((narrowest, between, self._length(narrowest)))
        return kernels

    def _length(self, spread: Interpolator) -> int:
        """Samples of a profile."""
        length = profile_length(spread.oversample, self.band.n_samples, spread.taps)
        carrier = carrier_steps(self.band.carrier, self.band.n_samples, self.band.bandwidth)
        while not off_carrier(length, carrier):
            length = 2 * fft.good_length(length // 2 + 1)
        return length

    def _ratios(self, depths: tuple[int, ...], fine: float) -> tuple[int, ...] | None:
        """Decimation ratios of the levels; None where one of them cannot decimate."""
        spaced, n_pulses, ratios = 1, len(self.antennas), []
        for depth in depths:
            radius = self.cells.typical_radii[depth]
            resolved = 1 / max(2 * fine * self.turning * radius * spaced, 1e-30)  # of one point, any number
            ratio = int(min(resolved, max(1, n_pulses // (2 * spaced))))
            if ratio < 2:
                return None
            ratios.append(ratio)
            spaced *= ratio
        return tuple(ratios)

    def _cost(
        self,
        depths: tuple[int, ...],
        spread: Interpolator,
        between: Interpolator,
        filter_taps: int,
        ratios: tuple[int, ...],
    ) -> float:
        """About the cost, in contributions per pair of point and pulse."""
        sigma = 2 * self.band.bandwidth / SPEED_OF_LIGHT * spread.oversample
        n_pulses, total = float(len(self.antennas)), 0.0
        for depth, ratio in zip(depths, ratios, strict=True):
            samples = 2 * self.cells.typical_radii[depth] * sigma + spread.taps + 2 * between.taps
            n_cells = self.cells.numbers[depth]
            total += n_cells * n_pulses * cost_model.expanding(samples, between.taps, filter_taps)
            n_pulses = n_pulses / ratio + filter_taps
        lanes = len(self.cells) + cost_model.LEAF_LANES * n_cells
        lane = cost_model.LEAF_POINT * cost_model.SPREADING.of_taps(spread.taps, 1.0) + self.amplitudes.leaf
        total += n_pulses * (lanes * lane + n_cells * cost_model.LEAF_SAMPLE * samples)
        total = self.amplitudes.channels * total + self.amplitudes.cell * len(self.cells) + cost_model.LEVELS
        return total / (len(self.cells) * len(self.antennas))

    def build(self, candidate: Candidate) -> FactorizedPlan | str:
        """The plan of a candidate, its errors computed for the track as it is; or the reason why they are too large."""
        share, source, error = candidate.share, self.antennas, 0.0
        levels = [self.cells.level(candidate.depths[-1])]
        for depth in candidate.depths[-2::-1]:
            levels.insert(0, self.cells.joined(depth, levels[0]))
        decimations: list[Decimation] = []
        ratios: list[int] = []
        samples, left = self.amplitudes.samples, self.changing
        weights, changes = samples and samples.weights, 0.0
        for cells, ratio in zip(levels, candidate.ratios, strict=True):
            most = (left - changes) / (len(levels) - len(decimations))
            while True:
                decimation, changed = decimated(source, ratio, candidate.filter_taps, candidate.fine), 0.0
                filtered = self._filter_error(source, decimation, cells)
                if samples and weights and filtered <= SHARE_SLACK * share:
                    changed = samples.change(weights, decimation, cells.radius)
                if (filtered <= SHARE_SLACK * share and changed <= most) or ratio <= 2:
                    break
                ratio = max(2, int(ratio * SMALLER_RATIO))
                # later levels keep their ratios at best
                reached = (*ratios, ratio, *candidate.ratios[len(ratios) + 1 :])
                if self._cost_of(candidate, reached) > self.most:
                    return COSTS_MORE
            if changed > most:
                return "amplitudes change too much along the track, or antennas' tables end among the scatterers"
            error, changes = error + filtered + candidate.between.error, changes + changed
            decimations.append(decimation)
            ratios.append(ratio)
            source, weights = decimation.kept, weights and weights.decimated(decimation)
        error += error_bounds.sum_rounding(64, self.band.n_samples) * len(levels)
        leaf = self._leaf(candidate, levels[-1], self.tolerance - error)
        if leaf is None:
            return "decimating the pulses leaves too small a share of the tolerance for spreading points"
        sigma = 2 * float(self.antennas.frequency_step.max()) * candidate.length / SPEED_OF_LIGHT
        reaches = _reaches(levels, sigma, leaf.interpolator.taps, candidate.between.taps)
        planned = tuple(Level(*v) for v in zip(levels, decimations, reaches, strict=True))
        predicted = error + leaf.predicted_error + changes
        cost = self._cost_of(candidate, tuple(ratios))
        if cost > self.most:
            return COSTS_MORE
        return FactorizedPlan(planned, candidate.between, leaf, predicted, cost)

    def _cost_of(self, candidate: Candidate, ratios: tuple[int, ...]) -> float:
        """About the cost of a candidate with other ratios of decimation."""
        return self._cost(candidate.depths, candidate.spread, candidate.between, candidate.filter_taps, ratios)

    def _filter_error(self, source: PulseGeometry, decimation: Decimation, cells: CellLevel) -> float:
        """Largest error of interpolation between the kept pulses, in cells where directions change fastest."""
        centers = cells.centers + self.cells.center
        picked = np.argsort(rates(source, centers, None, most=32))[-CENTERS:] if len(cells) > CENTERS else slice(None)
        return filter_error(source, decimation, centers[picked], cells.radius, self.highest, directions=DIRECTIONS)

    def _leaf(self, candidate: Candidate, cells: CellLevel, tolerance: float) -> Plan | None:
        """Plan by which points are spread into profiles of the smallest cells; None: there is none."""
        n_samples, most = self.band.n_samples, int(np.diff(cells.first).max())
        distance = self.antennas.distance(self.cells.bounds)
        summing, best = error_bounds.sum_rounding(most, n_samples), None
        for mode in (0, 1, 2):
            for order in cost_model.SERIES if mode < 2 else (0,):
                error = summing + error_bounds.range_error(
                    cells.radius, distance, self.highest, self.band.bandwidth, mode, order
                )
                cost = cost_model.RANGE_MODE[mode] + cost_model.SERIES[order]
                if error < tolerance and (best is None or cost < best.cost):
                    best = Plan(candidate.spread, candidate.length, 0, mode, order, error, cost)
        if best is None:
            return None
        images = self.amplitudes.image_error(best)
        if best.predicted_error + images > tolerance:
            return None
        return replace(best, predicted_error=best.predicted_error + images)


def chains(n_points: int) -> Iterator[tuple[int, ...]]:
    """Depths of the cells of each level, from the largest to the smallest: one to three levels."""
    for leaf in range(1, DEEPEST + 1):
        if 8 ** (leaf - 3) > n_points:
            return
        yield (leaf,)
        for step in STEPS:
            if leaf - step >= 0:
                yield (leaf - step, leaf)
            for second in STEPS:
                if leaf - step - second >= 0:
                    yield (leaf - step - second, leaf - step, leaf)


@functools.lru_cache(maxsize=16)
def _filters(error: float) -> list[tuple[int, float]]:
    """Taps of filters over the pulses, and the fewest kept pulses per Nyquist interval with an error up to `error`."""
    spacings = (1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
    fine = [(n, [s for s in spacings if interpolation.line_interpolator(n, s).error <= error]) for n in TAPS]
    return [(n, able[0]) for n, able in fine if able]


def _reaches(levels: list[CellLevel], sigma: float, spread_taps: int, taps: int) -> list[int]:
    """Samples of a profile on each side of a cell's centre, a multiple of 4: the profiles of a cell hold those of the
    cells within it; sigma: samples per metre."""
    reaches = [_multiple(levels[-1].radius * sigma + spread_taps // 2 + 1)]
    for larger, smaller in zip(levels[-2::-1], levels[:0:-1], strict=True):
        apart = smaller.centers - larger.centers[larger.parents_of(smaller)]
        farthest = float(np.sqrt((apart**2).sum(axis=1).max()))
        reaches.append(_multiple(farthest * sigma + reaches[-1] + taps // 2 + 1))
    return reaches[::-1]


def _multiple(samples: float) -> int:
    return 4 * int(np.ceil(samples / 4))
