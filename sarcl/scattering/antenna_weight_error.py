"""Errors of the antenna weights: within facets, interpolated over the band, and in float32.

Estimated from up to 400 facets and 200 points at up to 32 pulses, weighted by their echoes there. Errors are relative
to the norm of the echoes, so that those of a scene in a side lobe must be smaller than those in the main lobe.
docs/theory/radar.md derives each term.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.boxes import box
from ..base.errors import NothingSeen
from ..base.rows import spread_over
from ..base.vectors import unit
from ..model.waveform import Waveform
from ..numerics.polynomials import chebyshev
from ..scene.scene import Scene
from ..scene.triangles import areas, centroids
from ._facet_sampling import drawn, facets_at
from .antenna_weights import ANGLE, MOST_NODES, PATTERN, PRODUCTS, AntennaWeights, WeightError
from .facets import FacetSet

# Errors are estimated from samples. (Weights are compared at a facet's corner, twice as far from the centroid as the
# rms radius of the facet.)
SAFETY = 2.0
PULSES, FACETS, POINTS = 32, 400, 200
STEP = 1e-4  # rad, of the differences that approximate derivatives


def weight_error(
    beam: AntennaWeights, scene: Scene, waveform: Waveform, polarizations: Sequence[str], vertical: np.ndarray
) -> WeightError:
    """Errors for a scene. NothingSeen where it is out of the beam."""
    if not beam.is_needed:
        return WeightError()
    for pulses, many in ((PULSES, 1), (16 * PULSES, 4)):  # more samples before a scene is refused as unlit
        found = _sampled(beam, scene, waveform, polarizations, vertical, pulses, many)
        if found is not None:
            return found
    if beam.axes is None:  # there is no beam: the facets send nothing back, which is said where echoes are added up
        return WeightError()
    raise NothingSeen(out_of_beam(beam, scene))


def _sampled(
    beam: AntennaWeights, scene: Scene, waveform: Waveform, polarizations: Sequence[str], vertical: np.ndarray,
    n_pulses: int, many: int,
) -> WeightError | None:  # fmt: skip
    """Errors from samples at n_pulses; None where all weights are 0."""
    random = np.random.default_rng(0)
    where, facets, share = _places(scene, random, many)
    point_power = np.abs(scene.amplitudes) ** 2 * sum(name[0] == name[1] for name in polarizations)
    some, point_share = drawn(point_power, POINTS * many, random)
    n_facets = len(where)
    places = np.concatenate([where, scene.positions[some]])
    total = bent = seen = floor = blurred = 0.0
    left = np.zeros(MOST_NODES + 1)
    band = chebyshev(waveform.center, waveform.bandwidth, 2 * MOST_NODES + 1)
    for pulse in spread_over(len(beam.geometry), n_pulses):
        power = np.empty(len(places))
        power[n_facets:] = point_power[some] * point_share
        if n_facets:
            ends = beam.geometry.tx[pulse], beam.geometry.rx[pulse]
            made = facets.amplitudes(*ends, np.array([waveform.center]), polarizations, vertical)[0]
            power[:n_facets] = share * (np.abs(made) ** 2).sum(axis=1)
        weight = beam.weights(places, int(pulse), waveform.center)
        lit = power * np.abs(weight) ** 2
        total += float(power.sum())
        seen += float(lit.sum())
        # an error of one of two equal patterns is multiplied by the other
        blurred += (
            float((power * np.abs(weight) * beam.peak).sum()) if beam.is_two_way else float(power.sum()) * beam.peak**2
        )
        away = np.linalg.norm(places - beam.geometry.tx[pulse], axis=1)
        slope = np.zeros(len(places))
        for axis in range(3):
            step = np.zeros((len(places), 3))
            step[:, axis] = STEP * away
            slope += np.abs((beam.weights(places + step, int(pulse), waveform.center) - weight) / STEP) ** 2
        floor += float((power * slope).sum())
        bent += float((power * slope / away**2)[:n_facets].sum())
        if beam.varies_over_band:
            values = np.stack([beam.weights(places, int(pulse), f) for f in band.tolist()])
            order = np.arange(len(band))
            angles = np.outer(order, np.arccos(chebyshev(0, 2, len(band))))
            coefficients = np.abs(2 / len(band) * np.cos(angles) @ values)  # Chebyshev's, of the weights over the band
            tails = np.cumsum(coefficients[::-1], axis=0)[::-1]
            left[1:] += [(power * (2 * tails[n]) ** 2).sum() for n in range(1, MOST_NODES + 1)]
    if not total and not n_facets:  # points without amplitude, or of another polarisation: nothing to weigh
        return WeightError()
    if not seen:
        return None
    dim = max(1.0, beam.peak * float(np.sqrt(total / seen)))
    at_peak = len(beam.patterns) * PATTERN
    rounding = at_peak * float(np.sqrt(blurred / seen)) + ANGLE * float(np.sqrt(floor / seen)) + PRODUCTS
    return WeightError(dim, rounding, at_peak + PRODUCTS, float(np.sqrt(bent / seen)), SAFETY * np.sqrt(left / seen))


def _places(scene: Scene, random: np.random.Generator, many: int) -> tuple[np.ndarray, FacetSet, np.ndarray]:
    """Random points on sampled facets, m (n, 3), these facets, and the number of facets that each represents (n,)."""
    some, share = drawn(areas(scene.triangles), FACETS * many, random)
    triangles, corner = scene.triangles[some], random.dirichlet((1.0, 1.0, 1.0), len(some))
    return np.einsum("ni,nij->nj", corner, triangles).reshape(-1, 3), facets_at(scene, some, triangles), share


def out_of_beam(beam: AntennaWeights, scene: Scene) -> str:
    """A message: the scene is out of the beam, by how much, and what to do."""
    assert beam.axes is not None
    boresights = beam.axes[0][:, :, 0]
    middle = box(np.concatenate([scene.positions, centroids(scene.triangles)])).mean(axis=0)
    off = np.arccos(np.clip((unit(middle - beam.geometry.tx) * boresights).sum(axis=1), -1, 1))
    best = int(np.argmin(off))
    return (
        f"the scene is wholly out of the beam: its centre is never less than {np.degrees(off[best]):.3g} deg off the "
        f"boresight (pulse {best}); aim it with sarcl.pointing, such as pointing.spotlight(track, scene.center)"
    )
