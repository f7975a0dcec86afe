"""A scene made ready once, and its echoes added to the samples of one channel after another."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.errors import NothingSeen, ToleranceUnreachable, warn
from ..base.stage_timer import Clock
from ..base.tolerances import reachable
from ..model.waveform import Waveform
from ..numerics.plan import LEAST_TOLERANCE, PROFILES
from ..numerics.polynomials import chebyshev, lagrange
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scattering.antenna_weight_error import weight_error
from ..scattering.antenna_weights import AntennaWeights, WeightError
from ..scattering.facet_plan import MOST_FACETS, FacetPlan
from ..scattering.facets import Facets
from ..scattering.mesh_quality import facet_error, speckle_contrast
from ..scattering.scatterers import Points, facets_of, points_of
from ..scattering.subdivision import Cut, plan_cut
from ..scene.scene import Scene
from ._echo_check import exact_samples, how_many, measure_error
from ._facet_spreading import FacetSpreader
from ._point_spreading import Spreader
from .spreading import Band

LARGEST = 1e30  # amplitude whose sums and spectra still fit in complex64
UNSEEN = 1e-3  # of a tolerance: what the beam may leave out of it. So little, since what is left out may be specular
NODES = 0.3  # of a tolerance: the most that gains at nodes over the band may err, where there are enough nodes
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Order:
    """What is asked for, of every channel alike: arguments of `sarcl.echo`, checked.

    tolerance  of each channel;  vertical  (3,);  budget  bytes on the device
    """

    device: Device
    tolerance: float
    budget: float
    skips: set[str]
    polarizations: tuple[str, ...]
    vertical: np.ndarray
    max_edge: float | str | None
    shadows: bool | str
    seed: int
    progress: Progress | None
    clock: Clock = field(default_factory=Clock)

    @property
    def same(self) -> list[int]:
        """Polarisations in which points send something back."""
        return [i for i, name in enumerate(self.polarizations) if name[0] == name[1]]


class Work:
    """The points and facets that are left of a scene, how they are computed, and what has been added so far.

    order     what is asked for;  weights, blur  gains of antennas and what they err
    plans     of parts of the last channel: (predicted error, words);  counts of pairs of scatterer and pulse
    """

    points: Points | None
    facets: Facets | None

    def __init__(
        self, order: Order, given: Scene, scene: Scene, waveform: Waveform, antennas: PulseGeometry,
        weights: AntennaWeights, bands: Iterable[Band],
    ) -> None:  # fmt: skip
        """given  the scene as it came;  scene  with its random heights;  waveform  over the whole band
        bands  of all samples that will be asked for: whether the tolerance can be met is known before the work starts

        ToleranceUnreachable where it cannot; NothingSeen where no scatterer is left.
        """
        self.order, self.waveform = order, waveform
        self.share = order.tolerance / parts_of(scene)
        self.blur: WeightError = weight_error(weights, scene, waveform, order.polarizations, order.vertical)
        planned = self._planned(scene, antennas, bands)
        if "out of beam" in order.skips:
            weights = weights.culled(UNSEEN * self.share / self.blur.peak_to_rms, waveform)
        self.weights, self.n_pulses = weights, len(antennas.tx)
        self.points, self.skipped = points_of(scene, order.skips, self.n_pulses)
        self.facets, self.judged = None, dict[str, Any]()
        if planned is not None:
            self._ready(given, scene, antennas, planned)
        if self.facets is None and self.points is not None and not order.same:
            raise NothingSeen(
                f"polarization is {order.polarizations}, in which points send back nothing: ask for 'HH' or 'VV', or "
                "give facets"
            )
        if self.points is None and self.facets is None:
            reasons = ", ".join(why for why, n in self.skipped.items() if n) or "the scene is empty"
            raise NothingSeen(f"nothing is left to reflect: {reasons}; move the track or the scene")
        if self.points is not None:
            bounded(self.points.largest() * weights.peak)
            weights.check_clearance(self.points.positions)
        self.plans: list[tuple[float, dict[str, Any]]] = []
        self.pairs = self.gated = self.behind = self.unlit = 0
        order.clock.lap("scene")

    def _planned(self, scene: Scene, antennas: PulseGeometry, bands: Iterable[Band]) -> Cut | None:
        """How facets are cut, None where there are none. ToleranceUnreachable in the caller's own numbers."""
        order, bands = self.order, tuple(dict.fromkeys(bands))

        def plan(tolerance: float, max_edge: float | str | None = order.max_edge) -> Cut | None:
            return plan_scene(order, scene, self.waveform, antennas, self.blur, bands, tolerance, max_edge)

        try:
            return plan(order.tolerance)
        except ToleranceUnreachable as refused:
            scale, remedy = order.tolerance / refused.asked, None
            above = order.tolerance if refused.best is None else max(refused.best * scale, order.tolerance)
            if order.max_edge is None and _meets(lambda: plan(order.tolerance, "auto")):
                remedy = "let echo cut them (max_edge='auto')"
            raise refused.restated(order.tolerance, reachable(plan, above), remedy) from None

    def _ready(self, given: Scene, scene: Scene, antennas: PulseGeometry, planned: Cut) -> None:
        """Facets cut, culled and lit."""
        order = self.order
        self.facet_plan: FacetPlan
        self.facet_plan, pieces = planned.made(scene)
        self.crowd = planned.crowd
        # curves are told from facets as they came, speckle from what is added up
        self.judged = _warned(
            facet_error.judge(given, antennas, self.waveform), speckle_contrast.judge(pieces, antennas, self.waveform)
        )
        tell = order.progress
        if tell:
            tell("scene", 1, 3)
        self.facets, left_out = facets_of(
            pieces, self.waveform, antennas, shadows=order.shadows, seed=order.seed, skips=order.skips,
            max_bytes=order.budget / 4, device=order.device,
            tell=(lambda n: None) if tell is None else lambda n: tell("scene", n, 3),
        )  # fmt: skip
        self.skipped = {why: self.skipped.get(why, 0) + n for why, n in left_out.items()}

    @property
    def scatterers(self) -> int:
        """Points and facets."""
        return sum(len(part) for part in (self.points, self.facets) if part is not None)

    def add(
        self, antennas: PulseGeometry, waveform: Waveform, frequencies: np.ndarray, samples: np.ndarray, total: int,
        first: int = 0,
    ) -> None:  # fmt: skip
        """Add sum_k a_k exp(-j 2 pi f (tau_k - tau_ref)) to samples (n, n_polarizations, n_samples), zeros so far.

        antennas  of n pulses of the track from `first` on, at the channel's place;  waveform  of the channel
        total     pairs of scatterer, pulse and channel, for progress
        """
        order, clock, done = self.order, self.order.clock, self.pairs
        weights = self.weights.at(antennas, slice(first, first + len(antennas)))
        facets = self.facets
        if facets is not None and len(samples) < self.n_pulses:
            facets = facets.between(first, first + len(samples))

        def tell(n: int) -> None:
            if order.progress:
                order.progress("echo", done + n, total)

        tell(0)
        self.plans, gate, added = [], "range window" in order.skips, 0
        if self.points is not None:
            if order.same:
                nodes = chebyshev(waveform.center, waveform.bandwidth, self.blur.nodes(NODES * self.share))
                error = self.blur.of(len(nodes), self.share)
                spreader = Spreader(
                    order.device, antennas, waveform.bandwidth, len(frequencies), self.share - error, order.budget,
                    gate, weights, lagrange(nodes, frequencies), nodes,
                )  # fmt: skip
                plan, outside, dark = spreader.add(self.points, samples[:, order.same[0]], clock, tell)
                self.gated, self.unlit = self.gated + outside, self.unlit + dark
                samples[:, order.same[1:]] = samples[:, order.same[:1]]
                self.plans.append((plan.predicted_error + error, plan.describe("spread")))
            added = len(self.points) * len(samples)
            done += added
        if facets is not None:
            facet_spreader = FacetSpreader(
                order.device, antennas, waveform.bandwidth, frequencies, self.share / self.crowd, order.budget, gate,
                order.polarizations, self.facet_plan, order.vertical, weights,
            )  # fmt: skip
            plan, knots, outside, behind, dark = facet_spreader.add(facets, samples, clock, tell)
            self.gated, self.behind, self.unlit = self.gated + outside, self.behind + behind, self.unlit + dark
            how = plan.describe("spread") | self.facet_plan.describe()
            how |= {"pulses an amplitude": knots.spacing} | self.judged
            error = plan.predicted_error + self.facet_plan.predicted_error + knots.error
            self.plans.append((self.crowd * error, how))
            added += len(facets) * len(samples)
        self.pairs += added

    @property
    def predicted_error(self) -> float:
        """Of the last channel."""
        return float(np.sqrt(sum(error**2 for error, _ in self.plans)))

    def plan(self) -> dict[str, Any]:
        """In words, for a report: of the part of the last channel that errs most."""
        if not self.plans:
            return {}
        chosen = max(self.plans, key=lambda p: p[0])[1]
        return {"model": "stop and go, single scattering", **chosen, **self.weights.describe(self.blur)}

    def worth_checking(self, check: bool | None, channels: float = 1) -> bool:
        """Whether samples are to be computed again: as asked, or where that costs less than 2 %."""
        points, facets = (0 if part is None else len(part) for part in (self.points, self.facets))
        seconds = 256 * points * 6e-8 + facets * 1e-4
        return check if check is not None else channels * seconds < 0.02 * self.order.clock.seconds.get("echo", 0.0)

    @property
    def draws(self) -> int:
        """Rows that are checked, and samples of each."""
        return how_many(self.facets)

    def exact(
        self, antennas: PulseGeometry, pulse: int, frequencies: np.ndarray, weights: AntennaWeights
    ) -> tuple[np.ndarray, np.ndarray]:
        """Exact sums over scatterers (n_polarizations, n), and the power they have at random phases."""
        order, out = self.order, np.zeros((2, len(self.order.polarizations), len(frequencies)), np.complex128)
        for part in (self.points, self.facets):
            if part is not None:
                out += exact_samples(part, antennas, pulse, frequencies, order.polarizations, order.vertical, weights)
        return out[0], out[1].real

    def measured(
        self, antennas: PulseGeometry, frequencies: np.ndarray, spectrum: np.ndarray, samples: Any,
        check: bool | None,
    ) -> float | None:  # fmt: skip
        """Error of a channel's samples, where it is asked for, or costs next to nothing."""
        if not self.worth_checking(check):
            return None
        found = measure_error(
            self.points, self.facets, antennas, frequencies, spectrum, samples, self.order.polarizations,
            self.order.vertical, self.weights,
        )  # fmt: skip
        self.order.clock.lap("check")
        return found

    def must_show(self, near: float, far: float) -> None:
        """NothingSeen where nothing at all was added."""
        if self.gated == self.pairs:
            raise NothingSeen(
                f"every scatterer is outside the range window of {near:g} to {far:g} m about the reference; "
                "widen range_window or move reference"
            )
        if self.gated + self.unlit == self.pairs:
            raise NothingSeen(
                "no scatterer in the range window is ever in the beam; aim the antenna with sarcl.pointing"
            )
        if self.gated + self.unlit + self.behind == self.pairs:
            raise NothingSeen(
                "every facet in the range window faces away from an antenna; move the track or turn the scene"
            )

    def counted(self, channels: int = 1) -> dict[str, Any]:
        """Contributions done and skipped, as a report has them."""
        skipped = {why: n * channels for why, n in self.skipped.items()}
        skipped["facing away"] = skipped.get("facing away", 0) + self.behind
        if self.weights.pair is not None:
            skipped["out of beam"] = self.unlit
        return {
            "contributions_done": self.pairs - self.gated - self.behind - self.unlit,
            "contributions_skipped": {**skipped, "range window": self.gated},
        }


