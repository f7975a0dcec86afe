"""Polynomials of time and of image coordinates: of the least degree that meets a bound, checked between the nodes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import Polynomial, polynomial

DEGREES = range(9)  # of a track in time
PLANE_DEGREES = range(6)  # of a field over an image, in each coordinate
NODES = 9  # along each side of an image, at which fields are fitted; they are checked at the places between


def track(times: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, float]:
    """Coefficients (degree + 1, 3) of positions, m (n, 3), by time, s (n,), and their largest error, m.

    The degree is the least whose error is below 1 mm, or that of the least error.
    """
    best, error = np.asarray(positions[:1]), np.inf
    for degree in DEGREES:
        if degree >= len(times):
            break
        parts = [np.asarray(Polynomial.fit(times, axis, degree).convert().coef, np.float64) for axis in positions.T]
        fit = np.stack([np.pad(part, (0, degree + 1 - len(part))) for part in parts], axis=1)
        miss = float(np.linalg.norm(at(fit, times) - positions, axis=1).max())
        if miss < error:
            best, error = fit, miss
        if error < 1e-3:
            break
    return best, error


def at(coefficients: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Positions (n, 3) of a track at times (n,)."""
    return np.asarray(polynomial.polyval(times, coefficients).T)


def nodes(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Image coordinates (row, column), m, of the nodes of a fit (81, 2), and of the checks between them (64, 2)."""
    share = np.linspace(0, 1, NODES)
    return tuple(
        low + (high - low) * np.stack(np.meshgrid(s, s, indexing="ij"), axis=-1).reshape(-1, 2)
        for s in (share, (share[1:] + share[:-1]) / 2)
    )


def surface(
    places: tuple[np.ndarray, np.ndarray], values: Callable[[np.ndarray], np.ndarray], bound: float
) -> tuple[np.ndarray, float]:
    """Coefficients (degree + 1, degree + 1) of a field by row and column coordinate, m, and its largest error.

    places  `nodes`;  values  of places (n, 2).  The degree is the least whose error is below `bound`, or the best.
    """
    fit_at, check_at = places
    side = np.abs(fit_at).max(axis=0)
    side[side == 0] = 1.0
    wanted, checks = values(fit_at), values(check_at)
    best, error = np.zeros((1, 1)), np.inf
    for degree in PLANE_DEGREES:
        terms = polynomial.polyvander2d(fit_at[:, 0] / side[0], fit_at[:, 1] / side[1], [degree, degree])
        scaled = np.linalg.lstsq(terms, wanted, rcond=None)[0].reshape(degree + 1, degree + 1)
        fit = scaled / np.outer(*(side[i] ** np.arange(degree + 1) for i in (0, 1)))
        misses = [polynomial.polyval2d(p[:, 0], p[:, 1], fit) - v for p, v in ((fit_at, wanted), (check_at, checks))]
        miss = float(np.abs(np.concatenate(misses)).max())
        if miss < error:
            best, error = np.asarray(fit), miss
        if error < bound:
            break
    return best, error
