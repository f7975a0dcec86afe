"""One tiny task, for a process that runs under Oclgrind: python tests/gpu_static/oclgrind_task.py NAME

Prints the error of the result and the largest allowed, both relative; exit status 1 where the error is larger.

Oclgrind does not count what clEnqueueFillBuffer writes as written, and its own sincos reads what it says nobody wrote.
So zeros are copied here, and FFTs, whose kernels are reikna's, are made on the host. `restrict` is taken out of
kernels: functions that are inlined always leave marks of it that Oclgrind does not know.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import scipy.fft
from helpers.cases import image_error, noise_history, noise_on, straight

import sarcl
from sarcl.numerics import cost_model
from sarcl.opencl import _programs, fft
from sarcl.opencl import device as device_module
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device

PLANE = sarcl.ImageGrid.plane(center=(0, 0, 0), spacing=0.2, shape=(17, 19))
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
CIRCLE = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.01, n_pulses=3)
Errors = tuple[float, float]


def _zeros(self: Device, nbytes: int) -> Any:
    buffer = self.empty(nbytes)
    self.write(buffer, np.zeros(nbytes, np.uint8))
    return buffer


def _reikna(device: Device, data: np.ndarray, inverse: bool) -> np.ndarray:
    return fft.rows(None, data, inverse=inverse)


def _in_place(device: Device, buffer: Any, shape: tuple[int, int], dtype: Any) -> None:
    device.write(buffer, scipy.fft.fft(device.download(buffer, np.empty(shape, dtype)), axis=1))


def image(tolerance: float, grid: Any = PLANE, *, bistatic: bool = False, arc: float = 0.07, **options: Any) -> Errors:
    """Direct backprojection of noise; the error against the exact sum."""
    raw = noise_history(n_rows=6, n_samples=24, bistatic=bistatic, arc=arc)
    made = sarcl.backproject(raw, grid, tolerance=tolerance, method="direct", check=False, **options)
    return image_error(made, raw, most=100, **{k: v for k, v in options.items() if k == "wrap"}), tolerance


def shared_lines(tolerance: float, **options: Any) -> Errors:
    """Direct backprojection by lines that a work-group shares, also of few pixels."""
    cost_model.SHARING_PAYS = 0
    raw = noise_on(straight(5, aperture=20.0, distance=770e3), bandwidth=600e6, n_samples=96)
    grid = sarcl.ImageGrid.plane(spacing=(0.3, 0.2), shape=(32, 40))
    made = sarcl.backproject(raw, grid, tolerance=tolerance, method="direct", check=False, **options)
    assert "lines" in str(made.report.plan), made.report.plan
    return image_error(made, raw, most=100), tolerance


def factorized(**options: Any) -> Errors:
    raw = noise_on(straight(60, aperture=10.0), n_samples=24)
    grid = sarcl.ImageGrid.plane(shape=(40, 40), spacing=0.25)
    made = sarcl.backproject(raw, grid, tolerance=1e-2, method="factorized", check=False, **options)
    return image_error(made, raw, most=100), 1e-2


def fronts() -> Errors:
    raw = noise_on(straight(20), n_samples=24)
    grid = sarcl.ImageGrid.plane(shape=(12, 14), spacing=(0.3, 0.25))
    made = sarcl.polar_format(raw, grid, tolerance=1e-2, check=True)
    return made.report.measured_error, 1e-2


def echo(scene: Any, tolerance: float, **options: Any) -> Errors:
    """Echoes; the error against the exact sum, measured by sarcl itself."""
    raw = sarcl.echo(scene, CHIRP, CIRCLE, tolerance=tolerance, check=True, **options)
    return raw.report.measured_error, tolerance


def points(n: int = 30) -> Any:
    return sarcl.Scene.points(np.random.default_rng(0).uniform(-5, 5, (n, 3)), np.ones(n))


def hills() -> Any:
    axis = np.linspace(-1, 1, 3)
    return sarcl.Scene.from_heights(axis, axis, np.random.default_rng(0).standard_normal((3, 3)) * 0.3)


TASKS: dict[str, Callable[[], Errors]] = {
    "direct 1e-1": lambda: image(1e-1),
    "direct 1e-3": lambda: image(1e-3),
    "direct 1e-5": lambda: image(1e-5),
    "direct bistatic": lambda: image(1e-4, bistatic=True),
    "direct window": lambda: image(1e-3, sarcl.ImageGrid.plane(spacing=(1.3, 2.9), shape=(20, 22))),
    "direct wrap": lambda: image(1e-3, sarcl.ImageGrid.plane(spacing=(1.3, 2.9), shape=(20, 22)), wrap=True),
    "direct points": lambda: image(
        1e-3, sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-2, 2, (70, 3)))
    ),
    "direct float64": lambda: image(1e-8, sarcl.ImageGrid.plane(spacing=0.9, shape=(6, 7))),
    "direct float64 bistatic": lambda: image(1e-9, sarcl.ImageGrid.plane(spacing=0.9, shape=(6, 7)), bistatic=True),
    "shared lines 1e-2": lambda: shared_lines(1e-2),
    "shared lines 3e-5": lambda: shared_lines(3e-5),
    "factorized": factorized,
    "polar_format": fronts,
    "echo points": lambda: echo(points(), 1e-3),
    "echo points bistatic": lambda: echo(
        points(), 1e-5, receiver=sarcl.Trajectory.circle(radius=9e3, height=7e3, arc=0.01, start=0.2, n_pulses=3)
    ),
    "echo facets": lambda: echo(hills(), 1e-2, max_edge=1.0, shadows=True),
    "echo facets all": lambda: echo(hills(), 1e-2, max_edge=1.0, shadows=False, polarization="all"),
}  # fmt: skip


def main() -> int:
    Device.zeros = _zeros  # type: ignore[method-assign]
    fft._reikna, fft.in_place = _reikna, _in_place
    whole = _programs.source
    device_module.source = lambda file: whole(file).replace("restrict", "")  # type: ignore[assignment]
    device = open_device()
    assert "Oclgrind" in device.info.name, f"this is {device.info.name}, not Oclgrind"
    error, allowed = TASKS[sys.argv[1]]()
    print(f"error {error:.1e}, allowed {allowed:.1e}")
    return int(not error <= allowed)


if __name__ == "__main__":
    sys.exit(main())
