"""A scene prepared once for its echoes, and the echoes of one channel after another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base.errors import NothingSeen, ToleranceUnreachable, warn
from ..base.report import ErrorTerm, root_sum_square
from ..base.stage_timer import Clock
from ..base.tolerances import askable, reachable, rounded_up
from ..model.waveform import Waveform
from ..numerics.plan import LEAST_TOLERANCE, PROFILES, Plan
from ..numerics.polynomials import chebyshev, lagrange
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scattering.antenna_weight_error import weight_error as error_of_weights
from ..scattering.antenna_weights import AntennaWeights, WeightError
from ..scattering.facet_plan import MOST_FACETS
from ..scattering.facets import FacetSet
from ..scattering.mesh_quality import facet_error, speckle_contrast
from ..scattering.scatterers import Points, facets_of, points_of, samples_shadows
from ..scattering.subdivision import Subdivision, cell_edge, plan_cut
from ..scene.scene import Scene
from ._exact_facets import ExactFacets
from ._facet_spreading import FacetSpreader, TiledFacets
from ._point_spreading import spread_points, tiled_points
from ._unseen_scene import OUTSIDE_BEAM, OUTSIDE_WINDOW, refuse_unseen
from .spreading import PER_TILE, Band, Counts, TiledScatterers

LEAST = 1e-30  # largest amplitude of a scene below which echoes approach the smallest numbers of complex64
LARGEST = 1e30  # amplitude whose sums and spectra still fit in complex64
# Share of a tolerance for what is left out outside the beam: as little as this, since it may be a specular reflection
UNSEEN = 1e-3
NODES = 0.3  # share of a tolerance: largest error of gains interpolated over the band, where there are enough nodes
SHADOWS = 0.6  # share of a tolerance for shadows on rough facets, where they are counted in samples
CUT_PROFILES = 1.5  # error of range profiles of cut facets, over the least of 64 of them: sums are longer than that
SMALLER_TOLERANCE = "a smaller tolerance"  # makes an error term smaller
UNKNOWN_SHADOWS = {"shadow edges": "sampled, not part of the error"}  # for the report
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class EchoRequest:
    """What is asked for, of every channel alike: arguments of `sarcl.echo`, checked.

    tolerance  of each channel;  vertical  (3,);  budget  bytes on the device;  host  bytes for facets that are cut
    """

    device: Device
    tolerance: float
    budget: float
    host: float
    skips: set[str]
    polarizations: tuple[str, ...]
    vertical: np.ndarray
    max_edge: float | str | None
    shadows: bool
    seed: int
    progress: Progress | None
    clock: Clock = field(default_factory=Clock)

    @property
    def same(self) -> list[int]:
        """Indices of the polarisations in which points send something back."""
        return [i for i, name in enumerate(self.polarizations) if name[0] == name[1]]

    @property
    def gated(self) -> bool:
        """Whether scatterers outside the range window are left out."""
        return "range window" in self.skips

    def report(self, stage: str, done: int, total: int) -> None:
        """Call `progress`, where it is given."""
        if self.progress:
            self.progress(stage, done, total)


@dataclass(frozen=True, eq=False)
class SceneEchoes:
    """The points and facets that are left of a scene, prepared for all channels: `prepare_scene` makes it.

    weights, weight_error  of antennas and distances, and their errors
    subdivision            how facets were cut, None where there are none
    points, facets         None where none are left;  tiled_points, tiled_facets  the same on the device, partly lit
                           facets apart from the others
    skipped                pairs of scatterer and pulse that were left out: reason -> count
    mesh_warnings          what a report says of meshes that are too coarse
    error_budget           the share of the tolerance that points have, and facets
    shadow_terms           errors of shadows that are counted in samples, relative to the norm of the facets
    """

    request: EchoRequest
    weights: AntennaWeights
    weight_error: WeightError
    subdivision: Subdivision | None
    points: Points | None
    facets: FacetSet | None
    tiled_points: TiledScatterers | None
    tiled_facets: tuple[TiledFacets, ...]
    skipped: dict[str, int]
    mesh_warnings: dict[str, Any]
    error_budget: float
    shadow_terms: tuple[ErrorTerm, ...]
    n_pulses: int

    def __len__(self) -> int:
        """Number of points and facets."""
        return sum(len(part) for part in (self.points, self.facets) if part is not None)

    @property
    def gain(self) -> float:
        """Norm of the cut facets over that of the facets as they were given, both added with random phases."""
        return 1.0 if self.subdivision is None else self.subdivision.gain

    @property
    def shadow_words(self) -> dict[str, Any]:
        """For the report: number of facets of which some pulse sees a part past the others, and whether shadows are
        sampled."""
        rows = None if self.facets is None else self.facets.lit_rows
        words = {} if rows is None or not (rows >= 0).any() else {"partly lit facets": int((rows >= 0).sum())}
        if self.facets is None or not self.facets.has_sampled_shadows:
            return words
        if not self.facets.samples_incoherent_alone:
            return words | UNKNOWN_SHADOWS
        return words | {"shadow edges": f"sampled, {root_sum_square(self.shadow_terms):.1e}"}

    def by_light(self, antennas: PulseGeometry, waveform: Waveform) -> tuple[FacetSet | None, SceneEchoes | None]:
        """The facets of which all pulses see the same share; and the others alone, on the device. None: there are
        none."""
        if self.facets is None or self.subdivision is None:
            return None, None
        steady, changing = self.facets.steady()
        if changing is None:
            return steady, None
        request, plan = self.request, self.subdivision.plan
        tiled = tuple(
            TiledFacets(
                request.device, part, plan, antennas, waveform, self.weights, request.polarizations, request.vertical
            )
            for part in changing.split()
        )
        alone = replace(self, points=None, facets=changing, tiled_points=None, tiled_facets=tiled, shadow_terms=())
        return steady, alone

    def channel(
        self, antennas: PulseGeometry, waveform: Waveform, frequencies: np.ndarray, first: int = 0
    ) -> ChannelEchoes:
        """The plans for one channel at one receiver. ToleranceUnreachable where there are none.

        antennas  of pulses of the track from `first` on, at the channel's place;  waveform  of the channel
        """
        with self._unreachable_for_the_caller():
            return self._channel(antennas, waveform, frequencies, first)

    def check_plans(self, antennas: PulseGeometry, bands: Iterable[Band]) -> None:
        """ToleranceUnreachable where scatterers lie so evenly that samples of a band cannot meet the tolerance."""
        with self._unreachable_for_the_caller():
            for band in bands:
                if self.tiled_points is not None:
                    self._plan_points(self.tiled_points, antennas, band)
                for tiled in self.tiled_facets:
                    left = self.error_budget / self.gain - tiled.facet_plan.predicted_error
                    tiled.plan(antennas, band, left, least_tolerance=0.0)

    @contextmanager
    def _unreachable_for_the_caller(self) -> Iterator[None]:
        """ToleranceUnreachable names the tolerance of the request, not the share of it that was left to a plan."""
        try:
            yield
        except ToleranceUnreachable as refused:
            raise refused.restated(self.request.tolerance, None, "take a larger tolerance") from None

    def _plan_points(self, points: TiledScatterers, antennas: PulseGeometry, band: Band) -> tuple[Plan, float]:
        """The plan of points, and the error of their weights over the band."""
        error = self.weight_error.of(self.n_nodes, self.error_budget)
        return points.plan(antennas, band, self.error_budget - error), error

    @property
    def n_nodes(self) -> int:
        """Number of frequencies at which the weights of points are computed."""
        return self.weight_error.nodes(NODES * self.error_budget)

    def _channel(
        self, antennas: PulseGeometry, waveform: Waveform, frequencies: np.ndarray, first: int
    ) -> ChannelEchoes:
        request = self.request
        weights = self.weights.at(antennas, slice(first, first + len(antennas)))
        plan, nodes = None, np.zeros(0)
        parts: list[tuple[ErrorTerm, dict[str, Any]]] = []
        spreaders: list[FacetSpreader | ExactFacets] = []
        stop = first + len(antennas)
        if self.points is not None and self.tiled_points is not None and request.same:
            nodes = chebyshev(waveform.center, waveform.bandwidth, self.n_nodes)
            band = Band(len(frequencies), waveform.bandwidth, float(antennas.frequency.mean()))
            plan, error = self._plan_points(self.tiled_points, antennas, band)
            parts.append(
                (ErrorTerm("points", plan.predicted_error + error, SMALLER_TOLERANCE), plan.describe("spread"))
            )
        if self.facets is not None and self.subdivision is not None and self.subdivision.plan.is_float64:
            facets = self.facets if stop - first == self.n_pulses else self.facets.between(first, stop)
            exact = ExactFacets(
                facets, self.subdivision.plan, antennas, frequencies, request.gated, request.polarizations,
                request.vertical, weights,
            )  # fmt: skip
            words = exact.describe() | self.mesh_warnings | self.shadow_words
            parts.append((ErrorTerm("facets", self.gain * exact.predicted_error, SMALLER_TOLERANCE), words))
            spreaders.append(exact)
        spread = []
        for tiled in self.tiled_facets:
            facets = tiled.facets if stop - first == self.n_pulses else tiled.facets.between(first, stop)
            spreader = FacetSpreader(
                tiled, facets, antennas, waveform.bandwidth, frequencies, self.error_budget / self.gain,
                request.budget, request.gated, request.polarizations, request.vertical, weights,
            )  # fmt: skip
            words = spreader.plan.describe("spread") | tiled.facet_plan.describe()
            words |= {"pulses per amplitude": spreader.pulse_nodes.spacing} | self.mesh_warnings | self.shadow_words
            spread.append((self.gain * spreader.predicted_error, words))
            spreaders.append(spreader)
        if spread:  # relative to the norm of the facets that each adds: not more of all of them
            parts.append((ErrorTerm("facets", max(error for error, _ in spread), SMALLER_TOLERANCE), spread[0][1]))
        chosen = max(parts, key=lambda part: part[0].value)[1] if parts else {}
        model = {"model": "stop and go, single scattering"} if parts else {}
        return ChannelEchoes(
            self, antennas, weights, frequencies, plan, nodes, tuple(spreaders),
            (*(term for term, _ in parts), *self.shadow_terms),
            {**model, **chosen, **(self.weights.describe(self.weight_error) if parts else {})},
        )  # fmt: skip

    def check_seen(self, counts: Counts, near: float, far: float) -> None:
        """NothingSeen where nothing at all was added within the range window from near to far, m."""
        if counts.outside_window == counts.pairs:
            raise NothingSeen(OUTSIDE_WINDOW.format(near, far))
        if counts.outside_window + counts.outside_beam == counts.pairs:
            raise NothingSeen(OUTSIDE_BEAM)
        if not counts.contributing:
            raise NothingSeen(
                "every facet in the range window faces away from an antenna; move the track or turn the scene"
            )

    def counted(self, counts: Counts, channels: int = 1) -> dict[str, Any]:
        """Contributions done and skipped, as a report has them."""
        skipped = {why: n * channels for why, n in self.skipped.items()}
        skipped["facing away"] = skipped.get("facing away", 0) + counts.facing_away
        if self.weights.pair is not None:
            skipped["out of beam"] = counts.outside_beam
        return {
            "contributions_done": counts.contributing,
            "contributions_skipped": {**skipped, "range window": counts.outside_window},
        }


@dataclass(frozen=True, eq=False)
class ChannelEchoes:
    """The echoes of a scene in one channel at one receiver, as they are planned.

    weights          as the channel's antennas see the scatterers;  frequencies  Hz, of its samples
    point_plan       with gains at `nodes`, Hz, None where there are no points;  spreaders  of facets
    error_terms      relative, of the channel;  plan  in words, of its part with the largest error
    """

    scene: SceneEchoes
    antennas: PulseGeometry
    weights: AntennaWeights
    frequencies: np.ndarray
    point_plan: Plan | None
    nodes: np.ndarray
    spreaders: tuple[FacetSpreader | ExactFacets, ...]
    error_terms: tuple[ErrorTerm, ...]
    plan: dict[str, Any]

    @property
    def predicted_error(self) -> float:
        """Relative error of the channel."""
        return root_sum_square(self.error_terms)

    def add(self, samples: np.ndarray, pulses: Sequence[int], done: int, total: int) -> Counts:
        """Add sum_k a_k exp(-j 2 pi f (tau_k - tau_ref)) to samples (n, n_polarizations, n_samples), zeros so far.

        pulses  n consecutive pulses of the antennas;  done, total  pairs of scatterer and pulse, for progress
        """
        scene, request, counts = self.scene, self.scene.request, Counts()

        def on_progress(n: int) -> None:
            request.report("echo", done + counts.pairs + n, total)

        on_progress(0)
        if self.point_plan is not None and scene.tiled_points is not None:
            error = scene.weight_error.of(len(self.nodes), scene.error_budget)
            counts = spread_points(
                scene.tiled_points, self.point_plan, self.antennas, self.weights, self.nodes,
                lagrange(self.nodes, self.frequencies), scene.error_budget - error, request.budget, request.gated,
                samples[:, request.same[0]], pulses, request.clock, on_progress,
            )  # fmt: skip
            samples[:, request.same[1:]] = samples[:, request.same[:1]]
        elif scene.points is not None:  # in these polarisations points send nothing back
            counts = Counts(len(scene.points) * len(samples))
        for spreader in self.spreaders:
            counts += spreader.add(samples, pulses, request.clock, on_progress)
        return counts


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
    subdivision = _plan(request, scene, waveform, antennas, weight_error, bands)
    if "out of beam" in request.skips:
        weights = weights.culled(UNSEEN * error_budget / weight_error.peak_to_rms, waveform)
    points, skipped = points_of(scene, request.skips, len(antennas))
    facets, held_points, mesh_warnings = None, None, dict[str, Any]()
    shadow_terms: tuple[ErrorTerm, ...] = ()
    held_facets: tuple[TiledFacets, ...] = ()
    if subdivision is not None:
        facet_plan, pieces = subdivision.apply(scene, request.seed, device if tiled else None)
        subdivision = replace(subdivision, plan=facet_plan)
        cells, represents = pieces.sampled_cells(speckle_contrast.SAMPLED)
        # curves are recognised in facets as they were given, speckle follows from the facets that are added up
        mesh_warnings = _warned(
            facet_error.judge(original_scene, antennas, waveform),
            speckle_contrast.judge(cells, antennas, waveform, represents),
        )
        request.report("scene", 1, 3)
        facets, left_out = facets_of(
            pieces, waveform, antennas, shadows=request.shadows, skips=request.skips,
            max_bytes=request.budget / 4, device=device, progress=request.report,
            exact=exact and request.shadows, sampled=_samples_shadows(request, scene, waveform, antennas),
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


def _plan(
    request: EchoRequest, scene: Scene, waveform: Waveform, antennas: PulseGeometry, weight_error: WeightError,
    bands: Sequence[Band],
) -> Subdivision | None:  # fmt: skip
    """How facets are cut, None where there are none. ToleranceUnreachable in the caller's own numbers."""

    def plan(tolerance: float, max_edge: float | str | None = request.max_edge) -> Subdivision | None:
        return plan_scene(request, scene, waveform, antennas, weight_error, bands, tolerance, max_edge)

    try:
        return plan(request.tolerance)
    except ToleranceUnreachable as refused:
        scale, remedy = request.tolerance / refused.asked, None
        above = request.tolerance if refused.best is None else max(refused.best * scale, request.tolerance)
        if request.max_edge is None and _meets(lambda: plan(request.tolerance, "auto")):
            remedy = "let echo cut them (max_edge='auto')"
        raise refused.restated(request.tolerance, reachable(plan, above), remedy) from None


