"""How much of borders antennas see, from what they see of the pieces of the edges that borders are made of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._edge_pieces import EdgePieces

if TYPE_CHECKING:
    from ...scene.facing_borders import FacingBorders


class BorderLight:
    """Pieces of edges in a row, border by border, with a gap after each border.

    origin  where each border begins in that row, m (b,)
    """

    def __init__(self, borders: FacingBorders, edges: EdgePieces) -> None:
        parts = edges.parts[borders.edge]
        member = np.repeat(np.arange(len(parts)), parts)
        number = np.arange(len(member)) - np.repeat(np.cumsum(parts) - parts, parts)
        edge, self._is_turned = borders.edge[member], borders.is_turned[member]
        first = np.cumsum(edges.parts) - edges.parts
        self._piece = first[edge] + np.where(self._is_turned, edges.parts[edge] - 1 - number, number)
        self._length = (edges.lengths / edges.parts)[edge]
        self._weight = np.sqrt(edges.factor)[edge]  # of two borders: their mean by multiplication
        self._border = border = borders.border[member]
        gap = np.append(0.0, np.diff(border)) * float(self._length.max(initial=1.0))
        ends = np.cumsum(self._length + gap)
        self._begin = ends - self._length
        self.origin = self._begin[np.flatnonzero(np.diff(border, prepend=-1))]

    def reached(self, lit: np.ndarray) -> np.ndarray:
        """Of which borders something is seen at some pulse (b,); lit  as below."""
        seen = np.asarray((lit[..., 1] > lit[..., 0]).any(axis=0))[self._piece]
        return np.bincount(self._border, seen, len(self.origin)) > 0

    def intervals(self, lit: np.ndarray | None, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the seen parts begin and end, 0 to 1, of intervals between places (m or 1, n) in that row, at
        all pulses or one for all of them (m or 1, n - 1, 2), and the square root of the reflectivity there (.., n - 1).

        lit  where the part of each piece begins and ends that is seen, 0 to 1 (m, n_pieces, 2); None: all is seen
        A shadow is taken to begin or to end in an interval, not both.
        """
        number = np.clip(np.searchsorted(self._begin, places, "right") - 1, 0, None)
        weight = self._weight[number[:, :-1]]
        if lit is None:
            return np.broadcast_to([0.0, 1.0], (*weight.shape, 2)), weight
        part = lit[:, self._piece]
        part = np.where(self._is_turned[:, None], 1 - part[..., ::-1], part)
        size = (part[..., 1] - part[..., 0]) * self._length
        before = np.cumsum(size, axis=1) - size
        row = np.arange(len(part))[:, None]
        begin, end = part[row, number, 0], part[row, number, 1]
        at = np.clip((places - self._begin[number]) / self._length[number], 0, 1)
        amount = before[row, number] + (np.clip(at, begin, end) - begin) * self._length[number]
        way = np.diff(places, axis=1)
        share = np.clip(np.diff(amount, axis=1) / np.where(way == 0, np.inf, way), 0, 1)
        is_lit = (at >= begin) & (at <= end) & (end > begin)
        dark = np.where(is_lit[:, :-1], 0, np.where(is_lit[:, 1:], 1 - share, (1 - share) / 2))
        return np.stack([dark, dark + share], axis=-1), weight
