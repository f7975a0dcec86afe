"""Point response: where a reflector is, how sharp it is and how high its side lobes stand.

    value(x)   I(x) between pixels: the carrier exp(j 2 pi k.x), k = -f (u_T + u_R)/c turns/m with u from x to the antennas,
               is taken off the pixels, a Kaiser-windowed sinc interpolates along rows and columns, the carrier is put back
    range      direction in the grid's plane in which the two-way path grows fastest, -(u_T + u_R) projected on the plane
    cross      the direction in the plane that is perpendicular to it

docs/measure.md states the conventions; reference/quality.py measures an exact image by brute force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import check
from .image import Image

REACH = 10.0  # side lobes count within so many IRW of the peak
LEAST_REACH = 3.0
CHIP = 64  # pixels a side whose spectrum tells how much of the sampling rate the response fills
BAND = 0.42  # cycles a pixel that the response may fill: the interpolator needs the rest of 0.5 to stay short
FALL = 1e-2  # the band ends where the spectrum's density stays below this part of its largest
STEP = 1 / 32  # of an IRW, between points of a cut


@dataclass(frozen=True, eq=False)
class PointResponse:
    """A point's response; pairs are (range, cross-range) as projected on the grid.

    position  of the interpolated peak, m (3,)
    irw       width at half power (-3.01 dB), m
    pslr      highest lobe outside the first nulls over the peak, dB of power
    islr      energy outside the first nulls, within +-`reach` IRW, over the energy between the nulls, dB
    peak      complex value of the image at `position`, in the unit of its data; peak/gain is the amplitude
    gain      the image's gain
    reach     IRW on each side that PSLR and ISLR cover: 10, or what the image holds
    """

    position: np.ndarray
    irw: tuple[float, float]
    pslr: tuple[float, float]
    islr: tuple[float, float]
    peak: complex
    gain: float = 1.0
    reach: tuple[float, float] = (REACH, REACH)

    def __str__(self) -> str:
        x, y, z = self.position
        amplitude = abs(self.peak) / self.gain
        level = 20 * np.log10(amplitude)
        rows = (("IRW at -3.01 dB", self.irw, ".4f", "m"), ("PSLR", self.pslr, ".2f", "dB"), ("ISLR", self.islr, ".2f", "dB"))
        return "\n".join(
            [
                f"position         ({x:.4f}, {y:.4f}, {z:.4f}) m",
                f"peak             {abs(self.peak):.6g}, phase {np.angle(self.peak):.4f} rad",
                f"peak/gain        {amplitude:.6g}, RCS {level:.2f} dBsm",
                f"{'':15}{'range':>12}{'cross-range':>14}",
                *(f"{name:15}{a:>12{form}}{b:>14{form}} {unit}" for name, (a, b), form, unit in rows),
                f"{'lobes within +-':15}{self.reach[0]:>12.1f}{self.reach[1]:>14.1f} IRW",
            ]
        )


def measure(image: Image, near: Any = None) -> PointResponse:
    """Position, resolution and side lobes of one point of a complex image on a plane.

    image  with frequency (Hz) and tx, rx (m; rx None is tx); of its data only what is needed is read
    near   m (3,), projected on the plane along its normal: the highest peak within two resolution cells of it is
           measured. Default: the brightest pixel, looked for in blocks of rows

    Cuts through the interpolated peak run along range and cross-range projected on the grid. IRW is the half-power
    width; PSLR is the highest lobe outside the first nulls; ISLR takes the main lobe from null to null and all within
    +-10 IRW, or as far as the image reaches. A uniform aperture has -13.26 and -10.22 dB.
    ValueError for a detected image, a grid of listed points, no frequency or tx, an image of zeros, NaN or Inf, a
    `near` outside of the grid or without a peak, a response closer than 3 IRW to the border or in a stronger one's
    side lobes, and a grid coarser than the resolution: one where the response fills more than +-0.42 cycles a pixel.
    """
    _refuse(image)
    row, column = _brightest(image) if near is None else _peak_near(image, near)
    surface, axes = _surface(image, row, column)
    step = min(image.grid.spacing or ()) / 4
    position = _climb(surface, surface.grid.at(row, column), axes, step)
    peak = complex(surface(position[None])[0])
    cuts = [
        _cut(lambda t, a=axis: np.abs(surface(position + np.multiply.outer(t, a))) ** 2, surface.room(position, axis), step, name)
        for axis, name in zip(axes, ("range", "cross-range"), strict=True)
    ]
    for cut, axis, name in zip(cuts, axes, ("range", "cross-range"), strict=True):
        if cut.pslr >= 0:
            x, y, z = position + cut.lobe * axis
            raise ValueError(
                f"the peak at {_place(position)} lies in the response of something {cut.pslr:.1f} dB stronger, "
                f"{abs(cut.lobe):.3g} m away in {name}; measure that one with near=({x:.3f}, {y:.3f}, {z:.3f})"
            )
    position.flags.writeable = False
    irw, pslr, islr, reach = (tuple(getattr(c, n) for c in cuts) for n in ("irw", "pslr", "islr", "reach"))
    return PointResponse(position, irw, pslr, islr, peak, image.gain, reach)


def _refuse(image: Image) -> None:
    if not image.is_complex:
        raise ValueError("the image is detected (multilooked): its phase is gone; measure the complex image instead")
    if not image.grid.is_plane:
        raise ValueError("the grid lists its points; cuts need a plane: focus on an ImageGrid.plane")
    for name, what in (("frequency", "the centre frequency, Hz"), ("tx", "the antenna at mid-aperture, m (3,)")):
        if getattr(image, name) is None:
            raise ValueError(f"image.{name} is None; the carrier follows from it: set {name} to {what}, with replace()")


@dataclass(frozen=True, eq=False)
class _Surface:
    """The image between its pixels: called with positions m (n, 3), returns I complex128 (n,).

    carrier  turns a row and turns a column
    taps     pixels a side that a value is made of, even
    """

    image: Image
    carrier: tuple[float, float]
    taps: int

    @property
    def grid(self) -> Any:
        return self.image.grid

    def __call__(self, position: np.ndarray) -> np.ndarray:
        index = self.grid.index(position)
        first = np.floor(index).astype(int) - self.taps // 2 + 1
        low, high = first.min(axis=0), first.max(axis=0) + self.taps
        chip = _baseband(self.image, self.carrier, low, high)
        taken = first[:, :, None] + np.arange(self.taps)  # (n, 2, taps)
        weight = _kernel(index[:, :, None] - taken, self.taps)
        rows, columns = np.moveaxis(taken - low[:, None], 1, 0)
        values = np.einsum("na,nb,nab->n", weight[:, 0], weight[:, 1], chip[rows[:, :, None], columns[:, None, :]])
        return values * np.exp(2j * np.pi * (index @ np.array(self.carrier)))

    def room(self, position: np.ndarray, axis: np.ndarray) -> float:
        """How far a cut may run along +-axis before it wants pixels outside of the image, m."""
        here = self.grid.index(position)
        slope = np.abs(self.grid.index(position + axis) - here)
        ahead = np.array(self.grid.shape) - 1 - self.taps // 2 - here
        behind = here - (self.taps // 2 - 1)
        with np.errstate(divide="ignore"):
            return float(((np.minimum(ahead, behind) - 1e-6) / slope).min())


def _kernel(distance: np.ndarray, taps: int) -> np.ndarray:
    """sinc under a Kaiser window of 90 dB, `taps` pixels wide."""
    inside = np.maximum(1 - (2 * distance / taps) ** 2, 0)
    return np.sinc(distance) * np.i0(8.96 * np.sqrt(inside)) / np.i0(8.96)


def _baseband(image: Image, carrier: tuple[float, float], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Pixels low ... high - 1 (row, column) without their carrier, complex128."""
    chip = np.asarray(image.data[low[0] : high[0], low[1] : high[1]]).astype(np.complex128)
    if not np.isfinite(chip).all():
        i, j = np.argwhere(~np.isfinite(chip))[0] + low
        raise ValueError(f"image data[{i}, {j}] is {chip[i - low[0], j - low[1]]}; every value must be finite")
    for axis in (0, 1):
        turns = carrier[axis] * np.arange(low[axis], high[axis])
        chip *= np.expand_dims(np.exp(-2j * np.pi * turns), 1 - axis)
    return chip


