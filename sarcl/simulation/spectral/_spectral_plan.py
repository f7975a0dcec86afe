"""The plan of spectral echoes, and its run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import confirm_tolerance, warned_once
from ...base.forecast import Forecast
from ...base.report import Report, root_sum_square
from ...base.stage_timer import Clock
from ...model.phase_history import PhaseHistory
from ..echo_check import measure_error, seconds_to_check
from ..echo_output import EchoOutput, bytes_of
from ..echo_request import EchoRequest
from ..echo_sampling import row_fields
from ..scene_echoes import UNKNOWN_SHADOWS, ChannelEchoes
from ..spreading import Counts
from ._spectral_options import SpectralEchoOptions
from ._spectral_samples import SpectralSamples
from ._stationary_phase import chirp_ripple
from .spectral_parts import PlannedParts, plan_parts
from .spectral_task import SpectralTask

QUICK_CHECK = 1.0  # s, for the exact sums of the check


@dataclass(frozen=True, eq=False)
class SpectralEchoPlan:
    """Echoes to be computed by Fourier transforms: a Plan.

    seconds  of planning, by stage;  planned  None until `forecast` or `run` plans the scene: its samples have a place
             before that
    """

    options: SpectralEchoOptions
    task: SpectralTask
    seconds: dict[str, float]
    planned: PlannedParts | None = None

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the samples: (pulses, polarizations, samples)."""
        return len(self.task.track), len(self.task.request.polarizations), len(self.task.frequencies)

    def forecast(self) -> Forecast[PhaseHistory]:
        """Its Forecast. Nothing is transformed; the scene is prepared, and kept for the run."""
        clock = Clock(self.seconds)
        with warned_once():
            planned = plan_parts(self.task, replace(self.task.request, clock=clock, progress=None))
        spent = sum(clock.seconds.values())
        n_pulses, n_polarizations, n_samples = self.shape
        details = {
            **planned.describe(),
            **self.task.motion,
            "contributions": planned.counts().contributing * n_polarizations,
        }
        return Forecast(
            method="Fourier transforms",
            plan=details,
            seconds=spent + planned.seconds(),
            bytes=bytes_of(self.shape),
            predicted_error=root_sum_square(planned.error_terms),
            error_terms=planned.error_terms,
            n_rows=n_pulses * n_polarizations,
            n_samples=n_samples,
            planning=spent,
            run=replace(self, seconds=clock.seconds, planned=planned).run,
        )

    def run(self) -> PhaseHistory:
        """The echoes."""
        task, options, clock = self.task, self.options, Clock(self.seconds)
        request = replace(task.request, clock=clock)
        with EchoOutput(self.shape, options.out, request.budget, task.window) as output:
            planned = _timed(self.planned, request) if self.planned else plan_parts(task, request)
            spectrum = self._spectrum(planned)
            folder = None if options.out is None else Path(options.out).parent
            reference_range = task.seen.antennas.reference_range
            SpectralSamples(
                request, planned.parts, task.line, reference_range, task.frequencies, spectrum, folder
            ).compute(output)
            if planned.direct is not None:
                _add_directly(planned.direct, spectrum, output)
            raw = output.finish(
                frequency=task.frequencies[0],
                frequency_step=task.step,
                **row_fields(task.track, None, reference_range, request.polarizations),
                waveform=task.seen.waveform,
                array=options.array,
                compressed=options.compressed,
                report=self._report(planned, request, self._measured(planned, spectrum, output, request)),
            )
        confirm_tolerance(raw=raw, instead="use echo")
        return raw

    def _spectrum(self, planned: PlannedParts) -> np.ndarray:
        """Spectrum of all samples: the pulse, after its matched filter if compressed, times the antennas' factor."""
        waveform, frequencies = self.task.seen.waveform, self.task.frequencies
        pulse = waveform.pulse_spectrum(frequencies)
        spectrum = (np.abs(pulse) ** 2 if self.options.compressed else pulse) * planned.prepared.weights.factor(
            frequencies
        )
        return np.asarray(spectrum * chirp_ripple(waveform, frequencies) if self.options.ripple else spectrum)

    def _measured(
        self, planned: PlannedParts, spectrum: np.ndarray, output: EchoOutput, request: EchoRequest
    ) -> float | None:
        """Relative error of random samples, where that is asked for or quick."""
        check = self.options.check
        if not (seconds_to_check(planned.prepared) <= QUICK_CHECK if check is None else check):
            return None
        antennas = self.task.seen.antennas
        measured = measure_error(planned.prepared, antennas, self.task.frequencies, spectrum, output)
        request.clock.lap("check")
        return measured

    def _report(self, planned: PlannedParts, request: EchoRequest, measured: float | None) -> Report:
        prepared = planned.prepared
        shadows = prepared.shadow_words
        if self.options.variant == "saras" and "shadow edges" in shadows:
            # here aspects are interpolated as if shares changed slowly: what that adds is not known
            shadows = shadows | UNKNOWN_SHADOWS
        words: dict[str, Any] = {
            "model": "stop and go, single scattering",
            **planned.describe(),
            **prepared.mesh_warnings,
            **shadows,
            **prepared.weights.describe(prepared.weight_error),
            **self.task.motion,
        }
        return Report(
            plan=words,
            tolerance=request.tolerance,
            predicted_error=root_sum_square(planned.error_terms),
            error_terms=planned.error_terms,
            measured_error=measured,
            **prepared.counted(planned.counts()),
            seconds=request.clock.seconds,
            device=request.device.info.name,
            seed=request.seed,
        )


def _timed(planned: PlannedParts, request: EchoRequest) -> PlannedParts:
    """The same plan with the clock and the progress function of a request."""
    direct = planned.direct
    if direct is not None:
        direct = replace(direct, scene=replace(direct.scene, request=request))
    return replace(planned, prepared=replace(planned.prepared, request=request), direct=direct)


def _add_directly(direct: ChannelEchoes, spectrum: np.ndarray, output: EchoOutput) -> None:
    """Add echoes that change from pulse to pulse as `echo` does; spectrum  complex (n_f,), of all samples."""
    counts, n, request = Counts(), len(output), direct.scene.request
    pulses = max(1, int(request.budget / 8 / (8.0 * np.prod(output.shape[1:]))))
    for start in range(0, n, pulses):
        stop = min(start + pulses, n)
        block = np.zeros((stop - start, *output.shape[1:]), np.complex64)
        counts += direct.add(block, range(start, stop), counts.pairs, len(direct.scene) * n)
        output.add(start, block * spectrum.astype(np.complex64))
    request.clock.lap("facets with shadows")
