"""Plans for facets: edge length, number of frequencies, and the predicted error.

docs/theory/facets.md derives each term; tests/scattering/test_facet_engine.py measures the sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.boxes import box
from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import ToleranceUnreachable
from ..base.text import size_text
from ..numerics import cost_model
from ..numerics.polynomials import chebyshev, lagrange
from ..numerics.pulse_geometry import PulseGeometry
from ..scene.scene import Scene
from ..scene.triangles import centroids, distances, edges
from ._cutting_error import CuttingError
from ._direction_error import DirectionError
from ._frequency_nodes import crossed, over_band
from .antenna_weights import MOST_NODES, WeightError
from .facet_kinds import coherent

GIGAHERTZ = 1e9  # amplitudes are divided by f in GHz, to stay clear of the smallest float32 numbers
LADDER = 2.0 ** (1 / 2)  # ratio of the edge lengths that are tried
SHARE = 0.6  # of the tolerance, for the facets themselves; the rest is for ranges and interpolation
MOST_FACETS = 50_000_000
# Facets times pulses times samples that are added up in float64, in about a second, where float32 does not suffice, or
# needs this many times as many facets
FLOAT64_TERMS, WORTH_FLOAT32 = 4e6, 64
# bytes per cut facet of an echo: corners, normals, materials and illumination on the host, measured with 1e6 facets
FACET_BYTES = 512
DARK = 30.0  # times less in the cross-polarised echoes that are asked for: then that is said
# rms error of amplitudes in float32, relative to their rms; 1.5e-7 measured by tests/scattering/test_facet_kernel.py
KERNEL = 5e-7
TO_CORNER = 2 / 3  # largest distance of a corner from the centroid, relative to the longest edge


@dataclass(frozen=True, eq=False)
class FacetPlan:
    """Facets no longer than max_edge, m, their amplitudes over f^power interpolated between `nodes`, Hz (n,).

    power            1 where facets reflect coherently, 0 where their amplitude has no factor k
    predicted_error  relative to the facets as they are cut, at random phases; times `gain`, relative to the facets as
                     they were given;  n_facets  number of facets after cutting, about
    is_float64       amplitudes are computed and added up in float64, frequency by frequency, without nodes
    """

    max_edge: float
    nodes: np.ndarray
    predicted_error: float
    n_facets: float
    power: int = 1
    gain: float = 1.0
    is_float64: bool = False

    def basis(self, frequencies: np.ndarray) -> np.ndarray:
        """Lagrange's polynomials of the nodes at frequencies f, Hz (m,), times (f/1 GHz)^power: (n, m).

        The factor k(f) of coherent amplitudes is thus exact at any bandwidth; only S I is interpolated.
        """
        return lagrange(self.nodes, frequencies) * (frequencies / GIGAHERTZ) ** self.power

    def scales(self) -> np.ndarray:
        """k/(2 sqrt(pi)) at the nodes over (f/1 GHz)^power, 1/m (n,)."""
        wave = self.nodes / SPEED_OF_LIGHT
        return np.asarray(np.sqrt(np.pi) * wave / (self.nodes / GIGAHERTZ) ** self.power)

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a report."""
        sums = {"sums": "in float64"} if self.is_float64 else {"frequencies per facet": len(self.nodes)}
        return {"facets": round(self.n_facets), "facet edges, m": self.max_edge, **sums}


