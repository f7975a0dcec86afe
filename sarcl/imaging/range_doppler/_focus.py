"""The work of a range-Doppler image: azimuth FFT, secondary range compression, migration, azimuth compression.

    X(q, n)   azimuth FFT of the rows, Doppler bin q and frequency n
    I(q, r)   sum_n X(q, n) H(q, n) exp(+j (4 pi/c) [r sqrt(f_n^2 - b^2) - r_0 f_n]),   b = c f_q/(2 v(r))
    I(u, r)   inverse azimuth FFT of I(q, r)

H has the amplitude of the stationary phase and the taper of the Doppler band. The square root is taken as its value
and slope at the centre frequency, exactly for every column (azimuth compression and migration), and the rest, between
some slant ranges (secondary range compression).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...base import host_memory
from ...base.constants import SPEED_OF_LIGHT
from ...base.stage_timer import Clock
from ...base.text import size_text
from ...model.phase_history import PhaseHistory
from ...numerics import range_profiles
from ...numerics.polynomials import lagrange
from ...opencl import fft
from ...opencl.device import Device
from ._doppler import EVANESCENT
from ._plan import SEGMENT, FocusPlan, band_frequencies
from ._track import Track

PIECE = 64  # rows that are transposed at a time, for the cache
ARRAYS = 3  # large arrays that share the memory of the host: rows, spectra, compressed bins


@dataclass(frozen=True)
class Budget:
    """Bytes for blocks on the device, and for large arrays in the memory of the host; beyond, these go to files."""

    device: float
    host: float


def focus(
    device: Device, plan: FocusPlan, raw: PhaseHistory, track: Track, weights: tuple[np.ndarray, np.ndarray],
    budget: Budget, clock: Clock, on_progress: Callable[[float], None],
) -> np.ndarray:  # fmt: skip
    """The image complex64 (times, ranges), from the rows times weights of samples and of rows.

    MemoryError where neither memory nor temporary files hold the rows, their spectra or the compressed bins.
    """
    spectra = _azimuth_spectra(device, plan, raw, weights, budget, clock)
    on_progress(0.3)
    bins = _Bins(device, plan, raw, track)
    n_times, n_ranges = len(plan.times), len(plan.ranges)
    period = plan.length * plan.finer
    folded = host_memory.zeros((period, n_ranges), budget.host / ARRAYS, "Doppler bins of the columns")
    at_once = bins.at_once(budget.device)
    for start in range(0, len(plan.bins), at_once):
        numbers = plan.bins[start : start + at_once]
        chosen = spectra[numbers % plan.length]
        for columns, made in bins.compressed(chosen, numbers):
            for a, b in _pieces(numbers, period):
                folded[numbers[a] % period : numbers[a] % period + b - a, columns] += made[a:b]
        clock.lap("migration")
        on_progress(0.3 + 0.5 * (start + len(numbers)) / len(plan.bins))
    del spectra
    image = np.empty((n_times, n_ranges), np.complex64)
    level = bins.level(plan.ranges).astype(np.complex64)
    width = _columns(folded, budget)
    for start in range(0, n_ranges, width):
        columns = slice(start, start + width)
        made = fft.rows(device, np.ascontiguousarray(folded[:, columns].T), inverse=True)
        image[:, columns] = made[:, :n_times].T * level[columns]
    clock.lap("fft")
    on_progress(1.0)
    return image


def _columns(held: np.ndarray, budget: Budget) -> int:
    """Columns that are transformed at a time: few for the cache, more where each pass reads a file again."""
    return max(PIECE, int(budget.host / (32 * len(held)))) if isinstance(held, np.memmap) else PIECE


def _pieces(numbers: np.ndarray, period: int) -> list[tuple[int, int]]:
    """Runs of consecutive Doppler bins that do not cross a multiple of the period."""
    breaks = np.flatnonzero(numbers % period == 0)
    edges = np.unique(np.concatenate([[0], breaks, [len(numbers)]]))
    return [(int(a), int(b)) for a, b in pairwise(edges)]


def _azimuth_spectra(
    device: Device, plan: FocusPlan, raw: PhaseHistory, weights: tuple[np.ndarray, np.ndarray], budget: Budget,
    clock: Clock,
) -> np.ndarray:  # fmt: skip
    """FFT of the rows along the track, all with the reference range plan.center: complex64 (length, n_samples).

    A track longer than the FFT is folded: the plan's length keeps what is folded out of the pixels' Doppler band.
    """
    rows = host_memory.zeros((raw.n_rows, raw.n_samples), budget.host / ARRAYS, "rows of samples")
    largest = 0.0
    for start in range(0, raw.n_rows, PIECE):
        made, here = _referenced(raw, start, min(start + PIECE, raw.n_rows), plan.center, weights)
        rows[start : start + PIECE] = made
        largest = max(largest, here)
    range_profiles.check_digits(largest)
    clock.lap("samples")
    out = host_memory.zeros((plan.length, raw.n_samples), budget.host / ARRAYS, "spectra along the track")
    width = _columns(out, budget)
    for start in range(0, raw.n_samples, width):
        columns = slice(start, start + width)
        part = np.zeros((len(rows[0, columns]), plan.length), np.complex64)
        for first in range(0, raw.n_rows, plan.length):
            piece = rows[first : first + plan.length, columns].T
            part[:, : piece.shape[1]] += piece
        out[:, columns] = fft.rows(device, part).T
    clock.lap("fft")
    return out


def _referenced(
    raw: PhaseHistory, start: int, stop: int, center: float, weights: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, float]:
    """Weighted rows start ... stop - 1 with the reference range `center`, m: complex64; and their largest modulus."""
    sample_weight, row_weight = weights
    samples = raw.read(start, stop) * np.outer(row_weight[start:stop], sample_weight).astype(np.float32)
    largest = float(np.abs(samples).max(initial=0.0))
    if largest > range_profiles.LARGEST[np.complex64] / (raw.n_rows * raw.n_samples):
        raise ValueError(
            f"samples times weights reach {largest:.1e}; sums of {raw.n_rows * raw.n_samples} in complex64 hold up to "
            f"{range_profiles.LARGEST[np.complex64]:.0e}: scale the samples down"
        )
    moved = 2 / np.longdouble(SPEED_OF_LIGHT) * (center - raw.reference_range[start:stop].astype(np.longdouble))
    first, step = ((moved * f[0] % 1).astype(np.float64)[:, None] for f in (raw.frequency, raw.frequency_step))
    # n = width a + b: exp(j 2 pi n s) is a product of one power for each digit, which takes far fewer exponentials
    width = int(np.ceil(np.sqrt(raw.n_samples)))
    high = np.exp(2j * np.pi * (first + step * width * np.arange(-(-raw.n_samples // width)))).astype(np.complex64)
    low = np.exp(2j * np.pi * step * np.arange(width)).astype(np.complex64)
    turned = (high[:, :, None] * low[:, None, :]).reshape(stop - start, -1)[:, : raw.n_samples]
    return (samples * turned).astype(np.complex64), largest


class _Bins:
    """Doppler bins on a device: secondary range compression, migration and azimuth compression."""

    def __init__(self, device: Device, plan: FocusPlan, raw: PhaseHistory, track: Track) -> None:
        self.device, self.plan, self.track = device, plan, track
        self.frequencies = band_frequencies(raw)
        self.center = float(self.frequencies[raw.n_samples // 2])
        self.sample = SPEED_OF_LIGHT / (2 * plan.profile_length * float(raw.frequency_step[0]))  # m
        kernel = plan.interpolator
        spacing = float(np.diff(plan.ranges).max(initial=0.0)) / self.sample
        steepest = 1 / np.sqrt(1 - max(abs(s) for s in plan.band.ends) ** 2)
        self.pad = range_profiles.padding(kernel) + int(np.ceil(1.1 * spacing * steepest * SEGMENT))
        self.correction = range_profiles.correction(kernel, raw.n_samples, plan.profile_length)
        macros = {"TAPS": kernel.taps, "TERMS": kernel.terms, "SEGMENT": SEGMENT}
        self.kernel = device.kernel("range_doppler.cl", "straighten", **macros)
        self.table = device.upload(kernel.table)

    def at_once(self, budget: float) -> int:
        """Doppler bins at a time in `budget` bytes. MemoryError where none fits."""
        widest = max(b - a for a, b in self.plan.blocks)
        each = 8 * (self.plan.profile_length + 2 * self.pad) + (8 + 20 / SEGMENT) * (widest + SEGMENT)
        if each > budget:
            raise MemoryError(
                f"max_bytes leaves {size_text(budget)}, but a Doppler bin needs {size_text(each)}; raise max_bytes"
            )
        # a few MB at a time stay in the caches of a CPU
        return max(1, int(min(budget, 2**25) // each))

    def level(self, ranges: np.ndarray) -> np.ndarray:
        """The part of the stationary-phase amplitude that depends on the slant range alone, complex (n,)."""
        # the spectrum of exp(j phi(t)) is sqrt(2 pi/phi'') exp(j pi/4) at the stationary phase
        speeds = self.plan.fit.at(ranges)[0]
        scale = np.sqrt(SPEED_OF_LIGHT / 2) / (self.track.step * self.plan.length) * np.exp(0.25j * np.pi)
        return np.asarray(scale * np.sqrt(ranges) / speeds)

    def compressed(self, spectra: np.ndarray, numbers: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
        """Values complex64 (bins, columns) of Doppler bins whose spectra are given, for the columns of each block."""
        ranges, blocks = self.plan.ranges, self.plan.blocks
        doppler = numbers / (self.plan.length * self.track.step)
        if len(blocks) == 1:
            profiles = self._profiles(spectra, doppler, float(ranges[len(ranges) // 2]))
            yield slice(*blocks[0]), self._straightened(profiles, doppler, ranges)
            return
        nodes = np.array([ranges[first] for first, _ in blocks] + [ranges[-1]])
        made: dict[int, np.ndarray] = {}  # profiles of the four nodes about a block
        for i, (first, last) in enumerate(blocks):
            start = min(max(i - 1, 0), len(nodes) - 4)
            near = range(start, start + 4)
            made = {k: made[k] if k in made else self._profiles(spectra, doppler, float(nodes[k])) for k in near}
            here = ranges[first:last]
            shares = lagrange(nodes[near.start : near.stop], here).astype(np.float32)
            parts = (share * self._straightened(made[k], doppler, here) for share, k in zip(shares, near, strict=True))
            yield slice(first, last), sum(parts, np.zeros((), np.complex64))

    def _profiles(self, spectra: np.ndarray, doppler: np.ndarray, middle: float) -> np.ndarray:
        """Range profiles after the secondary range compression of one slant range, m."""
        filtered = spectra * self._filter(doppler, middle)
        return range_profiles.from_samples(
            self.device, filtered, self.correction.astype(np.float32), self.plan.profile_length, self.pad
        )

    def _straightened(self, profiles: np.ndarray, doppler: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Profiles read along the migration of slant ranges, and turned by the azimuth compression: complex64."""
        device = self.device
        cell, line = self._lines(doppler, ranges)
        n_segments = cell.shape[1]
        out = device.empty(8 * len(doppler) * n_segments * SEGMENT)
        device.run(
            self.kernel, (n_segments, len(doppler)), (1, 1) if device.is_cpu else None,
            device.upload(profiles), profiles.shape[1], self.pad + self.plan.profile_length // 2,
            device.upload(cell), device.upload(line), self.table, out,
        )  # fmt: skip
        made = device.download(out, np.empty((len(doppler), n_segments * SEGMENT), np.complex64))
        return made[:, : len(ranges)]

    def _filter(self, doppler: np.ndarray, middle: float) -> np.ndarray:
        """Secondary range compression for a slant range, amplitude and taper: complex64 (bins, n_samples)."""
        speed = float(self.plan.fit.at(np.array([middle]))[0][0])
        kind: Any = self.plan.phases
        band, f = self.plan.band, self.frequencies[None].astype(kind)
        bend = (SPEED_OF_LIGHT / (2 * speed) * doppler)[:, None].astype(kind)
        inside = np.abs(bend) < EVANESCENT * f
        bend = np.where(inside.all(axis=1, keepdims=True), bend, kind(0))
        root = np.sqrt((f - bend) * (f + bend))
        a = np.sqrt((self.center - bend) * (self.center + bend))
        g = (self.frequencies - self.center)[None].astype(kind)
        turn = g * (bend / a)
        cycles = kind(-2 / SPEED_OF_LIGHT * middle) * (turn * turn / (root + a + g * (self.center / a)))
        phase = ((cycles - np.rint(cycles)) * kind(2 * np.pi)).astype(np.float32)
        f, bend, root = (values.astype(np.float32, copy=False) for values in (f, bend, root))
        level = f / (root * np.sqrt(root))
        sines = bend / f
        low, high = float(sines.min()), float(sines.max())
        if band.window is not None or low < band.low or high > band.high:
            level = level * band.weight(sines).astype(np.float32)
        out = np.empty(phase.shape, np.complex64)
        out.real, out.imag = level * np.cos(phase), level * np.sin(phase)
        out[~inside.all(axis=1)] = 0
        return out

    def _lines(self, doppler: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions in profiles and cycles of phase, of kernels/range_doppler.cl, for Doppler bins, Hz, and columns."""
        n_segments = -(-len(ranges) // SEGMENT)
        spacing = float(ranges[1] - ranges[0]) if len(ranges) > 1 else 1.0
        nodes = ranges[0] + spacing * SEGMENT * np.arange(n_segments + 1)
        speed, offset, shift = self.plan.fit.at(nodes)
        cosine = np.sqrt(np.maximum(1 - (SPEED_OF_LIGHT * doppler[:, None] / (2 * speed * self.center)) ** 2, 1e-3))
        start = float(self.plan.times[0]) - self.track.start
        position = (nodes / cosine + (offset - self.plan.center)) / self.sample
        cycles = 2 / SPEED_OF_LIGHT * self.center * (nodes * cosine + (offset - self.plan.center))
        cycles += doppler[:, None] * (start + shift)
        step, slope = np.diff(position) / SEGMENT, np.diff(cycles) / SEGMENT
        position, cycles = position[:, :-1], cycles[:, :-1]
        whole = np.floor(position)
        length = self.plan.profile_length
        cell = ((whole + length // 2) % length - length // 2).astype(np.int32)
        line = np.stack([position - whole, step, cycles - np.rint(cycles), slope - np.rint(slope)], axis=-1)
        return cell, line.astype(np.float32)
