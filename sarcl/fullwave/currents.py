"""Equivalent currents of a target at the frequencies that are asked for, by one run of the grid, and when it ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, log

import numpy as np

from ..opencl.device import Buffer, Device
from . import dispersion
from ._lists import SAMPLES, TargetList
from .fields import BLOCK, PERIODS, Fields
from .incident import PlaneWave, WaveTable, wave_table
from .lattice import COURANT, Lattice
from .pulse import Pulse
from .target import Target

WEAKEST = 1e-3  # of the spectrum: float32 fields have errors of about 1e-6 of the peak
ALIAS = 1e-6  # of the spectrum at a frequency: what sums over some steps alone may add to it from other frequencies
SPAN = 256  # steps that are taken together: phasors of low frequencies change unevenly from window to window
SLOWEST = 0.98  # from one span to the next: changes that fall less do not fall
ROUNDING = 1e-5  # changes per window that may be rounding of float32 fields: 4e-6 were found beside spheres


@dataclass(frozen=True, eq=False)
class Currents:
    """What a target's cells changed of the vacuum updates, as phasors at F frequencies, over the incident wave.

    With J and M the densities of electric current times the impedance of vacuum, and of magnetic current, and E_0 the
    incident field at `centre`: electric = -c dt J/E_0 and magnetic = -c dt M/E_0.

    k             wavenumbers of the incident wave on the grid, rad/m (F,), at the frequencies omega, rad/s (F,)
    edges, faces  places as in Lattice, of electric (F, n) and magnetic (F, m), complex64
    centre        where phases are zero, m (3,)
    n_steps       steps that were done
    left, ended   what the run did not see, and why it ended: see Decay
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
    ended: str = "decayed"


@dataclass(frozen=True)
class RunOptions:
    """How a run of the grid ends, and how it is computed.

    tolerance   of the part of the currents that comes after the end of the run, relative (Decay)
    most_steps  number of steps after which it ends in any case, rounded up to whole windows
    progress    is called with the steps that are done and those that are expected
    tile        planes of the grid that are updated together; None: as the device likes
    max_bytes   bytes on the device to form echoes from the currents; None: as many as the device has
    """

    tolerance: float = 1e-4
    most_steps: int = 20_000
    progress: Callable[[int, int], None] | None = None
    tile: int | None = None
    max_bytes: float | None = None


