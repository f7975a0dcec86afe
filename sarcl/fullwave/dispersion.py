"""Plane waves of the Yee grid: its own wavenumber, frequency, polarisation and energy flux.

Directions are unit vectors (3,) or, one per pulse, (P, 3); then results have P in front of their shape.

A plane wave exp(j omega t - j k d.x) along the unit vector d solves the grid's equations in vacuum where

    |K| = Omega,   K_i = (2/dx) sin(k d_i dx/2),   Omega = 2/(c dt) sin(omega dt/2)

E is orthogonal to K, H = K x E/Omega. Source: A. Taflove and S. C. Hagness, Computational Electrodynamics (2005),
chapter 4.
"""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from .lattice import Lattice

STEPS = 12  # of Newton's method, which converges quadratically from k = Omega


def _phase_per_cell(lattice: Lattice, k: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """k d_i dx (n, 3)."""
    return np.asarray(np.asarray(k)[..., None] * np.asarray(direction)[..., None, :] * lattice.cell)


def grid_vector(lattice: Lattice, k: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """K of waves of wavenumbers k (n,), rad/m, along `direction` (3,): (n, 3)."""
    return np.asarray(2 / lattice.cell * np.sin(_phase_per_cell(lattice, k, direction) / 2))


def grid_omega(lattice: Lattice, k: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Angular frequencies, rad/s (n,), at which waves along `direction` have wavenumbers k (n,).

    ValueError where a wavelength is shorter than the grid carries.
    """
    length = np.linalg.norm(grid_vector(lattice, k, direction), axis=-1)
    if (np.abs(k) * np.abs(direction).max() * lattice.cell > np.pi).any():
        raise ValueError(
            f"wavelength {2 * np.pi / np.max(k):.3g} m is below two cells of {lattice.cell:.3g} m; use smaller cells"
        )
    dt = lattice.time_step
    return np.asarray(2 / dt * np.arcsin(SPEED_OF_LIGHT * dt / 2 * length))


def wavenumber(lattice: Lattice, omega: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Wavenumbers, rad/m (n,), of waves of angular frequencies omega (n,) along `direction`."""
    dt = lattice.time_step
    length = 2 / (SPEED_OF_LIGHT * dt) * np.sin(np.asarray(omega) * dt / 2)
    k = length * np.ones_like(np.asarray(direction)[..., :1])
    for _ in range(STEPS):
        vector = grid_vector(lattice, k, direction)
        slope = _along(lattice, vector, k, direction)  # of |K|^2/2
        k -= ((vector**2).sum(axis=-1) - length**2) / (2 * np.where(slope == 0, 1, slope))
    if (np.abs((grid_vector(lattice, k, direction) ** 2).sum(axis=-1) - length**2) > 1e-9 * length**2).any():
        raise ValueError(
            f"frequency {np.max(omega) / (2 * np.pi):.4g} Hz is above what cells of {lattice.cell:.3g} m carry; "
            "use smaller cells"
        )
    return np.asarray(k)


def fields(vector: np.ndarray, polarization: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """E and H, unit vectors (n, 3), of plane waves with K (n, 3): E is `polarization` (3,) less its part along K."""
    unit = vector / np.linalg.norm(vector, axis=-1, keepdims=True)
    across = polarization[..., None, :]
    e = across - unit * (unit * across).sum(axis=-1, keepdims=True)
    e = e / np.linalg.norm(e, axis=-1, keepdims=True)
    return e, np.cross(unit, e)


def flux(lattice: Lattice, k: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Energy flux along `direction` of plane waves of unit E (n,): 1 in vacuum, less on the grid.

    E and H stand half a cell apart, so that their product averages to cos(k d_i dx/2) along axis i.
    """
    vector = grid_vector(lattice, k, direction)
    return _along(lattice, vector, k, direction) / np.linalg.norm(vector, axis=-1)


def _along(lattice: Lattice, vector: np.ndarray, k: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Sum over i of d_i K_i cos(k d_i dx/2), (n,)."""
    part = vector * np.cos(_phase_per_cell(lattice, k, direction) / 2)
    return np.asarray((part * np.asarray(direction)[..., None, :]).sum(axis=-1))
