"""autofocus: phase and range error of every pulse, estimated from the echoes themselves and removed."""

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
from ._aperture_view import ApertureView, Errors, corrected

log = logging.getLogger(__name__)
Progress = Callable[[str, int, int], None]

LEAST_PULSES = 12  # with fewer, the halves of the band may agree by chance
LEAST_SAMPLES = 16  # 8 in each half of the band
AGREE = 0.4  # least closeness of the halves' phases at which they agree; that of noise is smaller
GAIN = 1.005  # least gain in sharpness of a correction, where the halves agree
SURE_GAIN = 1.5  # least gain where they do not agree: noise gains some per cent


@dataclass(frozen=True, eq=False, repr=False)
class PhaseErrors:
    """Errors that `autofocus` estimated: data = true data x exp(j phase) exp(-j 4 pi (f - frequency) range/c), per row.

    phase      rad (n_rows,), at `frequency`, unwrapped
    range      m (n_rows,), excess range of the echo; zeros where no migration of the envelope is seen
    frequency  Hz, centre of the band
    found      False: no correction passed cross-validation; phase and range are zero, and raw is as it was
    gain       gain in sharpness (sum |I|^4) of one half of the band by the phase estimated from the other
    agreement  closeness of the halves' phases: 1 for equal phases, below 0.4 for unrelated ones
    spread     rms difference of the halves' phases, halved, rad: the uncertainty of a pulse's phase before smoothing
    modes      number of cosines over the aperture that `phase` consists of, besides a slope; n_pulses: not smoothed
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
            f"phase {np.std(self.phase):.2f} rad rms of {self.modes} cosines, +-{self.spread:.2f} per pulse; "
            f"range {np.std(self.range):.4g} m rms; {tests}"
        )


class Autofocus(NamedTuple):
    """Result of `autofocus`; unpacks as raw, errors = sarcl.autofocus(raw, grid)."""

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
    """Estimate the phase and range error of each pulse from images on `grid`, and return raw without them.

    raw           PhaseHistory, compressed, of 12 or more pulses and 16 or more samples. Rows of equal time (without
                  times: of equal antenna positions) are one pulse and share its error
    grid          ImageGrid of any kind over some of the brightest parts of the scene, no coarser than the resolution
    range_errors  False: only phases are estimated
    places        largest number of bright points that are used
    max_bytes, device, progress  as for `backproject`, which makes the images

    Returns (raw, errors): the PhaseHistory corrected, lazily where its samples lie in a file, and a PhaseErrors.
    A correction is applied only if it sharpens echoes that it was not estimated from (the other half of the band);
    otherwise raw is returned as it was and errors.found is False. Phases that only shift the image cannot be
    estimated: the mean of the phase, and the least-squares fit of a shift across range, are not corrected.
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
            f"raw has {raw.n_samples} samples per row; autofocus tests one half of the band with the other and needs "
            f"{LEAST_SAMPLES} or more"
        )
    rows = _bright_points.in_pulses(raw)
    energy = _bright_points.energy(raw)
    alive = energy[rows].any(axis=1)
    if alive.sum() < LEAST_PULSES:
        raise ValueError(
            f"raw has {alive.sum()} pulses with any energy, of {len(rows)}; autofocus needs {LEAST_PULSES} or more"
        )
    view = _aperture_view(raw, rows, grid)
    options = {"max_bytes": max_bytes, "device": device}
    view = replace(view, alive=alive, places=places, scale=float(np.sqrt(energy.max())), options=options)
    tick = _ticker(progress, _search.searches(view, bool(range_errors)) + 2)
    errors = _search.search(view, bool(range_errors), tick)
    errors, tests = _cross_validated(view, errors, tick)
    if not tests["found"]:
        log.warning("no correction by autofocus passed cross-validation; the data are unchanged")
        zero = sealed(np.zeros(raw.n_rows))
        return Autofocus(raw, PhaseErrors(zero, zero, view.frequency, **tests))
    phase, shift = np.empty(raw.n_rows), np.empty(raw.n_rows)
    phase[rows], shift[rows] = errors[0][:, None], errors[1][:, None]
    better = corrected(raw, phase, shift, view.frequency)
    if in_memory(raw.samples):
        better = replace(better, samples=sealed(np.asarray(better.samples)))
    return Autofocus(better, PhaseErrors(sealed(phase), sealed(shift), view.frequency, **tests))


def _aperture_view(raw: PhaseHistory, rows: np.ndarray, grid: ImageGrid) -> ApertureView:
    """Pulses in order of time, from rows (n_pulses, n_channels), and geometry; ValueError without an aperture."""
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
            "tx and rx are the same in every pulse; without an aperture there is no cross-range image to focus"
        )
    axes = np.linalg.svd(look, full_matrices=False)[2][:2]
    shift_phase = 2 * np.pi * frequency / SPEED_OF_LIGHT * look @ axes.T
    return ApertureView(ordered, rows.shape[1], grid, frequency, shift_phase, np.ones(len(rows), bool))


def _cross_validated(view: ApertureView, errors: Errors, tick: Callable[[], None]) -> tuple[Errors, dict[str, Any]]:
    """Errors, smoothed as cross-validation asks for, and fields of PhaseErrors that say how well they passed it.

    Each half of the band gives a phase of its own, with the given range errors. It is smoothed to the number of cosines
    that sharpens the other half most. The halves have errors and scene in common, but neither noise nor speckle.
    """
    n, shift, samples = view.n, errors[1], view.raw.n_samples
    zero = np.zeros(n)
    parts = view.band(0, samples // 2), view.band(samples - samples // 2, samples)
    phases, held, before = [], [], []
    for part in parts:
        phase, _ = _search.ascend(part, (zero, shift))
        places = part.probes((phase, shift))
        held.append(part.values((zero, shift), places))
        before.append(part.sharpness((zero, zero), places))
        phases.append(phase)
        tick()

    def gain(i: int, modes: int) -> float:
        """Gain in sharpness of half i by the phase of the other half, registered to half i's own image."""
        other = _phase_smoothing.smooth(phases[1 - i], modes)
        phase, _ = _phase_smoothing.alignment(other, phases[i], view.shift_phase, view.cell / 2)
        return _phase_gradient.sharpness(held[i], phase, parts[i].window) / max(before[i], 1e-300)

    ladder = [2**k for k in range(2, 40) if 2**k < n] + [n]
    gains = np.array([[gain(0, modes), gain(1, modes)] for modes in ladder])
    best = int(gains.prod(axis=1).argmax())
    moved, agreement = _phase_smoothing.alignment(phases[0], phases[1], view.shift_phase, view.cell / 2)
    apart = np.exp(1j * (moved - phases[1]))
    log.debug("gains of %s cosines: %s", ladder, gains.round(3).tolist())

    # the result must sharpen the whole band too: a phase with an error of unwrapping would not
    candidates = [errors[0], phases[0], phases[1]]
    smoothed = [view.shift_removed((_phase_smoothing.smooth(c, ladder[best]), shift)) for c in candidates]
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
    """The function that each search calls when it is done: it reports progress."""
    done = iter(range(1, total + 1))
    if progress:
        progress("autofocus", 0, total)

    def tick() -> None:
        if progress:
            progress("autofocus", next(done), total)

    return tick