def plan_facets(
    tolerance: float, scene: Scene, antennas: PulseGeometry, center: float, bandwidth: float,
    polarizations: Sequence[str], vertical: np.ndarray, finest: float = np.inf, cell: float = np.inf, *,
    cut: bool = True, weights: WeightError | None = None, max_bytes: float = np.inf, profiles: float = 0.0,
    terms: float = np.inf,
) -> FacetPlan:  # fmt: skip
    """The cheapest plan for facets whose error is at most SHARE of `tolerance`, relative to the facets as given.

    center, bandwidth  of the waveform, Hz;  vertical  (3,), of the polarisations
    finest              no edge of a coherent facet may be longer, m;  cell  edges, m, of facets with random parts
    cut                False: facets stay as they are;  weights  errors of the antenna weights
    profiles   least error of the range profiles that cut facets are spread into
    terms      pulses times samples: with few of them and few facets, sums may be in float64; inf: never
    max_bytes  that the cut facets may take; twice the facets of the scene are allowed whatever it is
    ToleranceUnreachable where more facets would be needed than that, or than 50 million, with the best tolerance of
    fewer.
    """
    in_memory = max(2.0 * len(scene.triangles), max_bytes / FACET_BYTES)
    most = min(float(MOST_FACETS), in_memory)
    longest = np.maximum.reduce(edges(scene.triangles))
    mirror, highest = coherent(scene), center + bandwidth / 2
    top = float(longest[mirror].max(initial=0.0)) or float(longest.max())
    bounds = box(scene.triangles.reshape(-1, 3))
    distance = nearest(scene, antennas, bounds)
    weights = weights or WeightError()
    dark = crossed(scene, mirror, top, cell, antennas, polarizations, vertical, center)
    best: tuple[float, FacetPlan] | None = None
    exact: FacetPlan | None = None
    directions = DirectionError(scene, mirror, antennas, highest, polarizations, vertical)
    cutting = CuttingError(scene, mirror, antennas, center, bandwidth, polarizations, vertical, directions.steep)
    if scene.roughness.any() or not mirror.any():
        finest = min(finest, cell)
    least, least_rounding, edge, fine, turn = np.inf, np.inf, min(top, finest), False, 0.0

    def needed(gain: float, error: float) -> float:
        """The tolerance that an error meets, with what range profiles of cut facets need beside it."""
        return gain * max(error / SHARE, error + (profiles if gain > 1 else 0.0))

    while True:
        corner, gain = TO_CORNER * edge, 1.0
        count = float(np.maximum(1.0, 1.5 * (longest / np.where(mirror, edge, min(cell, 1e30))) ** 2).sum())
        if count > most or (exact is not None and count > WORTH_FLOAT32 * exact.n_facets):
            break
        small = count * terms <= FLOAT64_TERMS and dark <= DARK
        rounding = _rounding(edge, highest, directions.rounding) * dark + weights.rounding
        shape = weights.gradient * corner if mirror.any() else 0.0
        if mirror.any():
            turn, sharp = directions.turn(edge)
            if needed(1.0, shape if small else rounding + shape) < tolerance:
                gain = cutting.gain(edge if cut else np.inf)
            bent = _spherical(corner, distance, highest)
            turn = max(0.0, turn - corner / max(distance - corner, 1e-300))  # what `bent` has of directions
            left = tolerance / gain * SHARE - shape - (0 if small else rounding)
            shape += _at_most(cutting, edge, gain, bent, (turn, sharp), left)
        if small and exact is None and gain * shape <= SHARE * tolerance:
            exact = FacetPlan(edge, np.array([center]), shape, count, 1, gain, is_float64=True)
        fixed = rounding + shape
        least_rounding = min(least_rounding, needed(gain, rounding))
        if needed(gain, fixed) < tolerance:
            fine = True
            band = over_band(
                scene, mirror, edge, cell, antennas, polarizations, vertical, center, bandwidth
            )  # fmt: skip
            for power, n in ((power, n) for power in band for n in range(1, MOST_NODES + 1)):
                error = fixed + weights.with_phase(n, band[power])
                least = min(least, needed(gain, error))
                if needed(gain, error) <= tolerance:
                    per_node = cost_model.FACET_NODE + 4 * cost_model.FACET_TAP * len(polarizations)
                    cost = count * (cost_model.FACET + n * per_node)
                    if best is None or cost < best[0]:
                        best = cost, FacetPlan(edge, chebyshev(center, bandwidth, n), error, count, power, gain)
        else:
            least = min(least, needed(gain, fixed))
        settled = best is not None and count > 4 * best[1].n_facets
        if settled or not cut or not mirror.any():
            break
        edge /= LADDER
    if best is None and exact is not None:
        return exact
    if best is None and _rounding(0.0, highest, directions.rounding) * dark >= SHARE * tolerance and dark > DARK:
        names = ", ".join(polarizations)
        raise ToleranceUnreachable(
            tolerance, None, "float32 integrals over facets", "ask for HH or VV",
            how=f"in {names}, in which these facets send back {20 * np.log10(dark):.0f} dB less than in HH and VV",
        )  # fmt: skip
    reach = least * (1 + 1e-9) if np.isfinite(least) else None
    if best is None and not cut:
        raise ToleranceUnreachable(
            tolerance, reach, "facets as large as they are", how=f"with facets of up to {top:.3g} m uncut"
        )
    if best is None and fine:
        raise ToleranceUnreachable(
            tolerance, reach, "amplitudes over the band", "halve the band and add the halves' images",
            how=f"with facets' amplitudes interpolated between {MOST_NODES} frequencies",
        )  # fmt: skip
    if best is None and turn > SHARE * tolerance:
        raise ToleranceUnreachable(
            tolerance, reach, "change of H and V over facets seen along `vertical`",
            "pass another vertical=(x, y, z), farther from the lines of sight",
            how="where H and V change their directions over facets that an antenna sees along `vertical`",
        )  # fmt: skip
    if best is None and tolerance <= least_rounding < np.inf:  # inf: even the largest pieces are too many
        raise ToleranceUnreachable(tolerance, reach, "float32 integrals over facets", how="with facets in float32")
    if best is None:
        how, remedy = f"without cutting these facets into more than {most:,.0f}", "take a smaller scene"
        if in_memory < MOST_FACETS:
            how += f" (about {FACET_BYTES} bytes per facet of max_bytes, {size_text(max_bytes)})"
            remedy += ", a track farther away, or a larger max_bytes"
        raise ToleranceUnreachable(tolerance, reach, "number of facets", remedy, how=how)
    return best[1]


