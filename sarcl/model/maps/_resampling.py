"""An image resampled to a map, block by block.

    complex     I(x) = exp(j phi(x)) sum_ab K(i - a) K(j - b) I_ab exp(-j phi(x_ab)),   (i, j) the pixel index of x
    amplitude   root of the mean of |I(x)|^2 over k x k places of a map's pixel, as many as it has pixels of the image;
                k = 1 where the map is finer. Intensities (multilooked images) are interpolated linearly
    phi         2 pi f tau, the phase of a point's image, exact for the antennas of the middle of a block: it changes by
                several cycles from pixel to pixel, and the rest is band-limited
    K           zeros between the spectrum's ends make two samples of one; then sinc with a Kaiser window of 77 dB

All values are over the gain: a unit point has modulus 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ...base import wgs84
from ...base.constants import SPEED_OF_LIGHT
from ...base.vectors import Floats
from ._source import Part, Source
from .antennas import antennas_of

if TYPE_CHECKING:
    from ..image import Image
    from .map_grid import MapAxes

BLOCK = 128  # pixels along the sides of a block, with all places in its pixels
MARGIN = 24  # pixels around a part whose values are interpolated; the signal falls to 0 over them
TAPS, KAISER = 10, 7.5  # samples of the doubled image along each axis, and the window's shape: 77 dB
STEPS = 4096  # from sample to sample, at which the weights are computed; lines between them err by 1e-7
CHIP = 64  # pixels along the sides of a part whose spectrum is examined
ALIASED = 0.02  # most share of the energy whose frequencies a map of complex values may lack
MOST_PLACES = 32  # places along a side of a map's pixel: in wider ones, not every pixel of the image counts


@dataclass(frozen=True, eq=False)
class Resampling:
    """An image on a map: values in blocks.  places  k, of a pixel along each axis"""

    image: Image
    source: Source
    axes: MapAxes
    is_complex: bool

    @property
    def places(self) -> int:
        """Places k along each axis of a map's pixel at which the image is interpolated."""
        if self.is_complex:
            return 1
        jacobian = self.jacobian(self.axes.shape[0] // 2, self.axes.shape[1] // 2)
        widest = 1.0 if jacobian is None else float(np.linalg.norm(jacobian, axis=0).max())
        return int(np.clip(np.ceil(widest - 0.05), 1, MOST_PLACES))

    def values(self, rows: range) -> np.ndarray:
        """Complex values or amplitudes of rows of the map (n, columns), NaN where there are none."""
        kind = np.result_type(self.image.dtype, np.complex64) if self.is_complex else np.dtype(np.float64)
        return self._joined(rows, self.places, kind, lambda part, index: self._interpolated(index))

    def heights(self, rows: range) -> Floats:
        """Heights of the image above the ellipsoid, m, at the pixels of rows of the map (n, columns), NaN beside it."""
        return self._joined(rows, 1, np.dtype(np.float64), _heights_at)

    def _joined(
        self, rows: range, k: int, kind: np.dtype, function: Callable[[Part, Floats], np.ndarray]
    ) -> np.ndarray:
        """Values of rows (n, columns), by blocks: function(part, index) gives them at indices (2, n) of the image."""
        size = max(BLOCK // k, 1)
        out = np.full((len(rows), self.axes.shape[1]), np.nan, kind)
        for i in range(0, len(rows), size):
            for j in range(0, out.shape[1], size):
                shape = min(size, len(rows) - i), min(size, out.shape[1] - j)
                values = self._block(rows[i], j, shape, k, function)
                if values is not None:
                    out[i : i + size, j : j + size] = values
        return out

    def _block(
        self,
        row: int,
        column: int,
        shape: tuple[int, int],
        k: int,
        function: Callable[[Part, Floats], np.ndarray],
    ) -> np.ndarray | None:
        """Values (shape) of the block at a pixel of the map; None where the image does not lie there."""
        i, j = (first - 0.5 + (np.arange(n * k) + 0.5) / k for first, n in zip((row, column), shape, strict=True))
        x, y = (v.ravel() for v in self.axes.at(i[:, None], j))
        part = self.source.part(x, y)
        if part is None:
            return None
        index = self.source.index(part, x, y)
        full = np.isfinite(index[0])
        if not full.any():
            return None
        inner = function(part, index[:, full])
        values = np.full(len(x), np.nan, inner.dtype)
        values[full] = inner
        if k == 1:
            return values.reshape(shape)
        power = values.reshape(shape[0], k, shape[1], k) ** 2
        with np.errstate(invalid="ignore"):  # no place with data: 0/0
            return np.asarray(np.sqrt(np.nansum(power, axis=(1, 3)) / np.isfinite(power).sum(axis=(1, 3))))

    def _interpolated(self, index: Floats) -> np.ndarray:
        """Values at fractional indices (2, n): complex, or moduli; NaN where no row saw the pixel."""
        low, high = np.floor(index.min(axis=1)).astype(int), np.ceil(index.max(axis=1)).astype(int) + 1
        low, high = np.maximum(low, 0), np.minimum(high, self.image.shape)
        rows, columns = slice(low[0], high[0]), slice(low[1], high[1])
        inner = index - low[:, None]
        gain: np.ndarray | float = self.image.gain
        if isinstance(gain, np.ndarray):
            gain = bilinear(gain[rows, columns], inner)
        scale = np.where(np.greater(gain, 0), 1 / np.maximum(gain, 1e-300), np.nan)
        if not self.image.is_complex:
            return np.sqrt(bilinear(np.asarray(self.image.data[rows, columns], np.float64), inner)) * scale
        carrier = self._carrier(low, high)
        doubled = double(self._baseband(low, high, carrier))
        values = kernel_sum(doubled, 2 * (inner + MARGIN)) * scale
        if not self.is_complex:
            return np.abs(values)
        positions = self.source.positions(rows, columns)
        at = np.stack([bilinear(positions[..., a], inner) for a in range(3)], axis=-1)
        return np.asarray(values * carrier(at))

    def _carrier(self, low: np.ndarray, high: np.ndarray) -> Carrier:
        """The carrier about the middle of pixels low ... high - 1."""
        cell = (low + high) // 2
        middle = self.source.positions(*(slice(n, n + 1) for n in np.minimum(cell, np.array(self.image.shape) - 1)))[0]
        if np.isnan(middle).any():
            places = self.source.positions(slice(low[0], high[0]), slice(low[1], high[1])).reshape(-1, 3)
            middle = places[np.isfinite(places[:, 0])][:1]
        tx, rx = antennas_of(self.image, "a map of a complex image", middle)
        if self.image.frequency is None:
            raise ValueError(
                "a map of a complex image needs its centre frequency; give it with dataclasses.replace(image, "
                "frequency=...), Hz"
            )
        return Carrier(self.image.frequency, middle[0], tx[0], rx[0])

    def _baseband(self, low: np.ndarray, high: np.ndarray, carrier: Carrier) -> np.ndarray:
        """Pixels low - MARGIN ... high + MARGIN - 1 without their carrier, complex128, 0 at the ends of the margin."""
        first, last = np.maximum(low - MARGIN, 0), np.minimum(high + MARGIN, self.image.shape)
        rows, columns = slice(first[0], last[0]), slice(first[1], last[1])
        chip = np.asarray(self.image.data[rows, columns])
        if not np.isfinite(chip).all():
            i, j = np.argwhere(~np.isfinite(chip))[0] + first
            raise ValueError(f"image data[{i}, {j}] is {self.image.data[i, j]}; every value must be finite")
        base = np.nan_to_num(chip * carrier(self.source.positions(rows, columns)).conj())
        shape = high - low + 2 * MARGIN
        out = np.zeros(shape, np.complex128)
        start = first - low + MARGIN
        out[start[0] : start[0] + base.shape[0], start[1] : start[1] + base.shape[1]] = base
        fall = np.sin(np.pi / 2 * (np.arange(MARGIN - TAPS) + 0.5) / (MARGIN - TAPS)) ** 2
        for axis, n in enumerate(shape):
            taper = np.ones(n)
            taper[: len(fall)], taper[n - len(fall) :] = fall, fall[::-1]
            out *= np.expand_dims(taper, 1 - axis)
        return out

    def jacobian(self, row: float, column: float) -> Floats | None:
        """Indices of the image per pixel of the map: (row, column) by (map's row, map's column) (2, 2), at a place of
        the map; None where the image is not there."""
        offsets = np.array([[0.0, 0.5, -0.5, 0, 0], [0, 0, 0, 0.5, -0.5]])
        x, y = self.axes.at(row + offsets[0], column + offsets[1])
        part = self.source.part(x, y)
        index = None if part is None else self.source.index(part, x, y)
        if index is None or not np.isfinite(index).all():
            return None
        return np.stack([index[:, 1] - index[:, 2], index[:, 3] - index[:, 4]], axis=-1)

    def check_aliasing(self) -> None:
        """ValueError where the spectrum of the image is wider than the map's pixels can hold."""
        chips = []
        for i in (0.25, 0.5, 0.75):
            for j in (0.25, 0.5, 0.75):
                row, column = i * (self.axes.shape[0] - 1), j * (self.axes.shape[1] - 1)
                jacobian = self.jacobian(row, column)
                if jacobian is not None:
                    chips.append((self._spectrum(row, column), jacobian))
        if not chips:
            return

        def aliased(factor: float) -> float:
            """Share of energy beyond half a cycle per pixel of a map whose spacing is a factor times as wide."""
            beyond = total = 0.0
            for (fi, fj, power), jacobian in chips:
                across = (np.abs(fi * jacobian[0, a] + fj * jacobian[1, a]) * factor > 0.5 for a in (0, 1))
                beyond += float(power[np.logical_or(*across)].sum())
                total += float(power.sum())
            return beyond / max(total, 1e-300)

        share = aliased(1.0)
        if share > ALIASED:
            factor = next((f for f in 0.9 ** np.arange(1, 60) if aliased(f) <= ALIASED), 0.5)
            fits = ", ".join(f"{d * factor:.3g}" for d in (self.axes.dy, self.axes.dx))
            raise ValueError(
                f"spacing ({self.axes.dy:g}, {self.axes.dx:g}) is coarser than the image's resolution: "
                f"{100 * share:.0f} % of its energy would alias in complex pixels; give spacing=({fits}), or "
                "value='amplitude', which is averaged"
            )

    def _spectrum(self, row: float, column: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Frequencies of rows and columns, cycles per pixel of the image, and the energy there, of the part about a
        place of the map."""
        x, y = self.axes.at(np.array([row]), np.array([column]))
        part = self.source.part(x, y)
        assert part is not None
        middle = np.rint(self.source.index(part, x, y)[:, 0]).astype(int)
        low = np.maximum(middle - CHIP // 2, 0)
        high = np.minimum(low + CHIP, self.image.shape)
        power = np.abs(np.fft.fft2(self._baseband(low, high, self._carrier(low, high)))) ** 2
        fi, fj = (np.fft.fftfreq(n) for n in power.shape)
        return fi[:, None], fj[None, :], power


def _heights_at(part: Part, index: Floats) -> Floats:
    """Heights above the ellipsoid, m (n,), at fractional indices (2, n) of the image: lines between pixels, and on."""
    heights, inner = wgs84.geodetic(part.positions)[2], index - np.array([[part.rows.start], [part.columns.start]])
    edge = np.clip(inner, 0, np.array(heights.shape)[:, None] - 1)
    return 2 * bilinear(heights, edge) - bilinear(heights, 2 * edge - inner)


@dataclass(frozen=True, eq=False)
class Carrier:
    """exp(j phi(x)) of positions x, with phi = 0 at `origin`: positions of origin and antennas, m (3,); f in Hz."""

    frequency: float
    origin: Floats
    tx: Floats
    rx: Floats

    def __call__(self, positions: Floats) -> np.ndarray:
        """Complex (...), of positions, m (..., 3)."""
        path: Floats | float = 0.0
        for end in (self.tx, self.rx):
            path = path + np.linalg.norm(positions - end, axis=-1) - np.linalg.norm(self.origin - end)
        return np.asarray(np.exp(2j * np.pi * self.frequency / SPEED_OF_LIGHT * path))


def double(values: np.ndarray) -> np.ndarray:
    """Band-limited values (n, m) at twice as many places, those between them too."""
    for axis in (0, 1):
        n = values.shape[axis]
        spectrum = np.fft.fftshift(np.fft.fft(values, axis=axis), axes=axis)
        before = n - n // 2
        pad = [(0, 0), (0, 0)]
        pad[axis] = (before, n - before)
        values = 2 * np.fft.ifft(np.fft.ifftshift(np.pad(spectrum, pad), axes=axis), axis=axis)
    return values


def kernel_sum(values: np.ndarray, index: Floats) -> np.ndarray:
    """Values (n,) at fractional indices (2, n) that lie TAPS/2 within the borders of samples (rows, columns)."""
    first = np.floor(index).astype(int) - TAPS // 2 + 1
    place, table = (index - np.floor(index)) * STEPS, _weights()
    step = place.astype(int)
    share = (place - step)[:, None]
    rows, columns = ((1 - w) * table[:, k] + w * table[:, k + 1] for w, k in zip(share, step, strict=True))
    flat, start = values.ravel(), first[0] * values.shape[1] + first[1]
    out = np.zeros(index.shape[1], values.dtype)
    for a in range(TAPS):
        line = np.zeros_like(out)
        for b in range(TAPS):
            line += columns[b] * flat[start + (a * values.shape[1] + b)]
        out += rows[a] * line
    return out


@cache
def _weights() -> Floats:
    """Weights of TAPS samples (TAPS, STEPS + 1) at even places between two of them."""
    distance = np.linspace(0, 1, STEPS + 1) + TAPS // 2 - 1 - np.arange(TAPS)[:, None]
    inside = np.maximum(1 - (2 * distance / TAPS) ** 2, 0)
    return np.asarray(np.sinc(distance) * np.i0(KAISER * np.sqrt(inside)) / np.i0(KAISER))


def bilinear(values: np.ndarray, index: Floats) -> np.ndarray:
    """Values (n,) between samples (rows, columns) at fractional indices (2, n), from the nearest beyond the borders."""
    size = np.array(values.shape)[:, None] - 1
    index = np.clip(index, 0, size)
    low = np.minimum(np.floor(index).astype(int), np.maximum(size - 1, 0))
    (i, j), (u, v) = low, index - low
    k, m = np.minimum(low + 1, size)
    return np.asarray(
        (1 - u) * ((1 - v) * values[i, j] + v * values[i, m]) + u * ((1 - v) * values[k, j] + v * values[k, m])
    )
