"""Field of an array whose elements each transmit a carrier of their own, at any positions and times."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import float_pairs, text, validation
from ..base.constants import SPEED_OF_LIGHT
from ..model.antenna_array import AntennaArray
from ..opencl import memory_budget
from ..opencl.choose_device import open_device
from ..opencl.device import Device, DeviceChoice
from ._beam_plan import FINE, FLUSH, FieldPlan, blocks, fraction, make_plan, middle

CHUNK = 64  # elements per work-item when tables are made
ROWS = 8  # rows per tile
MOST_ROWS, MOST_LANES = 256, 2**16  # largest numbers of rows and lanes in a block
SLICE = 2**18  # points per array operation on the host: bounds the memory


def beam(
    array: AntennaArray,
    f0: float,
    *,
    times: ArrayLike,
    positions: ArrayLike,
    reference: ArrayLike = (0.0, 0.0, 0.0),
    tolerance: float = 1e-5,
    device: DeviceChoice | None = None,
    max_bytes: float | None = None,
    pulse: int = 0,
) -> NDArray[np.complexfloating]:
    """The field of an array, sum_n w_n exp(+j 2 pi f_n (t - |x - x_n|/c)): times.shape + positions.shape[:-1].

    f0         base frequency, Hz; element n sends f_n = f0 + array.offsets_at(pulse)[n]
    times      s (...), absolute: at t = 0 every element's carrier has phase arg w_n
    positions  x, m (..., 3), in the array's axes;  reference  position of the array's reference point, m (3,)
    tolerance  largest error of any value, relative to sum |w_n|; below 1e-6 the result is complex128, else complex64
    device     an OpenCL device: an index, "cpu", "gpu" or part of a name
    max_bytes  memory for blocks on the device, default 1 GiB on CPUs, half the memory of a GPU

    Distances to every element are exact, the phase is absolute, and amplitudes do not fall with range. The field of an
    array with one carrier is computed once per point. Raises ValueError for invalid arguments, ToleranceUnreachable
    with the best tolerance, and MemoryError if max_bytes is too small for one tile.

    >>> array = sarcl.AntennaArray.linear(8, spacing=0.015)
    >>> field = sarcl.beam(array, 10e9, times=[0.0], positions=[[1e4, 0, 0], [1e4, 1e3, 0]])
    >>> field.shape, round(float(abs(field[0, 0])), 3)
    ((1, 2), 8.0)
    """
    validation.instance("array", array, AntennaArray)
    f0 = validation.number("f0", f0)
    offsets = np.asarray(array.offsets_at(pulse), np.longdouble)
    carriers = np.longdouble(f0) + offsets
    if carriers.min() <= 0:
        at = int(np.argmin(carriers))
        raise ValueError(f"f0 + offset is {float(carriers[at]):g} Hz at element {at}; every carrier must be above 0 Hz")
    tolerance = validation.tolerance(tolerance)
    t = validation.converted("times", times, np.float64)
    validation.finite("times", t)
    x = validation.vectors("positions", positions)
    validation.finite("positions", x)
    origin = validation.array("reference", reference, np.float64, (3,))
    opened = open_device(device)
    budget = memory_budget.budget(opened, max_bytes)
    points = x.reshape(-1, 3)
    kind = np.complex64 if tolerance >= FINE else np.complex128
    validation.room(
        f"a field of {t.size:,} times at {len(points):,} points",
        float(t.size) * len(points) * np.dtype(kind).itemsize,
        "give fewer times or positions at once",
    )
    out = np.empty((t.size, len(points)), kind)
    if not out.size:
        return out.reshape(t.shape + x.shape[:-1])
    extent = float(np.linalg.norm(array.positions, axis=1).max())
    places = _Places.seen(points, origin)
    farthest = float(places.ranges.max())
    plan = make_plan(opened, tolerance, float(carriers.max()), extent, float(np.abs(t).max()), farthest)
    work = _Field(opened, plan, array, carriers, places, budget)
    if np.ptp(offsets) == 0:  # the field is a product of functions of time and of position
        work.add(np.zeros(1), once := np.empty((1, len(points)), kind))
        cycles = fraction(carriers[0] * t.ravel().astype(np.longdouble))
        np.multiply.outer(np.exp(2j * np.pi * cycles.astype(np.float64)).astype(kind), once[0], out=out)
    else:
        work.add(t.ravel(), out)
    return out.reshape(t.shape + x.shape[:-1])


class _Places(NamedTuple):
    """Points, m (n, 3), the array's reference point (3,), and ranges between them, m (n,), in extended precision."""

    points: np.ndarray
    origin: np.ndarray
    ranges: np.ndarray

    @classmethod
    def seen(cls, points: np.ndarray, origin: np.ndarray) -> _Places:
        """With the ranges of the points."""
        ranges = np.empty(len(points), np.longdouble)
        for i in range(0, len(points), SLICE):
            v = points[i : i + SLICE].astype(np.longdouble) - origin
            ranges[i : i + SLICE] = np.sqrt((v * v).sum(axis=1))
        return cls(points, origin, ranges)


