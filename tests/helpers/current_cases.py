"""Random currents of a target, antennas about it, and the sums of the currents in float64."""

from __future__ import annotations

import numpy as np

from sarcl.fullwave import dispersion
from sarcl.fullwave.currents import Currents
from sarcl.fullwave.incident import PlaneWave
from sarcl.fullwave.lattice import Lattice
from sarcl.fullwave.pulse import Pulse
from sarcl.reference import equations

CELL = 0.02  # m
RANGE = 1.1e3  # m


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v)


def random_currents(n, n_frequencies, shape=(48, 48, 48), cell=CELL, seed=0):
    """Currents that are random at n edges and n faces of a grid."""
    rng = np.random.default_rng(seed)
    grid = Lattice(cell, shape, np.array([1.0, 2.0, 3.0]))
    places = rng.permutation(3 * np.prod(grid.shape))[: 2 * n]
    edges, faces = np.sort(places[:n]), np.sort(places[n:])
    wave = PlaneWave(unit((1, 0.3, -0.9)), np.array([0, 1.0, 0]), Pulse.gaussian(1e9, 2e9))
    k = np.linspace(0.7, 1, n_frequencies) * 2 * np.pi / (10 * cell)
    phasors = rng.normal(size=(4, n_frequencies, n))
    electric, magnetic = ((phasors[a] + 1j * phasors[a + 1]).astype(np.complex64) for a in (0, 2))
    centre = grid.origin + cell * np.array(grid.shape) / 2
    omega = dispersion.grid_omega(grid, k, wave.travel)
    return Currents(grid, wave, centre, k, omega, edges, electric, faces, magnetic, 0, 0.0)


def antennas(currents, n, spread, distance=RANGE, seed=1):
    """Antennas about the direction from which the wave came."""
    rng = np.random.default_rng(seed)
    towards = np.array([unit(-currents.wave.travel + spread * rng.normal(size=3)) for _ in range(n)])
    return currents.centre + distance * towards


def twin(currents, paths, tx, rx):
    """Sums over the cells of E x, y, z and H x, y, z in float64 (6, P, F)."""
    out, size = [], int(np.prod(currents.lattice.shape))
    for at, values, magnetic in ((currents.edges, currents.electric, 0), (currents.faces, currents.magnetic, 1)):
        offset = currents.lattice.positions(at, bool(magnetic)) - currents.centre
        for component in range(3):
            own = at // size == component
            out.append(equations.current_sums(
                offset[own], values[:, own], currents.wave.travel, paths.sent, paths.received, tx - currents.centre,
                rx - currents.centre,
            ))  # fmt: skip
    return np.array(out)


def difference(got, wanted):
    return np.abs(got - wanted).max() / np.sqrt((np.abs(wanted) ** 2).mean())
