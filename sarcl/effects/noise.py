"""add_noise: seeded receiver noise on echoes, at a stated level of the image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..base import counter_rng
from ..base.constants import SPEED_OF_LIGHT
from ..base.types import LazyRows
from ..base.validation import array, count, direction, each, instance, number
from ..model.image_grid import ImageGrid
from ..model.lazy_rows import RowsOnDemand
from ..model.phase_history import PhaseHistory
from ..model.radar import Radar, noise_variance

LEVELS = ("nesz_db", "nesz", "temperature", "radar", "variance")

MOST_DECIBELS = 300.0  # largest level of noise, dB: amplitudes stay within float32
STREAM = 0x6E6F697365  # stream of random numbers: independent of those of roughness and speckle with the same seed


def add_noise(
    raw: PhaseHistory,
    *,
    nesz_db: float | None = None,
    nesz: float | None = None,
    temperature: float | None = None,
    radar: Radar | None = None,
    variance: ArrayLike | None = None,
    grid: ImageGrid | None = None,
    cell_area: float | None = None,
    seed: int = 0,
) -> PhaseHistory:
    """The echoes `raw` with complex white Gaussian noise, at a level that is given in one of five ways.

    nesz_db, nesz  noise-equivalent sigma zero, dB or m^2/m^2: the mean of |image.data/image.gain|^2 over the
                   resolution cell's area, focused from the rows of one polarisation. The cell is that at the centre of
                   `grid`, on its plane, or has the area `cell_area`
    temperature    K, of the receiving system, where samples are in sqrt(W) (see sarcl.model.radar); radar: a Radar that
                   has one
    variance       mean |noise|^2 of a sample, one or per row
    cell_area      m^2, of the cell of an unweighted image
    seed           noise depends on it, and on a sample's row and column, alone: not on what is read with it

    Noise is added when samples are read; nothing is loaded. Windows and weights widen the cell and increase the noise
    by the same factor, so the NESZ holds for all of them. Noise is filtered as the echoes are: it has the spectrum
    |P(f)| where the rows are compressed and their waveform is known. ValueError says what is missing.
    Source: docs/theory/radar.md.

    >>> noisy = sarcl.add_noise(raw, nesz_db=-20, grid=grid, seed=1)
    >>> empty = sarcl.backproject(noisy, grid).data[:40]  # far from both points
    """
    instance("raw", raw, PhaseHistory)
    seed = count("seed", seed, 0)
    levels = {"nesz_db": nesz_db, "nesz": nesz, "temperature": temperature, "radar": radar, "variance": variance}
    if level_of(levels) not in ("nesz", "nesz_db") and (grid is not None or cell_area is not None):
        raise ValueError(f"{level_of(levels)} is the level of samples; grid and cell_area go with nesz or nesz_db")
    if nesz is not None and not number("nesz", nesz) > 0:
        raise ValueError(f"nesz is {nesz:g}, wanted a ratio above 0, m^2/m^2; in decibels it is nesz_db={nesz:g}")
    if nesz is not None or nesz_db is not None:
        ratio = number("nesz", nesz, above=0) if nesz is not None else _power(nesz_db)
        level: ArrayLike = ratio * _cells(raw, grid, cell_area) / float((_filtered(raw) ** 2).mean())
    elif variance is not None:
        level = each("variance", variance, raw.n_rows)
    else:
        level = noise_variance(raw, _kelvin(radar) if temperature is None else temperature)
    level = each("variance", level, raw.n_rows)
    if (level < 0).any():
        raise ValueError(f"variance[{int(np.argmin(level))}] is {level.min():g}; it cannot be negative")
    shape = _filtered(raw) if raw.compressed else np.ones(raw.n_samples)
    return replace(raw, samples=Noisy(raw.samples, np.sqrt(level), shape, seed))


def _power(decibels: object) -> float:
    """A power ratio, of dB within those of float32."""
    level = number("nesz_db", decibels)
    if abs(level) > MOST_DECIBELS:
        raise ValueError(f"nesz_db is {level:g}; levels reach from {-MOST_DECIBELS:g} to {MOST_DECIBELS:g} dB")
    return float(10 ** (level / 10))


class Noisy(RowsOnDemand):
    """Rows of a source plus noise of deviation (n_rows,) times shape (n_samples,), computed for the rows of a slice."""

    def __init__(self, source: np.ndarray | LazyRows, deviation: np.ndarray, shape: np.ndarray, seed: int) -> None:
        self.source, self.deviation, self.profile, self.seed = source, deviation, shape, seed
        self.shape, self.dtype = source.shape, np.dtype(source.dtype)

    def rows(self, rows: slice) -> np.ndarray:
        index = np.arange(self.shape[0])[rows]
        clean = np.asarray(self.source[rows])
        noise = complex_gaussian(index, self.shape[1], self.seed) * (self.deviation[index, None] * self.profile)
        return (clean + noise).astype(self.dtype.newbyteorder("="))


def complex_gaussian(rows: np.ndarray, n_samples: int, seed: int) -> np.ndarray:
    """Complex normal numbers (len(rows), n_samples) of mean square 1 that belong to a seed, a row and a column.

    Two hashes of (seed, row, column) (splitmix64, Steele, Lea and Flood 2014), Box and Muller.
    """
    with np.errstate(over="ignore"):
        start = counter_rng.start_of(seed, STREAM)
        state = counter_rng.mix(
            counter_rng.mix(start ^ rows.astype(np.uint64))[:, None] ^ np.arange(n_samples, dtype=np.uint64)
        )
    power, cycles = counter_rng.polar(state)
    return np.asarray(np.sqrt(power) * np.exp(2j * np.pi * cycles))


def _kelvin(radar: Radar | None) -> float:
    instance("radar", radar, Radar)
    assert radar is not None
    if radar.noise_temperature is None:
        raise ValueError("radar has no noise_temperature; give Radar(..., noise_temperature=...) in K")
    return float(radar.noise_temperature)


def cell_area(raw: PhaseHistory, point: ArrayLike, normal: ArrayLike = (0.0, 0.0, 1.0)) -> float:
    """Area, m^2, of the resolution cell at `point` on a plane with a `normal`, of the echoes `raw`.

    It is the integral of |response|^2 over its peak.

    By Parseval it is (2 pi)^2 times the mean, over the samples, of 1/(the area of spatial frequencies that a sample
    occupies), over their number. For samples that are even there it is (2 pi)^2 over the area of all of them:
    range cell on the ground times cross-range cell, both between peak and null of an unweighted image: c/(2 B sin) x
    lambda/(2 angle), where the track is straight and short. Only rows of the first polarisation count; they must pass
    the point in one direction.

    >>> round(sarcl.noise.cell_area(raw, (0, 0, 0)), 2)
    0.31
    """
    instance("raw", raw, PhaseHistory)
    return float(_density(raw, point, normal) / (_one_image(raw).sum() * raw.n_samples))


def _cells(raw: PhaseHistory, grid: ImageGrid | None, area: float | None) -> float:
    """Variance of samples per NESZ: the cell's area times the number of samples in an image."""
    if (grid is None) == (area is None):
        raise ValueError("a NESZ needs the area of the resolution cell; give grid=... or cell_area=..., one of them")
    if area is not None:
        return number("cell_area", area, above=0) * int(_one_image(raw).sum()) * raw.n_samples
    instance("grid", grid, ImageGrid)
    assert grid is not None
    if grid.center is None or grid.x_axis is None or grid.y_axis is None:
        raise ValueError("this grid lists its points, so its normal is unknown; give a plane, or cell_area=... in m^2")
    return _density(raw, grid.center, np.cross(grid.x_axis, grid.y_axis))


