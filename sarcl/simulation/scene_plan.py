"""How the tolerance of echoes is divided among the parts of a scene, and how finely its facets are cut within it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.tolerances import reachable
from ..model.waveform import Waveform
from ..numerics.plan import LEAST_TOLERANCE, PROFILES
from ..numerics.pulse_geometry import PulseGeometry
from ..scattering.antenna_weight_error import weight_error as error_of_weights
from ..scattering.antenna_weights import AntennaWeights, WeightError
from ..scattering.facet_kinds import FacetView, coherent
from ..scattering.facet_plan import MOST_FACETS
from ..scattering.facet_shadows import rough_looks
from ..scattering.subdivision import Subdivision, cell_edge, plan_cut
from ..scene.scene import Scene
from ..scene.triangles import areas
from ._unseen_scene import refuse_unseen
from .echo_request import EchoRequest
from .spreading import PER_TILE, Band

NODES = 0.3  # share of a tolerance: largest error of gains interpolated over the band, where there are enough nodes
# share of a tolerance for shadows on rough facets, where they are counted in samples: looks take most of the time. The
# rest of the sum of squares is 0.6, of all parts together, which two taps of range profiles still meet at 1e-2
SHADOWS = 0.8
EDGES = 0.2  # share of a tolerance for edges: they are weaker than facets, which keep 0.98 of it
CUT_PROFILES = 1.5  # error of range profiles of cut facets, over the least of 64 of them: sums are longer than that

# Pieces per facet, over area / edge^2: isosceles right triangles that are bisected until their longest side is shorter
# than the edge have sides of 0.71 to 1 edge
PER_EDGE = 5.5


@dataclass(frozen=True, eq=False)
class SeenScene:
    """A scene as the antennas of all channels see it.

    original  as it was given;  scene  with its random heights;  waveform  over the band of all channels
    margin    m: elements of an array stand up to this far from the antennas
    """

    original: Scene
    scene: Scene
    waveform: Waveform
    antennas: PulseGeometry
    weights: AntennaWeights
    margin: float = 0.0


@dataclass(frozen=True, eq=False)
class ScenePlan:
    """How a scene is prepared for its echoes: all that is known before its facets are cut and illuminated.

    weight_error  of antennas and distances;  error_budget  the share of the tolerance that points have, and facets
    subdivision   how facets are cut, None where there are none;  bands  of all samples that will be asked for
    """

    request: EchoRequest
    seen: SeenScene
    weight_error: WeightError
    error_budget: float
    subdivision: Subdivision | None
    bands: tuple[Band, ...]

    @property
    def n_nodes(self) -> int:
        """Number of frequencies at which the weights of points are computed."""
        return self.weight_error.nodes(NODES * self.error_budget)

    def n_pieces(self) -> tuple[float, float]:
        """About the numbers of pieces of coherent and of other facets."""
        subdivision, facets = self.subdivision, self.seen.scene
        if subdivision is None:
            return 0.0, 0.0
        is_smooth = coherent(facets)
        if not subdivision.cuts:
            return float(is_smooth.sum()), float((~is_smooth).sum())
        edge = np.where(is_smooth, subdivision.plan.max_edge, min(subdivision.cell, subdivision.plan.max_edge))
        pieces = np.maximum(PER_EDGE * areas(facets.triangles) / edge**2, 1.0)
        return float(pieces[is_smooth].sum()), float(pieces[~is_smooth].sum())

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a forecast: those of a report that are known before the scene is prepared."""
        facets = {} if self.subdivision is None else self.subdivision.plan.describe()
        weights = self.seen.weights.describe(self.weight_error)
        return {"model": model_words(self.request), "method": "spread"} | facets | weights


def model_words(request: EchoRequest) -> str:
    """The model in words, for a report."""
    several = f"up to {request.bounces} reflections"
    return "stop and go, " + (several if request.bounces > 1 else "single scattering")


def planned_scene(request: EchoRequest, seen: SeenScene, bands: Iterable[Band]) -> ScenePlan:
    """The plan of a scene.

    ToleranceUnreachable where it cannot meet the tolerance; NothingSeen where bounds prove that no pulse sees it.
    """
    if request.bounces == 1:  # what several facets reflect may arrive from outside the scene's box
        refuse_unseen(seen.scene, seen.weights, seen.waveform, seen.antennas, request.gated, seen.margin)
    error_budget = share_of(request, seen, request.tolerance)
    weight_error = error_of_weights(seen.weights, seen.scene, seen.waveform, request.polarizations, request.vertical)
    bands = tuple(dict.fromkeys(bands))
    return ScenePlan(request, seen, weight_error, error_budget, cut_within(request, seen, weight_error, bands), bands)