def _surface(image: Image, row: int, column: int) -> tuple[_Surface, tuple[np.ndarray, np.ndarray]]:
    """The image about a pixel, and the unit vectors of range and cross-range on its plane."""
    grid = image.grid
    x = grid.at(row, column)
    antennas = (image.tx, image.tx if image.rx is None else image.rx)
    toward = sum(check.direction("from the point to the antenna", a - x) for a in antennas)
    along = -(toward - (toward @ grid.normal) * grid.normal)
    if np.linalg.norm(along) < 1e-3:
        raise ValueError("the antennas stand straight above the grid: range has no direction on it; tilt the grid")
    range_axis = along / np.linalg.norm(along)
    turns = -image.frequency / check.SPEED_OF_LIGHT * toward
    carrier = (float(turns @ grid.y_axis) * grid.spacing[0], float(turns @ grid.x_axis) * grid.spacing[1])
    band = _band(image, carrier, row, column)
    # Kaiser's rule for 90 dB and a transition from +-band to its alias, 1 - 2 band cycles a pixel
    surface = _Surface(image, carrier, 2 * int(np.ceil(2.86 / (1 - 2 * band))))
    return surface, (range_axis, np.cross(grid.normal, range_axis))


def _band(image: Image, carrier: tuple[float, float], row: int, column: int) -> float:
    """Largest frequency, cycles a pixel, that a response fills along rows or columns."""
    at, shape = np.array([row, column]), np.array(image.grid.shape)
    half = np.minimum(CHIP // 2, np.minimum(at, shape - 1 - at))
    if half.min() < 8:
        raise ValueError(
            f"the peak at pixel ({row}, {column}) of an image of {tuple(shape)} lies {half.min()} pixels from the "
            "border; a point response needs at least 8, and 3 resolution cells: focus a larger grid about it"
        )
    chip = _baseband(image, carrier, at - half, at + half + 1)
    for axis in (0, 1):  # a Hann taper, so that what leaves the chip does not leak over the band
        chip *= np.expand_dims(np.cos(np.pi * np.arange(-half[axis], half[axis] + 1) / (2 * half[axis] + 2)) ** 2, 1 - axis)
    power = np.abs(np.fft.fft2(chip)) ** 2
    bands = []
    for axis, name in ((0, "row"), (1, "column")):
        density = power.sum(axis=1 - axis)
        filled = np.abs(np.fft.fftfreq(len(density)))[density > FALL * density.max()].max()
        if filled > BAND:
            spacing = image.grid.spacing[axis]  # type: ignore[index]
            raise ValueError(
                f"the grid is coarser than the resolution along its {name}s: at a spacing of {spacing:g} m the response "
                f"fills +-{filled:.2f} of +-0.5 cycles a pixel, measuring needs +-{BAND}; focus again with a {name} "
                f"spacing of at most {spacing / 2:g} m (or check image.frequency, tx and rx)"
            )
        bands.append(filled)
    return float(max(bands))


def _brightest(image: Image) -> tuple[int, int]:
    """Pixel of the largest modulus; rows are read in blocks."""
    best, at = 0.0, None
    n_rows, n_columns = image.grid.shape
    step = max(1, 2**22 // n_columns)
    for first in range(0, n_rows, step):
        block = np.asarray(image.data[first : first + step])
        check.finite("image data", block, first_row=first)
        level = np.abs(block)
        i = int(level.argmax())
        if level.flat[i] > best:
            best, at = float(level.flat[i]), (first + i // n_columns, i % n_columns)
    if at is None:
        raise ValueError("the image is zero everywhere; there is no point to measure")
    return at


def _peak_near(image: Image, near: Any) -> tuple[int, int]:
    """Pixel of the highest peak within two resolution cells of `near`; a cell is what its own half power spans."""
    grid = image.grid
    place = grid.index(check.array("near", near, np.float64, (3,)))
    shape = np.array(grid.shape)
    start = np.rint(place).astype(int)
    if (start < 0).any() or (start >= shape).any():
        raise ValueError(
            f"near {_place(np.asarray(near, float))} falls on pixel ({place[0]:.1f}, {place[1]:.1f}), outside of the image of {grid.shape}"
        )
    radius = 2
    while True:
        # one pixel more than is searched, so that a peak on the search's edge is told from a slope
        low, high = np.maximum(start - radius - 1, 0), np.minimum(start + radius + 2, shape)
        level = np.abs(np.asarray(image.data[low[0] : high[0], low[1] : high[1]]))
        check.finite("image data near the point", level)
        ring = np.pad(level, 1, constant_values=-1)
        peaks = np.all([level >= ring[1 + i : ring.shape[0] - 1 + i, 1 + j : ring.shape[1] - 1 + j] for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)
        del peaks
        break
    raise NotImplementedError
