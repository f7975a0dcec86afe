"""Tasks whose plans `make gpu-static` compiles: those of bench/output_hashes.py that use a device, and others here.

The others use what output_hashes.py leaves out (range-Doppler, spectral echoes, full wave, beams of antennas), and the
geometry of a satellite at the tolerances whose figures the page prints first.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import output_hashes

import sarcl
from sarcl import shapes
from sarcl.bench import spaceborne as setting
from sarcl.opencl.choose_device import open_device
from sarcl.visibility.rays import SceneRays

# Tasks of output_hashes.py: those that use no device, run others' plans again, or cannot do with numbers of paper.
LEFT_OUT = (
    "command", "scenario", "plan", "pointing", "motion", "waveforms", "antennas", "scenes", "noise", "autofocus",
    "multilook", "map_aperture", "compress", "echo file", "image file", "ambiguity",
)  # fmt: skip
# Tasks that are run on a GPU without float64 too: those that reach kernels or branches of them that differ there.
WITHOUT_FP64 = (
    "spaceborne", "listed spaceborne", "direct 1e", "direct points", "direct bistatic", "direct wide", "direct wrap",
    "direct beam",
    "factorized 1e-02", "factorized 1e-03", "factorized bistatic", "factorized points", "echo points 1e",
    "echo points far", "echo points bistatic", "echo antenna pair", "echo facets 1e-4", "echo facets bistatic",
    "echo terrain tank", "echo factorized",
    "array facets", "beam", "antenna beam", "pixel taper", "spectral_echo", "polar_format", "range_doppler",
)  # fmt: skip
# Tasks of which the plan alone is wanted: they end at the first launch of a kernel whose name begins so.
UNTIL = {"spaceborne": "backproject", "listed spaceborne": "backproject"}


def spaceborne(tolerance: float, listed: bool = False) -> Any:
    """Direct backprojection of 8192 x 8192 pixels of 0.25 m, from 770 km: X band, 600 MHz, 11 566 pulses.

    The rows of samples share memory, and blocks are small: the task ends at the first of them.

    listed  the middle 2048 x 2048 pixels alone, as listed points, which lines cannot hold
    """
    noise = np.random.default_rng(1).standard_normal(2 * setting.SIDE).astype(np.float32).view(np.complex64)
    raw = setting.phase_history(np.broadcast_to(noise, (setting.PULSES, setting.SIDE)))
    grid = sarcl.ImageGrid.plane(shape=(setting.SIDE, setting.SIDE), spacing=setting.SPACING)
    if listed:
        grid = sarcl.ImageGrid.points(grid.part(slice(3072, 5120), slice(3072, 5120)).positions)
    return sarcl.backproject(raw, grid, tolerance=tolerance, method="direct", check=False, max_bytes=2e9)


def range_doppler(tolerance: float) -> Any:
    """Broadside strip at X band, 300 MHz, 10 km."""
    n = 256
    y = 60.0 * (np.arange(n) / (n - 1) - 0.5)
    tx = np.stack([np.full(n, -7e3), y, np.full(n, 7e3)], axis=1)
    noise = np.random.default_rng(1).standard_normal((n, n)).astype(np.float32).view(np.complex64)
    raw = sarcl.PhaseHistory(
        noise, frequency=9.6e9, frequency_step=300e6 / noise.shape[1], tx=tx, time=np.linspace(0, 2.4, n),
        reference_range=np.linalg.norm(tx, axis=1),
    )  # fmt: skip
    return sarcl.range_doppler(raw, tolerance=tolerance, check=False)


def spectral(tolerance: float, **options: Any) -> Any:
    """Rough facets of 1 m in the beam of a straight track, by Fourier transforms."""
    axis, look = np.linspace(-8, 8, 17), np.radians(50)
    material = sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="cos2")
    heights = np.random.default_rng(0).normal(size=(17, 17)) * 0.02
    scene = sarcl.Scene.from_heights(6e3 * np.tan(look) + axis, axis, heights, material=material, **options)
    line = sarcl.Trajectory.line(start=(0, -60, 6e3), velocity=(0, 100, 0), prf=125, n_pulses=150)
    track = sarcl.pointing.stripmap(line, look=look, side="right")
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=0.5e-6)
    return sarcl.spectral_echo(
        scene, chirp, track, antenna=sarcl.Antenna.gaussian(width=(0.012, 0.3)), max_edge=None, shadows=False,
        tolerance=tolerance, check=False,
    )  # fmt: skip


def rough_pieces() -> Any:
    """Rough facets without shadows, which the device cuts."""
    axis = np.linspace(-8, 8, 17)
    heights = np.random.default_rng(0).normal(size=(17, 17)) * 0.02
    scene = sarcl.Scene.from_heights(axis, axis, heights, material=sarcl.Material(eps_r=4.0, diagram="cos2"))
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=0.5e-6)
    return sarcl.echo(
        scene, chirp, sarcl.Trajectory.circle(radius=5e3, height=3e3, arc=0.02, n_pulses=8), shadows=False
    )


def full_wave(material: Any = "metal", cells: float = 10, **options: Any) -> Any:
    """A sphere, each pulse with a run of its own or formed from one run."""
    angle = np.deg2rad([20.0, 21, 22, 23, 24, 25, 26, 27])
    track = sarcl.Trajectory(None, 40 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1))
    chirp = sarcl.Waveform.chirp(center=1.25e9, bandwidth=500e6, duration=2e-8)
    return sarcl.fullwave_echo(shapes.sphere(0.1, edge=0.02, material=material), chirp, track, cells=cells, **options)


def antenna_beam(**options: Any) -> Any:
    """Direct backprojection, every pulse weighted by an antenna's pattern."""
    antenna = sarcl.Antenna.gaussian(width=(0.002, 0.003), gain_db=30)
    return output_hashes.focus(beam=antenna, **options)


