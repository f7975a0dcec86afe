"""How facets are cut: coherent ones to the edges of their plan, random ones to cells of the waveform."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.validation import number
from ..model.waveform import Waveform
from ..opencl.device import Device
from ..scene.scene import Scene
from ._facet_norm import longest_piece
from .antenna_weights import WeightError
from .facet_kinds import FacetView
from .facet_plan import CutLimits, FacetPlan, plan_facets
from .random_surface import Pieces, pieces_of
from .random_surface import cell_edge as cell_edge
from .rough_pieces import RoughPieces


@dataclass(frozen=True, eq=False)
class Subdivision:
    """How a scene's facets are cut: coherent ones to the edges of the plan, random ones to about `cell`, m.

    cuts  False: facets stay as they are
    """

    plan: FacetPlan
    cell: float
    cuts: bool

    @property
    def gain(self) -> float:
        """Norm of the cut facets over that of the facets as they were given, both added with random phases."""
        return self.plan.gain

    def apply(self, scene: Scene, seed: int, device: Device | None) -> tuple[FacetPlan, Pieces | RoughPieces]:
        """The plan with the number of facets, and the pieces of the scene; `seed` of its random surface.

        device  that cuts facets, where it can; None: the host does
        """
        pieces: Pieces | RoughPieces
        if device is not None and not self.plan.is_float64 and RoughPieces.suits(device, scene):
            pieces = RoughPieces.cut(device, scene, self.cell, seed)
        else:
            edge = longest_piece(self.plan.max_edge) if self.cuts else np.inf
            pieces = pieces_of(scene, self.cell, edge, seed)
        return replace(self.plan, n_facets=len(pieces)), pieces


def plan_cut(
    share: float,
    view: FacetView,
    weights: WeightError,
    waveform: Waveform,
    max_edge: float | str | None,
    **limits: float,
) -> Subdivision:
    """How to cut a scene's facets within `share` of a tolerance.

    weights  errors of the antenna weights;  max_edge  as `sarcl.echo` takes it
    limits   max_bytes, profiles and terms of `CutLimits`
    ValueError for another max_edge, ToleranceUnreachable where the share cannot be met.
    """
    finest = np.inf
    if isinstance(max_edge, (int, float)):
        finest = number("max_edge", max_edge, above=0)
    elif max_edge not in ("auto", None):
        raise ValueError(f"max_edge is {max_edge!r}; give a length in m, 'auto', or None")
    cell = np.inf if max_edge is None else cell_edge(waveform)
    cuts = max_edge is not None
    plan = plan_facets(share, view, weights, CutLimits(finest=finest, cell=cell, cuts=cuts, **limits))
    return Subdivision(plan, cell, cuts)
