"""What a hard edge of a beam adds to echoes: the pulses next to the edge, counted from the pulse at which it is passed.

A beam with hard edges is divided: psi = psi v + psi (1 - v). v rises from 0 at the edge to 1 over some Fresnel zones
inside, so that psi v is a beam without edges. psi (1 - v) lies next to the edge. Let n_k be the first pulse that sees
scatterer k (the last, at the other edge), with side = +1 (-1), R_k its distance there, s_k the sine of its aspect, and
d the distance between pulses. The pulses p = n_k + side m, m = 0, 1, ... then receive

    exp(-j 2 k R_k) D(m; s_k, R_k),   D = psi(s) (1 - v(s)) exp(-j 2 k (R - R_k)),   R^2 = R_k^2 + 2 s_k R_k x + x^2

with x = side m d and s = (s_k R_k + x)/R. D changes slowly with s_k and R_k: where between two pulses the edge lies,
and how it moves with range, is in the whole number n_k. So the sum over scatterers is the transform of a map with
azimuths n_k d and ranges R_k at wavenumbers u and 2 k, times the transform of D over m: a sum, exact for sampled
signals. It is tabulated over w = u + 2 k s_c and interpolated over s_k, 1/R_k and frequency.
docs/theory/spectral_echo.md derives it; sarcl/reference/spectral_echo.py:beam_edge is the sum itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import ToleranceUnreachable
from ...numerics.polynomials import chebyshev, lagrange
from ...opencl import fft
from ._aspect_window import Aspects, DopplerGrid, wavenumber
from ._azimuth_transfer import SAFETY, AzimuthTransfer, Functions
from ._map_part import MapPart
from ._map_plan import RangeWavenumbers, plan_map, scatterers_per_cell
from ._scatterer_amplitudes import ScattererAmplitudes
from ._straight_track import StraightTrack, tangent
from .planning_time import PlanningTime

# Nodes over s_k, 1/R_k and frequency, and cells of the table per pulse of D, that are tried one after the other.
TRIED = ((2, 1, 1, 8), (2, 2, 2, 8), (3, 2, 2, 8), (3, 3, 3, 16), (4, 4, 4, 16), (6, 6, 6, 32), (8, 8, 8, 32))
COMPARED = 27  # responses that are compared, at most: three frequencies, nine places
COMPRESSED = 0.1  # share of the tolerance: tables of several nodes are replaced by fewer sums of them


@dataclass(frozen=True, eq=False)
class EdgePhase:
    """The phase of an edge's transform that is known; as KnownPhase.

    middle_range  from which ranges count, m;  sine  s_c;  spacing  d, m
    delay         m, of the middle of D: its phase is taken out of the tables
    """

    middle_range: float
    sine: float
    spacing: float
    delay: float
    paraxial: None = None

    def ratio(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """The variable of the tables: w = u + 2 k s_c, rad/m, between -pi/d and pi/d."""
        w = u + 2 * self.sine * np.asarray(k)
        period = 2 * np.pi / self.spacing
        return np.asarray(w - period * np.rint(w / period))

    def kappa(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """Wavenumber over range, rad/m: 2 k at every u."""
        return np.asarray(2.0 * np.asarray(k) + 0 * u)

    def at_middle(self, u: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """Phase of the delay, rad."""
        return -self.delay * self.ratio(u, k)


@dataclass(frozen=True, eq=False)
class EdgePlaces:
    """The pulses at which scatterers pass an edge.

    side     +1: the first pulse that sees them, -1: the last
    picked   indices of the scatterers whose edge the track sees (n,);  pulse  (n,);  length  pulses of D
    sine, distance  of the antenna at that pulse: s_k, R_k (n,)
    """

    side: int
    picked: np.ndarray
    pulse: np.ndarray
    sine: np.ndarray
    distance: np.ndarray
    length: int


def edge_places(
    tangents: np.ndarray, azimuth: np.ndarray, slant_range: np.ndarray, side: int, inner: float, track: StraightTrack
) -> EdgePlaces | None:
    """Where scatterers pass the edge at `tangents` (n,); inner  sine beyond which D is 0. None where no pulse does."""
    finite = np.flatnonzero(np.isfinite(tangents))
    place = (azimuth[finite] + slant_range[finite] * tangents[finite]) / track.spacing
    pulse = np.ceil(place) if side > 0 else np.floor(place)
    lag = pulse * track.spacing - azimuth[finite]
    length = side * (slant_range[finite] * float(tangent(inner)) - lag) / track.spacing
    longest = int(np.ceil(max(1.0, length.max(initial=1.0)))) + 1
    last = track.n_pulses - 1
    here = (pulse <= last) & (pulse > -longest) if side > 0 else (pulse >= 0) & (pulse < last + longest)
    picked, lag = finite[here], lag[here]
    if not len(picked):
        return None
    distance = np.hypot(lag, slant_range[picked])
    return EdgePlaces(side, picked, pulse[here], lag / distance, distance, longest)


@dataclass(frozen=True, eq=False)
class EdgeTask:
    """Maps of the edges of one part of a scene, and how exact their tables have to be.

    functions, factors  amplitudes of scatterers: J functions of the aspect, and factors of some of them (n, J)
    tolerance  of the tables;  total_tolerance  that of the caller, for messages;  time  that the plans may take
    """

    aspects: Aspects
    functions: Functions
    factors: np.ndarray
    track: StraightTrack
    tolerance: float
    total_tolerance: float
    time: PlanningTime


def edge_response(task: EdgeTask, places: EdgePlaces, sine: float, distance: float, frequency: float) -> np.ndarray:
    """D for one place and frequency, for every function: complex128 (J, length)."""
    aspects, x = task.aspects, places.side * task.track.spacing * np.arange(places.length)
    away = np.sqrt(distance**2 + 2 * sine * distance * x + x**2)
    s = (sine * distance + x) / away
    rest = np.where(places.side * (s - (aspects.low + aspects.high) / 2) < 0, 1 - aspects.window(s), 0.0)
    further = x * (2 * sine * distance + x) / (away + distance)
    wave = rest * np.exp(-2j * float(wavenumber(frequency)) * further)
    return task.functions(s, frequency) * wave


@dataclass(frozen=True, eq=False)
class EdgeNodes:
    """Nodes over s_k and 1/R_k, and the sums of them that are left: combined (nodes, sums).  center  s_c"""

    center: float
    sines: np.ndarray
    inverses: np.ndarray
    combined: np.ndarray

    def shares(self, sine: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Shares of each sum in the responses of places (n,): complex128 (sums, n)."""
        both = lagrange(self.sines, sine)[:, None] * lagrange(self.inverses, 1 / distance)
        return np.asarray(self.combined.T @ both.reshape(-1, len(sine)))


