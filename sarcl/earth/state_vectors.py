"""Interpolation of state vectors: the order is chosen from the states, by leaving each of them out in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base import wgs84
from ..base.vectors import Floats
from .rotation import GM, spin

LEAST_STATES = 4
# Numbers of states per interpolation, cheapest first: Hermite uses velocities too, Lagrange positions alone.
HERMITE, LAGRANGE = (2, 3, 4, 5, 6, 7, 8), (4, 6, 8, 10, 12, 14)
ORDER_MARGIN = 1.5  # ratio to the least error of all orders: the cheapest order within it is taken
FINE = 1e-7  # interpolation error, m, that needs no higher order
WORST = 1.0  # m: states that do not fit their neighbours better are refused
VELOCITY_MISFIT = 1.0  # m/s: the same of velocities
DEEPEST = -20e3  # m: positions farther below the ellipsoid are refused
MISFIT = 0.01  # error of accelerations over gravity and the Earth's rotation: J2 causes 0.003
INERTIAL = 0.004  # the same error where the states accelerate as in an inertial frame
GAP = 2.1  # ratio of a gap to the usual spacing: leaving out a state measures the error over twice the spacing
BLOCK = 32_768  # times that are interpolated at once


@dataclass(frozen=True, eq=False)
class StateVectors:
    """States and how they are interpolated.

    times, positions, velocities   s (n,), m and m/s (n, 3), Earth-fixed
    n_nodes      states that one interpolation uses
    hermite      whether it uses their velocities too: its degree is then 2 n_nodes - 1, else n_nodes - 1
    left_out     largest distance, m, between a state and its interpolation from the others: the error over twice
                 the spacing, which no error between the states exceeds
    """

    times: Floats
    positions: Floats
    velocities: Floats
    n_nodes: int
    hermite: bool
    left_out: float

    @classmethod
    def fitted(cls, times: Floats, positions: Floats, velocities: Floats | None) -> StateVectors:
        """The states with the interpolation that predicts each of them best from the others.

        velocities  None: the derivatives of Lagrange polynomials through the positions
        ValueError for too few states, times that do not increase, gaps, positions inside the Earth, velocities that are
        not the derivative of the positions, states that do not fit the others, and states that do not fall as
        satellites over the rotating Earth do.
        """
        _check_times(times)
        _check_heights(positions)
        if velocities is None:
            velocities = _slopes(times, positions, min(len(times), 8))
        else:
            _check_velocities(times, positions, velocities)
        candidates = []
        for hermite, counts in ((True, HERMITE), (False, LAGRANGE)):
            for n in counts:
                if n < len(times):
                    misfit = _leave_one_out(times, positions, velocities, n, hermite)
                    candidates.append((float(misfit.max()), n, hermite, int(misfit.argmax()) + 1))
        least = min(t[0] for t in candidates)
        error, n, hermite, worst = next(t for t in candidates if t[0] <= max(ORDER_MARGIN * least, FINE))
        if not error <= WORST:
            raise ValueError(
                f"positions[{worst}] (at {times[worst]:g} s) is {error:.3g} m away from the curve through the other "
                "states; correct or remove a wrong state, or give states at a closer spacing"
            )
        _check_fall(times, positions, velocities)
        return cls(times, positions, velocities, n, hermite, error)

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Positions, m, and velocities, m/s (n, 3), at times, s (n,), within those of the states."""
        positions, velocities = np.empty((len(times), 3)), np.empty((len(times), 3))
        before = np.searchsorted(self.times, times, side="right") - 1
        first = np.clip(before - (self.n_nodes - 1) // 2, 0, len(self.times) - self.n_nodes)
        for start in range(0, len(times), BLOCK):
            part = slice(start, start + BLOCK)
            nodes = first[part, None] + np.arange(self.n_nodes)
            positions[part], velocities[part] = interpolate(
                self.times[nodes], self.positions[nodes], self.velocities[nodes] if self.hermite else None, times[part]
            )
        return positions, velocities

    def describe(self) -> str:
        """Words for the computation of positions and its measured error."""
        step = np.median(np.diff(self.times))
        kind, used = ("Hermite", " and velocities") if self.hermite else ("Lagrange", "")
        degree = 2 * self.n_nodes - 1 if self.hermite else self.n_nodes - 1
        return (
            f"{len(self.times)} state vectors every {step:g} s, {kind} interpolation of degree {degree} through "
            f"positions{used} of {self.n_nodes} states; states left out are met to {self.left_out:.1e} m"
        )


def interpolate(nodes: Floats, positions: Floats, velocities: Floats | None, times: Floats) -> tuple[Floats, Floats]:
    """Positions, m, and their derivatives, m/s (n, 3), at times, s (n,), each from nodes of its own.

    nodes, positions, velocities   s (n, m), m and m/s (n, m, 3); without velocities: Lagrange, else Hermite
    Source: Hermite's formula sum_i l_i^2 ((1 - 2 l_i'(t_i)(t - t_i)) x_i + (t - t_i) v_i), l_i Lagrange's polynomials.
    """
    offset = times[:, None] - nodes
    value, slope, own = np.ones_like(nodes), np.zeros_like(nodes), np.zeros_like(nodes)
    for shift in range(1, nodes.shape[1]):
        gap = nodes - np.roll(nodes, -shift, axis=1)
        factor = np.roll(offset, -shift, axis=1) / gap
        slope = slope * factor + value / gap
        value = value * factor
        own += 1 / gap
    middle = positions[:, nodes.shape[1] // 2, None]  # what is summed are differences, which round less
    away = positions - middle
    if velocities is None:
        return middle[:, 0] + _sum(value, away), _sum(slope, away)
    tilt, square, steep = 1 - 2 * own * offset, value**2, 2 * value * slope
    out = middle[:, 0] + _sum(square * tilt, away) + _sum(square * offset, velocities)
    rate = _sum(steep * tilt - 2 * own * square, away) + _sum(steep * offset + square, velocities)
    return out, rate


def _sum(weights: Floats, values: Floats) -> Floats:
    return np.asarray(np.einsum("nm,nmk->nk", weights, values))


def _leave_one_out(times: Floats, positions: Floats, velocities: Floats, n: int, hermite: bool) -> Floats:
    """Distances, m, of all states but the first and the last from their interpolation by n neighbours."""
    k = np.arange(1, len(times) - 1)
    nodes = np.clip(k - n // 2, 0, len(times) - n - 1)[:, None] + np.arange(n)
    nodes += nodes >= k[:, None]
    predicted, _ = interpolate(times[nodes], positions[nodes], velocities[nodes] if hermite else None, times[k])
    return np.asarray(np.linalg.norm(predicted - positions[k], axis=1))


def _check_times(times: Floats) -> None:
    if len(times) < LEAST_STATES:
        raise ValueError(f"times has {len(times)} states; an orbit needs at least {LEAST_STATES}: give more states")
    steps = np.diff(times)
    if not (steps > 0).all():
        i = int(np.argmax(steps <= 0)) + 1
        what = "repeats" if times[i] == times[i - 1] else "is before"
        raise ValueError(
            f"times[{i}] = {times[i]:.9g} s {what} times[{i - 1}] = {times[i - 1]:.9g} s; times must increase: "
            "sort the states by time, and keep one of each"
        )
    usual = float(np.median(steps))
    if steps.max() > GAP * usual:
        i = int(np.argmax(steps))
        raise ValueError(
            f"the states have a gap of {steps[i]:g} s from times[{i}] = {times[i]:.9g} s on, where they are usually "
            f"{usual:g} s apart; give the missing states, or make one orbit before the gap and one after it"
        )


def _check_heights(positions: Floats) -> None:
    height = wgs84.geodetic(positions)[2]
    if (height < DEEPEST).any():
        i = int(np.argmin(height))
        raise ValueError(
            f"positions[{i}] is {np.linalg.norm(positions[i]):.7g} m from the Earth's centre, inside the Earth; give "
            "Earth-fixed positions in m: are they in km?"
        )


def _check_fall(times: Floats, positions: Floats, velocities: Floats) -> None:
    """ValueError where accelerations are not those of satellites over the rotating Earth, g - 2 w x v - w x (w x r)."""
    n_nodes = min(len(times), 8)
    inner = slice(1, -1)
    acceleration, coarser = (_slopes(times, velocities, n)[inner] for n in (n_nodes, n_nodes - 1))
    p, v = positions[inner], velocities[inner]
    gravity = -GM * p / np.linalg.norm(p, axis=1, keepdims=True) ** 3
    turn = -2 * spin(v) - spin(spin(p))

    def size(a: Floats) -> float:
        return float(np.sqrt((a**2).sum(axis=1).mean()))

    misfit, misfit_inertial = size(acceleration - gravity - turn), size(acceleration - gravity)
    scale, uncertainty = size(gravity) + size(turn), 10 * size(acceleration - coarser)
    is_inertial = misfit_inertial < 0.3 * misfit
    if misfit > (INERTIAL if is_inertial else MISFIT) * scale + uncertainty:
        why = (
            "these are positions and velocities in an inertial frame: turn both by the sidereal time into an "
            "Earth-fixed frame"
            if is_inertial
            else "check units (m, m/s, s) and the frame"
        )
        raise ValueError(
            f"the states accelerate by {size(acceleration):.4g} m/s^2, where gravity and the Earth's rotation cause "
            f"{size(gravity + turn):.4g} m/s^2 there; wanted Earth-fixed states of a satellite: {why}"
        )


def _check_velocities(times: Floats, positions: Floats, velocities: Floats) -> None:
    derived = [_slopes(times, positions, n) for n in (min(len(times), 8), min(len(times), 8) - 1)]
    uncertainty = np.linalg.norm(derived[0] - derived[1], axis=1)  # about the error of the derivative at this spacing
    misfit = np.linalg.norm(velocities - derived[0], axis=1)
    wrong = misfit > VELOCITY_MISFIT + 10 * uncertainty
    if wrong.any():
        worst = int(np.argmax(misfit - 10 * uncertainty))
        inertial = np.linalg.norm(velocities[worst] - derived[0][worst] - spin(positions[worst]))
        why = (
            "these are velocities in an inertial frame: subtract the cross product of the Earth's rotation and the "
            "position"
            if inertial < 0.05 * misfit[worst]
            else "check units (m, m/s, s) and the order of the states"
        )
        if 2 * wrong.sum() <= len(wrong):
            why = "trim these states, or derive the velocities from the positions: velocities=None"
        raise ValueError(
            f"velocities{_ranges(np.flatnonzero(wrong))} of {len(wrong)} differ by up to {misfit[wrong].max():.4g} m/s "
            f"from the derivative of the positions; wanted Earth-fixed velocities: {why}"
        )


def _ranges(rows: NDArray[np.int64]) -> str:
    """Indices of rows in brackets, such as [0, 97:100], six at most."""
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    words = [str(run[0]) if len(run) == 1 else f"{run[0]}:{run[-1] + 1}" for run in runs]
    return f"[{', '.join(words[:6])}{', ...' if len(words) > 6 else ''}]"


def _slopes(times: Floats, positions: Floats, n: int) -> Floats:
    """Derivatives of the positions at the states, m/s, by Lagrange interpolation through n of them."""
    k = np.arange(len(times))
    nodes = np.clip(k - n // 2, 0, len(times) - n)[:, None] + np.arange(n)
    return interpolate(times[nodes], positions[nodes], None, times)[1]
