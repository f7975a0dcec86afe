"""Rows of an array's echoes: whose antennas, at which element, with which reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.channels import Channel, Sampling
from ...model.antenna_array import AntennaArray
from ...model.trajectory import Trajectory
from ...numerics.pulse_geometry import PulseGeometry
from .. import echo_sampling

CHANNELS = ("simultaneous", "separated")
RECEIVE = ("reference", "own", "all")


@dataclass(frozen=True, eq=False)
class Sides:
    """Antennas of every pulse, and what their arrays' elements are off them.

    tx, rx  m (n, 3);  turn_tx, turn_rx  from the arrays' axes to the scene's (n, 3, 3), or None: the same
    """

    tx: np.ndarray
    rx: np.ndarray
    turn_tx: np.ndarray | None
    turn_rx: np.ndarray | None

    @classmethod
    def of(cls, track: Trajectory, receiver: Trajectory | None) -> Sides:
        """Of tracks: arrays turn with their attitude."""
        back = track if receiver is None else receiver
        return cls(track.positions, echo_sampling.receiver_positions(track, receiver), track.attitude, back.attitude)

    def senders(self, places: np.ndarray, at: Any = slice(None)) -> np.ndarray:
        """Where elements at `places`, m (..., 3), stand at pulses `at`, (n, ..., 3)."""
        return _stand(self.tx, self.turn_tx, places, at)

    def receivers(self, places: np.ndarray, at: Any = slice(None)) -> np.ndarray:
        """The same on the receiving side."""
        return _stand(self.rx, self.turn_rx, places, at)


class Rows:
    """Rows of an array's echoes: (pulse, receiver) where channels are added up, else (pulse, sender, receiver)."""

    def __init__(
        self, array: AntennaArray, sides: Sides, point: np.ndarray, channels: str, receive: str, polarizations: Any
    ) -> None:
        self.array, self.sides, self.point, self.receive = array, sides, point, receive
        self.separated, self.polarizations = channels == "separated", polarizations
        self.heard = array.positions if receive == "all" else np.zeros((1, 3))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Pulses, senders, receivers of each."""
        return len(self.sides.tx), self.array.n if self.separated else 1, len(self.heard)

    @property
    def hearing(self) -> int:
        """Receivers of a channel."""
        return 1 if self.receive == "own" else len(self.heard)

    def receivers(self, sender: np.ndarray) -> np.ndarray:
        """Places of what hears a channel sent from `sender`, m (n, 3)."""
        return sender[None] if self.receive == "own" else self.heard

    def ends(
        self, sender: np.ndarray, at: Any = slice(None), which: slice = slice(None)
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Antennas of a channel's rows at pulses `at` and some receivers.

        Returns tx (n, 3) and rx (n, receivers, 3), m, and reference ranges (n, receivers).
        """
        tx = self.sides.senders(sender, at) if self.separated else self.sides.tx[at]
        rx = self.sides.receivers(self.receivers(sender)[which], at)
        return tx, rx, echo_sampling.half_path(tx[:, None], rx, self.point)

    def put(self, samples: np.ndarray, channel: Channel, receivers: slice, part: slice, made: np.ndarray) -> None:
        """Add a channel at some receivers, (n, receivers, n_polarizations, width), to samples of its pulses.

        samples  (n, senders, receivers, n_polarizations, n_samples)
        """
        if not self.separated:
            samples[:, 0, receivers, :, part] += np.complex64(channel.weight) * made
            return
        for element in channel.elements.tolist():
            samples[:, element, receivers] = np.complex64(self.array.weights[element]) * made

    def geometry(self, center: float, sampling: Sampling, track: Trajectory, back: Trajectory) -> dict[str, Any]:
        """What a PhaseHistory holds of every row."""
        pulses, senders, receivers = self.shape
        n, names = pulses * senders * receivers, self.polarizations
        places = self.array.positions
        tx = self.sides.senders(places)[:, :, None] if self.separated else self.sides.tx[:, None, None]
        own = self.receive == "own"
        rx = self.sides.receivers(places)[:, :, None] if own else self.sides.receivers(self.heard)[:, None]
        reference = np.broadcast_to(echo_sampling.half_path(tx, rx, self.point), self.shape)
        tx, rx = (np.broadcast_to(ends, (*self.shape, 3)) for ends in (tx, rx))
        frequency = np.full(self.shape, sampling.frequency)
        if self.separated:
            offsets = np.stack([self.array.offsets_at(p) for p in range(pulses)])
            frequency[:] = (center + offsets - (sampling.width - 1) / 2 * sampling.step)[:, :, None]
        pulse, sender_of, receiver_of = (i.ravel() for i in np.indices(self.shape))
        out: dict[str, Any] = {
            "frequency": frequency.reshape(n), "tx": tx.reshape(n, 3), "rx": rx.reshape(n, 3),
            "reference_range": reference.reshape(n), "time": track.times[pulse],
            "tx_channel": sender_of if self.separated else None,
            "rx_channel": sender_of if self.receive == "own" else receiver_of,
        }  # fmt: skip
        for name, velocities in (("tx_velocity", track.velocities), ("rx_velocity", back.velocities)):
            out[name] = None if velocities is None else velocities[pulse]
        every = {k: v if v is None or len(names) == 1 else np.repeat(v, len(names), axis=0) for k, v in out.items()}
        return {**every, "polarization": np.tile(names, n), "frequency_step": sampling.step}


def antennas_of(
    tx: np.ndarray, rx: np.ndarray, reference_range: np.ndarray, frequency: float, grid: Sampling,
    window: tuple[float, float], n: int | None = None,
) -> PulseGeometry:  # fmt: skip
    """Antennas of pulses whose samples begin at `frequency`, Hz, n of them."""
    rows, n = np.ones(len(tx)), grid.n if n is None else n
    return PulseGeometry(
        tx=tx,
        rx=rx,
        reference_range=reference_range,
        frequency=(frequency + n // 2 * grid.step) * rows,
        frequency_step=grid.step * rows,
        near=window[0] * rows,
        far=window[1] * rows,
    )


def _stand(ends: np.ndarray, turn: np.ndarray | None, places: np.ndarray, at: Any) -> np.ndarray:
    spread = ends[at].reshape(-1, *(1,) * (places.ndim - 1), 3)
    return np.asarray(spread + (places if turn is None else np.einsum("nij,...j->n...i", turn[at], places)))