def edge_tables(
    task: EdgeTask, places: EdgePlaces, middle_range: float, size: tuple[int, int, int, int]
) -> tuple[AzimuthTransfer, EdgeNodes]:
    """Tables of the transform of D, of one of the sizes TRIED, and their nodes."""
    aspects, spacing, (n_sines, n_inverses, n_frequencies, cells) = task.aspects, task.track.spacing, size
    low, high = float(places.sine.min()), float(places.sine.max())
    nearest, farthest = float(1 / places.distance.max()), float(1 / places.distance.min())
    sines = chebyshev((low + high) / 2, max(high - low, 1e-12), n_sines)
    inverses = chebyshev((nearest + farthest) / 2, max(farthest - nearest, 1e-6 * farthest), n_inverses)
    frequencies = chebyshev(sum(aspects.band) / 2, aspects.band[1] - aspects.band[0], n_frequencies)
    half = fft.good_length(cells * places.length)
    n, step, center = 2 * half, np.pi / (half * spacing), (low + high) / 2
    middle = places.length // 2
    delays = places.side * (np.arange(places.length) - middle)
    x = places.side * spacing * np.arange(places.length)
    tables = []
    for s in sines.tolist():
        for inverse in inverses.tolist():
            for f in frequencies.tolist():
                response = edge_response(task, places, s, 1 / inverse, f)
                padded = np.zeros((len(response), n), np.complex128)
                padded[:, delays] = spacing * response * np.exp(2j * float(wavenumber(f)) * center * x)
                tables.append(fft.rows(None, padded))
    spectra = np.stack(tables).reshape(n_sines * n_inverses, n_frequencies, -1, n)
    spectra = spectra[..., (np.arange(n + 5) - 2 - half) % n]
    flat = spectra.reshape(len(spectra), -1)
    power, vectors = np.linalg.eigh(flat @ flat.conj().T)
    total = np.cumsum(np.maximum(power, 0))  # power is in rising order
    combined = vectors[:, total > (COMPRESSED * task.tolerance) ** 2 * total[-1]]
    fewer = (combined.conj().T @ flat).reshape(-1, *spectra.shape[1:]).transpose(2, 0, 1, 3)
    phase = EdgePhase(middle_range, center, spacing, places.side * middle * spacing)
    transfer = AzimuthTransfer(aspects, phase, 1 / inverses, frequencies, -np.pi / spacing - 2 * step, step, fewer)
    return transfer, EdgeNodes(center, sines, inverses, combined)


