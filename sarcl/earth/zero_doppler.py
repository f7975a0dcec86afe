"""Zero-Doppler geometry: when an antenna is closest to a position, and which position lies at a time and range.

At the zero-Doppler time the Earth-fixed velocity is perpendicular to the path to the position: V.(x - P) = 0.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base import wgs84
from ..base.vectors import Floats
from .elevation import ElevationModel
from .viewing import hidden, normal

States = Callable[[Floats], tuple[Floats, Floats]]

COARSE = 60.0  # s: least time between zero-Doppler times of any orbit is half a revolution, 40 minutes
PAIRS = 4_000_000  # pairs of positions and coarse times that are examined at once
DOUBT = 50e3  # m: of passes whose first ranges differ by less, all zero-Doppler times are computed
EXACT = 1e-12  # s: below it, times follow the rounding of positions, 1e-9 m
EARLY = 1e-9  # s: a zero-Doppler time outside the span by less counts as its end
EXCESS = 2e-9  # m: differences of heights below it are rounding
LEAST_SPEED = 1.0  # m/s over the ground: below it there is no zero-Doppler plane


def locate(states: States, span: tuple[float, float], positions: Floats) -> tuple[Floats, Floats]:
    """Zero-Doppler times, s (n,), within span, and slant ranges, m (n,), of positions, m (n, 3).

    Of several passes over a position the one that comes closest counts. ValueError names the first position that no
    pass sees: because there is no zero-Doppler time in span, or because it is behind the horizon then.
    """
    start, stop = span
    coarse = np.linspace(start, stop, int(np.ceil((stop - start) / COARSE)) + 8)
    antennas, velocities = states(coarse)
    slack = EARLY * (velocities**2).sum(axis=1)
    times, ranges = np.full(len(positions), np.nan), np.full(len(positions), np.nan)
    has_crossing = np.zeros(len(positions), bool)
    count = max(1, PAIRS // len(coarse))
    for first in range(0, len(positions), count):
        x = positions[first : first + count]
        ahead = x @ velocities.T - (antennas * velocities).sum(axis=1)
        row, k = np.nonzero((ahead[:, :-1] >= -slack[:-1]) & (ahead[:, 1:] <= slack[1:]))
        has_crossing[first + row] = True
        lead = np.clip(ahead[row, k] / np.maximum(ahead[row, k] - ahead[row, k + 1], 1e-300), 0, 1)
        # about where the antenna is then: good to some kilometres, which separates most passes
        antenna = antennas[k] + lead[:, None] * (antennas[k + 1] - antennas[k])
        guess = np.where(hidden(antenna, x[row]), np.inf, np.linalg.norm(antenna - x[row], axis=1))
        least = np.full(len(x), np.inf)
        np.minimum.at(least, row, guess)
        for is_thorough in (False, True):
            is_open = np.isnan(ranges[first + row])
            candidates = np.flatnonzero(is_open & (is_thorough | (guess <= least[row] + DOUBT)))
            if not len(candidates):
                continue
            i, j = row[candidates], k[candidates]
            t = _crossings(states, x[i], coarse[j], coarse[j + 1], ahead[i, j], ahead[i, j + 1])
            antenna_at_t, _ = states(t)
            distance = np.where(hidden(antenna_at_t, x[i]), np.inf, np.linalg.norm(x[i] - antenna_at_t, axis=1))
            order = np.argsort(-distance, kind="stable")  # the nearest is written last
            order = order[np.isfinite(distance[order])]
            times[first + i[order]], ranges[first + i[order]] = t[order], distance[order]
    if np.isnan(ranges).any():
        number = int(np.argmax(np.isnan(ranges)))
        lon, lat, _ = wgs84.geodetic(positions[number])
        why = (
            "it is behind the horizon at every zero-Doppler time"
            if has_crossing[number]
            else "it has no zero-Doppler time (closest approach)"
        )
        raise ValueError(
            f"positions[{number}] (longitude {lon:.4f}, latitude {lat:.4f}) is never seen: {why} from {start:.9g} to "
            f"{stop:.9g} s; give an orbit over a longer span, or a scene that the satellite passes"
        )
    return times, ranges


def _crossings(states: States, x: Floats, low: Floats, high: Floats, at_low: Floats, at_high: Floats) -> Floats:
    """Times between low and high, s (n,), at which V.(x - P) is 0, from its values at both: Newton's iteration."""
    low, high = low.copy(), high.copy()
    least, most = low.copy(), high.copy()
    _, v_low = states(low)
    _, v_high = states(high)
    acceleration = (v_high - v_low) / (high - low)[:, None]
    t = np.clip(low + at_low / (at_low - at_high) * (high - low), low, high)
    for _ in range(60):
        antenna, velocity = states(t)
        path = x - antenna
        ahead = (path * velocity).sum(axis=1)
        low, high = np.where(ahead >= 0, t, low), np.where(ahead <= 0, t, high)
        slope = (path * acceleration).sum(axis=1) - (velocity**2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            new_t = t - ahead / slope
        new_t = np.where((new_t >= low) & (new_t <= high), new_t, (low + high) / 2)
        step = np.abs(new_t - t)
        t = new_t
        if (step <= EXACT + 4 * np.spacing(np.abs(t))).all():
            break
    return np.asarray(np.clip(t, least, most))


def geolocate(
    positions: Floats, velocities: Floats, ranges: Floats, heights: Floats | ElevationModel, sign: float
) -> Floats:
    """Positions, m (n, 3), at slant ranges, m (n,), in the zero-Doppler planes of antennas, m and m/s (n, 3).

    heights  above the ellipsoid, m (n,), or an elevation model;  sign  1 right of the velocity seen from above, -1 left

    The position turns about the antenna in its zero-Doppler plane, by an angle from straight down, until it lies at
    the height. Where terrain meets that arc several times (layover), the point closest to the point below the antenna
    counts. ValueError names the first range that meets no ground, or meets it behind the horizon.
    """
    speed = np.linalg.norm(velocities, axis=1)
    if (speed < LEAST_SPEED).any():
        i = int(np.argmin(speed))
        raise ValueError(
            f"the satellite moves over the ground with {speed[i]:.3g} m/s at point {i}: without a velocity there is "
            "no zero-Doppler plane; give an orbit that is not geostationary"
        )
    along = velocities / speed[:, None]
    up = positions - (positions * along).sum(axis=1)[:, None] * along
    up /= np.linalg.norm(up, axis=1)[:, None]
    arc = _Arc(positions, -up, sign * np.cross(along, up), ranges)
    model = heights if isinstance(heights, ElevationModel) else None
    levels = np.full(len(ranges), model.lowest) if model is not None else np.asarray(heights)
    angle = _angle_at(arc, levels)
    if model is not None:
        angle = _angle_on(arc, model, angle, _angle_at(arc, np.full(len(ranges), model.highest)))
    x = arc.at(angle)
    is_hidden = hidden(positions, x)
    if is_hidden.any():
        i = int(np.argmax(is_hidden))
        raise ValueError(
            f"slant range[{i}] = {ranges[i]:.9g} m meets the ground behind the horizon; give a shorter range"
        )
    return x


class _Arc:
    """Circles of positions at a range from antennas, in zero-Doppler planes; angles from straight down, rad (n,)."""

    def __init__(self, centers: np.ndarray, down: np.ndarray, across: np.ndarray, ranges: np.ndarray) -> None:
        self.centers, self.down, self.across, self.ranges = centers, down, across, ranges

    def at(self, angle: np.ndarray) -> np.ndarray:
        """Positions, m (n, 3)."""
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        return np.asarray(self.centers + self.ranges[:, None] * (c * self.down + s * self.across))

    def slope(self, angle: np.ndarray) -> np.ndarray:
        """Derivatives of the positions with the angle, m (n, 3)."""
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        return np.asarray(self.ranges[:, None] * (c * self.across - s * self.down))

    def part(self, rows: np.ndarray) -> _Arc:
        """The circles of some antennas."""
        return _Arc(self.centers[rows], self.down[rows], self.across[rows], self.ranges[rows])


def _angle_at(arc: _Arc, heights: np.ndarray) -> np.ndarray:
    """Angles, rad (n,), at which positions have heights above the ellipsoid, m (n,).

    The height grows with the angle, from below the antenna to above it: Newton's iteration within bounds.
    """
    low, high = np.zeros(len(heights)), np.full(len(heights), np.pi)
    top = wgs84.geodetic(arc.centers)[2]
    if (heights >= top).any():
        i = int(np.argmax(heights >= top))
        raise ValueError(f"heights[{i}] = {heights[i]:.9g} m is above the satellite ({top[i]:.9g} m); give metres")
    drop = np.abs((arc.centers * arc.down).sum(axis=1))
    is_short = wgs84.geodetic(arc.at(low))[2] >= heights
    if is_short.any():
        i = int(np.argmax(is_short))
        if arc.ranges[i] > drop[i]:  # through the Earth, and out on its other side
            raise ValueError(
                f"slant range[{i}] = {arc.ranges[i]:.9g} m reaches beyond the Earth; give a shorter range (one "
                "way, in m)"
            )
        raise ValueError(
            f"slant range[{i}] = {arc.ranges[i]:.9g} m does not reach the ground, which is "
            f"{top[i] - heights[i]:.9g} m below the satellite; give a longer range (one way, in m), or lower heights"
        )
    distance = np.linalg.norm(arc.centers, axis=1)
    ground = distance - top + heights
    angle = np.arccos(
        np.clip((distance**2 + arc.ranges**2 - ground**2) / (2 * drop * arc.ranges), -1, 1)
    )  # on a sphere
    for _ in range(100):
        x = arc.at(angle)
        longitude, latitude, height = wgs84.geodetic(x)
        excess = height - heights
        low, high = np.where(excess <= 0, angle, low), np.where(excess >= 0, angle, high)
        slope = (wgs84.up(longitude, latitude) * arc.slope(angle)).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            new_angle = angle - excess / slope
        new_angle = np.where((new_angle >= low) & (new_angle <= high), new_angle, (low + high) / 2)
        # straight down the slope is 0, and no step is right
        new_angle = np.where(np.abs(excess) <= EXCESS, angle, new_angle)
        step = np.abs(new_angle - angle)
        angle = new_angle
        if (step <= 4e-16).all():
            break
    return np.asarray(angle)


def _angle_on(arc: _Arc, model: ElevationModel, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The smallest angles, rad (n,), at which positions lie on terrain, between those of its lowest and highest level.

    The arc is walked in steps of half the model's spacing, then bisected where it first comes up through the terrain.
    """
    length = np.linalg.norm(arc.at(high) - arc.at(low), axis=1)
    margin = model.spacing / arc.ranges
    low, high = np.maximum(low - margin, 0), high + margin
    steps = int(np.ceil(2 * length.max(initial=0.0) / model.spacing)) + 5
    first, last = np.full(len(low), np.nan), np.full(len(low), np.nan)
    rows, before = np.arange(len(low)), _clearance(arc, model, low)
    for step in range(1, steps):
        angles = [low[rows] + n / (steps - 1) * (high - low)[rows] for n in (step - 1, step)]
        after = _clearance(arc.part(rows), model, angles[1])
        is_rising = (before <= 0) & (after > 0)
        first[rows[is_rising]], last[rows[is_rising]] = angles[0][is_rising], angles[1][is_rising]
        rows, before = rows[~is_rising], after[~is_rising]
    if np.isnan(first).any():
        i = int(np.argmax(np.isnan(first)))
        lon, lat, _ = wgs84.geodetic(arc.at(low)[i])
        raise ValueError(
            f"slant range[{i}] = {arc.ranges[i]:.9g} m meets no terrain of the elevation model: near longitude "
            f"{lon:.4f}, latitude {lat:.4f} it ends or has no data; give a model that covers "
            "the swath, times and ranges within it (of an image: times=, ranges=), or a number"
        )
    for _ in range(60):
        middle = (first + last) / 2
        is_above = _clearance(arc, model, middle) > 0
        first, last = np.where(is_above, first, middle), np.where(is_above, middle, last)
        if (last - first <= 4e-16).all():
            break
    return np.asarray(last)


def _clearance(arc: _Arc, model: ElevationModel, angle: np.ndarray) -> np.ndarray:
    """Heights above the terrain, m (n,); NaN where the model has none."""
    longitude, latitude, height = wgs84.geodetic(arc.at(angle))
    return np.asarray(height - model.heights_at(longitude, latitude))


def ray_ends(positions: Floats, directions: Floats, height: float) -> Floats:
    """Positions, m (n, 3), where rays from antennas, m (n, 3), along unit vectors (n, 3) meet a height, m.

    ValueError names the first ray that passes over the horizon.
    """
    axes = wgs84.SEMI_MAJOR * np.array([1, 1, 1 - wgs84.FLATTENING]) + height
    start, ray = positions / axes, directions / axes
    a, b, c = (ray**2).sum(axis=1), (ray * start).sum(axis=1), (start**2).sum(axis=1) - 1
    disc = b**2 - a * c
    beyond = (disc < 0) | (c <= 0) | (b >= 0)
    if beyond.any():
        raise ValueError(
            f"the beam passes over the horizon in direction {int(np.argmax(beyond))} of {len(beyond)}; give a smaller "
            "look angle, or a narrower beam"
        )
    along = c / (-b + np.sqrt(disc))
    for _ in range(20):  # surfaces of constant height are nearly, but not exactly, ellipsoids
        points = positions + along[:, None] * directions
        step = (wgs84.geodetic(points)[2] - height) / (normal(points) * directions).sum(axis=1)
        along = along - step
        if np.abs(step).max() < 1e-8:
            break
    return np.asarray(positions + along[:, None] * directions)
