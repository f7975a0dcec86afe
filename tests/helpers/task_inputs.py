"""What random tasks are made of: tracks, echoes, grids and scenes, legal but odd, at any scale."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

import sarcl
from sarcl.opencl.choose_device import open_device

from .tasks import Draw

C = 299792458.0


@functools.cache
def opened(twin: str) -> Any:
    """The default device, or a twin of it; opened once."""
    device = open_device(None)
    return device.without_fp64() if twin == "no fp64" else device.one_lane() if twin == "one lane" else device


def device(draw: Draw) -> Any:
    return opened(draw.pick("", "", "", "no fp64", "one lane"))


def tolerance(draw: Draw, low: float = 1e-8) -> float:
    return draw.log(low, 0.2)


def band(draw: Draw) -> tuple[float, float]:
    """Centre frequency, 1 MHz to 10 THz, and bandwidth, Hz: from far less than the centre to nearly twice as much."""
    center = draw.log(1e6, 1e13) if draw.chance(0.3) else draw.log(1e9, 3e10)
    return center, center * draw.log(1e-5, 1.9)


def distance(draw: Draw) -> float:
    return draw.log(1.0, 3.6e7) if draw.chance(0.4) else draw.log(50.0, 2e4)


def origin(draw: Draw) -> np.ndarray:
    """Where the scene lies, m (3,): mostly at the origin of the coordinates, or far from it."""
    return draw.normal(3) * (draw.log(1.0, 1e8) if draw.chance(0.25) else 0.0)


def positions(draw: Draw, n: int, away: float) -> np.ndarray:
    """Antenna positions about the origin, m (n, 3): lines, arcs, crooked ones, hovering ones and no track at all."""
    t = np.linspace(-0.5, 0.5, n) if n > 1 else np.zeros(1)
    middle = away * np.array([-0.75, draw.uniform(-1, 1), 0.66])
    kind = draw.pick("line", "line", "arc", "crooked", "scattered", "hovering", "overhead")
    if kind == "arc":
        angle = draw.uniform(0, 2 * np.pi) + draw.log(1e-3, 6) * t
        return away * np.stack([0.8 * np.cos(angle), 0.8 * np.sin(angle), np.full(n, 0.6)], axis=1)
    if kind == "scattered":
        return middle + draw.normal(n, 3) * away * draw.log(1e-6, 0.1)
    if kind == "hovering":
        return np.repeat(middle[None], n, axis=0)
    if kind == "overhead":
        middle = np.array([0, 0, away])
    made = middle + np.outer(t * away * draw.log(1e-6, 0.5), draw.normal(3) if draw.chance(0.3) else [0, 1, 0])
    return made + (draw.normal(n, 3) * away * 1e-5 if kind == "crooked" else 0)


def history(draw: Draw, n_rows: int, n_samples: int, center: np.ndarray, **fields: Any) -> sarcl.PhaseHistory:
    """Noise, a tone, few samples or none, on any track about `center`, m (3,)."""
    carrier, bandwidth = band(draw)
    away = distance(draw)
    tx = positions(draw, n_rows, away) + center
    rx = positions(draw, n_rows, away * draw.log(0.1, 10)) + center if draw.chance(0.3) else None
    back = tx if rx is None else rx
    reference = (np.linalg.norm(tx - center, axis=1) + np.linalg.norm(back - center, axis=1)) / 2
    step = bandwidth / n_samples
    if draw.chance(0.1):  # rows that see other ranges
        reference = reference + draw.normal(n_rows) * C / (2 * step)
    kind = draw.pick("noise", "noise", "tone", "few", "zero" if draw.chance(0.2) else "noise")
    samples = draw.noise(n_rows, n_samples) * draw.log(1e-12, 1e12)
    if kind == "tone":
        samples = np.exp(2j * np.pi * np.outer(draw.normal(n_rows), np.arange(n_samples)))
    elif kind == "few":
        samples *= draw.random.random(samples.shape) < 2 / samples.size
    elif kind == "zero":
        samples *= 0
    first, steps = carrier - bandwidth / 2, step
    if draw.chance(0.2):
        first = first * draw.random.uniform(0.9, 1.1, n_rows)
        steps = step * draw.random.uniform(0.5, 2, n_rows)
    if draw.chance(0.3):
        fields.setdefault("time", np.cumsum(draw.random.random(n_rows) + 0.1) * draw.log(1e-6, 1e3))
    if draw.chance(0.2):
        fields.setdefault("weight", draw.random.random(n_rows) * (draw.random.random(n_rows) < 0.8))
    kind = np.complex128 if draw.chance(0.2) else np.complex64
    return sarcl.PhaseHistory(
        samples.astype(kind), frequency=first, frequency_step=steps, tx=tx, rx=rx, reference_range=reference, **fields
    )


def extent(draw: Draw, raw: sarcl.PhaseHistory) -> float:
    """Size of a grid, m: of the order of the resolution up to beyond the range window."""
    window = C / (2 * float(raw.frequency_step.min()))
    return window * draw.log(1e-4, 2)


def plane(draw: Draw, center: np.ndarray, size: float, most: int = 400) -> sarcl.ImageGrid:
    """A plane, of any direction; often of one row or one column."""
    rows = draw.whole(1, 40)
    shape = draw.pick((rows, draw.whole(1, max(1, most // rows))), (1, rows), (rows, 1), (1, 1), (rows, rows))
    spacing = size / max(shape) * np.array([1, draw.pick(1, 1, draw.log(1e-3, 1e3))])
    axes = {}
    if draw.chance(0.4):
        axes["normal"] = draw.normal(3)
    if draw.chance(0.4):
        axes["x_axis"] = draw.normal(3)
    return sarcl.ImageGrid.plane(center=center, shape=shape, spacing=spacing, **axes)


def grid(draw: Draw, center: np.ndarray, size: float) -> sarcl.ImageGrid:
    """A plane, or listed points with one to three axes, some of them empty."""
    if draw.chance(0.65):
        return plane(draw, center, size)
    shape = draw.pick((draw.whole(1, 300),), (draw.whole(1, 20), draw.whole(1, 20)), (2, draw.whole(1, 9), 3))
    points = center + draw.normal(*shape, 3) * size * np.array([1, 1, draw.pick(0, 0.1)])
    if draw.chance(0.2):
        points[...] = points.reshape(-1, 3)[0]  # the same point again and again
    valid = draw.random.random(shape) < 0.8
    return sarcl.ImageGrid.points(points, valid=valid if draw.chance(0.3) and valid.any() else None)


def track(draw: Draw, n: int, away: float, timed: bool = False) -> sarcl.Trajectory:
    """A track with times, or without."""
    kind = draw.pick("line", "circle", "listed", "timeless")
    if timed and n > 1:
        kind = draw.pick("line", "listed")
    if kind == "line":
        speed = away * draw.log(1e-3, 1)
        start = np.array([-0.7 * away, -speed / 2, 0.7 * away])
        return sarcl.Trajectory.line(start=start, velocity=(0, speed, 0), prf=max(n - 1, 1), n_pulses=n)
    if kind == "circle":
        how = draw.pick({}, {"prf": draw.log(1, 1e4)}, {"speed": draw.log(1, 1e4)} if n > 1 else {})
        return sarcl.Trajectory.circle(
            radius=0.7 * away, height=0.7 * away, start=draw.uniform(0, 6), arc=draw.log(1e-3, 6), n_pulses=n, **how
        )
    times = np.cumsum(draw.random.random(n) + 0.01) * draw.log(1e-3, 10)
    return sarcl.Trajectory(times if kind == "listed" else None, positions(draw, n, away))


def waveform(draw: Draw) -> sarcl.Waveform:
    center, bandwidth = band(draw)
    kind = draw.pick("chirp", "chirp", "down", "tone", "sampled")
    if kind == "tone":
        return sarcl.Waveform.tone(center=center, duration=4 / bandwidth)
    if kind == "sampled":
        return sarcl.Waveform.sampled(draw.noise(draw.whole(1, 40)), rate=bandwidth, center=center)
    product = draw.log(1, 1e4)
    return sarcl.Waveform.chirp(center=center, bandwidth=bandwidth, duration=product / bandwidth, down=kind == "down")


def antenna(draw: Draw, one_way: bool = False) -> sarcl.Antenna:
    gain = {"gain_db": draw.uniform(-20, 60), "two_way": draw.chance(0.3) and not one_way}
    kind = draw.pick("isotropic", "gaussian", "rectangular", "table")
    if kind == "isotropic":
        return sarcl.Antenna.isotropic(gain_db=gain["gain_db"])
    if kind == "gaussian":
        return sarcl.Antenna.gaussian(width=(draw.log(0.01, 2), draw.log(0.01, 2)), **gain)
    if kind == "rectangular":
        return sarcl.Antenna.rectangular(
            size=(draw.log(0.01, 10), draw.log(0.01, 10)), taper=draw.uniform(0, 1), **gain
        )
    n, m = draw.whole(4, 12), draw.whole(4, 12)
    width = draw.log(0.05, 1)
    azimuth, elevation = np.linspace(-width, width, n), np.linspace(-width, width, m)
    return sarcl.Antenna.table(azimuth, elevation, draw.noise(n, m), **gain)


def array(draw: Draw, wavelength: float, bandwidth: float) -> sarcl.AntennaArray:
    n = draw.whole(1, 7)
    spacing = wavelength * draw.uniform(0.2, 3) * draw.pick(1, -1)
    step = draw.pick(0.0, bandwidth * draw.log(1e-3, 2)) * draw.pick(1, -1)
    kind = draw.pick("linear", "linear", "planar", "costas")
    if kind == "planar":
        return sarcl.AntennaArray.planar((n, 2), spacing=(spacing, wavelength / 2), frequency_step=(step, step / 3))
    if kind == "costas":
        return sarcl.AntennaArray.costas(draw.pick(2, 4, 6), spacing=spacing, frequency_step=step)
    weights = draw.noise(n) if draw.chance(0.3) else None
    return sarcl.AntennaArray.linear(n, spacing=spacing, frequency_step=step, axis=draw.normal(3), weights=weights)


def points(draw: Draw, center: np.ndarray, size: float) -> sarcl.Scene:
    n = draw.whole(1, 40)
    where = center + draw.normal(n, 3) * size * np.array([1, 1, draw.pick(0, 0, 1)])
    amplitudes = draw.noise(n) * draw.log(1e-6, 1e6) * (draw.random.random(n) < 0.9)
    return sarcl.Scene.points(where, amplitudes if draw.chance(0.7) else 1.0)


def facets(draw: Draw, size: float) -> sarcl.Scene:
    """A body, a plate, terrain or loose triangles about the origin."""
    surface: dict[str, Any] = {"material": draw.pick("metal", "metal", 0.5, sarcl.Material(eps_r=6, conductivity=0.01))}
    if draw.chance(0.2):
        surface["roughness"] = size * draw.log(1e-4, 1e-2)
    kind = draw.pick("box", "plate", "disc", "cone", "terrain", "loose")
    if kind == "box":
        return sarcl.shapes.box(size * draw.random.uniform(0.1, 1, 3), rotation=draw.normal(3), **surface)
    if kind == "plate":
        return sarcl.shapes.plate((size, size * draw.log(0.01, 1)), rotation=draw.normal(3), **surface)
    if kind == "disc":
        return sarcl.shapes.disc(size, sections=draw.whole(3, 12), **surface)
    if kind == "cone":
        return sarcl.shapes.cone(size, size * draw.log(0.1, 3), sections=draw.whole(3, 12), **surface)
    if kind == "terrain":
        n, m = draw.whole(2, 6), draw.whole(2, 6)
        x, y = np.linspace(-size, size, n), np.linspace(-size, size, m)
        return sarcl.Scene.from_heights(x, y, draw.normal(m, n) * size * 0.1, **surface)
    return sarcl.Scene.facets(draw.normal(draw.whole(1, 10), 3, 3) * size, two_sided=draw.chance(0.5), **surface)


def window(draw: Draw, n_samples: int) -> Any:
    """A window in both directions, or one for each."""

    def one(n: int | None) -> Any:
        options = [
            None,
            "hamming",
            "hann",
            ("taylor", 35, 5),
            ("kaiser", draw.uniform(0, 20)),
            ("tukey", 0.5),
            "cosine",
        ]
        if n is not None:
            options.append(draw.random.random(n) + 0.01)
        return draw.pick(*options)

    if draw.chance(0.5):
        return None
    return one(None) if draw.chance(0.6) else (one(n_samples), one(None))