def edge_wavenumbers(
    transfer: AzimuthTransfer, nodes: EdgeNodes, length: int, track: StraightTrack
) -> tuple[DopplerGrid, RangeWavenumbers]:
    """A whole period of wavenumbers along the track about that of the edge, and those over range: 2 k."""
    phase, k = transfer.phase, wavenumber(np.array(transfer.aspects.band))
    n_lags = fft.good_length(track.n_pulses + length + 1)
    period = n_lags * track.spacing
    center = int(np.rint(-float(k.sum()) * nodes.center * period / (2 * np.pi)))
    grid = DopplerGrid(period, n_lags, center - n_lags // 2, n_lags)
    half = float(k[1] - k[0])
    return grid, RangeWavenumbers(phase, 2 * np.pi * center / period, float(k.sum()), 0.0, (-half, half))


def plan_edge(task: EdgeTask, places: EdgePlaces, middle_range: float) -> tuple[AzimuthTransfer, EdgeNodes]:
    """The smallest tables whose responses differ from D by at most the tolerance."""
    best = np.inf
    for size in TRIED:
        *nodes_over, cells = size
        n_lags = task.track.n_pulses + places.length
        tables = float(np.prod(nodes_over)) * task.factors.shape[1] * 2 * cells * places.length
        task.time.spend(tables + COMPARED * len(task.factors) * n_lags, n_lags)
        transfer, nodes = edge_tables(task, places, middle_range, size)
        error = SAFETY * edge_error(task, transfer, nodes, places)
        best = min(best, error)
        if error <= task.tolerance:
            return replace(transfer, error=error), nodes
    how = f"by spectral_echo: tables of the beam's hard edges leave {best:.1e} of the responses beside them"
    raise ToleranceUnreachable(task.total_tolerance, None, "hard edges of the beam", "use echo", how=how)


def edge_error(task: EdgeTask, transfer: AzimuthTransfer, nodes: EdgeNodes, places: EdgePlaces) -> float:
    """Largest relative error of responses made from tables, at places with extreme sines and distances and others."""
    track, factors = task.track, task.factors
    grid, _ = edge_wavenumbers(transfer, nodes, places.length, track)
    extreme = [at(values) for values in (places.sine, places.distance) for at in (np.argmin, np.argmax)]
    some = np.unique([*extreme, *np.linspace(0, len(places.sine) - 1, 5).astype(int)])
    shares = nodes.shares(places.sine[some], places.distance[some])
    order, worst, (low, high) = places.side * np.arange(places.length), 0.0, transfer.aspects.band
    for f in {low, high, 0.4 * low + 0.6 * high}:
        k, u = float(wavenumber(f)), grid.wavenumbers
        known = np.exp(1j * transfer.phase.at_middle(u, k)) / grid.period
        tables = [[transfer.amplitude(j, q, f, u) for q in range(len(shares))] for j in range(len(transfer.tables))]
        for i, place in enumerate(some.tolist()):
            spectra = (factors @ np.einsum("q,jqu->ju", shares[:, i], np.array(tables))) * known
            response = fft.rows(None, grid.folded(spectra), inverse=True)[:, order]
            sine, distance = float(places.sine[place]), float(places.distance[place])
            exact = factors @ edge_response(task, places, sine, distance, f)
            right = float(np.linalg.norm(exact))
            worst = max(worst, float(np.linalg.norm(response - exact)) / right if right else 0.0)
    return worst


def places_of_edges(amplitudes: ScattererAmplitudes, aspects: Aspects, track: StraightTrack) -> list[EdgePlaces]:
    """Where scatterers pass the hard edges of the beam that the track sees."""
    places_by_edge, edges = [], amplitudes.edges
    if edges is not None:
        ends = ((edges.first, 1, aspects.low), (edges.last, -1, aspects.high))
        for (tangents, side, inner), hard in zip(ends, aspects.hard, strict=True):
            if hard:
                inside = np.where(edges.seen, tangents, np.inf)
                places = edge_places(inside, amplitudes.azimuth, amplitudes.slant_range, side, inner, track)
                places_by_edge += [] if places is None else [places]
    return places_by_edge


def edge_map(
    task: EdgeTask, places: EdgePlaces, some: np.ndarray, grid_tolerance: float, is_random: bool, tile: int
) -> MapPart:
    """The map of an edge.

    some  indices of the part's scatterers;  grid_tolerance  of the map's grid
    """
    ranges = float(places.distance.min()), float(places.distance.max() * (1 + 1e-4))
    transfer, nodes = plan_edge(task, places, (ranges[0] + ranges[1]) / 2)
    grid, numbers = edge_wavenumbers(transfer, nodes, places.length, task.track)
    azimuth = places.pulse * task.track.spacing
    per_cell = 0.0 if is_random else scatterers_per_cell(azimuth, places.distance, grid, numbers)
    plan = plan_map(grid_tolerance, numbers, grid, ranges, per_cell, tile, task.total_tolerance)

    def shares() -> np.ndarray:
        return nodes.shares(places.sine, places.distance)

    index = np.searchsorted(some, places.picked)
    return MapPart(index, azimuth, places.distance, shares, transfer, grid, numbers, plan)
