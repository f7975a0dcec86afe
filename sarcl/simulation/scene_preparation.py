"""A scene cut, culled and illuminated for its echoes, and put on the device."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from ..base.errors import NothingSeen, ToleranceUnreachable, warn
from ..base.report import ErrorTerm
from ..base.tolerances import askable, rounded_up
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import PulseGeometry
from ..scattering.antenna_weight_error import weight_error as error_of_weights
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.facets import FacetSet
from ..scattering.mesh_quality import facet_error, speckle_contrast
from ..scattering.scatterers import facets_of, points_of
from ..scene.scene import Scene
from ._facet_spreading import TiledFacets
from ._point_spreading import tiled_points
from ._unseen_scene import refuse_unseen
from .echo_request import EchoRequest
from .scene_echoes import SceneEchoes
from .scene_plan import SHADOWS, cut_within, parts_of, samples_shadows, share_of
from .spreading import Band

LEAST = 1e-30  # largest amplitude of a scene below which echoes approach the smallest numbers of complex64
LARGEST = 1e30  # amplitude whose sums and spectra still fit in complex64
# Share of a tolerance for what is left out outside the beam: as little as this, since it may be a specular reflection
UNSEEN = 1e-3


def prepare_scene(
    request: EchoRequest, original_scene: Scene, scene: Scene, waveform: Waveform, antennas: PulseGeometry,
    weights: AntennaWeights, bands: Iterable[Band], margin: float = 0.0, tiled: bool = True, exact: bool = True,
) -> SceneEchoes:  # fmt: skip
    """A scene prepared for its echoes.

    original_scene  as it was given;  scene  with its random heights;  waveform  over the band of all channels
    bands           of all samples that will be asked for
    margin          m: elements of an array stand up to this far from the antennas
    tiled           False: no scatterers are put on the device, for callers that do not spread them into range profiles
    exact           False: shadows on facets are shares, by sampled rays
    ToleranceUnreachable where these cannot meet the tolerance; NothingSeen where no scatterer is left.
    """
    refuse_unseen(scene, weights, waveform, antennas, request.gated, margin)
    device, vertical = request.device, request.vertical
    error_budget = share_of(request, scene, waveform, antennas, request.tolerance)
    weight_error = error_of_weights(weights, scene, waveform, request.polarizations, vertical)
    bands = tuple(dict.fromkeys(bands))
    subdivision = cut_within(request, scene, waveform, antennas, weight_error, bands)
    if "out of beam" in request.skips:
        weights = weights.culled(UNSEEN * error_budget / weight_error.peak_to_rms, waveform)
    points, skipped = points_of(scene, request.skips, len(antennas))
    facets, held_points, mesh_warnings = None, None, dict[str, Any]()
    shadow_terms: tuple[ErrorTerm, ...] = ()
    held_facets: tuple[TiledFacets, ...] = ()
    if subdivision is not None:
        facet_plan, pieces = subdivision.apply(scene, request.seed)
        subdivision = replace(subdivision, plan=facet_plan)
        # curves are recognised in facets as they were given, speckle follows from the facets that are added up
        mesh_warnings = _warned(
            facet_error.judge(original_scene, antennas, waveform),
            speckle_contrast.judge(pieces.cells, antennas, waveform),
        )
        request.report("scene", 1, 3)
        facets, left_out = facets_of(
            pieces, waveform, antennas, shadows=request.shadows, skips=request.skips,
            max_bytes=request.budget / 4, device=device, progress=request.report,
            exact=exact and request.shadows, sampled=samples_shadows(request, scene, waveform, antennas),
            accuracy=SHADOWS * request.tolerance / parts_of(scene), margin=margin,
        )  # fmt: skip
        shadow_terms = _shadow_terms(request, scene, facets)
        skipped = {why: skipped.get(why, 0) + n for why, n in left_out.items()}
        if facets is not None and tiled and not facet_plan.is_float64:
            held_facets = tuple(
                TiledFacets(device, part, facet_plan, antennas, waveform, weights, request.polarizations, vertical)
                for part in facets.split()
            )
    if facets is None and points is not None and not request.same:
        raise NothingSeen(
            f"polarization is {request.polarizations}, in which points send back nothing: ask for 'HH' or 'VV', or "
            "give facets"
        )
    if points is None and facets is None:
        reasons = ", ".join(why for why, n in skipped.items() if n) or "the scene is empty"
        raise NothingSeen(f"nothing is left to reflect: {reasons}; move the track or the scene")
    if points is not None:
        bounded(points.largest() * weights.peak)
        weights.check_clearance(points.positions)
        if request.same and tiled:
            held_points = tiled_points(device, points, antennas, waveform, weights)
    request.clock.lap("scene")
    prepared = SceneEchoes(
        request, weights, weight_error, subdivision, points, facets, held_points, held_facets, skipped, mesh_warnings,
        error_budget, shadow_terms, len(antennas),
    )  # fmt: skip
    prepared.check_plans(antennas, bands)
    return prepared


def _shadow_terms(request: EchoRequest, scene: Scene, facets: FacetSet | None) -> tuple[ErrorTerm, ...]:
    """Errors of shadows on rough facets that are counted in samples. ToleranceUnreachable where they exceed their
    share."""
    if facets is None or not facets.samples_incoherent_alone or facets.illumination is None:
        return ()
    share, light = SHADOWS / parts_of(scene), facets.illumination
    if light.error > share * request.tolerance:
        raise ToleranceUnreachable(
            request.tolerance, askable(rounded_up(1.05 * light.reached / share)),
            "shadow edges on rough facets, counted in samples at single pulses",
        )  # fmt: skip
    remedy = "a smaller tolerance: it asks for "
    return (
        ErrorTerm("shadow edges", light.sampling, remedy + "more samples of each facet"),
        ErrorTerm("motion of shadows", light.motion, remedy + "more viewpoints along the track"),
    )


def _warned(*judgements: facet_error.FacetError | speckle_contrast.Speckle) -> dict[str, Any]:
    """Warn of meshes that are too coarse; returns what a report says of them."""
    out: dict[str, Any] = {}
    for judgement in judgements:
        for number, text in enumerate(judgement.warnings()):
            warn(text, f"{type(judgement).__name__} {number}")
        out |= judgement.describe()
    return out


def bounded(largest: float) -> None:
    """ValueError for amplitudes whose largest is too large for complex64, or so small that digits are lost."""
    if 0 < largest < LEAST:
        text = f"amplitudes reach {largest:g}; echoes in complex64 lose digits below {LEAST:g}"
        raise ValueError(text + ": scale them up")
    if largest > LARGEST:
        text = f"amplitudes reach {largest:g}; echoes in complex64 hold up to {LARGEST:g}"
        raise ValueError(text + ": scale them down")
