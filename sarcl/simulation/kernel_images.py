"""Error of the images of an interpolation kernel, where scatterers lie evenly enough for the images to add up.

Profiles of rate F, Hz, that scatterers are spread into with a kernel of transform T hold, besides the samples
s(f) = sum_k a_k(f) exp(-j 2 pi f tau_k), images of them one rate away:

    error(f) = sum_m T(nu + m)/T(nu) sum_k a_k(f) exp(-j 2 pi (f + m F) tau_k),   m = +-1, +-2, ...,   nu = (f - f_0)/F

At random places an image sums to the root of the scatterers' power, and the bound of the kernel's error for a single
scatterer (Interpolator.error) holds. On a lattice, as the pieces of a plate, the sum is many times that wherever
f + m F is a grating lobe of the lattice, even where all of it cancels at f. So it is measured. Averaged over the band
and the track, only scatterers within a resolution cell or two of one another interfere: a few patches of neighbours at
random pulses and frequencies are enough.

source    docs/theory/accuracy.md; tests/simulation/test_lattice_echo.py measures it
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..model.waveform import Waveform
from ..numerics.interpolation import Interpolator
from ..numerics.pulse_geometry import PulseGeometry, half_path

SAFETY = 2.0  # the error is estimated from samples
PULSES = 16  # random pulses, each with a patch of its own
PATCH = 2048  # scatterers per patch, neighbours along the Morton curve; more where there are fewer pulses
FREQUENCIES = (16, 64)  # fewest and most random frequencies per pulse
SAMPLES = PULSES * PATCH * FREQUENCIES[0]  # terms of the sums
IMAGES = (-1, 1, -2, 2, -3, 3)  # further images are below the error of a kernel at random places

# amplitudes complex128 (k, n polarisations) of scatterers (k,) at a pulse and a frequency, Hz
Amplitudes = Callable[[np.ndarray, int, float], np.ndarray]


@dataclass(frozen=True, eq=False)
class PatchSamples:
    """What patches of scatterers send back at random pulses and frequencies.

    amplitudes  a, complex64 (n pulses, k, n polarisations), at one of the frequencies
    phasors     exp(-j 2 pi f tau), complex64 (n pulses, n frequencies, k)
    delays      tau, s (n pulses, k), from the reference
    offsets     f less the middle of the band, over the bandwidth (n pulses, n frequencies)
    """

    amplitudes: np.ndarray
    phasors: np.ndarray
    delays: np.ndarray
    offsets: np.ndarray

    def error(self, interpolator: Interpolator, length: int, n_samples: int, bandwidth: float) -> float:
        """Relative error that the kernel's images make in n_samples over a bandwidth, Hz, from profiles of `length`
        samples; relative to the samples of scatterers at random phases."""
        rate, nu = bandwidth * length / n_samples, self.offsets * (n_samples / length)
        power = float((np.abs(self.amplitudes) ** 2).sum(dtype=np.float64)) * nu.shape[1]
        if not power:
            return 0.0
        at_band = interpolator.transform(nu)
        error = np.zeros((*nu.shape, self.amplitudes.shape[-1]), np.complex128)
        for m in IMAGES:
            waves = _phasors(m * rate * self.delays)[..., None] * self.amplitudes
            image = np.einsum("pfk,pka->pfa", self.phasors, waves)  # not by BLAS, whose threads wait for one another
            error += (interpolator.transform(nu + m) / at_band)[..., None] * image
        return SAFETY * float(np.sqrt((np.abs(error) ** 2).sum() / power))


def sample_patches(
    positions: np.ndarray, order: np.ndarray, antennas: PulseGeometry, waveform: Waveform, amplitudes: Amplitudes
) -> PatchSamples:
    """Samples of scatterers at positions, m (n, 3), in Morton `order` (n,), over the band of the waveform.

    The phases change along the band; amplitudes change little, and are computed at one of the frequencies per patch.
    """
    random, n_pulses = np.random.default_rng(0), min(PULSES, len(antennas))
    size = min(PULSES * PATCH // n_pulses, len(positions))
    n_frequencies = int(np.clip(SAMPLES // (n_pulses * size), *FREQUENCIES))
    waves, phasors, delays = [], [], []
    offsets = (np.arange(n_frequencies) + random.random((n_pulses, n_frequencies))) / n_frequencies - 0.5
    for i, offset in enumerate(offsets):
        pulse = int((i + random.random()) / n_pulses * len(antennas))
        start = int(random.integers(len(positions) - size + 1))
        some, f = order[start : start + size], waveform.center + waveform.bandwidth * offset
        path = half_path(antennas.tx[pulse], antennas.rx[pulse], positions[some]) - antennas.reference_range[pulse]
        delays.append(2 / SPEED_OF_LIGHT * path)
        phasors.append(_phasors(f[:, None] * delays[-1]))
        waves.append(amplitudes(some, pulse, float(random.choice(f))).astype(np.complex64))
    return PatchSamples(np.stack(waves), np.stack(phasors), np.stack(delays), offsets)


def _phasors(cycles: np.ndarray) -> np.ndarray:
    """exp(-j 2 pi cycles), complex64."""
    phase = (-2 * np.pi * (cycles - np.rint(cycles))).astype(np.float32)
    out = np.empty(phase.shape, np.complex64)
    np.cos(phase, out=out.real)
    np.sin(phase, out=out.imag)
    return out
