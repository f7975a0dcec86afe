"""One run of the grid as echoes need it: the grid about bodies, what a run takes, the echoes that its currents form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..opencl.device import Device
from ._lists import PARTS, SAMPLES
from .bodies.materials import RIM as RIM
from .bodies.materials import Body, bodies
from .currents import RunOptions, currents
from .fields import WAVE_STEPS
from .formed_echoes import formed_echoes
from .incident import COMPONENTS, SPACING, PlaneWave
from .lattice import COURANT, LANES, ROWS, Lattice
from .mirrors import Twin, mirror_axes, mirrored_echoes, twins
from .pulse import Pulse
from .target import Target

ABSORBER, GAP, SPARE = 10, 3, 2  # cells on each side: absorbing layers, to the incident wave's box, to the target
MARGIN = ABSORBER + GAP + SPARE
WIDEST = 0.5  # lowest over highest frequency of the incident pulse: a narrower band makes a pulse longer than its echo
FINER = 1.06  # by which cells may be smaller than asked, so that flat sides lie on nodes
RESOLVED = 0.7  # of a gap between conductors: cells that leave a node in it
MOST_STEPS = 10.0  # of the predicted number, before a run is stopped

EDGE_BYTES = 4 + 4 * SAMPLES  # of an edge of a conductor: place, samples of its residual
FACE_BYTES = EDGE_BYTES + 20  # of a face: four weights and the old value
MATERIAL_BYTES = 12  # of an edge of another material: two shares and the old value
FREQUENCY_BYTES = 16  # of an edge or a face and frequency: its sum over time on the device, and its phasor
ENTRANCE_BYTES = 76  # of a component that the incident wave corrects: of NumPy arrays, while its list is made
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
    """How runs ended: steps done, and the largest part of the currents that was left (currents)."""

    steps: int
    left: float


def fitting_cell(bounds: np.ndarray, cell: float, flat: np.ndarray, finer: float) -> float:
    """A size of cells, at most `cell` m and at least cell/finer, of which flat sides are nearly a whole number apart.

    bounds  of a box, m (2, 3);  flat  which of its sides are flat: low and high, along x, y and z (2, 3)
    """
    extent = (bounds[1] - bounds[0])[flat.all(axis=0)]
    if not len(extent):
        return cell
    tried = cell / np.linspace(1, finer, 241)
    return float(tried[np.argmin(_whole(extent / tried[:, None])[1].max(axis=1))])


def grid_about(bounds: np.ndarray, cell: float, flat: np.ndarray) -> Lattice:
    """The grid about a box, m (2, 3), with room for absorbing layers and the incident wave.

    A flat side (`flat` as in fitting_cell) lies on nodes, or little outside of them where both sides of an axis are
    flat: edges of bodies between nodes are computed as if they were at the nodes inside of them. Along an axis with no
    flat side or two, nodes lie alike on both sides of the box's centre, so that a mirrored body has a mirrored grid.
    """
    number, rest = _whole((bounds[1] - bounds[0]) / cell)
    shape = grid_shape(bounds, cell, flat)
    lack = np.ceil(number + rest) - number - rest  # of a box to whole cells
    before = np.select([flat.all(axis=0), flat[0], flat[1]], [-rest / 2, 0 * lack, lack], lack / 2)
    spread = np.array([0, 0, (shape[2] - grid_shape(bounds, cell, flat, lanes=1)[2]) // 2])
    origin = bounds[0] - cell * (MARGIN + before + spread)
    return Lattice(cell, (int(shape[0]), int(shape[1]), int(shape[2])), origin)


def grid_shape(bounds: np.ndarray, cell: float, flat: np.ndarray, lanes: int = LANES) -> np.ndarray:
    """Cells along x, y and z of `grid_about`; the last is a multiple of `lanes`."""
    number, rest = _whole((bounds[1] - bounds[0]) / cell)
    shape = np.where(flat.all(axis=0), number, np.ceil(number + rest)).astype(np.int64) + 2 * MARGIN
    shape[2] += -shape[2] % lanes
    return shape


def _whole(number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whole numbers of cells, and what is left, which is 0 where rounding alone makes it other."""
    whole = np.floor(number + 1e-6)
    return whole, np.maximum(number - whole, 0) * (number - whole > 1e-6)