def cut_within(
    request: EchoRequest, seen: SeenScene, weight_error: WeightError, bands: tuple[Band, ...]
) -> Subdivision | None:
    """How facets are cut, None where there are none. ToleranceUnreachable in the caller's own numbers."""

    def plan(tolerance: float, max_edge: float | str | None = request.max_edge) -> Subdivision | None:
        return plan_scene(request, seen, weight_error, bands, tolerance, max_edge)

    try:
        return plan(request.tolerance)
    except ToleranceUnreachable as refused:
        scale, remedy = request.tolerance / refused.asked, None
        above = request.tolerance if refused.best is None else max(refused.best * scale, request.tolerance)
        if request.max_edge is None and _meets(lambda: plan(request.tolerance, "auto")):
            remedy = "let echo cut them (max_edge='auto')"
        raise refused.restated(request.tolerance, reachable(plan, above), remedy) from None


def share_of(request: EchoRequest, seen: SeenScene, tolerance: float) -> float:
    """The share of a tolerance that points have, that facets have, and what these reflect to one another, beside those
    of edges and of shadows in samples: their errors are independent."""
    scene, has_facets = seen.scene, len(seen.scene.triangles) > 0
    parts = (len(scene.positions) > 0) + has_facets + (has_facets and request.bounces > 1)
    others = SHADOWS**2 * samples_shadows(request, seen) + EDGES**2 * (request.crease is not None)
    return float(tolerance * np.sqrt((1 - others) / max(parts, 1)))


def samples_shadows(request: EchoRequest, seen: SeenScene) -> bool:
    """Whether shadows on rough facets are counted in samples."""
    return request.shadows and bool(len(seen.scene.triangles)) and _looks(request, seen) > request.limits.few_looks


def _looks(request: EchoRequest, seen: SeenScene) -> float:
    cell = np.inf if request.max_edge is None else cell_edge(seen.waveform)
    return rough_looks(seen.scene, cell, len(seen.antennas))


def with_clipped_shadows(plan: ScenePlan) -> ScenePlan | None:
    """The plan by which lit parts of rough facets are computed, not counted in samples; None where these are too
    many."""
    limits = plan.request.limits
    if _looks(plan.request, plan.seen) > limits.most_looks:
        return None
    request = replace(plan.request, limits=replace(limits, few_looks=np.inf))
    try:
        return planned_scene(request, plan.seen, plan.bands)
    except ToleranceUnreachable:  # the host does not hold the pieces
        return None


def plan_scene(
    request: EchoRequest,
    seen: SeenScene,
    weight_error: WeightError,
    bands: Iterable[Band],
    tolerance: float,
    max_edge: float | str | None,
) -> Subdivision | None:
    """How a scene's facets are cut for `tolerance`, None where there are none.

    ToleranceUnreachable where gains, facets, or samples of one of `bands` exceed their shares of it.
    """
    scene, antennas = seen.scene, seen.antennas
    share, subdivision = share_of(request, seen, tolerance), None
    weight_error.check(share)
    if len(scene.triangles):
        terms = len(antennas) * sum(band.n_samples for band in bands) or np.inf
        profiles = max((CUT_PROFILES * band.least_tolerance(min(PER_TILE), 0.0) for band in bands), default=0.0)
        center, bandwidth = seen.waveform.center, seen.waveform.bandwidth
        shades = request.device if request.shadows else None
        view = FacetView(scene, antennas, center, bandwidth, request.polarizations, request.vertical, shades)
        # lit parts are computed of pieces on the host; without bands nothing is added on a device
        on_device = bands and (not request.shadows or samples_shadows(request, seen))
        device = request.device if on_device else None
        subdivision = plan_cut(
            share, view, weight_error, seen.waveform, max_edge, device, max_bytes=request.host, profiles=profiles,
            terms=terms, most=request.limits.facets, float64_terms=request.limits.float64_terms,
            adds_others=request.bounces > 1,
        )  # fmt: skip
        room = share / subdivision.gain - subdivision.plan.predicted_error
        if not subdivision.plan.is_float64:  # pieces are not counted yet
            _profiles_fit(bands, room, len(scene.triangles) * MOST_FACETS, share / subdivision.gain)
    n_points = len(scene.amplitudes)
    if "zero reflectivity" in request.skips:
        n_points = int(np.count_nonzero(scene.amplitudes))
    if n_points and request.same:
        room = share - weight_error.of(weight_error.nodes(NODES * share), share)
        _profiles_fit(bands, room, n_points, share, LEAST_TOLERANCE)
    return subdivision


def _profiles_fit(bands: Iterable[Band], room: float, n: int, share: float, least: float = 0.0) -> None:
    """ToleranceUnreachable where range profiles of n scatterers need more than `room`, the rest of a share of it."""
    for band in bands:
        error = max(band.least_tolerance(n, room), least)
        if room < error:
            raise ToleranceUnreachable(share, error + (share - room), PROFILES, how="in complex64")


def _meets(plan: Callable[[], object]) -> bool:
    try:
        plan()
    except ToleranceUnreachable:
        return False
    return True
