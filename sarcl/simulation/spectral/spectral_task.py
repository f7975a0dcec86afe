"""One task of spectral_echo: what is refused, geometry and frequencies, plans, and the seconds that they need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.channels import is_single
from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable
from ...base.report import SMALLER_TOLERANCE, ErrorTerm
from ...base.validation import array as numbers
from ...base.validation import instance
from ...model.antenna_array import AntennaArray
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...numerics import cost_model
from ...numerics.pulse_geometry import PulseGeometry
from ...scattering import antenna_weights
from ...scattering.antenna_weights import AntennaWeights
from ...scattering.facets import FacetSet
from ...scene.scene import Scene
from .. import echo_sampling
from ..echo_request import EchoRequest
from ..scene_echoes import ChannelEchoes, SceneEchoes
from ..scene_plan import share_of
from ..scene_preparation import prepare_scene
from ._planning_time import PlanningTime
from ._scatterer_amplitudes import ScattererAmplitudes
from ._spectral_part import SpectralPart, plan_part
from ._straight_track import StraightTrack, straight_track

STRAIGHT = 0.05  # share of the tolerance: phase errors, rad, of a track that is not quite straight
WINDOW_PULSES = 33  # pulses at which scatterers are compared with a range window that was asked for


@dataclass(frozen=True, eq=False)
class SpectralTask:
    """Arguments of spectral_echo, checked, before the scene is prepared.

    scene         with its random heights, original_scene  as it was given
    frequencies   of the samples, Hz (n,), and their step;  window  (near, far), m about the reference
    window_asked  whether the window was given by the caller;  motion  entries of the report
    """

    request: EchoRequest
    waveform: Waveform
    line: StraightTrack
    scene: Scene
    original_scene: Scene
    antennas: PulseGeometry
    weights: AntennaWeights
    frequencies: np.ndarray
    step: float
    window: tuple[float, float]
    window_asked: bool
    motion: dict[str, object]

    def planned(
        self, variant: str
    ) -> tuple[SceneEchoes, list[SpectralPart], ChannelEchoes | None, tuple[ErrorTerm, ...]]:
        """The prepared scene, plans for its points and its facets, and the terms of the error of their sum.

        Facets of which pulses see different parts are added as `echo` does: their echoes are planned so; None where
        there are none, and for the variant "saras", whose shares of them change as slowly as amplitudes.
        """
        request, waveform = self.request, self.waveform
        request.report("scene", 0, 3)
        prepared = prepare_scene(
            request, self.original_scene, self.scene, waveform, self.antennas, self.weights, (), tiled=False,
            exact=variant == "exact",
        )  # fmt: skip
        steady, direct = prepared.facets, None
        if variant == "exact":
            steady, direct = prepared.by_light(self.antennas, waveform)
        band = waveform.center - waveform.bandwidth / 2, waveform.center + waveform.bandwidth / 2
        share = share_of(request, self.scene, waveform, self.antennas, request.tolerance)
        straight = 4 * np.pi * band[1] / SPEED_OF_LIGHT * self.line.deviation
        parts, terms = [], list(prepared.shadow_terms)
        for part in (prepared.points if request.same else None, steady):
            if part is None:
                continue
            gain, fixed, random = 1.0, 0.0, False
            if isinstance(part, FacetSet) and prepared.subdivision is not None:
                gain, fixed = prepared.subdivision.gain, prepared.subdivision.plan.predicted_error
                random = not part.is_mirror
            amplitudes = ScattererAmplitudes(
                part, prepared.weights, self.line, request.polarizations, request.vertical,
                share if variant == "exact" else None,
            )  # fmt: skip
            made = plan_part(
                amplitudes, self.line, band, prepared.weights.pair is not None, random, variant,
                share / gain - fixed - straight, request.tolerance, request.device,
                PlanningTime.of_echo(
                    self.line.n_pulses, len(amplitudes.azimuth), len(self.frequencies), len(request.polarizations),
                    isinstance(part, FacetSet),
                ),
            )  # fmt: skip
            parts.append(made)
            name = "facets" if isinstance(part, FacetSet) else "points"
            terms.append(ErrorTerm(name, gain * (made.predicted_error + fixed + straight), SMALLER_TOLERANCE))
        if self.window_asked and request.gated:
            for one in parts:
                _check_window(one, self.line, self.antennas.reference_range, self.window)
        channel = None
        if direct is not None:
            channel = direct.channel(self.antennas, waveform, self.frequencies)
            terms.append(ErrorTerm("facets added pulse by pulse", channel.predicted_error, SMALLER_TOLERANCE))
        request.clock.lap("plan")
        return prepared, parts, channel, tuple(terms)

    def describe(self, parts: list[SpectralPart], direct: ChannelEchoes | None) -> dict[str, Any]:
        """Words of the plan of the part with the largest error; of facets added as `echo` does where there is no
        other."""
        if not parts and direct is not None:
            return direct.plan
        return max(parts, key=lambda part: part.predicted_error).describe()

    def seconds(self, parts: list[SpectralPart], direct: ChannelEchoes | None) -> float:
        """About the seconds of the whole task: those since it began, and those of the plans."""
        n_polarizations, total = len(self.request.polarizations), sum(self.request.clock.seconds.values())
        if direct is not None:
            partly = direct.scene.shadow_words.get("partly lit facets", 0)
            each = cost_model.LIT_PART * partly + cost_model.ECHO_FACET * len(direct.scene)
            total += 1e-6 * each * self.line.n_pulses
        for part in parts:
            n, terms = len(part.some), len(part.expansion)
            of_facets = isinstance(part.amplitudes.part, FacetSet)
            amplitude = cost_model.SPECTRAL_FACET if of_facets else cost_model.SPECTRAL_POINT
            total += 1e-6 * n * (terms * amplitude + cost_model.SPECTRAL_PLANES * of_facets)
            for one in part.maps:
                of_map = cost_model.SPECTRAL_SPREAD * len(one.azimuth)
                of_map += cost_model.SPECTRAL_SAMPLE * one.grid.count * len(self.frequencies)
                total += 1e-6 * terms * n_polarizations * one.nodes * of_map
        return total


def spectral_task(
    scene: Scene, waveform: Waveform, track: Trajectory, request: EchoRequest, *, receiver: Any = None,
    array: Any = None, reference: Any = None, range_window: Any = None, antenna: Any = None, radar: Any = None,
    compressed: bool = True,
) -> SpectralTask:  # fmt: skip
    """The task of these arguments. NotApplicable, which names `echo`, for what spectral_echo cannot take."""
    if receiver is not None:
        raise NotApplicable("spectral_echo is for one antenna that transmits and receives; use echo for a receiver")
    if array is not None:
        instance("array", array, AntennaArray)
        if not is_single(array):
            raise NotApplicable("spectral_echo takes no arrays; use echo, which computes their channels")
    if not track.stop_and_go:
        raise NotApplicable(
            "the track is that of an orbit, with the receiver where it is at the echo's arrival; spectral_echo is for "
            "straight tracks, stop and go: use echo"
        )
    line = straight_track(track, waveform.center + waveform.bandwidth / 2, STRAIGHT * request.tolerance)
    tx = track.positions
    point = scene.center if reference is None else numbers("reference", reference, np.float64, (3,))
    _, _, motion = echo_sampling.in_flight(track, None, scene, point)
    reference_range = echo_sampling.half_path(tx, tx, point)
    real = scene.realized(request.seed)
    weights = antenna_weights.weights_of(antenna, radar, track, None, waveform, real.center)
    near, far = echo_sampling.window(real, waveform, tx, tx, reference_range, range_window)
    frequency, step, n_samples = echo_sampling.sampling(waveform, near, far, compressed)
    antennas = PulseGeometry.sampled(
        tx, tx, reference_range, first=frequency, step=step, n_samples=n_samples, near=near, far=far
    )
    return SpectralTask(
        request, waveform, line, real, scene, antennas, weights, frequency + step * np.arange(n_samples), step,
        (near, far), range_window is not None, motion,
    )  # fmt: skip


def _check_window(
    part: SpectralPart, line: StraightTrack, reference_range: np.ndarray, window: tuple[float, float]
) -> None:
    """NotApplicable where a scatterer lies outside the range window at a pulse that sees it."""
    azimuth, slant_range = part.amplitudes.azimuth[part.some], part.amplitudes.slant_range[part.some]
    low, high = part.seen
    for p in np.unique(np.linspace(0, line.n_pulses - 1, WINDOW_PULSES).astype(int)).tolist():
        lag = p * line.spacing - azimuth
        distance = np.hypot(lag, slant_range)
        seen = (lag >= low * distance) & (lag <= high * distance)
        away = distance[seen] - reference_range[p]
        outside = (away < window[0]) | (away > window[1])
        if outside.any():
            raise NotApplicable(
                f"range_window ({window[0]:g}, {window[1]:g}) m cuts the scene: at pulse {p} scatterers lie at "
                f"{away.min():.4g} to {away.max():.4g} m about the reference. Widen it, leave it out, or use echo, "
                "which leaves out scatterers row by row"
            )
