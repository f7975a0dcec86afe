"""Points or facets of a scene, planned for their spectral echoes, and their spectra along track."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import NotApplicable, ToleranceUnreachable
from ...base.rows import spread_over
from ...base.tolerances import askable, rounded_up
from ...numerics import cost_model
from ...opencl.device import Device
from ...scattering.facets import FacetSet
from ._aspect_expansion import AmplitudeSamples, AspectExpansion, expand, one_function
from ._aspect_window import Aspects, aspects
from ._aspects_seen import aspects_seen, check_doppler, check_spread, inner_aspects
from ._azimuth_transfer import SAFETY as RESPONSE_SAFETY
from ._azimuth_transfer import (
    TESTED,
    AllowedError,
    AzimuthTransfer,
    SeenScatterers,
    compared_samples,
    doppler_grid,
    lags_of,
    plan_transfer,
    response_error,
)
from ._edge_map import EdgePlaces, EdgeTask, edge_map, places_of_edges
from ._facet_factors import FacetFactors
from ._map_part import MapPart, SpectrumRows
from ._map_plan import plan_map, range_wavenumbers, scatterers_per_cell, tile_of
from ._map_spectrum import ReflectivityMap
from ._scatterer_amplitudes import ScattererAmplitudes
from ._stationary_phase import stationary_tables
from ._straight_track import StraightTrack, tangent
from .planning_time import PlanningTime

# Shares of the tolerance: of amplitudes over aspect, transfer functions, what lies outside the beam, the grids.
EXPANSION, TRANSFER, OUTSIDE, GRID = 0.35, 0.25, 0.15, 0.2
MANY = 64  # scatterers, the strongest of which try the responses along the track
SPREAD = 8  # of these, over all slant ranges, which try them together


@dataclass(frozen=True, eq=False)
class SpectralPart:
    """A plan for points or for facets.

    some   indices of the scatterers that the beam reaches (n,);  outside  error of what lies outside the beam
    maps   that of all pulses, and one for each hard edge of the beam that the track sees
    seen   sines between which pulses see scatterers
    """

    amplitudes: ScattererAmplitudes
    some: np.ndarray
    expansion: AspectExpansion
    maps: tuple[MapPart, ...]
    seen: tuple[float, float]
    outside: float

    @property
    def predicted_error(self) -> float:
        """Relative to the scatterers at random phases."""
        # pulses beside a hard edge belong to two maps, with shares v and 1 - v: these add up to less
        of_maps = float(np.sqrt(sum(one.error**2 for one in self.maps)))
        return self.expansion.error + self.outside + of_maps

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a report."""
        main = self.maps[0]
        words = {
            "method": "spectral, " + ("exact" if main.transfer.phase.paraxial is None else "saras"),
            "functions of aspect": len(self.expansion),
            "ranges": len(main.transfer.ranges),
            "frequencies": len(main.transfer.frequencies),
            "wavenumbers along track": main.grid.count,
            "cells": f"{main.map.n_columns} x {main.map.n_rows}",
            "taps": main.map.kernel.taps,
        }
        if len(self.maps) > 1:
            words["maps of hard edges of the beam"] = sum(one.nodes for one in self.maps[1:])
        return words

    def on_device(self, device: Device, budget: float) -> PartOnDevice:
        """The maps of the scatterers, sorted for the kernels, and their factors;  budget  bytes"""
        if isinstance(self.amplitudes.part, FacetSet):
            factors: PointFactors | FacetFactors = FacetFactors(device, self.amplitudes, self.some, budget)
        else:
            factors = PointFactors(self.amplitudes, self.some)
        return PartOnDevice([one.on_device(device) for one in self.maps], factors)

    def add(
        self, held: PartOnDevice, frequencies: np.ndarray, out: Sequence[Sequence[SpectrumRows]], budget: float,
        folder: Path | None, on_progress: Callable[[float], None],
    ) -> None:  # fmt: skip
        """Write the spectra at frequencies, Hz (n_f,), to out: rows of each map, of one or several polarisations.

        budget  bytes;  folder  of temporary files
        """
        expansion = self.expansion
        for j in range(len(expansion)):
            factors = held.factors(float(expansion.sines[j]), float(expansion.frequencies[j]))
            for one, on_device, spectra in zip(self.maps, held.maps, out, strict=True):
                if spectra:
                    one.add(on_device, factors, j, frequencies, spectra, budget, folder)
            on_progress((j + 1) / len(expansion))

    def repeated_seconds(self) -> float:
        """About the seconds of work that every block of one map repeats: amplitudes, and the map itself."""
        of_facets = isinstance(self.amplitudes.part, FacetSet)
        amplitude = cost_model.SPECTRAL_FACET if of_facets else cost_model.SPECTRAL_POINT
        of_maps = max(cost_model.SPECTRAL_SPREAD * len(one.azimuth) * one.nodes for one in self.maps)
        return 1e-6 * len(self.expansion) * (amplitude * len(self.some) + of_maps)