class _Field:
    """Sums the carriers of an array at points, block by block of times and points."""

    def __init__(
        self,
        device: Device,
        plan: FieldPlan,
        array: AntennaArray,
        carriers: np.ndarray,
        places: _Places,
        budget: float,
    ) -> None:
        self.device, self.plan, self.budget = device, plan, budget
        self.carriers, (self.points, self.origin, self.ranges) = carriers, places
        self.center = (carriers.min() + carriers.max()) / 2
        self.offsets = carriers - self.center
        self.elements = array.positions.T
        self.real = np.float64 if plan.double else np.float32
        self.item = 16 if plan.double else 8  # bytes of a complex number
        self.weights = device.upload(np.stack([array.weights.real, array.weights.imag]).astype(self.real))
        self.lane_width = 8 if device.is_cpu else 64
        self.group = (1, 1) if device.is_cpu else None  # on PoCL every work-item of a group has its own stack

    def add(self, times: np.ndarray, out: np.ndarray) -> None:
        """Compute out (times, points). Lanes run along the longer of the two axes."""
        n, most, c = len(self.carriers), np.abs(self.offsets).max(), np.longdouble(SPEED_OF_LIGHT)
        along_times = len(times) > len(self.points)
        room = min(self.budget / 4, self.device.info.max_alloc)
        least = self.lane_width * n * self.item
        if room < least:
            raise MemoryError(
                f"a tile of {self.lane_width} entries of {n} elements needs {text.size_text(4 * least)} in all; "
                "pass a larger max_bytes"
            )
        rows = max(ROWS, min(MOST_ROWS, int(room / (n * self.item))) // ROWS * ROWS)
        lanes = int(min(MOST_LANES, room / (n * self.item), room / (rows * self.item)))
        lanes = max(self.lane_width, lanes // self.lane_width * self.lane_width)
        reach = float(self.plan.reach / most) if most else np.inf  # s
        t = times.astype(np.longdouble)
        time_blocks = blocks(t, reach, lanes if along_times else rows)
        range_blocks = blocks(self.ranges, reach * SPEED_OF_LIGHT, rows if along_times else lanes)

        def time_table(which: np.ndarray) -> tuple[Any, int]:
            t0 = middle(t[which])
            entries = np.stack([t[which] - t0, fraction(self.center * (t[which] - t0))])
            elements = np.stack([self.offsets, fraction(self.carriers * t0)])
            return self._table("times", entries, elements, lanes_are=along_times)

        def path_table(which: np.ndarray) -> tuple[Any, int]:
            r0 = middle(self.ranges[which])
            shift = self.ranges[which] - r0
            v = (self.points[which].astype(np.longdouble) - self.origin).T
            entries = np.stack([*v, self.ranges[which], shift, fraction(self.center * shift / c)])
            start = fraction(self.carriers * r0 / c)
            elements = np.stack([*self.elements, self.carriers / c, self.offsets / c, start])
            return self._table("paths", entries, elements, lanes_are=not along_times)

        outer, inner = (time_blocks, range_blocks) if along_times else (range_blocks, time_blocks)
        outer_table, inner_table = (time_table, path_table) if along_times else (path_table, time_table)
        only_table = inner_table(inner[0]) if len(inner) == 1 else None
        for lane_block in outer:
            lane = outer_table(lane_block)
            for row_block in inner:
                sums = self._sum(lane, only_table or inner_table(row_block), len(row_block))[:, : len(lane_block)]
                if along_times:
                    out[np.ix_(lane_block, row_block)] = sums.T
                else:
                    out[np.ix_(row_block, lane_block)] = sums

    def _table(self, name: str, entries: np.ndarray, elements: np.ndarray, *, lanes_are: bool) -> tuple[Any, int]:
        """The table of kernel `name`, and its number of entries: whole tiles, the last one filled up with repeats."""
        device, n, lanes = self.device, elements.shape[1], self.device.info.vector_width
        width = self.lane_width if lanes_are else ROWS
        many = -(-entries.shape[1] // width) * width
        entries = entries[:, np.minimum(np.arange(many), entries.shape[1] - 1)]
        table = device.empty(self.item * n * many)
        numbers = self._wide(entries), self._wide(elements)
        weights = [self.weights] if name == "paths" else []
        device.run(
            self._kernel(name), (many // lanes, -(-n // CHUNK)), self.group,
            numbers[0], many, numbers[1], n, *weights, table, width,
        )  # fmt: skip
        return table, many

    def _sum(self, lane: tuple[Any, int], row: tuple[Any, int], rows: int) -> np.ndarray:
        """Sums over the elements for the entries of two tables, complex (rows, lanes)."""
        n_rows = next(k for k in (1, 2, 4, ROWS) if k >= min(rows, ROWS))
        tiles = row[1] // ROWS
        out = self.device.empty(self.item * tiles * n_rows * lane[1])
        self.device.run(
            self._kernel("add", n_rows), (lane[1] // self.device.info.vector_width, tiles), self.group,
            lane[0], row[0], len(self.carriers), lane[1], out, steps=len(self.carriers),
        )  # fmt: skip
        planes = self.device.download(out, np.empty((tiles * n_rows, 2, lane[1]), self.real))
        return np.asarray(planes[:rows, 0] + 1j * planes[:rows, 1])

    def _kernel(self, name: str, used: int = ROWS) -> object:
        macros = {"DOUBLE": int(self.plan.double), "ROWS": ROWS, "USED": used, "LANES": self.lane_width}
        fp64 = int(self.device.info.fp64)  # where it is slow too: `_wide` gives it as the plan counts its rounding
        return self.device.kernel("beam.cl", name, **macros, FLUSH=FLUSH, CHUNK=CHUNK, FP64=fp64)

    def _wide(self, values: np.ndarray) -> object:
        """Values (k, n) as wide numbers on the device: float64, or pairs of float32 (k, 2, n)."""
        if self.device.info.fp64:
            return self.device.upload(values.astype(np.float64))
        return self.device.upload(float_pairs.wide(values).swapaxes(0, 1))