def shares(place: str) -> Any:
    """Sampled shares of a box on hills: seen from outside, and from beside it."""
    axis = np.linspace(-8, 8, 17)
    heights = np.random.default_rng(0).normal(size=(17, 17)) * 0.3
    ground = sarcl.Scene.from_heights(axis, axis, heights)
    scene = ground + shapes.box((2, 2, 3)).on(ground, 1, 1)
    antenna = np.array([[3.0, -4.0, 4.0]]) if place == "near" else np.array([[7e3, 0, 5e3]])
    return sarcl.illumination.lit(scene.triangles, antenna, tolerance=0.1)


def rays() -> Any:
    """Rays between the facets of a sphere."""
    scene = SceneRays(open_device(), shapes.sphere(1.0, facets=320).triangles)
    ends = np.ones((16, 3))
    return scene.nearest(-ends, ends), scene.any_hit(-ends, ends)


def exact_operator(n_rows: int = 8, antenna: sarcl.Antenna | None = None) -> Any:
    """The transpose of float64 images, and gradients by everything that moves, of one antenna."""
    noise = np.ones((n_rows, 32), np.complex64)
    tx = np.array([-7e3, 0, 7e3]) + np.arange(n_rows)[:, None]
    raw = sarcl.PhaseHistory(noise, 9.5e9, 6e6, tx, np.linalg.norm(tx, axis=1))
    grid = sarcl.ImageGrid.plane(shape=(16, 16), spacing=0.2)
    operator = sarcl.linear.Echoes(grid, raw, exact=True, antenna=antenna)
    x = operator.H @ noise.ravel()
    return operator.gradients(x, operator @ x)


OWN: dict[str, Callable[[], Any]] = {
    **{f"shares {place}": partial(shares, place) for place in ("outside", "near")},
    **{
        f"{'listed ' * listed}spaceborne {name}": partial(spaceborne, float(name), listed)
        for listed, name in itertools.product((False, True), ("1e-3", "3e-5"))
    },
    "rays": rays,
    "operator": exact_operator,
    "operator with an antenna": partial(exact_operator, antenna=sarcl.Antenna.gaussian(width=0.1)),
    "range_doppler": lambda: range_doppler(1e-2),
    "spectral_echo": lambda: spectral(1e-2),
    "spectral_echo rough": lambda: spectral(1e-2, roughness=0.01),
    "echo rough pieces": rough_pieces,
    "fullwave_echo": lambda: full_wave(anchors=2),
    "fullwave_echo dielectric": lambda: full_wave(sarcl.Material(eps_r=3.0), 12, anchors=2),
    "antenna beam": antenna_beam,
    "antenna beam window": lambda: antenna_beam(window="hamming"),
    "pixel taper": lambda: output_hashes.focus(beam=0.0015, window=(None, "hamming")),
}


def tasks() -> dict[str, Callable[[], Any]]:
    """Every task, by name."""
    return {**{k: v for k, v in output_hashes.TASKS.items() if not k.startswith(LEFT_OUT)}, **OWN}


def without_fp64() -> dict[str, Callable[[], Any]]:
    """The tasks that are run on a GPU without float64 too."""
    return {name: task for name, task in tasks().items() if name.startswith(WITHOUT_FP64)}
