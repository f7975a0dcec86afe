"""The Yee grid: cells, where their field components stand, and where they lie in the buffers of a device."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.validation import array, count, number, sealed

COURANT = 0.5 / sqrt(3)  # c dt/dx: half the limit of a grid without cut cells, which leaves room for cut faces
LANES = 16  # cells of a vector: rows are multiples of it, and are separated by as many cells that hold zero
ROWS = 8  # rows of a group: those that a work-item updates on a CPU


@dataclass(frozen=True, eq=False)
class Lattice:
    """A Yee grid of cubic cells.

    cell    edge of a cell, m
    shape   cells along x, y and z; the last is a multiple of LANES
    origin  position of node (0, 0, 0), m (3,)

    Component a of E stands at node + 1/2 cell along axis a, component a of H at node + 1/2 cell along both other axes.
    Places of field components are numbers of a raveled array (3, *shape).
    """

    cell: float
    shape: tuple[int, int, int]
    origin: np.ndarray
    row: int = field(init=False)
    plane: int = field(init=False)
    component: int = field(init=False)
    start: int = field(init=False)

    def __post_init__(self) -> None:
        number("cell", self.cell, above=0)
        nx, ny, nz = (count("shape", n) for n in self.shape)
        if nz % LANES:
            raise ValueError(
                f"shape has {nz} cells along z; give a multiple of {LANES}, such as {-(-nz // LANES) * LANES}"
            )
        row = nz + LANES
        plane = (ny + 1) * row
        derived = {
            "origin": array("origin", self.origin, np.float64, (3,)),
            "row": row,
            "plane": plane,
            "component": LANES + (nx + 2) * plane + row,
            "start": LANES + plane + row,
        }
        for name, value in derived.items():
            object.__setattr__(self, name, value)
        if 3 * self.component >= 2**31:
            raise ValueError(
                f"shape {self.shape} needs {3 * self.component} numbers per field, kernels count to {2**31 - 1}: "
                "use fewer or larger cells"
            )

    @property
    def time_step(self) -> float:
        """Time step, s."""
        return COURANT * self.cell / SPEED_OF_LIGHT

    @property
    def centre(self) -> np.ndarray:
        """Middle of the grid, m (3,), where phases of echoes are zero."""
        return np.asarray(self.origin + self.cell * np.array(self.shape) / 2)

    def positions(self, at: np.ndarray, magnetic: bool) -> np.ndarray:
        """Positions of field components at places `at` (n,), m (n, 3)."""
        component, *node = np.unravel_index(at, (3, *self.shape))
        along = np.arange(3) == np.asarray(component)[:, None]
        return np.asarray(self.origin + self.cell * (np.stack(node, axis=1) + 0.5 * (along != magnetic)))

    def in_buffer(self, at: np.ndarray) -> np.ndarray:
        """Where components at places `at` (n,) lie in the buffer of a field: int32 (n,)."""
        component, i, j, k = np.unravel_index(at, (3, *self.shape))
        return np.asarray(component * self.component + self.start + i * self.plane + j * self.row + k, np.int32)

    def from_buffer(self, buffer: np.ndarray) -> np.ndarray:
        """The field (3, *shape) in the contents of its buffer."""
        nx, ny, nz = self.shape
        cells = buffer.reshape(3, -1)[:, LANES : LANES + (nx + 2) * self.plane]
        return cells.reshape(3, nx + 2, ny + 1, self.row)[:, 1:-1, 1:, :nz]

    def to_buffer(self, values: np.ndarray) -> np.ndarray:
        """Contents float32 of the buffer of a field (3, *shape)."""
        buffer = np.zeros(3 * self.component, np.float32)
        self.from_buffer(buffer)[...] = values
        return buffer

    @property
    def groups(self) -> int:
        """Groups of ROWS rows in a plane; the last may have fewer rows."""
        return -(-self.shape[1] // ROWS)


@dataclass(frozen=True, eq=False)
class GroupOrder:
    """How a list of places is sorted by plane and group of rows.

    order  (n,);  first  first entry of each group, groups in the order of planes, int32 (planes * groups + 1,)
    """

    order: np.ndarray
    first: np.ndarray

    @classmethod
    def of(cls, lattice: Lattice, at: np.ndarray) -> GroupOrder:
        _, plane, row, _ = np.unravel_index(at, (3, *lattice.shape))
        group = plane * lattice.groups + row // ROWS
        order = np.lexsort((at, group))
        first = np.searchsorted(group[order], np.arange(lattice.shape[0] * lattice.groups + 1))
        return cls(sealed(order), sealed(first.astype(np.int32)))


def lattice_around(low: np.ndarray, high: np.ndarray, cell: float, margin: int) -> Lattice:
    """The grid of cells of `cell` metres that holds a box, m (3,), and at least `margin` cells on each of its sides."""
    low, high = array("low", low, np.float64, (3,)), array("high", high, np.float64, (3,))
    size = np.ceil((high - low) / number("cell", cell, above=0) - 1e-9).astype(int) + 2 * margin
    size[2] += -size[2] % LANES
    origin = (low + high) / 2 - cell * size / 2
    return Lattice(float(cell), (int(size[0]), int(size[1]), int(size[2])), origin)
