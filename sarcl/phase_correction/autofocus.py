"""autofocus: phase and range error of every pulse, estimated from the echoes themselves and removed."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import arguments
from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import warn
from ..base.validation import count, instance, sealed
from ..imaging.antenna_beam import is_antenna
from ..imaging.focusing_task import BeamCone, beam_of, make_task, weigh
from ..imaging.unseen_pixels import unseen_pixels
from ..model.image_grid import ImageGrid
from ..model.lazy_rows import Tapered, in_memory
from ..model.phase_history import PhaseHistory
from ..numerics.windows import Window
from ..opencl.device import DeviceChoice
from . import _bright_points, _hold_out, _search
from ._aperture_view import ApertureView, corrected

log = logging.getLogger(__name__)
Progress = Callable[[str, int, int], None]

LEAST_PULSES = 12  # with fewer, the halves of the band may agree by chance
LEAST_SAMPLES = 16  # 8 in each half of the band


@dataclass(frozen=True, eq=False, repr=False)
class PhaseErrors:
    """Errors that `autofocus` estimated: data = true data x exp(j phase) exp(-j 4 pi (f - frequency) range/c), per row.

    phase      rad (n_rows,), at `frequency`, unwrapped
    range      m (n_rows,), excess range of the echo; zeros where no migration of the envelope is seen
    frequency  Hz, centre of the band
    found      False: no correction passed cross-validation; phase and range are zero, and raw is as it was
    gain       gain in sharpness (sum |I|^4) of one half of the band by the phase estimated from the other
    agreement  closeness of the halves' phases, smoothed as `phase` is: 1 for equal, below 0.4 for unrelated ones
    spread     rms difference of the halves' phases, halved, rad: the uncertainty of a pulse's phase before smoothing
    modes      number of cosines over the aperture that `phase` consists of, besides a slope; n_pulses: not smoothed
    reason     in words why nothing was applied, and what to do about it; empty where found is True
    places     m (k, 3), the brightest points of the image with the correction, applied or not: ten at most
    displacements  m (k,), by how much the correction, applied or not, moves each of them across range, positive
               towards where the antennas move: the slope of the phase over the pulses that see the place
    """

    phase: NDArray[np.float64]
    range: NDArray[np.float64]
    frequency: float
    found: bool
    gain: float
    agreement: float
    spread: float
    modes: int
    reason: str = ""
    places: NDArray[np.float64] = field(default_factory=lambda: sealed(np.zeros((0, 3))))
    displacements: NDArray[np.float64] = field(default_factory=lambda: sealed(np.zeros(0)))

    def __repr__(self) -> str:
        return f"PhaseErrors({self})"

    def __str__(self) -> str:
        tests = f"sharpness x {self.gain:.3f} in the other half of the band, halves agree to {self.agreement:.2f}"
        if not self.found:
            return f"no error found: {self.reason} ({tests})"
        apart = float(np.ptp(self.displacements)) if len(self.displacements) else 0.0
        return (
            f"phase {np.std(self.phase):.2f} rad rms of {self.modes} cosines, +-{self.spread:.2f} per pulse; "
            f"range {np.std(self.range):.4g} m rms; {tests}; "
            f"bright places move by up to {apart:.2g} m against one another"
        )


class Autofocus(NamedTuple):
    """Result of `autofocus`; unpacks as raw, errors = sarcl.autofocus(raw, grid)."""

    raw: PhaseHistory
    errors: PhaseErrors


def autofocus(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    beam: BeamCone | None = None,
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
    window, weights, beam  as for `backproject`: the images that the estimate is made from are weighted so, and every
                  row contributes in its beam alone. A cone of the beam, not an Antenna. raw comes back without weights
    range_errors  False: only phases are estimated
    places        largest number of bright points that are used
    max_bytes, device, progress  as for `backproject`, which makes the images

    Returns (raw, errors): the PhaseHistory corrected, lazily where its samples lie in a file, and a PhaseErrors.
    A correction is applied only if it sharpens echoes that it was not estimated from: the other half of the band, the
    places at other ranges where there are bright ones; if no bright point is lost; and if bright places stay within
    half a resolution cell of where they were against one another, or the echoes show for certain where they belong.
    Otherwise raw is returned as it was, errors.found is False, and errors.reason says why and what to do. Phases that
    only shift the image cannot be estimated: the mean of the phase, and the least-squares fit of a shift across range,
    are not corrected.
    TypeError, ValueError: arguments of the wrong kind; too few pulses; pulses that lack a channel others have; data
    not compressed; an image that is zero. SarclWarning: 1 % of the pixels or more lie outside the range window of
    every row. Sources: _phase_gradient.py; docs/theory/autofocus.md.

    >>> from dataclasses import replace
    >>> errors = np.cumsum(np.random.default_rng(1).normal(0, 0.3, raw.n_rows))  # rad, one per pulse
    >>> blurred = replace(raw, samples=raw.samples * np.exp(1j * errors)[:, None])
    >>> sharp, estimate = sarcl.autofocus(blurred, grid)
    >>> bool(estimate.found)
    True
    """
    instance("raw", raw, PhaseHistory)
    instance("grid", grid, ImageGrid)
    arguments.progress(progress)
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
    sample_weight, row_weight = weigh(raw, window, weights)
    if is_antenna(beam):
        raise TypeError("beam is an Antenna; autofocus takes the cone that the antenna sees: (angle, direction), rad")
    toward, angle = beam_of(raw, beam, grid.bounds.mean(axis=0) if grid.center is None else grid.center)
    weighted = raw if window is None and weights is None else replace(raw, weight=row_weight)
    if window is not None:
        weighted = replace(weighted, samples=Tapered(raw.samples, sample_weight))
    view = replace(
        _aperture_view(weighted, rows, grid),
        places=places,
        beam=None if toward is None else (angle, toward[rows.ravel()]),
        options={"max_bytes": max_bytes, "device": device},
    )
    tick = _ticker(progress, _search.searches(view, bool(range_errors)) + 2)
    errors = _search.search(view, bool(range_errors), tick)
    unseen = unseen_pixels(make_task(weighted, grid, None, None, False, True, beam, True))
    if unseen and unseen.warning(wraps=False):
        warn(unseen.warning(wraps=False))
    errors, tests = _hold_out.cross_validated(view, errors, tick)
    if not tests["found"]:
        log.warning("no correction by autofocus passed cross-validation; the data are unchanged: %s", tests["reason"])
        zero = sealed(np.zeros(raw.n_rows))
        return Autofocus(raw, PhaseErrors(zero, zero, view.frequency, **tests))
    phase, shift = np.empty(raw.n_rows), np.empty(raw.n_rows)
    phase[rows], shift[rows] = errors[0][:, None], errors[1][:, None]
    better = corrected(raw, phase, shift, view.frequency)
    if in_memory(raw.samples):
        better = replace(better, samples=sealed(np.asarray(better.samples)))
    return Autofocus(better, PhaseErrors(sealed(phase), sealed(shift), view.frequency, **tests))


