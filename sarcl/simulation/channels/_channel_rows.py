"""Rows of the phase history of an array: antenna positions of every channel, pulse by pulse, and reference ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...arrays.channels import Channel, Sampling
from ...model.antenna_array import AntennaArray
from ...model.trajectory import Trajectory, receiver_positions
from ...numerics.pulse_geometry import PulseGeometry, half_path


class ChannelRows:
    """Rows of an array's echoes: (pulse, receiver) where channels are summed, else (pulse, transmitter, receiver).

    track      positions of the arrays' reference points at n pulses, and attitudes (n, 3, 3) of the transmitting and
               of the receiving array; an attitude of None means that its axes are the scene's
    receivers  positions of the receiving elements in the array, m (n_elements, 3); with receive="own" each channel has
               its own instead: see `receivers_of`
    """

    def __init__(
        self,
        array: AntennaArray,
        track: Trajectory,
        receiver: Trajectory | None,
        point: np.ndarray,
        channels: str,
        receive: str,
        polarizations: Sequence[str],
    ) -> None:
        """point  the reference point, m (3,);  channels, receive: arguments of `sarcl.echo`."""
        self.array, self.point, self.receive = array, point, receive
        self.separated, self.polarizations = channels == "separated", polarizations
        self.track = PulseGeometry(track.positions, receiver_positions(track, receiver))
        self.attitudes = track.attitude, (track if receiver is None else receiver).attitude
        self.receivers = array.positions if receive == "all" else np.zeros((1, 3))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of pulses, of transmitters per pulse, and of receivers per transmitter."""
        return len(self.track), self.array.n if self.separated else 1, len(self.receivers)

    @property
    def n_receivers(self) -> int:
        """Number of receivers of each channel."""
        return 1 if self.receive == "own" else len(self.receivers)

    def receivers_of(self, transmitter: np.ndarray) -> np.ndarray:
        """Positions in the array of the receivers of a channel that is sent from `transmitter` (3,), m (n, 3)."""
        return transmitter[None] if self.receive == "own" else self.receivers

    def tx_positions(self, elements: np.ndarray, at: slice | np.ndarray = slice(None)) -> np.ndarray:
        """Positions in the scene of transmitting elements, m (..., 3) in the array, at n pulses `at`: (n, ..., 3)."""
        return _in_scene(self.track.tx, self.attitudes[0], elements, at)

    def rx_positions(self, elements: np.ndarray, at: slice | np.ndarray = slice(None)) -> np.ndarray:
        """Positions in the scene of receiving elements, m (..., 3) in the array, at n pulses `at`: (n, ..., 3)."""
        return _in_scene(self.track.rx, self.attitudes[1], elements, at)

    def ends(
        self, transmitter: np.ndarray, at: slice | np.ndarray = slice(None), which: slice = slice(None)
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Antenna positions that the rows of a channel state, at n pulses `at` and for the receivers `which`.

        Returns tx (n, 3) and rx (n, receivers, 3), m, and reference ranges (n, receivers), m.
        """
        tx = self.tx_positions(transmitter, at) if self.separated else self.track.tx[at]
        rx = self.rx_positions(self.receivers_of(transmitter)[which], at)
        return tx, rx, half_path(tx[:, None], rx, self.point)

    def add(self, samples: np.ndarray, channel: Channel, receivers: slice, part: slice, echoes: np.ndarray) -> None:
        """Add echoes of a channel (n, receivers, n_polarizations, width) to samples of the pulses it is sent at.

        samples  (n, transmitters, receivers, n_polarizations, n_samples);  part  the channel's samples among these
        """
        if not self.separated:
            samples[:, 0, receivers, :, part] += np.complex64(channel.weight) * echoes
            return
        for element in channel.elements.tolist():
            samples[:, element, receivers] = np.complex64(self.array.weights[element]) * echoes

    def fields(self, center: float, sampling: Sampling, track: Trajectory, back: Trajectory) -> dict[str, Any]:
        """Fields of the PhaseHistory, one entry per row; center  Hz, of the waveform;  back  the receiver's track."""
        pulses, transmitters, receivers = self.shape
        n, names = pulses * transmitters * receivers, self.polarizations
        elements = self.array.positions
        tx = self.tx_positions(elements)[:, :, None] if self.separated else self.track.tx[:, None, None]
        own = self.receive == "own"
        rx = self.rx_positions(elements)[:, :, None] if own else self.rx_positions(self.receivers)[:, None]
        reference = np.broadcast_to(half_path(tx, rx, self.point), self.shape)
        tx, rx = (np.broadcast_to(ends, (*self.shape, 3)) for ends in (tx, rx))
        frequency = np.full(self.shape, sampling.frequency)
        if self.separated:
            offsets = np.stack([self.array.offsets_at(p) for p in range(pulses)])
            frequency[:] = (center + offsets - (sampling.width - 1) / 2 * sampling.step)[:, :, None]
        pulse, tx_channel, rx_channel = (i.ravel() for i in np.indices(self.shape))
        out: dict[str, Any] = {
            "frequency": frequency.reshape(n),
            "tx": tx.reshape(n, 3),
            "rx": rx.reshape(n, 3),
            "reference_range": reference.reshape(n),
            "time": None if track.times is None else track.times[pulse],
            "tx_channel": tx_channel if self.separated else None,
            "rx_channel": tx_channel if own else rx_channel,
        }
        for name, velocities in (("tx_velocity", track.velocities), ("rx_velocity", back.velocities)):
            out[name] = None if velocities is None else velocities[pulse]
        every = {k: v if v is None or len(names) == 1 else np.repeat(v, len(names), axis=0) for k, v in out.items()}
        return {**every, "polarization": np.tile(names, n), "frequency_step": sampling.step}


def _in_scene(
    centers: np.ndarray, attitude: np.ndarray | None, elements: np.ndarray, at: slice | np.ndarray
) -> np.ndarray:
    spread = centers[at].reshape(-1, *(1,) * (elements.ndim - 1), 3)
    turned = elements if attitude is None else np.einsum("nij,...j->n...i", attitude[at], elements)
    return np.asarray(spread + turned)
