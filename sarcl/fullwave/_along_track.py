"""Sums over cells along a smooth track: computed at some pulses, interpolated at the others, verified at a few.

With the phase of the centre removed, a sum over cells changes no faster along the track than the phase of the
farthest cell. Measured in that phase, t, its spectrum ends at 1 rad per rad: polynomials of a degree little above half
the change of t over a stretch follow it. They are fitted at pulses close to Chebyshev nodes. Where pulses that were
left out of the fit disagree, for example on a track that shakes, all pulses of the stretch are computed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..numerics.polynomials import chebyshev

POWER = 8  # of the mean over corners
LONGEST = 128.0  # rad: change of t over a stretch
FITTED = 1.2  # pulses in a fit, over its polynomials
CHECKED = 8  # pulses per stretch that verify the fit
ACCURATE = 3e-4  # relative error at these, below which the others are interpolated
WORTH = 0.6  # of the pulses: where more are needed for the fit, all are computed


def farthest_phase(lengths: np.ndarray, k: float) -> np.ndarray:
    """t of each pulse, rad (P,): the phase that the cell passes which passes most, added up along the track.

    lengths  paths of P pulses by the corners of the target's box, less those by its centre, m (P, 8)
    """
    # At least two corners have the largest change. A mean of high power is smooth where others take their place.
    change = (4 * (np.diff(lengths, axis=0) ** POWER).mean(axis=1)) ** (1 / POWER)
    return np.concatenate([[0.0], k * np.cumsum(change)])


def along_track(
    exact: Callable[[np.ndarray], np.ndarray], echoes: Callable[[np.ndarray, np.ndarray], np.ndarray], t: np.ndarray
) -> np.ndarray:
    """Sums of P pulses, complex128 (P, m).

    exact   exact(pulses): sums of pulses of these numbers (n, m)
    echoes  echoes(pulses, sums): what is made of them, by which the error is measured
    t       of farthest_phase (P,)
    """
    stretches = _stretches(t)
    fits = [_fit(t[s]) for s in stretches]
    found: list[np.ndarray] = []  # numbers of the pulses that are computed, of each stretch
    for stretch, (fitted, checked) in zip(stretches, fits, strict=True):
        found.append(stretch[np.sort(np.concatenate([fitted, checked]))])
    values = exact(np.concatenate(found))
    out = np.empty((len(t), *values.shape[1:]), values.dtype)
    out[np.concatenate(found)] = values
    failed = []
    for stretch, (fitted, checked) in zip(stretches, fits, strict=True):
        if not len(checked):
            continue
        guess = _polynomials(t[stretch], len(fitted)) @ _solved(t[stretch], fitted, out[stretch[fitted]])
        pulses = stretch[checked]
        known = echoes(pulses, out[pulses])
        missed = echoes(pulses, guess[checked]) - known
        others = np.setdiff1d(np.arange(len(stretch)), np.concatenate([fitted, checked]))
        if np.linalg.norm(missed) <= ACCURATE * np.linalg.norm(known):
            out[stretch[others]] = guess[others]
        else:
            failed.append(stretch[others])
    if failed:
        out[np.concatenate(failed)] = exact(np.concatenate(failed))
    return out


def _stretches(t: np.ndarray) -> list[np.ndarray]:
    """Numbers of the pulses of each stretch."""
    parts = max(1, int(np.ceil((t[-1] - t[0]) / LONGEST)))
    number = np.minimum(((t - t[0]) / max(t[-1] - t[0], 1e-300) * parts).astype(int), parts - 1)
    return [pulses for pulses in (np.flatnonzero(number == n) for n in range(parts)) if len(pulses)]


def _terms(t: np.ndarray) -> int:
    """Polynomials that follow a band limit of 1 rad per rad over a stretch to about 1e-5."""
    half = np.ptp(t) / 2
    return int(half + 4 * half ** (1 / 3) + 7)


def _fit(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers within a stretch of pulses to fit and of pulses to check; none to check where all are computed."""
    terms, every = _terms(t), np.arange(len(t))
    n_nodes = int(np.ceil(FITTED * terms))
    if n_nodes + CHECKED > WORTH * len(t):
        return every, every[:0]
    nodes = chebyshev((t[0] + t[-1]) / 2, np.ptp(t), n_nodes)
    fitted = np.unique([0, len(t) - 1, *np.abs(t[:, None] - nodes).argmin(axis=0)])
    others = np.setdiff1d(every, fitted)
    return fitted, others[np.linspace(0, len(others) - 1, CHECKED + 2).astype(int)[1:-1]]


def _polynomials(t: np.ndarray, n_fitted: int) -> np.ndarray:
    """Chebyshev polynomials over a stretch (n, terms), fewer than pulses in the fit."""
    x = 2 * (t - t[0]) / max(t[-1] - t[0], 1e-300) - 1
    return np.asarray(np.polynomial.chebyshev.chebvander(x, min(_terms(t), n_fitted) - 1))


def _solved(t: np.ndarray, fitted: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients of the polynomials that are closest to values (n, m) at the pulses of the fit."""
    return np.asarray(np.linalg.lstsq(_polynomials(t, len(fitted))[fitted], values, rcond=None)[0])