def _aperture_view(raw: PhaseHistory, rows: np.ndarray, grid: ImageGrid) -> ApertureView:
    """Pulses in order of time, from rows (n_pulses, n_channels), and geometry.

    ValueError without an aperture, or without enough pulses that have energy.
    """
    energy = _bright_points.energy(raw)
    alive = energy[rows].any(axis=1)
    if alive.sum() < LEAST_PULSES:
        raise ValueError(
            f"raw has {alive.sum()} pulses with any energy, of {len(rows)}; autofocus needs {LEAST_PULSES} or more"
        )
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
        raise ValueError("tx and rx are the same in every pulse: without an aperture nothing is focused across range")
    axes = np.linalg.svd(look, full_matrices=False)[2][:2]
    shift_phase = 2 * np.pi * frequency / SPEED_OF_LIGHT * look @ axes.T
    scale = float(np.sqrt(energy.max()))
    return ApertureView(ordered, rows.shape[1], grid, frequency, shift_phase, alive, scale=scale)


def _ticker(progress: Progress | None, total: int) -> Callable[[], None]:
    """The function that each search calls when it is done: it reports progress."""
    done = iter(range(1, total + 1))
    if progress:
        progress("autofocus", 0, total)

    def tick() -> None:
        if progress:
            progress("autofocus", next(done), total)

    return tick
