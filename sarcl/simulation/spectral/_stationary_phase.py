"""The transfer function of SARAS: stationary phase over azimuth, parabolas over the Doppler wavenumber.

source  Franceschetti, Migliaccio, Riccio, Schirinzi 1992, equations (26) to (36). In their variables, with the signs
        of a numerical transform of (22) (those of (27), (34) and (36) are wrong in print):

    G = d w^2(-xi/2a^2) sqrt(1 + beta r)/sqrt(1 + eps eta/2b^2 - (3/2) gamma^2 xi^2/4a^4) exp(j psi)
    psi = xi^2/4a^2 (1 + beta r)/(1 + eps eta/2b^2);   grid deformation: eta' = eta - beta xi^2/4a^2

    xi^2 (1 + beta r)/4a^2 is u^2 (R_0 + r)/4 k_0,  1 + eps eta/2b^2 is f/f_0,  xi/2a^2 is u R_0/2 k_0 over X, and
    gamma^2 xi^2/4a^4 is (u/2 k_0)^2.
"""

from __future__ import annotations

import numpy as np
import scipy.special

from ...model.waveform import Waveform
from ...numerics.polynomials import chebyshev
from ._aspect_window import Aspects, KnownPhase, wavenumber
from ._azimuth_transfer import CELLS, AzimuthTransfer, Functions

MARGIN = 4  # Fresnel zones by which the tables exceed the window
FREQUENCIES = 4  # of the tables: the root's dependence on frequency is smooth


def stationary_tables(aspects: Aspects, functions: Functions) -> AzimuthTransfer:
    """Tables of equation (26) without d, over u/2 k_0; `functions` at the centre of the band."""
    zone = aspects.fresnel
    step, (low, high), r = zone / CELLS, aspects.support, aspects.middle_range
    start = -high - MARGIN * zone
    sine = -(start + step * np.arange(int(np.ceil((high - low + 2 * MARGIN * zone) / step)) + 4))
    center = sum(aspects.band) / 2
    k = float(wavenumber(center))
    frequencies = chebyshev(center, aspects.band[1] - aspects.band[0], FREQUENCIES)
    window = aspects.window(sine)
    inside = np.flatnonzero(window)
    psi = functions(sine[inside], center)
    tables = np.zeros((len(psi), 1, FREQUENCIES, len(sine)), np.complex128)
    for m, f in enumerate(frequencies.tolist()):
        root = np.sqrt(np.maximum(f / center - 1.5 * sine[inside] ** 2, 0.01))
        tables[:, 0, m, inside] = psi * window[inside] * np.sqrt(np.pi * r / k) * np.exp(-0.25j * np.pi) / root
    return AzimuthTransfer(aspects, KnownPhase(r, k), np.array([r]), frequencies, start, step, tables)


def chirp_ripple(waveform: Waveform, frequencies: np.ndarray) -> np.ndarray:
    """d of equation (26): spectrum of a rectangular chirp over its form by stationary phase, complex128 (n,).

    With K = bandwidth/duration and f from the centre: d = (1 - j)/2 [Z(a + b) + Z(a - b)], Z = C + jS the Fresnel
    integrals, a = duration sqrt(K/2), b = f sqrt(2/K). A down-chirp is the conjugate of the chirp, and d, which is the
    same at f and -f, becomes its conjugate.
    """
    rate = waveform.bandwidth / waveform.duration
    a, b = waveform.duration * np.sqrt(rate / 2), (frequencies - waveform.center) * np.sqrt(2 / rate)
    (sine, cosine), (other_sine, other_cosine) = scipy.special.fresnel(a + b), scipy.special.fresnel(a - b)
    integral = np.asarray((1 - 1j) / 2 * (cosine + other_cosine + 1j * (sine + other_sine)))
    return integral.conj() if waveform.kind == "down-chirp" else integral
