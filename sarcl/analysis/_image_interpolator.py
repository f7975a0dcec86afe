"""Interpolation of a complex image between its pixels.

    I(x)     exp(j phi(x)) sum_ab K(i - a) K(j - b) I_ab exp(-j phi(x_ab)),   (i, j) the pixel index of x
    phi(x)   2 pi f (tau(x) - tau(x_0)), the phase of a point's image at mid-aperture: its local spatial
             frequency is -f (u_T + u_R)/c cycles/m, u from x to the antennas: several cycles per pixel, too many for
             any kernel. It is computed exactly, so that its change over the image does not widen the band
    K        sinc with a Kaiser window of 90 dB, as long as the remaining band requires

reference: sarcl/reference/quality.py computes the exact sum instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import constants
from ..model.image import Image

CHIP = 32  # pixels on each side of the point from whose spectrum the occupied band is determined
LEAST = 8  # pixels on each side that a spectrum needs at least
BAND = 0.42  # cycles per pixel, largest occupied band: the kernel's transition takes the rest of 0.5
FALL = 1e-3  # of the largest spectral density: the band ends where the density stays below it
SHRINK = 0.9  # factor by which a cut is shortened whose ends lie too near to the border of a grid of terrain
KAISER = 8.96, 5.715  # shape, and pixels times transition width, for 90 dB by Kaiser's formulas


@dataclass(frozen=True, eq=False)
class ImageInterpolator:
    """Values of an image between pixels: called with positions m (n, 3) on the grid, it returns I, complex128 (n,).

    origin  x_0, m (3,); the values depend on it by rounding alone
    taps    pixels along each axis from which a value is interpolated, even

    The error is at most 1e-4 of the nearby peak. Raises ValueError where a position lies within taps/2 pixels of the
    border, or a pixel is NaN or Inf.
    """

    image: Image
    origin: np.ndarray
    taps: int

    @classmethod
    def about(cls, image: Image, row: int, column: int) -> ImageInterpolator:
        """An interpolator for the response at a pixel. Raises ValueError if the grid is too coarse or too small."""
        origin = image.grid.at(row, column)
        band = max(_bands(image, origin, row, column))
        # transition of the kernel: from the band's edge to its alias, 1 - 2 band cycles per pixel
        return cls(image, origin, 2 * int(np.ceil(KAISER[1] / (1 - 2 * band) / 2)))

    def __call__(self, position: np.ndarray) -> np.ndarray:
        index = self.image.grid.index(position)
        first = np.floor(index).astype(int) - self.taps // 2 + 1
        low, high = first.min(axis=0), first.max(axis=0) + self.taps
        if (low < 0).any() or (high > self.image.grid.shape).any():
            raise ValueError(
                f"a value between pixels needs {self.taps // 2} pixels on each side; the image of "
                f"{self.image.grid.shape} ends before that about {index[0].round(1)}: focus a larger grid"
            )
        chip = _baseband(self.image, self.origin, low, high)
        taken = first[:, :, None] + np.arange(self.taps)  # (n, 2, taps)
        weight = _kernel(index[:, :, None] - taken, self.taps)
        rows, columns = np.moveaxis(taken - low[:, None], 1, 0)
        near = chip[rows[:, :, None], columns[:, None, :]]
        values = np.einsum("na,nb,nab->n", weight[:, 0], weight[:, 1], near)
        return values * _carrier(self.image, self.origin, position)

    def room(self, position: np.ndarray, axis: np.ndarray) -> float:
        """Largest distance, m, along +axis and -axis at which all pixels exist; 0 or less if some are missing here."""
        here = self.image.grid.index(position)
        slope = np.abs(self.image.grid.index(position + axis) - here)
        ahead = np.array(self.image.grid.shape) - 1 - self.taps // 2 - here
        behind = here - (self.taps // 2 - 1)
        with np.errstate(divide="ignore"):
            made = float(((np.minimum(ahead, behind) - 1e-6) / slope).min())
        if not self.image.grid.is_plane:  # rows and columns of terrain are not evenly spaced: the ends must fit too
            low, high = self.taps // 2 - 1, np.array(self.image.grid.shape) - 1 - self.taps // 2
            while made > 0:
                ends = self.image.grid.index(position + made * np.array([[-1.0], [1.0]]) * axis)
                if (ends >= low).all() and (ends <= high).all():
                    break
                made *= SHRINK
        return made


def antennas(image: Image) -> tuple[np.ndarray, np.ndarray]:
    """Positions of transmitter and receiver at mid-aperture, m (3,)."""
    assert image.tx is not None
    return image.tx, image.tx if image.rx is None else image.rx


def _carrier(image: Image, origin: np.ndarray, position: np.ndarray) -> np.ndarray:
    """exp(j phi(x)), complex (...), of positions, m (..., 3)."""
    assert image.frequency is not None
    path = np.zeros(position.shape[:-1])
    for end in antennas(image):
        path += np.linalg.norm(position - end, axis=-1) - np.linalg.norm(origin - end)
    return np.exp(2j * np.pi * image.frequency / constants.SPEED_OF_LIGHT * path)


def _kernel(distance: np.ndarray, taps: int) -> np.ndarray:
    inside = np.maximum(1 - (2 * distance / taps) ** 2, 0)
    return np.sinc(distance) * np.i0(KAISER[0] * np.sqrt(inside)) / np.i0(KAISER[0])


def _baseband(image: Image, origin: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Pixels low ... high - 1 (row, column) without their carrier, complex128; no others are read."""
    chip = np.asarray(image.data[low[0] : high[0], low[1] : high[1]])
    if not np.isfinite(chip).all():
        i, j = np.argwhere(~np.isfinite(chip))[0]
        raise ValueError(f"image data[{low[0] + i}, {low[1] + j}] is {chip[i, j]}; every value must be finite")
    place = image.grid.at(np.arange(low[0], high[0])[:, None], np.arange(low[1], high[1]))
    return chip * _carrier(image, origin, place).conj()


