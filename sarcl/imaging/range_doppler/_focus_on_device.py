"""The work of a range-Doppler image on a GPU: samples go up once, the image comes down once (equations in _focus.py).

Two arrays are large: the rows, which their spectra along the track replace, and the compressed Doppler bins, which the
image replaces. Both stay on the device where it holds them; one that does not fit is kept on the host and goes up and
down in blocks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base import float_pairs, host_memory
from ...base.constants import SPEED_OF_LIGHT
from ...base.stage_timer import Clock
from ...numerics.range_profiles import check_digits
from ...numerics.transforms import Transforms
from ...numerics.weighted_samples import WeightedSamples, bound_of_held
from ...opencl.device import Buffer, Device
from ...opencl.fft_batches import Batches
from ...opencl.launch_numbers import launch_numbers
from ...opencl.pipeline import SLOTS, Pipeline
from ._bins import Bins
from ._doppler import EVANESCENT
from ._host_rows import ARRAYS, Job, referenced, turns
from ._plan import SEGMENT, FocusPlan

LENGTHS = 3  # lengths of FFTs: along the track, of range profiles, back; the programs of each keep their memory
WORK = 1 / 16  # share of a budget for the rows that are transformed at a time, with one of these lengths
PIECE = 64  # rows that the host refers to one range at a time
BLOCKS = 8  # blocks of Doppler bins, at least, so that the host works on one while the device does another


def focus_on_device(job: Job, clock: Clock, on_progress: Callable[[float], None]) -> np.ndarray | None:
    """The image complex64 (times, ranges), as `focus` makes it; None where the host must make it.

    That is where the device has no room for a row of a transform, or may not hold the sums of the samples.
    """
    device, plan, raw = job.device, job.plan, job.raw
    weigher = WeightedSamples(device, job.weights[0], raw.n_rows, np.dtype(raw.samples.dtype))
    bins = Bins(device, plan, raw, job.track)
    room = Room.for_task(device, plan, bins, raw.n_rows, weigher.row_bytes, job.budget.device)
    if room is None:
        return None
    spectra = _Array(device, (max(raw.n_rows, plan.length), raw.n_samples), room.spectra)
    if not (_refer(job, spectra, weigher, room) if room.spectra else _refer_on_host(job, spectra, weigher)):
        return None
    clock.lap("samples")
    del weigher
    spectra.transform(plan.length, raw.n_rows, plan.length, 1, room)
    clock.lap("fft")
    on_progress(0.3)
    period = plan.length * plan.finer
    folded = _Array(device, (period, len(plan.ranges)), room.folded)
    if room.folded:
        folded.buffer = device.zeros(8 * folded.shape[0] * folded.shape[1])
    else:
        folded.host = host_memory.zeros(folded.shape, job.budget.host / ARRAYS, "Doppler bins of the columns")

    def on_bins(done: float) -> None:
        clock.lap("migration")
        on_progress(0.3 + 0.5 * done)

    _Migration(device, plan, bins, room).compressed(spectra, folded, on_bins)
    del spectra
    folded.transform(period, period, len(plan.times), -1, room)
    image = folded.rows(len(plan.times))
    clock.lap("fft")
    on_progress(1.0)
    return image


@dataclass(frozen=True)
class Room:
    """Arrays and blocks that fit on a device.

    spectra, folded  whether the rows and their spectra stay there, and the compressed Doppler bins
    work     bytes for the rows of a transform;  remainder  for blocks of all else;  bins  Doppler bins at a time
    """

    spectra: bool
    folded: bool
    work: float
    remainder: float
    bins: int

    @classmethod
    def for_task(
        cls, device: Device, plan: FocusPlan, bins: Bins, n_rows: int, row_bytes: float, budget: float
    ) -> Room | None:
        """The room of a task; None where a row of a transform, or a Doppler bin, does not fit.

        row_bytes  of the samples of a row that are being uploaded
        """
        n_samples, n_ranges, period = len(bins.frequencies), len(plan.ranges), plan.length * plan.finer
        spectra, folded = 8.0 * max(n_rows, plan.length) * n_samples, 8.0 * period * n_ranges
        work = WORK * budget
        if max(Batches(device, n, np.complex64).row_bytes for n in (period, plan.profile_length)) > work:
            return None
        widest = max(b - a for a, b in plan.blocks)
        profiles = 8.0 * len(bins.near(0)) * (plan.profile_length + 2 * bins.pad)
        uploads = SLOTS * (20.0 * (widest / SEGMENT + 1) + 12 * len(bins.near(0)))
        tables = 4.0 * (len(bins.near(0)) * n_ranges + 4 * n_samples + period + len(plan.times))
        tables += 4.0 * plan.interpolator.taps * plan.interpolator.terms
        if plan.band.window is not None:
            tables += 4.0 * len(plan.band.window.weights)
        column = 16.0 * max(n_rows, period)  # of an array on the host: as it goes up, and as it comes down
        order = [(True, True), (True, False), (False, True), (False, False)]
        if folded > spectra:  # the larger one costs more to move
            order[1:3] = order[2], order[1]
        for keeps in order:
            resident = [n for n, kept in zip((spectra, folded), keeps, strict=True) if kept]
            remainder = budget - LENGTHS * work - tables - sum(resident)
            each = profiles + uploads + (0 if keeps[0] else 8 * n_samples) + (0 if keeps[1] else 8 * n_ranges)
            if (
                remainder >= max(each, row_bytes, 0 if all(keeps) else column)
                and max(resident, default=0) <= device.info.max_alloc
            ):
                most = min(period, max(PIECE, -(-len(plan.bins) // BLOCKS)))
                largest = max(8.0 * (plan.profile_length + 2 * bins.pad), 8.0 * n_samples, 8.0 * n_ranges)
                return cls(
                    *keeps, work, remainder, max(1, int(min(most, remainder / each, device.info.max_alloc / largest)))
                )
        return None


class _Rows(NamedTuple):
    """Rows of an array on the device, from `first` on, that begin again after `period`; is_new  they hold no values."""

    buffer: Buffer
    first: int
    period: int
    is_new: bool = False


class _Array:
    """An array complex64 on the device, in `buffer`, or in `host`: in memory or a file."""

    buffer: Buffer
    host: np.ndarray

    def __init__(self, device: Device, shape: tuple[int, int], resident: bool) -> None:
        self.device, self.shape, self.resident = device, shape, resident

    def transform(self, length: int, n_rows: int, n: int, sign: int, room: Room) -> None:
        """Replace the columns of the first `n_rows`, padded or folded to a length, by n bins of their transforms.

        sign  1, or -1 for transforms with exp(+j ...)
        """
        device, width = self.device, self.shape[1]
        transforms = Transforms(device, length, width, room.work)
        weights = device.copied(np.ones(n, np.float32)), n
        if self.resident:
            for first in range(0, width, transforms.most):
                count = min(transforms.most, width - first)
                transforms.columns(self.buffer, (n_rows, width), first, count)
                transforms.lay(self.buffer, width, first, count, weights, 0, sign)
            return
        at_once = max(1, min(transforms.most, int(room.remainder // (8 * (n_rows + n)))))
        for first in range(0, width, at_once):
            part = np.ascontiguousarray(self.host[:n_rows, first : first + at_once])
            count = part.shape[1]
            transforms.columns(device.upload(part), part.shape, 0, count)
            out = device.empty(8 * n * count)
            transforms.lay(out, count, 0, count, weights, 0, sign)
            self.host[:n, first : first + count] = device.download(out, np.empty((n, count), np.complex64))

    def rows(self, n: int) -> np.ndarray:
        """The first n rows."""
        if self.resident:
            return self.device.download(self.buffer, np.empty((n, self.shape[1]), np.complex64))
        return np.array(self.host[:n])


def _refer(job: Job, rows: _Array, weigher: WeightedSamples, room: Room) -> bool:
    """Weighted rows of one reference range, made on the device; False where it may not hold their sums."""
    raw = job.raw
    rows.buffer = job.device.empty(8 * rows.shape[0] * rows.shape[1])
    at_once = max(1, int(min(room.remainder, job.device.limits.upload) // weigher.row_bytes))
    with Pipeline(job.device) as pipeline:
        for start in range(0, raw.n_rows, at_once):
            stop = min(start + at_once, raw.n_rows)
            samples, along = raw.read(start, stop), job.weights[1][start:stop]
            if weigher.bound(samples, along) is None:
                return False
            pipeline.new_block()
            weigher.make(pipeline, samples, along, turns(raw, start, stop, job.plan.center), rows.buffer, start)
            pipeline.step()
    return True


def _refer_on_host(job: Job, rows: _Array, weigher: WeightedSamples) -> bool:
    """The same, made on the host."""
    rows.host = host_memory.zeros(rows.shape, job.budget.host / ARRAYS, "spectra along the track")
    largest = 0.0
    for start in range(0, job.raw.n_rows, PIECE):
        stop = min(start + PIECE, job.raw.n_rows)
        samples, modulus = referenced(job, start, stop)
        rows.host[start:stop], largest = samples, max(largest, modulus)
        if bound_of_held(job.device, samples, (1.0, 1.0), weigher.n_terms, np.complex64) is None:
            return False
    check_digits(largest)
    return True


class _Migration:
    """Secondary range compression, migration and azimuth compression of Doppler bins, on a device."""

    def __init__(self, device: Device, plan: FocusPlan, bins: Bins, room: Room) -> None:
        self.device, self.plan, self.bins, self.room = device, plan, bins, room
        kernel, window = plan.interpolator, plan.band.window
        macros = {"TAPS": kernel.taps, "TERMS": kernel.terms, "SEGMENT": SEGMENT}
        self._compress = device.kernel("compression_filter.cl", "compress")
        self._pad = device.kernel("range_profiles.cl", "pad", REAL64=0, FROM64=0)
        self._straighten = device.kernel("range_doppler.cl", "straighten_onto", VW=1, **macros)
        self._frequencies = device.copied(float_pairs.wide(bins.frequencies))
        self._factors = device.copied(bins.correction.astype(np.float32))
        values = np.ones(1, np.float32) if window is None else window.weights.astype(np.float32)
        self._window = device.copied(values)
        first, step = (0.0, 1.0) if window is None else (window.sines[0], window.sines[1] - window.sines[0])
        self._band = {name: getattr(plan.band, name) for name in ("low", "high", "taper")}
        self._band |= {"window_first": first, "window_step": step, "n_window": len(values)}
        # the part of the amplitude that depends on the slant range alone; its phase of 1/8 cycle is in the lines
        level = np.abs(bins.level(plan.ranges))
        self._shares = [device.copied((share * level).astype(np.float32)) for share in bins.shares()]
        self._batches = Batches(device, plan.profile_length, np.complex64, room.work)
        self._stride = plan.profile_length + 2 * bins.pad

    def compressed(self, spectra: _Array, folded: _Array, on_progress: Callable[[float], None]) -> None:
        """Add the Doppler bins, compressed, to the rows of `folded` that they fall on, modulo its number of rows.

        on_progress  called with the share that is done
        """
        device, plan, bins, blocks = self.device, self.plan, self.bins, self.plan.blocks
        at_once, period = min(self.room.bins, len(plan.bins)), folded.shape[0]
        self._batches.reserve(at_once)
        free = [device.empty(8 * at_once * self._stride) for _ in bins.near(0)]
        profiles_of: dict[int, Buffer] = {}  # profiles of the nodes about a block
        chosen = spectra.buffer if spectra.resident else device.empty(8 * at_once * spectra.shape[1])
        out = folded.buffer if folded.resident else device.empty(8 * at_once * folded.shape[1])
        with Pipeline(device) as pipeline:
            for start in range(0, len(plan.bins), at_once):
                numbers = plan.bins[start : start + at_once]
                doppler = numbers / (plan.length * bins.track.step)
                read = _Rows(chosen, int(numbers[0] % plan.length), plan.length)
                written = _Rows(out, int(numbers[0] % period), period)
                if not spectra.resident:
                    device.write(chosen, spectra.host[numbers % plan.length])
                    read = _Rows(chosen, 0, len(numbers))
                if not folded.resident:
                    written = _Rows(out, 0, len(numbers), is_new=True)
                free += profiles_of.values()
                profiles_of.clear()
                for i, block in enumerate(blocks):
                    pipeline.new_block()
                    near = bins.near(i)
                    free += [profiles_of.pop(k) for k in [*profiles_of] if k not in near]
                    for k in near:
                        if k not in profiles_of:
                            profiles_of[k] = free.pop()
                            self._profiles(pipeline, read, doppler, bins.nodes[k], profiles_of[k])
                    profiles = [profiles_of[k] for k in near]
                    self._add(pipeline, profiles, doppler, block, written)
                    done = (start + len(numbers) * (i + 1) / len(blocks)) / len(plan.bins)
                    pipeline.step(lambda done=done: on_progress(done))  # type: ignore[misc]
                if not folded.resident:
                    part = np.empty((len(numbers), folded.shape[1]), np.complex64)
                    folded.host[numbers % period] += device.download(out, part)

    def _profiles(self, pipeline: Pipeline, spectra: _Rows, doppler: np.ndarray, distance: float, out: Buffer) -> None:
        """Range profiles after the secondary range compression of one slant range, m."""
        device, bins, length = self.device, self.bins, self.plan.profile_length
        bend = bins.bend(doppler, distance)
        kept = np.abs(bend) < EVANESCENT * bins.frequencies.min()
        bends = pipeline.upload(np.concatenate([float_pairs.wide(bend), kept[None].astype(np.float32)]))
        center, delay = (float_pairs.wide(np.array(v)) for v in (bins.center, 2 / SPEED_OF_LIGHT * distance))
        numbers = self._band | {"n_samples": len(bins.frequencies), "n_bins": len(doppler)}
        numbers |= {"first": spectra.first, "period": spectra.period}
        for start, count, work in self._batches.of(len(doppler)):
            numbers |= {"begin": start, "center": center, "delay": delay}
            launch = launch_numbers("compression_filter.cl", "compress", **numbers)
            buffers = spectra.buffer, self._frequencies, self._factors, bends, self._window, work
            device.run(self._compress, (length, count), None, launch, *buffers)
            self._batches.transform()
            device.run(self._pad, (self._stride, count), None, work, length, bins.pad, start, out)

    def _add(
        self, pipeline: Pipeline, profiles: list[Buffer], doppler: np.ndarray, block: tuple[int, int], folded: _Rows
    ) -> None:
        """Add profiles, read along the migration and turned, in the columns of a block: each with its shares."""
        bins, (begin, end) = self.bins, block
        cell, line = bins.lines(doppler, self.plan.ranges[begin:end])
        line[..., 2] += np.float32(0.125)
        places = pipeline.upload(cell), pipeline.upload(line)
        numbers = {"stride": self._stride, "origin": bins.pad + self.plan.profile_length // 2, "begin": begin}
        numbers |= {"first": folded.first, "period": folded.period, "n_ranges": len(self.plan.ranges)}
        for number, (profile, share) in enumerate(zip(profiles, self._shares, strict=True)):
            has_values = not folded.is_new or number > 0
            launch = launch_numbers("range_doppler.cl", "straighten_onto", **numbers, add=has_values)
            buffers = profile, *places, bins.table, share, folded.buffer
            self.device.run(self._straighten, (end - begin, len(doppler)), None, launch, *buffers)
