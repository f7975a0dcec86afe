"""A far radar for the scenes of papers that give no geometry: an azimuth arc about flat ground, seen at one angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..imaging.backproject import backproject
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..scene.scene import Scene
from ..simulation.echo import echo

FAR = 1e6  # m: wavefronts are planes to 1e-3 of a wavelength over 10 m


@dataclass(frozen=True)
class FarRadar:
    """Far away at -x, `look` rad off the vertical, turning by `turn` rad about z: range runs along x, azimuth along y.

    bandwidth, center  Hz
    """

    look: float
    bandwidth: float
    turn: float
    n_pulses: int
    center: float = 9.6e9

    @property
    def null(self) -> tuple[float, float]:
        """Distance from the peak of a point to its first null on the ground, m: (along y, along x)."""
        side = 2 * float(np.sin(self.look))
        return SPEED_OF_LIGHT / self.center / (self.turn * side), SPEED_OF_LIGHT / (self.bandwidth * side)

    @property
    def up(self) -> np.ndarray:
        """Unit vector from the scene to the radar (3,)."""
        return np.array([-np.sin(self.look), 0, np.cos(self.look)])

    def echo(self, scene: Scene, **options: object) -> PhaseHistory:
        """Echoes of a scene about the origin, to 1e-2 unless the options, `sarcl.echo`'s, say otherwise."""
        n = self.n_pulses
        azimuth = np.pi + self.turn * ((np.arange(n) + 0.5) / n - 0.5)
        around = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1) * np.sin(self.look)
        positions = FAR * np.column_stack([around, np.full(n, np.cos(self.look))])
        wave = Waveform.chirp(center=self.center, bandwidth=self.bandwidth, duration=1e-6)
        options = {"tolerance": 1e-2, "check": False, **options}
        return echo(scene, wave, Trajectory(np.arange(n) / 100.0, positions), **options)

    def grid(self, shape: Sequence[int], pixels: float | tuple[float, float] = 1, **options: Any) -> ImageGrid:
        """A grid about the origin with so many pixels per null: along y and x, or the same for both."""
        return ImageGrid.plane(shape=(shape[0], shape[1]), spacing=np.array(self.null) / pixels, **options)

    def focus(self, raw: PhaseHistory, grid: ImageGrid, **options: object) -> np.ndarray:
        """Pixels whose |.|^2 is the radar cross section of a point, m^2."""
        image = backproject(raw, grid, **{"tolerance": 1e-2, "check": False, **options})
        return image.normalized()


def ground(y: tuple[float, float], x: tuple[float, float], cells: Sequence[int] = (1, 1), **options: Any) -> Scene:
    """Flat ground from y[0] to y[1] and x[0] to x[1], m, of so many cells of two facets; options of `from_heights`."""
    axes = [np.linspace(*ends, n + 1) for ends, n in zip((y, x), cells, strict=True)]
    return Scene.from_heights(axes[1], axes[0], np.zeros([len(a) for a in axes]), **options)


@dataclass(frozen=True)
class Speckle:
    """Statistics of pixels: p values of Rayleigh amplitudes and uniform phases (Kolmogorov and Smirnov), the standard
    deviation of the intensity over its mean, 1 for fully developed speckle, and the largest difference between the
    distribution functions of the amplitudes and Rayleigh's."""

    rayleigh: float
    uniform: float
    contrast: float
    difference: float


def speckle(pixels: np.ndarray) -> Speckle:
    """Statistics of independent pixels, complex."""
    from scipy import stats

    power = np.abs(pixels.ravel()) ** 2
    amplitude = np.sqrt(power / power.mean())
    rayleigh = stats.kstest(amplitude, "rayleigh", args=(0, np.sqrt(0.5)))
    uniform = stats.kstest(np.angle(pixels.ravel()), "uniform", args=(-np.pi, 2 * np.pi)).pvalue
    contrast = float(power.std() / power.mean())
    return Speckle(float(rayleigh.pvalue), float(uniform), contrast, float(rayleigh.statistic))
