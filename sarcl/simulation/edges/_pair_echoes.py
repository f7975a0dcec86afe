"""Amplitudes and delays of waves that pulses see from border to border."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.vectors import dot, unit
from ...scattering.double_diffraction import double_matrix
from ..spreading import ChannelView
from ._border_pairs import BorderPairs, Rays
from ._paths import common_part, paths_over, weigh, within_window


class PairEchoes:
    """Pairs of borders of one channel at one receiver. Coefficients are computed once for a pair, or for its pieces."""

    def __init__(self, pairs: BorderPairs, view: ChannelView) -> None:
        self.pairs, self.view = pairs, view

    def seen(
        self, antennas: list[np.ndarray], pulses: np.ndarray, frequencies: np.ndarray, lit: list[np.ndarray] | None
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Numbers of pulses among those at hand (k,), amplitudes, complex128 (k, n_polarizations, m), |a|^2 in m^2, and
        delays about those of reference ranges, s (k,), of pieces: from border 1 to border 2, of two antennas also back.

        antennas  places of one or two, m (p, 3) each, at pulses (p,);  frequencies  Hz (m,)
        lit       what each sees of the pieces of edges, as EdgeLight has it, (p, n, 2); None: all
        """
        view = self.view
        for side in ((0, 0),) if len(antennas) == 1 else ((0, 1), (1, 0)):
            places = [antennas[i] for i in side]
            lights = [None if lit is None else lit[i] for i in side]
            rays = _rays(self.pairs, places)
            rows = self.pairs.reached(rays, lights)
            pairs, rays = self.pairs.chosen(rows), rays.chosen(rows)
            if not len(pairs):
                continue
            corners = pairs.corners(rays)
            path = paths_over(places, list(corners), view.antennas.reference_range[pulses])
            path += np.linalg.norm(corners[1] - corners[0], axis=-1) / 2
            first = np.arange(len(pairs)) + pairs.pair
            begin, end = path[:, first], path[:, first + 1]
            away = (begin + end) / 2
            part, factor = pairs.seen(rays, lights)
            if view.gated:
                part = common_part([part, within_window(begin, end, view.antennas, pulses)])
            factor = factor * ((rays.high - rays.low) / pairs.parts)[:, pairs.pair] * (part[..., 1] - part[..., 0])
            factor, part = np.broadcast_to(factor, away.shape), np.broadcast_to(part, (*away.shape, 2))
            pulse, piece = np.nonzero(factor)
            matrix = self._matrices(pairs, places, side, rays, pulse, piece, frequencies)
            phase = 2 * np.pi / SPEED_OF_LIGHT * frequencies * (2 * (begin - end)[pulse, piece])[:, None]
            part = part[pulse, piece]
            size, middle = (part[:, 1] - part[:, 0])[:, None], part.mean(axis=1)
            line = factor[pulse, piece, None] * np.sinc(phase * size / (2 * np.pi)).astype(complex)
            cut = size[:, 0] < 1
            line[cut] *= np.exp(1j * phase[cut] * (middle[cut] - 0.5)[:, None])
            matrix *= line[:, None]
            if view.weights.is_needed:
                row = pulse if len(corners[0]) > 1 else 0 * pulse
                middle_of_rays = (corners[0] + corners[1])[row, first[piece]] / 2
                weigh(matrix, middle_of_rays, view.weights, pulses, pulse, frequencies)
            yield pulse, matrix, 2 / SPEED_OF_LIGHT * away[pulse, piece]

    def _matrices(
        self,
        pairs: BorderPairs,
        places: list[np.ndarray],
        side: tuple[int, int],
        rays: Rays,
        pulse: np.ndarray,
        piece: np.ndarray,
        frequencies: np.ndarray,
    ) -> np.ndarray:
        """a/dc, complex128 (k, n_polarizations, m), of pairs of pulse and piece (k,)."""
        unit_pair, share, unit_of_piece = _units(pairs)
        number = np.zeros((len(places[0]), len(unit_pair)), int)
        number[pulse, unit_of_piece[piece]] = 1
        at, of_unit = np.nonzero(number)
        number[at, of_unit] = np.arange(len(at))
        pair, row = unit_pair[of_unit], at if len(rays.low) > 1 else 0 * at
        ends = pairs.ends(rays, row, pair, share[of_unit])
        looks = [unit(place[at] - end) for place, end in zip(places, ends, strict=True)]
        way = ends[1] - ends[0]
        length = np.sqrt(dot(way, way))
        phase = 2 * np.pi / SPEED_OF_LIGHT * length[:, None] * frequencies
        up = (float(self.view.vertical[0]), float(self.view.vertical[1]), float(self.view.vertical[2]))
        matrix = double_matrix(pairs.shape.chosen(pair), looks[0], looks[1], way / length[:, None], phase, up)
        back = matrix.swapaxes(1, 2)
        matrix = matrix + back if side == (0, 0) else back if side == (1, 0) else matrix
        columns = [("HV".index(name[0]), "HV".index(name[1])) for name in self.view.polarizations]
        values = np.stack([matrix[:, r, t] for r, t in columns], axis=1)
        return np.asarray(values[number[pulse, unit_of_piece[piece]]])


def _rays(pairs: BorderPairs, places: list[np.ndarray]) -> Rays:
    """Rays to antennas at border 1 and border 2."""
    if places[0] is places[1] and pairs.is_fixed:
        return pairs.rays(np.zeros((1, len(pairs.parts))), np.zeros((1, len(pairs.parts))))
    along, across = [], []
    for place in places:
        look = unit(place[:, None] - pairs.middle)
        along.append(np.einsum("mnj,nj->mn", look, pairs.along))
        across.append(np.einsum("mnj,nj->mn", look, pairs.across))
    return pairs.rays(along[1] - along[0], across[0] + across[1])


def _units(pairs: BorderPairs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where coefficients are computed, once for a pair or for each of its pieces: pairs and shares of their lengths
    (u,), and which of them each piece has (k,)."""
    own = np.where(pairs.is_fine, pairs.parts, 1)
    pair = np.repeat(np.arange(len(own)), own)
    fine = pairs.is_fine[pairs.pair]
    unit_of_piece = (np.cumsum(own) - own)[pairs.pair] + np.where(fine, pairs.number, 0)
    share = np.full(len(pair), 0.5)
    share[unit_of_piece[fine]] = ((pairs.number + 0.5) / pairs.parts[pairs.pair])[fine]
    return pair, share, unit_of_piece
