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
from dataclasses import dataclass

import numpy as np

from ...base.errors import ToleranceUnreachable

# (indices of scatterers, sine (scalar or one for each), frequency, Hz) -> (n, n_polarizations), complex128
Amplitudes = Callable[[np.ndarray, "float | np.ndarray", float], np.ndarray]
RANKS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
SCATTERERS, ASPECTS, FREQUENCIES = 160, 48, 5  # samples from which the terms are chosen
CHECKED = 400  # pairs of scatterer and pulse at which the error is measured
SAFETY = 2.0  # the error is estimated from samples


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
        made = self.amplitudes(np.repeat(self.scatterers, n), np.tile(sines, m), frequency).reshape(m, n, -1)
        return np.asarray(self.inverse @ made[np.arange(m), :, self.polarizations])


def expand(
    amplitudes: Amplitudes, size: np.ndarray, sines: tuple[float, float], band: tuple[float, float],
    seen: Callable[[np.ndarray, np.random.Generator], np.ndarray], tolerance: float, asked: float,
) -> AspectExpansion:  # fmt: skip
    """The shortest expansion whose error is at most `tolerance`.

    size    (n,) of the scatterers, such as areas: large ones are drawn more often
    sines, band   limits of aspect and of frequency, Hz
    seen    (scatterers (n,), random) -> sines (n,) at which random pulses of the track see them
    asked   the whole tolerance, for the message
    """
    random = np.random.default_rng(0)
    chance = 0.5 / len(size) + (0.5 * size / size.sum() if size.any() else np.full(len(size), 0.5 / len(size)))
    chance /= np.sum(chance)
    n = min(SCATTERERS, len(size))
    some = np.sort(random.choice(len(size), n, replace=False, p=chance)) if n < len(size) else np.arange(n)
    grid_s = np.linspace(*sines, ASPECTS)
    grid_f = np.unique(np.linspace(*band, FREQUENCIES))
    columns = [(s, f) for f in grid_f.tolist() for s in grid_s.tolist()]
    made = np.stack([amplitudes(some, s, f) for s, f in columns], axis=-1)  # (n, polarizations, columns)
    n_pol = made.shape[1]
    matrix = made.reshape(n * n_pol, len(columns)) / np.sqrt(np.repeat(chance[some], n_pol))[:, None]
    order = _pivots(matrix, RANKS[-1])
    which, share = some, np.ones(0)
    if len(size) > n:
        which = random.choice(len(size), CHECKED, p=chance)
        share = 1 / chance[which]
    else:
        which = np.resize(some, CHECKED)
        share = np.ones(CHECKED)
    at = seen(which, random)
    frequencies = random.uniform(*band, 4)
    exact = np.stack([amplitudes(which, at, f) for f in frequencies.tolist()])
    total = float((share[:, None] * np.abs(exact) ** 2).sum())
    best = np.inf
    for rank in RANKS:
        rank = min(rank, len(order))
        picked = order[:rank]
        rows = _pivots(matrix[:, picked].conj().T, rank)
        core = made.reshape(n * n_pol, -1)[np.ix_(rows, picked)]
        inverse = np.linalg.pinv(core, rcond=1e-10)
        sine_j, frequency_j = (np.array([columns[i][axis] for i in picked]) for axis in (0, 1))
        # psi_j(s, f) = sum_i inverse[j, i] a_i(s, f)
        found = AspectExpansion(
            amplitudes, sine_j, frequency_j, some[rows // n_pol], rows % n_pol, inverse, 0.0
        )  # fmt: skip
        factors = np.stack([found.factors(which, j) for j in range(rank)], axis=-1)  # (checked, pol, J)
        wrong = 0.0
        for i, f in enumerate(frequencies.tolist()):
            functions = found.functions(at, f)  # (J, checked)
            guess = np.einsum("cpj,jc->cp", factors, functions)
            wrong += float((share[:, None] * np.abs(guess - exact[i]) ** 2).sum())
        error = SAFETY * float(np.sqrt(wrong / total)) if total else 0.0
        best = min(best, error)
        if error <= tolerance:
            return AspectExpansion(
                amplitudes, sine_j, frequency_j, found.scatterers, found.polarizations, inverse, error
            )
        if rank == len(order):
            break
    raise ToleranceUnreachable(
        asked, None, "amplitudes that change along the track", "use echo, which computes them pulse by pulse",
        how=f"by spectral_echo: {RANKS[-1]} functions of aspect leave {best:.1e} of these scatterers' amplitudes",
    )  # fmt: skip


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
