"""Task of fullwave_echo: geometry, frequencies, the grid about the bodies, and the runs of an anchor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import ToleranceUnreachable, TooThin, warn
from ...base.vectors import unit
from ...model.trajectory import Trajectory, receiver_positions
from ...model.waveform import Waveform
from ...numerics.pulse_geometry import half_path
from ...opencl.device import Device
from ...opencl.memory_budget import budget
from ...scattering.physical_optics import polarisation
from ...scene.scene import Scene
from ...simulation import echo_sampling
from .. import runs
from ..lattice import Lattice
from ..mirrors import Twin
from ..target import Target
from ._antenna_geometry import angle_along, check_outside, window_of
from ._closed_bodies import check_bodies, check_wavelengths, losses_said, parts_of
from ._grid_choice import check_cells, chosen_cells, default_bytes, grid_choice
from ._options import FullwaveOptions

LEFT = 1 / 30  # of the tolerance: currents that may come after the end of a run
# wavelengths, at the highest frequency: widest strip thinner than a cell that is a sheet on the grid, far from the
# quarter of a wavelength at which strips on a body resonate. Wider parts are plates or masts, and refused
STRIP = 0.1
MOST_SHOWN = 0.999  # of a run, as progress shows it, until it has ended: it may take longer than expected
LEAST_TOLERANCE = 1e-4  # fields in float32, and currents until they have decayed to a part of 1e-5


@dataclass(frozen=True, eq=False)
class FullwaveTask:
    """Echoes to be computed, and the grid for them: the checked problem.

    options           as they were asked for;  polarizations, vertical  names, and a unit vector (3,)
    device, devices   the device of its runs; all of this process that share them
    band              lowest and highest frequency of the waveform, Hz
    track, receiver   antennas while pulses are on their way;  motion  entries of a plan about them
    reference_range   m (P,);  window  m (near, far);  frequencies  Hz (F,);  step  Hz
    cells             per shortest wavelength;  lattice, cost  the grid, and what a run on it takes
    max_bytes         allowed for a run
    along             angle along the path of directions in which the target sees the transmitter, rad (P,)
    strip             m, widest strip of a conductor, thinner than a cell, that may be a sheet on the grid
    exact             frequency, Hz, at which a complex eps_r is that of the grid; None: the waveform's centre
    """

    options: FullwaveOptions
    device: Device
    devices: tuple[Device, ...]
    polarizations: tuple[str, ...]
    vertical: np.ndarray
    scene: Scene
    waveform: Waveform
    band: tuple[float, float]
    track: Trajectory
    receiver: Trajectory | None
    motion: dict[str, object]
    reference_range: np.ndarray
    window: tuple[float, float]
    frequencies: np.ndarray
    step: float
    cells: float
    lattice: Lattice
    cost: runs.RunCost
    max_bytes: float
    along: np.ndarray
    strip: float
    exact: float | None = None

    def __getstate__(self) -> dict[str, Any]:
        """For another process: without what belongs to this one."""
        return {**self.__dict__, "options": self.options.portable(), "device": None, "devices": ()}

    def on(self, device: Device) -> FullwaveTask:
        """The same task on another device, with the bodies as they are cut."""
        other = replace(self, device=device)
        other.__dict__.update({name: self.__dict__[name] for name in ("target", "twins") if name in self.__dict__})
        return other

    @property
    def tx(self) -> np.ndarray:
        """Positions of the transmitter, m (P, 3)."""
        return self.track.positions

    @property
    def rx(self) -> np.ndarray:
        """Positions of the receiver, m (P, 3)."""
        return self.tx if self.receiver is None else self.receiver.positions

    @property
    def centre(self) -> np.ndarray:
        """Centre of the scene's box, m (3,)."""
        return self.scene.center

    @property
    def carried_cells(self) -> float:
        """Cells per shortest wavelength on the grid: those asked for, or little more."""
        return SPEED_OF_LIGHT / self.band[1] / self.lattice.cell

    @property
    def n_cells(self) -> int:
        """Cells of the grid."""
        return int(np.prod(self.lattice.shape))

    @property
    def grid_choices(self) -> dict[str, object]:
        """Entries of a plan, in reports and forecasts, about the grid."""
        return {
            "cells": float(f"{self.carried_cells:.4g}"),
            "cell_m": float(f"{self.lattice.cell:.4g}"),
            "grid": " x ".join(map(str, self.lattice.shape)),
        }

    @property
    def losses(self) -> dict[str, object]:
        """Entry of a plan about complex permittivities, which become conductivities; empty where there are none."""
        return losses_said(self.scene, self.waveform.center)

    @property
    def wavenumbers(self) -> np.ndarray:
        """rad/m (F,)."""
        return 2 * np.pi * self.frequencies / SPEED_OF_LIGHT

    @cached_property
    def target(self) -> Target:
        """The bodies, cut by the grid when it is first used. TooThin, a ValueError: parts that cells do not resolve."""
        middle = self.waveform.center
        try:
            parts = parts_of(self.scene, middle, self.exact)
            return runs.target_of(self.lattice, parts, 2 * np.pi * middle / SPEED_OF_LIGHT, self.strip)
        except TooThin as thin:
            if thin.cell is None:
                raise
            needed = np.ceil(10 * SPEED_OF_LIGHT / self.band[1] / thin.cell) / 10
            raise TooThin(f"{thin}: cells={needed:g}, which are {self.cells:g} now", thin.cell) from None

    @property
    def strips(self) -> dict[str, object]:
        """Entry of a plan about parts of conductors that are thinner than a cell; empty where there are none."""
        area = self.target.strip_area
        return {"strips": f"{area:.2g} m^2 thinner than a cell, as sheets"} if area else {}

    def warn_of_gaps(self) -> None:
        """SarclWarning where gaps between conductors are narrower than a cell: closed, or with one layer of nodes."""
        if (gap := self.target.gap) is not None:
            needed = np.ceil(10 * SPEED_OF_LIGHT / self.band[1] / (runs.RESOLVED * gap)) / 10
            warn(
                f"bodies have gaps of about {gap:.2g} m, narrower than cells of {self.lattice.cell:.3g} m: the grid "
                "closes them, or has one layer of nodes in them, and what waves do in them is missing or wrong, also "
                f"in report.model_error; give cells={needed:g}, which are {self.cells:g} now, or close the gaps in "
                "the mesh"
            )

    @property
    def sendings(self) -> list[tuple[str, list[int]]]:
        """The polarisations that are sent, and the indices of the polarisations whose echoes they give."""
        indices = {sent: [i for i, name in enumerate(self.polarizations) if name[1] == sent] for sent in "HV"}
        return [(sent, own) for sent, own in indices.items() if own]

    def senses(self, antennas: np.ndarray) -> dict[str, np.ndarray]:
        """Unit vectors of H and V, (P, 3) each, of antennas (P, 3) that look at the target."""
        h, v = polarisation(self.centre - antennas, tuple(self.vertical.tolist()))
        return {"H": h, "V": v}

    @property
    def run_bytes(self) -> float:
        """Memory of one run on the device."""
        return float(self.cost.bytes(self.parts[0].stop))

    @property
    def parts(self) -> list[slice]:
        """Frequencies whose phasors fit into memory together: a run for each part."""
        n, most = len(self.frequencies), self.cost.frequencies(self.max_bytes)
        each = -(-n // -(-n // most))
        return [slice(first, min(first + each, n)) for first in range(0, n, each)]

    @cached_property
    def twins(self) -> dict[str, dict[int, Twin]]:
        """For each polarisation that is sent, and for pulses, the pulse that the run of their anchor serves too, by
        mirror symmetry."""
        radius = float(np.linalg.norm(self.scene.bounds[1] - self.scene.bounds[0])) / 2
        senses, k = self.senses(self.tx), float(self.wavenumbers[-1])
        return {
            sent: runs.mirror_twins(self.lattice, self.target, self.tx, senses[sent], k, radius)
            for sent, _ in self.sendings
        }

    def formed(
        self,
        pulse: int,
        sent: str,
        received: list[str],
        pulses: np.ndarray,
        progress: Callable[[float], None],
        twin: Twin | None = None,
    ) -> tuple[list[np.ndarray], runs.RunEnd]:
        """Echoes (n, Q, F) at some pulses (n,), formed from the currents of an anchor at one pulse, phase zero at the
        centre, and from those of its twin, where one is given; and how the runs ended.

        progress  called with the share of the work that is done
        """
        tx, rx = self.tx[pulses], self.rx[pulses]
        senses = self.senses(rx)
        shape = len(pulses), len(received), len(self.frequencies)
        formed = [np.empty(shape, np.complex64) for _ in range(1 + (twin is not None))]
        path = half_path(tx, rx, self.lattice.centre) - half_path(tx, rx, self.centre)
        steps, left, parts, shown = 0, 0.0, self.parts, 0.0
        for number, part in enumerate(parts):

            def share_done(done: int, expected: int, before: int = number) -> None:
                nonlocal shown
                shown = max(shown, (before + min(done / max(expected, 1), MOST_SHOWN)) / len(parts))
                progress(shown)

            part_echoes, ended = runs.run(
                self.device, self.lattice, self.target, self.band, self.wavenumbers[part],
                anchor=runs.Anchor(self.tx[pulse], self.senses(self.tx[pulse])[sent], twin),
                antennas=runs.Antennas(tx, rx, np.stack([senses[name] for name in received])),
                options=runs.RunOptions(
                    tolerance=LEFT * self.options.tolerance, most_steps=int(runs.MOST_STEPS * self.cost.steps),
                    max_bytes=self.max_bytes, progress=share_done,
                ),
            )  # fmt: skip
            turn = np.exp(-2j * np.outer(path, self.wavenumbers[part]))[:, None]
            for whole_band, echoes in zip(formed, part_echoes, strict=True):
                whole_band[..., part] = echoes * turn
            steps, left = steps + ended.steps, max(left, ended.left)
        return formed, runs.RunEnd(steps, left)

    @property
    def spectrum(self) -> np.ndarray:
        """The waveform's spectrum, after its matched filter where samples are compressed (F,)."""
        pulse = self.waveform.pulse_spectrum(self.frequencies)
        return np.asarray(np.abs(pulse) ** 2 if self.options.compressed else pulse)

    def factors(self, pulses: slice) -> np.ndarray:
        """Factors of formed echoes: the spectrum, and the phase from the centre to the reference range, (n, F)."""
        path = half_path(self.tx[pulses], self.rx[pulses], self.centre) - self.reference_range[pulses]
        return np.asarray(self.spectrum * np.exp(-2j * np.outer(path, self.wavenumbers)))

    def coarser(self, ratio: float, finer: float) -> FullwaveTask:
        """The same task with cells larger by a factor, divided by up to `finer`. Strips thinner than a cell are wider
        in proportion, as at the edge of a wedge, and their width is known to RIM cells.
        """
        lattice, cost = grid_choice(self.scene, self.band, self.cells / ratio, self.max_bytes, finer)
        strip = self.strip * lattice.cell / self.lattice.cell + runs.RIM * lattice.cell
        return replace(self, cells=self.cells / ratio, lattice=lattice, cost=cost, strip=strip)

    @cached_property
    def with_upper_losses(self) -> FullwaveTask:
        """The same task with conductivities that have the losses of each complex eps_r at the upper end of the band."""
        return replace(self, exact=self.band[1])


def fullwave_task(scene: Scene, waveform: Waveform, track: Trajectory, options: FullwaveOptions) -> FullwaveTask:
    """The task of fullwave_echo, on a grid that is chosen. ValueError, MemoryError: what does not fit."""
    tolerance = options.tolerance
    devices = options.devices()
    check_bodies(scene)
    band = waveform.center - waveform.bandwidth / 2, waveform.center + waveform.bandwidth / 2
    cells = check_cells(chosen_cells(options.cells, scene, band[1], tolerance), band)
    check_wavelengths(scene, cells, band[1])
    if tolerance < LEAST_TOLERANCE:
        raise ToleranceUnreachable(tolerance, LEAST_TOLERANCE, "float32 fields", how="with fields in float32")
    point = scene.center if options.reference is None else np.asarray(options.reference)
    track, receiver, motion = echo_sampling.in_flight(track, options.receiver, scene, point)
    tx, rx = track.positions, receiver_positions(track, receiver)
    check_outside(scene, {"track": tx} if receiver is None else {"track": tx, "receiver": rx})
    reference_range = half_path(tx, rx, point)
    window = window_of(scene, waveform, tx, rx, reference_range, options.range_window)
    frequency, step, n_samples = echo_sampling.sampling(waveform, *window, options.compressed)
    most = options.max_bytes  # one number for all devices: the band is divided alike on each
    max_bytes = min(default_bytes(device) if most is None else budget(device, most) for device in devices)
    lattice, cost = grid_choice(scene, band, cells, max_bytes)
    return FullwaveTask(
        options=options,
        device=devices[0],
        devices=devices,
        polarizations=tuple(options.polarization),
        vertical=options.vertical_at(scene.center),
        scene=scene,
        waveform=waveform,
        band=band,
        track=track,
        receiver=receiver,
        motion=motion,
        reference_range=reference_range,
        window=window,
        frequencies=frequency + step * np.arange(n_samples),
        step=step,
        cells=cells,
        lattice=lattice,
        cost=cost,
        max_bytes=max_bytes,
        along=angle_along(unit(tx - scene.center)),
        strip=STRIP * SPEED_OF_LIGHT / band[1],
    )
