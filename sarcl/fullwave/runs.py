"""One run of the grid as echoes need it: the grid about bodies, what a run takes, the echoes that its currents form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..opencl.device import Device
from ._currents import currents
from ._cut_cells import conductor
from ._formed_echoes import formed_echoes
from ._incident import PlaneWave
from ._mesh_lines import mesh_lines
from ._pulse import Pulse
from .lattice import COURANT, LANES, Lattice, lattice_around
from .target import Target

ABSORBER, GAP, SPARE = 10, 3, 2  # cells on each side: absorbing layers, to the incident wave's box, to the target
MARGIN = ABSORBER + GAP + SPARE
WIDEST = 0.5  # lowest over highest frequency of the incident pulse: a narrower band makes a pulse longer than its echo
MOST_STEPS = 10.0  # of the predicted number, before a run is stopped

CELL_BYTES = 24  # of a cell: six components, float32
LAYER_BYTES = 16  # of a cell of an absorbing layer, for each axis along which the layer lies
ENTRY_BYTES = 56  # of an edge or a face of the target: coefficients, old value, residuals of a block of steps
FREQUENCY_BYTES = 8  # of an edge or a face and frequency: its phasor
ENTRANCE_BYTES = 64  # of a cell of the incident wave's box: components that the wave corrects
TABLE_BYTES = 72  # of a step and cell of the incident wave's table
ENTRIES = 5.0  # edges and faces of the target per area of a cell of its surface; measured: 4.7 for a sphere
RINGING = 2.0  # diagonals of the target's box: path of the currents until they have decayed


@dataclass(frozen=True)
class RunCost:
    """Predicted for one run.

    grid_bytes  of grid, target and incident wave;  entries  edges and faces of the target;  steps  in time
    """

    grid_bytes: float
    entries: float
    steps: int

    def bytes(self, n_frequencies: int) -> float:
        """Bytes on the device of a run that keeps the phasors of so many frequencies."""
        return self.grid_bytes + FREQUENCY_BYTES * self.entries * n_frequencies

    def frequencies(self, max_bytes: float) -> int:
        """How many frequencies fit into max_bytes, at least 1."""
        return max(1, int((max_bytes - self.grid_bytes) / (FREQUENCY_BYTES * self.entries)))


@dataclass(frozen=True)
class RunEnd:
    """How runs ended: steps done, and the largest part of the currents that was left (_currents)."""

    steps: int
    left: float


def grid_shape(bounds: np.ndarray, cell: float) -> np.ndarray:
    """Cells along x, y and z of `grid_about`."""
    shape = np.ceil((bounds[1] - bounds[0]) / cell - 1e-9).astype(np.int64) + 2 * MARGIN
    shape[2] += -shape[2] % LANES
    return shape


def grid_about(bounds: np.ndarray, cell: float) -> Lattice:
    """The grid about a box, m (2, 3), whose centre is the grid's: room for absorbing layers and the incident wave."""
    return lattice_around(bounds[0], bounds[1], cell, MARGIN)


def run_cost(bounds: np.ndarray, cell: float, area: float, band: tuple[float, float]) -> RunCost:
    """What one run takes on a grid about a box, m (2, 3), with a target of a surface of `area` m^2."""
    nx, ny, nz = (float(n) for n in grid_shape(bounds, cell))
    component = LANES + (nx + 2) * (ny + 1) * (nz + LANES)
    layers = 2 * ABSORBER * (nx + ny) * nz + 2 * LANES * nx * ny
    box = np.array([nx, ny, nz]) - 2 * (ABSORBER + GAP)
    sides = 2 * float(box[0] * box[1] + box[1] * box[2] + box[2] * box[0])
    diagonal = float(np.linalg.norm(box))  # cells
    pulse_steps = 2 * _pulse(band).half_length * SPEED_OF_LIGHT / (COURANT * cell)
    entries = ENTRIES * area / cell**2
    grid = CELL_BYTES * component + LAYER_BYTES * layers + ENTRY_BYTES * entries + ENTRANCE_BYTES * sides
    grid += TABLE_BYTES * (pulse_steps + 1.2 * diagonal / COURANT) * diagonal
    return RunCost(grid, entries, int(pulse_steps + (1 + RINGING) * diagonal / COURANT))


def too_many_cells(shape: np.ndarray) -> bool:
    """Whether a grid has more cells than the kernels count."""
    nx, ny, nz = (float(n) for n in shape)
    return 3 * (LANES + (nx + 2) * (ny + 1) * (nz + LANES) + (ny + 1) * (nz + LANES)) >= 2**31


def target_of(lattice: Lattice, triangles: np.ndarray) -> Target:
    """Perfect conductors of closed surfaces, m (k, 3, 3), on the grid; ValueError as `_mesh_lines` raises it."""
    return conductor(lattice, mesh_lines(lattice, triangles).intervals)


def run(
    device: Device, lattice: Lattice, target: Target, band: tuple[float, float], k: np.ndarray, *,
    anchor: tuple[np.ndarray, np.ndarray], tx: np.ndarray, rx: np.ndarray, received: np.ndarray, most_steps: int,
    max_bytes: float, progress: Callable[[int, int], None] | None = None,
) -> tuple[np.ndarray, RunEnd]:  # fmt: skip
    """One run: echoes of P pulses from the currents of an anchor, complex64 (P, Q, F), phase zero at the grid's centre.

    band      lowest and highest frequency of the waveform, Hz;  k  wavenumbers of the echoes, rad/m (F,)
    anchor    the transmitter's position, m (3,), and the polarisation that is sent there, a unit vector (3,)
    tx, rx    positions of the antennas, m (P, 3);  received  unit vectors, polarisations at each pulse (Q, P, 3)
    """
    place, sent = anchor
    centre = lattice.origin + lattice.cell * np.array(lattice.shape) / 2
    found = currents(
        device, lattice, target, PlaneWave(centre - place, sent, _pulse(band)), k, absorber=ABSORBER, gap=GAP,
        most_steps=most_steps, progress=progress,
    )  # fmt: skip
    echoes = formed_echoes(device, found, tx, rx, received, max_bytes=max_bytes)
    return echoes, RunEnd(found.n_steps, found.left)


def _pulse(band: tuple[float, float]) -> Pulse:
    return Pulse.gaussian(min(band[0], WIDEST * band[1]), band[1])
