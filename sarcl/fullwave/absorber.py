"""Absorbing layers (CPML): their coefficients, and their memory on a device."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.validation import count
from ..opencl.device import Device
from .lattice import COURANT, LANES, Lattice

ORDER = 3  # the conductivity grows with this power of the depth
STRENGTH = 0.8  # largest conductivity over (ORDER + 1)/(377 ohm dx), as Roden and Gedney (2000) recommend
SHIFT = 0.05  # frequency shift alpha at the inner face, in rad per cell of path: absorbs fields that decay, too


def coefficients(thickness: int) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """beta and gamma, float32 (2 thickness,), for E and for H: layers at the low end, then those at the high end.

    Source: J. A. Roden and S. D. Gedney, Microw. Opt. Technol. Lett. 27 (2000), eqs (19), (20), with kappa = 1.
    """
    layer = np.arange(thickness)
    electric = np.concatenate([thickness - layer, layer])
    magnetic = np.concatenate([thickness - layer - 0.5, layer + 0.5])
    return _at(electric / max(thickness, 1)), _at(magnetic / max(thickness, 1))


def _at(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    sigma = STRENGTH * (ORDER + 1) * COURANT * depth**ORDER
    alpha = SHIFT * COURANT * (1 - depth)
    beta = np.exp(-(sigma + alpha))
    gamma = np.where(sigma > 0, sigma / np.where(sigma > 0, sigma + alpha, 1) * (beta - 1), 0)
    return beta.astype(np.float32), gamma.astype(np.float32)


def layers(device: Device, lattice: Lattice, thickness: int) -> tuple[tuple[Any, Any], ...]:
    """Memory and coefficients of the layers on all sides, for E and for H: arguments of kernels/fdtd_vacuum.cl.

    Along z the memory has LANES cells at each end of a row; those inside of the layers have gamma 0. ValueError where
    layers do not fit into the grid, or into these cells.
    """
    if count("absorber", thickness, least=0) > LANES:
        raise ValueError(f"absorber is {thickness} cells; layers have at most {LANES}")
    nx, ny, nz = lattice.shape
    if thickness and (min(nx, ny) < 2 * thickness or nz < 2 * LANES):
        raise ValueError(
            f"shape {lattice.shape} does not hold layers of {thickness} cells on each side; it needs at least "
            f"{(2 * thickness, 2 * thickness, 2 * LANES)}"
        )
    cells = 2 * thickness * (nx + ny) * nz + 2 * LANES * nx * ny if thickness else 1
    if 2 * cells >= 2**31:
        raise ValueError(
            f"layers of {thickness} cells need {2 * cells} numbers per field, kernels count to {2**31 - 1}: use fewer "
            "or larger cells"
        )
    made = []
    for beta, gamma in coefficients(thickness):
        parts = [beta, gamma, *(_in_rows(part) for part in (beta, gamma))]
        made.append((device.zeros(8 * cells), device.copied(np.concatenate(parts))))
    return tuple(made)


def _in_rows(along: np.ndarray) -> np.ndarray:
    """Coefficients (2 thickness,) in the outer cells of two vectors of LANES cells, 0 between."""
    out, half = np.zeros(2 * LANES, np.float32), len(along) // 2
    out[:half], out[2 * LANES - half :] = along[:half], along[half:]
    return out
