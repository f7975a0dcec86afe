"""Wavefronts of L1 and of local memory: how often a warp's load or store passes through, from replayed addresses.

Rules (docs/developers/gpu_static.md, "How wavefronts are counted"): a load from global memory takes one wavefront for
each line of 128 bytes that the warp touches; a load from local memory as many as different words of 4 bytes meet in one
of the 32 banks.
"""

from __future__ import annotations

import numpy as np

NEIGHBOURS = 8  # of kernels/backproject.cl
LINE, SECTOR, BANKS, WARP = 128, 32, 32, 32  # bytes of a line and of a sector of L1; banks; lanes


def _words(addresses: np.ndarray, width: int) -> np.ndarray:
    """Words of 4 bytes that loads touch: int (..., 32 width / 4) of addresses, bytes (..., 32)."""
    lanes = np.asarray(addresses, np.int64)[..., None] + np.arange(0, width, 4)
    return lanes.reshape(*lanes.shape[:-2], -1) // 4


def _different(values: np.ndarray) -> np.ndarray:
    """Number of different values along the last axis."""
    ordered = np.sort(values, axis=-1)
    return 1 + (np.diff(ordered, axis=-1) != 0).sum(axis=-1)


def global_wavefronts(addresses: np.ndarray, width: int = 4) -> np.ndarray:
    """Wavefronts of L1 of loads by one warp each: addresses, bytes (..., 32); width, bytes per lane."""
    return _different(_words(addresses, width) * 4 // LINE)


def sectors(addresses: np.ndarray, width: int = 4) -> np.ndarray:
    """Sectors of 32 bytes that loads by one warp each touch; arguments as for `global_wavefronts`."""
    return _different(_words(addresses, width) * 4 // SECTOR)


def local_wavefronts(addresses: np.ndarray, width: int = 4) -> np.ndarray:
    """Wavefronts of local memory of loads or stores by one warp each; arguments as for `global_wavefronts`."""
    words = _words(addresses, width)
    most = np.zeros(words.shape[:-1], np.int64)
    for bank in range(BANKS):
        here = np.where(words % BANKS == bank, words, -1)
        most = np.maximum(most, _different(here) - (here == -1).any(axis=-1))
    return most


def samples_of_pixels(
    samples_per_metre: float, side: int = 32, pixel: float = 0.25, incidence: float = 36.9, tiles: int = 40
) -> np.ndarray:
    """First sample of the range profile, complex numbers, for each pixel of tiles: int (tiles * side, side, side).

    Tiles stand anywhere in a scene of 2 km; pulses from 770 km, along a track of 17 km: X band, as in
    tests/gpu_static/tasks.py:spaceborne. incidence  degrees
    """
    random = np.random.default_rng(0)
    angle = np.radians(incidence)
    centre = random.uniform(-1000, 1000, (tiles, 1, 2))
    step = (np.arange(side) - (side - 1) / 2) * pixel
    down, right = np.meshgrid(step, step, indexing="ij")
    places = centre[..., None, :] + np.stack([right, down], axis=-1)[None]
    places = places.reshape(tiles, side, side, 2)
    along = random.uniform(-8.6e3, 8.6e3, (tiles, 1, 1))
    height, ground = 770e3 * np.cos(angle), 770e3 * np.sin(angle)
    reach = np.sqrt((ground - places[..., 0]) ** 2 + (along - places[..., 1]) ** 2 + height**2)
    return np.floor((reach - 770e3) * samples_per_metre).astype(np.int64) + 10**6


def gather(samples: np.ndarray, taps: int, per_item: int = 4, width: int = 4) -> tuple[float, float]:
    """Wavefronts and sectors per 32 contributions of the gather kernel's loads of samples.

    samples  as `samples_of_pixels` gives them: of `per_item` pixels each, NEIGHBOURS work-items have neighbouring ones
    width    bytes per load: 4 loads a real number, 8 a complex one
    """
    parts = samples.reshape(-1, WARP // NEIGHBOURS, per_item, NEIGHBOURS)  # pixels of a tile, row by row
    warps = parts.transpose(0, 2, 1, 3).reshape(-1, per_item, WARP)
    loads = np.arange(taps * 8 // width) * width
    addresses = 8 * warps[:, :, None, :] + loads[:, None]
    fronts = global_wavefronts(addresses, width).sum(axis=(1, 2)).mean() / per_item
    return float(fronts), float(sectors(addresses, width).sum(axis=(1, 2)).mean() / per_item)


def shared_lines(side: int, items: int, fine: int, line_taps: int, slope_taps: int) -> float:
    """Wavefronts of local memory per 32 contributions where backproject_shared_lines.cl adds a pulse to its sums.

    Arguments are the macros of the program. Where lines begin in T is random.
    """
    pixels, random = 4, np.random.default_rng(0)
    across, period = side // pixels, fine * pixels
    columns = fine * (2 * side + 16) // period + 1
    read = (pixels - 1) * fine + line_taps
    item = np.arange(items).reshape(-1, WARP)
    lane, first_line = item % across, item // across
    lines = first_line[None] + np.arange(0, side, items // across)[:, None, None]  # (lines of an item, warps, 32)
    start = random.integers(0, fine * side, side)
    at = (start % period * columns + start // period)[lines]
    samples = 8 * (at + lane + (np.arange(read) * columns)[:, None, None, None])
    total = local_wavefronts(samples, 8).sum() + local_wavefronts(4 * lines).sum()
    for taps in filter(None, (line_taps, slope_taps)):
        pairs = np.arange(taps // 2)[:, None, None, None]
        total += local_wavefronts(16 * (lines * (taps // 2) + pairs), 16).sum()
    return float(total) * WARP / side**2
