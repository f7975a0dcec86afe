"""A task of every verb, of any size, and the error of its result against an exact one."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import verbs
from ..arrays.beam import beam
from ..base.constants import SPEED_OF_LIGHT
from ..experiments.fda.case import Case
from ..model import pointing
from ..model.antenna import Antenna
from ..model.antenna_array import AntennaArray
from ..model.image import Image
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..opencl.device import Device
from ..reference import equations
from ..reference.edges import border_echo, edge_echo
from ..reference.polar_format import polar_format
from ..scattering.physical_optics import triangle_integral
from ..scene import shapes
from ..scene.material import Material
from ..scene.scene import Scene
from ..scene.triangles import normals
from . import exact
from .exact import Errors

CENTER = 9.6e9  # Hz, of all cases but those of arrays and the full wave
CELL = 0.5  # m: range resolution of the chirp, and the spacing of scatterers and pixels in proportion
CHIRP = Waveform.chirp(center=CENTER, bandwidth=SPEED_OF_LIGHT / (2 * CELL), duration=1e-6)
CHECKED = 24  # samples or pixels compared with the exact result, where its cost grows with the task


@dataclass(frozen=True, eq=False)
class VerbCase:
    """One task of a verb.

    scene, n  name of the task, and its size
    pairs     contributions of the task, as VerbTask.unit counts them
    call      computes the result: call(tolerance=, device=, check=) and, where the verb has methods, method=
    compare   Errors of a result of call(check=True)
    """

    scene: str
    n: int
    pairs: float
    call: Callable[..., Any]
    compare: Callable[[Any], Errors]


@dataclass(frozen=True)
class VerbTask:
    """What is measured of a verb: its cases, methods and tolerances, and what its sizes and contributions are."""

    make: Callable[[str, int], VerbCase]
    words: str
    unit: str
    sizes: tuple[int, ...]
    quick_sizes: tuple[int, ...]
    methods: tuple[str, ...] = ("",)
    tolerances: tuple[float, ...] = (1e-1, 1e-2, 1e-3, 1e-4)


def measured(result: PhaseHistory) -> Errors:
    """Errors that the verb's own check measured, against the float64 reference."""
    assert result.report is not None and result.report.measured_error is not None  # check=True gives both
    return result.report.measured_error, result.report.measured_error


def straight(n: int, length: float) -> Trajectory:
    """n pulses over `length`, m, 9.9 km from the origin, 45 deg up."""
    return Trajectory.line(start=(-7e3, -length / 2, 7e3), velocity=(0, length, 0), prf=n, n_pulses=n)