@dataclass(frozen=True, eq=False)
class PointFactors:
    """Amplitudes of some points: what FacetFactors are for facets."""

    amplitudes: ScattererAmplitudes
    some: np.ndarray

    def __call__(self, sine: float, frequency: float) -> np.ndarray:
        return self.amplitudes(self.some, sine, frequency).astype(np.complex64)


@dataclass(frozen=True, eq=False)
class PartOnDevice:
    """The maps of a part, and amplitudes of its scatterers at a sine and a frequency, Hz: complex64
    (n, n_polarizations)."""

    maps: list[ReflectivityMap]
    factors: PointFactors | FacetFactors


@dataclass(frozen=True, eq=False)
class PartTask:
    """Points or facets whose spectral echoes are to be planned.

    band       Hz, its limits;  variant  "exact" or "saras"
    has_beam   antennas limit the aspects at which scatterers are seen;  is_random  scatterers have random phases
    tolerance  that the plan may take;  asked  the whole tolerance, for messages;  time  that planning may take
    """

    amplitudes: ScattererAmplitudes
    track: StraightTrack
    band: tuple[float, float]
    has_beam: bool
    is_random: bool
    variant: str
    tolerance: float
    asked: float
    device: Device
    time: PlanningTime


@dataclass(frozen=True, eq=False)
class Reach:
    """Scatterers whose responses reach the track.

    reached  by the beam, or between its hard edges (n,) bool;  ends  of responses along the track, m
    edges    places of hard edges;  some  indices of these scatterers and of those that edges pick
    """

    reached: np.ndarray
    ends: tuple[float, float]
    edges: list[EdgePlaces]
    some: np.ndarray


def plan_part(task: PartTask) -> SpectralPart:
    """The plan for points or facets whose error is at most the tolerance."""
    amplitudes, track, band = task.amplitudes, task.track, task.band
    low, high, outside, main = aspects_seen(amplitudes, track, band, task.has_beam, OUTSIDE * task.tolerance)
    check_doppler(track, band[1], main, task.has_beam)
    check_spread(track, band[1], low, high)
    expansion = _expansion(task, (low, high), main)
    inner, hard = inner_aspects(amplitudes, track, (low, high), band[0])
    parts = float(np.sqrt(1 + sum(hard)))  # maps whose errors add up
    of_transfer, of_grid = TRANSFER * task.tolerance / parts, GRID * task.tolerance / parts
    azimuth, ranges = amplitudes.azimuth, amplitudes.slant_range
    nearest, farthest = float(ranges.min()), float(ranges.max())
    farthest = max(farthest, nearest * (1 + 1e-4))  # nodes over range need an interval
    lags = -float(azimuth.max()), track.length - float(azimuth.min())
    seen_aspects = aspects(*inner, (nearest, farthest), band, lags, of_transfer / 3, hard)
    reach = _reach(task, seen_aspects, nearest)
    factors, transfer = _transfer(task, seen_aspects, expansion, reach, of_transfer, outside)
    grid = doppler_grid(transfer, track, reach.ends)
    numbers = range_wavenumbers(transfer, grid)
    tile, x, r = tile_of(task.device), azimuth[reach.reached], ranges[reach.reached]
    per_cell = 0.0 if task.is_random else scatterers_per_cell(x, r, grid, numbers)
    plan = plan_map(of_grid, numbers, grid, (nearest, farthest), per_cell, tile, task.asked)
    whole = np.flatnonzero(reach.reached[reach.some]) if reach.edges else slice(None)
    maps = [MapPart(whole, x, r, lambda: transfer.range_weights(r), transfer, grid, numbers, plan)]
    edge_task = EdgeTask(seen_aspects, expansion.functions, factors[:TESTED], track, of_transfer, task.asked, task.time)
    maps += [edge_map(edge_task, places, reach.some, of_grid, task.is_random, tile) for places in reach.edges]
    return SpectralPart(amplitudes, reach.some, expansion, tuple(maps), (low, high), outside)


