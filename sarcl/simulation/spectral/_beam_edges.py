"""Beams with hard edges: the places on a straight track between which each scatterer is inside an antenna's table.

The gain of a table is 0 outside its azimuths. At an azimuth alpha the edge is the plane through the antenna's z axis
and the direction x cos(alpha) + y sin(alpha), in antenna axes x, y, z: with n = y cos(alpha) - x sin(alpha), rho the
unit vector from the track to the scatterer at closest approach, and t the tangent of the aspect, an antenna sees the
scatterer on the edge where (rho - t along).n = 0. The edge's aspect therefore depends on the scatterer's elevation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline

from ...model.antenna import Antenna
from ...model.antenna_pattern import SLACK
from ...scattering.antenna_weights import AntennaWeights
from ._straight_track import StraightTrack

SOFT = 0.02  # share of the tolerance: gains at the edges of a table, over the peak, that need no separate treatment


@dataclass(frozen=True, eq=False)
class BeamEdges:
    """Tangents of the aspects between which scatterers are seen: first, last (n,); never where first > last."""

    first: np.ndarray
    last: np.ndarray

    @property
    def seen(self) -> np.ndarray:
        """Whether any place on the track sees a scatterer inside the beam (n,)."""
        return np.asarray(self.first < self.last)

    def along(self, azimuth: np.ndarray, slant_range: np.ndarray, length: float) -> BeamEdges:
        """The same edges, without those of scatterers at azimuths and slant ranges, m (n,), whose part of a track of
        `length` m lies beyond its ends."""
        beyond = (azimuth + slant_range * self.first > length) | (azimuth + slant_range * self.last < 0)
        return BeamEdges(np.where(beyond, np.inf, self.first), np.where(beyond, -np.inf, self.last))

    def sines(self) -> tuple[np.ndarray, np.ndarray]:
        """Sines of these aspects (n,); -1 and 1 where a beam has no edge."""
        return np.sin(np.arctan(self.first)), np.sin(np.arctan(self.last))


def continued_weights(weights: AntennaWeights, tolerance: float) -> AntennaWeights:
    """The weights with tables continued by a step beyond azimuths at which they end with gain; the same weights
    where there is no such table. Tables whose angles depend on frequency are kept: their edges differ over the band."""
    if weights.pair is None:
        return weights
    made = {one: _continued(one, SOFT * tolerance, weights.is_two_way) for one in weights.patterns}
    if all(new is old for old, new in made.items()):
        return weights
    sent, back = weights.pair
    return replace(weights, pair=(made[sent], None if back is None else made[back]))


def _continued(antenna: Antenna, soft: float, is_two_way: bool) -> Antenna:
    """A table with a value more at each end of its azimuths, on the same spline; other antennas as they are."""
    if antenna.kind != "table" or antenna.frequency is not None:
        return antenna
    azimuth, ends = antenna.azimuth, np.abs(antenna.values[[0, -1]]).max()
    step = azimuth[1] - azimuth[0]
    if ends ** (1 + is_two_way) <= soft or np.abs(azimuth).max() + step >= np.pi / 2:
        return antenna
    # the first and the last two pieces of a not-a-knot spline are one polynomial each: values on it change nothing else
    spline = make_interp_spline(np.arange(len(azimuth)), antenna.values, k=3)
    values = spline(np.arange(-1, len(azimuth) + 1))
    return Antenna.table(
        azimuth[0] + step * np.arange(-1, len(azimuth) + 1),
        antenna.elevation,
        values,
        gain_db=antenna.gain_db + 20 * float(np.log10(np.abs(values).max())),
        two_way=antenna.two_way,
        mount=antenna.mount,
    )


def beam_edges(
    weights: AntennaWeights, continued: AntennaWeights, track: StraightTrack, positions: np.ndarray
) -> BeamEdges | None:
    """Edges, for scatterers at positions, m (n, 3), of the tables that `continued` continues; None without such."""
    if continued is weights or weights.pair is None or continued.pair is None or weights.axes is None:
        return None
    along, across = track.along, track.across(positions)
    first, last = np.full(len(across), -np.inf), np.full(len(across), np.inf)
    for one, new, axes in zip(weights.pair, continued.pair, weights.axes, strict=True):
        if one is None or new is one:
            continue
        slack = SLACK * (one.azimuth[1] - one.azimuth[0])
        x, y = axes[0][:, 0], axes[0][:, 1]
        for alpha, sign in ((one.azimuth[0] - slack, 1), (one.azimuth[-1] + slack, -1)):
            normal = sign * (y * np.cos(alpha) - x * np.sin(alpha))  # the scatterer is inside where it is ahead of it
            a, b = float(along @ normal), across @ normal
            if abs(a) < 1e-12:
                first[b < 0] = np.inf
            elif a > 0:
                last = np.minimum(last, b / a)
            else:
                first = np.maximum(first, b / a)
    return BeamEdges(first, last)
