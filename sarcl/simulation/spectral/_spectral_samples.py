"""From spectra along the track to samples: all parts of a scene, block of frequencies by block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...opencl import fft
from ..echo_output import EchoOutput
from ..scene_echoes import EchoRequest
from ._map_part import MapPart
from ._spectral_part import SpectralPart
from ._straight_track import StraightTrack


class SpectralSamples:
    """Samples of all parts, block of frequencies by block."""

    def __init__(
        self, request: EchoRequest, parts: Sequence[SpectralPart], line: StraightTrack,
        reference_range: np.ndarray, frequencies: np.ndarray, spectrum: np.ndarray,
    ) -> None:  # fmt: skip
        """spectrum  complex (n_f,), by which all samples are multiplied"""
        self.device, self.request, self.parts, self.line = request.device, request, parts, line
        self.reference_range, self.frequencies, self.spectrum = reference_range, frequencies, spectrum

    def compute(self, output: EchoOutput) -> None:
        """Write the samples of all pulses to an output."""
        request, n_polarizations = self.request, len(self.request.polarizations)
        held = [part.on_device(request.device, request.budget) for part in self.parts]
        request.clock.lap("map")
        a_frequency = max(part.bytes_per_frequency for part in self.parts) + 16.0 * self.line.n_pulses
        at_once = int(np.clip(request.budget / 3 / (n_polarizations * a_frequency), 1, len(self.frequencies)))
        n_steps = -(-len(self.frequencies) // at_once) * len(held)
        for i, start in enumerate(range(0, len(self.frequencies), at_once)):
            some = slice(start, min(start + at_once, len(self.frequencies)))
            block = np.zeros((self.line.n_pulses, n_polarizations, some.stop - start), np.complex64)
            for m, (part, on_device) in enumerate(zip(self.parts, held, strict=True)):

                def on_progress(done: float, step: int = i * len(held) + m) -> None:
                    request.report("echo", round(1000 * (step + done) / n_steps), 1000)

                shape = some.stop - start
                spectra = [np.zeros((n_polarizations, one.grid.count, shape), np.complex64) for one in part.maps]
                part.add(on_device, self.frequencies[some], spectra, request.budget / 3, on_progress)
                for one, made in zip(part.maps, spectra, strict=True):
                    for n in range(n_polarizations):
                        block[:, n] += self._along_track(one, made[n], self.frequencies[some])
            block *= self._reference(some)[:, None]
            output.keep_frequencies(start, block)
        request.clock.lap("echo")

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
