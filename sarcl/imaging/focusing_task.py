"""The image to be made, prepared once: its rows, their weights and their geometry."""

from __future__ import annotations

import functools
from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import groups
from ..base.validation import array, converted, finite, number
from ..base.vectors import unit
from ..model.antenna import Antenna
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..model.trajectory import Trajectory
from ..numerics import windows
from ..numerics.plan import skips as known_skips
from ..numerics.pulse_geometry import UNLIMITED, PulseGeometry
from ..numerics.range_profiles import LARGEST
from ..numerics.windows import Window
from ..scattering.antenna_weights import AntennaWeights
from .antenna_beam import antenna_of, is_antenna, picked

Skip = Literal["range window", "beam", "zero weight", "no data"]
# full angle, rad, and direction of the axis; or an antenna, and its direction or attitude
BeamCone = float | tuple[float, ArrayLike] | Antenna | tuple[Antenna, ArrayLike | Trajectory]
SKIPS = ("range window", "beam", "zero weight", "no data")
BEAM_EDGE = 1e-5  # rad: pixels so near the edge of a beam may count as inside or outside


@dataclass(frozen=True, eq=False)
class FocusingTask:
    """One image to be made, whatever the method and the device.

    raw            its rows, without those of weight 0 where these are skipped
    grid           ImageGrid; where empty cells are not skipped, they have positions and do not count as empty
    antennas       geometry of the rows, their range windows and beams
    sample_weight  (n_samples,) and row_weight (n_rows,), float64: window, raw.weight and `weights` together
    wrap           profiles repeat beyond the range window
    skips          reasons to leave out pairs
    taper          window over the aperture of each pixel, as windows.table makes it, which is not in row_weight; None:
                   the same weights in all pixels.  places  of the rows along the aperture (n_rows,), where there is one
    antenna        gains that weigh the rows in each pixel, or None
    """

    raw: PhaseHistory
    grid: ImageGrid
    antennas: PulseGeometry
    sample_weight: np.ndarray
    row_weight: np.ndarray
    wrap: bool
    skips: frozenset[str]
    taper: np.ndarray | None = None
    places: np.ndarray | None = None
    antenna: AntennaWeights | None = None

    @property
    def weighs_pixels(self) -> bool:
        """Whether a row has another weight in each pixel."""
        return self.taper is not None or self.antenna is not None

    def resolves_beam(self, radius: float) -> bool:
        """Whether float32 tells on which side of a beam's edge the pixels of a tile of so many m lie, to BEAM_EDGE rad.

        (x - T).b - |x - T| cos alpha is computed by differences from the tile's middle: a gradient, which is at most
        sin alpha and the angle that the tile's radius takes up, times the radius, and a curvature. Both are rounded by
        6e-8, independently of each other. Where antennas are among the pixels, this is so for pixels farther from them
        than the radius.
        """
        if self.antennas.beam is None:
            return True
        distance = self.antennas.distance(self.grid.bounds) or radius
        sine, angle = float(np.sin(self.antennas.beam_angle / 2)), radius / distance if distance else 0.0
        off = 6e-8 * radius * float(np.hypot(min(sine + angle, 2.0), min(angle, 2.0)))
        return bool(off <= BEAM_EDGE * distance * max(sine, BEAM_EDGE))

    @functools.cached_property
    def highest(self) -> float:
        """Upper bound of the frequencies, Hz."""
        return float((self.raw.frequency + self.raw.n_samples * self.raw.frequency_step).max())

    @functools.cached_property
    def bandwidth(self) -> float:
        """Largest bandwidth of a row, Hz."""
        return float(self.raw.bandwidth.max())

    @property
    def skip_flags(self) -> int:
        """SKIP_WINDOW and SKIP_BEAM of the kernels."""
        return int("range window" in self.skips) + 2 * int("beam" in self.skips)

    @property
    def pairs(self) -> int:
        """Number of (row, pixel) pairs of these rows."""
        return self.raw.n_rows * self.grid.size