def _expansion(task: PartTask, limits: tuple[float, float], main: tuple[float, float]) -> AspectExpansion:
    """Amplitudes as functions of aspect, between sines; main  those of the middle of the beam."""
    amplitudes, track, (low, high) = task.amplitudes, task.track, limits

    def seen(some: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return np.clip(amplitudes.sines(random.integers(0, track.n_pulses, len(some)) * track.spacing, some), low, high)

    samples = AmplitudeSamples(amplitudes, amplitudes.size, task.band, seen, amplitudes.kinds)
    if task.variant == "saras":
        return one_function(samples, float(np.clip(0.0, *main)))
    return expand(samples, limits, EXPANSION * task.tolerance, task.asked)


def _reach(task: PartTask, seen_aspects: Aspects, nearest: float) -> Reach:
    """The scatterers whose responses reach the track; nearest  slant range, m, of all."""
    amplitudes, track = task.amplitudes, task.track
    if max(abs(sine) for sine in seen_aspects.support) >= 1:
        raise NotApplicable(
            f"scatterers are seen from {nearest:.3g} m, where a Fresnel zone is so wide that spectral_echo would "
            "continue their responses beyond the direction of the track; use echo"
        )
    ends = [amplitudes.azimuth + amplitudes.slant_range * float(tangent(end)) for end in seen_aspects.support]
    reached = (ends[0] <= track.length) & (ends[1] >= 0)
    if amplitudes.edges is not None:
        reached &= amplitudes.edges.seen
    limits = float(ends[0][reached].min()), float(ends[1][reached].max())
    edges = places_of_edges(amplitudes, seen_aspects, track)
    is_picked = reached.copy()
    for places in edges:
        is_picked[places.picked] = True
    return Reach(reached, limits, edges, np.flatnonzero(is_picked))


def _transfer(
    task: PartTask, seen_aspects: Aspects, expansion: AspectExpansion, reach: Reach, of_transfer: float, outside: float
) -> tuple[np.ndarray, AzimuthTransfer]:
    """Factors (n, J) of the scatterers that responses are tried on, the strongest first; and the transfer functions.

    of_transfer  error that these may have;  outside  error of what lies outside the beam
    """
    amplitudes, track, some = task.amplitudes, task.track, reach.some
    azimuth, ranges = amplitudes.azimuth, amplitudes.slant_range
    drawn = some[np.linspace(0, len(some) - 1, min(len(some), MANY)).astype(int)]
    factors = np.stack([expansion.factors(drawn, j) for j in range(len(expansion))], axis=-1)
    factors = factors[:, np.abs(factors).sum(axis=(0, 2)).argmax()]
    groups = []
    if task.has_beam or len(expansion) > 1:  # those of other ranges and elevations are other sums of the functions
        apart = np.argsort(ranges[drawn], kind="stable")[spread_over(len(drawn), SPREAD)]
        groups.append(SeenScatterers(factors[apart], azimuth[drawn[apart]], ranges[drawn[apart]]))
    if task.has_beam:
        groups.append(_brightest(amplitudes, track, drawn, factors, task.band))
    factors = factors[np.argsort(-np.abs(factors).sum(axis=1), kind="stable")]
    if task.variant == "exact":
        allowed = AllowedError(of_transfer, task.asked)
        return factors, plan_transfer(
            seen_aspects, expansion.functions, factors, track, reach.ends, allowed, task.time, groups
        )
    n_lags = lags_of(track, reach.ends)
    task.time.spend(compared_samples(1, len(expansion), n_lags), n_lags)
    transfer = stationary_tables(seen_aspects, expansion.functions)
    error = RESPONSE_SAFETY * response_error(transfer, expansion.functions, factors[:1], track, reach.ends)
    _check_saras(expansion.error, error, outside, (1 - GRID) * task.tolerance, task.asked)
    return factors, replace(transfer, error=error)


def _brightest(
    amplitudes: ScattererAmplitudes,
    track: StraightTrack,
    drawn: np.ndarray,
    factors: np.ndarray,
    band: tuple[float, float],
) -> SeenScatterers:
    """Those of some scatterers (n,), with factors (n, J), that the middle or an end of the track sees brightest."""
    power = np.zeros(len(drawn))
    for place in (0.0, track.length / 2, track.length):
        amplitude = amplitudes(drawn, amplitudes.sines(place, drawn), sum(band) / 2)
        power = np.maximum(power, (np.abs(amplitude) ** 2).sum(axis=1))
    best = np.argsort(-power, kind="stable")[:TESTED]
    return SeenScatterers(factors[best], amplitudes.azimuth[drawn[best]], amplitudes.slant_range[drawn[best]])


def _check_saras(of_amplitudes: float, of_transfer: float, outside: float, allowed: float, asked: float) -> None:
    """ToleranceUnreachable where SARAS's approximations exceed their share of the tolerance."""
    error = of_amplitudes + of_transfer + outside
    if not error <= allowed:
        best = rounded_up(1.05 * asked * error / allowed)
        raise ToleranceUnreachable(
            asked,
            askable(best),
            "SARAS's transfer function",
            "take variant='exact', or echo",
            "by variant='saras': stationary phase, parabolas and the grid deformation differ from the responses along "
            f"the track by {of_transfer:.1e}, amplitudes of one aspect by {of_amplitudes:.1e}",
        )