def parts_of(scene: Scene) -> float:
    """By how much a tolerance is divided among the scene's parts: errors of points and of facets are independent."""
    return float(np.sqrt(2 if len(scene.positions) and len(scene.triangles) else 1))


def share_of(
    request: EchoRequest, scene: Scene, waveform: Waveform, antennas: PulseGeometry, tolerance: float
) -> float:
    """The share of a tolerance that points have, and facets, beside that of shadows that are counted in samples."""
    left = np.sqrt(1 - SHADOWS**2) if _samples_shadows(request, scene, waveform, antennas) else 1.0
    return float(tolerance * left / parts_of(scene))


def _samples_shadows(request: EchoRequest, scene: Scene, waveform: Waveform, antennas: PulseGeometry) -> bool:
    cell = np.inf if request.max_edge is None else cell_edge(waveform)
    return request.shadows and bool(len(scene.triangles)) and samples_shadows(scene, cell, len(antennas))


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


def plan_scene(
    request: EchoRequest, scene: Scene, waveform: Waveform, antennas: PulseGeometry, weight_error: WeightError,
    bands: Iterable[Band], tolerance: float, max_edge: float | str | None,
) -> Subdivision | None:  # fmt: skip
    """How a scene's facets are cut for `tolerance`, None where there are none.

    ToleranceUnreachable where gains, facets, or samples of one of `bands` exceed their shares of it.
    """
    share, made = share_of(request, scene, waveform, antennas, tolerance), None
    weight_error.check(share)
    if len(scene.triangles):
        terms = len(antennas) * sum(band.n_samples for band in bands) or np.inf
        profiles = max((CUT_PROFILES * band.least_tolerance(min(PER_TILE), 0.0) for band in bands), default=0.0)
        made = plan_cut(
            scene, waveform, antennas, request.polarizations, request.vertical, max_edge, share, weight_error,
            request.host, profiles, terms,
        )  # fmt: skip
        left = share / made.gain - made.plan.predicted_error
        if not made.plan.is_float64:  # pieces are not counted yet
            _profiles_fit(bands, left, len(scene.triangles) * MOST_FACETS, share / made.gain)
    n_points = len(scene.amplitudes)
    if "zero reflectivity" in request.skips:
        n_points = int(np.count_nonzero(scene.amplitudes))
    if n_points and request.same:
        left = share - weight_error.of(weight_error.nodes(NODES * share), share)
        _profiles_fit(bands, left, n_points, share, LEAST_TOLERANCE)
    return made


def _profiles_fit(bands: Iterable[Band], left: float, n: int, share: float, least: float = 0.0) -> None:
    """ToleranceUnreachable where range profiles of n scatterers need more than is `left` of a share of it."""
    for band in bands:
        needed = max(band.least_tolerance(n, left), least)
        if left < needed:
            raise ToleranceUnreachable(share, needed + (share - left), PROFILES, how="in complex64")


def _meets(plan: Callable[[], object]) -> bool:
    try:
        plan()
    except ToleranceUnreachable:
        return False
    return True


def band_of(waveform: Waveform, center: float, bandwidth: float) -> Waveform:
    """A waveform over the bands of all channels, of the same duration."""
    return Waveform.chirp(center=center, bandwidth=bandwidth, duration=waveform.duration)


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