def scatterers(count: int, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions, m (count, 3), in a square of `side`, m, and complex amplitudes (count,), seeded."""
    random = np.random.default_rng(0)
    positions = random.uniform(-0.5, 0.5, (count, 3)) * [side, side, 1.0]
    return positions, random.standard_normal((count, 2)).view(np.complex128)[:, 0]


def sample_errors(raw: PhaseHistory, positions: np.ndarray, amplitudes: np.ndarray) -> Errors:
    """Errors of echoes of points at random rows and samples, against the sum over the points."""
    random = np.random.default_rng(1)
    rows, columns = random.integers(0, raw.n_rows, CHECKED), random.integers(0, raw.n_samples, CHECKED)
    values, wanted = np.empty(CHECKED, np.complex128), np.empty(CHECKED, np.complex128)
    for i, (p, n) in enumerate(zip(rows, columns, strict=True)):
        f = raw.frequency[p] + n * raw.frequency_step[p]
        wanted[i] = equations.point_echo(
            positions, amplitudes, np.array([f]), raw.tx[p], raw.rx[p], float(raw.reference_range[p])
        )[0]
        values[i] = raw.read(p, p + 1)[0, n]
    return exact.relative(values, wanted, float(np.sqrt(CHECKED) * np.linalg.norm(amplitudes)))


def points(name: str, n: int) -> VerbCase:
    """n^2 points in a square of n cells, n pulses over 300 m."""
    positions, amplitudes = scatterers(n * n, n * CELL)
    call = functools.partial(verbs.echo, Scene.points(positions, amplitudes), CHIRP, straight(n, 300.0))
    return VerbCase(name, n, n**3, call, lambda raw: sample_errors(raw, positions, amplitudes))


def facets(name: str, n: int) -> VerbCase:
    """Rough hills of 2 n^2 facets with a metal box on them, shadows, 64 pulses over 100 m."""
    axis = 2 * CELL * (np.arange(n + 1) - n / 2)
    hills = 2 * np.sin(axis / 13)[:, None] * np.cos(axis / 17)
    rough = Material(eps_r=4.0, conductivity=1e-3, height=np.inf, diagram="cos")
    box = shapes.box((6.0, 4.0, 3.0), position=(0, 0, 3.0), material="metal")
    scene = Scene.from_heights(axis, axis, hills, material=rough) + box
    call = functools.partial(verbs.echo, scene, CHIRP, straight(64, 100.0))
    return VerbCase(name, n, 64 * len(scene.triangles), call, measured)


def town(name: str, n: int, **options: object) -> VerbCase:
    """n metal boxes on metal ground, 3 m apart, shadows, 64 pulses over 100 m."""
    random, side = np.random.default_rng(0), int(np.ceil(np.sqrt(n)))
    scene = shapes.plate((3.0 * side, 3.0 * side))
    for i, (size, turn) in enumerate(zip(random.uniform(0.5, 2, (n, 3)), random.uniform(0, 2, n), strict=True)):
        place = 3 * (i % side) - 1.5 * side + 1.5, 3 * (i // side) - 1.5 * side + 1.5, 0.01
        scene = scene + shapes.box(tuple(size), position=place, rotation=(0, 0, turn))
    call = functools.partial(verbs.echo, scene, CHIRP, straight(64, 100.0), **options)
    return VerbCase(name, n, 64 * len(scene.triangles), call, measured)


def cross_section(name: str, n: int) -> VerbCase:
    """A box of facets with legs of 1/n m, with its edges, from 360 directions; against sums over all in float64."""
    box = shapes.box((1.0, 0.7, 0.5), rotation=(0.2, 0.1, 0.4)).split(1 / n)
    azimuth, elevation, k = np.radians(np.arange(360.0)), 0.5, 2 * np.pi * CENTER / SPEED_OF_LIGHT
    checked = np.random.default_rng(0).integers(0, 360, CHECKED)

    def call(*, check: bool, **options: Any) -> np.ndarray:
        return verbs.rcs(box, azimuth, elevation, CENTER, edges=True, **options)

    @functools.cache
    def wanted() -> np.ndarray:
        from ..scene.facing_borders import facing_borders  # imports scipy
        from ..scene.wedges import wedges

        exact_sums = np.zeros(CHECKED, complex)
        edges = wedges(box.triangles, box.two_sided, 0.35)
        facing = list(facing_borders(box.triangles, edges))
        for i, a in enumerate(azimuth[checked]):
            look = np.array([np.cos(elevation) * np.cos(a), np.cos(elevation) * np.sin(a), np.sin(elevation)])
            facets = box.triangles[normals(box.triangles) @ look > 0]
            cosine = normals(facets) @ look
            parts = k / np.sqrt(np.pi) * cosine * triangle_integral(facets, 2 * k * look)
            parts = parts * np.exp(2j * k * facets.mean(axis=1) @ look)
            far, f = 1e7 * look, np.array([CENTER])
            for ends, *frame in zip(edges.ends, edges.inward, edges.normal, edges.number, strict=True):
                parts = np.append(parts, edge_echo(ends, tuple(frame), f, (far, far), 1e7)[0, 0, 0])
            for borders, shape in facing:
                parts = np.append(parts, border_echo(borders, shape, f, (far, far), 1e7)[0, 0, 0])
            exact_sums[i] = parts.sum()
        return exact_sums

    def compare(s: np.ndarray) -> Errors:
        return exact.relative(s[checked], wanted(), 0.0)

    return VerbCase(name, n, 360 * len(box.triangles), call, compare)


def spectral_echo(name: str, n: int) -> VerbCase:
    """n points beside a straight track of n pulses, 0.4 m apart, seen by a Gaussian beam."""
    height, spacing, look = 6e3, 0.4, np.radians(50)
    line = Trajectory.line(start=(0, -n * spacing / 2, height), velocity=(0, 100, 0), prf=100 / spacing, n_pulses=n)
    track = pointing.stripmap(line, look=look, side="right")
    positions, amplitudes = scatterers(n, 0.8 * n * spacing)
    scene = Scene.points(positions + np.array([height * np.tan(look), 0, 0]), amplitudes)
    antenna = Antenna.gaussian(width=(0.012, 0.5))
    call = functools.partial(verbs.spectral_echo, scene, CHIRP, track, antenna=antenna)
    return VerbCase(name, n, n * n, call, measured)


def channels(name: str, n: int) -> VerbCase:
    """1000 points in front of n elements, each with its own carrier, 900 MHz in all, 101 pulses."""
    band = 900e6
    case = Case("channels", n=n, frequency_step=band / n, n_pulses=101, mirrored=False)
    positions, amplitudes = scatterers(1000, 5.0)
    tone = Waveform.tone(center=case.center, duration=n / band)
    scene = Scene.points(positions, amplitudes)
    call = functools.partial(
        verbs.echo, scene, tone, case.track(), array=case.array(), reference=(0, 0, 0), range_window=(-5, 5)
    )
    return VerbCase(name, n, 1000 * n * 101, call, measured)


def array_beam(name: str, n: int) -> VerbCase:
    """The field of n elements at n times and n x 64 positions."""
    array = AntennaArray.linear(n, spacing=0.015, axis=(0, 1, 0), frequency_step=30e3)
    random = np.random.default_rng(0)
    times = 1e-5 + np.linspace(0, 1e-6, n)
    angle, distance = np.linspace(-1, 1, 64), 3e3 + random.uniform(-50, 50, n)
    positions = np.stack([np.outer(distance, f(angle)) for f in (np.cos, np.sin, np.zeros_like)], axis=2)
    at = random.integers(0, (n, n, 64), (CHECKED, 3)).T

    def call(*, check: bool, tolerance: float, device: Device | None) -> np.ndarray:
        return beam(array, 10e9, times=times, positions=positions, tolerance=tolerance, device=device)

    def compare(field: np.ndarray) -> Errors:
        wanted = np.array(
            [
                equations.field(array.positions, array.offsets_at(0), np.ones(n), 10e9, times[t], positions[i, j])
                for t, i, j in at.T
            ]
        )
        wrong = np.abs(field[tuple(at)] - wanted).max()
        return float(wrong / n), float(wrong / np.abs(wanted).max())

    return VerbCase(name, n, 64 * n**3, call, compare)


def noise(n: int, samples: int, track: Trajectory) -> PhaseHistory:
    """White echoes of n pulses of a chirp, its band sampled at twice its resolution's spacing."""
    random = np.random.default_rng(0)
    white = random.standard_normal((n, samples, 2)).astype(np.float32).view(np.complex64)[..., 0]
    band = SPEED_OF_LIGHT / (2 * CELL)
    tx = track.positions
    return PhaseHistory(
        white,
        frequency=CENTER - band / 2,
        frequency_step=band / samples,
        tx=tx,
        reference_range=np.linalg.norm(tx, axis=1),
        time=track.times,
    )


def plane_image(name: str, n: int, *, verb: Callable[..., Image], sums: Callable[..., Any]) -> VerbCase:
    """White noise of n pulses over 300 m on a plane of n x n pixels; against exact sums, of echoes and positions."""
    raw, grid = noise(n, n, straight(n, 300.0)), ImageGrid.plane(shape=(n, n), spacing=CELL / 2)
    index, places = grid.sample(CHECKED, seed=1)

    def compare(image: Image) -> Errors:
        return exact.relative(image.data[index], *sums(raw, places))

    return VerbCase(name, n, n**3, functools.partial(verb, raw, grid), compare)


def range_doppler_image(name: str, n: int) -> VerbCase:
    """White noise of n pulses 0.24 m apart at their own zero-Doppler times; against the exact sum of backprojection."""
    track = Trajectory.line(start=(-7e3, -0.12 * n, 7e3), velocity=(0, 100, 0), prf=100 / 0.24, n_pulses=n)
    raw = noise(n, n // 2, track)

    def compare(image: Image) -> Errors:
        index, places = image.grid.sample(CHECKED, seed=1)
        return exact.relative(image.data[index], *exact.backproject(raw, places))

    return VerbCase(name, n, n**3 // 2, functools.partial(verbs.range_doppler, raw), compare)


def fullwave(name: str, n: int) -> VerbCase:
    """A conducting sphere of n cells across, 64 pulses of an arc; against a run between those that were computed."""
    wavelength, cells = 0.1, 12
    sphere = shapes.sphere(n * wavelength / (2 * cells), facets=500)
    chirp = Waveform.chirp(center=0.85 * SPEED_OF_LIGHT / wavelength, bandwidth=9e8, duration=1e-7)
    track = Trajectory.circle(radius=80.0, height=60.0, arc=0.2, n_pulses=64)
    call = functools.partial(verbs.fullwave_echo, sphere, chirp, track, cells=cells, model_error=False)
    return VerbCase(name, n, 64 * n**3, call, measured)


BOTH = ("direct", "factorized")
TASKS: Mapping[str, VerbTask] = {
    "echo of points": VerbTask(
        points, "n^2 points in n x n cells of 0.5 m, n pulses over 300 m at 9.9 km, X band, 300 MHz",
        "points x pulses", (128, 256, 512, 1024), (128, 256), BOTH,
    ),
    "echo of facets": VerbTask(
        facets, "hills of 2 n^2 rough facets with legs of 1 m and a metal box on them, shadows, 64 pulses",
        "facets x pulses", (32, 64, 128, 256), (32, 64), tolerances=(1e-1, 1e-2),
    ),
    "echo with edges": VerbTask(
        functools.partial(town, edges=True), "n metal boxes of 0.5 to 2 m on metal ground and their edges, 64 pulses",
        "facets x pulses", (16, 64, 256), (8, 16), tolerances=(1e-1, 1e-2),
    ),
    "echo with bounces": VerbTask(
        functools.partial(town, bounces=3), "n metal boxes of 0.5 to 2 m on metal ground, 3 reflections, 64 pulses",
        "facets x pulses", (8, 16), (8, 12), tolerances=(1e-1, 1e-2),
    ),
    "radar cross section": VerbTask(
        cross_section, "a box with its edges, facets with legs of 1/n m, from 360 directions", "facets x directions",
        (8, 12, 16), (8,), tolerances=(1e-2, 1e-4),
    ),
    "spectral echo": VerbTask(
        spectral_echo, "n points beside a straight track of n pulses 0.4 m apart, a Gaussian beam of 0.7 deg",
        "points x pulses", (1024, 2048, 4096), (512, 1024),
    ),
    "channels of an array": VerbTask(
        channels, "1000 points in front of n elements with a carrier each, 900 MHz in all, 101 pulses",
        "points x elements x pulses", (9, 45, 450), (9, 45),
    ),
    "beam of an array": VerbTask(
        array_beam, "the field of n elements with a carrier each at n times and 64 n positions; errors are the largest "
        "of any value, relative to the sum of all elements' amplitudes", "elements x times x positions", (64, 128, 256),
        (64, 128),
    ),
    "backproject": VerbTask(
        functools.partial(plane_image, verb=verbs.backproject, sums=exact.backproject),
        "white noise, n pulses of n samples over 300 m at 9.9 km on n x n pixels of 0.25 m",
        "pulses x pixels", (512, 1024, 2048), (256, 512), BOTH,
    ),
    "polar format": VerbTask(
        functools.partial(
            plane_image, verb=verbs.polar_format, sums=functools.partial(polar_format, center=np.zeros(3))
        ), "white noise, n pulses of n samples over 300 m at 9.9 km on n x n pixels of 0.25 m",
        "pulses x pixels", (512, 1024, 2048), (256, 512),
    ),
    "range-Doppler": VerbTask(
        range_doppler_image, "white noise, n pulses of n/2 samples, 0.24 m apart at 9.9 km, X band, 300 MHz",
        "pulses x samples x n", (512, 1024, 2048), (256, 512), tolerances=(1e-1, 1e-2, 3e-3),
    ),
    "full wave": VerbTask(
        fullwave, "a conducting sphere n cells across, 12 cells to the shortest wavelength, 64 pulses over 11 deg",
        "cells of the sphere x pulses", (24, 36, 48), (16, 24), tolerances=(1e-1, 3e-2),
    ),
}  # fmt: skip