def beam_of(raw: PhaseHistory, beam: object, center: np.ndarray) -> tuple[np.ndarray | None, float]:
    """Unit directions (n_rows, 3), or None where every point is seen, and full angle, rad, of `beam`.

    beam    None, an angle about the line from the transmitter to `center`, m (3,), or (angle, direction)
    ValueError: an angle that is not in (0, 2 pi], a direction of another shape, zero or not finite.
    """
    if beam is None:
        return None, 2 * np.pi
    parts = beam if isinstance(beam, (tuple, list)) else None
    if parts is not None and len(parts) != 2:
        raise ValueError(f"beam has {len(parts)} parts; give an angle in rad, or (angle, direction)")
    name = "beam" if parts is None else "beam[0]"
    angle = number(name, beam if parts is None else parts[0], above=0)
    if angle > 2 * np.pi:
        raise ValueError(f"{name} is {angle:g} rad; a full angle is at most 2 pi: give radians")
    if parts is not None:
        axis = converted("beam[1]", parts[1], np.float64)
        if axis.shape not in ((3,), (raw.n_rows, 3)):
            raise ValueError(f"beam[1] has shape {axis.shape}, wanted (3,) or one direction per row ({raw.n_rows}, 3)")
        finite("beam[1]", axis)
        toward = np.broadcast_to(axis, (raw.n_rows, 3))
    else:
        toward = center - raw.tx
    largest = np.abs(toward).max(axis=1, keepdims=True)  # first, so that squares neither overflow nor vanish
    if not largest.all():
        row = int(np.argmin(largest))
        if parts is None:
            raise ValueError(f"tx[{row}] is at the grid's centre, so its beam points nowhere; give (angle, direction)")
        which = f"[{row}]" if np.ndim(parts[1]) == 2 else ""
        raise ValueError(f"beam[1]{which} is (0, 0, 0); a direction needs a length")
    if angle == 2 * np.pi:
        return None, angle
    return unit(toward / largest), angle


def make_task(
    raw: PhaseHistory,
    grid: ImageGrid,
    window: Window | None,
    weights: ArrayLike | None,
    wrap: bool,
    skip: bool | Collection[Skip],
    beam: BeamCone | None = None,
    sum_polarizations: bool = False,
) -> FocusingTask:
    """The task for the options of `backproject`; ValueError for options that do not fit the data."""
    if not raw.compressed:
        raise ValueError("raw is not compressed: its pulses still have their own spectrum; call sarcl.compress(raw)")
    check_polarizations(raw, sum_polarizations)
    skips = known_skips(skip, SKIPS)
    # of a plane the pixel at `center`: with an even number of pixels the middle of the bounds is half a pixel off
    center = grid.bounds.mean(axis=0) if grid.center is None else grid.center
    antenna = antenna_of(raw, beam, center) if is_antenna(beam) else None
    toward, angle = beam_of(raw, None if antenna else beam, center)
    taper = None
    if toward is not None and not all_lit(geometry_of(raw, wrap, toward, angle), grid):
        across, along = windows.both(window)
        if along is not None:
            taper, window = windows.table(along), (across, None)
    sample_weight, row_weight = weigh(raw, window, weights)
    if "zero weight" in skips and not row_weight.all():
        used = np.flatnonzero(row_weight)
        raw, row_weight = raw[used], row_weight[used]
        toward = None if toward is None else toward[used]
        antenna = antenna and picked(antenna, used)
    if "no data" not in skips:
        grid = grid.filled()
    return FocusingTask(
        raw=raw,
        grid=grid,
        antennas=geometry_of(raw, wrap, toward, angle),
        sample_weight=sample_weight,
        row_weight=row_weight,
        wrap=wrap,
        skips=frozenset(skips),
        taper=taper,
        places=None if taper is None else places_of(raw),
        antenna=antenna,
    )


def all_lit(antennas: PulseGeometry, grid: ImageGrid) -> bool:
    """Whether every row sees the whole sphere about the grid."""
    low, high = grid.bounds
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2 * (1 + 1e-9)
    depth = antennas.beam_depth(middle)
    if not antennas.wrap:
        depth = np.minimum(depth, antennas.depth(middle))
    return bool((depth > radius).all())


