"""Zou et al. 2021, section 4: field at the receiver, I/Q samples and images of a target (figures 5 to 7)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...figures import html
from ...imaging.backproject import backproject
from ...imaging.compress import compress
from ...imaging.range_doppler.range_doppler import range_doppler
from ...model.image import Image
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ..paper import Section
from . import _targets
from ._lab import BOTH, Lab, Levels, radius, report_of
from ._radar import SPEED, Record, received, recorded

SPACING = 0.05  # m, of pixels
AROUND = 1.2  # m beside the target that pictures show
FIELD_RATE = 6e9  # Hz, of the field in figure 5: four times the carrier
FLOOR = -35.0  # dB, of pictures
CHAIN = (
    0.1  # difference allowed between images of samples and of echoes: records cut the ripples before and after pulses
)
RANGE_NAME, AZIMUTH_NAME, LEVEL = "slant range about the origin, m", "azimuth, m", "dB re 1 m²"
DELAY_NAME, SLOW_NAME = "delay after the nearest echo of the origin, ns", "slow time, ms"
LEAST = 1e-7  # of the amplitude in HH that float32 resolves: VH is not below


def section(name: str, lab: Lab) -> Section:
    """A target of figures 5 to 7."""
    target = _targets.find(name)
    out = Section.of("zou", "images", target=target)
    out.key = name
    both = lab.full_wave(name)
    raws = {polarization: both.select(polarization=polarization) for polarization in BOTH}
    for polarization, raw in raws.items():
        field = received(raw, FIELD_RATE, 0.0)
        out.words |= {"polarization": polarization}
        levels_db = _db(np.abs(field.samples))
        out.picture("Envelope of the field at the receiver", levels_db, *_ends(field, raw), floor_db=FLOOR, unit=LEVEL)
    records = {polarization: received(raw) for polarization, raw in raws.items()}
    for part, values in (("I", records["HH"].samples.real), ("Q", records["HH"].samples.imag)):
        out.words |= {"part": part}
        out.picture("Samples", values, *_ends(records["HH"], raws["HH"]), floor_db=-2 * float(values.max()), unit="m")
    view = _View(lab, name)
    chains = {polarization: compress(recorded(records[polarization], raw)) for polarization, raw in raws.items()}
    sampled = {polarization: view.range_doppler(chain) for polarization, chain in chains.items()}
    for polarization, image in sampled.items():
        caption = f"{polarization}, range-Doppler image of the samples (figure 7 {target.letter})."
        out.draw(view.picture(np.abs(np.asarray(image.data)) / image.gain, caption))
    images = {polarization: np.abs(view.backprojected(raw)) for polarization, raw in raws.items()}
    for polarization, pixels in images.items():
        # unlike the chirps of the receiver's field, these pictures differ from target to target: for the page's head
        caption = f"{polarization}, backprojection of the echoes."
        out.draw(view.picture(pixels, caption, chosen=polarization == "HH"))
    optics = lab.optics(name)
    flat = np.abs(view.backprojected(optics))
    out.draw(view.picture(flat, "HH by physical optics (sarcl.echo), backprojection of the echoes."))
    _draw_waves(out, raws["HH"])
    _compare_chain(out, view, name, sampled["HH"], raws["HH"])
    rms = {polarization: float(np.sqrt((np.abs(_samples(raw)) ** 2).mean())) for polarization, raw in raws.items()}
    apart = _samples(raws["HH"]) - _samples(optics)
    levels = Levels(
        (float(images["HH"].max()), float(images["VH"].max())),
        (rms["HH"], rms["VH"]),
        float(flat.max()),
        float(np.sqrt((np.abs(apart) ** 2).mean()) / rms["HH"]),
    )
    lab.levels[name] = levels
    _say(out, levels, both)
    return out


def _draw_waves(out: Section, raw: PhaseHistory) -> None:
    """The field of two pulses, as it oscillates."""
    field = received(raw, FIELD_RATE, 0.0)
    (first, last), _ = _ends(field, raw)
    delay = np.linspace(first, last, field.samples.shape[1])
    rows = (("middle of the track", raw.n_rows // 2), ("beginning", 0))
    out.plot("Field of two pulses at the receiver", [(name, delay, field.samples[row].real) for name, row in rows])


def _say(out: Section, levels: Levels, both: PhaseHistory) -> None:
    """Levels of a target, and how its echoes were computed, in words and for JSON."""
    cross = 20 * np.log10(max(levels.peak[1] / levels.peak[0], LEAST))
    report, grid = report_of(both)
    model = report.model_error
    peak, optics = 20 * np.log10(levels.peak[0]), 20 * np.log10(levels.optics)
    out.words |= {"peak_db": peak, "optics_db": optics, "found": levels, "cross": cross, "model_error": model or 0}
    out.say(grid=grid, cell_mm=1e3 * grid["cell_m"], predicted=report.predicted_error)
    out.keep(
        peak_hh_dbsm=20 * np.log10(levels.peak[0]), cross_over_co_db=cross, rms_hh=levels.rms[0], rms_vh=levels.rms[1],
        peak_hh_optics_dbsm=20 * np.log10(levels.optics), optics_differs=levels.apart, model_error=model,
        forming_error=report.predicted_error, anchors=grid["anchors"],
    )  # fmt: skip


class _View:
    """Images of one target in the plane of track and origin, and pictures of them with the target's outline."""

    def __init__(self, lab: Lab, name: str) -> None:
        self.lab, self.half = lab, radius(lab.scene(name)) + AROUND
        self.outline = _outline(lab, name)
        self.grid = lab.radar.grid((self.half, self.half), SPACING)

    def backprojected(self, raw: PhaseHistory, grid: ImageGrid | None = None) -> np.ndarray:
        """Pixels whose |.|^2 is the radar cross section of a point, m^2."""
        image = backproject(
            raw, self.grid if grid is None else grid, tolerance=1e-2, check=False, device=self.lab.device
        )
        return np.asarray(image.data) / image.gain

    def range_doppler(self, chain: PhaseHistory) -> Image:
        """The range-Doppler image of samples."""
        time, middle = self.half / SPEED, self.lab.radar.range_
        return range_doppler(
            chain,
            side="right",
            times=(-time, time),
            ranges=(middle - self.half, middle + self.half),
            spacing=(SPACING / SPEED, SPACING),
            check=False,
            device=self.lab.device,
        )

    def picture(self, amplitude: np.ndarray, caption: str, chosen: bool = False) -> html.Block:
        """Pixels, m, with the outline; chosen: for the head of the page."""
        ends = -self.half, self.half
        return html.picture(
            _db(amplitude), ends, ends, RANGE_NAME, AZIMUTH_NAME, caption, floor_db=FLOOR, lines=self.outline,
            unit=LEVEL, equal=True, chosen=chosen,
        )  # fmt: skip


