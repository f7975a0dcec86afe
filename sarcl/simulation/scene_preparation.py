"""A scene cut, culled and illuminated for its echoes, and put on the device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..base.errors import NothingSeen, ToleranceUnreachable, warn
from ..base.report import ErrorTerm
from ..base.tolerances import askable, rounded_up
from ..scattering import facing_corners
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.facet_shadows import ShadowRule
from ..scattering.facets import FacetSet
from ..scattering.facing_corners import FacingCorners
from ..scattering.mesh_quality import facet_error, post_spacing, speckle_contrast
from ..scattering.mesh_quality.facet_error import FacetError
from ..scattering.mesh_quality.post_spacing import PostSpacing
from ..scattering.mesh_quality.speckle_contrast import Speckle
from ..scattering.rough_pieces import PIECE_BYTES, RoughFacets
from ..scattering.scatterers import Points, facets_of, points_of
from ..scattering.subdivision import Subdivision
from .bounces.bounce_spreader import BounceScene
from .echo_request import EchoRequest
from .edges.edge_echoes import PreparedEdges
from .facets.facet_spreading import TiledFacets
from .facets.facets_behind_sheets import FacetsBehindSheets
from .points.point_plan import PreparedPoints
from .scene_echoes import SceneEchoes
from .scene_plan import SHADOWS, ScenePlan, samples_shadows, with_clipped_shadows

LEAST = 1e-30  # largest amplitude of a scene below which echoes approach the smallest numbers of complex64
LARGEST = 1e30  # amplitude whose sums and spectra still fit in complex64
# Share of a tolerance for what is left out outside the beam: as little as this, since it may be a specular reflection
UNSEEN = 1e-3


def prepare_scene(plan: ScenePlan, *, tiled: bool = True, exact: bool = True) -> SceneEchoes:
    """A scene prepared for its echoes as it was planned.

    tiled  False: no scatterers are put on the device, for callers that do not spread them into range profiles
    exact  False: shadows on facets are shares, by sampled rays
    ToleranceUnreachable where these cannot meet the tolerance, and the pieces are too many to be clipped; NothingSeen
    where no scatterer is left.
    """
    try:
        return _prepared(plan, tiled=tiled, exact=exact)
    except _TooFewSamples:
        clipped = with_clipped_shadows(plan) if exact else None
        if clipped is None:
            raise
    return _prepared(clipped, tiled=tiled, exact=exact)


class _TooFewSamples(ToleranceUnreachable):
    """Shadows that are counted in samples do not meet the tolerance."""


def _prepared(plan: ScenePlan, *, tiled: bool, exact: bool) -> SceneEchoes:
    """As `prepare_scene`, with shadows as they are planned."""
    request, seen, weights = plan.request, plan.seen, plan.seen.weights
    if "out of beam" in request.skips:
        weights = weights.culled(UNSEEN * plan.error_budget / plan.weight_error.peak_to_rms, seen.waveform)
    points, skipped = points_of(seen.scene, request.skips, len(seen.antennas))
    facets, subdivision, mesh_warnings = tuple[FacetSet, ...](), plan.subdivision, dict[str, Any]()
    behind: FacetsBehindSheets | None = None
    if subdivision is not None:
        subdivision, cut = subdivision.apply(seen.scene, request.seed)
        cells, represents = cut.sampled_cells(speckle_contrast.SAMPLED)
        # curves are recognised in facets as they were given, speckle follows from the facets that are added up
        speckle = speckle_contrast.judge(cells, seen.antennas, seen.waveform, represents)
        mesh_warnings = warn_of_shapes(plan) | _warned(speckle)
        request.report("scene", 1, 3)
        shadows = ShadowRule(
            exact=exact,
            sampled=samples_shadows(request, seen),
            accuracy=SHADOWS * request.tolerance,
            max_bytes=request.budget / 4,
            margin=seen.margin,
            host=request.host,
        )
        facets, left_out = facets_of(
            cut,
            seen.antennas,
            shadows=shadows if request.shadows else None,
            skips=request.skips,
            device=request.device,
            progress=request.report,
        )
        skipped = {why: skipped.get(why, 0) + n for why, n in left_out.items()}
        behind = FacetsBehindSheets.of(request, seen, cut.host, subdivision.plan, plan.error_budget)
        if behind is not None:
            skipped["shadowed"] -= behind.n_dark * len(seen.antennas)
    bounced = bounced_facets(plan)
    if bounced is None and behind is None:
        _check_left(request, points, facets, skipped)
    if points is not None:
        bounded(points.largest() * weights.peak)
        weights.check_clearance(points.positions)
    prepared = SceneEchoes(
        request=request,
        weights=weights,
        weight_error=plan.weight_error,
        subdivision=subdivision,
        points=points,
        facets=facets,
        prepared_points=_prepared_points(plan, points, weights) if tiled else None,
        tiled_facets=_tiled_facets(plan, subdivision, facets, weights) if tiled else (),
        skipped=skipped,
        mesh_warnings=mesh_warnings,
        error_budget=plan.error_budget,
        shadow_terms=_shadow_terms(request, facets),
        bounced=bounced,
        behind_sheets=behind,
        n_pulses=len(seen.antennas),
        edges=PreparedEdges.of(request, seen),
    )
    request.clock.lap("scene")
    prepared.check_plans(seen.antennas, plan.bands)
    return prepared


def bounced_facets(plan: ScenePlan) -> BounceScene | None:
    """Facets of several reflections, None where only single ones are asked for. MemoryError for too many ways."""
    request, seen = plan.request, plan.seen
    highest = seen.waveform.center + seen.waveform.bandwidth / 2
    bounced = BounceScene.of(seen.scene, request.bounces, plan.error_budget, highest, request.host)
    if bounced is not None:
        bounced.refuse_many(seen.antennas.tx, seen.antennas.rx)
    return bounced


def _check_left(
    request: EchoRequest, points: Points | None, facets: Sequence[FacetSet], skipped: dict[str, int]
) -> None:
    """NothingSeen where no scatterer is left that sends something back."""
    if not facets and points is not None and not request.same:
        raise NothingSeen(
            f"polarization is {request.polarizations}, in which points send back nothing: ask for 'HH' or 'VV', or "
            "give facets"
        )
    if points is None and not facets:
        reasons = ", ".join(why for why, n in skipped.items() if n) or "the scene is empty"
        raise NothingSeen(f"nothing is left to reflect: {reasons}; move the track or the scene")


def _prepared_points(plan: ScenePlan, points: Points | None, weights: AntennaWeights) -> PreparedPoints | None:
    """Points with what the plans of all channels share, where any send something back."""
    request, seen = plan.request, plan.seen
    if points is None or not request.same:
        return None
    return PreparedPoints(request.device, points, seen.antennas, seen.waveform, weights, request.method)


def _tiled_facets(
    plan: ScenePlan, subdivision: Subdivision | None, facets: Sequence[FacetSet], weights: AntennaWeights
) -> tuple[TiledFacets, ...]:
    """Facets in tiles on the device, partly lit ones apart from the others; none where their sums are in float64."""
    if subdivision is None or subdivision.plan.is_float64:
        return ()
    seen = plan.seen
    n_rough = sum(len(part) for part in facets if isinstance(part, RoughFacets))
    stays = PIECE_BYTES * n_rough <= plan.request.limits.kept_pieces * plan.request.budget
    return tuple(
        TiledFacets(plan.request, some, subdivision.plan_of(some), seen.antennas, seen.waveform, weights, stays=stays)
        for part in facets
        for some in part.split()
    )


def _shadow_terms(request: EchoRequest, facets: Sequence[FacetSet]) -> tuple[ErrorTerm, ...]:
    """Errors of shadows on rough facets that are counted in samples. ToleranceUnreachable where they exceed their
    share."""
    lights = [part.illumination for part in facets if part.illumination is not None and part.samples_incoherent_alone]
    if not lights:
        return ()
    light = lights[0]  # one for all
    if light.error > SHADOWS * request.tolerance:
        raise _TooFewSamples(
            request.tolerance,
            askable(rounded_up(1.05 * light.reached / SHADOWS)),
            "shadow edges on rough facets, counted in samples at single pulses",
        )
    remedy = "a smaller tolerance: it asks for "
    return (
        ErrorTerm("shadow edges", light.sampling, remedy + "more samples of each facet"),
        ErrorTerm("motion of shadows", light.motion, remedy + "more viewpoints along the track"),
    )


def warn_of_shapes(plan: ScenePlan) -> dict[str, Any]:
    """Warn of posts that an image resolves, of facets too large for the curves that they approximate, and of right
    angles whose reflections are not followed; returns what a report says of them."""
    if plan.subdivision is None:
        return {}
    seen = plan.seen
    _warned(post_spacing.judge(seen.original, seen.antennas, seen.waveform))
    words = _warned(facet_error.judge(seen.original, seen.antennas, seen.waveform))
    if plan.request.bounces > 1:
        return words
    return words | _warned(facing_corners.judge(seen.original, seen.antennas, seen.waveform))


def _warned(judgement: FacetError | PostSpacing | Speckle | FacingCorners) -> dict[str, Any]:
    for number, text in enumerate(judgement.warnings()):
        warn(text, f"{type(judgement).__name__} {number}")
    return judgement.describe()


def bounded(largest: float) -> None:
    """ValueError for amplitudes whose largest is too large for complex64, or so small that digits are lost."""
    if 0 < largest < LEAST:
        text = f"amplitudes reach {largest:g}; echoes in complex64 lose digits below {LEAST:g}"
        raise ValueError(text + ": scale them up")
    if largest > LARGEST:
        text = f"amplitudes reach {largest:g}; echoes in complex64 hold up to {LARGEST:g}"
        raise ValueError(text + ": scale them down")
