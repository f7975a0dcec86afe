"""From spectra along the track to samples: all parts of a scene, block of frequencies by block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...opencl import fft
from ..echo_output import EchoOutput
from ..echo_request import EchoRequest
from ._map_part import MapPart
from ._scratch import Scratch
from ._spectral_blocks import SpectrumBands
from .spectral_parts import PlannedParts


class SpectralSamples:
    """Samples from the spectra of all parts, block of frequencies by block."""

    def __init__(self, planned: PlannedParts, request: EchoRequest, spectrum: np.ndarray) -> None:
        """request  with the clock of this run;  spectrum  complex (n_f,), by which all samples are multiplied"""
        task = planned.task
        self.planned, self.request, self.spectrum = planned, request, spectrum
        self.device, self.line, self.frequencies = request.device, task.line, task.frequencies
        self.reference_range = task.seen.antennas.reference_range

    def compute(self, spectra: Scratch, bands: SpectrumBands, output: EchoOutput) -> None:
        """Write the samples of all pulses to an output; spectra  rows of `bands`."""
        request, n_polarizations = self.request, len(self.request.polarizations)
        maps = [one for part in self.planned.parts for one in part.maps]
        n_frequencies, at_once = len(self.frequencies), self._at_once(maps, n_polarizations)
        for start in range(0, n_frequencies, at_once):
            some = slice(start, min(start + at_once, n_frequencies))
            block = np.zeros((self.line.n_pulses, n_polarizations, some.stop - start), np.complex64)
            for section in bands.sections:
                rows = slice(section.first, section.first + section.n_rows)
                columns = spectra.columns(start, some.stop, request.budget / 16, rows)
                if section.part is None:  # the last section: these echoes have their phases already
                    block *= self._reference(some)[:, None]
                    block += columns.reshape(block.shape) * self.spectrum[some].astype(np.complex64)
                else:
                    one = self.planned.parts[section.part].maps[section.map]
                    block[:, section.polarization] += self._along_track(one, columns, self.frequencies[some])
            if self.planned.direct is None:
                block *= self._reference(some)[:, None]
            output.keep_frequencies(start, block)
            request.report("echo", some.stop, n_frequencies)
        request.clock.lap("echo")

    def _at_once(self, maps: Sequence[MapPart], n_polarizations: int) -> int:
        """Frequencies per block, whose spectra, samples and factors take up to a third of the budget."""
        n_pulses = self.line.n_pulses
        of_maps = (16.0 * one.grid.count + 16.0 * one.grid.n_lags for one in maps)
        of_spectra = max(of_maps, default=0.0) + 16.0 * n_pulses
        bytes_per_frequency = max(of_spectra, 40.0 * n_pulses) + 8.0 * n_polarizations * n_pulses
        return int(np.clip(self.request.budget / 3 / bytes_per_frequency, 1, len(self.frequencies)))

    def _along_track(self, part: MapPart, spectra: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
        """Samples (n_pulses, n_f) from spectra over the wavenumbers along the track (n_u, n_f)."""
        folded = part.grid.folded(np.ascontiguousarray(spectra.T))
        made = fft.rows(self.device, folded, inverse=True)[:, : self.line.n_pulses].T
        # the spectra's phases count from the middle range of the map
        return np.asarray(
            made * (self._turns(part.numbers.phase.middle_range, frequencies) / np.float32(part.grid.period))
        )

    def _turns(self, middle_range: float, frequencies: np.ndarray) -> np.ndarray:
        """exp(-j 4 pi f (middle range - first reference range)/c), complex64 (n_f,)."""
        cycles = 2 * frequencies / SPEED_OF_LIGHT * (middle_range - self.reference_range[0])
        return np.exp(-2j * np.pi * (cycles % 1)).astype(np.complex64)

    def _reference(self, some: slice) -> np.ndarray:
        """Factors (n_pulses, n_f) of the reference ranges and of the spectrum, complex64."""
        cycles = np.outer(self.reference_range - self.reference_range[0], 2 * self.frequencies[some] / SPEED_OF_LIGHT)
        cycles -= np.rint(cycles)
        out = np.exp((2j * np.pi * cycles).astype(np.complex64))
        out *= self.spectrum[some].astype(np.complex64)
        return np.asarray(out)
