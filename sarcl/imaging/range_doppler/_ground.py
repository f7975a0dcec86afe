"""Positions on the ground at zero-Doppler times and slant ranges from a track: at a height, or on an elevation model.

They solve V.(x - P) = 0 and |x - P| = r, with z = height in local coordinates, and with the height above the WGS84
ellipsoid in Earth-fixed ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from ...base import wgs84
from ...base.validation import number
from ...earth import zero_doppler
from ...earth.elevation import ElevationModel
from ._track import REMEDY, Track

UP = np.array([0.0, 0.0, 1.0])
HIGHEST = 1e8  # m, largest height above the ellipsoid, or above the plane z = 0
NODES = 10, 24  # times and ranges at which smooth Earth-fixed positions are solved; in between, Chebyshev polynomials


@dataclass(frozen=True, eq=False)
class Ground:
    """The ground that a track looks at: heights, m, or an elevation model, on its right (sign 1) or left (-1)."""

    track: Track
    heights: float | ElevationModel
    sign: float

    @classmethod
    def of(cls, track: Track, heights: float | ElevationModel, sign: float) -> Ground:
        """ValueError for a vertical track, and for an elevation model where coordinates are local."""
        _, velocity = track.states(track.times)
        if not track.is_earth_fixed and (np.hypot(*velocity.T[:2]) < 1e-6 * np.abs(velocity[:, 2])).any():
            raise ValueError(f"the track is vertical: no side of it is left or right; {REMEDY}")
        if not isinstance(heights, ElevationModel):
            level = number("heights", heights)
            if abs(level) > HIGHEST:
                raise ValueError(f"heights is {level:g} m, which no ground has; give z in m, or an ElevationModel")
            return cls(track, level, sign)
        if not track.is_earth_fixed:
            raise ValueError(
                "heights is an elevation model, by longitude and latitude, but the track is in local coordinates, "
                f"{np.linalg.norm(track.coefficients[0]):.4g} m from the origin: give heights as a number, z in m"
            )
        return cls(track, heights, sign)

    @property
    def level(self) -> float:
        """The height, m, or the middle of the model's."""
        if isinstance(self.heights, ElevationModel):
            return (self.heights.lowest + self.heights.highest) / 2
        return self.heights

    def smooth(self) -> Ground:
        """Ground at one height: effective velocities are fitted over it, since terrain may jump along a range."""
        return Ground(self.track, self.level, self.sign)

    def least_range(self) -> float:
        """Shortest slant range from every row to the ground, m, and a little more: positions exist from there on."""
        p, v = self.track.states(self.track.times)
        if self.track.is_earth_fixed:
            lowest = self.heights.lowest if isinstance(self.heights, ElevationModel) else self.heights
            drop = wgs84.geodetic(p)[2] - lowest
        else:
            steep = np.hypot(v[:, 0], v[:, 1]) / np.linalg.norm(v, axis=1)
            drop = np.abs(p[:, 2] - self.level) / np.maximum(steep, 1e-300)
        return 1.0001 * float(drop.max()) + 1e-3

    def positions(self, times: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Positions, m (n, m, 3), at zero-Doppler times, s (n,), and slant ranges, m (m,).

        ValueError for a range that does not reach the ground, or finds no height in an elevation model.
        """
        if not self.track.is_earth_fixed:
            return self._local(times, ranges)
        few = len(times) <= 2 * NODES[0] or len(ranges) <= 2 * NODES[1]
        if isinstance(self.heights, ElevationModel) or few:
            return self._earth_fixed(times, ranges)
        t, r = (_nodes(axis, n) for axis, n in ((times, NODES[0]), (ranges, NODES[1])))
        nodes = self._earth_fixed(t, r)
        x, y = ((2 * axis - axis[0] - axis[-1]) / (axis[-1] - axis[0]) for axis in (times, ranges))
        (cx, cy) = ((2 * node - axis[0] - axis[-1]) / (axis[-1] - axis[0]) for node, axis in ((t, times), (r, ranges)))
        rows = chebyshev.chebvander(x, len(t) - 1) @ np.linalg.inv(chebyshev.chebvander(cx, len(t) - 1))
        columns = chebyshev.chebvander(y, len(r) - 1) @ np.linalg.inv(chebyshev.chebvander(cy, len(r) - 1))
        middle = nodes.mean(axis=(0, 1))
        return np.asarray(np.einsum("ia,abx,jb->ijx", rows, nodes - middle, columns, optimize=True) + middle)

    def _earth_fixed(self, times: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        p, v = (np.repeat(a, len(ranges), axis=0) for a in self.track.states(times))
        r = np.tile(ranges, len(times))
        model = isinstance(self.heights, ElevationModel)
        levels = self.heights if model else np.full(len(r), self.heights)
        positions = zero_doppler.geolocate(p, v, r, levels, self.sign)  # type: ignore[arg-type]
        return positions.reshape(len(times), len(ranges), 3)

    def _local(self, times: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        p, v = self.track.states(times)
        height, sign = self.level, self.sign
        along = v / np.linalg.norm(v, axis=1, keepdims=True)
        down = (along @ UP)[:, None] * along - UP
        steep = np.linalg.norm(down, axis=1, keepdims=True)
        down = down / steep
        across = sign * np.cross(along, UP) / steep
        fall = ((height - p[:, 2]) / down[:, 2])[:, None]  # along `down`, the cosine times the range
        short = np.abs(fall) > ranges
        if short.any():
            i, j = np.argwhere(short)[0]
            raise ValueError(
                f"slant range {ranges[j]:.9g} m does not reach the height {height:g} m from {p[i, 2]:.9g} m: give "
                "ranges=(near, far) beyond it, or the terrain's heights="
            )
        aside = np.sqrt((ranges - fall) * (ranges + fall))
        below, out = p + fall * down, np.empty((len(times), len(ranges), 3))
        for k in range(3):  # coordinate by coordinate: broadcasting over an axis of three is slow
            np.multiply(aside, across[:, k : k + 1], out=out[..., k])
            out[..., k] += below[:, k : k + 1]
        return out


def _nodes(axis: np.ndarray, n: int) -> np.ndarray:
    """Chebyshev's points of an interval."""
    return np.asarray((axis[0] + axis[-1]) / 2 + (axis[-1] - axis[0]) / 2 * np.cos(np.pi * (np.arange(n) + 0.5) / n))
