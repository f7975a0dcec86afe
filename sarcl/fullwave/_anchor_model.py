"""Interpolation between anchors by their correlation over direction, with its error: kriging.

At one pulse, the echo that an anchor's currents form is a function of the anchor's direction: a constant that is not
known, for currents that follow the incident wave, and a rest, for paths by other cells. The rest is taken as a random
function whose correlation over direction is one of FAMILIES of one rate. Family and rate are those under which each
anchor, predicted from the others, is most likely.
Source: O. Dubrule, Math. Geology 15 (1983), for predictions that leave one anchor out; docs/theory/waveform_forming.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# Correlations over rate times angle. Spectra: a Gaussian, even up to the rate, a triangle, and one with slow decay.
FAMILIES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "gaussian": lambda x: np.exp(-(x**2) / 2),
    "sinc": lambda x: np.sinc(x / np.pi),
    "sinc squared": lambda x: np.sinc(x / (2 * np.pi)) ** 2,
    "matern": lambda x: (1 + np.sqrt(5) * np.abs(x) + 5 / 3 * x**2) * np.exp(-np.sqrt(5) * np.abs(x)),
}
RATES = 36  # rates that are tried per family,
SLOWEST, FASTEST = 0.05, 4.5  # rad over the mean and over the least spacing of the anchors
NOISE = 1e-10  # variance without correlation, for stable inverses: with 1e-7, echoes at anchors were not their own
NEAR = 0.25  # spacings from an anchor: pulses in which its prediction is compared with its echoes
REACH = 2.0  # mean spacings over which the scale of the error at an anchor holds


@dataclass(frozen=True, eq=False)
class _Fit:
    """One family and rate: its likelihood, and the error of each anchor's prediction over the expected one (n,)."""

    family: str
    rate: float
    loss: float
    scale: np.ndarray


@dataclass(frozen=True, eq=False)
class AnchorModel:
    """Weights of anchors, and error energies, at each pulse.

    weights (n, P);  error (P,): expected energy of the error of the weighted sum, over receivers and frequencies
    """

    weights: np.ndarray
    error: np.ndarray


def anchor_model(formed: np.ndarray, anchors: np.ndarray, along: np.ndarray) -> AnchorModel:
    """The model that echoes `formed` (n, P, Q, F) from n anchors, pulses of these numbers (ascending), show.

    The error is the geometric mean of those of the likeliest model and of the likeliest Gaussian one, because the
    likeliest of several models promises too much.
    """
    place, at = along[anchors], along
    spacing = float(np.ptp(place)) / (len(anchors) - 1)
    near = [np.abs(along - along[a]) <= NEAR * abs(gap) for a, gap in zip(anchors, np.gradient(place), strict=True)]
    energy = np.array([_products(formed[:, here]) / here.sum() for here in near])
    rates = np.geomspace(SLOWEST / spacing, FASTEST / np.diff(place).min(), RATES)
    fits = {family: _likeliest(family, rates, place, energy) for family in FAMILIES}
    best = min(fits.values(), key=lambda fit: fit.loss)
    closeness = np.exp(-np.abs(at[:, None] - place) / (REACH * spacing))
    closeness /= closeness.sum(axis=1, keepdims=True)
    weights, variance = _solved(best, place, at)
    _, gaussian = _solved(fits["gaussian"], place, at)
    error = np.sqrt(variance * (closeness @ best.scale) * gaussian * (closeness @ fits["gaussian"].scale))
    return AnchorModel(weights, error)


def _products(formed: np.ndarray) -> np.ndarray:
    """Products of the echoes of each two anchors, summed over pulses: real (n, n)."""
    flat = formed.reshape(len(formed), -1)
    return np.asarray((flat.conj() @ flat.T).real, np.float64)


def _correlation(family: str, rate: float, place: np.ndarray) -> np.ndarray:
    return FAMILIES[family](rate * (place[:, None] - place)) + NOISE * np.eye(len(place))


def _likeliest(family: str, rates: np.ndarray, place: np.ndarray, energy: np.ndarray) -> _Fit:
    """The rate under which predictions of each anchor from the others are most likely.

    With P the inverse of the correlation less its part along a constant, the prediction of anchor i misses by (P y)_i
    over P_ii, and is expected to miss by a variance of 1/P_ii.
    """
    fits = []
    for rate in rates:
        inverse = np.linalg.inv(_correlation(family, rate, place))
        rows = inverse.sum(axis=0)
        residual = inverse - np.outer(rows, rows) / rows.sum()
        expected = 1 / np.diag(residual)
        if not (np.isfinite(expected) & (expected > 0)).all():
            continue
        miss = residual * expected[:, None]
        scale = np.einsum("ia,iab,ib->i", miss, energy, miss) / expected
        scale = np.maximum(scale, np.finfo(np.float64).tiny)
        fits.append(_Fit(family, float(rate), float(np.log(expected).mean() + np.log(scale.mean())), scale))
    return min(fits, key=lambda fit: fit.loss)


def _solved(fit: _Fit, place: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights (n, P), which add up to 1, and the variance of the prediction (P,), for a unit variance."""
    n = len(place)
    system, right_side = np.ones((n + 1, n + 1)), np.ones((n + 1, len(at)))
    system[:n, :n], system[n, n] = _correlation(fit.family, fit.rate, place), 0
    right_side[:n] = FAMILIES[fit.family](fit.rate * (place[:, None] - at))
    solution = np.linalg.solve(system, right_side)
    return solution[:n], np.maximum(1 + NOISE - (solution * right_side).sum(axis=0), 0)