def currents(
    device: Device,
    lattice: Lattice,
    target: Target,
    wave: PlaneWave,
    k: np.ndarray,
    *,
    absorber: int,
    gap: int,
    options: RunOptions = RunOptions(),
) -> Currents:
    """Currents of a target under a plane wave at wavenumbers k (F,), rad/m, in vacuum.

    absorber   layers on each side;  gap  cells between these and the box where the wave enters
    The target is inside that box. The run ends as Decay says, or after options.most_steps.
    """
    low, high = box_of(lattice, absorber, gap)
    _check_inside(lattice, target, low, high)
    table = wave_table(lattice, wave, low, high, lattice.centre)
    omega = dispersion.grid_omega(lattice, k, wave.travel)
    spectrum = table.spectrum(omega)
    _check_band(k, spectrum)
    every = sample_period(wave.pulse, omega, lattice.time_step)
    fields = Fields(device, lattice, target, absorber=absorber, wave=table, tile=options.tile, every=every)
    lists = (fields.edges, 0.5), (fields.faces, 0.0)  # E changes between two steps, H about a step
    sums = [device.zeros(8 * len(omega) * part.count) for part, _ in lists]
    window = SAMPLES * every
    decay = Decay(options.tolerance, window)
    most_steps, progress = options.most_steps, options.progress
    while fields.step < most_steps and (fields.step < table.n_steps or not decay.ended):
        times = fields.step + every - 1 + every * np.arange(SAMPLES)
        for _ in range(window // BLOCK):
            fields.advance(BLOCK)
        norms = np.zeros((2, len(omega)))
        for (part, late), sum_ in zip(lists, sums, strict=True):
            turns = every * _turns(lattice, omega, times + late)
            norms += fields.transform(part, device.upload(turns), sum_, SAMPLES, len(omega))
        decay.add(*norms)
        if progress:
            progress(fields.step, min(most_steps, max(expected_steps(table), fields.step + decay.missing_steps())))
    electric, magnetic = (_phasors(device, part, sum_, spectrum) for (part, _), sum_ in zip(lists, sums, strict=True))
    return Currents(
        lattice, wave, lattice.centre, np.asarray(k), omega, fields.edges.places, electric, fields.faces.places,
        magnetic, fields.step, decay.left, (decay.ended if fields.step >= table.n_steps else None) or "most_steps",
    )  # fmt: skip


def box_of(lattice: Lattice, absorber: int, gap: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes at the faces of the box where the wave enters, low and high (3,)."""
    low = np.full(3, absorber + gap)
    return low, np.array(lattice.shape) - low


def expected_steps(table: WaveTable) -> int:
    """Steps of a run whose currents decay while a wave crosses the grid once more."""
    diagonal = float(np.linalg.norm(table.lattice.shape))
    return table.n_steps + int(diagonal / COURANT) + SPAN


def sample_period(pulse: Pulse, omega: np.ndarray, time_step: float) -> int:
    """Steps between two samples of the residuals that sums over time need, at frequencies omega, rad/s (F,).

    The grid and its target are linear and do not change: residuals hold the frequencies of the pulse alone. A sum over
    every n-th step holds, beside the frequency that is asked for, those that differ by multiples of 1/(n dt). It is
    the sum over all steps, over n, where the pulse has nothing there (ALIAS).
    """
    frequency = omega / (2 * np.pi)
    spectrum = np.abs(pulse.spectrum(frequency))
    for every in PERIODS:
        shift = np.arange(1, every)[:, None] / (every * time_step)
        alias = frequency + np.concatenate([shift, -shift])
        if (np.abs(pulse.spectrum(np.abs(alias))).sum(axis=0) <= ALIAS * spectrum).all():
            return every
    return 1


class Decay:
    """What windows of equal length add to phasors, and what all later ones will.

    For each frequency, with S the phasors of all cells, the change is |S(after a window) - S(before)|/|S(after)|. The
    largest changes of the last n windows (SPAN steps), a, and of the n windows before, b, give the ratio r = a/b. If it
    stays, later windows add at most n a (r + r^2 + ...) = n a r/(1 - r), which adds changes as if they all had the same
    phase: true for a resonance at that frequency, and too much for others.

    left   largest of these estimates over frequencies; 1 before there are enough windows
    ended  "decayed": left <= tolerance;  None: not yet
           "rounding": changes are below ROUNDING and do not fall. They are fields that stand still where rounding left
           them, whose sums over time do not grow: left is n a.
    """

    def __init__(self, tolerance: float, window: int) -> None:
        self._tolerance, self._windows = tolerance, max(1, SPAN // window)
        self._changes: list[np.ndarray] = []
        self.left, self._ratio = 1.0, 1.0
        self.ended: str | None = None

    def add(self, changes: np.ndarray, sums: np.ndarray) -> None:
        """Take |change|^2 and |S|^2, summed over all cells, of a window (F,) each."""
        self._changes = [*self._changes[1 - 2 * self._windows :], np.sqrt(changes)]
        self.ended = None
        if len(self._changes) < 2 * self._windows:
            return
        size = np.sqrt(sums)
        if not size.any():  # nothing scatters
            self.left, self.ended, self._ratio = 0.0, "decayed", 0.0
            return
        n = self._windows
        before, last = (np.max(part, axis=0) for part in (self._changes[:n], self._changes[n:]))
        last, ratio = last / size, last / np.where(before > 0, before, 1)
        self._ratio = float(ratio.max())
        falling = np.minimum(ratio, SLOWEST)
        left = n * last * falling / (1 - falling)
        self.left = float(left.max())
        if self.left <= self._tolerance and (ratio < 1).all():
            self.ended = "decayed"
        elif ((left <= self._tolerance) | ((last < ROUNDING) & (ratio > SLOWEST))).all():
            self.left, self.ended = float((n * last).max()), "rounding"

    def missing_steps(self) -> int:
        """Steps until `left` is as small as asked for, if changes go on falling as they do; 0 where they do not."""
        if self.left <= self._tolerance or not 0 < self._ratio < SLOWEST:
            return 0
        return ceil(log(self._tolerance / self.left) / log(self._ratio)) * SPAN


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


def _phasors(device: Device, part: TargetList, sums: Buffer, spectrum: np.ndarray) -> np.ndarray:
    out = np.empty((len(spectrum), len(part.places)), np.complex64)
    both = np.empty((2, part.count), np.float32)
    for f, weight in enumerate(spectrum):
        device.download(sums, both, offset=f * both.nbytes)
        out[f] = (both[0] + 1j * both[1])[: out.shape[1]] / weight
    return out
