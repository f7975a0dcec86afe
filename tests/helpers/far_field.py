"""The far field of a target's currents, consistent with the grid: echoes without the grid's own dispersion.

    a = -k dx^2/(2 sqrt(pi) s sqrt(g g_r)) sum_n exp(+j k_r u.x_n) (e_r . electric_n + h_r . magnetic_n),   |a|^2 = RCS

u points from the target to the receiver, s = c dt/dx. At the frequency of the run the grid's wave along u has the
wavenumber k_r and the fields e_r and h_r; g and g_r are the energy fluxes of the incident wave and of that wave.
The phase of a is that of `sarcl.echo`: a plate that faces the radar has a positive amplitude. Source:
docs/theory/full_wave.md.
"""

from __future__ import annotations

import numpy as np

from sarcl.fullwave import dispersion
from sarcl.fullwave.currents import Currents
from sarcl.fullwave.lattice import COURANT


def amplitude(currents: Currents, direction: np.ndarray, polarization: np.ndarray) -> np.ndarray:
    """Amplitudes of the echo that a receiver in `direction` (3,) sees in `polarization` (3,): complex128 (F,), m."""
    grid, towards = currents.lattice, np.asarray(direction) / np.linalg.norm(direction)
    k = dispersion.wavenumber(grid, currents.omega, towards)
    e, h = dispersion.fields(dispersion.grid_vector(grid, k, towards), np.asarray(polarization, float))
    total = np.zeros(len(k), np.complex128)
    for at, values, unit, magnetic in (
        (currents.edges, currents.electric, e, False), (currents.faces, currents.magnetic, h, True)
    ):  # fmt: skip
        path = (grid.positions(at, magnetic) - currents.centre) @ towards
        component = at // np.prod(grid.shape)
        for f in range(len(k)):
            total[f] += (values[f] * unit[f, component]) @ np.exp(1j * k[f] * path)
    sent = dispersion.flux(grid, currents.k, currents.wave.travel)
    received = dispersion.flux(grid, k, towards)
    scale = currents.k * grid.cell**2 / (2 * np.sqrt(np.pi) * COURANT)
    return np.asarray(-scale * total / np.sqrt(sent * received))
