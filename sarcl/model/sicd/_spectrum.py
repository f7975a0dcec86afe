"""Spatial frequencies of an image, pixel by pixel, and the time at which a pixel is seen (docs/theory/sicd.md).

Near a point x that rows p see at frequencies f, the image is a sum of waves exp(+j 2 pi k.(x' - x)) with

    k(p, f) = f grad tau = -f/c (u_T + u_R)        cycles per metre, u_T, u_R unit vectors from x to the antennas
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.rows import spread_over

MOST_ROWS = 4096  # rows of an aperture, spread over all
WAVES = 128, 64  # rows and frequencies whose waves are summed for the point response
STEPS = 400  # at which the point response is followed, to one over the bandwidth


@dataclass(frozen=True, eq=False)
class Aperture:
    """Rows that an image was made of, Earth-fixed.

    time  s (n,);  tx, rx  m (n, 3);  low, high  ends of the band, Hz (n,)
    beam, cosine   unit vectors (n, 3), and cosine of half the angle of the beam: -1, no beam
    near, far      half path at the ends of the range window, m (n,)
    """

    time: np.ndarray
    tx: np.ndarray
    rx: np.ndarray
    low: np.ndarray
    high: np.ndarray
    beam: np.ndarray
    cosine: float
    near: np.ndarray
    far: np.ndarray

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Whether rows see points, m (m, 3): bool (m, n)."""
        to_tx, to_rx = points[:, None] - self.tx, points[:, None] - self.rx
        reach = np.linalg.norm(to_tx, axis=-1)
        path = (reach + np.linalg.norm(to_rx, axis=-1)) / 2
        along = np.einsum("mnx,nx->mn", to_tx, self.beam)
        return np.asarray((path >= self.near) & (path <= self.far) & (along >= self.cosine * reach))

    def slopes(self, points: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """grad tau along axes (2, 3), s/m (m, n, 2), at points, m (m, 3)."""
        total = sum(
            (points[:, None] - end) / np.linalg.norm(points[:, None] - end, axis=-1, keepdims=True)
            for end in (self.tx, self.rx)
        )
        return np.asarray(total @ axes.T / SPEED_OF_LIGHT)

    def spans(self, points: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Least and largest spatial frequency along axes (2, 3), and the first and last time, (m, 3, 2) at points.

        NaN at points that no row sees. The rows of the result: along axes[0], along axes[1], time.
        """
        out = np.empty((len(points), 3, 2))
        for first in range(0, len(points), 16):  # 16 x 4096 x 3 numbers at a time
            part = points[first : first + 16]
            hidden = ~self.seen(part)[..., None]
            slopes = self.slopes(part, axes)
            ends = np.stack([slopes * f[:, None] for f in (self.low, self.high)])
            time = np.broadcast_to(self.time[:, None], hidden.shape)
            for fill, pick, side in ((np.inf, np.min, 0), (-np.inf, np.max, 1)):
                out[first : first + 16, :2, side] = pick(np.where(hidden, fill, ends), axis=(0, 2))
                out[first : first + 16, 2, side] = pick(np.where(hidden, fill, time), axis=(1, 2))
        out[~np.isfinite(out).all(axis=(1, 2))] = np.nan
        return out

    def widths(self, point: np.ndarray, axes: np.ndarray, windows: tuple[str, str]) -> np.ndarray:
        """Widths of the response of a point, m (3,), at half its power, along axes (2, 3): m (2,).

        windows  over the frequencies and over the rows, in words; ValueError for one that has no name
        """
        rows = np.flatnonzero(self.seen(point[None])[0])
        rows = rows[np.argsort(self.time[rows], kind="stable")]
        rows = rows[spread_over(len(rows), WAVES[0])]
        slopes = self.slopes(point[None], axes)[0, rows]
        share = (np.arange(WAVES[1]) + 0.5) / WAVES[1]
        frequency = self.low[rows, None] + (self.high - self.low)[rows, None] * share
        weight = window_weights(windows[1], len(rows))[:, None] * window_weights(windows[0], WAVES[1])
        return np.array([_width(frequency * slopes[:, i, None], weight) for i in (0, 1)])

    def cells(self, points: np.ndarray, axes: np.ndarray, windows: tuple[str, str]) -> np.ndarray:
        """Areas, m^2 (m,), of the resolution cells at points, m (m, 3), that all rows see, on the plane of axes (2, 3).

        The integral of |h|^2, h the response over its peak. By Parseval sum w^2/dA over (sum w)^2, with dA the area of
        spatial frequencies of a sample, f df |g x dg|, g the slopes and dg their change from row to row. NaN where
        rows have no extent. windows  as in `widths`
        """
        order = np.argsort(self.time, kind="stable")
        slopes = self.slopes(points, axes)[:, order]
        change = np.gradient(slopes, axis=1)
        width = (self.high - self.low)[order, None] / WAVES[1]
        frequency = self.low[order, None] + width * (np.arange(WAVES[1]) + 0.5)
        turn = np.abs(slopes[..., 0] * change[..., 1] - slopes[..., 1] * change[..., 0])
        weight = window_weights(windows[1], len(order))[:, None] * window_weights(windows[0], WAVES[1])
        per_row = (weight**2 / (frequency * width)).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            areas = (per_row / turn).sum(axis=1) / weight.sum() ** 2
        return np.where(np.isfinite(areas), areas, np.nan)


def _width(k: np.ndarray, weight: np.ndarray) -> float:
    """Twice the distance, m, at which a weighted sum of waves of k, cycles per metre, has half its power."""
    k, weight = (k - (k.max() + k.min()) / 2).ravel(), weight.ravel() / weight.sum()
    x = np.arange(STEPS) * 2 / STEPS / max(np.ptp(k), np.finfo(float).tiny)
    power = np.array([np.abs(weight @ np.exp(2j * np.pi * k * each)) ** 2 for each in x])
    below = int(np.argmax(power < 0.5))
    if power[below] >= 0.5:
        raise ValueError("the response of a point does not fall to half its power within two resolution cells")
    share = (power[below - 1] - 0.5) / (power[below - 1] - power[below])
    return float(2 * (below - 1 + share) * x[1])


def window_weights(words: str, n: int) -> np.ndarray:
    """Weights (n,) of a window in words, such as "hamming" or "taylor 35 5"."""
    from scipy.signal import windows

    name, *numbers = words.split()
    values = [float(number) for number in numbers]
    if name in ("none", "boxcar"):
        return np.ones(n)
    if name == "taylor":
        return np.asarray(windows.taylor(n, nbar=round(values[1]), sll=values[0]))
    return np.asarray(windows.get_window((name, *values) if values else name, n, fftbins=False))
