"""An antenna as the beam of an image: the matched filter of its pattern.

    I(x) = sum_p v_p(x) conj(g_p(x)) w_p sum_n w_n s_p(f_n) exp(...),    gain(x) = sum_p v_p(x) |g_p(x)|^2 w_p sum_n w_n

g_p(x) is the gain of transmitting and receiving towards x, an amplitude, at the centre of the band: the factor that
`sarcl.echo(antenna=)` gives an echo. |I/gain|^2 is then the radar cross section of a point wherever it lies in the
beam, and I/gain the amplitude that fits the echoes best in noise that is the same in all rows.
Kernels: kernels/pixel_weights.clh, kernels/gains.clh; reference: AntennaWeights.weights.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from ..base import wgs84
from ..base.rows import spread_over
from ..base.validation import converted
from ..model import pointing
from ..model.antenna import Antenna, pair_of
from ..model.phase_history import PhaseHistory
from ..model.trajectory import Trajectory
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Buffer, Device
from ..scattering.antenna_weights import ANGLE, PATTERN, AntennaWeights

if TYPE_CHECKING:
    from .focusing_task import FocusingTask

AntennaBeam: TypeAlias = Antenna | tuple[Antenna, ArrayLike | Trajectory]  # and its direction or attitude
PIXELS, ROWS = 256, 64  # pixels and rows from which the mean gain is estimated
LEAST_DISTANCE = 1e-6  # radii of a tile: no direction is left so near to an antenna


def is_antenna(beam: object) -> TypeGuard[AntennaBeam]:
    """Whether `beam` is an Antenna, or one with its direction."""
    return isinstance(beam, Antenna) or (
        isinstance(beam, (tuple, list)) and bool(beam) and isinstance(beam[0], Antenna)
    )


def antenna_of(raw: PhaseHistory, beam: AntennaBeam, center: np.ndarray, name: str = "beam") -> AntennaWeights:
    """Gains for `beam`: an Antenna, whose boresight follows `center`, m (3,), or (antenna, aim).

    aim  direction of the boresight, (3,) or (n_rows, 3); or attitude, (n_rows, 3, 3) as Trajectory.attitude, or a
         Trajectory of a pulse per row that has one. Transmitter and receiver have the same
    ValueError: an aim of another shape, an attitude that is no rotation; name  of the argument, in errors
    """
    if isinstance(beam, (tuple, list)) and len(beam) != 2:
        raise ValueError(f"{name} has {len(beam)} parts; give an Antenna, or (antenna, direction or attitude)")
    antenna, aim = beam if isinstance(beam, (tuple, list)) else (beam, None)
    up = wgs84.vertical_at(center)
    ends = [raw.tx] if raw.is_monostatic else [raw.tx, raw.rx]
    axes = [_axes(antenna, Trajectory(None, end), aim, center, up=up, name=f"{name}[1]") for end in ends]
    frequency = float(np.median(raw.frequency + raw.n_samples // 2 * raw.frequency_step))
    pair = pair_of(antenna, not raw.is_monostatic)
    return AntennaWeights(PulseGeometry(raw.tx, raw.rx), frequency, pair, (axes[0], axes[-1]))


def picked(antenna: AntennaWeights, rows: np.ndarray) -> AntennaWeights:
    """The gains of these rows alone."""
    assert antenna.axes is not None
    return replace(antenna, geometry=antenna.geometry.picked(rows), axes=(antenna.axes[0][rows], antenna.axes[1][rows]))


def _axes(
    antenna: Antenna,
    track: Trajectory,
    aim: ArrayLike | Trajectory | None,
    center: np.ndarray,
    *,
    up: np.ndarray | None,
    name: str,
) -> np.ndarray:
    if aim is None:
        return antenna.axes(pointing.spotlight(track, center, up=up))
    if isinstance(aim, Trajectory):
        if aim.attitude is None or len(aim) != len(track):
            without = "" if aim.attitude is not None else " without attitude"
            raise ValueError(
                f"{name} is a Trajectory of {len(aim)} pulses{without}; give one with an attitude for each of the "
                f"{len(track)} rows, such as of pointing.stripmap"
            )
        aim = aim.attitude
    attitude = converted(name, aim, np.float64)
    if attitude.shape == (len(track), 3, 3):
        return antenna.axes(replace(track, attitude=attitude))
    if attitude.shape not in ((3,), (len(track), 3)):
        raise ValueError(
            f"{name} has shape {attitude.shape}; with an Antenna give the direction of its boresight, (3,) or "
            f"({len(track)}, 3), its attitude, ({len(track)}, 3, 3), or a Trajectory with an attitude per row"
        )
    return antenna.axes(pointing.fixed(track, attitude, up=up))


def rounding(task: FocusingTask, radius: float, share: float = 1.0) -> float:
    """Relative error of the image from gains in float32. ValueError where the grid lies out of the beam.

    share    of rounding in other numbers, of that in float32
    radius   of the largest tiles, m, padding included. Directions are differences of positions about a tile's middle:
             where a tile reaches farther than to the antenna, they are rounded by as much more
    """
    beam = task.antenna
    assert beam is not None
    _, points = task.grid.sample(PIXELS, seed=3)
    rows = spread_over(task.raw.n_rows, ROWS)
    power = np.mean([np.abs(beam.weights(points, int(row), beam.frequency)) ** 2 for row in rows])
    if not power > 0:
        raise ValueError(
            "the grid lies wholly out of the antenna's beam; aim it: give (antenna, direction), or (antenna, attitude) "
            "with the attitude of sarcl.pointing"
        )
    ends = np.concatenate([beam.geometry.tx[rows], beam.geometry.rx[rows]])
    distances = np.array([np.linalg.norm(points - end, axis=1) for end in ends])
    reach = radius / np.maximum(distances, max(LEAST_DISTANCE * radius, np.finfo(float).tiny))
    angle = ANGLE * float(np.sqrt(np.mean((1 + 2 * reach) ** 2)))
    one_way = sum(PATTERN + angle * one.slope(beam.frequency) for one in beam.patterns)
    return share * float(one_way * beam.peak / np.sqrt(power))


def shares(task: FocusingTask, points: np.ndarray) -> np.ndarray:
    """Weights conj(g), complex (n, n_rows), of points, m (n, 3), in all rows."""
    beam = task.antenna
    assert beam is not None
    gains = [beam.weights(points, row, beam.frequency).conj() for row in range(task.raw.n_rows)]
    return np.stack(gains, axis=1)


class GainsFloat64:
    """Buffers of an antenna for the kernels in float64, in the places of those of `TaperOnDevice`.

    gain  True: they add up |g|^2 over that of the peak times the rows' weights, not the echoes
    """

    pixel_bytes = 0

    def __init__(self, device: Device, task: FocusingTask, gain: bool = False) -> None:
        assert task.antenna is not None
        self.device, self.beam, macros = device, task.antenna, task.antenna.macros(1)
        self.patterns, _ = self.beam.upload(device, np.float64, relative=gain)
        self.macros = {"WEIGHT": 3 if gain else 2, "GAINS": macros["GAINS"], "ALIKE": macros["ALIKE"]}
        self._weights = np.asarray(task.row_weight, np.float64) if gain else None

    def apertures(self, positions: np.ndarray) -> None:
        """None: gains have no numbers per pixel."""

    def arguments(self, apertures: Buffer | None, start: int, stop: int) -> tuple[Buffer | None, ...]:
        """The kernel's arguments of rows start ... stop - 1: weights (or, not read, patterns), patterns, axes."""
        axes = self.beam.packed_axes(np.arange(start, stop), np.float64)
        weights = self.patterns if self._weights is None else self.device.upload(self._weights[start:stop])
        return weights, self.patterns, self.device.upload(axes)


class AntennaOnDevice:
    """Buffers of an antenna for the kernels.

    gain  True: they add up |g|^2 over that of the peak times the rows' weights, not the echoes
    """

    def __init__(self, device: Device, task: FocusingTask, gain: bool) -> None:
        assert task.antenna is not None
        self.device, self.task, self.beam = device, task, task.antenna
        self.patterns, self.second = self.beam.upload(device, relative=gain)
        self.macros = {**self.beam.macros(1), "WEIGHT": 3 if gain else 2}

    def arguments(self, start: int, stop: int) -> tuple[Buffer, ...]:
        """The kernel's arguments of rows start ... stop - 1: weights, patterns, axes."""
        axes = self.beam.packed_axes(np.arange(start, stop))
        weights = self.task.row_weight[start:stop].astype(np.float32)
        return self.device.upload(weights), self.patterns, self.device.upload(axes)
