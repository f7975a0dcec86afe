"""Plans for facets: edge length, number of frequencies, and the predicted error.

docs/theory/facets.md derives each term; tests/scattering/test_facet_engine.py measures the sum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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
from ..scene.triangles import centroids, distances, edges, longest_side
from ._cutting_error import CuttingError
from ._direction_error import DirectionError
from ._frequency_nodes import OverBand, cross_polarization_ratio
from .antenna_weights import MOST_NODES, WeightError
from .facet_kinds import FacetView
from .facets import POLARIZATIONS

GIGAHERTZ = 1e9  # amplitudes are divided by f in GHz, to stay clear of the smallest float32 numbers
LADDER = 2.0 ** (1 / 2)  # ratio of the edge lengths that are tried
PIECES = 1.5  # pieces per facet, over the square of its longest edge over theirs, about
SHARE = 0.6  # of the tolerance, for the facets themselves; the rest is for ranges and interpolation
MOST_FACETS = 50_000_000
WORTH_FLOAT32 = 64  # ratio of facets: float32 is not tried with more of them, where sums may be in float64
# bytes per cut facet of an echo: corners, normals, materials and illumination on the host, measured with 1e6 facets
FACET_BYTES = 512
DARK = 30.0  # amplitude ratio of all polarisations to the cross-polarised ones asked for, above which errors name it
ROUNDED = 1e10  # the same ratio, above which the cross-polarised amplitudes are rounding of float64 alone
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
    is_dark          rounding alone in the polarisations that are asked for, beside which other echoes are added
    """

    max_edge: float
    nodes: np.ndarray
    predicted_error: float
    n_facets: float
    power: int = 1
    gain: float = 1.0
    is_float64: bool = False
    is_dark: bool = False

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


@dataclass(frozen=True)
class CutLimits:
    """Limits within which facets are cut.

    finest     longest edge of a coherent facet, m;  cell  edges, m, of facets with random parts
    cuts       False: facets stay as they are
    on_device  facets (k,) bool that a device cuts, in blocks: their pieces take no memory of the host
    max_bytes  that the other cut facets may take; twice the facets of the scene are allowed whatever it is
    profiles   least error of the range profiles that cut facets are spread into
    terms      pulses times samples: with few of them and few facets, sums may be in float64; inf: never
    most       facets in all
    float64_terms  facets times pulses times samples that may be added up in float64, in about a second
    adds_others    other echoes are added, such as several reflections, beside which facets dark in the polarisations
                   that are asked for may be added up in float64
    """

    finest: float
    cell: float
    cuts: bool
    on_device: np.ndarray
    max_bytes: float
    profiles: float
    terms: float
    most: float = MOST_FACETS
    float64_terms: float = 4e6
    adds_others: bool = False


def plan_facets(tolerance: float, view: FacetView, weights: WeightError, limits: CutLimits) -> FacetPlan:
    """The cheapest plan for facets whose error is at most SHARE of `tolerance`, relative to the facets as given.

    weights  errors of the antenna weights
    ToleranceUnreachable where more facets would be needed than the limits allow, with the best tolerance of fewer.
    """
    search = _PlanSearch(tolerance, view, weights, limits)
    edge = search.first_edge
    while search.proceeds_beyond(edge):
        edge /= LADDER
    plan = search.best or search.exact
    if plan is None:
        raise search.refusal()
    return plan