def parts_of(scene: Scene) -> float:
    """By how much errors of a scene's parts may add up: points and facets err independently, each gets its share of the
    tolerance, so that the sum keeps it."""
    return float(np.sqrt(2 if len(scene.positions) and len(scene.triangles) else 1))


def plan_scene(
    order: Order, scene: Scene, waveform: Waveform, antennas: PulseGeometry, blur: WeightError, bands: Iterable[Band],
    tolerance: float, max_edge: float | str | None,
) -> Cut | None:  # fmt: skip
    """How a scene's facets are cut for `tolerance`, None where there are none.

    ToleranceUnreachable where gains, facets, or samples of one of `bands` cannot keep their shares of it.
    """
    share, made = tolerance / parts_of(scene), None
    blur.check(share)
    if len(scene.triangles):
        made = plan_cut(scene, waveform, antennas, order.polarizations, order.vertical, max_edge, share, blur)
        left = share / made.crowd - made.plan.predicted_error
        _profiles_fit(bands, left, len(scene.triangles) * MOST_FACETS, share / made.crowd)  # pieces: not counted yet
    n_points = int(np.count_nonzero(scene.amplitudes)) if "zero reflectivity" in order.skips else len(scene.amplitudes)
    if n_points and order.same:
        left = share - blur.of(blur.nodes(NODES * share), share)
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
    """A waveform that stands for all channels: as long, over all their bands."""
    return Waveform.chirp(center=center, bandwidth=bandwidth, duration=waveform.duration)


def _warned(*judgements: facet_error.Fineness | speckle_contrast.Speckle) -> dict[str, Any]:
    """SarclWarnings of what was judged, and what it says in a report."""
    out: dict[str, Any] = {}
    for judgement in judgements:
        for text in judgement.warnings():
            warn(text)
        out |= judgement.describe()
    return out


def bounded(largest: float) -> None:
    """ValueError for an amplitude too large for complex64."""
    if largest > LARGEST:
        text = f"amplitudes reach {largest:g}; echoes in complex64 hold up to {LARGEST:g}"
        raise ValueError(text + ": scale them down")
