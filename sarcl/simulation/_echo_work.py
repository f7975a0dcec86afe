"""How much work echoes are, by the numbers of pieces and pulses: before any facet is cut."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..numerics import cost_model
from ..scattering.facet_kinds import coherent
from ..scattering.rough_pieces import RoughPieces
from ..scene import terrain
from ..scene.triangles import areas
from ._planned_echoes import PlannedEchoes
from .scene_plan import ScenePlan, samples_shadows

# Pieces per facet, over area / edge^2: isosceles right triangles that are bisected until their longest side is shorter
# than the edge have sides of 0.71 to 1 edge
PER_EDGE = 5.5


class EchoWork(NamedTuple):
    """Work of echoes, in seconds of one core.

    tiling, cutting  of preparing points and facets;  adding  of their echoes
    pieces           about the number of facets after cutting;  contributions  pairs of scatterer, pulse and channel
    """

    tiling: float
    cutting: float
    adding: float
    pieces: float
    contributions: float

    @property
    def preparing(self) -> float:
        """Seconds before the first pulse."""
        return self.tiling + self.cutting

    @property
    def seconds(self) -> float:
        """Seconds of the whole job."""
        return self.preparing + self.adding

    @classmethod
    def of(cls, planned: PlannedEchoes) -> EchoWork:
        """The work of a plan."""
        scene, runs = planned.scene, planned.method.runs
        request, seen = scene.request, scene.seen
        n_points = len(seen.scene.positions) if request.same else 0
        smooth, rough = pieces_of(scene)
        device = None if scene.subdivision is None else scene.subdivision.device
        on_device = device is not None and RoughPieces.suited(device, seen.scene).any()
        cut_rough = cost_model.CUT_PIECE_ON_DEVICE if on_device else cost_model.CUT_PIECE
        cutting = cost_model.CUT_PIECE * smooth + cut_rough * rough
        lit, n_pulses = 0.0, len(seen.antennas)
        if request.shadows:
            sampled = samples_shadows(request, seen)
            clipped = n_pulses * (smooth if sampled else smooth + rough)
            looks = min(n_pulses, cost_model.LOOKS) if sampled and _shadows_may_fall(scene) else 0
            cutting += cost_model.CLIPPED_PIECE * clipped + cost_model.LOOK_AT_PIECE * rough * looks
            lit = cost_model.LIT_PIECE * clipped
        n_polarizations, n_samples = len(request.polarizations), planned.channels.shape[-1]
        pulse = cost_model.ECHO_PULSE + cost_model.ECHO_SAMPLE * n_samples + cost_model.SPREAD_PIECE * (smooth + rough)
        adding = runs * (n_polarizations * pulse + cost_model.SPREAD_POINT * n_points) + lit
        contributions = float(runs * (n_points + smooth + rough))
        return cls(
            1e-6 * cost_model.TILED_POINT * n_points, 1e-6 * cutting, 1e-6 * adding, smooth + rough, contributions
        )


def pieces_of(scene: ScenePlan) -> tuple[float, float]:
    """About the numbers of pieces of coherent and of other facets."""
    subdivision, facets = scene.subdivision, scene.seen.scene
    if subdivision is None:
        return 0.0, 0.0
    is_smooth = coherent(facets)
    if not subdivision.cuts:
        return float(is_smooth.sum()), float((~is_smooth).sum())
    edge = np.where(is_smooth, subdivision.plan.max_edge, min(subdivision.cell, subdivision.plan.max_edge))
    pieces = np.maximum(PER_EDGE * areas(facets.triangles) / edge**2, 1.0)
    return float(pieces[is_smooth].sum()), float(pieces[~is_smooth].sum())


def _shadows_may_fall(scene: ScenePlan) -> bool:
    """Whether something may be hidden from an antenna: not on a terrain alone that all of them overlook."""
    original = scene.seen.original
    if original.heights is None or len(original.triangles) > terrain.n_facets(original.heights):
        return True
    return not terrain.is_overlooked(original.heights, original.bounds, scene.seen.antennas.ends)
