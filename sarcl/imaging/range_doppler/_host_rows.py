"""Rows of samples with weights and one reference range, made on the host; bytes for large arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...model.phase_history import PhaseHistory
from ...opencl.device import Device
from ..focusing_task import weighted_rows
from ._plan import FocusPlan
from ._track import Track

ARRAYS = 3  # large arrays that share the memory of the host: rows, spectra, compressed bins


@dataclass(frozen=True)
class Budget:
    """Bytes for blocks on the device, and for large arrays in the memory of the host; beyond, these go to files."""

    device: float
    host: float


@dataclass(frozen=True, eq=False)
class Job:
    """Echoes that a plan focuses on a device; weights  of samples (n_samples,) and of rows (n_rows,)."""

    device: Device
    plan: FocusPlan
    raw: PhaseHistory
    track: Track
    weights: tuple[np.ndarray, np.ndarray]
    budget: Budget


def turns(raw: PhaseHistory, start: int, stop: int, center: float) -> tuple[np.ndarray, np.ndarray]:
    """Cycles, less whole ones, that give rows start ... stop - 1 the reference range `center`, m.

    Of their first samples, and from one sample to the next, float64 (n,).
    """
    moved = 2 / np.longdouble(SPEED_OF_LIGHT) * (center - raw.reference_range[start:stop].astype(np.longdouble))
    return (moved * raw.frequency[0] % 1).astype(np.float64), (moved * raw.frequency_step[0] % 1).astype(np.float64)


def referenced(job: Job, start: int, stop: int) -> tuple[np.ndarray, float]:
    """Weighted rows start ... stop - 1 with the plan's reference range: complex64; and their largest modulus."""
    raw = job.raw
    samples, largest = weighted_rows(raw, job.weights, start, stop)
    first, step = (cycles[:, None] for cycles in turns(raw, start, stop, job.plan.center))
    # n = width a + b: exp(j 2 pi n s) is a product of one power for each digit, which takes far fewer exponentials
    width = int(np.ceil(np.sqrt(raw.n_samples)))
    high = np.exp(2j * np.pi * (first + step * width * np.arange(-(-raw.n_samples // width)))).astype(np.complex64)
    low = np.exp(2j * np.pi * step * np.arange(width)).astype(np.complex64)
    turned = (high[:, :, None] * low[:, None, :]).reshape(stop - start, -1)[:, : raw.n_samples]
    return (samples * turned).astype(np.complex64), largest
