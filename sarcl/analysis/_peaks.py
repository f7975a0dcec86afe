"""The pixel to measure: the brightest, or the peak near a position."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation
from ..model.image import Image
from ._surface import pixel_of, place_of, surface_at


def brightest(image: Image) -> tuple[int, int]:
    """Row and column of the pixel of largest modulus; rows are read in blocks."""
    best, pixel = 0.0, None
    n_rows, n_columns = image.grid.shape
    block = max(1, 2**22 // n_columns)
    for first in range(0, n_rows, block):
        part = np.asarray(image.data[first : first + block])
        validation.finite("image data", part, first_row=first)
        level = np.abs(part)
        i = int(level.argmax())
        if level.flat[i] > best:
            best, pixel = float(level.flat[i]), (first + i // n_columns, i % n_columns)
    if pixel is None:
        raise ValueError("the image is zero everywhere; there is no point to measure")
    return pixel


def brightest_around(image: Image, position: np.ndarray, reach: float) -> tuple[int, int]:
    """Row and column of the brightest pixel within `reach` m of a position or, as long as one is brighter, of that."""
    shape = np.array(image.grid.shape)
    pixel = np.clip(np.rint(pixel_of(image, position)).astype(int), 0, shape - 1)
    spacing = surface_at(image, *pixel).spacing_at(*pixel)
    half = np.ceil(reach / np.array(spacing)).astype(int)
    while True:
        low, high = np.maximum(pixel - half, 0), np.minimum(pixel + half + 1, shape)
        level = np.abs(np.asarray(image.data[low[0] : high[0], low[1] : high[1]]))
        level = np.where(np.isfinite(level), level, 0)
        peak = np.array(np.unravel_index(level.argmax(), level.shape)) + low
        if not level.max() > level[tuple(pixel - low)]:
            return int(pixel[0]), int(pixel[1])
        pixel = peak


def peak_near(image: Image, near: ArrayLike) -> tuple[int, int]:
    """Row and column of the highest peak within two cells of `near`; the cell is the peak's half-power width."""
    near = validation.array("near", near, np.float64, (3,))
    shape = np.array(image.grid.shape)
    index = pixel_of(image, near)
    start = np.rint(index).astype(int)
    if (start < 0).any() or (start >= shape).any():
        raise ValueError(f"near {place(near)} is pixel {place(index, 1)}, outside the image of {image.grid.shape}")
    radius = np.array([2, 2])
    while True:
        low, high = np.maximum(start - 4 * radius, 0), np.minimum(start + 4 * radius + 1, shape)
        level = np.abs(np.asarray(image.data[low[0] : high[0], low[1] : high[1]]))
        if not np.isfinite(level).all():
            raise ValueError(f"image data are NaN or Inf near {place(near)}; every value must be finite")
        a, b = np.maximum(start - radius, 0) - low, start + radius + 1 - low
        searched = level[a[0] : b[0], a[1] : b[1]]
        i, j = np.array(np.unravel_index(searched.argmax(), searched.shape)) + a
        if level[i, j] == 0:
            raise ValueError(f"the image is zero around near {place(near)}; there is no point to measure")
        cells = 2 * np.array([_run(level[:, j], i), _run(level[i], j)])
        if (cells <= radius).all():
            break
        radius = np.maximum(radius, cells)
    if level[i, j] < level[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2].max():
        uphill = place_of(image, int(i + low[0]), int(j + low[1]))
        raise ValueError(
            f"no peak lies within two resolution cells of near {place(near)}; the image still rises at "
            f"{place(uphill)}: move near to the point, or leave it out to measure the brightest"
        )
    return int(i + low[0]), int(j + low[1])


def _run(level: np.ndarray, index: int) -> int:
    """Number of contiguous pixels about `at` where the power is at least half of that at `at`."""
    below = level**2 < level[index] ** 2 / 2
    after = below[index:].argmax() if below[index:].any() else len(level) - index
    before = below[index::-1].argmax() if below[index::-1].any() else index + 1
    return int(after + before - 1)


def place(position: np.ndarray, digits: int = 3) -> str:
    """A position as text for messages; + 0.0 replaces a rounded -0 by 0."""
    return "(" + ", ".join(f"{x + 0.0:.{digits}f}" for x in np.round(position, digits)) + ")"
