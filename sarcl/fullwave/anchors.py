"""Echoes along a track from few runs: at each pulse a weighted sum of the echoes formed from several anchors."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ._anchor_model import NEAR, AnchorModel, anchor_model

FIRST = (0.03, 0.5, 0.97)  # first anchors, of the arc
LEAST = 4  # anchors before any end: estimates of three are too low, and one anchor at least is predicted first
OVERHANG = 0.1  # spacings beyond the first and the last of equispaced anchors: ends of sums are weak otherwise
ENOUGH = 0.7  # of the tolerance: predicted error at which no further anchor is run, because it is an estimate;
ENOUGH_OF_FEW = 0.25  # of the tolerance, with LEAST anchors
APART = 0.25  # mean spacings: a mirrored anchor closer to another one predicts it, and hides what lies between others
SAME = 1e-5  # of the arc: pulses that are closer have one direction, and no interpolation goes between them


@dataclass(frozen=True)
class Check:
    """An anchor that was predicted from the others before its run: relative errors of echoes near its pulse."""

    pulse: int
    predicted: float
    found: float


@dataclass(frozen=True, eq=False)
class Anchored:
    """Echoes of all pulses, and how they were found.

    samples          complex64 (P, Q, F)
    pulses           numbers of the anchors' pulses, ascending (n,)
    predicted_error  estimate of the relative error of samples: root of the energy of the difference to runs of each
                     pulse over that of the echoes; nan with one anchor
    history          number of anchors and predicted error, of the first anchors and after each that was added
    checks           predictions of the anchors that were added
    """

    samples: np.ndarray
    pulses: np.ndarray
    predicted_error: float
    history: list[tuple[int, float]]
    checks: list[Check]


def anchored(
    formed: Callable[[int], np.ndarray],
    along: np.ndarray,
    *,
    anchors: str | int | np.ndarray = "auto",
    tolerance: float = 3e-2,
    mirror: np.ndarray | None = None,
) -> Anchored:
    """Echoes of P pulses to a tolerance.

    formed     formed(pulse): the echoes of all pulses that the currents of an anchor at this pulse form (P, Q, F)
    along      directions of the pulses along their path as seen from the target, rad, ascending or descending (P,)
    anchors    "auto": as many as the tolerance needs; a number of anchors, equispaced; or the numbers of their pulses
    tolerance  relative error of the echoes, as Anchored.predicted_error
    mirror     for each pulse the number of the pulse whose anchor the same run serves by symmetry, or -1 (P,)
    """
    search = anchor_search(along, anchors=anchors, tolerance=tolerance, mirror=mirror)
    pulses = next(search)
    while True:
        try:
            pulses = search.send([formed(pulse) for pulse in pulses])
        except StopIteration as end:
            return end.value


def anchor_search(
    along: np.ndarray,
    *,
    anchors: str | int | np.ndarray = "auto",
    tolerance: float = 3e-2,
    mirror: np.ndarray | None = None,
) -> Search:
    """As `anchored`, for callers that run several anchors at a time: yields the pulses of anchors that are to be run,
    is sent the echoes (P, Q, F) of each, and returns the result. Only with anchors="auto" it yields more than once.
    """
    work = _Work(np.asarray(along, float), mirror)
    if not isinstance(anchors, str):
        yield from work.run(np.atleast_1d(anchors) if np.ndim(anchors) else _equispaced(work.along, int(anchors)))
        return work.result()
    yield from work.run(_nearest(work.along, np.array(FIRST)))
    while work.model is not None and work.worst is not None:
        n = len(work.got)
        if n >= LEAST and work.predicted_error <= tolerance * (ENOUGH if n > LEAST else ENOUGH_OF_FEW):
            break
        yield from work.check_and_run(work.worst)
    return work.result()


Runs = Generator[list[int], list[np.ndarray], None]  # pulses of anchors to be run, and the echoes of each
Search = Generator[list[int], list[np.ndarray], Anchored]


class _Work:
    """Anchors that have been run, and the echoes from them."""

    def __init__(self, along: np.ndarray, mirror: np.ndarray | None) -> None:
        self._mirror = mirror
        self.along = along if along[-1] >= along[0] else -along
        self.got: dict[int, np.ndarray] = {}
        self.history: list[tuple[int, float]] = []
        self.checks: list[Check] = []

    def run(self, pulses: np.ndarray) -> Runs:
        """Run anchors, and what a mirror gives with them, and interpolate; one anchor serves each direction."""
        numbers = list(self.got)
        for pulse in pulses:
            for number in (int(pulse), *self._twin(int(pulse), numbers)):
                if not self._served(numbers)[number]:
                    numbers.append(number)
        new = numbers[len(self.got) :]
        self.got |= dict(zip(new, (yield new) if new else [], strict=True))
        self.pulses = np.array(sorted(self.got))
        several = len(self.pulses) > 1
        every = np.stack([self.got[int(pulse)] for pulse in self.pulses])
        self.model: AnchorModel | None = anchor_model(every, self.pulses, self.along) if several else None
        weights = self.model.weights if self.model else np.full((len(every), len(self.along)), 1 / len(every))
        self.samples = np.einsum("ap,apqf->pqf", weights.astype(np.float32), every).astype(np.complex64)
        error = self.model.error.sum() if self.model else 0.0 if np.ptp(self.along) == 0 else np.nan
        power = float((np.abs(self.samples) ** 2).sum(dtype=np.float64))
        self.predicted_error = float(np.sqrt(error / power)) if power else 0.0  # a body of permittivity 1 has no echo
        self.history.append((len(self.got), self.predicted_error))

    def _twin(self, pulse: int, anchors: list[int]) -> list[int]:
        """The pulse whose anchor the run of a pulse serves too; none where it is close to another of the anchors."""
        twin = -1 if self._mirror is None else int(self._mirror[pulse])
        if twin < 0:
            return []
        others = self.along[[pulse, *anchors]]
        apart = APART * float(np.ptp(self.along)) / max(LEAST, len(anchors) + 1)
        return [twin] if np.abs(others - self.along[twin]).min() > apart else []

    def _served(self, anchors: Iterable[int]) -> np.ndarray:
        """Which pulses have the direction of an anchor, bool (P,)."""
        places = self.along[list(anchors)]
        return (np.abs(self.along[:, None] - places) <= SAME * np.ptp(self.along)).any(axis=1)

    @property
    def worst(self) -> int | None:
        """The pulse of the largest error, in the interval between anchors that has most of it; None: no interval."""
        assert self.model is not None
        error = np.where(self._served(self.got), 0.0, self.model.error)
        ends = [(-1, int(self.pulses[0])), *pairwise(self.pulses.tolist()), (int(self.pulses[-1]), len(self.along))]
        energy = [float(error[a + 1 : b].sum()) if b - a > 1 else -1.0 for a, b in ends]
        first, last = ends[int(np.argmax(energy))]
        if max(energy) <= 0:
            return None
        return first + 1 + int(np.argmax(error[first + 1 : last]))

    def check_and_run(self, pulse: int) -> Runs:
        """Run an anchor, and compare its echoes near its pulse with their prediction from the others."""
        assert self.model is not None
        weights, expected = self.model.weights[:, pulse], float(self.model.error[pulse])
        reach = NEAR * np.abs(self.along[self.pulses] - self.along[pulse]).min()
        near = np.abs(self.along - self.along[pulse]) <= reach
        guess = sum(w * self.got[int(a)][near] for a, w in zip(self.pulses, weights, strict=True))
        yield from self.run(np.array([pulse]))
        own = self.got[pulse][near]
        energy = (np.abs(own) ** 2).sum()
        error = np.sqrt((np.abs(guess - own) ** 2).sum() / energy)
        self.checks.append(Check(pulse, float(np.sqrt(expected * near.sum() / energy)), float(error)))

    def result(self) -> Anchored:
        return Anchored(self.samples, self.pulses, self.predicted_error, self.history, self.checks)


def _equispaced(along: np.ndarray, number: int) -> np.ndarray:
    """Numbers of pulses at equispaced directions; the middle for one anchor."""
    edge = OVERHANG / (number - 1 + 2 * OVERHANG)
    return _nearest(along, np.linspace(edge, 1 - edge, number) if number > 1 else np.array([0.5]))


def _nearest(along: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Numbers of the pulses nearest to shares of the arc, each once."""
    places = along[0] + share * (along[-1] - along[0])
    return np.unique(np.abs(along[:, None] - places).argmin(axis=0))
