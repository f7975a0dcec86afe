"""The plan of spectral echoes, and its run."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.errors import confirm_tolerance, warned_once
from ...base.forecast import Forecast
from ...base.report import Report, root_sum_square
from ...base.stage_timer import Clock
from ...blocks.block_job import BlockJob
from ...blocks.checkpoint import Checkpoint
from ...blocks.fill_bands import BandFiller
from ...model.phase_history import PhaseHistory
from ..echo_check import measure_error, seconds_to_check
from ..echo_files import EchoFiles
from ..echo_output import EchoOutput, bytes_of
from ..echo_request import EchoRequest
from ..echo_sampling import row_fields
from ..scene_echoes import UNKNOWN_SHADOWS
from ._scratch import Scratch, folder_of
from ._spectral_blocks import SpectrumBands, SpectrumRecipe, spectrum_job
from ._spectral_options import SpectralEchoOptions
from ._spectral_samples import SpectralSamples
from ._stationary_phase import chirp_ripple
from .spectral_parts import PlannedParts, plan_parts
from .spectral_task import SpectralTask

QUICK_CHECK = 1.0  # s, for the exact sums of the check


@dataclass(frozen=True, eq=False)
class SpectralEchoPlan:
    """Echoes to be computed by Fourier transforms: a Plan.

    seconds  of planning, by stage;  piece  (i, n) where only that piece of the spectra is computed
    planned  None until `forecast` or `run` plans the scene: its samples have a place before that
    """

    options: SpectralEchoOptions
    task: SpectralTask
    seconds: dict[str, float]
    piece: tuple[int, int] | None = None
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
            seconds=spent + planned.seconds() / self.options.speedup(self.task.devices),
            bytes=bytes_of(self.shape),
            predicted_error=root_sum_square(planned.error_terms),
            error_terms=planned.error_terms,
            n_rows=n_pulses * n_polarizations,
            n_samples=n_samples,
            planning=spent,
            run=replace(self, seconds=clock.seconds, planned=planned).run,
        )

    def run(self) -> PhaseHistory:
        """The echoes; None for a piece while others are missing."""
        with ExitStack() as stack:
            raw = self._echoes(stack, Clock(self.seconds))
        if raw is not None:
            confirm_tolerance(raw=raw, instead="use echo")
        return raw  # type: ignore[return-value]

    def _echoes(self, stack: ExitStack, clock: Clock) -> PhaseHistory | None:
        task, options = self.task, self.options
        request, job = replace(task.request, clock=clock), spectrum_job(task, options, self.shape)
        files = EchoFiles(stack, job, self._output, out=options.out, resume=options.resume, piece=self.piece)
        if (finished := files.finished()) is not None:
            return finished
        planned = _timed(self.planned, request) if self.planned else plan_parts(task, request)
        filler = self._filler(planned, job, files.checkpoint, clock)
        clock.lap("map")
        output = files.output(filler)
        if output is None:
            return None
        assert isinstance(job.bands, SpectrumBands)
        rows = job.bands.n_rows, self.shape[2]
        spectra = Scratch(rows, request.budget / 6, folder_of(options.out))
        n_kept, spectrum = filler.fill(spectra)[1], self._spectrum(planned)
        SpectralSamples(planned, request, spectrum).compute(spectra, job.bands, output)
        measured = self._measured(planned, spectrum, output, request)
        report = self._report(planned, request, measured, filler.workers.names)
        if n_kept:
            words = {**report.plan, "from files": f"{n_kept} of {job.bands.n_bands} blocks of spectra"}
            report = replace(report, plan=words)
        return files.finish(
            frequency=task.frequencies[0],
            frequency_step=task.step,
            **row_fields(task.track, None, task.seen.antennas.reference_range, request.polarizations),
            waveform=task.seen.waveform,
            array=options.array,
            compressed=options.compressed,
            report=report,
        )

    def _output(self) -> EchoOutput:
        """Destination of the samples."""
        return EchoOutput(self.shape, self.options.out, self.task.request.budget, self.task.window)

    def _filler(self, planned: PlannedParts, job: BlockJob, checkpoint: Checkpoint | None, clock: Clock) -> BandFiller:
        """What fills the spectra, by the devices of the task."""
        task, options, bands = self.task, self.options, job.bands
        assert isinstance(bands, SpectrumBands)
        bands.divide(planned)
        recipe = SpectrumRecipe(planned, bands, options)
        workers = options.workers(job, recipe, task.devices, recipe.on(task.devices[0]))
        return BandFiller(workers, job, checkpoint, clock, options.progress)

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

    def _report(
        self, planned: PlannedParts, request: EchoRequest, measured: float | None, devices: list[str]
    ) -> Report:
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
            device=" + ".join(devices),
            seed=request.seed,
        )


def _timed(planned: PlannedParts, request: EchoRequest) -> PlannedParts:
    """The same plan with the clock and the progress function of a request."""
    direct = planned.direct
    if direct is not None:
        direct = replace(direct, scene=replace(direct.scene, request=request))
    return replace(planned, prepared=replace(planned.prepared, request=request), direct=direct)
