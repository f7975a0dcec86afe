"""Equivalent currents of a target at the frequencies that are asked for, by one run of the grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..opencl.device import Device
from . import _dispersion
from ._incident import PlaneWave, wave_table
from ._lists import BLOCK, TargetList
from .fields import Fields
from .lattice import Lattice
from .target import Target

CHUNK = 128  # steps between two looks at how much of the currents is left: a multiple of BLOCK
WEAKEST = 1e-3  # of the spectrum: float32 fields have errors of about 1e-6 of the peak
LEFT = 1e-5  # largest residual of a block over the largest of all, below which the run ends


@dataclass(frozen=True, eq=False)
class Currents:
    """What a target's cells changed of the vacuum updates, as phasors at F frequencies, over the incident wave.

    With J and M the densities of electric current times the impedance of vacuum, and of magnetic current, and E_0 the
    incident field at `centre`: electric = -c dt J/E_0 and magnetic = -c dt M/E_0.

    k             wavenumbers of the incident wave on the grid, rad/m (F,), at the frequencies omega, rad/s (F,)
    edges, faces  places as in Lattice, of electric (F, n) and magnetic (F, m), complex64
    centre        where phases are zero, m (3,)
    n_steps       steps that were done;  left  largest residual of the last block over the largest of all
    """

    lattice: Lattice
    wave: PlaneWave
    centre: np.ndarray
    k: np.ndarray
    omega: np.ndarray
    edges: np.ndarray
    electric: np.ndarray
    faces: np.ndarray
    magnetic: np.ndarray
    n_steps: int
    left: float


def currents(
    device: Device, lattice: Lattice, target: Target, wave: PlaneWave, k: np.ndarray, *, absorber: int, gap: int,
    most_steps: int = 20_000, tile: int | None = None, progress: Callable[[int, int], None] | None = None,
) -> Currents:  # fmt: skip
    """Currents of a target under a plane wave at wavenumbers k (F,), rad/m, in vacuum.

    absorber  layers on each side;  gap  cells between these and the box where the wave enters
    progress  called as progress(steps done, steps expected)
    The target is inside that box. The run ends when the currents have decayed (LEFT), or after most_steps.
    """
    low = np.full(3, absorber + gap)
    high = np.array(lattice.shape) - absorber - gap
    centre = lattice.origin + lattice.cell * np.array(lattice.shape) / 2
    _check_inside(lattice, target, low, high)
    table = wave_table(lattice, wave, low, high, centre)
    fields = Fields(device, lattice, target, absorber=absorber, wave=table, tile=tile)
    omega = _dispersion.grid_omega(lattice, k, wave.travel)
    lists = (fields.edges, 0.5), (fields.faces, 0.0)  # E changes between two steps, H about a step
    spectrum = table.spectrum(omega)
    _check_band(k, spectrum)
    sums = [device.zeros(8 * len(omega) * part.count) for part, _ in lists]
    largest, left = 0.0, 1.0
    while fields.step < most_steps and (fields.step < len(table.values) or left > LEFT):
        now = 0.0
        times = fields.step + np.arange(CHUNK)
        phases = [device.copied(_turns(lattice, omega, times + late)) for _, late in lists]
        for block in range(CHUNK // BLOCK):
            fields.advance(BLOCK)
            for (part, _), phase, sum_ in zip(lists, phases, sums, strict=True):
                fields.transform(part, phase, sum_, block * BLOCK, BLOCK, len(omega))
        now = max(float(np.abs(part.residuals(BLOCK)).max(initial=0)) for part, _ in lists)
        largest = max(largest, now)
        left = now / largest if largest else 0.0
        if progress is not None:
            progress(fields.step, 2 * len(table.values))
    electric, magnetic = (_phasors(device, part, sum_, spectrum) for (part, _), sum_ in zip(lists, sums, strict=True))
    return Currents(
        lattice, wave, centre, np.asarray(k), omega, fields.edges.places, electric, fields.faces.places, magnetic,
        fields.step, left,
    )  # fmt: skip


def _check_inside(lattice: Lattice, target: Target, low: np.ndarray, high: np.ndarray) -> None:
    """ValueError where a cell of the target is not inside the box between nodes low and high."""
    for name, at in (("an edge", target.edges), ("a face", target.faces)):
        node = np.stack(np.unravel_index(at, (3, *lattice.shape))[1:], axis=1)
        outside = ~((node > low) & (node < high - 1)).all(axis=1)
        if outside.any():
            raise ValueError(
                f"target has {name} in cell {tuple(node[outside][0].tolist())}, outside the box of the incident wave "
                f"from {tuple(low.tolist())} to {tuple(high.tolist())}; give the grid a larger margin"
            )


def _check_band(k: np.ndarray, spectrum: np.ndarray) -> None:
    """ValueError where the pulse has less than WEAKEST of its strongest frequency at a wavenumber that is asked for."""
    weakest = int(np.argmin(np.abs(spectrum)))
    if not np.abs(spectrum[weakest]) > WEAKEST * np.abs(spectrum).max():
        raise ValueError(
            f"k[{weakest}] is {k[weakest]:.4g} rad/m, where the pulse has {np.abs(spectrum[weakest]):.2g} of its "
            f"spectrum, {np.abs(spectrum).max():.2g} at most; give a pulse whose band holds every wavenumber"
        )


def _turns(lattice: Lattice, omega: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Real and imaginary part of exp(-j omega t), float32 (n_steps, F, 2)."""
    turns = np.exp(-1j * np.outer(steps * lattice.time_step, omega))
    return np.stack([turns.real, turns.imag], axis=-1).astype(np.float32)


def _phasors(device: Device, part: TargetList, sums: object, spectrum: np.ndarray) -> np.ndarray:
    both = device.download(sums, np.empty((len(spectrum), 2, part.count), np.float32))[:, :, : len(part.places)]
    return np.asarray((both[:, 0] + 1j * both[:, 1]) / spectrum[:, None], np.complex64)
