"""A grid for data without one: at the point that they were aimed at, with their resolution and unambiguous extent."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import wgs84
from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..base.validation import choice, instance, number
from ..earth import zero_doppler
from ..earth.elevation import ElevationModel
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory

log = logging.getLogger(__name__)

MOST = 1024  # pixels along a side, at most
MOST_OF_AREA = 8192  # pixels along a side of an image area that a file names, at most: an image of 0.5 GB
ROWS = 4096  # rows from which the geometry is taken
# Smallest ratio of a singular value to the largest at which all three coordinates are determined, and at which a
# direction on the ground is; other directions are left unchanged
WELL_POSED, FIXED = 0.02, 0.001


@dataclass(frozen=True, eq=False)
class GridChoice:
    """A plane, and the reason for its choice in words."""

    grid: ImageGrid
    why: str


def default_grid(
    raw: PhaseHistory,
    *,
    center: ArrayLike | None = None,
    shape: int | Sequence[int] | None = None,
    spacing: float | Sequence[float] | None = None,
    side: str | None = None,
    heights: float | ElevationModel = 0.0,
) -> ImageGrid:
    """The plane on which `sarcl focus` images echoes without a grid; arguments that are None are chosen from the data.

    raw      echoes, whose geometry alone is looked at
    center   m (3,): the point whose range equals reference_range in every row: the origin where that holds to within a
             resolution cell; else by least squares, on z = 0 unless the directions to the antennas determine z too;
             else the origin
    spacing  m: half the resolution along rows and columns, from the frequencies and directions in the data
    shape    the extent that the frequency step and the angle between rows leave unambiguous, at most 1024 pixels
    side     "left" or "right" of the track, for Earth-fixed echoes without a center
    heights  m above the ellipsoid, or an ElevationModel, of the center of Earth-fixed echoes

    The image area of the echoes, where they have one (from a CPHD file) and center is None, gives centre, axes and
    extent, at most 8192 pixels along a side. Else the plane is horizontal; of Earth-fixed echoes it is tangent to the
    ellipsoid at its center, and columns run east.
    The reasons for the choice are logged (INFO). TypeError where raw is no PhaseHistory; ValueError for echoes without
    rows, and for Earth-fixed ones without side and center.

    >>> sarcl.default_grid(raw).spacing
    (0.1926, 0.3011)
    """
    instance("raw", raw, PhaseHistory)
    chosen = choose_grid(raw, center=center, shape=shape, spacing=spacing, side=side, heights=heights)
    log.info("grid from the data: %s", chosen.why)
    return chosen.grid


def choose_grid(
    raw: PhaseHistory,
    *,
    center: ArrayLike | None = None,
    shape: int | Sequence[int] | None = None,
    spacing: float | Sequence[float] | None = None,
    normal: ArrayLike | None = None,
    x_axis: ArrayLike | None = None,
    side: str | None = None,
    heights: float | ElevationModel = 0.0,
) -> GridChoice:
    """As `default_grid`, with the reasons for the choice; normal, x_axis as in `ImageGrid.plane`."""
    part = raw if raw.n_rows <= ROWS else raw[spread_over(raw.n_rows, ROWS)]
    why = []
    area = raw.image_area if center is None and normal is None and x_axis is None else None
    if area is not None:
        center, x_axis, normal = area[0], area[1], np.cross(area[1], area[2])
        why.append("centre: of the image area that the file names")
    on_earth = needs_side(part)
    if center is None and on_earth:
        center, words = _center_on_earth(part, side, heights)
        why.append(words)
    elif center is None:
        center, words = _center(part)
        why.append(words)
    upward, east = np.array([0.0, 0.0, 1.0]), None
    if on_earth and wgs84.vertical_at(np.asarray(center, np.float64)) is not None:
        longitude, latitude, _ = wgs84.geodetic(center)
        east, _, upward = wgs84.local_axes(float(longitude), float(latitude))
    axes: dict[str, Any] = {
        "center": center,
        "x_axis": east if x_axis is None and normal is None else x_axis,
        "normal": upward if normal is None else normal,
    }
    cell, swath = _resolution(part, ImageGrid.plane(shape=1, spacing=1, **axes), raw.n_rows)
    if spacing is None:
        spacing = tuple(float(f"{d:.4g}") for d in cell / 2)
        why.append(f"pixels half the resolution of {cell[0]:.3g} x {cell[1]:.3g} m")
    if shape is None and area is not None:
        sides = 2 * np.linalg.norm(area[[2, 1]], axis=1)
        pixels = np.ceil(np.maximum(sides / np.broadcast_to(spacing, 2), 1)).astype(int)
        shape = np.minimum(pixels, MOST_OF_AREA).tolist()
        limit = "" if (pixels <= MOST_OF_AREA).all() else f"{MOST_OF_AREA} pixels at most of "
        why.append(f"{limit}its {sides[0]:.4g} x {sides[1]:.4g} m")
    elif shape is None:
        unambiguous = [max(1, 2 * round(swath / (2 * d))) for d in np.broadcast_to(spacing, 2)]
        shape = [min(n, MOST) for n in unambiguous]
        limit = "" if shape == unambiguous else f"{MOST} pixels at most of "
        why.append(f"{limit}the {swath:.4g} m that are unambiguous")
    return GridChoice(ImageGrid.plane(shape=shape, spacing=spacing, **axes), "; ".join(why))


def _excess(raw: PhaseHistory, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Range of x less the reference, m (n_rows,), and its gradient (n_rows, 3)."""
    to_tx, to_rx = x - raw.tx, x - raw.rx
    r_tx, r_rx = (np.maximum(np.linalg.norm(d, axis=1), 1e-9) for d in (to_tx, to_rx))
    return (r_tx + r_rx) / 2 - raw.reference_range, (to_tx / r_tx[:, None] + to_rx / r_rx[:, None]) / 2


