"""Shared by the sections: the systems, their echoes (computed once), images and cuts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...arrays.map_aperture import MapKind, map_aperture
from ...experiments.fda.case import Case
from ...experiments.fda.experiment import response
from ...figures import html
from ...imaging.backproject import backproject
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ...model.waveform import Waveform
from ...opencl.device import DeviceChoice
from ...scene.scene import Scene
from ...simulation.echo import echo

CENTER = ((0.0, 0.0, 0.0),)
HALF, STEP = (2.64, 4.0), 0.04  # m: half the sides of a picture along range and cross-range; side of a pixel


class Lab:
    """Echoes of `sarcl.fda.Case` systems, made once and kept.

    device  an OpenCL device as elsewhere;  quick  leave out arrays of more than 100 elements
    """

    def __init__(self, device: DeviceChoice | None = None, quick: bool = False) -> None:
        self.device, self.quick = device, quick
        self._kept: dict[Any, PhaseHistory] = {}

    def small_enough(self, n: int) -> bool:
        """Whether an array of n elements is part of the run."""
        return not self.quick or n <= 100

    def collect(self, case: Case, points: ArrayLike = CENTER) -> PhaseHistory:
        """Echoes of unit points, m (n, 3), channels added up at the reference element."""
        places = np.asarray(points, np.float64)
        key = (replace(case, name=""), places.tobytes())
        if key not in self._kept:
            tone = Waveform.tone(center=case.center, duration=1 / case.channel_step)
            self._kept[key] = echo(
                Scene.points(places), tone, case.track(), array=case.array(), reference=(0, 0, 0),
                range_window=(-case.window, case.window), tolerance=1e-4, check=False, device=self.device,
            )  # fmt: skip
        return self._kept[key]

    def mapped(self, case: Case, mapping: MapKind | None, points: ArrayLike = CENTER, **options: Any) -> PhaseHistory:
        """The echoes of `collect`, mapped; mapping None: as collected."""
        raw = self.collect(case, points)
        return raw if mapping is None else map_aperture(raw, mapping, **options)

    def single(self, case: Case, waveform: Waveform, points: ArrayLike = CENTER) -> PhaseHistory:
        """Echoes of one antenna on the case's track."""
        return echo(
            Scene.points(points), waveform, case.track(), reference=(0, 0, 0), range_window=(-5.0, 5.0),
            tolerance=1e-4, check=False, device=self.device,
        )  # fmt: skip

    def image(self, raw: PhaseHistory, zoom: float = 1.0) -> np.ndarray:
        """dB (along range, cross-range) about the origin, over HALF/zoom m each way; a focused unit point has 0."""
        shape = tuple(2 * round(half / STEP) + 1 for half in HALF[::-1])
        grid = ImageGrid.plane(shape=shape, spacing=STEP / zoom)
        image = backproject(raw, grid, tolerance=1e-3, check=False, device=self.device)
        return np.maximum(image.decibels().T, -200.0)

    def picture(
        self, raw: PhaseHistory, caption: str, zoom: float = 1.0, box: float | None = None, unit: float = 1.0
    ) -> html.Block:
        """The image as a figure, white where it is brightest; box: half the side of a dashed square, m.

        unit  amplitude of a focused unit point, which has 0 dB
        """
        edges = (-HALF[1] / zoom, HALF[1] / zoom), (-HALF[0] / zoom, HALF[0] / zoom)
        square = None if box is None else (box, box)
        levels_db = self.image(raw, zoom) - 20 * np.log10(unit)
        return html.picture(
            levels_db, *edges, "cross-range, m", "range, m", caption, floor_db=-30.0, box=square, equal=True
        )

    def cut(
        self, raw: PhaseHistory, axis: int = 1, half: float = 2.0, n: int = 801, about: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Places along range (axis 0) or cross-range (1), m (n,), and amplitudes (n,), 1 of a focused unit point."""
        offsets = about + np.linspace(-half, half, n)
        places = np.zeros((n, 3))
        places[:, axis] = offsets
        image = backproject(raw, ImageGrid.points(places), tolerance=1e-3, check=False, device=self.device)
        return offsets, np.abs(image.normalized())

    def measure(self, raw: PhaseHistory, axis: int = 1, half: float = 2.0, about: float = 0.0) -> dict[str, float]:
        """Response of a point `about` m along the axis: what `sarcl.fda.response` measures on a cut."""
        return response(*self.cut(raw, axis, half, about=about), about)


def system(n: int, step: float, *, mirrored: bool = True, spacing: float | None = None, pulses: int = 431) -> Case:
    """Farooq's collection (tables 5.1 and 5.2): f0 10 GHz, 430 m of track 5 km away.

    spacing  m; None: half a wave of the centre frequency, as section 5.4 has it
    """
    return Case(
        f"N {n}, {step / 1e6:g} MHz", n=n, frequency_step=step, mirrored=mirrored, spacing=spacing, n_pulses=pulses
    )


def decibels(amplitude: np.ndarray, floor: float = -40.0) -> np.ndarray:
    """20 log10 of amplitudes, and `floor` dB for smaller ones."""
    return np.maximum(20 * np.log10(np.maximum(amplitude, 1e-9)), floor)