def _bands(image: Image, origin: np.ndarray, row: int, column: int) -> list[float]:
    """Largest frequencies, cycles per pixel, of the response at a pixel, along rows and along columns."""
    at, shape = np.array([row, column]), np.array(image.grid.shape)
    half = np.minimum(CHIP, np.minimum(at, shape - 1 - at))
    if half.min() < LEAST:
        raise ValueError(
            f"the peak at pixel ({row}, {column}) of an image of {image.grid.shape} lies {half.min()} pixels "
            f"from the border; at least {LEAST}, and 3 resolution cells, are needed: focus a larger grid"
        )
    chip = _baseband(image, origin, at - half, at + half + 1)
    for axis in (0, 1):  # a Hann taper: truncation must not leak over the band
        taper = np.cos(np.pi / 2 * np.arange(-half[axis], half[axis] + 1) / (half[axis] + 1)) ** 2
        chip *= np.expand_dims(taper, 1 - axis)
    power = np.abs(np.fft.fft2(chip)) ** 2
    bands = []
    for axis, name in ((0, "row"), (1, "column")):
        density = power.max(axis=1 - axis)  # not the sum: a rotated band ends in a thin corner
        frequency = np.abs(np.fft.fftfreq(len(density)))
        bands.append(float(frequency[density > FALL * density.max()].max()))
        if bands[-1] > BAND:
            spacing = image.grid.spacing_at(row, column)[axis]
            raise ValueError(
                f"the grid is coarser than the resolution: at a {name} spacing of {spacing:g} m the response "
                f"fills +-{bands[-1]:.2f} of +-0.5 cycles per pixel, more than +-{BAND}; focus again with a "
                f"{name} spacing of at most {spacing / 2:g} m (or correct image.frequency, tx and rx)"
            )
    return bands