class _PlanSearch:
    """Search for the cheapest plan, with facets cut to shorter and shorter edges.

    best   cheapest plan with sums in float32 so far;  exact  that with the fewest facets and sums in float64
    least, least_rounding  best tolerances so far, and those that float32 alone would allow
    turn   error of one H and V per facet at the last edge;  interpolates  whether an edge was short enough but for the
           interpolation over the band;  rough  pieces of facets without a coherent part, on the host and on a device;
    elsewhere  those that have a plan of their own: what they cost does not depend on this one
    fits  whether the host holds the pieces of the last edge
    """

    def __init__(self, tolerance: float, view: FacetView, weights: WeightError, limits: CutLimits) -> None:
        self.tolerance, self.view, self.weights, self.limits = tolerance, view, weights, limits
        scene, mirror = view.scene, view.mirror
        self.in_memory = max(2.0 * len(scene.triangles), limits.max_bytes / FACET_BYTES)
        self.longest = np.maximum.reduce(edges(scene.triangles))
        self.top = float(self.longest[mirror].max(initial=0.0)) or float(self.longest.max())
        self.distance = nearest(scene, view.antennas, box(scene.triangles.reshape(-1, 3)))
        self.cross_ratio = cross_polarization_ratio(view, self.top, limits.cell)
        self.is_dark = limits.adds_others and self.cross_ratio > ROUNDED
        if self.is_dark:  # what rounding makes has no error of its own
            view = replace(view, polarizations=POLARIZATIONS)
        # where both kinds are there, facets that a device cuts have a plan of their own
        apart = limits.on_device & mirror.any()
        self.over_band = OverBand(view, limits.cell, apart)
        pieces = np.maximum(1.0, PIECES * (self.longest / min(limits.cell, 1e30)) ** 2)
        self.rough = [float(pieces[~mirror & there].sum()) for there in (~limits.on_device, limits.on_device)]
        self.elsewhere = self.rough[1] if mirror.any() else 0.0
        self.directions = DirectionError(view)
        self.cutting = CuttingError(view, self.directions.steep)
        is_random = scene.roughness.any() or not mirror.any()
        self.first_edge = min(self.top, limits.finest, limits.cell if is_random else np.inf)
        self.best: FacetPlan | None = None
        self.exact: FacetPlan | None = None
        self.cost = self.least = self.least_rounding = np.inf
        self.turn, self.interpolates, self.fits = 0.0, False, True

    def proceeds_beyond(self, edge: float) -> bool:
        """Consider facets cut to `edge`, m. Whether shorter edges may allow a cheaper plan."""
        mirror, limits = self.view.mirror, self.limits
        n_on_host = self.rough[0] + float(np.maximum(1.0, PIECES * (self.longest[mirror] / edge) ** 2).sum())
        count = n_on_host + self.rough[1]
        self.fits = n_on_host <= self.in_memory
        if not self.fits or count > limits.most:
            return False
        if self.exact is not None and count > WORTH_FLOAT32 * self.exact.n_facets:
            return False
        # the kernels know neither forward scatter, nor thin sheets, nor the scattering models of installed packages
        scene = self.view.scene
        on_host = self.view.antennas.forward or bool(scene.sheets.any()) or bool(scene.scattering_models)
        is_small = on_host or (
            count * limits.terms <= limits.float64_terms and (self.cross_ratio <= DARK or limits.adds_others)
        )
        rounding = self._rounding(edge) + self.weights.rounding
        gain, shape = self._shape(edge, 0.0 if is_small else rounding) if mirror.any() else (1.0, 0.0)
        if is_small and self.exact is None and gain * shape <= SHARE * self.tolerance:
            nodes = np.array([self.view.center])
            self.exact = FacetPlan(edge, nodes, shape, count, 1, gain, is_float64=True, is_dark=self.is_dark)
        self.least_rounding = min(self.least_rounding, self._required(gain, rounding))
        error = rounding + shape
        if on_host:
            self.least = min(self.least, self._required(gain, shape))
        elif self._required(gain, error) < self.tolerance:
            self.interpolates = True
            self._choose_nodes(edge, gain, error, count)
        else:
            self.least = min(self.least, self._required(gain, error))
        is_settled = self.best is not None and n_on_host > 4 * (self.best.n_facets - self.elsewhere)
        return limits.cuts and bool(mirror.any()) and not is_settled

    def _required(self, gain: float, error: float) -> float:
        """Tolerance that an error meets, with what range profiles of cut facets need beside it."""
        return gain * max(error / SHARE, error + (self.limits.profiles if gain > 1 else 0.0))

    def _rounding(self, edge: float) -> float:
        """Error of facets in float32, relative to the polarisations that are asked for."""
        return _rounding(edge, self.view.highest, self.directions.rounding) * self.cross_ratio

    def _shape(self, edge: float, rounding: float) -> tuple[float, float]:
        """Gain of facets cut to `edge`, m, and the error of one weight, phase slope and matrix per facet."""
        corner, gain, shape = TO_CORNER * edge, 1.0, self.weights.gradient * (TO_CORNER * edge)
        turn, is_sharp = self.directions.turn(edge)
        if self._required(1.0, rounding + shape) < self.tolerance:
            gain = self.cutting.gain(edge if self.limits.cuts else np.inf)
        bound = _spherical(corner, self.distance, self.view.highest)
        self.turn = max(0.0, turn - corner / max(self.distance - corner, 1e-300))  # what `bound` has of directions
        room = self.tolerance / gain * SHARE - shape - rounding
        return gain, shape + _at_most(self.cutting, edge, gain, bound, (self.turn, is_sharp), room)

    def _choose_nodes(self, edge: float, gain: float, fixed: float, count: float) -> None:
        """Take the cheapest number of frequency nodes whose error, beside a `fixed` one, meets the tolerance."""
        view, weights = self.view, self.weights
        per_node = cost_model.FACET_NODE + 4 * cost_model.FACET_TAP * len(view.polarizations)
        band = self.over_band.errors(edge)
        for power, n in ((power, n) for power in band for n in range(1, MOST_NODES + 1)):
            error = fixed + weights.with_phase(n, band[power])
            self.least = min(self.least, self._required(gain, error))
            cost = (count - self.elsewhere) * (cost_model.FACET + n * per_node)
            if self._required(gain, error) <= self.tolerance and cost < self.cost:
                nodes = chebyshev(view.center, view.bandwidth, n)
                self.cost, self.best = cost, FacetPlan(edge, nodes, error, count, power, gain)

    def refusal(self) -> ToleranceUnreachable:
        """The error that names what keeps the facets from the tolerance."""
        tolerance, float32 = self.tolerance, "float32 integrals over facets"
        if self._rounding(0.0) >= SHARE * tolerance and self.cross_ratio > DARK:
            names, ratio_db = ", ".join(self.view.polarizations), 20 * np.log10(self.cross_ratio)
            how = f"in {names}, in which these facets send back {ratio_db:.0f} dB less than in HH and VV"
            remedy = f"ask for {('HH', *self.view.polarizations)}" if self.limits.adds_others else "ask for HH or VV"
            return ToleranceUnreachable(tolerance, None, float32, remedy, how=how)
        reach = self.least * (1 + 1e-9) if np.isfinite(self.least) else None
        if not self.limits.cuts:
            how = f"with facets of up to {self.top:.3g} m uncut"
            return ToleranceUnreachable(tolerance, reach, "facets as large as they are", how=how)
        if self.interpolates:
            how = f"with facets' amplitudes interpolated between {MOST_NODES} frequencies"
            remedy = "halve the band and add the halves' images"
            return ToleranceUnreachable(tolerance, reach, "amplitudes over the band", remedy, how=how)
        if self.turn > SHARE * tolerance:
            how = "where H and V change their directions over facets that an antenna sees along `vertical`"
            remedy = "pass another vertical=(x, y, z), farther from the lines of sight"
            limit = "change of H and V over facets seen along `vertical`"
            return ToleranceUnreachable(tolerance, reach, limit, remedy, how=how)
        if tolerance <= self.least_rounding < np.inf:  # inf: even the largest pieces are too many
            return ToleranceUnreachable(tolerance, reach, float32, how="with facets in float32")
        most = self.limits.most if self.fits else self.in_memory
        remedy = f"take a smaller scene (this one is {longest_side(self.view.scene.triangles):.4g} m long)"
        how = f"without cutting these facets into more than {most:,.0f}"
        if most < self.limits.most:
            memory = size_text(self.limits.max_bytes)
            how += f" (about {FACET_BYTES} bytes per facet of max_bytes, {memory})"
            remedy += ", a track farther away, or a larger max_bytes"
        return ToleranceUnreachable(tolerance, reach, "number of facets", remedy, how=how)


def _at_most(
    cutting: CuttingError, edge: float, gain: float, bound: float, turn: tuple[float, bool], room: float
) -> float:
    """Error of linear phases and one scattering matrix over pieces, relative to these: measured, or by its bound, or
    estimated where the bound is more than `room`, what remains of the tolerance.

    turn  error of one H and V per piece, beyond the bound, and whether these turn sharply within one: then measures
          and estimates, which suppose that errors fall with the square of the size, miss it
    """
    missed = turn[0] * turn[1]
    if room <= missed:
        return bound + turn[0]
    measured = cutting.measured(edge)
    if measured is not None:
        return measured / gain + missed
    return min(bound + turn[0], cutting.relative(edge) + missed) if bound + turn[0] >= room else bound + turn[0]


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