def _at_most(
    cutting: CuttingError, edge: float, gain: float, bound: float, turn: tuple[float, bool], left: float
) -> float:
    """Error of linear phases and one scattering matrix over pieces, relative to these: measured, or by its bound, or
    estimated where the bound is more than is left of the tolerance.

    turn  error of one H and V per piece, beyond the bound, and whether these turn sharply within one: then measures
          and estimates, which suppose that errors fall with the square of the size, miss it
    """
    missed = turn[0] * turn[1]
    if left <= missed:
        return bound + turn[0]
    measured = cutting.measured(edge)
    if measured is not None:
        return measured / gain + missed
    return min(bound + turn[0], cutting.relative(edge) + missed) if bound + turn[0] >= left else bound + turn[0]


def nearest(scene: Scene, antennas: PulseGeometry, bounds: np.ndarray) -> float:
    """Lower bound of the distance of an antenna to a facet, m: by the box of all, by centroids where facets are small
    beside it, else exactly."""
    distance = antennas.distance(bounds)
    if distance > float(np.linalg.norm(bounds[1] - bounds[0])):
        return distance
    from scipy.spatial import cKDTree

    tree = cKDTree(centroids(scene.triangles))
    ends = list(zip(("track", "receiver"), antennas.ends, strict=False))
    away = [(float(d.min()), name, int(d.argmin())) for name, end in ends for d in [tree.query(end)[0]]]
    reach = TO_CORNER * np.maximum.reduce(edges(scene.triangles))
    large = reach > min(away)[0] / 2
    nearest_of = [(least - float(reach[~large].max(initial=0.0)), name, pulse) for least, name, pulse in away]
    if large.any():  # few, as a rule
        near = scene.triangles[large]
        nearest_of += [(float(distances(near, at).min()), name, i) for name, end in ends for i, at in enumerate(end)]
    least, name, pulse = min(nearest_of)
    if max(least, distance) <= 0:
        place = np.array2string(dict(ends)[name][pulse], precision=6)
        raise ValueError(
            f"{name}[{pulse}] is {place} m: an antenna stands on a facet; move the track away from the scene"
        )
    return max(least, distance)


def _spherical(corner: float, distance: float, highest: float) -> float:
    """Error of the wave's curvature over a facet, rad at its corners, with its change of direction and polarisation."""
    if corner >= distance:
        return float("inf")
    return float(
        (2 * np.pi * highest / SPEED_OF_LIGHT) * corner**2 / (distance - corner) + corner / (distance - corner)
    )


def _rounding(edge: float, highest: float, steepness: float) -> float:
    """Error of float32 directions (4e-7 |q| |edge| rad, a fifth of which counts), and rms error of the amplitudes, more
    where these are steep in the direction."""
    return 0.2 * 4e-7 * (4 * np.pi * highest / SPEED_OF_LIGHT) * edge + max(KERNEL, steepness)
