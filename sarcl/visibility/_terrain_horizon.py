"""Occlusion by a terrain of heights: horizons along range lines, about one evaluation per cell and viewpoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ._facet_samples import SampleLines
from ._frame import DeviceFacets, DevicePoints, Frame

FINE = 2  # range lines per cell at the border of the terrain
SIGHT_STEP = 4  # samples that a line of sight decides on


class Terrain:
    """Heights z (n_y, n_x) over increasing x (n_x,), y (n_y,), m, on a device."""

    def __init__(self, device: Device, grid: tuple[np.ndarray, np.ndarray, np.ndarray], frame: Frame) -> None:
        self.device, self.frame = device, frame
        x, y, z = ((v - c) * frame.unit for v, c in zip(grid, frame.center, strict=True))
        self.axes = (x, y)
        self.per = tuple((len(a) - 1) / (a[-1] - a[0]) for a in self.axes)
        self.x, self.y = (device.upload(a.astype(np.float32)) for a in self.axes)
        z = z.astype(np.float32)
        self.z_rows, self.z_columns = device.upload(z), device.upload(z.T)
        self._swept: list[Horizons] = []

    def hide(
        self, facets: DeviceFacets | DevicePoints, index: Any, n: int, lines: SampleLines, viewpoint: np.ndarray,
        other: np.ndarray, words: Any,
    ) -> None:  # fmt: skip
        """Set the bits of occluded samples: arguments as of `_ray_casting.Occluders.hide`. The
        horizons of the last two viewpoints are kept."""
        known = [swept for swept in self._swept if np.array_equal(swept.viewpoint, viewpoint)]
        if not known:
            known = [self.sweep(viewpoint)]
            self._swept = [*self._swept[-1:], *known]
        known[0].hide(facets, index, n, lines, other, words)

    def by_rays(self, viewpoint: np.ndarray) -> bool:
        """Whether single lines of sight tell what a viewpoint, m (3,), sees: always."""
        return True

    def sweep(self, viewpoint: np.ndarray) -> Horizons:
        """Horizons along range lines around a viewpoint, m (3,)."""
        eye = (viewpoint - self.frame.center) * self.frame.unit
        sectors = [_sector(self.axes, self.per, eye, axis, sign) for axis in (0, 1) for sign in (1, -1)]
        offsets = np.cumsum([0, *(len(s.lines) * s.columns for s in sectors)])
        table = self.device.empty(4 * max(int(offsets[-1]), 1))
        kernel = self.device.kernel("terrain_horizon.cl", "sweep")
        held = []  # buffers that must outlive the kernels
        for s, offset in zip(sectors, offsets, strict=False):
            if not s.columns:
                continue
            z, along, across = (self.z_columns, self.y, self.x) if s.axis else (self.z_rows, self.x, self.y)
            numbers = launch_numbers(
                "terrain_horizon.cl", "sweep", n_along=len(self.axes[s.axis]), n_across=len(self.axes[1 - s.axis]),
                per_across=self.per[1 - s.axis], eye=eye[s.axis], eye_z=eye[2], ref=s.end, first=s.first, step=s.step,
                columns=s.columns, offset=int(offset),
            )  # fmt: skip
            lines = self.device.upload(s.lines.astype(np.float32))
            held.append(lines)
            self.device.run(kernel, (len(s.lines),), None, numbers, z, along, across, lines, table)
        whole = [
            (s.first, s.step, s.columns, len(s.lines), o, 0, 0, 0) for s, o in zip(sectors, offsets[:4], strict=True)
        ]
        number = [(s.end, s.start, s.density, 0, 0, 0, 0, 0) for s in sectors]
        numbers = self.device.upload(np.array(number, np.float32))
        return Horizons(self, viewpoint, numbers, self.device.upload(np.array(whole, np.int32)), table, held)


@dataclass(frozen=True, eq=False)
class Horizons:
    """The horizons of one viewpoint, on the device."""

    terrain: Terrain
    viewpoint: np.ndarray
    number: Any
    whole: Any
    table: Any
    held: list[Any]

    def hide(
        self, facets: DeviceFacets | DevicePoints, index: Any, n: int, lines: SampleLines, other: np.ndarray, words: Any
    ) -> None:
        """Set the bits of occluded samples: arguments as of `_ray_casting.Occluders.hide`."""
        t = self.terrain
        kernel = t.device.kernel("terrain_horizon.cl", "horizon", LINES=lines.count)
        numbers = launch_numbers(
            "terrain_horizon.cl", "horizon", step=max(lines.step, SIGHT_STEP), nx=len(t.axes[0]),
            ny=len(t.axes[1]), per_x=t.per[0], per_y=t.per[1], eye=t.frame.eye(self.viewpoint)[:3],
            other=t.frame.eye(other)[:3],
        )  # fmt: skip
        t.device.run(
            kernel, (n,), None, numbers, facets.buffer, index, facets.kind, lines.places, t.x, t.y, t.z_rows,
            t.z_columns, self.number, self.whole, self.table, words,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Sector:
    """Range lines that cross at least as many grid lines along `axis` as across it.

    end      coordinate along `axis` of the terrain's border; there line i has the coordinate start + i/density across
    lines    (n, 2): coordinate across at the border, and slope
    first    grid line next to the viewpoint; from it outwards, by `step`, there are `columns` grid lines
    """

    axis: int
    step: int
    first: int
    end: float
    start: float
    density: float
    lines: np.ndarray
    columns: int


def _sector(axes: Any, per: Any, eye: np.ndarray, axis: int, sign: int) -> _Sector:
    along, across = axes[axis], axes[1 - axis]
    end = along[-1] if sign > 0 else along[0]
    # grid lines through the viewpoint itself cross no range line
    out = np.flatnonzero(sign * (along - eye[axis]) * per[axis] > 1e-3)[::sign]
    none = _Sector(axis, sign, 0, end, 0.0, 1.0, np.zeros((0, 2)), 0)
    if len(out) == 0:
        return none
    reach = along[out] - eye[axis]
    wide = abs(reach[-1]) * per[axis] / per[1 - axis]
    side = across[[0, -1]] - eye[1 - axis]
    ends = np.concatenate([side * (reach[-1] / reach[0]), side])
    low, high = max(ends.min(), -wide), min(ends.max(), wide)
    if not low < high:
        return none
    n = int(np.ceil((high - low) * per[1 - axis] * FINE)) + 2
    place = np.linspace(low, high, n)
    lines = np.stack([place + eye[1 - axis], place / reach[-1]], axis=1)
    density = (n - 1) / (high - low)
    return _Sector(axis, sign, int(out[0]), end, lines[0, 0], density, lines, len(out))
