"""Waveform forming: the echoes of many pulses from the currents of one run.

    a(p, f) = -k dx^2/(2 sqrt(pi) s sqrt(g g_r)) sum_n (e_r . electric_n + h_r . magnetic_n)
              exp(-j k ((|T - x_n| - |T - c|) - d.(x_n - c)) - j k_r (|R - x_n| - |R - c|)),   |a|^2 = RCS

The current of a cell follows the incident wave, whose direction of travel was d: its phase is corrected by the
difference of the paths from the transmitter T of this pulse, and the field at the receiver R of this pulse is that of
these currents. k is the wavenumber that was asked for; at the frequency at which the grid's wave from T has it, the
grid's wave towards R has the wavenumber k_r and the fields e_r and h_r; g and g_r are the energy fluxes of the incident
wave and of that wave, and s = c dt/dx. Source: B. Zou, Y. Jia and Z. Qiao, Proc. SPIE 11742 (2021), equations (4) to
(6); docs/theory/waveform_forming.md.
"""

from __future__ import annotations

import numpy as np

from ..base import boxes
from ..opencl.device import Device
from . import dispersion
from ._along_track import along_track, farthest_phase
from .current_sums import Paths, current_sums
from .currents import Currents
from .lattice import COURANT


def formed_echoes(
    device: Device,
    currents: Currents,
    tx: np.ndarray,
    rx: np.ndarray,
    received: np.ndarray,
    *,
    max_bytes: float | None = None,
) -> np.ndarray:
    """Echo amplitudes, m, whose phase is that of `sarcl.echo` about the centre of the currents: complex64 (P, Q, F).

    tx, rx    positions of the antennas, m (P, 3)
    received  unit vectors, the polarisations received at each pulse (Q, P, 3)
    """
    paths, received = paths_of(currents, tx, rx), np.asarray(received, float)

    def sums(pulses: np.ndarray) -> np.ndarray:
        found = current_sums(device, currents, paths.part(pulses), max_bytes=max_bytes)
        return found.swapaxes(0, 1).reshape(len(pulses), -1)

    def echoes(pulses: np.ndarray, found: np.ndarray) -> np.ndarray:
        parts = found.reshape(len(pulses), 6, -1).swapaxes(0, 1)
        return weighted(currents, paths.part(pulses), parts, received[:, pulses])

    every = np.arange(len(paths.tx))
    return echoes(every, along_track(sums, echoes, _farthest_phase(currents, tx, rx)))


def _farthest_phase(currents: Currents, tx: np.ndarray, rx: np.ndarray) -> np.ndarray:
    """How far the phase of the farthest cell has turned along the track, rad (P,)."""
    places = [currents.lattice.positions(at, bool(n)) for n, at in enumerate((currents.edges, currents.faces))]
    box = boxes.box(np.concatenate(places)) if sum(map(len, places)) else np.tile(currents.centre, (2, 1))
    by = np.concatenate([boxes.corners(box), currents.centre[None]])
    lengths = sum(np.linalg.norm(antenna[:, None] - by, axis=2) for antenna in (tx, rx))
    return farthest_phase(lengths[:, :-1] - lengths[:, -1:], float(currents.k.max()))


def paths_of(currents: Currents, tx: np.ndarray, rx: np.ndarray) -> Paths:
    """Directions, distances and wavenumbers of pulses with antennas at tx and rx, m (P, 3)."""
    towards, ranges = [], []
    for antenna in (tx, rx):
        ray = np.asarray(antenna, float) - currents.centre
        ranges.append(np.linalg.norm(ray, axis=1))
        towards.append(ray / ranges[-1][:, None])
    omega = dispersion.grid_omega(currents.lattice, currents.k, towards[0])
    received = dispersion.wavenumber(currents.lattice, omega, towards[1])
    return Paths(towards[0], ranges[0], towards[1], ranges[1], currents.k, received)


def weighted(currents: Currents, paths: Paths, sums: np.ndarray, received: np.ndarray) -> np.ndarray:
    """Echo amplitudes from sums (6, P, F) over cells, in polarisations `received` (Q, P, 3): complex64 (P, Q, F)."""
    grid = currents.lattice
    vector = dispersion.grid_vector(grid, paths.received, paths.rx)
    e, h = dispersion.fields(vector, received)
    total = np.einsum("qpfa,apf->pqf", np.concatenate([e, h], axis=-1), sums)
    flux = dispersion.flux(grid, paths.sent, paths.tx) * dispersion.flux(grid, paths.received, paths.rx)
    scale = -paths.sent * grid.cell**2 / (2 * np.sqrt(np.pi) * COURANT) / np.sqrt(flux)
    return np.asarray(scale[:, None] * total, np.complex64)
