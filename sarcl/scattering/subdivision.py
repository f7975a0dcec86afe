"""How facets are cut: coherent ones to the edges of their plan, random ones to cells of the waveform."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.validation import number
from ..model.waveform import Waveform
from ..opencl.device import Device
from ..scene.scene import Scene
from . import facet_kinds
from ._facet_norm import longest_piece
from .antenna_weights import WeightError
from .facet_kinds import FacetView
from .facet_plan import CutLimits, FacetPlan, plan_facets
from .facets import FacetSet
from .random_surface import Pieces, pieces_of, with_facets
from .random_surface import cell_edge as cell_edge
from .rough_pieces import RoughFacets, RoughPieces


@dataclass(frozen=True, eq=False)
class Subdivision:
    """How a scene's facets are cut: coherent ones to the edges of the plan, random ones to about `cell`, m.

    cuts    False: facets stay as they are
    device  that cuts the facets without a coherent part, where it can; None: the host does
    rough   plan of the facets without a coherent part, where a device cuts them; None: `plan` holds for them
    """

    plan: FacetPlan
    cell: float
    cuts: bool
    device: Device | None = None
    rough: FacetPlan | None = None

    @property
    def gain(self) -> float:
        """Norm of the cut facets over that of the facets as they were given, both added with random phases."""
        return self.plan.gain

    def plan_of(self, facets: FacetSet) -> FacetPlan:
        """The plan by which a set of facets is added up."""
        return self.rough if self.rough is not None and isinstance(facets, RoughFacets) else self.plan

    def apply(self, scene: Scene, seed: int) -> tuple[Subdivision, CutScene]:
        """The subdivision with the number of pieces, and the pieces of the scene; `seed` of its random surface."""
        rough = host = None
        on_device = _on(None if self.plan.is_float64 else self.device, scene)
        if self.device is not None and on_device.any():
            rough = RoughPieces.cut(self.device, scene, self.cell, seed, on_device)
        if not on_device.all():
            edge = longest_piece(self.plan.max_edge) if self.cuts else np.inf
            host = pieces_of(scene, self.cell, edge, seed, ~on_device)
        cut = CutScene(scene, rough, host)
        return replace(self, plan=replace(self.plan, n_facets=len(cut))), cut


@dataclass(frozen=True, eq=False)
class CutScene:
    """Pieces of a scene's facets: those of rough ones that a device cuts, and the others on the host; None: none."""

    original: Scene
    rough: RoughPieces | None
    host: Pieces | None

    def __len__(self) -> int:
        return sum(len(pieces) for pieces in (self.rough, self.host) if pieces is not None)

    def sampled_cells(self, most: int) -> tuple[Scene, float]:
        """About `most` cells of random facets as a scene, and the number that each represents: all of them where the
        host cut all."""
        if self.rough is None:
            return self.host.cells if self.host else self.original, 1.0
        cells, each = self.rough.sampled_cells(most)
        if self.host is None:
            return cells, each
        others = self.host.cells
        rows = np.flatnonzero(facet_kinds.random(others))
        rows = np.random.default_rng(1).choice(rows, round(len(rows) / each), replace=False)
        return cells + with_facets(others, others.triangles[rows], rows) if len(rows) else cells, each


def plan_cut(
    share: float,
    view: FacetView,
    weights: WeightError,
    waveform: Waveform,
    max_edge: float | str | None,
    device: Device | None,
    **limits: Any,
) -> Subdivision:
    """How to cut a scene's facets within `share` of a tolerance.

    weights  errors of the antenna weights;  max_edge  as `sarcl.echo` takes it
    device   that may cut rough facets, or None;  limits  other fields of `CutLimits`
    ValueError for another max_edge, ToleranceUnreachable where the share cannot be met.
    """
    finest = np.inf
    if isinstance(max_edge, (int, float)):
        finest = number("max_edge", max_edge, above=0)
    elif max_edge not in ("auto", None):
        raise ValueError(f"max_edge is {max_edge!r}; give a length in m, 'auto', or None")
    cell = np.inf if max_edge is None else cell_edge(waveform)
    cuts = max_edge is not None
    on_device = _on(device, view.scene)
    cut_limits = CutLimits(finest=finest, cell=cell, cuts=cuts, on_device=on_device, **limits)
    rough, rows = None, np.flatnonzero(on_device)
    if 0 < len(rows) < len(on_device):
        part = replace(view, scene=with_facets(view.scene, view.scene.triangles[rows], rows))
        try:
            rough = plan_facets(share, part, weights, replace(cut_limits, on_device=on_device[rows], terms=np.inf))
        except ToleranceUnreachable:  # beside the others they may meet it
            cut_limits = replace(cut_limits, on_device=np.zeros(len(on_device), bool))
    return Subdivision(plan_facets(share, view, weights, cut_limits), cell, cuts, device, rough)


def _on(device: Device | None, scene: Scene) -> np.ndarray:
    """Facets that a device cuts (k,) bool."""
    return np.zeros(len(scene.triangles), bool) if device is None else RoughPieces.suited(device, scene)
