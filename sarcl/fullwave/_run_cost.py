"""What a run takes, before it starts: bytes, steps and updates of cells."""

from __future__ import annotations

from dataclasses import dataclass

from ._currents import box_of, expected_steps
from ._incident import COMPONENTS, PlaneWave, wave_table
from ._lists import PARTS, SAMPLES
from .fields import VECTORS, WAVE_STEPS
from .lattice import LANES, Lattice

ENTRY = 130  # bytes of NumPy arrays per entry of the list of the incident wave, while it is made


@dataclass(frozen=True)
class RunCost:
    """What _currents:currents takes.

    device_bytes  of its buffers;  host_bytes  of its NumPy arrays, at most, the currents that it returns included
    steps         that are expected: resonances take more;  updates  cells of the grid times steps
    """

    device_bytes: int
    host_bytes: int
    steps: int
    updates: int


def run_cost(
    lattice: Lattice, wave: PlaneWave, *, edges: int, faces: int, frequencies: int, absorber: int, gap: int,
    conductor: bool = True,
) -> RunCost:  # fmt: skip
    """The cost of a run for a target of so many edges and faces, at so many frequencies.

    conductor  no edge is of another material;  others as in _currents:currents
    """
    low, high, centre = box_of(lattice, absorber, gap)
    table = wave_table(lattice, wave, low, high, centre)
    nx, ny, nz = lattice.shape
    groups = nx * lattice.groups + 1
    size = high - low
    pairs = [int(size[(a + 1) % 3] * (size[(a + 2) % 3] + 1)) for a in range(3)]
    pairs += [int(size[(a + 2) % 3] * (size[(a + 1) % 3] + 1)) for a in range(3)]
    entries = 2 * 2 * sum(pairs)  # on two sides, for E and for H
    lists = 0
    for n, of_entry in ((edges, 0 if conductor else 12), (faces, 20)):
        count = max(1, -(-n // LANES)) * LANES
        lists += 4 * groups + count * (4 + of_entry + 4 * SAMPLES + 8 * frequencies)
    norms = 8 * frequencies * (max(edges, faces) // (LANES * VECTORS) + 1)
    layers = 8 * (2 * absorber * (nx + ny) * nz + 2 * LANES * nx * ny) if absorber else 8
    wave_bytes = 4 * WAVE_STEPS * COMPONENTS * table.n_points
    device = 24 * lattice.component + lists + norms + 2 * layers + 4 * nx * ny
    device += 16 * entries + 2 * PARTS * 4 * groups + 2 * wave_bytes
    host = 8 * frequencies * (edges + faces) + 16 * (edges + faces) + 6 * wave_bytes
    steps = expected_steps(table)
    return RunCost(int(device), int(max(host, ENTRY * entries)), steps, steps * nx * ny * nz)
