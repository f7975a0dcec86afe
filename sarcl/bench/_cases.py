"""The data of the benchmark: three apertures, white noise or points, of any size."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.validation import choice, count
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..model.trajectory import Trajectory
from . import exact, spaceborne

FREQUENCY = 9.3e9  # Hz, of sample 0 of the first two scenes
N_POINTS = 400
DEFAULT_SCENES = ("spotlight", "straight")
SCENES = (*DEFAULT_SCENES, "spaceborne")
DATA = {"spotlight": "noise", "straight": "points", "spaceborne": "noise"}
BANDWIDTH = {"spotlight": 600e6, "straight": 300e6}  # Hz
SPACING = {"spotlight": 0.1, "straight": 0.25, "spaceborne": spaceborne.SPACING}  # m
WORDS = {
    "spotlight": "X band, 600 MHz, an arc of 4 deg at 10 km, 0.1 m pixels; n pulses",
    "straight": "X band, 300 MHz, a straight aperture of 300 m at 10 km, 0.25 m pixels; n pulses",
    "spaceborne": "X band, 600 MHz, a straight track at 770 km, 0.25 m pixels; 1.41 n pulses",
}


@dataclass(frozen=True, eq=False)
class BenchCase:
    """Echoes, grid, and the exact sum at some of the pixels.

    scene, data, n   one of SCENES; "noise" or "points"; samples = pixels a side, and pulses but for "spaceborne"
    raw, grid        echoes, and the grid they are focused on
    at               (rows, columns) of the pixels that are checked, int64 (2, m)
    wanted           exact sum there, complex128 (m,)
    norm             norm of the exact sum if contributions had random phases
    """

    scene: str
    data: str
    n: int
    raw: PhaseHistory
    grid: ImageGrid
    at: np.ndarray
    wanted: np.ndarray
    norm: float

    @property
    def pairs(self) -> int:
        """Pulses x pixels."""
        return self.raw.n_rows * self.grid.size


def make(scene: str, n: int, data: str | None = None, pixels: int = 1024) -> BenchCase:
    """BenchCase `scene` of n pulses of n samples on n x n pixels, checked at `pixels` of them; seeded.

    scene "spaceborne" has spaceborne.pulses(n) pulses, 11 566 where n is 8192
    data  "noise": white, in every sample, so that most of the energy lies outside the scene of "straight";
          "points": points of random amplitude over the scene, from the formula. None: DATA[scene]
    ValueError: another scene or data, n below 8, points for "spaceborne".
    """
    choice("scene", scene, SCENES)
    data = choice("data", DATA[scene] if data is None else data, ("noise", "points"))
    n = count("size", n, least=8)
    random = np.random.default_rng(0)
    if scene == "spaceborne":
        choice("data of spaceborne", data, ("noise",))
        raw = spaceborne.phase_history(_noise(random, spaceborne.pulses(n), n))
        return _checked(scene, data, raw, pixels)
    if scene == "spotlight":
        tx = Trajectory.circle(radius=8e3, height=6e3, arc=0.07, n_pulses=n).positions
    else:
        along = (np.arange(n) - (n - 1) / 2) * 300 / n
        tx = np.stack([np.full(n, -8e3), along, np.full(n, 6e3)], axis=1)
    step = BANDWIDTH[scene] / n
    reference = np.linalg.norm(tx, axis=1)
    if data == "noise":
        samples = _noise(random, n, n)
    else:
        positions = np.zeros((N_POINTS, 3))
        positions[:, :2] = (random.random((N_POINTS, 2)) - 0.5) * 0.98 * n * SPACING[scene]
        amplitudes = random.standard_normal((N_POINTS, 2)).view(np.complex128)[:, 0]
        samples = exact.echo(tx, reference, FREQUENCY, step, n, positions, amplitudes)
    raw = PhaseHistory(samples, frequency=FREQUENCY, frequency_step=step, tx=tx, reference_range=reference)
    return _checked(scene, data, raw, pixels)


def _noise(random: np.random.Generator, n_pulses: int, n_samples: int) -> np.ndarray:
    """White noise, complex64 (n_pulses, n_samples)."""
    samples = np.empty((n_pulses, n_samples), np.complex64)
    for row in samples:
        row[:] = random.standard_normal((n_samples, 2)).view(np.complex128)[:, 0]
    return samples


def _checked(scene: str, data: str, raw: PhaseHistory, pixels: int) -> BenchCase:
    """The case of these echoes, with the exact sum at `pixels` random pixels."""
    n = raw.n_samples
    grid = ImageGrid.plane(shape=(n, n), spacing=SPACING[scene])
    at = np.random.default_rng(1).integers(0, n, (2, count("pixels", pixels)))
    return BenchCase(scene, data, n, raw, grid, at, *exact.backproject(raw, grid.at(*at)))


def save(case: BenchCase, folder: Path) -> None:
    """Write the files from which any process makes the image: samples.npy, tx.npy, reference_range.npy, case.json."""
    np.save(folder / "samples.npy", case.raw.samples)
    np.save(folder / "tx.npy", case.raw.tx)
    np.save(folder / "reference_range.npy", case.raw.reference_range)
    numbers = {
        "frequency": float(case.raw.frequency[0]),
        "frequency_step": float(case.raw.frequency_step[0]),
        "spacing": SPACING[case.scene],
        "n": case.n,
        "at": case.at.tolist(),
    }
    (folder / "case.json").write_text(json.dumps(numbers))


def load(folder: Path) -> tuple[PhaseHistory, ImageGrid]:
    """The data and grid that `save` wrote."""
    numbers: dict[str, Any] = json.loads((folder / "case.json").read_text())
    raw = PhaseHistory(
        np.load(folder / "samples.npy"),
        frequency=numbers["frequency"],
        frequency_step=numbers["frequency_step"],
        tx=np.load(folder / "tx.npy"),
        reference_range=np.load(folder / "reference_range.npy"),
    )
    return raw, ImageGrid.plane(shape=(numbers["n"], numbers["n"]), spacing=numbers["spacing"])