def _one_image(raw: PhaseHistory) -> np.ndarray:
    """True for the rows of one image: those of the first polarisation."""
    if raw.polarization is None:
        return np.ones(raw.n_rows, bool)
    return np.asarray(raw.polarization == raw.polarization[0])


def _density(raw: PhaseHistory, point: ArrayLike, normal: ArrayLike) -> float:
    """(2 pi)^2 times samples per area of spatial frequencies on the plane, mean over the samples of an image.

    A sample lies at f g_p, g_p = (2 pi/c) (u_t + u_r) on the plane, and occupies f df |g_p x dg_p| there.
    """
    rows = _one_image(raw)
    for name in ("tx_channel", "rx_channel"):
        value = getattr(raw, name)
        if value is not None and np.ptp(value[rows]):
            raise ValueError(f"raw has several channels ({name}), whose samples may overlap; give cell_area=... in m^2")
    point, n = array("point", point, np.float64, (3,)), direction("normal", normal)
    first = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    plane = np.stack([first / np.linalg.norm(first), np.cross(n, first / np.linalg.norm(first))])
    look = sum(_unit(ends[rows] - point) for ends in (raw.tx, raw.rx))
    g = 2 * np.pi / SPEED_OF_LIGHT * (look @ plane.T)
    if len(g) < 2:
        raise ValueError("one pulse has no cross-range resolution, so a cell has no area; give cell_area=... in m^2")
    step = np.gradient(g, axis=0)
    sweep = g[:, 0] * step[:, 1] - g[:, 1] * step[:, 0]
    angle = np.unwrap(np.arctan2(g[:, 1], g[:, 0]))
    onward = np.diff(angle) * np.sign(angle[-1] - angle[0])
    if not (onward > 0).all() or not sweep.all() or abs(angle[-1] - angle[0]) > 2 * np.pi:
        raise ValueError(
            "the rows do not pass the point in one direction, so their cell is not defined; give cell_area=... in m^2"
        )
    f = raw.frequency[rows, None] + raw.frequency_step[rows, None] * np.arange(raw.n_samples)
    filled = f * raw.frequency_step[rows, None] * np.abs(sweep)[:, None]
    return float((2 * np.pi) ** 2 * (1 / filled).mean())


def _filtered(raw: PhaseHistory) -> np.ndarray:
    """Modulus (n_samples,) of the matched filter that the noise has passed; 1 where it is unknown."""
    if raw.waveform is None or np.ptp(raw.frequency) or np.ptp(raw.frequency_step):
        return np.ones(raw.n_samples)
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    shape = np.abs(raw.waveform.pulse_spectrum(f))
    return shape if shape.any() else np.ones(raw.n_samples)


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not length.all():
        raise ValueError(f"an antenna stands on the point at row {int(np.argmin(length))}, where no cell has an area")
    return np.asarray(vectors / length)


def level_of(levels: Mapping[str, object]) -> str:
    """The name of the one level among the arguments of `add_noise`; ValueError where there is none, or several."""
    names = [name for name in LEVELS if levels.get(name) is not None]
    if len(names) != 1:
        raise ValueError(f"noise has one level; give one of {', '.join(LEVELS)}, got {', '.join(names) or 'none'}")
    return names[0]
