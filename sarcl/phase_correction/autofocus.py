"""autofocus: what phase and range every pulse is off, found from the echoes themselves, and taken out."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.constants import SPEED_OF_LIGHT
from ..base.validation import count, instance, sealed
from ..model.image_grid import ImageGrid
from ..model.lazy_rows import in_memory
from ..model.phase_history import PhaseHistory
from ..opencl.device import DeviceChoice
from . import _bright_points, _phase_gradient, _phase_smoothing, _search
from ._aperture_view import Errors, View, corrected

log = logging.getLogger(__name__)
Progress = Callable[[str, int, int], None]

LEAST_PULSES = 12  # fewer agree by chance
LEAST_SAMPLES = 16  # two halves of the band, of 8
GAIN = 1.005  # in sharpness below which nothing was found, where the halves of the band agree on the phase
AGREE = 0.4  # least closeness of the halves' phases; noise stays below
SURE_GAIN = 1.5  # and where they do not: noise gains some per cent


@dataclass(frozen=True, eq=False, repr=False)
class PhaseErrors:
    """What `autofocus` found: data = true data x exp(j phase) exp(-j 4 pi (f - frequency) range/c), row by row.

    phase      rad (n_rows,), at `frequency`, unwrapped
    range      m (n_rows,): how much too far the echo lies; zeros where no walk of the envelope shows
    frequency  Hz, the middle of the band
    found      False: nothing holds for echoes that did not take part; phase and range are zero, raw as it was
    gain       in sharpness (sum |I|^4) of one half of the band by the phase found in the other
    agreement  closeness of the halves' phases: 1 for equal ones, below 0.4 for none in common
    spread     rms difference of the halves' phases, halved, rad: the uncertainty of a pulse's phase before smoothing
    modes      cosines over the aperture that `phase` is made of, beside a slope; n_pulses: not smoothed
    """

    phase: NDArray[np.float64]
    range: NDArray[np.float64]
    frequency: float
    found: bool
    gain: float
    agreement: float
    spread: float
    modes: int

    def __repr__(self) -> str:
        return f"PhaseErrors({self})"

    def __str__(self) -> str:
        tests = f"sharpness x {self.gain:.3f} in the other half of the band, halves agree to {self.agreement:.2f}"
        if not self.found:
            return f"no error found: {tests}"
        return (
            f"phase {np.std(self.phase):.2f} rad rms of {self.modes} cosines, +-{self.spread:.2f} a pulse; "
            f"range {np.std(self.range):.4g} m rms; {tests}"
        )


class Autofocus(NamedTuple):
    """What `autofocus` returns; unpacks as raw, errors = sarcl.autofocus(raw, grid)."""

    raw: PhaseHistory
    errors: PhaseErrors


def autofocus(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    range_errors: bool = True,
    places: int = 200,
    max_bytes: float | None = None,
    device: DeviceChoice | Sequence[DeviceChoice] | None = None,
    progress: Progress | None = None,
) -> Autofocus:
    """Find each pulse's phase and range error from the image on `grid`, and return raw without them.

    raw           PhaseHistory, compressed, of 12 pulses and 16 samples or more. Rows of one time (without times:
                  of equal antenna positions) are one pulse and share its error
    grid          ImageGrid of any kind over some of the brightest parts of the scene, no coarser than the resolution
    range_errors  False: phases alone
    places        bright places that are used, at most
    max_bytes, device, progress  as for `backproject`, which makes the images

    Returns (raw, errors): the PhaseHistory corrected, lazily where its samples lie in a file, and a PhaseErrors.
    An error is taken out only if it sharpens echoes that it was not found from (the other half of the band);
    else raw comes back as it was and errors.found is False. What shifts the image is not seen: the mean, and the
    least-squares fit of a shift across range, of the phase are left alone.
    TypeError, ValueError: arguments of the wrong kind; too few pulses; pulses that lack a channel others have; data
    not compressed; an image that is zero. Sources: _phase_gradient.py; docs/theory/autofocus.md.
    """
    instance("raw", raw, PhaseHistory)
    instance("grid", grid, ImageGrid)
    if not isinstance(range_errors, (bool, np.bool_)):
        raise TypeError(f"range_errors is {range_errors!r}; wanted True or False")
    if not raw.compressed:
        raise ValueError("raw is not compressed: its pulses still have their own spectrum; call sarcl.compress(raw)")
    places = count("places", places, 2)
    if raw.n_samples < LEAST_SAMPLES:
        raise ValueError(
            f"raw has {raw.n_samples} samples a row; autofocus tests one half of the band with the other and needs "
            f"{LEAST_SAMPLES} or more"
        )
    rows = _bright_points.in_pulses(raw)
    energy = _bright_points.energy(raw)
    alive = energy[rows].any(axis=1)
    if alive.sum() < LEAST_PULSES:
        raise ValueError(
            f"raw has {alive.sum()} pulses that hold anything, of {len(rows)}; autofocus needs {LEAST_PULSES} or more"
        )
    view = _view(raw, rows, grid)
    options = {"max_bytes": max_bytes, "device": device}
    view = replace(view, alive=alive, places=places, scale=float(np.sqrt(energy.max())), options=options)
    tick = _ticker(progress, _search.searches(view, bool(range_errors)) + 2)
    errors = _search.search(view, bool(range_errors), tick)
    errors, tests = _proved(view, errors, tick)
    if not tests["found"]:
        log.warning("autofocus found no error that holds for echoes it was not found from; the data are as they were")
        zero = sealed(np.zeros(raw.n_rows))
        return Autofocus(raw, PhaseErrors(zero, zero, view.frequency, **tests))
    phase, shift = np.empty(raw.n_rows), np.empty(raw.n_rows)
    phase[rows], shift[rows] = errors[0][:, None], errors[1][:, None]
    better = corrected(raw, phase, shift, view.frequency)
    if in_memory(raw.samples):
        better = replace(better, samples=sealed(np.asarray(better.samples)))
    return Autofocus(better, PhaseErrors(sealed(phase), sealed(shift), view.frequency, **tests))


def _view(raw: PhaseHistory, rows: np.ndarray, grid: ImageGrid) -> View:
    """Pulses in order, (n_pulses, n_channels) rows, with the geometry; ValueError where there is no aperture."""
    order = rows.ravel()
    ordered = raw if np.array_equal(order, np.arange(raw.n_rows)) else raw[order]
    frequency = float(np.median(raw.center_frequency))
    first, middle = rows[:, 0], grid.bounds.mean(axis=0)
    look = np.zeros((len(rows), 3))
    for ends in (raw.tx[first], raw.rx[first]):
        away = ends - middle
        look += away / np.maximum(np.linalg.norm(away, axis=1), 1e-300)[:, None]
    look -= look.mean(axis=0)
    if grid.x_axis is not None and grid.y_axis is not None:
        look = look @ np.stack([grid.x_axis, grid.y_axis], axis=1)
    if np.linalg.norm(look) < 1e-9:
        raise ValueError(
            "tx and rx are the same in every pulse; without an aperture there is no image across range to focus"
        )
    axes = np.linalg.svd(look, full_matrices=False)[2][:2]
    along = 2 * np.pi * frequency / SPEED_OF_LIGHT * look @ axes.T
    return View(ordered, rows.shape[1], grid, frequency, along, np.ones(len(rows), bool))


def _proved(view: View, errors: Errors, tick: Callable[[], None]) -> tuple[Errors, dict[str, Any]]:
    """The errors, smoothed as far as data that took no part ask for, and how they stood the test.

    Each half of the band finds its own phase, with the range error given. How many cosines of it sharpen the
    other half most is how many are kept. The halves share the errors and the scene, but neither noise nor speckle.
    """
    n, shift, samples = view.n, errors[1], view.raw.n_samples
    zero = np.zeros(n)
    parts = view.band(0, samples // 2), view.band(samples - samples // 2, samples)
    phases, held, before = [], [], []
    for part in parts:
        phase, _ = _search.climb(part, (zero, shift))
        places = part.probes((phase, shift))
        held.append(part.values((zero, shift), places))
        before.append(part.sharpness((zero, zero), places))
        phases.append(phase)
        tick()

    def gain(i: int, modes: int) -> float:
        """Of half i, by the other half's phase, moved to where half i's own image lies."""
        other = _phase_smoothing.smooth(phases[1 - i], modes)
        phase, _ = _phase_smoothing.alignment(other, phases[i], view.along, view.cell / 2)
        return _phase_gradient.sharpness(held[i], phase, parts[i].window) / max(before[i], 1e-300)

    ladder = [2**k for k in range(2, 40) if 2**k < n] + [n]
    gains = np.array([[gain(0, modes), gain(1, modes)] for modes in ladder])
    best = int(gains.prod(axis=1).argmax())
    moved, agreement = _phase_smoothing.alignment(phases[0], phases[1], view.along, view.cell / 2)
    apart = np.exp(1j * (moved - phases[1]))
    log.debug("gains of %s cosines: %s", ladder, gains.round(3).tolist())

    # what is handed out must sharpen all of the band too: a slip in unwrapping would not
    candidates = [errors[0], phases[0], phases[1]]
    smoothed = [view.unmoved((_phase_smoothing.smooth(c, ladder[best]), shift)) for c in candidates]
    places = view.probes((zero, zero), smoothed[0])
    levels = [view.sharpness(e, places) for e in smoothed]
    least = min(*gains[best], max(levels) / max(view.sharpness((zero, zero), places), 1e-300))
    agree = agreement > max(AGREE, _phase_smoothing.chance(n))
    return smoothed[int(np.argmax(levels))], {
        "found": bool(least > (GAIN if agree else SURE_GAIN)),
        "gain": float(np.sqrt(gains[best].prod())),
        "agreement": agreement,
        "spread": float(np.std(np.angle(apart * apart.sum().conj())) / 2),
        "modes": ladder[best],
    }


def _ticker(progress: Progress | None, total: int) -> Callable[[], None]:
    """What each search calls when it is done."""
    done = iter(range(1, total + 1))
    if progress:
        progress("autofocus", 0, total)

    def tick() -> None:
        if progress:
            progress("autofocus", next(done), total)

    return tick
