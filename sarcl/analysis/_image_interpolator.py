"""Interpolation of a complex image between its pixels.

    I(x)     exp(j phi(x)) sum_ab K(i - a) K(j - b) I_ab exp(-j phi(x_ab)),   (i, j) the pixel index of x
    phi(x)   2 pi f (tau(x) - tau(x_0)), the phase of a point's image at mid-aperture: its local spatial
             frequency is -f (u_T + u_R)/c cycles/m, u from x to the antennas: several cycles per pixel, too many for
             any kernel. It is computed exactly, so that its change over the image does not widen the band
    K        sinc with a Kaiser window of 90 dB, as long as the remaining band requires

reference: sarcl/reference/quality.py computes the exact sum instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base import constants
from ..model.image import Image
from ..model.maps.antennas import Ends, ends_at
from ._surface import Surface, has_surface, place_of, surface_at

CHIP = 32  # pixels on each side of the point from whose spectrum the occupied band is determined
LEAST = 8  # pixels on each side that a spectrum needs at least
BAND = 0.42  # cycles per pixel, largest occupied band: the kernel's transition takes the rest of 0.5
FALL = 1e-3  # spectral density over its largest value, below which the band ends
SHRINK = 0.9  # factor by which a cut is shortened whose ends lie too near to the border of a grid of terrain
KAISER = 8.96, 5.715  # shape, and pixels times transition width, for 90 dB by Kaiser's formulas


@dataclass(frozen=True, eq=False)
class ImageInterpolator:
    """Values of an image between pixels: called with positions m (n, 3) on the grid, it returns I, complex128 (n,).

    pixel    (row, column) of the response;  origin  x_0, its position, m (3,)
    surface  where positions and indices belong together: the grid, or a plane that touches it
    ends     positions of transmitter and receiver that the carrier follows from, m (3,) each
    taps     pixels along each axis from which a value is interpolated, even
    step     m, a quarter of the widest spacing that the response could have: a smaller one shows interpolation errors
    offset   cycles per pixel along rows and columns, which are left of the carrier and removed with it

    The error is at most 1e-4 of the nearby peak. Raises ValueError where a position lies within taps/2 pixels of the
    border, or a pixel is NaN or Inf.
    """

    image: Image
    pixel: tuple[int, int]
    origin: np.ndarray
    surface: Surface
    ends: Ends
    taps: int = 2
    step: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def about(cls, image: Image, row: int, column: int) -> ImageInterpolator:
        """An interpolator for the response at a pixel. Raises ValueError if the grid is too coarse or too small."""
        origin = place_of(image, row, column)
        plain = cls(image, (row, column), origin, surface_at(image, row, column), ends_at(image, origin))
        bands, offset = _bands(plain)
        # transition of the kernel: from the band's edge to its alias, 1 - 2 band cycles per pixel
        taps = 2 * int(np.ceil(KAISER[1] / (1 - 2 * max(bands)) / 2))
        widest = [
            s * BAND / max(b, 0.5 / CHIP) for s, b in zip(plain.surface.spacing_at(row, column), bands, strict=True)
        ]
        return replace(plain, taps=taps, offset=offset, step=min(widest) / 4)

    def touching(self, position: np.ndarray) -> tuple[ImageInterpolator, np.ndarray]:
        """The interpolator, with the surface at a position of its own, and that position on the grid, m (3,)."""
        row, column = self.surface.index(position)
        moved = replace(self, surface=surface_at(self.image, row, column))
        return moved, moved.surface.at(row, column)

    def __call__(self, position: np.ndarray) -> np.ndarray:
        index = self.surface.index(position)
        first = np.floor(index).astype(int) - self.taps // 2 + 1
        low, high = first.min(axis=0), first.max(axis=0) + self.taps
        if (low < 0).any() or (high > self.image.grid.shape).any():
            raise ValueError(
                f"a value between pixels needs {self.taps // 2} pixels on each side; the image of "
                f"{self.image.grid.shape} ends before that about {index[0].round(1)}: focus a larger grid"
            )
        chip = self.baseband(low, high)
        pixels = first[:, :, None] + np.arange(self.taps)  # (n, 2, taps)
        weight = _kernel(index[:, :, None] - pixels, self.taps)
        rows, columns = np.moveaxis(pixels - low[:, None], 1, 0)
        near = chip[rows[:, :, None], columns[:, None, :]]
        values = np.einsum("na,nb,nab->n", weight[:, 0], weight[:, 1], near)
        return values * self.carrier(position) * self._turned(index)

    def carrier(self, position: np.ndarray) -> np.ndarray:
        """exp(j phi(x)), complex (...), of positions, m (..., 3)."""
        assert self.image.frequency is not None
        path = np.zeros(position.shape[:-1])
        for end in self.ends:
            path += np.linalg.norm(position - end, axis=-1) - np.linalg.norm(self.origin - end)
        return np.asarray(np.exp(2j * np.pi * self.image.frequency / constants.SPEED_OF_LIGHT * path))

    def baseband(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Pixels low ... high - 1 (row, column) without their carrier, complex128; no others are read."""
        chip = np.asarray(self.image.data[low[0] : high[0], low[1] : high[1]])
        if not np.isfinite(chip).all():
            i, j = np.argwhere(~np.isfinite(chip))[0]
            raise ValueError(f"image data[{low[0] + i}, {low[1] + j}] is {chip[i, j]}; every value must be finite")
        i, j = np.arange(low[0], high[0])[:, None], np.arange(low[1], high[1])
        grid = self.image.grid
        if has_surface(grid):
            place = grid.at(i, j)
        else:
            place = grid.listed[low[0] : high[0], low[1] : high[1]]  # type: ignore[index]
            if np.isnan(place).any():
                raise ValueError(
                    f"cells of the grid within {int(max(high - low) // 2)} pixels of pixel {self.pixel} are empty; a "
                    "point is measured where all pixels about it have data"
                )
        turned = self._turned(np.stack(np.broadcast_arrays(i, j), axis=-1))
        return np.asarray(chip * self.carrier(place).conj() * np.conj(turned))

    def _turned(self, index: np.ndarray) -> np.ndarray | float:
        """exp(2 pi j offset (index - pixel)), complex (...), of indices (..., 2); 1 without an offset."""
        if not any(self.offset):
            return 1.0
        return np.asarray(np.exp(2j * np.pi * ((index - np.array(self.pixel)) @ np.array(self.offset))))

    def room(self, position: np.ndarray, axis: np.ndarray) -> float:
        """Largest distance, m, along +axis and -axis at which all pixels exist; 0 or less if some are missing here."""
        index = self.surface.index(position)
        slope = np.abs(self.surface.index(position + axis) - index)
        ahead = np.array(self.image.grid.shape) - 1 - self.taps // 2 - index
        behind = index - (self.taps // 2 - 1)
        with np.errstate(divide="ignore"):
            distance = float(((np.minimum(ahead, behind) - 1e-6) / slope).min())
        if (
            self.image.grid.times is not None
        ):  # rows and columns of terrain are not evenly spaced: the ends must fit too
            low, high = self.taps // 2 - 1, np.array(self.image.grid.shape) - 1 - self.taps // 2
            while distance > 0:
                ends = self.surface.index(position + distance * np.array([[-1.0], [1.0]]) * axis)
                if (ends >= low).all() and (ends <= high).all():
                    break
                distance *= SHRINK
        return distance


def _kernel(distance: np.ndarray, taps: int) -> np.ndarray:
    inside = np.maximum(1 - (2 * distance / taps) ** 2, 0)
    return np.sinc(distance) * np.i0(KAISER[0] * np.sqrt(inside)) / np.i0(KAISER[0])


def _bands(about: ImageInterpolator) -> tuple[list[float], tuple[float, float]]:
    """Largest frequencies, cycles per pixel, of the response at a pixel, along rows and along columns; and the middle
    of its band, where the response fits between its aliases about that, but not about the carrier."""
    row, column = about.pixel
    pixel, shape = np.array(about.pixel), np.array(about.image.grid.shape)
    half = np.minimum(CHIP, np.minimum(pixel, shape - 1 - pixel))
    if half.min() < LEAST:
        raise ValueError(
            f"the peak at pixel ({row}, {column}) of an image of {about.image.grid.shape} lies {half.min()} pixels "
            f"from the border; at least {LEAST}, and 3 resolution cells, are needed: focus a larger grid"
        )
    chip = about.baseband(pixel - half, pixel + half + 1)
    for axis in (0, 1):  # a Hann taper: truncation must not leak over the band
        taper = np.cos(np.pi / 2 * np.arange(-half[axis], half[axis] + 1) / (half[axis] + 1)) ** 2
        chip *= np.expand_dims(taper, 1 - axis)
    power = np.abs(np.fft.fft2(chip)) ** 2
    bands, offset = [], []
    for axis, name in ((0, "row"), (1, "column")):
        density = power.max(axis=1 - axis)  # not the sum: a rotated band ends in a thin corner
        frequency = np.abs(np.fft.fftfreq(len(density)))
        occupied = density > FALL * density.max()
        bands.append(float(frequency[occupied].max()))
        offset.append(0.0)
        if bands[-1] > BAND:
            offset[-1], around = _middle(occupied)
            if around > BAND:
                spacing = about.surface.spacing_at(row, column)[axis]
                raise ValueError(
                    f"the grid is coarser than the resolution: at a {name} spacing of {spacing:g} m the response "
                    f"fills +-{around:.2f} of +-0.5 cycles per pixel, more than +-{BAND}; focus again with a "
                    f"{name} spacing of at most {spacing / 2:g} m"
                )
            bands[-1] = around
    return bands, (offset[0], offset[1])


def _middle(occupied: np.ndarray) -> tuple[float, float]:
    """Middle and half width, cycles per pixel, of the band outside the longest run of frequencies (n,) that are not
    occupied; frequencies in the order of the FFT, which go round in a circle."""
    n, numbers = len(occupied), np.flatnonzero(occupied)
    gaps = np.diff(np.append(numbers, numbers[0] + n))
    k = int(gaps.argmax())
    low, width = numbers[(k + 1) % len(numbers)], n - gaps[k]  # the band begins behind the gap
    middle = (low + width / 2) / n
    return float(middle - np.rint(middle)), float(width / 2 / n)
