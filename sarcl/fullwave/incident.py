"""A plane wave that enters through the faces of a box: total field inside, scattered field outside.

The wave is the grid's own: at each frequency it has the wavenumber, the field vectors and the impedance that the grid
gives a plane wave along that direction. All six components then depend on time and on the distance d.x along the wave
alone. They are tabulated over that distance, and interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.validation import array, direction, sealed
from . import dispersion
from .lattice import COURANT, GroupOrder, Lattice
from .pulse import SILENCE, Pulse

SPACING = 1 / 3  # of the table, in cells: six points interpolate waves of 6 cells to 1e-5
QUIET = 3e-8  # of the peak of the wave: float32 fields have errors ten times as large
AHEAD = 8  # cells from the last value that is not negligible to the front of the wave, beyond which fields are zero
COMPONENTS = 6  # of E and H
SILENT = [-1, -2]  # first and last point that is not negligible, where none is
BEFORE, AFTER = 2, 3  # points of the table before and after the cell of a position


@dataclass(frozen=True, eq=False)
class PlaneWave:
    """A pulse that travels along `travel` (3,), a unit vector, with its electric field along `polarization` (3,)."""

    travel: np.ndarray
    polarization: np.ndarray
    pulse: Pulse

    def __post_init__(self) -> None:
        object.__setattr__(self, "travel", sealed(direction("travel", self.travel)))
        wanted = array("polarization", self.polarization, np.float64, (3,))
        across = wanted - float(wanted @ self.travel) * self.travel
        if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(wanted):
            raise ValueError(
                f"polarization {tuple(wanted)} lies along travel {tuple(self.travel)}; give a direction across it"
            )
        object.__setattr__(self, "polarization", sealed(across / np.linalg.norm(across)))


@dataclass(frozen=True, eq=False)
class Entrance:
    """Corrections of one field, each place at most once, in the order of GroupOrder: F[at] += amount u[from ...].

    at, source  places of the components that are corrected, and of those of the other field that the wave gives
    first       first entry of each group of rows
    """

    at: np.ndarray
    source: np.ndarray
    amount: np.ndarray
    first: np.ndarray


def entrances(lattice: Lattice, low: np.ndarray, high: np.ndarray) -> tuple[list[Entrance], list[Entrance]]:
    """Corrections of E and of H that make the field total between nodes low and high (3,), scattered outside.

    A component of E on an edge of the box is corrected for both its faces: it stands in two entrances.
    """
    electric, magnetic = [], []
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        for node, outside, sign in ((low[a], low[a] - 1, 1), (high[a], high[a], -1)):
            for target, other, turn in ((b, c, 1), (c, b, -1)):
                ranges = [np.arange(low[n], high[n] + (n != target)) for n in range(3)]
                e_at, h_at = list(ranges), list(ranges)
                e_at[a], h_at[a] = np.array([node]), np.array([outside])
                e_places, h_places = _places(lattice, target, e_at), _places(lattice, other, h_at)
                electric.append((e_places, h_places, sign * turn))
                magnetic.append((h_places, e_places, sign * turn))
    return _unique(lattice, electric), _unique(lattice, magnetic)


def _places(lattice: Lattice, component: int, node: list[np.ndarray]) -> np.ndarray:
    return np.ravel_multi_index(
        [np.array([component])[:, None, None, None], *np.ix_(*node)], (3, *lattice.shape)
    ).ravel()


def _unique(lattice: Lattice, parts: list[tuple[np.ndarray, np.ndarray, int]]) -> list[Entrance]:
    """Entrances in which no place occurs twice."""
    at, source = (np.concatenate([part[n] for part in parts]) for n in (0, 1))
    amount = np.concatenate([np.full(len(part[0]), part[2] * COURANT) for part in parts])
    out = []
    while len(at):
        _, once = np.unique(at, return_index=True)
        sort = GroupOrder.of(lattice, at[once])
        chosen = once[sort.order]
        out.append(Entrance(at[chosen], source[chosen], amount[chosen].astype(np.float32), sort.first))
        at, source, amount = (np.delete(values, once) for values in (at, source, amount))
    return out


@dataclass(frozen=True, eq=False)
class WaveTable:
    """The wave over distance along its direction, from step 0 until it has left the box.

    low, high  nodes at the faces of the box, int (3,)
    n_steps, n_points  number of steps, and of points along the wave, SPACING cells apart
    origin     distance of the first point from the origin of phases, m
    delay      s: the time at which the peak of the pulse passes the origin of phases
    centre     the origin of phases, m (3,)
    amplitudes, omega, k  of the lines of the spectrum: complex, rad/s and rad/m (m,)
    units      field vectors E and H of the lines, (6, m)
    signal     E of each step at the origin of phases, along its unit vector (n_steps,)
    """

    lattice: Lattice
    wave: PlaneWave
    low: np.ndarray
    high: np.ndarray
    n_steps: int
    n_points: int
    origin: float
    delay: float
    centre: np.ndarray
    amplitudes: np.ndarray
    omega: np.ndarray
    k: np.ndarray
    units: np.ndarray
    signal: np.ndarray

    def values(self, first: int, n_steps: int) -> np.ndarray:
        """E at steps first, first + 1 ... and H half a step later, float32 (n_steps, 6, n_points), peak about 1."""
        times = (first + np.arange(n_steps)) * self.lattice.time_step - self.delay
        turns = np.exp(1j * np.outer(times, self.omega))
        places = self.origin + SPACING * self.lattice.cell * np.arange(self.n_points)
        waves = self.amplitudes[:, None] * np.exp(-1j * np.outer(self.k, places))
        late = np.exp(0.5j * self.omega * self.lattice.time_step)
        out = np.empty((n_steps, COMPONENTS, self.n_points), np.float32)
        for component, unit in enumerate(self.units):
            x = turns * (unit if component < 3 else unit * late)
            out[:, component] = x.real @ waves.real - x.imag @ waves.imag
        return out

    def loud(self, values: np.ndarray) -> np.ndarray:
        """First and last point of each step whose values are not negligible, int (n_steps, 2); or SILENT."""
        heard = np.abs(values).max(axis=1) > QUIET * np.abs(self.signal).max()
        first, last = heard.argmax(axis=1), heard.shape[1] - 1 - heard[:, ::-1].argmax(axis=1)
        return np.where(heard.any(axis=1)[:, None], np.stack([first, last], axis=1), SILENT)

    def fronts(self, loud: np.ndarray, before: float) -> np.ndarray:
        """Cells from node 0 to the front of the wave along its direction, at each step (n_steps,).

        Nothing travels faster than the wave: beyond the front, scattered fields are zero too. `before` is the front one
        step earlier, -inf where the wave has not begun.
        """
        node = float((self.lattice.origin - self.centre) @ self.wave.travel)
        heard = (self.origin - node) / self.lattice.cell + SPACING * loud[:, 1] + AHEAD
        steps = COURANT * np.arange(1, len(loud) + 1)
        heard = np.where(loud[:, 1] < 0, -np.inf, heard)
        return np.asarray(np.maximum(np.maximum.accumulate(heard - steps), before) + steps)

    def read(self, source: np.ndarray, magnetic: bool) -> tuple[np.ndarray, np.ndarray]:
        """Entries of lists: 8 times the first of six points, plus the component, int32 (n,); position from the third
        point, in 0 ... 1 (n,)."""
        place = (self.lattice.positions(source, magnetic) - self.centre) @ self.wave.travel
        cell = (place - self.origin) / (SPACING * self.lattice.cell)
        whole = np.floor(cell)
        component = source // np.prod(self.lattice.shape) + 3 * magnetic
        return (8 * (whole - BEFORE) + component).astype(np.int32), (cell - whole).astype(np.float32)

    def spectrum(self, omega: np.ndarray) -> np.ndarray:
        """sum over steps n of u(n dt) exp(-j omega n dt) at the origin of phases, along the unit vector E: (n,)."""
        n = np.arange(self.n_steps) * self.lattice.time_step
        return np.asarray(np.exp(-1j * np.outer(omega, n)) @ self.signal)


def wave_table(lattice: Lattice, wave: PlaneWave, low: np.ndarray, high: np.ndarray, centre: np.ndarray) -> WaveTable:
    """The table of a wave for the box between nodes low and high; phases are zero at `centre`, m (3,)."""
    dt, step = lattice.time_step, SPACING * lattice.cell
    corners = lattice.origin + lattice.cell * np.stack(np.meshgrid(*zip(low - 1, high + 1, strict=True)), -1).reshape(
        -1, 3
    )
    reach = (corners - centre) @ wave.travel
    first = float(reach.min() - BEFORE * step)
    n_points = int((reach.max() - first) / step) + AFTER + 2
    delay = wave.pulse.half_length - first / SPEED_OF_LIGHT
    slowest = 1.2 * (n_points - 1) * step / SPEED_OF_LIGHT
    n_steps = int((2 * wave.pulse.half_length + slowest) / dt) + 2
    n_lines = min(n_steps // 2, int(wave.pulse.highest * n_steps * dt) + 1)
    frequency = np.arange(1, n_lines) / (n_steps * dt)
    line = np.asarray(wave.pulse.spectrum(frequency), np.complex128)
    kept = np.abs(line) > SILENCE * np.abs(line).max()
    omega, line = 2 * np.pi * frequency[kept], line[kept] / np.abs(line[kept]).sum()
    k = dispersion.wavenumber(lattice, omega, wave.travel)
    units = np.concatenate(dispersion.fields(dispersion.grid_vector(lattice, k, wave.travel), wave.polarization), 1)
    signal = (np.exp(1j * np.outer(np.arange(n_steps) * dt - delay, omega)) @ line).real
    return WaveTable(lattice, wave, low, high, n_steps, n_points, first, delay, centre, line, omega, k, units.T, signal)
