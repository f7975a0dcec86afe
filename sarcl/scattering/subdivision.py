"""Facets cut to the edges of their plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import ToleranceUnreachable
from ..base.rows import spread_over
from ..base.validation import number
from ..base.vectors import unit
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import PulseGeometry
from ..scene.material import COHERENT
from ..scene.scene import Scene
from ..scene.triangles import areas, centroids, edges
from ._facet_sampling import drawn
from .antenna_weights import WeightError
from .facet_plan import FacetPlan, coherent, plan_facets
from .scatterers import resolution_edge

FACETS = 200  # sampled, for the gain of subdivision


@dataclass(frozen=True, eq=False)
class Subdivision:
    """How a scene's facets are cut: coherent ones to the edges of the plan, the others to about `finest`, m.

    gain  bound of `subdivision_gain`;  cuts  False: facets stay as they are
    """

    plan: FacetPlan
    finest: float
    gain: float
    cuts: bool

    def apply(self, scene: Scene) -> tuple[FacetPlan, Scene]:
        """The plan with the number of facets, and the cut facets of the scene without its points."""
        scene = _without_points(scene)
        made = cut_facets(scene, self.plan, self.finest) if self.cuts else scene
        return replace(self.plan, n_facets=len(made.triangles)), made


def plan_cut(
    scene: Scene, waveform: Waveform, antennas: PulseGeometry, polarizations: Sequence[str], vertical: np.ndarray,
    max_edge: float | str | None, share: float, weights: WeightError, max_bytes: float = np.inf,
) -> Subdivision:  # fmt: skip
    """How to cut a scene's facets within `share` of a tolerance.

    max_edge  as `sarcl.echo` takes it;  weights  errors of the antenna weights;  max_bytes  for the cut facets
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
    gain = 1.0
    for _ in range(6):
        try:
            plan = plan_facets(
                share / gain, scene, antennas, waveform.center, waveform.bandwidth, polarizations,
                vertical, finest, cut=max_edge is not None, weights=weights, max_bytes=max_bytes,
            )  # fmt: skip
        except ToleranceUnreachable as refused:
            raise refused.restated(share, None if refused.best is None else refused.best * gain) from None
        found = 1.0 if max_edge is None else subdivision_gain(scene, plan.max_edge, antennas, plan.nodes)
        if found <= gain:
            return Subdivision(plan, finest, gain, max_edge is not None)
        gain = 1.1 * found
    raise ToleranceUnreachable(
        share, None, "edges of cut facets", "let fewer facets make up a plane",
        how=f"with these facets: cut finely enough, their edges' echoes cancel to less than 1/{gain:.0f}",
    )  # fmt: skip


def _without_points(scene: Scene) -> Scene:
    return replace(scene, positions=np.zeros((0, 3)), amplitudes=np.zeros(0, np.complex128))


def cut_facets(scene: Scene, plan: FacetPlan, finest: float) -> Scene:
    """The scene's facets cut to the edges of the plan; those without a coherent part only to about `finest`, m."""
    mirror = coherent(scene)
    parts = [scene.part(which).split(edge) if np.isfinite(edge) else scene.part(which)
             for which, edge in ((mirror, plan.max_edge), (~mirror, 1.05 * finest)) if which.any()]  # fmt: skip
    return parts[0] if len(parts) == 1 else parts[0] + parts[1]


def subdivision_gain(scene: Scene, max_edge: float, antennas: PulseGeometry, frequencies: np.ndarray) -> float:
    """Norm of cut facets over that of uncut ones, both added with random phases; at least 1.

    Cutting a smooth facet makes edges whose echoes cancel again; their errors do not. Estimated from up to 200 facets
    at three pulses, as perfect conductors.
    """
    from .physical_optics import triangle_integral

    some = np.flatnonzero((np.maximum.reduce(edges(scene.triangles)) > max_edge) & coherent(scene))
    if len(some) == 0:
        return 1.0
    some = some[drawn(areas(scene.triangles[some]), FACETS, np.random.default_rng(0))[0]]
    whole = Scene.facets(scene.triangles[some])
    cut = whole.split(max(max_edge, float(np.maximum.reduce(edges(whole.triangles)).max()) / 64))
    power = [0.0, 0.0]
    for row in spread_over(len(antennas.tx), 3):
        for i, part in enumerate((whole, cut)):
            centers = centroids(part.triangles)
            q = np.zeros_like(centers)
            for ends in (antennas.tx, antennas.rx):
                q += unit(ends[row] - centers)
            for f in frequencies:
                integral = triangle_integral(part.triangles, 2 * np.pi * f / SPEED_OF_LIGHT * q)
                power[i] += float((np.abs(integral) ** 2).sum())
    return max(1.0, float(np.sqrt(power[1] / power[0]))) if power[0] else 1.0
