"""Plane waves over a scene: wavenumbers of the rows on a plane, and the error of neglecting the wavefront curvature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.rows import spread_over
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory

MOST_ROWS = 65  # rows from which the error is estimated
DIRECTIONS = 16  # directions from the centre along which the sharp radius is searched
FOCUSED = np.pi / 4  # rad: largest blurring phase of a sharp image


@dataclass(frozen=True, eq=False)
class Waves:
    """Plane waves of rows about a point of a grid.

    center     m (3,): where they are exact
    units      unit vectors from it to the antennas (n_antennas, n_rows, 3): one antenna, or transmitter and receiver
    distances  from it to the antennas, m (n_antennas, n_rows)
    shift      half path by way of the center less reference_range, m (n_rows,): the phase 4 pi f shift/c is added back
    """

    center: np.ndarray
    units: np.ndarray
    distances: np.ndarray
    shift: np.ndarray

    @property
    def toward(self) -> np.ndarray:
        """Mean of the unit vectors of the antennas (n_rows, 3): less the gradient of the half path at the center."""
        return np.asarray(self.units.mean(axis=0))

    def pixel_cycles(self, raw: PhaseHistory, grid: ImageGrid) -> tuple[np.ndarray, np.ndarray]:
        """Cycles of phase from one pixel to the next along rows and columns, of sample n_samples//2, and their change
        from one sample to the next, each (n_rows, 2).

        K = -(2 f/c) u on the plane, u = toward, so that I(x) = sum s exp(+j 2 pi K.(x - center)).
        """
        assert grid.spacing is not None and grid.y_axis is not None and grid.x_axis is not None
        along = self.toward @ np.stack([grid.y_axis * grid.spacing[0], grid.x_axis * grid.spacing[1]], axis=1)
        middle = raw.frequency + raw.n_samples // 2 * raw.frequency_step
        scale = -2 / SPEED_OF_LIGHT
        return scale * middle[:, None] * along, scale * raw.frequency_step[:, None] * along


def waves_about(raw: PhaseHistory, center: np.ndarray) -> Waves:
    """Plane waves of every row about `center`, m (3,). ValueError where an antenna is at the centre."""
    antennas = [("tx", raw.tx)] if raw.is_monostatic else [("tx", raw.tx), ("rx", raw.rx)]
    units, distances, shifts = [], [], []
    for name, positions in antennas:
        away = positions - center
        distance = np.linalg.norm(away, axis=1)
        if not distance.all():
            row = int(np.argmin(distance))
            raise ValueError(f"{name}[{row}] is at the grid's centre, where waves have no direction")
        # in float64 the difference has an error of 4e-9 m at 36 000 km: 1e-5 rad at 60 GHz
        wide, reference = positions.astype(np.longdouble) - center, raw.reference_range.astype(np.longdouble)
        length = np.sqrt((wide**2).sum(axis=1))
        total = (
            length + reference
        )  # not above 0 for a reference range that is negative: there the quotient gains nothing
        quotient = ((wide**2).sum(axis=1) - reference**2) / np.where(total > 0, total, 1)
        shifts.append(np.where(total > 0, quotient, length - reference))
        units.append(away / distance[:, None])
        distances.append(distance)
    return Waves(center, np.stack(units), np.stack(distances), np.mean(shifts, axis=0).astype(np.float64))


@dataclass(frozen=True)
class Curvature:
    """Error of plane waves on a grid.

    phase       largest |4 pi f/c (|T - x| - |T - c| + u.(x - c))| of any pixel, row and frequency, rad; of two
                antennas the mean of both
    defocus     remaining phase, rad, after removal of a constant phase and a shift for each pixel
    distortion  the largest such shift, m
    radius      m from the centre within which defocus stays below pi/4; inf where it does up to the antennas
    """

    phase: float
    defocus: float
    distortion: float
    radius: float


def curvature(raw: PhaseHistory, waves: Waves, grid: ImageGrid) -> Curvature:
    """Error of plane waves on a plane: at its border, from some rows, at the lowest, middle and highest frequency."""
    rows = spread_over(raw.n_rows, MOST_ROWS)
    neglected = _NeglectedPhase(raw, waves, grid, rows)
    last = np.array(grid.shape) - 1
    i, j = (np.array(at) / 2 for at in ([0, 0, 0, 1, 1, 2, 2, 2], [0, 1, 2, 0, 2, 0, 1, 2]))
    phase, rest, shift = neglected(grid.at(i * last[0], j * last[1]) - waves.center)
    angle = np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
    assert grid.y_axis is not None and grid.x_axis is not None
    compass = np.cos(angle)[:, None] * grid.x_axis + np.sin(angle)[:, None] * grid.y_axis

    def blurred(radius: float) -> bool:
        return bool(neglected(radius * compass)[1].max() >= FOCUSED)

    low, high = 0.0, float(waves.distances[:, rows].min()) / 2
    radius = np.inf
    if blurred(high):
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (low, middle) if blurred(middle) else (middle, high)
        radius = low
    return Curvature(float(phase.max()), float(rest.max()), float(shift.max()), radius)


class _NeglectedPhase:
    """The phase that plane waves neglect, for some rows at three frequencies, and its part that is no shift."""

    def __init__(self, raw: PhaseHistory, waves: Waves, grid: ImageGrid, rows: np.ndarray) -> None:
        self.units, self.distances = waves.units[:, rows], waves.distances[:, rows]
        n = np.array([0, (raw.n_samples - 1) / 2, raw.n_samples - 1])
        frequency = raw.frequency[rows, None] + raw.frequency_step[rows, None] * n
        self.wavenumber = 4 * np.pi / SPEED_OF_LIGHT * frequency  # (rows, 3), rad/m of range
        assert grid.y_axis is not None and grid.x_axis is not None
        on_plane = waves.toward[rows] @ np.stack([grid.y_axis, grid.x_axis], axis=1)
        waves_here = (self.wavenumber[:, :, None] * on_plane[:, None]).reshape(-1, 2)
        middle = waves_here.mean(axis=0)
        # constant phase and shift; with columns of equal scale, shifts that equal a constant phase drop out of the fit
        self.scale = float(np.abs(waves_here - middle).max()) or 1.0
        self.basis = np.column_stack([np.ones(len(waves_here)), (waves_here - middle) / self.scale])

    def __call__(self, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Largest phase and remainder, rad, and shift, m, each (n,), at offsets d, m (n, 3), from the centre."""
        along = self.units @ d.T  # (antennas, rows, n)
        near = self.distances[..., None] - along
        path = np.sqrt(np.maximum((d * d).sum(axis=1) - along**2, 0) + near**2)
        # |T - x| - (|T| - u.d) without cancellation
        lacking = (((d * d).sum(axis=1) - along**2) / np.maximum(path + near, 1e-300)).mean(axis=0)
        phase = (self.wavenumber[:, :, None] * lacking[:, None]).reshape(-1, len(d))
        fit = np.linalg.lstsq(self.basis, phase, rcond=1e-9)[0]
        return (
            np.abs(phase).max(axis=0),
            np.abs(phase - self.basis @ fit).max(axis=0),
            np.linalg.norm(fit[1:], axis=0) / self.scale,
        )
