"""Facets cut to the edges of their plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.validation import number
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import PulseGeometry
from ..scene.material import COHERENT
from ..scene.scene import Scene
from ._cutting_error import longest_piece
from .antenna_weights import WeightError
from .facet_plan import FacetPlan, coherent, plan_facets
from .scatterers import resolution_edge


@dataclass(frozen=True, eq=False)
class Subdivision:
    """How a scene's facets are cut: coherent ones to the edges of the plan, the others to about `finest`, m.

    cuts  False: facets stay as they are
    """

    plan: FacetPlan
    finest: float
    cuts: bool

    @property
    def gain(self) -> float:
        """Norm of the cut facets over that of the facets as they were given, both added with random phases."""
        return self.plan.gain

    def apply(self, scene: Scene) -> tuple[FacetPlan, Scene]:
        """The plan with the number of facets, and the cut facets of the scene without its points."""
        scene = _without_points(scene)
        made = cut_facets(scene, self.plan, self.finest) if self.cuts else scene
        return replace(self.plan, n_facets=len(made.triangles)), made


def plan_cut(
    scene: Scene, waveform: Waveform, antennas: PulseGeometry, polarizations: Sequence[str], vertical: np.ndarray,
    max_edge: float | str | None, share: float, weights: WeightError, max_bytes: float = np.inf,
    profiles: float = 0.0, terms: float = np.inf,
) -> Subdivision:  # fmt: skip
    """How to cut a scene's facets within `share` of a tolerance.

    max_edge  as `sarcl.echo` takes it;  weights  errors of the antenna weights;  max_bytes  for the cut facets
    profiles, terms  as `plan_facets` takes them
    ValueError for another max_edge, ToleranceUnreachable where the share cannot be met.
    """
    scene = _without_points(scene)
    finest = np.inf
    if max_edge == "auto" and (scene.roughness.any() or any(m.diagram not in COHERENT for m in scene.materials)):
        finest = resolution_edge(waveform, antennas, scene)
    elif isinstance(max_edge, (int, float)):
        finest = number("max_edge", max_edge, above=0)
    elif max_edge not in ("auto", None):
        raise ValueError(f"max_edge is {max_edge!r}; give a length in m, 'auto', or None")
    plan = plan_facets(
        share, scene, antennas, waveform.center, waveform.bandwidth, polarizations, vertical, finest,
        cut=max_edge is not None, weights=weights, max_bytes=max_bytes, profiles=profiles, terms=terms,
    )  # fmt: skip
    return Subdivision(plan, finest, max_edge is not None)


def _without_points(scene: Scene) -> Scene:
    return replace(scene, positions=np.zeros((0, 3)), amplitudes=np.zeros(0, np.complex128))


def cut_facets(scene: Scene, plan: FacetPlan, finest: float) -> Scene:
    """The scene's facets cut to the edges of the plan; those without a coherent part only to about `finest`, m."""
    mirror = coherent(scene)
    parts = [scene.part(which).split(longest_piece(edge)) if np.isfinite(edge) else scene.part(which)
             for which, edge in ((mirror, plan.max_edge), (~mirror, 1.05 * finest)) if which.any()]  # fmt: skip
    return parts[0] if len(parts) == 1 else parts[0] + parts[1]
