"""A taper over the aperture of each pixel: the rows that see it, from the first to the last.

    w_p(x) = W((place_p - start(x)) inverse(x)),    start = first place - 1/2,    inverse = 1/(last place - first + 1)

Places count the rows of a channel in the order of time. Where every row sees a pixel these are the weights of a window
over the track; a row of a strip map has another weight in each pixel, so that the method adds pixel by pixel.
Kernels: kernels/pixel_weights.clh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..opencl.device import Buffer, Device
from ._row_coverage import RowCoverage
from .focusing_task import FocusingTask

CELLS = 2**14  # cells of a table in float32
WEIGHT_BUFFERS = 3  # of weights, among a kernel's arguments: any others stand in their places where there are none
PIECE = 2**20  # pairs of a pixel and a row whose weights are added up together


@dataclass(frozen=True, eq=False)
class PixelTaper:
    """The taper of a task's rows; see FocusingTask.taper and FocusingTask.places."""

    task: FocusingTask

    @property
    def table(self) -> np.ndarray:
        """W, float64, at the middles of even cells of 0 <= u <= 1."""
        assert self.task.taper is not None
        return self.task.taper

    def apertures(self, positions: np.ndarray) -> np.ndarray:
        """Start and inverse (2, n_tiles, per_tile) of positions, m (n_tiles, per_tile, 3); of one that no row sees,
        those of the whole track."""
        assert self.task.places is not None
        first, last = RowCoverage(self.task).spans(positions, self.task.places)
        none = first > last
        first[none], last[none] = self.task.places.min(), self.task.places.max()
        return np.stack([first - 0.5, 1 / (last - first + 1)])

    def weights(self, points: np.ndarray) -> np.ndarray:
        """Weights (n, n_rows) of points, m (n, 3), in the rows, whether or not these see them."""
        assert self.task.places is not None
        start, inverse = self.apertures(points[None])[:, 0, :, None]
        return self.read((self.task.places - start) * inverse)

    def gains(self, positions: np.ndarray, count: np.ndarray) -> np.ndarray:
        """Sums of the weights of the rows that see positions, m (n_tiles, per_tile, 3): (n_tiles, per_tile).

        count  rows that see each: where they are all rows of one channel from the first to the last, of the same
               weight, the sum depends on their number alone
        """
        task = self.task
        assert task.places is not None
        start, inverse = self.apertures(positions)
        alike = task.row_weight.min() == task.row_weight.max() and len(np.unique(task.places)) == len(task.places)
        plain = alike & (np.rint(1 / inverse) == count)
        sum_of_count = {0: 0.0}
        for n in np.unique(count[plain]).astype(int):
            sum_of_count[n] = float(self.read((np.arange(n) + 0.5) / max(n, 1)).sum() * task.row_weight[0])
        numbers = np.array(sorted(sum_of_count))
        sums = np.array([sum_of_count[n] for n in numbers])
        gains = sums[np.searchsorted(numbers, np.where(plain, count, 0).astype(int))]
        others = np.argwhere(~plain)
        step, rows = max(1, PIECE // task.raw.n_rows), np.arange(task.raw.n_rows)
        for at in range(0, len(others), step):
            tile, pixel = others[at : at + step].T
            seen = RowCoverage(task).sees(positions[tile, pixel], rows).T
            u = (task.places - start[tile, pixel, None]) * inverse[tile, pixel, None]
            gains[tile, pixel] = (seen * self.read(u)) @ task.row_weight
        return gains

    def read(self, u: np.ndarray) -> np.ndarray:
        """W at u, of any shape."""
        n = len(self.table)
        return np.interp(u, (np.arange(n) + 0.5) / n, self.table)


class TaperOnDevice:
    """The buffers that the kernels read of a taper; kind  float32 or float64."""

    def __init__(self, device: Device, task: FocusingTask, kind: type[np.floating]) -> None:
        self.device, self.task, self.kind, self.table = device, task, kind, None
        if task.taper is not None:
            table = task.taper
            if kind is np.float32:  # as fine as float32 can tell, and small enough for a cache
                table = PixelTaper(task).read((np.arange(CELLS) + 0.5) / CELLS)
            self.table, self.cells = device.upload(table.astype(kind)), len(table)

    @property
    def macros(self) -> dict[str, int]:
        """Build-time macros of kernels/pixel_weights.clh."""
        return {"WEIGHT": 0} if self.table is None else {"WEIGHT": 1, "TAPER": self.cells}

    @property
    def pixel_bytes(self) -> int:
        """Bytes on the device per pixel."""
        return 0 if self.table is None else 2 * np.dtype(self.kind).itemsize

    def apertures(self, positions: np.ndarray) -> Buffer | None:
        """Buffer of start and inverse (2, pixels) of positions, m (n_tiles, per_tile, 3); None without a taper."""
        if self.table is None:
            return None
        return self.device.upload(PixelTaper(self.task).apertures(positions).astype(self.kind))

    def arguments(self, apertures: Buffer | None, start: int, stop: int) -> tuple[Buffer | None, ...]:
        """The kernel's arguments of rows start ... stop - 1: place, taper, aperture; none without a taper."""
        if self.table is None or self.task.places is None:
            return ()
        return self.device.upload(self.task.places[start:stop].astype(self.kind)), self.table, apertures
