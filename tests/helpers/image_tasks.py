"""Random legal tasks of images: backprojection by every method, other focusing, and what is done with images."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl.imaging.backproject import EDGE
from sarcl.imaging.focusing_task import beam_of, weigh
from sarcl.reference.backproject import backproject as exact_image
from sarcl.reference.image import multilook as exact_multilook
from sarcl.reference.polar_format import polar_format as exact_polar_format

from . import task_inputs as inputs
from .tasks import Draw, expect, finite, near, within_report

SOME = 40  # pixels that are computed again


def judged_image(draw: Draw, image: Any, raw: Any, options: dict[str, Any], allowed: float) -> None:
    """Compare some pixels with the exact sum."""
    finite(image.data, "image")
    finite(image.gain, "gain")
    index, where = image.grid.sample(SOME, seed=draw.seed % 1000)
    across, rows = weigh(raw, options.get("window"), options.get("weights"))
    center = image.grid.bounds.mean(axis=0) if image.grid.center is None else image.grid.center
    toward, angle = beam_of(raw, options.get("beam"), center)
    beam = None if toward is None else (angle, toward)
    wanted, spread = exact_image(raw, where, across, rows, options.get("wrap", False), beam, EDGE)
    clear = np.isfinite(wanted)
    scale = max(float(np.linalg.norm(wanted[clear])), spread)
    near(np.asarray(image.data)[index][clear], wanted[clear], allowed, scale, "image")


def options_of(draw: Draw, raw: Any) -> dict[str, Any]:
    """Options of `backproject` and `plan` for these echoes."""
    made: dict[str, Any] = {"window": inputs.window(draw, raw.n_samples)}
    if draw.chance(0.2):
        made["weights"] = draw.random.random(raw.n_rows) * draw.log(1e-6, 1e6)
    if draw.chance(0.3):
        made["wrap"] = True
    if draw.chance(0.3):
        made["skip"] = draw.pick(False, {"range window"}, {"beam", "zero weight"}, {"no data"})
    if draw.chance(0.3):
        made["max_bytes"] = draw.log(8e5, 1e9)
    if draw.chance(0.3):
        angle = draw.log(1e-3, 6.2)
        made["beam"] = draw.pick(angle, (angle, draw.normal(3)), (angle, draw.normal(raw.n_rows, 3)))
    if draw.chance(0.4):
        made["method"] = draw.pick("direct", "direct", "factorized")
    return made


def made_elsewhere(draw: Draw, image: Any, raw: Any, grid: Any, options: dict[str, Any]) -> None:
    """The same image in a file, an array or by pieces, to the last bit."""
    how = draw.pick("file", "array", "tiles")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.h5"
        if how == "file":
            again = sarcl.backproject(raw, grid, out=path, **options)
        elif how == "array":
            again = sarcl.backproject(raw, grid, out=np.empty(grid.shape, np.asarray(image.data).dtype), **options)
        else:
            for i in range(1, 4):
                again = sarcl.backproject(raw, grid, out=path, tile=(i, 3), **options)
        expect(np.array_equal(np.asarray(again), np.asarray(image)), f"the image differs in {how}")


def backproject(draw: Draw) -> None:
    center = inputs.origin(draw)
    raw = inputs.history(draw, draw.whole(1, 40), draw.whole(1, 300), center)
    grid = inputs.grid(draw, center, inputs.extent(draw, raw))
    options = {**options_of(draw, raw), "tolerance": inputs.tolerance(draw, 1e-9), "device": inputs.device(draw)}
    taper = "beam" in options and options["window"] is not None  # each pixel has weights of its own: by check=True
    image = sarcl.backproject(raw, grid, check=taper, **options)
    within_report(image, options["tolerance"])
    if not taper:
        judged_image(draw, image, raw, options, options["tolerance"])
    if draw.chance(0.05):
        made_elsewhere(draw, image, raw, grid, {**options, "check": False})


def smooth(draw: Draw) -> None:
    """Many pulses close together: sub-apertures are used."""
    raw = inputs.history(draw, 2 ** draw.whole(5, 8), draw.whole(8, 64), np.zeros(3))
    tx = np.linspace([-700, -3, 700], [-700, 3, 700], raw.n_rows) * draw.log(0.1, 1e3)
    raw = replace(raw, tx=tx, rx=tx, reference_range=np.linalg.norm(tx, axis=1))
    grid = inputs.grid(draw, np.zeros(3), inputs.extent(draw, raw))
    options = {"method": "factorized", "tolerance": inputs.tolerance(draw, 1e-5), "device": inputs.device(draw)}
    image = sarcl.backproject(raw, grid, check=False, **options)
    within_report(image, options["tolerance"])
    judged_image(draw, image, raw, options, options["tolerance"])


def antenna_beam(draw: Draw) -> None:
    raw = inputs.history(draw, draw.whole(1, 20), draw.whole(1, 64), np.zeros(3))
    antenna = inputs.antenna(draw)
    beam = draw.pick(antenna, (antenna, np.mean(-raw.tx, axis=0) + draw.normal(3) * np.abs(raw.tx).max() * 0.1))
    grid = inputs.grid(draw, np.zeros(3), inputs.extent(draw, raw))
    allowed = inputs.tolerance(draw, 1e-6)
    image = sarcl.backproject(
        raw, grid, beam=beam, tolerance=allowed, check=True, device=inputs.device(draw), wrap=draw.chance(0.3),
        window=inputs.window(draw, raw.n_samples),
    )  # fmt: skip
    within_report(image, allowed)
    finite(image.data)
    finite(image.gain, "gain")


def plan(draw: Draw) -> None:
    """A forecast is refused where the image is, and predicts an error within the tolerance."""
    raw = inputs.history(draw, draw.whole(1, 20), draw.whole(1, 100), np.zeros(3))
    grid = inputs.grid(draw, np.zeros(3), inputs.extent(draw, raw))
    options = {**options_of(draw, raw), "tolerance": inputs.tolerance(draw)}
    said = made = None
    try:
        forecast = sarcl.plan(raw, grid, **options)
        expect(forecast.seconds >= 0 and np.isfinite(forecast.seconds), f"seconds {forecast.seconds}")
        str(forecast)
    except sarcl.ToleranceUnreachable as exc:
        said = exc
    try:
        sarcl.backproject(raw, grid, check=False, **options)
    except sarcl.ToleranceUnreachable as exc:
        made = exc
    expect(str(said) == str(made), f"plan: {said}; backproject: {made}")
    if said is not None:
        raise said


def polar_format(draw: Draw) -> None:
    center = inputs.origin(draw)
    raw = inputs.history(draw, draw.pick(1, *[draw.whole(2, 40)] * 9), draw.whole(1, 200), center)
    grid = inputs.plane(draw, center, inputs.extent(draw, raw), most=1500)
    allowed, window = inputs.tolerance(draw, 1e-6), inputs.window(draw, raw.n_samples)
    weights = draw.random.random(raw.n_rows) if draw.chance(0.2) else None
    image = sarcl.polar_format(
        raw, grid, tolerance=allowed, window=window, weights=weights, check=draw.chance(0.2), device=inputs.device(draw)
    )
    finite(image.data, "image")
    within_report(image, allowed)
    index, where = image.grid.sample(SOME, seed=1)
    wanted, spread = exact_polar_format(raw, where, grid.at(grid.shape[0] // 2, grid.shape[1] // 2),
                                        *weigh(raw, window, weights))  # fmt: skip
    near(image.data[index], wanted, allowed, max(float(np.linalg.norm(wanted)), spread), "image")


def range_doppler(draw: Draw) -> None:
    """A straight strip map; the image against the exact sum with the beam's tapers, by check=True."""
    away, center = draw.log(200, 1e6), draw.log(1e8, 3e10)
    n, n_samples = draw.whole(7, 64), draw.whole(4, 64)
    wavelength = inputs.C / center
    step = wavelength * draw.log(0.05, 3)
    speed = draw.log(1, 8e3)
    y = (np.arange(n) - n / 2) * step
    tx = np.stack([np.full(n, -0.7 * away), y, np.full(n, 0.7 * away)], axis=1)
    bandwidth = center * draw.log(1e-3, 0.2)
    raw = sarcl.PhaseHistory(
        draw.noise(n, n_samples).astype(np.complex64), frequency=center - bandwidth / 2,
        frequency_step=bandwidth / n_samples, tx=tx, reference_range=np.linalg.norm(tx, axis=1)[n // 2],
        time=y / speed,
    )  # fmt: skip
    options: dict[str, Any] = {"window": inputs.window(draw, n_samples)} if draw.chance(0.5) else {}
    if draw.chance(0.4):
        options["azimuth_beam"] = draw.log(1e-3, 0.5)
    if draw.chance(0.2):
        options["doppler"] = draw.pick("data", draw.normal() * speed / wavelength)
    allowed = inputs.tolerance(draw, 1e-6)
    image = sarcl.range_doppler(
        raw, side=draw.pick("left", "right"), heights=draw.pick(0.0, draw.normal() * 10), tolerance=allowed, check=True,
        device=inputs.device(draw), **options,
    )  # fmt: skip
    finite(image.data, "image")
    within_report(image, allowed)


def autofocus(draw: Draw) -> None:
    """Noise has nothing to focus: the data come back as they were; else corrected by the errors found."""
    n, n_samples = draw.whole(2, 40), draw.whole(4, 64)
    raw = inputs.history(draw, n, n_samples, np.zeros(3), time=np.arange(n) * 1e-3)
    size = 20 * inputs.C / (2 * float(raw.frequency_step.max()) * n_samples)
    grid = sarcl.ImageGrid.plane(shape=(draw.whole(4, 32), draw.whole(4, 32)), spacing=size / 32)
    found, errors = sarcl.autofocus(raw, grid, window=inputs.window(draw, n_samples), places=draw.whole(1, 50))
    finite(errors.phase, "phase")
    finite(errors.range, "range")
    finite(found.samples, "samples")
    if not errors.found:
        expect(len(errors.reason) > 20, "no reason")
        near(np.asarray(found.samples), np.asarray(raw.samples), 0.0)


def measure(draw: Draw) -> None:
    """The response of a point, where it is."""
    n = draw.whole(8, 40)
    center, away = draw.log(1e8, 1e11), draw.log(10, 1e6)
    bandwidth = center * draw.log(0.01, 0.5)
    cell = inputs.C / (2 * bandwidth)
    arc = min(1.0, inputs.C / center / (2 * cell) * draw.log(0.2, 5))
    angle = arc * np.linspace(-0.5, 0.5, n)
    tx = away * np.stack([-0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(n, 0.7)], axis=1)
    n_samples = draw.whole(16, 64)
    raw = sarcl.PhaseHistory(
        np.ones((n, n_samples), np.complex64), frequency=center - bandwidth / 2, frequency_step=bandwidth / n_samples,
        tx=tx, reference_range=np.linalg.norm(tx, axis=1),
    )  # fmt: skip
    shape = (draw.pick(1, *[int(draw.uniform(20, 90))] * 9), draw.pick(2, *[int(draw.uniform(20, 90))] * 9))
    across = inputs.C / center / (2 * arc) * draw.uniform(0.2, 1.0)
    grid = sarcl.ImageGrid.plane(shape=shape, spacing=(across, cell * draw.uniform(0.2, 1.0)))
    image = sarcl.backproject(raw, grid, check=False)
    found = sarcl.measure(image, near=draw.pick(None, (0, 0, 0)))
    finite([*found.irw, *found.pslr, *found.islr, abs(found.peak)], "response")
    expect(np.linalg.norm(found.position) < max(grid.spacing), f"the point is at {found.position}")
    near([abs(found.peak / found.gain)], [1.0], 0.02, what="peak")


def looks(draw: Draw) -> None:
    """Multilooking, pictures and files of any image."""
    shape = (draw.whole(1, 60), draw.whole(1, 60))
    grid = sarcl.ImageGrid.plane(shape=shape, spacing=draw.log(1e-9, 1e9), center=inputs.origin(draw))
    data = (draw.noise(*shape) * draw.log(1e-15, 1e15) * (draw.random.random(shape) < 0.9)).astype(np.complex64)
    gain = draw.pick(1.0, draw.log(1e-9, 1e9), draw.random.random(shape) + 0.1)
    image = sarcl.Image(data, grid, gain, frequency=draw.pick(None, 1e9), tx=draw.pick(None, draw.normal(3)))
    a, b = (draw.whole(1, min(n, 8)) for n in shape)
    near(image.multilook((a, b)).data, exact_multilook(data, (a, b)), 1e-5, what="multilook")
    near(image.normalized(), data / gain, 1e-5, what="normalized")
    expect(not np.isnan(image.decibels()).any(), "decibels are NaN")
    if draw.chance(0.3):
        image.show(draw.uniform(-90, -1), **draw.pick({}, {"percentile": draw.uniform(1, 100)}, {"top_db": 3.0}))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.h5"
        image.save(path)
        found = sarcl.read(path)
        near(np.asarray(found.data), data, 0.0, what="image in a file")
        expect(np.array_equal(found.gain, image.gain) and found.grid.shape == grid.shape, "fields of the file")


VERBS = {
    "backproject": (240, backproject), "sub-apertures": (20, smooth), "antenna beam": (40, antenna_beam),
    "plan": (20, plan), "polar_format": (80, polar_format), "range_doppler": (16, range_doppler),
    "autofocus": (12, autofocus), "measure": (40, measure), "looks": (40, looks),
}  # fmt: skip
