"""A scene prepared once for its echoes, and the echoes of one channel after another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base.errors import NotApplicable, NothingSeen, ToleranceUnreachable
from ..base.report import SMALLER_TOLERANCE, ErrorTerm, root_sum_square
from ..model.waveform import Waveform
from ..numerics.polynomials import chebyshev
from ..numerics.pulse_geometry import PulseGeometry
from ..scattering.antenna_weights import AntennaWeights, WeightError
from ..scattering.facets import FacetSet
from ..scattering.scatterers import Points
from ..scattering.subdivision import Subdivision
from ._unseen_scene import OUTSIDE_BEAM, OUTSIDE_WINDOW
from .bounces.bounce_spreader import BounceScene, BounceSpreader
from .echo_request import EchoRequest
from .edges.edge_echoes import EdgeEchoes, PreparedEdges
from .facets.exact_facets import ExactFacets
from .facets.facet_method import facet_echoes
from .facets.facet_spreading import FacetSpreader, TiledFacets
from .facets.facets_behind_sheets import FacetsBehindSheets, SheetEchoes
from .facets.window_edges import WindowEdges
from .factorized.spreader import FactorizedSpreader
from .points.direct import PointSpreader
from .points.point_plan import PointPlan, PreparedPoints
from .scene_plan import NODES, model_words
from .spreading import Band, ChannelView, Counts

Spreader = FacetSpreader | ExactFacets | FactorizedSpreader | BounceSpreader | EdgeEchoes | SheetEchoes | WindowEdges
UNKNOWN_SHADOWS = {"shadow edges": "sampled, not part of the error"}  # for the report


@dataclass(frozen=True, eq=False)
class SceneEchoes:
    """The points and facets that are left of a scene, prepared for all channels: `prepare_scene` makes it.

    weights, weight_error  of antennas and distances, and their errors
    subdivision            how facets were cut, None where there are none
    points                 None where none are left;  facets  sets: those that a device cut, and those of the host
    prepared_points, tiled_facets  the same as channels plan them: facets on the device, partly lit ones apart from the
                           others
    skipped                pairs of scatterer and pulse that were left out: reason -> count
    mesh_warnings          what a report says of meshes that are too coarse
    error_budget           the share of the tolerance that points have, and facets
    shadow_terms           errors of shadows that are counted in samples, relative to the norm of the facets
    edges                  edges that diffract, None where none are asked for
    bounced                facets that reflect to one another, None where a single reflection counts
    behind_sheets          facets that are seen through thin sheets, None where none are
    """

    request: EchoRequest
    weights: AntennaWeights
    weight_error: WeightError
    subdivision: Subdivision | None
    points: Points | None
    facets: tuple[FacetSet, ...]
    prepared_points: PreparedPoints | None
    tiled_facets: tuple[TiledFacets, ...]
    skipped: dict[str, int]
    mesh_warnings: dict[str, Any]
    error_budget: float
    shadow_terms: tuple[ErrorTerm, ...]
    n_pulses: int
    edges: PreparedEdges | None = None
    bounced: BounceScene | None = None
    behind_sheets: FacetsBehindSheets | None = None

    def __len__(self) -> int:
        """Number of points, facets, pieces of edges and facets that are seen through sheets."""
        parts = (self.points, *self.facets, self.edges, self.behind_sheets)
        return sum(len(part) for part in parts if part is not None)

    @property
    def shadow_words(self) -> dict[str, Any]:
        """For the report: number of facets of which some pulse sees a part past the others, and whether shadows are
        sampled."""
        partly = sum(part.n_partly_lit for part in self.facets)
        words: dict[str, Any] = {"partly lit facets": partly} if partly else {}
        sampled = [part for part in self.facets if part.has_sampled_shadows]
        if not sampled:
            return words
        if not all(part.samples_incoherent_alone for part in sampled):
            return words | UNKNOWN_SHADOWS
        return words | {"shadow edges": f"sampled, {root_sum_square(self.shadow_terms):.1e}"}

    def by_light(self, antennas: PulseGeometry, waveform: Waveform) -> tuple[FacetSet | None, SceneEchoes | None]:
        """The facets of which all pulses see the same share; and the others alone, on the device. None: there are
        none."""
        if not self.facets or self.subdivision is None:
            return None, None
        (facets,) = self.facets  # no device has cut any
        steady, changing = facets.steady()
        if changing is None:
            return steady, None
        tiled = tuple(
            TiledFacets(self.request, part, self.subdivision.plan, antennas, waveform, self.weights)
            for part in changing.split()
        )
        alone = replace(
            self, points=None, facets=(changing,), prepared_points=None, tiled_facets=tiled, shadow_terms=()
        )
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
                if self.prepared_points is not None:
                    self._plan_points(self.prepared_points, self.weights.at(antennas), band)
                for tiled in self.tiled_facets:
                    left = self.error_budget / tiled.facet_plan.gain - tiled.facet_plan.predicted_error
                    tiled.plan(antennas, band, left, least_tolerance=0.0)

    @contextmanager
    def _unreachable_for_the_caller(self) -> Iterator[None]:
        """ToleranceUnreachable names the tolerance of the request, not the share of it that was left to a plan."""
        try:
            yield
        except ToleranceUnreachable as refused:
            raise refused.restated(self.request.tolerance, None, "take a larger tolerance") from None

    def _plan_points(self, points: PreparedPoints, weights: AntennaWeights, band: Band) -> tuple[PointPlan, float]:
        """The plan of points, and the error of their weights over the band."""
        error = self.weight_error.of(self.n_nodes, self.error_budget)
        return points.plan(weights, band, self.error_budget - error, self.n_nodes), error

    @property
    def n_nodes(self) -> int:
        """Number of frequencies at which the weights of points are computed."""
        return self.weight_error.nodes(NODES * self.error_budget)

    def _channel(
        self, antennas: PulseGeometry, waveform: Waveform, frequencies: np.ndarray, first: int
    ) -> ChannelEchoes:
        request = self.request
        weights = self.weights.at(antennas, slice(first, first + len(antennas)))
        view = ChannelView(
            antennas, weights, frequencies, waveform.bandwidth, request.polarizations, request.vertical, request.gated
        )
        points: PointSpreader | None = None
        parts: list[tuple[ErrorTerm, dict[str, Any]]] = []
        spreaders: list[Spreader] = []
        stop, reason = first + len(antennas), ""
        if self.points is not None and self.prepared_points is not None and request.same:
            nodes = chebyshev(waveform.center, waveform.bandwidth, self.n_nodes)
            plan, error = self._plan_points(self.prepared_points, weights, view.band)
            tolerance = self.error_budget - error
            points = plan.direct_spreader(view, nodes, tolerance, request.budget)
            leveled = plan.factorized_spreader(request.device, self.points, view, nodes, request.same, request.budget)
            spreaders += [] if leveled is None else [leveled]
            parts.append((ErrorTerm("points", plan.predicted_error + error, SMALLER_TOLERANCE), plan.describe()))
        on_host, of_host = self._facets_on_host(view, first)
        spreaders += on_host
        parts += of_host
        spread = []
        for tiled in self.tiled_facets:
            gain, facets = tiled.facet_plan.gain, tiled.facets.within(first, stop, self.n_pulses)
            share = self.error_budget / gain
            echoes = facet_echoes(tiled, facets, view, share, request.budget, method=request.method)
            words = echoes.words | (self.subdivision.plan.describe() if self.subdivision else {})
            spread.append((gain * echoes.error, words | self.mesh_warnings | self.shadow_words))
            spreaders += echoes.spreaders
            reason = reason or echoes.reason
        by_levels = any(isinstance(one, FactorizedSpreader) for one in spreaders)
        if request.method == "factorized" and not by_levels:
            text = reason or "few facets in few samples are added up in float64"
            raise NotApplicable(f'method="factorized" is not possible: {text}; pass method="auto"')
        if spread:  # relative to the norm of the facets that each adds: not more of all of them
            parts.append((ErrorTerm("facets", max(error for error, _ in spread), SMALLER_TOLERANCE), spread[0][1]))
        spreaders += self.window_edges(view, first)
        if self.edges is not None:
            edges = EdgeEchoes(self.edges, view)
            spreaders.append(edges)
        if self.bounced is not None:
            bounces = BounceSpreader(self.bounced, view, None if self.edges is None else self.edges.pieces.wedges)
            spreaders.append(bounces)
            parts.append((ErrorTerm("bounces", self.bounced.tolerance, SMALLER_TOLERANCE), bounces.describe()))
        chosen = max(parts, key=lambda part: (bool(part[1]), part[0].value))[1] if parts else {}
        model = {"model": model_words(request)} if parts else {}
        words = {**model, **chosen, **(self.weights.describe(self.weight_error) if parts else {})}
        error_terms = *(term for term, _ in parts), *self.shadow_terms
        if self.edges is not None:
            words |= edges.describe()
            error_terms = *error_terms, ErrorTerm("edges", self.edges.error, SMALLER_TOLERANCE)
        return ChannelEchoes(self, points, tuple(spreaders), error_terms, words)

    def window_edges(self, view: ChannelView, first: int = 0) -> list[WindowEdges]:
        """Coherent facets where edges of the range window cross them."""
        parts = (part.within(first, first + len(view.antennas), self.n_pulses) for part in self.facets)
        return [WindowEdges(part, view) for part in parts if part.is_mirror and not part.is_incoherent.all()]

    def _facets_on_host(
        self, view: ChannelView, first: int
    ) -> tuple[list[Spreader], list[tuple[ErrorTerm, dict[str, Any]]]]:
        """Facets that are added in float64, those seen through thin sheets first; their error terms and words."""
        spreaders, parts, hidden, seen_through = list[Spreader](), [], 0.0, dict[str, Any]()
        if self.behind_sheets is not None:
            behind = SheetEchoes(self.behind_sheets, view, first)
            spreaders.append(behind)
            hidden, seen_through = self.behind_sheets.error, behind.describe()
            if not self.facets:
                parts.append((ErrorTerm("facets", hidden, SMALLER_TOLERANCE), seen_through | self.mesh_warnings))
        if self.subdivision is not None and self.subdivision.plan.is_float64:
            for facets in self.facets:
                some = facets.within(first, first + len(view.antennas), self.n_pulses)
                exact = ExactFacets(some, self.subdivision.plan, view)
                words = exact.describe() | self.mesh_warnings | self.shadow_words | seen_through
                # each relative to the norm of the facets that it adds: not more of all of them
                error = max(self.subdivision.plan.gain * exact.predicted_error, hidden)
                parts.append((ErrorTerm("facets", error, SMALLER_TOLERANCE), words))
                spreaders.append(exact)
        return spreaders, parts

    def check_seen(self, counts: Counts, near: float, far: float) -> None:
        """NothingSeen where nothing at all was added within the range window from near to far, m."""
        counts = replace(counts, pairs=counts.pairs - counts.unseen - counts.weak, unseen=0, weak=0)
        if 0 < counts.outside_window == counts.pairs:
            raise NothingSeen(OUTSIDE_WINDOW.format(near, far))
        if 0 < counts.outside_window + counts.outside_beam == counts.pairs:
            raise NothingSeen(OUTSIDE_BEAM)
        if not counts.contributing:
            raise NothingSeen(
                "every facet in the range window faces away from an antenna; move the track or turn the scene"
            )
        if self.subdivision is not None and self.subdivision.plan.is_dark and not any(counts.orders[1:]):
            names = self.request.polarizations
            raise NothingSeen(
                f"polarization is {', '.join(names)}, in which single reflections of these facets are rounding alone, "
                f"and no wave of several arrives: ask for {('HH', *names)}"
            )

    def counted(self, counts: Counts, channels: int = 1) -> dict[str, Any]:
        """Contributions done and skipped, as a report has them."""
        skipped = {why: n * channels for why, n in self.skipped.items()}
        skipped["facing away"] = skipped.get("facing away", 0) + counts.facing_away
        if self.weights.pair is not None:
            skipped["out of beam"] = counts.outside_beam
        if self.bounced is not None:
            skipped["no reflection from facet to facet"] = counts.unseen
            skipped["weak reflections"] = counts.weak
        return {
            "contributions_done": counts.contributing,
            "contributions_skipped": {**skipped, "range window": counts.outside_window},
        }


@dataclass(frozen=True, eq=False)
class ChannelEchoes:
    """The echoes of a scene in one channel at one receiver, as they are planned.

    points, spreaders  what adds points at each pulse, None where there are none; and what adds other scatterers
    error_terms      relative, of the channel;  plan  in words, of its part with the largest error
    """

    scene: SceneEchoes
    points: PointSpreader | None
    spreaders: tuple[Spreader, ...]
    error_terms: tuple[ErrorTerm, ...]
    plan: dict[str, Any]

    @property
    def predicted_error(self) -> float:
        """Relative error of the channel."""
        return root_sum_square(self.error_terms)

    def of(self, scene: SceneEchoes) -> ChannelEchoes:
        """The same for another request for the scene, without what is kept on the device from call to call."""
        spreaders = (replace(one) if isinstance(one, FactorizedSpreader) else one for one in self.spreaders)
        return replace(self, scene=scene, spreaders=tuple(spreaders))

    def apart(self) -> tuple[ChannelEchoes, list[FactorizedSpreader]]:
        """The echoes that are added pulse by pulse, and what adds the others, by levels for the whole track."""
        by_levels = [spreader for spreader in self.spreaders if isinstance(spreader, FactorizedSpreader)]
        rest = tuple(one for one in self.spreaders if not isinstance(one, FactorizedSpreader))
        return replace(self, spreaders=rest), by_levels

    def add(self, samples: np.ndarray, pulses: Sequence[int], done: int, total: int) -> Counts:
        """Add sum_k a_k exp(-j 2 pi f (tau_k - tau_ref)) to samples (n, n_polarizations, n_samples), zeros so far.

        pulses  n consecutive pulses of the antennas;  done, total  pairs of scatterer and pulse, for progress
        """
        scene, request, counts = self.scene, self.scene.request, Counts()

        def on_progress(n: int) -> None:
            request.report("echo", done + counts.pairs + n, total)

        on_progress(0)
        if self.points is not None:
            counts += self.points.add(samples[:, request.same[0]], pulses, request.clock, on_progress)
            samples[:, request.same[1:]] = samples[:, request.same[:1]]
        elif scene.points is not None and not request.same:  # in these polarisations points send nothing back
            counts = Counts(len(scene.points) * len(samples))
        for spreader in self.spreaders:
            counts += spreader.add(samples, pulses, request.clock, on_progress)
        return counts


@dataclass(frozen=True)
class Added:
    """Echoes that were added to samples: terms of the largest predicted error, the plan of the last channel, counts.

    It is the tally of a block (blocks.bands.Tally): mappings become objects again.
    """

    error_terms: tuple[ErrorTerm, ...] = ()
    plan: dict[str, Any] = field(default_factory=dict)
    counts: Counts = field(default_factory=Counts)

    def __post_init__(self) -> None:
        terms = tuple(ErrorTerm(**term) if isinstance(term, Mapping) else term for term in self.error_terms)
        object.__setattr__(self, "error_terms", terms)
        if isinstance(self.counts, Mapping):
            object.__setattr__(self, "counts", Counts(**self.counts))

    @property
    def predicted_error(self) -> float:
        """The largest of all channels."""
        return root_sum_square(self.error_terms)

    def __add__(self, other: Added) -> Added:
        worst = max(self.error_terms, other.error_terms, key=root_sum_square)
        return Added(worst, other.plan or self.plan, self.counts + other.counts)


def band_of(waveform: Waveform, center: float, bandwidth: float) -> Waveform:
    """A waveform over the bands of all channels, of the same duration."""
    return Waveform.chirp(center=center, bandwidth=bandwidth, duration=waveform.duration)
