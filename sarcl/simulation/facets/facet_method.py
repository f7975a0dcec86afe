"""The method of echoes of facets: each pulse by itself, or factorised, for facets of which all pulses see the same."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...numerics import cost_model
from ...numerics.plan import Plan
from ...scattering.facets import POLARIZATIONS, FacetSet, diagram_macros, vertical_axes
from ...scattering.kept_amplitudes import AmplitudeSamples, passes_overhead
from ..factorized.cells import PlaceSample, ScattererCells, drawn_numbers, scatterers_in_window
from ..factorized.levels import COSTS_MORE, FEWEST_PULSES, Amplitudes, FactorizedPlan, plan_levels
from ..factorized.scatterers import Channel, Scatterers
from ..factorized.spreader import FactorizedSpreader
from ..spreading import ChannelView
from .facet_spreading import FacetSpreader, TiledFacets

BYTES = 250  # per facet in cells: positions, numbers for the kernel, and their copies in the order of the cells


@dataclass(frozen=True, eq=False)
class FacetEchoes:
    """What adds the facets of a channel: by levels, and at each pulse. None: there are none.

    reason  why none are added by levels, "" where some are
    """

    by_levels: FactorizedSpreader | None
    direct: FacetSpreader | None
    error: float
    words: dict[str, object]
    reason: str = ""

    @property
    def spreaders(self) -> list[FactorizedSpreader | FacetSpreader]:
        """Those that there are."""
        return [one for one in (self.by_levels, self.direct) if one is not None]


def facet_echoes(
    tiled: TiledFacets, facets: FacetSet, view: ChannelView, tolerance: float, budget: float, *, method: str
) -> FacetEchoes:
    """The cheapest way of adding facets, as the pulses of a channel see them.

    tolerance  relative to the facets at random phases;  budget  bytes on the device
    method     "auto", "direct", or "factorized": by levels wherever that is possible
    """
    case = _Case(tiled, facets, view, tolerance, budget, method == "factorized")
    levels = 'method is "direct"' if method == "direct" else case.by_levels()
    if isinstance(levels, str):
        spreader = FacetSpreader(tiled, facets, view, tolerance, budget)
        words = spreader.plan.describe("spread") | tiled.facet_plan.describe()
        words |= {"pulses per amplitude": spreader.pulse_nodes.spacing}
        return FacetEchoes(None, spreader, spreader.predicted_error, words, levels)
    scatterers = case.scatterers(levels.cells, levels.numbers)
    by_levels = FactorizedSpreader(tiled.device, levels.plan, scatterers, view.antennas, len(view.frequencies), budget)
    error, words = levels.plan.predicted_error, levels.plan.describe("spread") | tiled.facet_plan.describe()
    direct, rest = None, np.setdiff1d(np.arange(len(facets)), levels.numbers, assume_unique=True)
    if len(rest):
        some = facets.chosen(rest)
        direct = FacetSpreader(tiled.of(some), some, view, tolerance, budget)
        error = max(error, direct.predicted_error - tiled.facet_plan.predicted_error)
        words |= {"facets added pulse by pulse": len(rest)}
    return FacetEchoes(by_levels, direct, error + tiled.facet_plan.predicted_error, words)


@dataclass(frozen=True, eq=False)
class _Levels:
    """Facets that are added by levels: their numbers in the order of the cells, and the plan."""

    cells: ScattererCells
    numbers: np.ndarray
    plan: FactorizedPlan


@dataclass(frozen=True, eq=False)
class _Case:
    """Facets, a channel, a tolerance and bytes on the device; forced: by levels wherever that is possible."""

    tiled: TiledFacets
    facets: FacetSet
    view: ChannelView
    tolerance: float
    budget: float
    forced: bool

    def by_levels(self) -> _Levels | str:
        """The facets that are added by levels, or the reason why none are."""
        view, antennas, device = self.view, self.view.antennas, self.tiled.device
        fewest = 1 if self.forced else cost_model.ECHO_SEARCH_PAYS / (self._direct_cost * len(antennas))
        if len(antennas) < FEWEST_PULSES:
            return f"the track has {len(antennas)} pulses, and {FEWEST_PULSES} are the fewest that are decimated"
        if len(self.facets) < fewest:
            return "planning would take longer than it saves"
        if not self.forced and not self.tiled.stays:
            return "all pieces together take more than the memory for them"
        if not self.forced and not device.is_cpu and len(antennas) < cost_model.PULSES_BESIDE_CELLS:
            return "the GPU adds these pulses before the host has made cells"
        if not self.forced and BYTES * len(self.facets) > self.budget:
            return "cells of so many facets take more memory than max_bytes allows"
        most = math.inf if self.forced else cost_model.LEVELS_PAY * self._direct_cost
        if cost_model.CELL_FACET > most * len(antennas):
            return COSTS_MORE
        if passes_overhead(self.facets, view.weights, view.vertical):
            return "antennas pass over the facets, where horizontal and vertical turn fast"
        steady = np.flatnonzero(~self.facets.is_changing)
        if len(steady) < fewest:
            return "shadows move over too many of the facets"
        sample = PlaceSample(len(steady), self.facets.places(steady[drawn_numbers(len(steady))]), self.facets.bounds)
        cells = ScattererCells(lambda: self.tiled.numbers[0][steady], sample)
        seen = scatterers_in_window(cells, antennas)
        if not seen.all():
            if seen.sum() < fewest:
                return "too few facets lie inside the range window at every pulse"
            steady = steady[np.sort(cells.order[seen])]
            cells = ScattererCells(self.tiled.numbers[0][steady])
        plan = plan_levels(cells, antennas, view.band, self._room, self._amplitudes(steady), most=most)
        if isinstance(plan, str):
            return plan
        return _Levels(cells, steady[cells.order], plan)

    @property
    def _room(self) -> float:
        """What is left of the tolerance beside the errors of the facets' own plan."""
        return self.tolerance - self.tiled.facet_plan.predicted_error

    def _amplitudes(self, numbers: np.ndarray) -> Amplitudes:
        """What the plan must know of facets of these numbers."""
        view, some = self.view, self.facets
        if len(numbers) < len(some):
            some = some.chosen(numbers)
        highest = float(view.frequencies[-1])
        samples = AmplitudeSamples.of_facets(some, view.weights, self._polarizations, view.vertical, highest)
        gain = cost_model.GAIN * view.weights.is_needed

        def image_error(leaf: Plan) -> float:
            return self.tiled.image_error(leaf, view.band)

        return Amplitudes(image_error, samples, self._n_channels, cost_model.LEAF_FACET + gain, cost_model.CELL_FACET)

    @property
    def _polarizations(self) -> list[str]:
        """Those that are computed, each once."""
        return [name for name in POLARIZATIONS if name in self._columns]

    @property
    def _columns(self) -> list[str]:
        """Of the samples: one antenna receives as V what is sent as H exactly as it receives as H what is sent as V."""
        alike = {"VH": "HV"} if self.view.antennas.is_monostatic else {}
        return [alike.get(name, name) for name in self.view.polarizations]

    @property
    def _n_channels(self) -> int:
        return len(self._polarizations) * len(self.tiled.facet_plan.nodes)

    @property
    def _direct_cost(self) -> float:
        """About the cost of a pair that is added directly, in contributions."""
        return cost_model.FACET_PAIR * self._n_channels * self.view.band.spreading_cost(self._room, len(self.facets))

    def scatterers(self, cells: ScattererCells, numbers: np.ndarray) -> Scatterers:
        """Facets of these numbers, in the order of the cells, as the kernel reads them."""
        facets, tiled, view = self.facets, self.tiled, self.view
        planes = np.ascontiguousarray(tiled.numbers[1][:, numbers])
        if facets.illumination is not None:  # of facets that all pulses see alike
            planes[tiled.REFLECTIVITY] *= facets.share_at(0)[numbers].astype(np.float32)
        nodes, columns = tiled.facet_plan.nodes, self._columns
        basis = tiled.facet_plan.basis(view.frequencies).astype(np.float32)
        channels = tuple(
            Channel(
                tuple(i for i, other in enumerate(columns) if other == name), basis[m], name,
                root=7 + 6 * facets.is_rough + 2 * m * tiled.dispersive, wave=float(node) / SPEED_OF_LIGHT,
                scale=float(tiled.facet_plan.scales()[m]), ratio=float(node / view.weights.frequency),
            )
            for name in self._polarizations for m, node in enumerate(nodes)
        )  # fmt: skip
        macros = {"FACETS": 1, "METAL": int(tiled.metal), "ROUGH": int(facets.is_rough)}
        macros |= {"COHERENT": int(facets.is_mirror), **(diagram_macros() if facets.is_rough else {})}
        return Scatterers(cells, planes, channels, view.weights, macros, vertical_axes(view.vertical))
