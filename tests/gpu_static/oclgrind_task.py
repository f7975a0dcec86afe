"""One tiny task, for a process that runs under Oclgrind: python tests/gpu_static/oclgrind_task.py NAME

Prints the error of the result and the largest allowed, both relative; exit status 1 where the error is larger.

Oclgrind does not count what clEnqueueFillBuffer writes as written, and its own sincos reads what it says nobody wrote.
So zeros are copied here, and FFTs, whose kernels are reikna's, are made on the host. `restrict` is taken out of
kernels: functions that are inlined always leave marks of it that Oclgrind does not know. Buffers are kept to the end:
where one is dropped and another made, Oclgrind mixes up what was written (reports in beam.cl:add ended when nothing was
dropped, and began again with each dropped buffer, also where the kernel before it stored a constant everywhere).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import scipy.fft
from helpers.cases import image_error, noise_history, noise_on, straight
from helpers.current_cases import antennas, difference, random_currents
from helpers.current_cases import twin as current_twin
from helpers.fdtd_cases import Twin, random_target

import sarcl
from sarcl.fullwave.current_sums import current_sums
from sarcl.fullwave.fields import BLOCK, Fields
from sarcl.fullwave.formed_echoes import paths_of
from sarcl.fullwave.incident import PlaneWave, wave_table
from sarcl.fullwave.lattice import Lattice
from sarcl.fullwave.pulse import Pulse
from sarcl.numerics import cost_model
from sarcl.opencl import choose_device, fft, programs
from sarcl.opencl import device as device_module
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device
from sarcl.reference import fdtd
from sarcl.reference.equations import field

PLANE = sarcl.ImageGrid.plane(center=(0, 0, 0), spacing=0.2, shape=(17, 19))
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
CIRCLE = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.01, n_pulses=3)
Errors = tuple[float, float]


def _zeros(self: Device, nbytes: int) -> Any:
    buffer = self.empty(nbytes)
    self.write(buffer, np.zeros(nbytes, np.uint8))
    return buffer


def _keeping(make: Callable[[Device, Any], Any]) -> Callable[[Device, Any], Any]:
    """A method that makes a buffer and never drops it."""
    kept = []

    def made(self: Device, given: Any) -> Any:
        kept.append(make(self, given))
        return kept[-1]

    return made


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


def echo(scene: Any, tolerance: float, track: sarcl.Trajectory = CIRCLE, **options: Any) -> Errors:
    """Echoes; the error against the exact sum, measured by sarcl itself."""
    raw = sarcl.echo(scene, CHIRP, track, tolerance=tolerance, check=True, **options)
    return raw.report.measured_error, tolerance


def range_doppler() -> Errors:
    """A strip image of few rows; the error against the exact sum, measured by sarcl itself."""
    n = 96
    raw = noise_on(straight(n, aperture=20.0), n_samples=32, time=np.linspace(0, 0.9, n))
    made = sarcl.range_doppler(raw, tolerance=1e-2, check=True)
    return made.report.measured_error, 1e-2


def spectral() -> Errors:
    """Facets in the beam of a straight track, by Fourier transforms; the error measured by sarcl itself."""
    axis, look = np.linspace(-4, 4, 5), np.radians(50)
    heights = np.random.default_rng(0).normal(size=(5, 5)) * 0.02
    material = sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="cos2")
    scene = sarcl.Scene.from_heights(6e3 * np.tan(look) + axis, axis, heights, material=material, roughness=0.01)
    line = sarcl.Trajectory.line(start=(0, -60, 6e3), velocity=(0, 100, 0), prf=125, n_pulses=150)
    made = sarcl.spectral_echo(
        scene, CHIRP, sarcl.pointing.stripmap(line, look=look, side="right"), max_edge=None, shadows=False,
        antenna=sarcl.Antenna.gaussian(width=(0.012, 0.3)), tolerance=1e-2, check=True,
    )  # fmt: skip
    return made.report.measured_error, 1e-2


def beam(tolerance: float) -> Errors:
    """The field of an array of nine carriers; the error against extended precision."""
    random, array = np.random.default_rng(0), sarcl.AntennaArray.linear(9, spacing=0.015, frequency_step=2e6)
    x, t = random.uniform(-1, 1, (5, 3)) + np.array([0, 1e3, 0]), random.uniform(0, 1e-5, 3)
    made = sarcl.beam(array, 9.6e9, times=t, positions=x, tolerance=tolerance)
    wanted = field(array.positions, array.offsets_at(0), array.weights, 9.6e9, t, x)
    return float(np.abs(made - wanted).max() / np.abs(array.weights).sum()), tolerance


def fields() -> Errors:
    """Steps of a grid with absorbing layers, an incident wave and lists of a target; the twin computes in float64."""
    grid, random = Lattice(0.01, (10, 9, 32), np.zeros(3)), np.random.default_rng(3)
    top = 299792458.0 / (8 * grid.cell)
    wave = PlaneWave(np.array([0.36, -0.48, 0.8]), np.array([1.0, 2, 0]), Pulse.gaussian(0.1 * top, top))
    middle = grid.cell * np.array(grid.shape) / 2
    table = wave_table(grid, wave, np.full(3, 4), np.array(grid.shape) - 4, middle)
    target, start = random_target(grid, random, inside=4), random.uniform(-1, 1, (2, 3, *grid.shape))
    made, twin = Fields(open_device(), grid, target, absorber=3, wave=table), Twin(grid, target, *start, 3, table)
    made.start(*start)
    made.advance(BLOCK)
    steps = [twin.advance()[0] for _ in range(BLOCK)]
    omega, part, times = np.array([0.0, 0.3]), made.edges, np.arange(BLOCK)
    sums = made.device.zeros(8 * len(omega) * part.count)
    turns = np.exp(-1j * np.outer(times, omega))
    phase = made.device.copied(np.stack([turns.real, turns.imag], -1).astype(np.float32))
    norms = made.transform(part, phase, sums, BLOCK, len(omega))
    wanted = (np.abs(fdtd.transform(np.array(steps), times, omega)) ** 2).sum(axis=1)
    e, h = made.download()
    parts = (np.abs(e - twin.e).max(), np.abs(h - twin.h).max(), np.abs(norms[1] / wanted - 1).max())
    return float(max(parts)), 2e-5


def currents() -> Errors:
    """Sums of random currents for transmitters and receivers that differ."""
    given = random_currents(70, 9)
    tx, rx = antennas(given, 5, 0.2), antennas(given, 5, 0.5, seed=2)
    paths = paths_of(given, tx, rx)
    made = current_sums(open_device(), given, paths, max_bytes=None)
    return difference(made, current_twin(given, paths, tx, rx)), 5e-5


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
    "echo antenna": lambda: echo(
        points(), 1e-3, sarcl.pointing.spotlight(CIRCLE, (0, 0, 0)), antenna=sarcl.Antenna.gaussian(width=(0.3, 0.4))
    ),
    "range_doppler": range_doppler,
    "spectral_echo": spectral,
    "beam": lambda: beam(1e-5),
    "beam float64": lambda: beam(1e-8),
    "fields": fields,
    "currents": currents,
}  # fmt: skip

# Tasks that reach kernels or branches of them that differ without float64.
WITHOUT_FP64 = (
    "direct 1e-5", "direct bistatic", "shared lines 3e-5", "factorized", "echo points bistatic", "echo facets",
    "echo antenna", "beam", "spectral_echo", "range_doppler",
)  # fmt: skip
NO_FP64 = " without float64"
NAMES = [*TASKS, *(name + NO_FP64 for name in WITHOUT_FP64)]


def chosen(device: Device, name: str) -> Device:
    """The device as a task wants it: what Oclgrind's time for float64 is says nothing."""
    if name.endswith(NO_FP64):
        return device.without_fp64()
    return Device(replace(device.info, fast_fp64=True), device._raw)


def main() -> int:
    Device.zeros = _zeros  # type: ignore[method-assign]
    for make in ("upload", "empty"):
        setattr(Device, make, _keeping(getattr(Device, make)))
    fft.reikna_rows, fft.in_place = _reikna, _in_place
    whole = programs.source
    device_module.source = lambda file: whole(file).replace("restrict", "")  # type: ignore[assignment]
    device = open_device()
    assert "Oclgrind" in device.info.name, f"this is {device.info.name}, not Oclgrind"
    used = chosen(device, sys.argv[1])
    choose_device.open_listed = lambda index: used  # type: ignore[assignment]
    error, allowed = TASKS[sys.argv[1].removesuffix(NO_FP64)]()
    print(f"error {error:.1e}, allowed {allowed:.1e}")
    return int(not error <= allowed)


if __name__ == "__main__":
    sys.exit(main())
