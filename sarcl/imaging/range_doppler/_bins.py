"""Doppler bins on a device: secondary range compression, migration and azimuth compression (equations in _focus.py)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.text import size_text
from ...model.phase_history import PhaseHistory
from ...numerics import range_profiles
from ...numerics.polynomials import lagrange
from ...opencl.device import Device
from ._doppler import EVANESCENT
from ._plan import SEGMENT, FocusPlan, band_frequencies
from ._track import Track

CUBIC_NODES = 4  # nodes of a cubic polynomial


class Bins:
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
        shares = self.shares()
        profiles: dict[int, np.ndarray] = {}  # profiles of the nodes about a block
        for i, (first, last) in enumerate(blocks):
            near = self.near(i)
            profiles = {
                k: profiles[k] if k in profiles else self._profiles(spectra, doppler, self.nodes[k]) for k in near
            }
            columns = ranges[first:last]
            if len(blocks) == 1:
                yield slice(first, last), self._straightened(profiles[0], doppler, columns)
                return
            parts = (
                share[first:last] * self._straightened(profiles[k], doppler, columns)
                for share, k in zip(shares, near, strict=True)
            )
            yield slice(first, last), sum(parts, np.zeros((), np.complex64))

    @property
    def nodes(self) -> list[float]:
        """Slant ranges, m, for which filters are made: the middle of one block, every column where all blocks are
        single columns, else the ends of the blocks."""
        ranges, blocks = self.plan.ranges, self.plan.blocks
        if len(blocks) == 1:
            return [float(ranges[len(ranges) // 2])]
        if len(blocks) == len(ranges):
            return [float(r) for r in ranges]
        return [float(ranges[first]) for first, _ in blocks] + [float(ranges[-1])]

    def near(self, block: int) -> range:
        """Numbers of the nodes whose profiles are read for a block: four about it, or all where there are fewer."""
        n = len(self.nodes)
        start = min(max(block - 1, 0), max(n - CUBIC_NODES, 0))
        return range(start, min(start + CUBIC_NODES, n))

    def shares(self) -> np.ndarray:
        """Weights of the profiles of the nodes `near` a column's block, float32 (1 to 4, columns)."""
        nodes, ranges = np.array(self.nodes), self.plan.ranges
        out = np.ones((len(self.near(0)), len(ranges)), np.float32)
        if len(nodes) > 1:
            for i, (first, last) in enumerate(self.plan.blocks):
                near = self.near(i)
                out[:, first:last] = lagrange(nodes[near.start : near.stop], ranges[first:last])
        return out

    def bend(self, doppler: np.ndarray, distance: float) -> np.ndarray:
        """b = c q/(2 v) of Doppler bins, Hz (n,), at a slant range, m."""
        speed = float(self.plan.fit.at(np.array([distance]))[0][0])
        return np.asarray(SPEED_OF_LIGHT / (2 * speed) * doppler)

    def _profiles(self, spectra: np.ndarray, doppler: np.ndarray, middle: float) -> np.ndarray:
        """Range profiles after the secondary range compression of one slant range, m."""
        filtered = spectra * self._filter(doppler, middle)
        return range_profiles.from_samples(
            None, filtered, self.correction.astype(np.float32), self.plan.profile_length, self.pad
        )

    def _straightened(self, profiles: np.ndarray, doppler: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Profiles read along the migration of slant ranges, and turned by the azimuth compression: complex64."""
        device = self.device
        cell, line = self.lines(doppler, ranges)
        n_segments = cell.shape[1]
        out = device.empty(8 * len(doppler) * n_segments * SEGMENT)
        size, group = (n_segments, len(doppler)), (1, 1) if device.is_cpu else None
        origin = self.pad + self.plan.profile_length // 2
        buffers = device.upload(cell), device.upload(line), self.table, out
        device.run(self.kernel, size, group, device.upload(profiles), profiles.shape[1], origin, *buffers)
        columns = device.download(out, np.empty((len(doppler), n_segments * SEGMENT), np.complex64))
        return columns[:, : len(ranges)]

    def _filter(self, doppler: np.ndarray, middle: float) -> np.ndarray:
        """Secondary range compression for a slant range, amplitude and taper: complex64 (bins, n_samples)."""
        kind: Any = self.plan.phases
        band, f = self.plan.band, self.frequencies[None].astype(kind)
        bend = self.bend(doppler, middle)[:, None].astype(kind)
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

    def lines(self, doppler: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions in profiles and cycles of phase, of kernels/range_doppler.cl, for Doppler bins, Hz, and columns."""
        n_segments = -(-len(ranges) // SEGMENT)
        spacing = float(ranges[1] - ranges[0]) if len(ranges) > 1 else 1.0
        nodes = ranges[0] + spacing * SEGMENT * np.arange(n_segments + 1)
        speed, offset, shift = self.plan.fit.at(nodes)
        cosine = np.sqrt(np.maximum(1 - (SPEED_OF_LIGHT * doppler[:, None] / (2 * speed * self.center)) ** 2, 1e-3))
        position = (nodes / cosine + (offset - self.plan.center)) / self.sample
        cycles = 2 / SPEED_OF_LIGHT * self.center * (nodes * cosine + (offset - self.plan.center))
        cycles += doppler[:, None] * (float(self.plan.times[0]) + shift)
        step, slope = np.diff(position) / SEGMENT, np.diff(cycles) / SEGMENT
        position, cycles = position[:, :-1], cycles[:, :-1]
        samples = np.floor(position)
        length = self.plan.profile_length
        cell = ((samples + length // 2) % length - length // 2).astype(np.int32)
        line = np.stack([position - samples, step, cycles - np.rint(cycles), slope - np.rint(slope)], axis=-1)
        return cell, line.astype(np.float32)
