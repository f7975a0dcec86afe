"""Echoes of edges, added up in float64 on the host."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.stage_timer import Clock
from ...base.vectors import unit
from ...numerics.polynomials import chebyshev, lagrange
from ...opencl.device import Device
from ...scattering.edge_diffraction import edge_matrix
from ...scattering.subdivision import cell_edge
from ...scene.scene import Scene
from ..echo_request import EchoRequest
from ..scene_plan import EDGES, SeenScene
from ..spreading import ChannelView, Counts
from ._border_pairs import BorderPairs
from ._edge_pieces import EdgeKnots, EdgeLight, EdgePieces, edge_pieces, longest_piece
from ._pair_echoes import PairEchoes
from ._paths import WHOLE, common_part, paths_over, weigh, within_window

# Errors of amplitudes that are interpolated over the band between 1, 2, ... frequencies, x^m/(m! 2^(m - 1)), where
# x = pi/8 for pieces of a quarter of a resolution cell
OVER_BAND = tuple((math.pi / 8) ** m / (math.factorial(m) * 2 ** (m - 1)) for m in range(1, 16))
PER_SIZE = 64  # pieces over the size of a scene with shadows, at least: these are looked for at the ends of pieces
# Samples: phasors of so many next to one another are products of two factors. Matrices of so many rows and columns are
# multiplied: for larger ones OpenBLAS starts threads, which mostly wait for one another
STEP = 32
STEEP = 16.0  # change of coefficients over that of directions, rad, at most: near grazing incidence they change fastest
TOGETHER = 2**16  # pairs of pulse and piece that are looked at together: 3 MB for each vector of them
AMPLITUDES = 2**21  # of pairs, polarisations and frequencies, complex128, that are held together: 32 MB


@dataclass(frozen=True, eq=False)
class PreparedEdges:
    """Edges of a scene, prepared for all channels.

    knots  where the coefficients of edges are computed
    light  what antennas see of the pieces; None: all of them;  error  of the echoes of edges, relative to their norm
    pairs  of borders between which waves run along faces
    """

    pieces: EdgePieces
    knots: EdgeKnots
    light: EdgeLight | None
    error: float
    pairs: BorderPairs

    def __len__(self) -> int:
        return len(self.pieces)

    @classmethod
    def of(cls, request: EchoRequest, seen: SeenScene) -> PreparedEdges | None:
        """The edges that a request asks for; None where it asks for none, or the scene has none."""
        if request.crease is None or not len(seen.scene.triangles):
            return None
        antennas, waveform, error = seen.antennas, seen.waveform, EDGES * request.tolerance
        low, high = seen.scene.bounds
        gaps = [np.maximum(np.maximum(low - end, end - high), 0) for end in antennas.ends]
        near = min(float(np.linalg.norm(gap, axis=1).min()) for gap in gaps) - seen.margin
        wavelength = SPEED_OF_LIGHT / (waveform.center + waveform.bandwidth / 2)
        near = max(near, wavelength)
        longest = longest_piece(wavelength, cell_edge(waveform), near, error / 4)
        device = request.device if request.shadows else None
        return cls.pieces_of(seen.scene, request.crease, longest, device, error, distance=near)

    @classmethod
    def pieces_of(
        cls,
        scene: Scene,
        crease: float,
        longest: float,
        device: Device | None,
        error: float,
        *,
        distance: float = np.inf,
    ) -> PreparedEdges:
        """The edges of a scene in pieces no longer than `longest`, m.

        device  that looks for shadows, None: nothing shades;  distance  m, of the nearest antenna
        """
        size = float(np.linalg.norm(np.diff(scene.bounds, axis=0)))
        longest = longest if device is None else min(longest, size / PER_SIZE)
        pieces, borders = edge_pieces(scene, crease, longest)
        pairs = BorderPairs(borders, pieces, longest, distance, error / STEEP)
        light = None
        if device is not None and len(pieces):
            light = EdgeLight(pieces, device, scene)
            pairs.block(light.rays)
        return cls(pieces, EdgeKnots.of(pieces, distance, error / STEEP), light, error, pairs)


@dataclass(frozen=True, eq=False)
class _Seen:
    """What pulses see of pieces of edges and of pairs of borders, pulse by pulse.

    pulse       the number among the pulses at hand (k,)
    amplitudes  complex128 (k, n_polarizations, m) at m frequencies, |a|^2 in m^2
    delays      s, about those of the pulses' reference ranges (k,);  counts  of pieces of edges at all pulses
    """

    pulse: np.ndarray
    amplitudes: np.ndarray
    delays: np.ndarray
    counts: Counts

    def rows(self, n_pulses: int) -> Iterator[tuple[int, slice]]:
        """Pulses that see something, and their pairs."""
        ends = np.searchsorted(self.pulse, np.arange(n_pulses + 1)).tolist()
        return ((p, slice(ends[p], ends[p + 1])) for p in range(n_pulses) if ends[p] < ends[p + 1])


class EdgeEchoes:
    """Edges of one channel at one receiver."""

    def __init__(self, edges: PreparedEdges, view: ChannelView) -> None:
        self.pieces, self.knots, self.light, self.view = edges.pieces, edges.knots, edges.light, view
        self.pairs, self._pair_echoes = edges.pairs, PairEchoes(edges.pairs, view)
        # pieces mostly cancel: an edge sends back as much as a wavelength of it, unless it is seen at right angles
        longest = float(edges.pieces.lengths.max(initial=0.0))
        gain = 1 + 2 * np.pi * float(view.frequencies[-1]) / SPEED_OF_LIGHT * longest
        fine = [m for m, error in enumerate(OVER_BAND, 1) if error <= edges.error / gain]
        self.n_nodes = min(fine, default=len(OVER_BAND))

    def __len__(self) -> int:
        return len(self.pieces)

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a report."""
        left_out = {"edges left out": self.pieces.n_other} if self.pieces.n_other else {}
        words = {"edges": len(self.pieces.ends), "pieces of edges": len(self.pieces)}
        return words | {"pairs of borders": len(self.pairs.parts)} | left_out

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add to samples (n_pulses, n_polarizations, n_samples) of consecutive `pulses` of the antennas.

        on_progress is called with the number of pairs of piece and pulse that are done.
        """
        counts, every, f = Counts(), np.array(pulses), self.view.frequencies
        exact = len(f) <= self.n_nodes
        nodes = f if exact else chebyshev(float(f.mean()), float(np.ptp(f)), self.n_nodes)
        for batch in self._batches(len(every), len(nodes)):
            seen = self._seen(every[batch], nodes)
            for p, rows in seen.rows(batch.stop - batch.start):
                a, delays = seen.amplitudes[rows], seen.delays[rows]
                if exact:
                    out = np.einsum("kpm,km->pm", a, _phasors(delays, f))
                else:
                    sums = _summed(a.reshape(len(a), -1), delays, f).reshape(a.shape[1], len(nodes), len(f))
                    out = np.einsum("pmn,mn->pn", sums, lagrange(nodes, f))
                samples[batch.start + p] += out.astype(np.complex64)
            counts += seen.counts
            on_progress(counts.pairs)
        clock.lap("edges")
        return counts

    def exactly(self, pulses: np.ndarray, frequencies: np.ndarray) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Samples of batches of pulses (n,) at any frequencies, Hz: which these are, values complex128
        (n, n_polarizations, m), and their power at random phases."""
        for batch in self._batches(len(pulses), len(frequencies)):
            seen = self._seen(pulses[batch], frequencies)
            values = np.zeros((batch.stop - batch.start, *seen.amplitudes.shape[1:]), np.complex128)
            powers = np.zeros(values.shape)
            waves = seen.amplitudes * _phasors(seen.delays, frequencies)[:, None]
            for p, rows in seen.rows(len(values)):
                values[p] = waves[rows].sum(axis=0)
                powers[p] = (np.abs(waves[rows]) ** 2).sum(axis=0)
            yield batch, values, powers

    def _batches(self, n_pulses: int, n_frequencies: int) -> Iterator[slice]:
        if not len(self):
            return iter(())
        pieces = len(self) + len(self.pairs)
        amplitudes = pieces * n_frequencies * len(self.view.polarizations)
        n = max(min(TOGETHER // pieces, AMPLITUDES // amplitudes), 1)
        return (slice(first, min(first + n, n_pulses)) for first in range(0, n_pulses, n))

    def _seen(self, pulses: np.ndarray, frequencies: np.ndarray) -> _Seen:
        """What pulses (n,) see, at frequencies, Hz (m,).

        a = F L integral exp(j psi (s - 1/2)) ds over the lit part, where psi is k times the difference of the paths
        over both ends: phases meet from piece to piece, so that errors of their curvature are not added up along an
        edge. F is that of the middle of the lit part, between knots.
        """
        antennas, pieces, view = self.view.antennas, self.pieces, self.view
        ends = [antennas.tx[pulses]] if antennas.is_monostatic else [antennas.tx[pulses], antennas.rx[pulses]]
        paths = paths_over(ends, [pieces.corners] * len(ends), antennas.reference_range[pulses])
        begin, end = paths[:, pieces.first], paths[:, pieces.first + 1]
        away = (begin + end) / 2
        alone = None if self.light is None else [self.light.lit(places) for places in ends]
        inside = within_window(begin, end, antennas, pulses) if view.gated else np.broadcast_to(WHOLE, (*away.shape, 2))
        lit = common_part([inside, *(alone or [])])
        n_inside = int((inside[..., 1] > inside[..., 0]).sum())
        pulse, piece = np.nonzero(lit[..., 1] > lit[..., 0])
        counts = Counts(away.size, away.size - n_inside, n_inside - len(pulse))
        lit, edge = lit[pulse, piece], pieces.edge[piece]
        part, middle = lit[:, 1] - lit[:, 0], lit.sum(axis=1) / 2
        share = pieces.corner_share[pieces.first[piece]] + middle / pieces.parts[edge]
        scale = pieces.factor[edge] * pieces.lengths[edge] / pieces.parts[edge] * part
        matrix = self._matrix(ends, pulse, edge, share) * scale[:, None]
        phase = 2 * np.pi / SPEED_OF_LIGHT * frequencies * (2 * (begin - end)[pulse, piece])[:, None]
        line = np.sinc(phase * part[:, None] / (2 * np.pi)).astype(complex)
        cut = part < 1
        line[cut] *= np.exp(1j * phase[cut] * (middle[cut] - 0.5)[:, None])
        if view.weights.is_needed:
            centers = (pieces.corners[pieces.first] + pieces.corners[pieces.first + 1]) / 2
            weigh(line, centers[piece], view.weights, pulses, pulse, frequencies)
        parts = [(pulse, matrix[..., None] * line[:, None], 2 / SPEED_OF_LIGHT * away[pulse, piece])]
        if len(self.pairs):
            parts += self._pair_echoes.seen(ends, pulses, frequencies, alone)
        numbers, amplitudes, delays = (np.concatenate(one) for one in zip(*parts, strict=True))
        order = np.argsort(numbers, kind="stable")
        return _Seen(numbers[order], amplitudes[order], delays[order], counts)

    def _matrix(self, ends: list[np.ndarray], pulse: np.ndarray, edge: np.ndarray, share: np.ndarray) -> np.ndarray:
        """a/dl, complex128 (k, n_polarizations), of pairs of pulse and edge (k,) at shares of its length (k,)."""
        pieces, knots, view = self.pieces, self.knots, self.view
        used = np.zeros((len(ends[0]), len(pieces.ends)), bool)
        used[pulse, edge] = True
        at, knot = np.nonzero(used[:, knots.edge])
        number = np.zeros((len(used), len(knots.edge)), int)
        number[at, knot] = np.arange(len(at))
        looks = [unit(places[at] - knots.places[knot]) for places in ends]
        up = (float(view.vertical[0]), float(view.vertical[1]), float(view.vertical[2]))
        matrices = edge_matrix(pieces.shapes(knots.edge[knot]), looks[0], looks[-1], up)
        columns = [("HV".index(name[0]), "HV".index(name[1])) for name in view.polarizations]
        values = np.stack([matrices[:, r, t] for r, t in columns], axis=1)
        before, after, weight = knots.around(edge, share)
        first, second = values[number[pulse, before]], values[number[pulse, after]]
        return np.asarray(first + weight[:, None] * (second - first))


def _summed(amplitudes: np.ndarray, delays: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """sum_k a_k exp(-2 pi j f tau_k) at n evenly spaced frequencies, complex128 (m, n), of m columns of amplitudes.

    amplitudes  (k, m);  delays  s (k,)
    """
    n, first = len(frequencies), float(frequencies[0])
    step = (float(frequencies[-1]) - first) / max(n - 1, 1)
    fine = np.ones((-(-len(delays) // STEP) * STEP, STEP), complex)
    k = len(delays)
    for i in range(STEP.bit_length() - 1):
        fine[:k, 2**i : 2 ** (i + 1)] = fine[:k, : 2**i] * _phasors(delays, np.array([step * 2**i]))
    coarse = _phasors(delays, first + step * STEP * np.arange(-(-n // STEP)))
    columns = np.zeros((len(fine), amplitudes.shape[1] * coarse.shape[1]), complex)
    columns[:k] = (amplitudes[:, :, None] * coarse[:, None]).reshape(k, -1)
    blocks = columns.reshape(-1, STEP, columns.shape[1]).transpose(0, 2, 1)
    parts = [blocks[:, c : c + STEP] @ fine.reshape(-1, STEP, STEP) for c in range(0, columns.shape[1], STEP)]
    sums = np.concatenate([part.sum(axis=0) for part in parts])
    return np.asarray(sums.reshape(amplitudes.shape[1], -1)[:, :n])


def _phasors(delays: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    cycles = delays[:, None] * frequencies
    return np.asarray(np.exp(-2j * np.pi * (cycles - np.rint(cycles))))
