"""Sums of a target's currents with the phases of their paths, pulse by pulse, on a device."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..opencl.device import Buffer, Device
from ..opencl.group_sizes import first_allowed
from ..opencl.launch_numbers import launch_numbers
from ..opencl.memory_budget import budget
from .currents import Currents

BLOCK = 8  # frequencies whose sums a work-item has in registers, as in kernels/current_sums.cl
CHUNK = 2048  # cells of a work-item: float32 sums over more would lose digits
PULSES = 256  # at a time
GROUPS = 32, 16, 8  # pulses of a work-group that keeps paths in local memory, most first
PATHS = 2 * 4 * 32 * GROUPS[0]  # bytes of these: to and from the 32 cells of a tile
BENT = 1e-4  # cycles: largest error of a phase that is taken as linear in the frequency over BLOCK frequencies


@dataclass(frozen=True, eq=False)
class Paths:
    """Antennas of P pulses from the target's centre, and wavenumbers.

    tx, rx  unit vectors towards the transmitter and the receiver (P, 3);  tx_range, rx_range  m (P,), or inf
    sent, received  wavenumbers, rad/m (F,) and (P, F)
    """

    tx: np.ndarray
    tx_range: np.ndarray
    rx: np.ndarray
    rx_range: np.ndarray
    sent: np.ndarray
    received: np.ndarray

    def part(self, which: np.ndarray) -> Paths:
        """The pulses of these numbers (n,)."""
        return Paths(
            self.tx[which], self.tx_range[which], self.rx[which], self.rx_range[which], self.sent, self.received[which]
        )

    @property
    def bistatic(self) -> bool:
        """True where receiver and transmitter, or their wavenumbers, differ."""
        same = np.array_equal(self.tx, self.rx) and np.array_equal(self.tx_range, self.rx_range)
        return not same or bool(np.abs(self.received - self.sent).max() > 1e-9 * self.sent.max())


def current_sums(device: Device, currents: Currents, paths: Paths, *, max_bytes: float | None) -> np.ndarray:
    """Sums over all cells, for E x, y, z and H x, y, z: complex128 (6, P, F). Equation: kernels/current_sums.cl.

    max_bytes  memory of the device for cells, currents and sums
    """
    lists = _by_component(currents)
    n_frequencies, n_pulses = len(paths.sent), len(paths.tx)
    out = np.zeros((6, n_pulses, n_frequencies), np.complex128)
    reach = max((float(np.linalg.norm(offset, axis=1).max()) for _, offset, _ in lists if len(offset)), default=0.0)
    macros = {"BISTATIC": int(paths.bistatic), "LINEAR": int(_is_linear(paths, reach))}
    sizes = GROUPS if device.info.vector_width == 1 and device.shares(PATHS, GROUPS[-1]) else ()
    group, (kernel,) = first_allowed(
        device, (*sizes, 0), lambda items: (device.kernel("current_sums.cl", "current_sums", **macros, GROUP=items),)
    )
    lanes, blocks = max(group, 1) * device.info.vector_width, -(-n_frequencies // BLOCK)
    for first in range(0, n_pulses, PULSES):
        part = paths.part(np.arange(first, min(first + PULSES, n_pulses)))
        count = -(-len(part.tx) // lanes) * lanes
        tables = [device.upload(values) for values in _tables(part, count)]
        sums_per_cell = 8 * blocks * BLOCK * count / CHUNK
        most = int(budget(device, max_bytes) / (8 * n_frequencies + 16 + sums_per_cell)) // CHUNK
        for number, offset, values in lists:
            for start in range(0, len(offset), max(1, most) * CHUNK):
                cells = slice(start, start + max(1, most) * CHUNK)
                total = _sums(device, kernel, offset[cells], values(cells), tables, currents.wave.travel,
                              (n_frequencies, count), group)  # fmt: skip
                out[number, first : first + len(part.tx)] += total[:, : len(part.tx)].T
    return out


def _by_component(currents: Currents) -> list[tuple[int, np.ndarray, Callable[[slice], np.ndarray]]]:
    """For E x, y, z and H x, y, z: number of the component, offsets of cells from the centre, m (n, 3), currents.

    Currents are functions that give those of a slice of these cells, complex64 (F, cells of the slice).
    """
    out: list[tuple[int, np.ndarray, Callable[[slice], np.ndarray]]] = []
    size = int(np.prod(currents.lattice.shape))
    for magnetic, (at, values) in enumerate(((currents.edges, currents.electric), (currents.faces, currents.magnetic))):
        offset, component = currents.lattice.positions(at, bool(magnetic)) - currents.centre, at // size
        for a in range(3):
            cells = np.flatnonzero(component == a)
            out.append((a + 3 * magnetic, offset[cells], _taken(values, cells)))
    return out


def _taken(values: np.ndarray, index: np.ndarray) -> Callable[[slice], np.ndarray]:
    return lambda cells: np.take(values, index[cells], axis=1)


def _is_linear(paths: Paths, reach: float) -> bool:
    """True where phases follow a straight line over BLOCK frequencies, within BENT cycles for cells up to `reach` m."""
    worst = 0.0
    for k in (paths.sent[None], paths.received):
        for first in range(0, k.shape[1], BLOCK):
            part = k[:, first : first + BLOCK]
            step = part[:, 1:2] - part[:, :1] if part.shape[1] > 1 else 0.0
            worst = max(worst, float(np.abs(part - part[:, :1] - step * np.arange(part.shape[1])).max()))
    return 2 * reach * worst / (2 * np.pi) < BENT


def _tables(paths: Paths, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Antennas, wavenumbers sent and wavenumbers received, as the kernel reads them; pulses up to `count`."""
    ends = ((paths.tx, paths.tx_range), (paths.rx, paths.rx_range))
    antenna = np.concatenate([np.vstack([unit.T, 1 / distance]) for unit, distance in ends])
    cycles = paths.received.T / (2 * np.pi)
    padded = [np.pad(values, ((0, 0), (0, count - values.shape[1])), mode="edge") for values in (antenna, cycles)]
    return padded[0].astype(np.float32), (paths.sent / (2 * np.pi)).astype(np.float32), padded[1].astype(np.float32)


def _sums(
    device: Device, kernel: object, offset: np.ndarray, values: np.ndarray, tables: list[Buffer], travel: np.ndarray,
    shape: tuple[int, int], group: int,
) -> np.ndarray:  # fmt: skip
    """Sums over one list of cells: complex128 (F, pulses); group: the macro GROUP of the kernel."""
    (n_frequencies, count), n = shape, len(offset)
    blocks, chunks = -(-n_frequencies // BLOCK), -(-n // CHUNK)
    cells = np.column_stack([offset, (offset**2).sum(axis=1) / 2]).astype(np.float32)
    bounds = np.minimum(np.arange(chunks + 1) * CHUNK, n).astype(np.int32)
    sums = device.empty(8 * chunks * blocks * BLOCK * count)
    arrays = [device.upload(table) for table in (cells, np.ascontiguousarray(values), bounds)]
    share = 1 if device.is_cpu else blocks
    size = (count // device.info.vector_width, chunks, share)
    device.run(
        kernel,
        size,
        (group, 1, 1) if group else None,
        launch_numbers("current_sums.cl", "current_sums", cells=n, n_frequencies=n_frequencies, n=count, travel=travel),
        *arrays,
        *tables,
        sums,
        steps=n / chunks,
    )
    got = device.download(sums, np.empty((chunks, blocks * BLOCK, 2, count), np.float32)).sum(axis=0, dtype=np.float64)
    return np.asarray(got[:n_frequencies, 0] + 1j * got[:n_frequencies, 1])
