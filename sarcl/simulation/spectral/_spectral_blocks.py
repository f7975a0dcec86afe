"""Spectral echoes as a job that is computed in blocks: a row of spectra has the same bits in whatever block it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.stage_timer import Clock
from ...blocks.bands import FlatArray, Run
from ...blocks.block_job import BlockJob
from ...numerics import cost_model
from ...opencl.device import Device
from ...opencl.memory_budget import budget as budget_of
from ..echo_files import job_description
from ..echo_output import SHARE
from ._map_part import SpectrumRows
from ._scratch import folder_of
from ._spectral_options import SpectralEchoOptions
from .spectral_parts import PlannedParts
from .spectral_task import SpectralTask

STAGE = "spectra"
BAND = 64  # rows: numbers of rows whose transforms fill the vectors of every CPU divide it
# of a block: fewer bytes of rows take longer to write, unless they take about so many microseconds
LEAST_BYTES, LEAST_MICROSECONDS = 2.0**22, 1e6
REPEATED = 10.0  # ratio of a block's work to the part of it that every block of a map repeats, at least


@dataclass(frozen=True)
class Section:
    """Rows of one map of a part in one polarisation, one per wavenumber; or of all pulses and polarisations of the
    facets that are added pulse by pulse: part is None.

    first, n_rows  its rows;  first_band  its first band;  cost  work of a row, microseconds
    """

    part: int | None
    map: int
    polarization: int
    first: int
    n_rows: int
    first_band: int
    cost: int

    @property
    def n_bands(self) -> int:
        """Number of its bands."""
        return -(-self.n_rows // BAND)

    def rows(self, first: int, last: int) -> tuple[int, int]:
        """Its rows in bands first ... last - 1, counted from its own first."""
        inside = (min(max((band - self.first_band) * BAND, 0), self.n_rows) for band in (first, last))
        return next(inside), next(inside)


class SpectrumBands:
    """Spectra of all maps over the wavenumbers along the track, and echoes added pulse by pulse, in bands of up to BAND
    rows: see blocks.bands.Bands. It has no sections until the scene is planned.
    """

    def __init__(self, n_samples: int) -> None:
        self.row_shape: tuple[int, ...] = (n_samples,)
        self.sections: list[Section] = []

    def divide(self, planned: PlannedParts) -> None:
        """Take the sections of a plan."""
        polarizations, n_samples = len(planned.task.request.polarizations), self.row_shape[0]
        self.sections = []
        for i, part in enumerate(planned.parts):
            for j, one in enumerate(part.maps):
                cost = cost_model.SPECTRAL_SAMPLE * n_samples * len(part.expansion) * one.nodes
                for n in range(polarizations):
                    self._append(i, j, n, one.grid.count, cost)
        if planned.direct is not None:
            n_pulses = len(planned.task.track)
            cost = 1e6 * planned.seconds_pulse_by_pulse() / (n_pulses * polarizations)
            self._append(None, 0, 0, n_pulses * polarizations, cost)

    def _append(self, part: int | None, number: int, polarization: int, n_rows: int, cost: float) -> None:
        band = self.n_bands
        self.sections.append(Section(part, number, polarization, self.n_rows, n_rows, band, max(1, round(cost))))

    @property
    def n_bands(self) -> int:
        """Number of bands."""
        return self.sections[-1].first_band + self.sections[-1].n_bands if self.sections else 0

    @property
    def has_direct(self) -> bool:
        """Whether facets are added pulse by pulse: their section is the last."""
        return bool(self.sections) and self.sections[-1].part is None

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return self.sections[-1].first + self.sections[-1].n_rows if self.sections else 0

    def parts(self, first: int, last: int) -> list[tuple[Section, int, int]]:
        """Sections with rows in bands first ... last - 1, and these rows, counted from the first of the section."""
        parts = [(section, *section.rows(first, last)) for section in self.sections]
        return [(section, a, b) for section, a, b in parts if a < b]

    def extent(self, first: int, last: int) -> slice:
        """Rows of bands first ... last - 1."""
        parts = self.parts(first, last)
        if not parts:
            return slice(0, 0)
        return slice(parts[0][0].first + parts[0][1], parts[-1][0].first + parts[-1][2])

    def count(self, first: int, last: int) -> int:
        """Work of these bands, about, microseconds."""
        return sum(section.cost * (b - a) for section, a, b in self.parts(first, last))


@dataclass(frozen=True)
class SpectrumTally:
    """Nothing is counted in blocks of spectra: see blocks.bands.Tally."""

    def __add__(self, other: SpectrumTally) -> SpectrumTally:
        return self


class SpectrumEngine:
    """Spectra of planned parts on a device: see blocks.bands.Engine."""

    def __init__(
        self, planned: PlannedParts, bands: SpectrumBands, options: SpectralEchoOptions, device: Device
    ) -> None:
        self.planned, self.bands, self.folder = planned, bands, folder_of(options.out)
        self.budget = budget_of(device, options.max_bytes)
        self.parts = [part.on_device(device, self.budget) for part in planned.parts]
        self.direct = planned.direct
        if bands.has_direct and device is not planned.task.request.device:
            self.direct = planned.direct_on(device)

    @property
    def least(self) -> float:
        """Microseconds of a block, at least: also so that its rows are worth a file."""
        repeated = max((1e6 * part.repeated_seconds() for part in self.planned.parts), default=0.0)
        row = max(section.cost for section in self.bands.sections)
        worth = min(LEAST_BYTES / (8.0 * self.bands.row_shape[0]) * row, LEAST_MICROSECONDS)
        return max(REPEATED * repeated, worth)

    @property
    def most(self) -> float:
        """Microseconds of a block in memory, at most."""
        row = min(section.cost for section in self.bands.sections)
        return max(1.0, SHARE * self.budget / (8.0 * self.bands.row_shape[0]) * row)

    def blocks(self, nbytes: float) -> list[Run]:
        """See Engine: no block needs more of the device than another."""
        return [(0, self.bands.n_bands)]

    def fill(
        self, first: int, last: int, flat: FlatArray, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> SpectrumTally:
        """See Engine."""
        sections, whole, before = self.bands.parts(first, last), self.bands.count(first, last), 0
        for number in (*range(len(self.parts)), None):
            own = [entry for entry in sections if entry[0].part == number]
            work = sum(section.cost * (b - a) for section, a, b in own)

            def part_done(share: float, before: int = before, work: int = work) -> None:
                on_progress((before + share * work) / whole)

            if own and number is not None:
                self._add_part(number, own, flat, budget, part_done)
                clock.lap(STAGE)
            elif own:
                self._add_directly(*own[0], flat, part_done)
                clock.lap("facets with shadows")
            before += work
        return SpectrumTally()

    def _add_part(
        self,
        number: int,
        sections: list[tuple[Section, int, int]],
        flat: FlatArray,
        budget: float,
        on_progress: Callable[[float], None],
    ) -> None:
        """Spectra of a part at some wavenumbers of some of its maps and polarisations."""
        part = self.planned.parts[number]
        rows = [SpectrumRows(section.polarization, a, b, flat, section.first) for section, a, b in sections]
        maps = [section.map for section, _, _ in sections]
        out = [[one for one, number in zip(rows, maps, strict=True) if number == m] for m in range(len(part.maps))]
        part.add(self.parts[number], self.planned.task.frequencies, out, budget, self.folder, on_progress)

    def _add_directly(
        self, section: Section, first: int, stop: int, flat: FlatArray, on_progress: Callable[[float], None]
    ) -> None:
        """Rows first ... stop - 1 of the echoes of facets that are added pulse by pulse, without the spectrum."""
        assert self.direct is not None
        direct, rows_each = self.direct, len(self.planned.task.request.polarizations)
        shape = rows_each, self.bands.row_shape[0]
        begin, end = first // rows_each, -(-stop // rows_each)
        at_once = max(1, int(self.budget / 8 / (8.0 * np.prod(shape))))

        def progress(_: str, done: int, total: int) -> None:
            on_progress(done / max(total, 1))

        request = replace(direct.scene.request, clock=Clock(), progress=progress)
        channel, pairs = replace(direct, scene=replace(direct.scene, request=request)), 0
        for pulse in range(begin, end, at_once):
            last = min(pulse + at_once, end)
            block = np.zeros((last - pulse, *shape), np.complex64)
            pairs += channel.add(block, range(pulse, last), pairs, len(channel.scene) * (end - begin)).pairs
            own = slice(max(first, pulse * rows_each), min(stop, last * rows_each))
            rows = block.reshape(-1, shape[1])[own.start - pulse * rows_each : own.stop - pulse * rows_each]
            flat[slice(section.first + own.start, section.first + own.stop)] = rows


@dataclass(frozen=True, eq=False)
class SpectrumRecipe:
    """How spectra are computed on a device as they were planned: see blocks.bands.Recipe."""

    planned: PlannedParts
    bands: SpectrumBands
    options: SpectralEchoOptions

    def __getstate__(self) -> dict[str, Any]:
        """For another process: without what belongs to this one."""
        options = replace(self.options.portable(), out=None, resume=None, tile=None)
        return {**self.__dict__, "options": options, "planned": self.planned.portable()}

    def on(self, device: Device) -> SpectrumEngine:
        """The engine on one device."""
        return SpectrumEngine(self.planned, self.bands, self.options, device)

    def budget(self, device: Device) -> float:
        """Bytes that blocks may take on a device."""
        return budget_of(device, self.options.max_bytes)


def spectrum_job(task: SpectralTask, options: SpectralEchoOptions, shape: tuple[int, ...]) -> BlockJob:
    """The job of the spectra of samples of a shape; its bands have no sections yet."""

    def describe() -> dict[str, Any]:
        named = {
            "variant": options.variant,
            "tolerance": options.tolerance,
            "polarization": ", ".join(task.request.polarizations),
            "seed": options.seed,
            "skip": ", ".join(sorted(task.request.skips)),
        }
        subjects = {"scene": task.seen.original, "waveform": task.seen.waveform, "track": task.track}
        return job_description(options, subjects, shape, named)

    return BlockJob(
        kind="phase history",
        stage=STAGE,
        bands=SpectrumBands(shape[-1]),
        unit=1,
        dtype=np.complex64,
        tally=SpectrumTally,
        passes=1,
        describe=describe,
    )