def run_bytes(
    shape: np.ndarray, edges: float, faces: float, frequencies: int, *, gap: int = GAP, absorber: int = ABSORBER,
    conductor: bool = True,
) -> tuple[float, float]:  # fmt: skip
    """Bytes of the buffers of a run, and with them those of its NumPy arrays at most: currents:currents.

    shape      cells along x, y and z;  edges, faces  of the target;  frequencies  of its phasors
    conductor  no edge is of another material
    """
    nx, ny, nz = (float(n) for n in shape)
    box = np.array([nx, ny, nz]) - 2 * (absorber + gap)
    entrances = 4 * 2 * float(box @ np.roll(box, 1) + box.sum())
    groups = nx * np.ceil(ny / ROWS)
    fields = 24 * (LANES + (nx + 2) * (ny + 1) * (nz + LANES) + (ny + 2) * (nz + LANES)) + 4 * nx * ny
    layers = 16 * (2 * absorber * (nx + ny) * nz + 2 * LANES * nx * ny) if absorber else 0
    lists = (EDGE_BYTES + (0 if conductor else MATERIAL_BYTES)) * edges + FACE_BYTES * faces
    lists += 16 * entrances + 4 * (2 + 2 * PARTS) * groups
    wave = 2 * 4 * WAVE_STEPS * COMPONENTS * float(np.linalg.norm(box)) / SPACING
    device = fields + layers + lists + wave + FREQUENCY_BYTES / 2 * frequencies * (edges + faces)
    host = max(ENTRANCE_BYTES * entrances, 4 * wave, FREQUENCY_BYTES / 2 * frequencies * (edges + faces))
    return device, device + host


def run_cost(shape: np.ndarray, cell: float, area: float, band: tuple[float, float]) -> RunCost:
    """What one run takes on a grid of `shape` cells (3,) with a target of a surface of `area` m^2."""
    diagonal = float(np.linalg.norm(shape - 2 * (ABSORBER + GAP)))  # cells
    pulse_steps = 2 * incident_pulse(band).half_length * SPEED_OF_LIGHT / (COURANT * cell)
    entries = ENTRIES * area / cell**2
    _, grid = run_bytes(shape, 0.4 * entries, 0.6 * entries, 0)
    return RunCost(grid, entries, int(pulse_steps + (1 + RINGING) * diagonal / COURANT))


def too_many_cells(shape: np.ndarray) -> bool:
    """Whether a grid has more cells than the kernels count."""
    nx, ny, nz = (float(n) for n in shape)
    return 3 * (LANES + (nx + 2) * (ny + 1) * (nz + LANES) + (ny + 1) * (nz + LANES)) >= 2**31


def target_of(
    lattice: Lattice, parts: Sequence[tuple[np.ndarray, complex | None]], k: float, strip: float = 0.0
) -> Target:
    """Closed bodies on the grid: facets, m (k, 3, 3), and relative permittivity at the wavenumber k of each material,
    None: a perfect conductor; strip  m, widest strip of a conductor thinner than a cell that may be a sheet. ValueError
    as `bodies` raises it.
    """
    return bodies(lattice, [Body(*part) for part in parts], k, strip / lattice.cell)


def mirror_twins(
    lattice: Lattice, target: Target, tx: np.ndarray, sent: np.ndarray, k: float, radius: float
) -> dict[int, Twin]:
    """For pulses, the pulse that the run of their anchor serves too, by a mirror that leaves the target unchanged.

    tx, sent  positions of the transmitter, m, and polarisations, unit vectors (P, 3);  k, radius  as `mirrors:twins`
    """
    return twins(mirror_axes(lattice, target), unit(tx - lattice.centre), sent, k, radius)


@dataclass(frozen=True, eq=False)
class Anchor:
    """Where the wave of a run comes from.

    place  of the transmitter, m (3,);  sent  its polarisation, a unit vector (3,)
    twin   the anchor that the run serves too, by a mirror; None: none
    """

    place: np.ndarray
    sent: np.ndarray
    twin: Twin | None = None


@dataclass(frozen=True, eq=False)
class Antennas:
    """Antennas of P pulses, whose echoes are formed.

    tx, rx    positions, m (P, 3)
    received  unit vectors, polarisations at each pulse (Q, P, 3)
    """

    tx: np.ndarray
    rx: np.ndarray
    received: np.ndarray


def run(
    device: Device,
    lattice: Lattice,
    target: Target,
    band: tuple[float, float],
    k: np.ndarray,
    *,
    anchor: Anchor,
    antennas: Antennas,
    options: RunOptions,
) -> tuple[list[np.ndarray], RunEnd]:
    """One run: echoes of P pulses from the currents of an anchor, complex64 (P, Q, F), phase zero at the grid's centre;
    and those from the currents of its twin, where it has one.

    band  lowest and highest frequency of the waveform, Hz;  k  wavenumbers of the echoes, rad/m (F,)
    """
    wave = PlaneWave(lattice.centre - anchor.place, anchor.sent, incident_pulse(band))
    sources = currents(device, lattice, target, wave, k, absorber=ABSORBER, gap=GAP, options=options)
    of_pulses = antennas.tx, antennas.rx, antennas.received
    echoes = [formed_echoes(device, sources, *of_pulses, max_bytes=options.max_bytes)]
    if anchor.twin is not None:
        echoes.append(mirrored_echoes(device, sources, anchor.twin, *of_pulses, max_bytes=options.max_bytes))
    return echoes, RunEnd(sources.n_steps, sources.left)


def incident_pulse(band: tuple[float, float]) -> Pulse:
    """The pulse that runs send for a band, Hz: no narrower than WIDEST allows."""
    return Pulse.gaussian(min(band[0], WIDEST * band[1]), band[1])
