"""Echoes along a track from few runs: at each pulse a weighted sum of the echoes from several anchors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..numerics.polynomials import lagrange

POINTS = 4  # anchors of a weighted sum: local cubic
FIRST = 5  # anchors before any interval is bisected


@dataclass(frozen=True, eq=False)
class Anchored:
    """Echoes of all pulses, and how they were found.

    samples          complex64 (P, Q, F)
    pulses           numbers of the anchors' pulses, ascending (n,)
    predicted_error  estimate of the error of samples: root of the energy of the difference over that of the echoes;
                     nan with one anchor
    history          (number of anchors, predicted error) after each anchor
    """

    samples: np.ndarray
    pulses: np.ndarray
    predicted_error: float
    history: list[tuple[int, float]]


def anchored(
    formed: Callable[[int], np.ndarray], along: np.ndarray, *, anchors: str | int | np.ndarray = "auto",
    tolerance: float = 3e-2, progress: Callable[[str, int, int], None] | None = None,
) -> Anchored:  # fmt: skip
    """Echoes of P pulses to a tolerance.

    formed     formed(pulse): the echoes of all pulses that the currents of an anchor at this pulse form (P, Q, F)
    along      directions of the pulses along their path as seen from the target, rad, ascending or descending (P,)
    anchors    "auto": as many as the tolerance needs; a number of anchors, equispaced; or the numbers of their pulses
    tolerance  relative error of the energy of all echoes
    """
    along = np.asarray(along, float) * (1 if along[-1] >= along[0] else -1)
    got: dict[int, np.ndarray] = {}
    history: list[tuple[int, float]] = []

    def run(pulse: int) -> None:
        got[pulse] = formed(pulse)
        if progress:
            progress("anchors", len(got), len(got) + 1)

    auto = isinstance(anchors, str)
    number = FIRST if auto else anchors
    for pulse in np.atleast_1d(number) if np.ndim(number) else _equispaced(along, int(number)):
        run(int(pulse))
    error = np.full(len(along), np.nan)
    while True:
        pulses = np.array(sorted(got))
        samples = _interpolated(got, along, pulses, np.arange(len(along)))
        if len(pulses) > 1:
            error = _left_out(got, along, pulses)
        energy = (np.abs(samples) ** 2).sum()
        history.append((len(pulses), float(np.sqrt(error.sum() / energy))))
        wide = np.diff(pulses) > 1
        if not auto or history[-1][1] <= tolerance or not wide.any():
            return Anchored(samples, pulses, history[-1][1], history)
        share = [error[a:b].sum() if b - a > 1 else -1.0 for a, b in pairwise(pulses)]
        worst = int(np.argmax(share))
        middle = np.mean(along[pulses[worst : worst + 2]])
        inner = np.arange(pulses[worst] + 1, pulses[worst + 1])
        run(int(inner[np.argmin(np.abs(along[inner] - middle))]))


def _equispaced(along: np.ndarray, number: int) -> np.ndarray:
    """Numbers of the pulses nearest to equispaced directions."""
    wanted = np.linspace(along[0], along[-1], number) if number > 1 else [(along[0] + along[-1]) / 2]
    return np.unique([np.argmin(np.abs(along - place)) for place in wanted])


def _interpolated(got: dict[int, np.ndarray], along: np.ndarray, anchors: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The echoes of pulses `at` from anchors at these pulses."""
    out = np.zeros((len(at), *got[int(anchors[0])].shape[1:]), np.complex64)
    first = np.clip(np.searchsorted(anchors, at, "right") - POINTS // 2, 0, max(0, len(anchors) - POINTS))
    for begin in np.unique(first):
        here = np.flatnonzero(first == begin)
        near = anchors[begin : begin + POINTS]
        weights = lagrange(along[near], along[at[here]])
        for anchor, weight in zip(near, weights, strict=True):
            out[here] += weight[:, None, None].astype(np.float32) * got[int(anchor)][at[here]]
    return out


def _left_out(got: dict[int, np.ndarray], along: np.ndarray, pulses: np.ndarray) -> np.ndarray:
    """Energy of the error of each pulse: that of each anchor's echoes predicted without it, to its neighbours' middles,
    less by the power of the spacing."""
    out = np.zeros(len(along))
    edges = np.concatenate([[0], (pulses[1:] + pulses[:-1] + 1) // 2, [len(along)]])
    for i, pulse in enumerate(pulses):
        others = np.delete(pulses, i)
        at = np.arange(edges[i], edges[i + 1])
        near = others[np.argsort(np.abs(along[others] - along[pulse]))[:POINTS]]
        weights = lagrange(along[near], along[[pulse]])[:, 0]
        guess = sum(w * got[int(a)][at] for a, w in zip(near, weights, strict=True))
        out[at] = (np.abs(guess - got[int(pulse)][at]) ** 2).sum(axis=(1, 2)) / 4 ** min(POINTS, len(near))
    out[pulses] = 0  # an anchor's pulse has the echoes of its own run
    return out
