"""Shared by the sections: the radar, targets and their echoes, computed once, or kept in files of a full run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.forecast import Forecast
from ...base.report import Report
from ...base.version import __version__
from ...fullwave.echoes.fullwave_echo import fullwave_echo
from ...model.phase_history import PhaseHistory
from ...model.store import read
from ...model.trajectory import Trajectory
from ...opencl.device import DeviceChoice
from ...scene.scene import Scene
from ...simulation.echo import Polarization, echo
from . import _targets
from ._radar import CHIRP, DURATION, Radar

REDUCTION = {True: 6, False: 1}  # of targets, range and track, but not of the wavelength
CELLS = {True: 10, False: 12}  # per wavelength at 1.75 GHz, at least
TOLERANCE = 3e-2
FULL_BYTES = 8e9  # memory for a run of the full size: what this device happens to have would change the forecast
CREEPING = 1.25  # of the radius of the target: waves that creep round it arrive later
PULSE = SPEED_OF_LIGHT * DURATION / 2  # m, of slant range
BOTH: tuple[Polarization, ...] = ("HH", "VH")


@dataclass(frozen=True, eq=False)
class Levels:
    """Of a target in HH and VH: peak of the image, and root mean square of its echoes, both m; then of HH by physical
    optics; and the difference of the echoes of physical optics from those of full wave, over these."""

    peak: tuple[float, float]
    rms: tuple[float, float]
    optics: float
    apart: float


class Lab:
    """Radar, targets and echoes of a quick or a full run, on one device.

    folder    where the echoes of a full run are kept, so that a run that was stopped goes on; None: nowhere
    progress  called as progress(stage, done, total) by the runs of the grid
    """

    def __init__(
        self,
        device: DeviceChoice | None = None,
        quick: bool = False,
        folder: Path | None = None,
        progress: Callable[[str, int, int], None] | None = None,
    ) -> None:
        self.device, self.quick, self.progress = device, quick, progress
        self.folder = None if quick else folder
        self.radar = Radar(REDUCTION[quick])
        self.levels: dict[str, Levels] = {}
        self.scene = cache(self._scene)
        self.full_wave = cache(self._full_wave)
        self.optics = cache(self._optics)

    def _scene(self, name: str) -> Scene:
        return _targets.find(name).scene(self.radar.reduction)

    def window(self, scene: Scene) -> dict[str, Any]:
        """Range window and reference of all echoes of a target: it holds creeping waves and a pulse."""
        half = CREEPING * radius(scene) + 0.75 * PULSE
        return {"range_window": (-half, half), "reference": (0.0, 0.0, 0.0)}

    def _full_wave(self, name: str) -> PhaseHistory:
        """HH and VH of a target along the track by full wave, from a file where a full run has finished it."""
        return self.run(name, self.radar.track, BOTH, "track")

    def run(
        self,
        name: str,
        track: Trajectory,
        polarization: Polarization | Sequence[Polarization],
        kept: str,
        **options: object,
    ) -> PhaseHistory:
        """Echoes by full wave; kept: what the file of a full run is called beside the name of the target."""
        scene, out = self.scene(name), None
        if self.folder is not None:
            self.folder.mkdir(exist_ok=True)
            out = self.folder / f"{name.replace(' ', '-')}-{kept}-{CELLS[self.quick]}-cells-{__version__}.h5"
            if out.exists():
                finished = read(out)
                assert isinstance(finished, PhaseHistory)
                return finished
        return fullwave_echo(
            scene, CHIRP, track, polarization=polarization, cells=CELLS[self.quick], tolerance=TOLERANCE, out=out,
            device=self.device, progress=self.progress, **self.window(scene), **options,
        )  # fmt: skip

    def forecast(self, name: str) -> Forecast[PhaseHistory]:
        """Memory, seconds and runs of the echoes of a target in full size, with FULL_BYTES for a run."""
        scene = _targets.find(name).scene()
        return fullwave_echo.planned(
            scene, CHIRP, Radar().track, polarization=BOTH, cells=CELLS[False], tolerance=TOLERANCE,
            max_bytes=FULL_BYTES, device=self.device, **self.window(scene),
        ).forecast()  # fmt: skip

    def _optics(self, name: str) -> PhaseHistory:
        """HH of a target by physical optics, with shadows; VH is zero."""
        scene = self.scene(name)
        return echo(
            scene, CHIRP, self.radar.track, tolerance=1e-2, check=False, device=self.device, **self.window(scene)
        )


def report_of(raw: PhaseHistory) -> tuple[Report, dict[str, Any]]:
    """The report of full-wave echoes, and its plan."""
    assert raw.report is not None
    return raw.report, dict(raw.report.plan)


def radius(scene: Scene) -> float:
    """Half the diagonal of a scene's box, m."""
    return float(np.linalg.norm(np.diff(scene.bounds, axis=0)) / 2)
