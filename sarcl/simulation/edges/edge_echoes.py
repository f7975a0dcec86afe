"""Echoes of edges, added up in float64 on the host."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.stage_timer import Clock
from ...numerics.polynomials import chebyshev, lagrange
from ...numerics.pulse_geometry import half_path
from ...opencl.device import Device
from ...scattering.subdivision import cell_edge
from ...scene.scene import Scene
from ..echo_request import EchoRequest
from ..scene_plan import EDGES, SeenScene
from ..spreading import ChannelView, Counts
from ._edge_pieces import EdgeLight, EdgePieces, edge_pieces, longest_piece

# Errors of amplitudes that are interpolated over the band between 1, 2, ... frequencies, x^m/(m! 2^(m - 1)), where
# x = pi/8 for pieces of a quarter of a resolution cell
OVER_BAND = tuple((math.pi / 8) ** m / (math.factorial(m) * 2 ** (m - 1)) for m in range(1, 16))
PER_SIZE = 64  # pieces over the size of a scene with shadows, at least: these are looked for at the ends of pieces
STEP = 32  # samples: phasors of so many next to one another are products of two factors


@dataclass(frozen=True, eq=False)
class PreparedEdges:
    """Edges of a scene, prepared for all channels.

    light  what antennas see of the pieces; None: all of them;  error  of the echoes of edges, relative to their norm
    """

    pieces: EdgePieces
    light: EdgeLight | None
    error: float

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
        longest = longest_piece(wavelength, cell_edge(waveform), max(near, wavelength), error / 4)
        device = request.device if request.shadows else None
        return cls.pieces_of(seen.scene, request.crease, longest, device, error)

    @classmethod
    def pieces_of(
        cls, scene: Scene, crease: float, longest: float, device: Device | None, error: float
    ) -> PreparedEdges:
        """The edges of a scene in pieces no longer than `longest`, m; device  that looks for shadows, None: nothing
        shades."""
        size = float(np.linalg.norm(np.diff(scene.bounds, axis=0)))
        pieces = edge_pieces(scene, crease, longest if device is None else min(longest, size / PER_SIZE))
        light = None if device is None or not len(pieces) else EdgeLight(pieces, device, scene)
        return cls(pieces, light, error)


class EdgeEchoes:
    """Edges of one channel at one receiver."""

    def __init__(self, edges: PreparedEdges, view: ChannelView) -> None:
        self.pieces, self.light, self.view = edges.pieces, edges.light, view
        # pieces mostly cancel: an edge sends back as much as a wavelength of it, unless it is seen at right angles
        gain = 1 + 2 * np.pi * float(view.frequencies[-1]) / SPEED_OF_LIGHT * edges.pieces.longest_edge
        fine = [m for m, error in enumerate(OVER_BAND, 1) if error <= edges.error / gain]
        self.n_nodes = min(fine, default=len(OVER_BAND))

    def __len__(self) -> int:
        return len(self.pieces)

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a report."""
        left_out = {"edges left out": self.pieces.n_other} if self.pieces.n_other else {}
        return {"edges": self.pieces.n_edges, "pieces of edges": len(self.pieces)} | left_out

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add to samples (n_pulses, n_polarizations, n_samples) of consecutive `pulses` of the antennas.

        on_progress is called with the number of pairs of piece and pulse that are done.
        """
        counts = Counts()
        for row, p in enumerate(pulses):
            values, _, done = self.samples(p, self.view.frequencies)
            samples[row] += values.astype(np.complex64)
            counts += done
            on_progress(counts.pairs)
        clock.lap("edges")
        return counts

    def samples(
        self, pulse: int, frequencies: np.ndarray, *, exact: bool = False
    ) -> tuple[np.ndarray, np.ndarray, Counts]:
        """Samples (n_polarizations, n) of a pulse, their power at random phases, and counts of pairs.

        frequencies  Hz (n,), evenly spaced;  exact  any: amplitudes are computed at each of them
        """
        antennas, pieces, view = self.view.antennas, self.pieces, self.view
        ends = [antennas.tx[pulse], antennas.rx[pulse]]
        away = half_path(ends[0], ends[1], pieces.centers) - antennas.reference_range[pulse]
        inside = (away >= antennas.near[pulse]) & (away <= antennas.far[pulse]) | np.bool_(not view.gated)
        lit = np.tile([0.0, 1.0], (len(pieces), 1)) if self.light is None else self.light.lit(ends)
        seen = np.flatnonzero(inside & (lit[:, 1] > lit[:, 0]))
        counts = Counts(len(pieces), int((~inside).sum()), int(inside.sum()) - len(seen))
        if not len(seen):
            nothing = np.zeros((len(view.polarizations), len(frequencies)))
            return nothing.astype(np.complex128), nothing, counts
        exact = exact or len(frequencies) <= self.n_nodes
        nodes = frequencies if exact else chebyshev(float(frequencies.mean()), float(np.ptp(frequencies)), self.n_nodes)
        chosen, waves = pieces.chosen(seen), 2 * np.pi * nodes / SPEED_OF_LIGHT
        amplitudes, ranges = chosen.amplitudes(antennas, pulse, lit[seen], waves, view.polarizations, view.vertical)
        delay = 2 * ranges / np.longdouble(SPEED_OF_LIGHT)
        for m, f in enumerate(nodes.tolist()):
            amplitudes[:, :, m] *= view.weights.weights(chosen.centers, pulse, f)[:, None]
        if exact:
            out = np.einsum("kpm,km->pm", amplitudes, _phasors(delay, frequencies))
        else:
            sums = _summed(amplitudes.reshape(len(seen), len(view.polarizations) * len(nodes)), delay, frequencies)
            out = np.einsum("pmn,mn->pn", sums.reshape(-1, len(nodes), len(frequencies)), lagrange(nodes, frequencies))
        power = (np.abs(amplitudes) ** 2).sum(axis=0)
        return out, power if exact else power @ np.abs(lagrange(nodes, frequencies)), counts


def _summed(amplitudes: np.ndarray, delay: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """sum_k a_k exp(-2 pi j f tau_k) at n evenly spaced frequencies, complex128 (m, n), of m columns of amplitudes.

    amplitudes  (k, m);  delay  s, longdouble (k,)
    """
    n, first = len(frequencies), np.longdouble(frequencies[0])
    step = np.longdouble(frequencies[-1] - frequencies[0]) / max(n - 1, 1)
    rows = -(-n // STEP)
    coarse = _phasors(delay, first + step * STEP * np.arange(rows))
    fine = _phasors(delay, step * np.arange(min(STEP, n)))
    columns = (amplitudes[:, :, None] * coarse[:, None]).reshape(len(delay), -1)
    return np.asarray((columns.T @ fine).reshape(amplitudes.shape[1], -1)[:, :n])


def _phasors(delay: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    cycles = delay[:, None] * frequencies
    return np.asarray(np.exp(-2j * np.pi * (cycles - np.rint(cycles)).astype(np.float64)))