def _compare_chain(out: Section, view: _View, name: str, image: Image, raw: PhaseHistory) -> None:
    """The range-Doppler image of the receiver's samples against backprojection of the echoes."""
    exact = view.backprojected(raw, image.grid)
    chain = np.asarray(image.data) / image.gain
    apart = float(np.linalg.norm(chain - exact) / np.linalg.norm(exact))
    out.states("{name}: range-Doppler image of 600 MHz samples", apart, apart < CHAIN, name=name, chain=CHAIN)


def _outline(lab: Lab, name: str) -> list[tuple[str, Any, Any]]:
    """The convex edge of the target as images show it, as a line for pictures: name, slant ranges, azimuths."""
    from scipy.spatial import ConvexHull

    azimuth, slant = lab.radar.seen(lab.scene(name).triangles.reshape(-1, 3)).T
    around = ConvexHull(np.column_stack([slant, azimuth])).vertices
    closed = np.append(around, around[0])
    return [("outline", slant[closed], azimuth[closed])]


def _samples(raw: PhaseHistory) -> np.ndarray:
    return raw.read(0, raw.n_rows)


def _db(amplitude: np.ndarray) -> np.ndarray:
    return np.asarray(20 * np.log10(np.maximum(amplitude, max(1e-6 * amplitude.max(), 1e-30))))


def _ends(record: Record, raw: PhaseHistory) -> tuple[tuple[float, float], tuple[float, float]]:
    """Edges of a picture of samples: delay, ns, and slow time, ms."""
    delay = 1e9 * (record.times - 2 * raw.reference_range.min() / SPEED_OF_LIGHT)
    assert raw.time is not None
    return (float(delay[0]), float(delay[-1])), (1e3 * float(raw.time[0]), 1e3 * float(raw.time[-1]))
