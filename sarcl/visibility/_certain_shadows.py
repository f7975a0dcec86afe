"""Pairs of a facet and an occluder whose shadow misses the facet, or covers it, at all pulses of a few."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers

KERNELS = "certain_shadows.cl"
MISSED, UNDECIDED, COVERED = 0, 1, 2  # as in the kernel
# Of the distance to antennas: a box about them that is flatter than this is a rectangle, or a line. Shadows move by
# about the distance beside an edge at which the kernels of lit parts look
FLAT = 1e-13


def certain_shadows(
    device: Device, buffers: Sequence[object], n_pairs: int, antennas: np.ndarray, margin: float = 0.0
) -> np.ndarray:
    """UNDECIDED, MISSED or COVERED, for each pair, uint8 (n_pairs,).

    buffers   receivers, the receiver and the occluder of each pair, and occluders, as kernels of lit parts read them
    antennas  of the pulses, m (n_pulses, 1 or 2, 3), about the same origin; others stand up to `margin`, m, from these
    """
    boxes = [box_about(antennas[:, end], margin) for end in range(antennas.shape[1])]
    most = max(len(box) for box in boxes)
    eyes = np.stack([np.concatenate([box, np.repeat(box[-1:], most - len(box), axis=0)]) for box in boxes])
    state = device.empty(n_pairs)
    kernel = device.kernel(KERNELS, "certain_shadows", ENDS=len(eyes))
    numbers = launch_numbers(KERNELS, "certain_shadows", n_eyes=most)
    device.run(kernel, (n_pairs,), None, numbers, *buffers, device.upload(eyes), state)
    return device.download(state, np.empty(n_pairs, np.uint8))


def box_about(positions: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Corners of a small box that holds positions, m (n, 3), and what is up to `margin`, m, from them: 1 of a point, 2
    of a line, 4 or 8, (m, 3)."""
    middle = positions.mean(axis=0)
    away = positions - middle
    axes = np.linalg.eigh(away.T @ away)[1].T
    along = away @ axes.T
    corners = middle[None]
    flat = FLAT * float(np.linalg.norm(positions, axis=1).max())
    for least, most, axis in zip(along.min(axis=0) - margin, along.max(axis=0) + margin, axes, strict=True):
        ends = [least, most] if most - least > flat else [(least + most) / 2]
        corners = (corners[:, None] + np.multiply.outer(ends, axis)).reshape(-1, 3)
    return corners
