"""Geometry of the rows as kernels/geometry_float64.clh lays it out, in float64 and pairs of float64."""

from __future__ import annotations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...model.phase_history import PhaseHistory
from ...numerics.double_double import exact_product, exact_sum, quotient
from ...numerics.pulse_geometry import PulseGeometry


def packed(raw: PhaseHistory, antennas: PulseGeometry, length: int, start: int, stop: int, lanes: int) -> np.ndarray:
    """Array per pulse (components, n) of rows start ... stop - 1 for profiles of `length` samples, in the order of
    kernels/geometry_float64.clh.

    n is rounded up to whole vectors of `lanes` by repeating the last row. Positions and reference ranges are float64
    as given, so exact; what is derived from frequencies comes in pairs: kappa = 2 fc/c with fc the frequency of
    sample n_samples//2, sigma = 2 df length/c, limit = c/(4 df).
    """
    n = -(-(stop - start) // lanes) * lanes
    rows = np.minimum(np.arange(start, start + n), stop - 1)
    step = raw.frequency_step[rows]
    hi, lo = exact_product(float(raw.n_samples // 2), step)
    carrier, low = exact_sum(raw.frequency[rows], hi)
    kappa = quotient(exact_sum(carrier, low + lo), SPEED_OF_LIGHT / 2)
    sigma = quotient(exact_product(float(length), step), SPEED_OF_LIGHT / 2)
    limit = quotient((np.full(n, SPEED_OF_LIGHT / 4), np.zeros(n)), step)
    components = [*raw.tx[rows].T, raw.reference_range[rows], *kappa, *sigma, *limit]
    if not antennas.is_monostatic:
        components += list(antennas.rx[rows].T)
    if antennas.beam is not None:
        half = np.full(n, antennas.beam_angle / 2)
        components += [*antennas.beam[rows].T, np.cos(half), np.sin(half)]
    return np.stack(components)
