"""The demo: a spotlight pass over an airfield, from mesh to picture. `sarcl demo` runs it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.constants import SPEED_OF_LIGHT

if TYPE_CHECKING:
    from ..base.types import PathLike
    from ..model.image import Image
    from ..model.image_grid import ImageGrid
    from ..model.phase_history import PhaseHistory
    from ..model.trajectory import Trajectory
    from ..model.waveform import Waveform
    from ..numerics.windows import Window
    from ..opencl.device import DeviceChoice

CENTER = 9.6e9  # Hz
GRAZING_DEG = 35.0
DISTANCE = 10e3  # m
EXTENT = 50.0  # m of the picture's side
TOLERANCE = 1e-2
BOUNCES = 3  # reflections
WINDOW: Window = ("taylor", 35, 5)  # without a window side lobes would fill the shadows
FLOOR_DB, PERCENTILE = -40.0, 98.5  # black, dB below white; white, per cent of the pixels


@dataclass(frozen=True)
class Setting:
    """Resolution of the demo: bandwidth Hz, arc rad, number of pulses, pixels along a side."""

    bandwidth: float
    arc: float
    n_pulses: int
    n_pixels: int

    def waveform(self) -> Waveform:
        """The transmitted pulse."""
        from ..model.waveform import Waveform

        return Waveform.chirp(center=CENTER, bandwidth=self.bandwidth, duration=2e-6)

    def track(self) -> Trajectory:
        """An arc of a circle beyond the top of the picture, so that shadows fall towards its bottom."""
        from ..model.trajectory import Trajectory

        grazing = np.radians(GRAZING_DEG)
        return Trajectory.circle(
            radius=DISTANCE * np.cos(grazing),
            height=DISTANCE * np.sin(grazing),
            start=np.pi / 2 - self.arc / 2,
            arc=self.arc,
            n_pulses=self.n_pulses,
            prf=100.0,
        )

    def grid(self) -> ImageGrid:
        """Pixels on the ground about the origin."""
        from ..model.image_grid import ImageGrid

        return ImageGrid.plane(shape=(self.n_pixels, self.n_pixels), spacing=(EXTENT / self.n_pixels,) * 2)

    @property
    def edge(self) -> float:
        """Half a resolution cell, m, the longest edge of the ground's facets."""
        cross = SPEED_OF_LIGHT / CENTER / (2 * self.arc * np.cos(np.radians(GRAZING_DEG)))
        return min(SPEED_OF_LIGHT / (2 * self.bandwidth), cross) / 2


FULL = Setting(bandwidth=720e6, arc=0.096, n_pulses=400, n_pixels=640)
QUICK = Setting(bandwidth=330e6, arc=0.044, n_pulses=192, n_pixels=320)


def run(
    out: PathLike = "out",
    *,
    quick: bool = False,
    device: DeviceChoice | None = None,
    seed: int = 0,
    progress: Callable[[str, int, int], None] | None = None,
    say: Callable[[str], None] = print,
) -> Image:
    """Simulate and focus the demo scene; write demo.png and demo_raw.h5 into the folder `out`.

    say   called with each line of the report of the run
    Returns the image. OSError, before any work, when `out` cannot be made or written.
    """
    from ..figures.decibels import write_png
    from ..imaging.backproject import backproject
    from ..opencl.choose_device import open_device
    from ..simulation.echo import echo
    from . import demo_scene

    start = time.perf_counter()
    picture, raw_file = outputs(out)
    opened = open_device(device)
    setting = QUICK if quick else FULL
    clock = _Clock(say)
    scene = demo_scene.scene(setting.edge, seed)
    clock.stage("scene", f"an airfield of {len(scene.triangles):,} facets, made by code")
    raw = echo(
        scene,
        setting.waveform(),
        setting.track(),
        bounces=BOUNCES,
        seed=seed,
        tolerance=TOLERANCE,
        device=opened,
        progress=progress,
    )
    clock.stage("echo", f"{raw.n_rows} pulses of {raw.n_samples} samples{_rate(raw, 'facet x pulse')}")
    image = backproject(raw, setting.grid(), window=WINDOW, tolerance=TOLERANCE, device=opened, progress=progress)
    clock.stage("focus", f"{image.grid.shape[0]} x {image.grid.shape[1]} pixels{_rate(image, 'pulse x pixel')}")
    band = f"{CENTER / 1e9:g} GHz, {setting.bandwidth / 1e6:g} MHz"
    title = f"{band}; radar beyond the top edge, {GRAZING_DEG:g} deg up"
    shown = image.show(FLOOR_DB, percentile=PERCENTILE, title=title)
    write_png(shown, picture)
    raw.save(raw_file)
    clock.stage("write", f"{picture}, {raw_file.name}")
    say(f"grey    {shown.info['caption']}")
    say(f"device  {opened.info.name}, {opened.info.platform}")
    say(f"picture {picture.resolve()}  ({time.perf_counter() - start:.1f} s in all)")
    say(f"echoes  {raw_file.resolve()}; sarcl focus {raw_file} focuses them again")
    return image


def outputs(out: PathLike) -> tuple[Path, Path]:
    """The files to write in the folder `out`, which is made where it is missing."""
    from ..io.output_paths import check_writable

    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(f"--out {str(folder)!r} is a file; give a folder")
    folder.mkdir(parents=True, exist_ok=True)
    names = folder / "demo.png", folder / "demo_raw.h5"
    for name in names:
        check_writable(name)
    return names


def _rate(result: PhaseHistory | Image, unit: str) -> str:
    """Rate and error of a report as text."""
    report = result.report
    if report is None:
        return ""
    from ..base.text import rate_text

    error = report.predicted_error if report.measured_error is None else report.measured_error
    kind = "predicted" if report.measured_error is None else "measured"
    seconds = sum(report.seconds.values())
    rate = rate_text(report.contributions_done / seconds) if seconds else ""
    return f", {unit} {rate}, error {error:.1e} {kind} ({report.tolerance:.0e} allowed)"


class _Clock:
    """Reports how long each step took."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.say = say
        self.last = time.perf_counter()

    def stage(self, step: str, what: str) -> None:
        now = time.perf_counter()
        self.say(f"{step:7} {now - self.last:6.1f} s  {what}")
        self.last = now
