"""Errors of images whose data have their energy unevenly over rows and ranges: points, and ranges beside them.

What Doppler bins leave out, and what interpolation and rounding add, is proportional to the energy of some rows, or of
all samples of a row; the tolerance is relative to that of the profiles at the pixels. In white noise the two agree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.rows import spread_over
from ...model.phase_history import PhaseHistory
from ...opencl import fft
from ._doppler import Band, fresnel, sine
from ._extent import Extent
from ._track import Track
from ._velocity import Hyperbolas

PIXELS = 64  # pixels at which profiles are read
SAMPLES, LEAST_ROWS = 2**17, 32  # samples of the rows that are read, at most, and rows, at least
FINER = 4  # samples of a profile per sample of a row
ABOUT = 6  # samples on each side of a pixel that an interpolation reads
FEW_ZONES = 4  # Fresnel zones within which errors of rows add up in phase
CHANCE = 1.25  # what noise in so many pixels and rows makes of ratios that are 1
CELLS, MARGIN = 16, 12  # cells of a table per Fresnel zone, and zones beside the band


@dataclass(frozen=True, eq=False)
class UnevenEnergy:
    """Range profiles at some pixels.

    near    root mean square of the samples about the pixels, whole  of all samples: relative to that at the pixels
    sines   of the squint angles (rows, pixels);  power, about (rows, pixels) of the profiles at and about the pixels
    each    number of rows that each row that was read represents
    """

    near: float
    whole: float
    sines: np.ndarray
    power: np.ndarray
    about: np.ndarray
    each: float

    def error(self, band: Band, zone: float, pixel_band: float) -> float:
        """Relative error of these pixels by the ends of a Doppler band.

        zone  width of a Fresnel zone;  pixel_band  extent of the sines at which rows see a pixel
        Errors come from the directions of the ends, whose migration is another: from beside the pixels. Those of rows
        that see a pixel within few zones add up in phase where its echo may not, such as beside a point. Along more
        zones they do not, and are those of noise unless energies differ by more than chance.
        """
        table, wrong, exact = row_errors(band, zone)
        weight, errors = np.interp(self.sines, table, np.abs(exact) ** 2), np.interp(self.sines, table, wrong)
        echo, energy = float((weight * self.power).sum()), np.maximum(self.power, self.about)
        if not echo:
            return 0.0
        if pixel_band < FEW_ZONES * zone:
            return float(np.sqrt(self.each * ((errors * np.sqrt(energy)).sum(axis=0) ** 2).sum() / echo))
        variance, usual = (errors**2 * energy).sum() / echo, (errors**2).sum() / weight.sum()
        return float(np.sqrt(variance)) if variance > CHANCE**2 * usual else 0.0


def row_errors(band: Band, zone: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights of rows that weights of Doppler bins make: sines of squint angles (n,), moduli of the errors of these
    weights (n,), and the weights that are wanted, complex (n,).

    Weights of bins are convolved with a chirp, a factor exp(j pi n^2) at n cycles per Fresnel zone.
    """
    low, high = band.ends
    middle = np.clip((low + high) / 2, -1, 1)
    narrow = zone * (1 - min(middle**2, 0.99)) ** 0.75  # on the scale of sines the zone shrinks with squint
    step = narrow / CELLS
    n = int(np.ceil((high - low) / step)) + 2 * MARGIN * CELLS
    sines = (low + high) / 2 + step * (np.arange(n) - (n - 1) / 2)
    length = fft.good_length(n)
    chirp = np.exp(1j * np.pi * np.fft.fftfreq(length, 1 / CELLS) ** 2)
    weights = np.fft.ifft(np.fft.fft(band.weight(sines), length) * chirp)[:n]
    exact = band.row_weight(sines, zone)
    return sines, np.abs(weights - exact), exact


def uneven_energy(
    raw: PhaseHistory,
    track: Track,
    extent: Extent,
    fit: Hyperbolas,
    weights: tuple[np.ndarray, np.ndarray],
    wavelength: float,
) -> UnevenEnergy:
    """Profiles at 64 random pixels, in rows spread over the data. Ratios of 1 where no row holds energy.

    weights  of samples (n_samples,) and of rows (n_rows,)
    """
    sample_weight, row_weight = weights
    random = np.random.default_rng(0)
    u, r = random.choice(extent.times, PIXELS), random.choice(extent.ranges, PIXELS)
    rows = spread_over(raw.n_rows, max(LEAST_ROWS, SAMPLES // raw.n_samples))
    t, each = track.times[rows, None], raw.n_rows / len(rows)
    speed, _, shift = fit.at(r)
    sines = sine(u + shift, r, t, speed)
    delays = fit.range(u, r, t) - raw.reference_range[rows, None]
    length = fft.good_length(FINER * raw.n_samples)
    cells = np.rint(delays * (2 * float(raw.frequency_step[0]) * length / SPEED_OF_LIGHT)).astype(np.int64) % length
    weight = np.abs(extent.band.row_weight(sines, fresnel(wavelength, r))) ** 2
    power, about, energy = np.empty(cells.shape), np.empty(cells.shape), np.empty(len(rows))
    largest = np.zeros(len(rows))
    for i, row in enumerate(rows.tolist()):
        samples = raw.read(row, row + 1)[0] * (sample_weight * row_weight[row])
        largest[i] = np.abs(samples).max()  # squares must neither overflow nor underflow
        profile = np.abs(np.fft.ifft(samples / (largest[i] or 1.0), length)) ** 2 * length**2
        power[i], energy[i] = profile[cells[i]], profile.mean()
        sums = np.cumsum(np.pad(profile, (ABOUT * FINER, ABOUT * FINER + 1), mode="wrap"))  # rows may be shorter
        about[i] = (sums[cells[i] + 2 * ABOUT * FINER] - sums[cells[i]]) / (2 * ABOUT * FINER)
    relative = (largest / (largest.max() or 1.0)) ** 2
    power, about, energy = power * relative[:, None], about * relative[:, None], energy * relative
    at_pixels = float((weight * power).sum())
    floor = 1e-20 * float((weight * energy[:, None]).sum())  # where every pixel is at an exact null
    if floor == 0:
        return UnevenEnergy(1.0, 1.0, sines, power, about, each)
    ratios = [float(np.sqrt((weight * e).sum() / max(at_pixels, floor))) for e in (about, energy[:, None])]
    near, whole = (ratio if ratio > CHANCE else 1.0 for ratio in ratios)
    if extent.pixel_band < FEW_ZONES * extent.zone:  # profiles hardly migrate: their errors, too, add up in phase
        together = np.sqrt(weight * about).sum(axis=0) * each
        near = max(near, float(np.sqrt((together**2).sum() / (each * max(at_pixels, floor)))))
    return UnevenEnergy(near, whole, sines, power, about, each)