def places_of(raw: PhaseHistory) -> np.ndarray:
    """Places of the rows along the aperture, float64 (n_rows,): whole numbers from 0 on in the order of time.

    Channels of fewer rows than the longest are stretched to its length, so that all share an aperture.
    """
    channels = _channels(raw)
    longest, places = max(len(rows) for rows in channels), np.zeros(raw.n_rows)
    for rows in channels:
        stretched = (np.arange(len(rows)) + 0.5) / len(rows) * longest - 0.5
        places[rows] = stretched if len(rows) < longest else np.arange(longest)
    return places


def _channels(raw: PhaseHistory) -> list[np.ndarray]:
    """Rows of each channel and polarisation, in the order of time."""
    when = np.arange(raw.n_rows) if raw.time is None else np.argsort(np.argsort(raw.time, kind="stable"))
    group = groups(raw.n_rows, raw.tx_channel, raw.rx_channel, raw.polarization)
    members = (np.flatnonzero(group == g) for g in np.unique(group))
    return [rows[np.argsort(when[rows])] for rows in members]


def check_polarizations(
    raw: PhaseHistory,
    sum_polarizations: bool,
    select: str = "raw.select(polarization={!r})",
    sum_up: str = "sum_polarizations=True",
) -> None:
    """Raise ValueError where rows of several polarisations would be summed and nobody asked for it.

    select, sum_up  how the caller's user selects one of them, and asks for the sum: for the message
    """
    if not isinstance(sum_polarizations, (bool, np.bool_)):
        raise TypeError(f"sum_polarizations is {sum_polarizations!r}; give True or False")
    if raw.polarization is None or sum_polarizations or (raw.polarization == raw.polarization[0]).all():
        return
    kinds = sorted(set(raw.polarization.tolist()))
    raise ValueError(
        f"raw has rows of the polarisations {', '.join(kinds)}, which are different measurements of the scene: make an "
        f"image of each, {select.format(kinds[0])}, or pass {sum_up} for their coherent sum"
    )


def weigh(raw: PhaseHistory, window: Window | None, weights: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    """Weights of samples (n_samples,) and rows (n_rows,): window, raw.weight and `weights` together.

    The rows of each channel and polarisation, in time, share one window over the aperture.
    """
    across, along = windows.both(window)
    rows = np.ones(raw.n_rows)
    if along is not None:
        for channel in _channels(raw):
            rows[channel] = windows.weights(along, len(channel))
    if raw.weight is not None:
        rows = rows * raw.weight
    if weights is not None:
        rows = rows * array("weights", weights, np.float64, (raw.n_rows,))
    if (rows < 0).any():
        raise ValueError(f"weights[{int(np.argmin(rows))}] is negative; a weight cannot be")
    if not rows.any():
        raise ValueError("every row has weight 0; nothing would be focused")
    return windows.weights(across, raw.n_samples), rows


def weighted_rows(
    raw: PhaseHistory, weights: tuple[np.ndarray, np.ndarray], start: int, stop: int
) -> tuple[np.ndarray, float]:
    """Rows start ... stop - 1 times weights of samples (n_samples,) and rows (n_rows,); and their largest modulus.

    ValueError where sums of all samples may exceed complex64.
    """
    samples = raw.read(start, stop) * np.outer(weights[1][start:stop], weights[0]).astype(np.float32)
    largest, n_samples = float(np.abs(samples).max(initial=0.0)), raw.n_rows * raw.n_samples
    if largest > LARGEST[np.complex64] / n_samples:
        raise ValueError(
            f"samples times weights reach {largest:.1e}; sums of {n_samples} in complex64 hold up to "
            f"{LARGEST[np.complex64]:.0e}: scale the samples down"
        )
    return samples, largest


def geometry_of(
    raw: PhaseHistory, wrap: bool, beam: np.ndarray | None = None, beam_angle: float = 2 * np.pi
) -> PulseGeometry:
    """The geometry of every row; the carrier is the frequency of sample n_samples//2; beam as of `beam_of`."""
    half = UNLIMITED if wrap else SPEED_OF_LIGHT / (4 * raw.frequency_step)
    return PulseGeometry.sampled(
        raw.tx,
        raw.rx,
        raw.reference_range,
        first=raw.frequency,
        step=raw.frequency_step,
        n_samples=raw.n_samples,
        window=(-half, half),
        wrap=wrap,
        beam=beam,
        beam_angle=beam_angle,
    )
