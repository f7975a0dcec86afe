"""How the echoes of a scene change from position to position in an array: by phase, antenna gain and distance.

Phases are computed for the outermost points of the scene's box, where they change most; where gains or spreading count,
also for some of its scatterers. The pulses are spread along the track, and include those at which phases change most.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.boxes import corners
from ...base.constants import SPEED_OF_LIGHT
from ...base.rows import spread_over
from ...model.antenna_pattern import pattern_gain
from ...scattering.antenna_weights import AntennaWeights
from ...scene.scene import Scene
from ...scene.triangles import centroids
from ._channel_rows import ChannelRows

PULSES, SCATTERERS = 33, 32  # largest numbers of pulses and of scatterers that responses are sampled at
BLOCK = 256  # pulses per array operation: bounds the memory

ToScene = Callable[..., np.ndarray]  # ChannelRows.tx_positions or rx_positions


class ResponseSamples:
    """Responses (m, k) of a scene at m positions in an array: of transmitters, of receivers, or of elements as both.

    A response holds k pairs of pulse and point in the scene, each without the path to the scene's centre. Where weights
    count, responses are relative to the root mean square of the echoes; else their modulus is 1.
    """

    def __init__(
        self, rows: ChannelRows, scene: Scene, weights: AntennaWeights, highest: float, transmitters: np.ndarray,
        receivers: np.ndarray,
    ) -> None:  # fmt: skip
        """highest  frequency, Hz;  transmitters, receivers  positions of the elements in the array, m (n, 3)."""
        self.rows, self.weights, self.highest, self.center = rows, weights, highest, scene.center
        off = corners(scene.bounds) - self.center
        self.outer = np.concatenate([off, np.diag(off[-1]), -np.diag(off[-1])])  # face centres too: they may be nearest
        self.off = self.outer
        if weights.is_needed:
            scatterers = np.concatenate([scene.positions, centroids(scene.triangles)]) - self.center
            sample = np.random.default_rng(0).choice(len(scatterers), min(len(scatterers), SCATTERERS), replace=False)
            self.off = np.concatenate([self.outer, scatterers[sample]])
        self.tx_pulses = self._sampled_pulses(rows.tx_positions, transmitters)
        self.rx_pulses = self._sampled_pulses(rows.rx_positions, receivers)
        self.levels = 1.0, 1.0
        if weights.is_needed:
            self.levels = self._levels(transmitters.mean(axis=0), receivers.mean(axis=0))

    def tx_response(self, elements: np.ndarray) -> np.ndarray:
        """Response (m, k) of transmitters at elements, m (m, 3)."""
        return self._response(0, self.rows.tx_positions, elements, self.tx_pulses) / self.levels[0]

    def rx_response(self, elements: np.ndarray) -> np.ndarray:
        """Response (m, k) of receivers at elements, m (m, 3)."""
        return self._response(1, self.rows.rx_positions, elements, self.rx_pulses) / self.levels[1]

    def two_way_response(self, elements: np.ndarray) -> np.ndarray:
        """Response (m, k) of elements, m (m, 3), that each receive what they transmit."""
        at = np.union1d(self.tx_pulses, self.rx_pulses)
        tx = self._response(0, self.rows.tx_positions, elements, at)
        return tx * self._response(1, self.rows.rx_positions, elements, at) / self.levels[0]

    def _sampled_pulses(self, to_scene: ToScene, elements: np.ndarray) -> np.ndarray:
        """Pulses spread along the track, and those at which phases differ most between points, over the array's box."""
        box = corners(np.stack([elements.min(axis=0), elements.max(axis=0)]))
        box = np.concatenate([box, box.mean(axis=0)[None]])  # with its centre: phases may be equal at opposite corners
        n = len(self.rows.track)
        change = np.zeros(n)
        for start in range(0, n, BLOCK):
            block = slice(start, min(start + BLOCK, n))
            change[block] = np.ptp(self._cycles(to_scene(box, block), self.outer), axis=1).max(axis=-1)
        most = np.argsort(change)[-PULSES // 4 :]
        return np.unique(np.concatenate([spread_over(n, PULSES), most]))

    def _cycles(self, ends: np.ndarray, off: np.ndarray) -> np.ndarray:
        """Phases, cycles (n, m, k), of paths from antennas, m (n, m, 3), to points off the centre, m (k, 3)."""
        d = ends - self.center
        # |d - x| - |d| without cancellation
        total = np.linalg.norm(d[..., None, :] - off, axis=-1) + np.linalg.norm(d, axis=-1)[..., None]
        return np.asarray(self.highest / SPEED_OF_LIGHT * ((off**2).sum(axis=1) - 2 * d @ off.T) / total)

    def _response(self, side: int, to_scene: ToScene, elements: np.ndarray, at: np.ndarray) -> np.ndarray:
        ends = to_scene(elements, at)
        phases = np.exp(-2j * np.pi * self._cycles(ends, self.off))
        if self.weights.is_needed:
            for i, pulse in enumerate(at.tolist()):
                phases[i] *= self._gain(side, ends[i], pulse)
        return np.asarray(np.moveaxis(phases, 1, 0).reshape(len(elements), -1))

    def _gain(self, side: int, ends: np.ndarray, pulse: int) -> np.ndarray:
        """Weights (m, k) of one antenna at positions `ends`, m (m, 3), towards the points; side  0: tx, 1: rx."""
        weights, look = self.weights, self.center + self.off - ends[:, None]
        out = np.ones(look.shape[:2], np.complex128)
        antenna = None if weights.pair is None else weights.pair[side]
        if antenna is not None and weights.axes is not None:
            toward = (look @ weights.axes[side][pulse]).reshape(-1, 3)
            out *= pattern_gain(antenna, toward, self.highest).reshape(out.shape)
        if weights.radar is not None:
            out *= weights.range / np.linalg.norm(look, axis=-1)
        return out

    def _levels(self, transmitter: np.ndarray, receiver: np.ndarray) -> tuple[float, float]:
        """Levels that errors of the tx and of the rx response are relative to: the other response multiplies them."""
        at = np.union1d(self.tx_pulses, self.rx_pulses)
        sent = np.abs(self._response(0, self.rows.tx_positions, transmitter[None], at))
        back = np.abs(self._response(1, self.rows.rx_positions, receiver[None], at))
        scatterers = (sent * back).reshape(len(at), len(self.off))[:, len(self.outer) :]
        both = float(np.sqrt(np.mean(scatterers.reshape(-1) ** 2))) or np.finfo(float).tiny
        return both / float(back.max()), both / float(sent.max())
