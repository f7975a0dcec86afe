"""Beams of all orders at pulses that are looked at together, as many of them at a time as memory holds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ...base.boxes import box
from . import _occlusion
from ._beams import Beams, Surfaces, extended, first, first_facets, halved, reached
from ._facet_tree import MOST_PAIRS
from ._polygons import Polygons, TooManyAtOnce
from ._weak_beams import Budget

MOST_TURN = 0.05  # rad, by which directions to antennas differ within a block of pulses


@dataclass(frozen=True)
class BeamLimits:
    """How beams are looked for.

    many        facets that a beam may reach, on average, from which on shadows on single facets are looked at first
    most_pairs  of a beam and a facet that are looked at together
    most_ways   from facet to facet, of the first two reflections, that are followed
    """

    many: float = 30.0
    most_pairs: int = MOST_PAIRS
    most_ways: int = MOST_PAIRS


@dataclass(frozen=True, eq=False)
class LitBeams:
    """Beams whose last facet is lit, their pulses counted from 0, and pieces that receivers see, of beams `of` (n,).

    n_pairs  of a beam and a facet that were looked at;  n_weak  beams that were left out
    """

    beams: Beams
    pieces: Polygons
    of: np.ndarray
    n_pairs: int
    n_weak: int

    def part(self, rows: np.ndarray) -> LitBeams:
        """The beams `rows`, rising (n,)."""
        own = np.flatnonzero(np.isin(self.of, rows))
        return LitBeams(self.beams[rows], self.pieces[own], np.searchsorted(rows, self.of[own]), 0, 0)


@dataclass(frozen=True, eq=False)
class Paths:
    """Ways of waves from transmitters over facets to receivers, m (n, 3).

    bounces  of the last order
    """

    surfaces: Surfaces
    tx: np.ndarray
    rx: np.ndarray
    bounces: int
    limits: BeamLimits

    @cached_property
    def turn(self) -> float:
        """Angle, rad, by which directions from any facet to antennas differ from those to the middle one."""
        return max(_turn(self.surfaces, self.tx), _turn(self.surfaces, self.rx))

    @cached_property
    def sides_lit(self) -> np.ndarray:
        """Sides of facets that a transmitter sees, as of `sides_seen`."""
        return _occlusion.sides_seen(self.surfaces, self.tx, self.turn)

    @cached_property
    def sides_seen(self) -> np.ndarray:
        """Sides of facets that a receiver sees."""
        if np.array_equal(self.tx, self.rx):
            return self.sides_lit
        return _occlusion.sides_seen(self.surfaces, self.rx, self.turn)

    @cached_property
    def first_facets(self) -> tuple[np.ndarray, int]:
        """Facets from which waves may reach others, and in how many ways."""
        return first_facets(self.surfaces, self.tx, self.turn)

    def followed(self, budget: Budget) -> Iterator[LitBeams]:
        """Beams from order 2 on, less weak ones of the last order."""
        return self._after(first(self.surfaces, self.tx, self.first_facets[0]), budget)

    def _after(self, beams: Beams, budget: Budget) -> Iterator[LitBeams]:
        """Beams with more reflections than these: of a part of the chains after the other where not all fit."""
        if beams.order == self.bounces or not len(beams):
            return

        def next_of(chains: slice) -> tuple[Beams, int, int, np.ndarray]:
            return self._next(beams.of_chains(chains), budget)

        for longer, n_pairs, n_weak, spent in halved(len(beams.chains), next_of):
            budget.spent += spent
            for part in halved(len(longer.chains), partial(self._seen, longer)):
                yield LitBeams(*part, n_pairs, n_weak)
                yield from self._after(part[0], budget)
                n_pairs = n_weak = 0

    def _next(self, beams: Beams, budget: Budget) -> tuple[Beams, int, int, np.ndarray]:
        """The beams after one reflection more, without shadows; the numbers of a LitBeams; and what weak ones spend."""
        surfaces, turn, rx = self.surfaces, self.turn, self.rx
        is_last = beams.order == self.bounces - 1
        pairs, sides = reached(surfaces, beams, turn), None
        if len(pairs[0]) > self.limits.many * len(beams.chains):  # what is in shadow is worth knowing before
            if beams.order == 1:
                facet, normal = beams.chains[:, 0], beams.normals[:, 0]
                is_lit = self.sides_lit[facet, surfaces.side(facet, normal)]
                beams = beams[np.flatnonzero(is_lit[beams.chain])]
                pairs = reached(surfaces, beams, turn)
            if is_last:
                sides = self.sides_seen
        number = np.diff(np.append(beams.first_of, len(beams)))[pairs[0]].sum()
        if number > self.limits.most_pairs and len(beams.chains) > 1:
            raise TooManyAtOnce
        beams, n_pairs = extended(surfaces, beams, *pairs, rx if is_last else None, sides)
        n_beams, spent = len(beams), np.zeros(len(rx))
        if is_last:
            beams, spent = budget.strong(beams)
        return beams, n_pairs, n_beams - len(beams), spent

    def _seen(self, beams: Beams, chains: slice) -> tuple[Beams, Polygons, np.ndarray]:
        """Beams of these chains of which something is lit, and what receivers see of them, as LitBeams have it."""
        surfaces, turn, beams = self.surfaces, self.turn, beams.of_chains(chains)
        pieces, of = _occlusion.lit(surfaces, beams, turn)
        arrives = np.bincount(of, minlength=len(beams)) > 0
        beams, of = beams[np.flatnonzero(arrives)], (np.cumsum(arrives) - 1)[of]
        return beams, *_occlusion.seen(surfaces, beams, pieces, of, self.rx[beams.pulse], turn)

    def unshaded(self, beams: Beams) -> tuple[Polygons, np.ndarray]:
        """What receivers see of beams less all shadows: pieces, and the beam of each (n,)."""
        pieces, of = _occlusion.lit(self.surfaces, beams, self.turn)
        return _occlusion.seen(self.surfaces, beams, pieces, of, self.rx[beams.pulse], self.turn)


def blocks(surfaces: Surfaces, tx: np.ndarray, rx: np.ndarray, most: int) -> Iterator[slice]:
    """Slices of up to `most` pulses with antennas, m (n, 3), that turn little within each."""
    begin = 0
    while begin < len(tx):
        number = min(most, len(tx) - begin)
        while number > 1 and max(_turn(surfaces, end[begin : begin + number]) for end in (tx, rx)) > MOST_TURN:
            number = -(-number // 2)
        yield slice(begin, begin + number)
        begin += number


def _turn(surfaces: Surfaces, antennas: np.ndarray) -> float:
    low, high = box(surfaces.corners.reshape(-1, 3))
    middle = antennas[len(antennas) // 2]
    step = float(np.linalg.norm(antennas - middle, axis=1).max())
    if not step:
        return 0.0
    distance = float(np.linalg.norm(antennas - np.clip(antennas, low, high), axis=1).min())
    return float(2 * np.arcsin(min(1.0, step / (2 * distance)))) if distance else float(np.pi)
