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
from . import _dispersion
from ._pulse import SILENCE, Pulse
from .lattice import COURANT, Lattice, PlaneOrder

SPACING = 1 / 3  # of the table, in cells: six points interpolate waves of 6 cells to 1e-5
QUIET = 3e-8  # of the largest value of a table: float32 fields have errors ten times as large
COMPONENTS = 6  # of E and H
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
    """Corrections of one field, each place at most once, sorted by plane: F[at] += amount u[from ...].

    at, source  places of the components that are corrected, and of those of the other field that the wave gives
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
        sort = PlaneOrder.of(lattice, at[once])
        chosen = once[sort.order]
        out.append(Entrance(at[chosen], source[chosen], amount[chosen].astype(np.float32), sort.first))
        at, source, amount = (np.delete(values, once) for values in (at, source, amount))
    return out


@dataclass(frozen=True, eq=False)
class WaveTable:
    """The wave over distance along its direction, for every time step until it has left the box.

    low, high  nodes at the faces of the box, int (3,)
    values  float32 (n_steps, n, 6): E at step n and H at step n + 1/2, x, y and z each, peak about 1
    loud    int (n_steps, 2): first and last point at which the wave is not negligible at a step (QUIET); -1, -2: none
    origin  distance of the first value from the origin of phases, m
    delay   s: the time at which the peak of the pulse passes the origin of phases
    centre  the origin of phases, m (3,)
    amplitudes, omega  of the lines of the spectrum, complex and rad/s (m,)
    """

    lattice: Lattice
    wave: PlaneWave
    low: np.ndarray
    high: np.ndarray
    values: np.ndarray
    loud: np.ndarray
    origin: float
    delay: float
    centre: np.ndarray
    amplitudes: np.ndarray
    omega: np.ndarray

    def read(self, source: np.ndarray, magnetic: bool) -> tuple[np.ndarray, np.ndarray]:
        """Place of the first of six points within a step, int32 (n,), and position from the third, in 0 ... 1 (n,)."""
        place = (self.lattice.positions(source, magnetic) - self.centre) @ self.wave.travel
        cell = (place - self.origin) / (SPACING * self.lattice.cell)
        whole = np.floor(cell)
        component = source // np.prod(self.lattice.shape) + 3 * magnetic
        first = COMPONENTS * (whole - BEFORE) + component
        return first.astype(np.int32), (cell - whole).astype(np.float32)

    def spectrum(self, omega: np.ndarray) -> np.ndarray:
        """sum over steps n of u(n dt) exp(-j omega n dt) at the origin of phases, along the unit vector E: (n,)."""
        n = np.arange(len(self.values)) * self.lattice.time_step
        signal = (self.amplitudes * np.exp(1j * np.outer(n - self.delay, self.omega))).real.sum(axis=1)
        return np.asarray(np.exp(-1j * np.outer(omega, n)) @ signal)


def wave_table(lattice: Lattice, wave: PlaneWave, low: np.ndarray, high: np.ndarray, centre: np.ndarray) -> WaveTable:
    """The table of a wave for the box between nodes low and high; phases are zero at `centre`, m (3,)."""
    dt, step = lattice.time_step, SPACING * lattice.cell
    corners = lattice.origin + lattice.cell * np.stack(np.meshgrid(*zip(low - 1, high + 1, strict=True)), -1).reshape(
        -1, 3
    )
    reach = (corners - centre) @ wave.travel
    first = reach.min() - BEFORE * step
    places = first + step * np.arange(int((reach.max() - first) / step) + AFTER + 2)
    delay = wave.pulse.half_length - first / SPEED_OF_LIGHT
    slowest = 1.2 * (places[-1] - first) / SPEED_OF_LIGHT
    n_steps = int((2 * wave.pulse.half_length + slowest) / dt) + 2
    n_lines = min(n_steps // 2, int(wave.pulse.highest * n_steps * dt) + 1)
    frequency = np.arange(1, n_lines) / (n_steps * dt)
    line = np.asarray(wave.pulse.spectrum(frequency), np.complex128)
    kept = np.abs(line) > SILENCE * np.abs(line).max()
    omega, line = 2 * np.pi * frequency[kept], line[kept] / np.abs(line[kept]).sum()
    k = _dispersion.wavenumber(lattice, omega, wave.travel)
    e, h = _dispersion.fields(_dispersion.grid_vector(lattice, k, wave.travel), wave.polarization)
    number = np.arange(1, n_lines)[kept]
    values = np.empty((n_steps, len(places), COMPONENTS), np.float32)
    phase = np.exp(-1j * (np.multiply.outer(places, k) + omega * delay))
    for component in range(COMPONENTS):
        unit = e[:, component] if component < 3 else h[:, component - 3] * np.exp(0.5j * omega * dt)
        bins = np.zeros((len(places), n_steps // 2 + 1), np.complex128)
        bins[:, number] = phase * (line * unit)
        values[:, :, component] = np.fft.irfft(bins, n_steps, axis=1).T * (n_steps / 2)
    return WaveTable(lattice, wave, low, high, values, _loud(values), float(first), float(delay), centre, line, omega)


def _loud(values: np.ndarray) -> np.ndarray:
    """First and last point of each step whose values are not negligible, int (n_steps, 2); -1, -2: none."""
    heard = np.abs(values).max(axis=2) > QUIET * np.abs(values).max()
    first, last = heard.argmax(axis=1), heard.shape[1] - 1 - heard[:, ::-1].argmax(axis=1)
    return np.where(heard.any(axis=1)[:, None], np.stack([first, last], axis=1), [-1, -2])
