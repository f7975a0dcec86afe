"""Gradients of Re <y, A x> where an antenna has gains: of its pointing, and of what its gains do not depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..scattering.antenna_weights import AntennaWeights
from ._float32_pair import PointEchoes
from ._measurement import Measurement

KINDS = ("amplitudes", "reference_range", "phase", "pointing")
# Of the angle over which gains change by their peak. The error of the differences below is STEP^4/30 of the fifth
# derivative, 1e-7; rounding of gains in float32 grows by 1/STEP.
STEP = 0.04
# f'(0) = sum of weight f(shift STEP)/STEP: central differences of fourth order
SHIFTS = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))


def gradients(
    forward: PointEchoes, measurement: Measurement, x: np.ndarray, y: np.ndarray, kinds: Sequence[str]
) -> dict[str, np.ndarray]:
    """The gradients of each kind of KINDS but "amplitudes", for x (n,) and y (n_rows, n_samples), complex128.

    pointing: of rotation vectors of the axes of both antennas in the scene, (n_rows, 3), by differences: A is linear in
    the gains, so that the error of a difference is that of A for the gains' difference.
    """
    exponent = np.frexp(np.abs(x.view(np.float64)).max(initial=0.0))[1]
    scaled = np.ldexp(x.view(np.float64), -exponent).view(np.complex128)
    weighted = measurement.weighted(y.conj())
    out: dict[str, np.ndarray] = {}
    if {"reference_range", "phase"} & {*kinds}:
        terms = weighted * forward(scaled)
        of_row = {"reference_range": (measurement.slope * terms).sum(axis=1).real, "phase": -terms.sum(axis=1).imag}
        out = {kind: of_row[kind] for kind in of_row if kind in kinds}
    if "pointing" in kinds:
        out["pointing"] = _of_pointing(forward, weighted, scaled)
    return {kind: np.ldexp(value, exponent) for kind, value in out.items()}


def _of_pointing(forward: PointEchoes, weighted: np.ndarray, x: np.ndarray) -> np.ndarray:
    weights = forward.weights
    out = np.zeros((len(weighted), 3))
    slope = max((one.slope(weights.frequency) for one in weights.patterns), default=0.0)
    if slope == 0:  # isotropic
        return out
    for axis, rotation in enumerate(np.eye(3)):
        for shift, weight in SHIFTS:
            turned = forward(x, _turned(weights, shift * STEP / slope * rotation))
            out[:, axis] += weight * slope / STEP * (weighted * turned).sum(axis=1).real
    return out


def _turned(weights: AntennaWeights, rotation: np.ndarray) -> AntennaWeights:
    """The gains with the antennas turned in the scene by a rotation vector, rad (3,)."""
    from scipy.spatial.transform import Rotation

    assert weights.axes is not None
    matrix = Rotation.from_rotvec(rotation).as_matrix()
    return replace(weights, axes=(matrix @ weights.axes[0], matrix @ weights.axes[1]))
