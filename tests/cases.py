"""Echoes, grids and errors that several tests share."""

from __future__ import annotations

import numpy as np

import sarcl
from sarcl.reference.backproject import backproject as exact_image


def noise_history(
    *,
    n_rows=40,
    n_samples=48,
    distance=10e3,
    center=9.6e9,
    bandwidth=600e6,
    bistatic=False,
    arc=0.07,
    seed=0,
    **fields,
):
    """White noise in every sample, on a slightly random arc at `distance`: nothing is left to chance alignment."""
    random = np.random.default_rng(seed)
    angle = arc * (np.arange(n_rows) / max(n_rows - 1, 1) - 0.5)
    tx = distance * np.stack([0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(n_rows, 0.714)], axis=1)
    tx += random.standard_normal((n_rows, 3)) * min(1.0, distance / 100)
    rx = tx + distance * np.array([0.1, 0.2, 0.0]) if bistatic else None
    there = np.linalg.norm(tx, axis=1)
    back = there if rx is None else np.linalg.norm(rx, axis=1)
    samples = random.standard_normal((n_rows, n_samples)) + 1j * random.standard_normal((n_rows, n_samples))
    return sarcl.PhaseHistory(
        samples.astype(np.complex64),
        frequency=center - bandwidth / 2,
        frequency_step=bandwidth / n_samples,
        tx=tx,
        rx=rx,
        reference_range=(there + back) / 2,
        **fields,
    )


def image_error(image, raw, wrap=False, **weights):
    """L2 error of an image against the exact sum, relative as the accuracy contract says."""
    wanted, random_norm = exact_image(raw, image.grid.positions.reshape(-1, 3), wrap=wrap, **weights)
    got = np.asarray(image.data).ravel()
    return float(np.linalg.norm(got - wanted) / max(np.linalg.norm(wanted), random_norm))
