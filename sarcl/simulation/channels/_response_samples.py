"""How echoes of a scene change from place to place of an array: turns of their phase, gains of antennas, and distance.

Only the scene's outermost places are looked at, whose turns are largest, and where gains or spreading count some of its
scatterers; at pulses spread along the track, and at those where the array turns echoes most.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.boxes import corners
from ...base.constants import SPEED_OF_LIGHT
from ...model.antenna_pattern import pattern_gain
from ...scattering.antenna_weights import Beam
from ...scene.scene import Scene
from ...scene.triangles import centroids
from .channel_rows import Sides

PULSES, SCATTERERS = 33, 32  # looked at
BLOCK = 256  # pulses at a time

Stand = Callable[..., np.ndarray]


class Views:
    """Responses (m, k) of a scene at places of an array, m (m, 3): `sending`, `hearing` or both at the `same` place.

    Of k pairs of pulse and place in the scene, each less the path to the scene's centre; relative to the root mean
    square of echoes where gains count, else of modulus 1. top  highest frequency, Hz
    """

    def __init__(
        self, sides: Sides, scene: Scene, weights: Beam, top: float, senders: np.ndarray, heard: np.ndarray
    ) -> None:
        self.sides, self.weights, self.top, self.center = sides, weights, top, scene.center
        off = corners(scene.bounds) - self.center
        self.outer = np.concatenate([off, np.diag(off[-1]), -np.diag(off[-1])])  # the middles of faces too: the nearest
        self.off = self.outer
        if weights.weighs:
            every = np.concatenate([scene.positions, centroids(scene.triangles)]) - self.center
            some = np.random.default_rng(0).choice(len(every), min(len(every), SCATTERERS), replace=False)
            self.off = np.concatenate([self.outer, every[some]])
        self.tx_pulses = self._telling(sides.senders, senders)
        self.rx_pulses = self._telling(sides.receivers, heard)
        self.levels = 1.0, 1.0
        if weights.weighs:
            self.levels = self._levels(senders.mean(axis=0), heard.mean(axis=0))

    def sending(self, places: np.ndarray) -> np.ndarray:
        """Of senders."""
        return self._response(0, self.sides.senders, places, self.tx_pulses) / self.levels[0]

    def hearing(self, places: np.ndarray) -> np.ndarray:
        """Of receivers."""
        return self._response(1, self.sides.receivers, places, self.rx_pulses) / self.levels[1]

    def same(self, places: np.ndarray) -> np.ndarray:
        """Of elements that hear what they send."""
        at = np.union1d(self.tx_pulses, self.rx_pulses)
        both = self._response(0, self.sides.senders, places, at) * self._response(1, self.sides.receivers, places, at)
        return both / self.levels[0]

    def _telling(self, stand: Stand, places: np.ndarray) -> np.ndarray:
        """Pulses spread along the track, and those at which the array's box turns echoes most."""
        box = corners(np.stack([places.min(axis=0), places.max(axis=0)]))
        box = np.concatenate([box, box.mean(axis=0)[None]])  # and its middle: turns may be alike at both ends
        n = len(self.sides.tx)
        turns = np.zeros(n)
        for start in range(0, n, BLOCK):
            here = slice(start, min(start + BLOCK, n))
            turns[here] = np.ptp(self._turns(stand(box, here), self.outer), axis=1).max(axis=-1)
        return np.unique(np.concatenate([np.linspace(0, n - 1, PULSES).astype(int), np.argsort(turns)[-PULSES // 4 :]]))

    def _turns(self, ends: np.ndarray, off: np.ndarray) -> np.ndarray:
        """Turns of the phase (n, m, k) from antennas, m (n, m, 3), to places off the centre, m (k, 3)."""
        d = ends - self.center
        # |d - x| - |d| without cancellation
        total = np.linalg.norm(d[..., None, :] - off, axis=-1) + np.linalg.norm(d, axis=-1)[..., None]
        return np.asarray(self.top / SPEED_OF_LIGHT * ((off**2).sum(axis=1) - 2 * d @ off.T) / total)

    def _response(self, side: int, stand: Stand, places: np.ndarray, at: np.ndarray) -> np.ndarray:
        ends = stand(places, at)
        made = np.exp(-2j * np.pi * self._turns(ends, self.off))
        if self.weights.weighs:
            for i, pulse in enumerate(at.tolist()):
                made[i] *= self._gain(side, ends[i], pulse)
        return np.asarray(np.moveaxis(made, 1, 0).reshape(len(places), -1))

    def _gain(self, side: int, ends: np.ndarray, pulse: int) -> np.ndarray:
        """Weights of one antenna, m (m, 3), towards the places (m, k)."""
        beam, look = self.weights, self.center + self.off - ends[:, None]
        out = np.ones(look.shape[:2], np.complex128)
        antenna = None if beam.pair is None else beam.pair[side]
        if antenna is not None and beam.axes is not None:
            out *= pattern_gain(antenna, (look @ beam.axes[side][pulse]).reshape(-1, 3), self.top).reshape(out.shape)
        if beam.radar is not None:
            out *= beam.range / np.linalg.norm(look, axis=-1)
        return out

    def _levels(self, sender: np.ndarray, heard: np.ndarray) -> tuple[float, float]:
        """What errors of a sender's and of a receiver's response are relative to: the other side's multiplies them."""
        at = np.union1d(self.tx_pulses, self.rx_pulses)
        sent = np.abs(self._response(0, self.sides.senders, sender[None], at))
        back = np.abs(self._response(1, self.sides.receivers, heard[None], at))
        inside = np.ones((len(at), len(self.off)), bool)
        inside[:, : len(self.outer)] = False  # scatterers alone
        both = (
            float(np.sqrt(np.mean((sent * back).reshape(inside.shape)[inside].reshape(-1) ** 2)))
            or np.finfo(float).tiny
        )
        return both / float(back.max()), both / float(sent.max())
