"""Amplitudes of scatterers over aspect and frequency, as sums of few products: functions of the scatterer times
functions of aspect and frequency.

    a_k(s, f) = sum_j a_k(s_j, f_j) psi_j(s, f),   psi_j(s, f) = sum_i [A^-1]_ji a_i(s, f),   A_ij = a_i(s_j, f_j)

s is the sine of the aspect: (antenna - scatterer) . along over their distance. The J aspects (s_j, f_j) and the J
scatterers i are chosen from samples by pivoted Gram-Schmidt: a cross approximation, exact for amplitudes that are
sums of J products. Each psi_j is computed at any s and f from the amplitudes of the J scatterers themselves, so beams
with edges are as exact as smooth ones.

source  Goreinov, Tyrtyshnikov, Zamarashkin 1997, A theory of pseudoskeleton approximations
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import ToleranceUnreachable

# (indices of scatterers, sine (scalar or one for each), frequency, Hz) -> (n, n_polarizations), complex128
Amplitudes = Callable[[np.ndarray, "float | np.ndarray", float], np.ndarray]
RANKS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
# samples from which the terms are chosen: with few frequencies, terms beside one another in aspect take the place of
# those beside one another in frequency, and cancel
SCATTERERS, ASPECTS, FREQUENCIES = 160, 48, 9
CHECKED = 400  # pairs of scatterer and pulse at which the error is measured
SAFETY = 2.0  # the error is estimated from samples
ROUNDING = 1e-6  # relative error of a factor of facets, rms, in float32; measured 5e-7 to 1.1e-6


@dataclass(frozen=True, eq=False)
class AspectExpansion:
    """Terms of an expansion.

    sines, frequencies    aspects of the terms (J,), frequencies in Hz
    scatterers            indices of up to J scatterers;  polarizations  index of a polarisation of each
    inverse               (J, number of scatterers)
    error                 predicted, relative to all amplitudes
    """

    amplitudes: Amplitudes
    sines: np.ndarray
    frequencies: np.ndarray
    scatterers: np.ndarray
    polarizations: np.ndarray
    inverse: np.ndarray
    error: float

    def __len__(self) -> int:
        return len(self.sines)

    def factors(self, some: np.ndarray, term: int) -> np.ndarray:
        """Factor of scatterers `some` (n,) in a term, complex128 (n, n_polarizations)."""
        return self.amplitudes(some, float(self.sines[term]), float(self.frequencies[term]))

    def functions(self, sines: np.ndarray, frequency: float) -> np.ndarray:
        """psi at sines (n,) and one frequency, Hz: complex128 (J, n)."""
        n, m = len(sines), len(self.scatterers)
        made = self.amplitudes(np.repeat(self.scatterers, n), np.tile(sines, m), frequency)
        return np.asarray(self.inverse @ made.reshape(m, n, made.shape[-1])[np.arange(m), :, self.polarizations])


class AmplitudeSamples:
    """Random scatterers, and pairs of scatterer and pulse at which expansions are compared with the amplitudes."""

    def __init__(
        self,
        amplitudes: Amplitudes,
        size: np.ndarray,
        band: tuple[float, float],
        seen: Callable[[np.ndarray, np.random.Generator], np.ndarray],
        kinds: np.ndarray | None = None,
    ) -> None:
        """size  (n,) of the scatterers, such as areas: large ones are drawn more often;  band  Hz, its limits
        seen    (scatterers (n,), random) -> sines (n,) at which random pulses of the track see them
        kinds   int (n,), of scatterers whose errors are judged apart: the pieces of a specular facet add up in phase,
                and so do their errors, however many rough ones there are; default one
        """
        self.amplitudes, self.band = amplitudes, band
        random = np.random.default_rng(0)
        alike = np.full(len(size), 1 / len(size))
        chance = 0.5 * (alike + (size / size.sum() if size.any() else alike))
        kinds = np.zeros(len(size), np.int64) if kinds is None else np.unique(kinds, return_inverse=True)[1]
        chance /= np.bincount(kinds, chance)[kinds]
        chance /= np.sum(chance)
        n = min(SCATTERERS, len(size))
        self.some, self.which, self.share = np.arange(n), np.resize(np.arange(n), CHECKED), np.ones(CHECKED)
        if n < len(size):
            self.some = np.sort(random.choice(len(size), n, replace=False, p=chance))
            self.which = random.choice(len(size), CHECKED, p=chance)
            self.share = 1 / chance[self.which]
        self.weight, self.kinds = 1 / np.sqrt(chance[self.some]), kinds[self.which]
        self.at = seen(self.which, random)
        # evenly over the band: amplitudes that grow along it err most far from a term's frequency, and a few random
        # frequencies may all lie near it. Halfway between the frequencies of terms
        parts = FREQUENCIES - 1
        self.frequencies = (band[0] + (np.arange(parts) + 0.5) / parts * (band[1] - band[0])).tolist()
        self.exact = np.stack([amplitudes(self.which, self.at, f) for f in self.frequencies])

    def error(self, expansion: AspectExpansion) -> float:
        """Relative error of an expansion, with a margin; terms that cancel multiply the rounding of the factors."""
        factors = np.stack([expansion.factors(self.which, j) for j in range(len(expansion))], axis=-1)
        wrong, right, apart = np.zeros((3, self.kinds.max(initial=0) + 1))
        for f, exact in zip(self.frequencies, self.exact, strict=True):
            functions = expansion.functions(self.at, f)
            guess = np.einsum("cpj,jc->cp", factors, functions)
            terms = np.einsum("cpj,jc->cp", np.abs(factors) ** 2, np.abs(functions) ** 2)
            for total, powers in ((wrong, np.abs(guess - exact) ** 2), (right, np.abs(exact) ** 2), (apart, terms)):
                total += np.bincount(self.kinds, self.share * powers.sum(axis=1), len(total))
        some = right > 0
        if not some.any():
            return 0.0
        wrong, apart = np.sqrt(wrong[some] / right[some]), np.sqrt(apart[some] / right[some])
        # rounding of terms as large as the amplitudes themselves is that of the map
        return SAFETY * float((wrong + ROUNDING * np.maximum(apart - 1, 0)).max())


def expand(samples: AmplitudeSamples, sines: tuple[float, float], tolerance: float, asked: float) -> AspectExpansion:
    """The shortest expansion between two sines whose error is at most `tolerance`; asked  the whole tolerance, for the
    message."""
    amplitudes, some = samples.amplitudes, samples.some
    grid_s, grid_f = np.linspace(*sines, ASPECTS), np.unique(np.linspace(*samples.band, FREQUENCIES))
    columns = [(s, f) for f in grid_f.tolist() for s in grid_s.tolist()]
    made = np.stack([amplitudes(some, s, f) for s, f in columns], axis=-1)  # (n, polarizations, columns)
    n_pol = made.shape[1]
    matrix = made.reshape(-1, len(columns)) * np.repeat(samples.weight, n_pol)[:, None]
    order, best = _pivots(matrix, RANKS[-1]), np.inf
    for rank in (min(rank, len(order)) for rank in RANKS):
        picked = order[:rank]
        rows = _pivots(matrix[:, picked].conj().T, rank)
        inverse = np.linalg.pinv(made.reshape(-1, len(columns))[np.ix_(rows, picked)], rcond=1e-10)
        sine_j, frequency_j = (np.array([columns[i][axis] for i in picked]) for axis in (0, 1))
        expansion = AspectExpansion(amplitudes, sine_j, frequency_j, some[rows // n_pol], rows % n_pol, inverse, 0.0)
        error = samples.error(expansion)
        best = min(best, error)
        if error <= tolerance:
            return replace(expansion, error=error)
        if rank == len(order):
            break
    raise ToleranceUnreachable(
        asked,
        None,
        "amplitudes that change along the track",
        "use echo, which computes them pulse by pulse",
        how=f"by spectral_echo: {len(order)} functions of aspect leave {best:.1e} of these scatterers' amplitudes",
    )


def one_function(samples: AmplitudeSamples, sine: float) -> AspectExpansion:
    """The expansion of SARAS: amplitudes at one sine, and the pattern of the strongest sampled scatterer for all."""
    frequency = sum(samples.band) / 2
    made = samples.amplitudes(samples.some, sine, frequency)
    row, polarization = np.unravel_index(int(np.argmax(np.abs(made))), made.shape)
    value = made[row, polarization]
    found = AspectExpansion(
        samples.amplitudes, np.array([sine]), np.array([frequency]), samples.some[[row]], np.array([polarization]),
        np.array([[1 / value if value else 0.0]]), 0.0,
    )  # fmt: skip
    return replace(found, error=samples.error(found))


def _pivots(matrix: np.ndarray, most: int) -> np.ndarray:
    """Columns of a matrix that span it, as pivoted Gram-Schmidt takes them: up to `most`, at least one.

    Written out because LAPACK's pivoted QR of such small matrices was measured to take a second where threads are busy.
    """
    found: list[int] = []
    rest, first = matrix.copy(), 0.0
    for _ in range(min(most, *matrix.shape)):
        power = (rest.real**2 + rest.imag**2).sum(axis=0)
        at = int(np.argmax(power))
        first = first or float(power[at])
        if found and power[at] <= 1e-24 * first:
            break
        found.append(at)
        if power[at] == 0:
            break
        direction = rest[:, at] / np.sqrt(power[at])
        rest -= np.outer(direction, direction.conj() @ rest)
    return np.array(found)