def needs_side(raw: PhaseHistory) -> bool:
    """Whether the default centre needs the side of the track: in Earth-fixed coordinates, whose origin is no scene."""
    if raw.image_area is not None or not wgs84.is_earth_fixed(raw.tx[raw.n_rows // 2]):
        return False
    return _spread(raw, np.zeros(3)) > _cell(raw)


def _cell(raw: PhaseHistory) -> float:
    """Resolution in range, m."""
    return SPEED_OF_LIGHT / (2 * float(raw.bandwidth.max()))


def _spread(raw: PhaseHistory, x: np.ndarray) -> float:
    """Root mean square of the range of x less the reference, m."""
    return float(np.sqrt(np.mean(_excess(raw, x)[0] ** 2)))


def _center_on_earth(raw: PhaseHistory, side: str | None, heights: float | ElevationModel) -> tuple[np.ndarray, str]:
    """The point at `heights` whose ranges to the antennas are the reference ranges, by least squares; and words."""
    if side is None:
        raise ValueError(
            "the echoes are in Earth-fixed coordinates, where reference ranges meet on either side of the track; give "
            "side='left' or 'right' of it (--side), or the grid's center (--center, --grid)"
        )
    sign = {"right": 1.0, "left": -1.0}[choice("side", side, ("right", "left"))]
    middle = raw.n_rows // 2
    ahead = raw.tx[-1] - raw.tx[0]
    reference = raw.reference_range[[middle]]
    start = heights if isinstance(heights, ElevationModel) else np.array([number("heights", heights)])
    x = zero_doppler.geolocate(raw.tx[[middle]], ahead[None], reference, start, sign)[0]
    for _ in range(20):
        longitude, latitude, height = wgs84.geodetic(x)
        level = heights.heights_at(longitude, latitude) if isinstance(heights, ElevationModel) else heights
        excess, gradient = _excess(raw, x)
        rows = np.concatenate([gradient, 1e3 * wgs84.up(longitude, latitude)[None]])
        step = np.linalg.lstsq(rows, -np.append(excess, 1e3 * (height - level)), rcond=None)[0]
        x = x + step
        if np.linalg.norm(step) < 1e-4:
            break
    place = "longitude {:.6f}, latitude {:.6f}, height {:.1f} m".format(*wgs84.geodetic(x))
    return x, (f"centre: {place}, {side} of the track, where the reference ranges meet, to {_spread(raw, x):.2g} m")


def _center(raw: PhaseHistory) -> tuple[np.ndarray, str]:
    origin = np.zeros(3)
    if _spread(raw, origin) <= _cell(raw):
        return origin, "centre: the origin, where all reference ranges meet"
    for free, words in ((3, "where the reference ranges meet"), (2, "where the reference ranges meet z = 0")):
        x = _meet(raw, free)
        if x is not None and _spread(raw, x) <= float(raw.swath.min()) / 4:
            return np.round(x, 3), f"centre: {words}, to {_spread(raw, x):.2g} m"
    return (origin, "centre: the origin, because the reference ranges meet in no point (--center names another)")


def _meet(raw: PhaseHistory, free: int) -> np.ndarray | None:
    """Least-squares point of equal ranges; its first `free` coordinates are free, the others 0.

    None where the directions to the antennas do not determine all three coordinates, or the search does not converge.
    """
    x = np.zeros(3)
    for _ in range(50):
        excess, gradient = _excess(raw, x)
        u, s, vt = np.linalg.svd(gradient[:, :free], full_matrices=False)
        if free == 3 and (len(s) < 3 or s[-1] < WELL_POSED * s[0]):
            return None
        fixed = s > FIXED * s[0]
        step = -vt.T[:, fixed] @ ((u.T @ excess)[fixed] / s[fixed])
        # steps of half the distance to the antennas at most, where the gradients are still valid
        reach = float(raw.reference_range.max()) / 2
        length = float(np.linalg.norm(step))
        x[:free] += step * min(1.0, reach / max(length, 1e-300))
        if length < 1e-6 * max(1.0, reach * 1e-6):
            return x
    return None


def _resolution(raw: PhaseHistory, plane: ImageGrid, n_rows: int) -> tuple[np.ndarray, float]:
    """Resolution along rows and columns (y_axis, x_axis), m, and the extent, m, over which echoes do not repeat.

    The data contain the spatial frequencies k = 2 f/c times the gradient of range; their extent along an axis is 0.886
    divided by the resolution.
    """
    assert plane.center is not None and plane.x_axis is not None and plane.y_axis is not None
    direction = -_excess(raw, plane.center)[1] @ np.stack([plane.y_axis, plane.x_axis], axis=1)
    low, high = raw.frequency, raw.frequency + raw.bandwidth
    k = np.concatenate([direction * (2 / SPEED_OF_LIGHT * f)[:, None] for f in (low, high)])
    extent = np.ptp(k, axis=0)
    level = max(float(np.median(np.linalg.norm(direction, axis=1))), 0.1)  # cosine of the grazing angle
    swath = float(raw.swath.min()) / level
    turn = np.ptp(np.unwrap(np.arctan2(direction[:, 0], direction[:, 1])))
    if raw.n_rows > 1 and turn > 0:
        middle = 2 / SPEED_OF_LIGHT * float(np.median((low + high) / 2))
        swath = min(swath, (n_rows - 1) / (turn * level * middle))
    # along an axis that the data do not resolve, pixels are at most 8 times longer than across
    extent = np.maximum(extent, extent.max() / 8)
    return 0.886 / np.maximum(extent, 0.886 / swath), swath
