"""Measured error of echoes: random samples recomputed exactly."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..numerics.pulse_geometry import PulseGeometry
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.facets import FacetSet, Light
from ..scattering.scatterers import Points
from ..scene.triangles import centroids
from .bounces.bounce_spreader import BounceScene, BounceSpreader
from .edges.edge_echoes import EdgeEchoes, PreparedEdges
from .facets.exact_facets import facet_samples, inside_window
from .facets.facets_behind_sheets import SheetEchoes
from .scene_echoes import SceneEchoes
from .spreading import ChannelView

CANDIDATES = 256  # pulses among which those that are checked are drawn
MOST_DRAWS = 16  # pulses, and frequencies at each of them
FEWEST_DRAWS, MANY_FACETS = (4, 2), 2_000_000  # up to so many facets, and above
# s, to recompute the share of a facet in a sample, on one core; of a point, and where its gain changes over the band
PER_FACET, PER_POINT, PER_GAIN = 5e-7, 1.5e-7, 1.3e-6
MOST_REFLECTORS = 12  # facets whose reflections the reference follows
PER_LIT_PART = 5e-3  # s, to recompute the lit part of a facet, past some ten occluders, on one core


class PulseRows(Protocol):
    """Samples in memory or in a file: of each pulse (n_polarizations, n_samples)."""

    def __len__(self) -> int: ...

    def __getitem__(self, pulse: int, /) -> np.ndarray: ...


def draws_of(scene: SceneEchoes) -> int:
    """Number of pulses that are checked, and of samples at each: 16, fewer where there are over 20 000 facets."""
    n, most = sum(map(len, scene.facets)), scene.request.limits.checked_facets
    return int(np.clip(np.sqrt(most / max(n, 1)), FEWEST_DRAWS[n > MANY_FACETS], MOST_DRAWS))


def seconds_to_check(scene: SceneEchoes) -> float:
    """About the seconds that `measure_error` takes, on one core; infinite with bounces, edges and what is seen through
    sheets, whose integrals over facets of any size the reference adds up for minutes."""
    if scene.bounced is not None or scene.edges is not None or scene.behind_sheets is not None:
        return np.inf
    points, facets = 0 if scene.points is None else len(scene.points), sum(map(len, scene.facets))
    partly = sum(part.n_partly_lit for part in scene.facets)
    draws = draws_of(scene)
    per_point = PER_GAIN if scene.weights.varies_over_band else PER_POINT
    return MOST_DRAWS**2 * points * per_point + draws**2 * facets * PER_FACET + draws * partly * PER_LIT_PART


def worth_checking(scene: SceneEchoes, check: bool | None, channels: float = 1, crossed: float = 0) -> bool:
    """Whether samples are to be recomputed: as asked, or where that takes less than 2 % of the time.

    crossed  facets on which the range window of a pulse ends"""
    if check is not None:
        return check
    parts = draws_of(scene) * crossed * PER_LIT_PART
    return channels * (seconds_to_check(scene) + parts) < 0.02 * scene.request.clock.seconds.get("echo", 0.0)


def measure_error(
    scene: SceneEchoes, antennas: PulseGeometry, frequencies: np.ndarray, spectrum: np.ndarray, samples: PulseRows
) -> float:
    """Relative error of 256 random samples (16 random pulses, 16 frequencies each) against the exact sum; of as many as
    take two or three seconds where there are more than 20 000 facets, and at least 16, or 4 above 2 million.

    Half of the pulses are drawn by the energy of their samples, so that those are among them whose narrow beam sees the
    scene; each is weighted by the number of pulses that it represents. The error is relative to the larger of their
    norm and the norm they would have if scatterers added with random phases. Facets are as they were cut, each by its
    centroid's plane wave at every frequency.
    """
    random = np.random.default_rng(0)
    wrong = right = random_phases = 0.0
    draws = draws_of(scene)
    pulses, represented = _drawn(samples, draws, random)
    for p, share in zip(pulses.tolist(), represented.tolist(), strict=True):
        n = random.integers(0, len(frequencies), draws)
        echo, power = exact(scene, antennas, p, frequencies[n], scene.weights)
        echo *= spectrum[n]
        wrong += share * float((np.abs(samples[p][:, n] - echo) ** 2).sum())
        right += share * float((np.abs(echo) ** 2).sum())
        random_phases += share * float((power * np.abs(spectrum[n]) ** 2).sum())
    return float(np.sqrt(wrong / max(right, random_phases))) if wrong else 0.0


def _drawn(samples: PulseRows, draws: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random pulses (draws,), and the number of pulses that each represents, up to a factor."""
    some = spread_over(len(samples), CANDIDATES)
    energy = np.array([np.linalg.norm(samples[p].astype(np.complex128, copy=False)) ** 2 for p in some.tolist()])
    chance = np.full(len(some), 1 / len(some))
    if 0 < energy.sum() < np.inf:
        chance = 0.5 * (chance + energy / energy.sum())
    picked = random.choice(len(some), draws, p=chance / chance.sum())
    within = some[picked]
    if len(some) < len(samples):  # a pulse beside it
        within = np.minimum(within + random.integers(0, len(samples) // len(some), draws), len(samples) - 1)
    return within, 1 / chance[picked]


def exact(
    scene: SceneEchoes, antennas: PulseGeometry, pulse: int, frequencies: np.ndarray, weights: AntennaWeights
) -> tuple[np.ndarray, np.ndarray]:
    """Exact sums over a scene's scatterers (n_polarizations, n), and their power at random phases."""
    request = scene.request
    view = ChannelView(antennas, weights, frequencies, 0.0, request.polarizations, request.vertical, gated=True)
    values = np.zeros((len(request.polarizations), len(frequencies)), np.complex128)
    powers = np.zeros(values.shape)
    for part in (scene.points, *scene.facets):
        if part is not None:
            value, power = _exact(part, view, pulse)
            values, powers = values + value, powers + power
    if scene.behind_sheets is not None:
        value, power, _ = SheetEchoes(scene.behind_sheets, view, 0).exactly(pulse)
        values, powers = values + value, powers + power
    if scene.edges is not None:
        for _, value, power in EdgeEchoes(scene.edges, view).exactly(np.array([pulse]), frequencies):
            values, powers = values + value[0], powers + power[0]
    if scene.bounced is not None:
        values = values + _bounced(scene.bounced, view, pulse, scene.edges)
    return values, powers


def _exact(part: Points | FacetSet, view: ChannelView, p: int) -> tuple[np.ndarray, np.ndarray]:
    """Samples (n_polarizations, n) of pulse p at the frequencies, and their power at random phases."""
    antennas, frequencies, polarizations = view.antennas, view.frequencies, view.polarizations
    if isinstance(part, FacetSet):
        crossed = across_edges(part, view, p)
        return facet_samples(
            part,
            view,
            p,
            inside_window(part, antennas, p) | crossed,
            exact_light(part, antennas, p, frequencies, crossed),
        )
    from ..reference.equations import point_echo as exact_echo

    tx, rx, places = antennas.tx[p], antennas.rx[p], part.positions
    away = np.linalg.norm(places - tx, axis=1), np.linalg.norm(places - rx, axis=1)
    delta = (away[0] + away[1]) / 2 - antennas.reference_range[p]
    inside = (delta >= antennas.near[p]) & (delta <= antennas.far[p])
    values = np.zeros((len(polarizations), len(frequencies)), np.complex128)
    powers = np.zeros(values.shape)
    place = (tx, rx, float(antennas.reference_range[p]))
    same = [i for i, name in enumerate(polarizations) if name[0] == name[1]]
    # all at once where amplitudes are the same at all frequencies: paths to the points take the longest
    bands = np.arange(len(frequencies))[:, None] if view.weights.varies_over_band else np.arange(len(frequencies))[None]
    for band in bands:
        a = part.amplitudes * inside * view.weights.weights(places, p, float(frequencies[band[0]]))
        values[np.ix_(same, band)] = exact_echo(places, a, frequencies[band], *place)
        powers[np.ix_(same, band)] = (np.abs(a) ** 2).sum()
    return values, powers


def _bounced(scene: BounceScene, view: ChannelView, pulse: int, edges: PreparedEdges | None) -> np.ndarray:
    """Samples (n_polarizations, n) of a pulse of what facets reflect to one another: by the reference, of few facets
    without antennas' weights and waves beside edges, and otherwise by the beams, each added at every frequency."""
    from ..reference.bounces import NO_WINDOW, Reflectors, bounce_echo

    antennas, surfaces, coatings = view.antennas, scene.surfaces, scene.coatings
    beams = BounceSpreader(scene, view, None if edges is None else edges.pieces.wedges)
    if len(scene.mirrors) > MOST_REFLECTORS or view.weights.is_needed or surfaces.ground or beams.has_transitions:
        return np.asarray(beams.values(np.array([pulse]), view.frequencies, exact=True)[0][0])
    eps = np.stack([coatings.permittivity(f)[coatings.material] for f in view.frequencies.tolist()])
    reflectivity = coatings.reflectivity * surfaces.mirrors
    sums = bounce_echo(
        Reflectors(surfaces.corners, surfaces.two_sided, eps, reflectivity, coatings.height),
        view.frequencies,
        (antennas.tx[pulse] - scene.origin, antennas.rx[pulse] - scene.origin),
        float(antennas.reference_range[pulse]),
        bounces=scene.bounces,
        up=tuple(view.vertical.tolist()),
        on_plane=scene.surfaces.on_plane,
        window=(float(antennas.near[pulse]), float(antennas.far[pulse])) if view.gated else NO_WINDOW,
    )[1:].sum(axis=0)
    return np.stack([sums[:, "HV".index(name[0]), "HV".index(name[1])] for name in view.polarizations])


def exact_light(
    part: FacetSet, antennas: PulseGeometry, pulse: int, frequencies: np.ndarray, crossed: np.ndarray | None = None
) -> Light:
    """What a pulse sees of the partly lit facets, and within its range window of facets `crossed` by the window's edges
    (k,) bool, by the reference."""
    from ..reference.lit_part import lit_part

    rows = np.full(len(part), -1) if part.lit_parts is None or part.lit_rows is None else part.lit_rows
    crossed = np.zeros(len(part), bool) if crossed is None else crossed
    index, waves = np.flatnonzero((rows >= 0) | crossed), 2 * np.pi * frequencies / SPEED_OF_LIGHT
    if not len(index):
        return Light.whole(1, len(frequencies))
    ends, on_plane, no_limits = [end[pulse] for end in antennas.ends], 1e-9, (-np.inf, np.inf)
    share, mean = np.empty((1, len(index))), np.empty((1, len(index), len(waves)), np.complex128)
    limits = part_limits(part.triangles[index], antennas, pulse)
    for i, (row, cut, window) in enumerate(zip(rows[index].tolist(), crossed[index], limits.tolist(), strict=True)):
        facet, occluders, others = part.triangles[index[i]], np.zeros((0, 3, 3)), None
        if row >= 0 and part.lit_parts is not None:
            occluders, others = part.lit_parts.occluders_at(pulse, row)
            facet, on_plane = part.lit_parts.facet_at(row), part.lit_parts.on_plane
        limit = (window[0], window[1]) if cut else no_limits
        share[0, i], mean[0, i] = lit_part(facet, occluders, ends, waves, on_plane, others, window=limit)
    return Light(index, np.maximum(share, 0), mean)


def part_limits(triangles: np.ndarray, antennas: PulseGeometry, pulse: int) -> np.ndarray:
    """Limits of (u_t + u_r).rho, m, about the centroids of facets, within the range window of a pulse (k, 2)."""
    half_path = sum(np.linalg.norm(end[pulse] - centroids(triangles), axis=1) for end in (antennas.tx, antennas.rx)) / 2
    beyond = half_path - antennas.reference_range[pulse]
    return np.stack([2 * (beyond - antennas.far[pulse]), 2 * (beyond - antennas.near[pulse])], axis=1)


def across_edges(part: FacetSet, view: ChannelView, pulse: int) -> np.ndarray:
    """Coherent facets (k,) bool that an edge of the range window of a pulse crosses."""
    antennas, middle = view.antennas, centroids(part.triangles)[:, None]
    half_path = sum(np.linalg.norm(end[pulse] - part.triangles, axis=2) for end in (antennas.tx, antennas.rx)) / 2
    reach = np.linalg.norm(part.triangles - middle, axis=2).max(axis=1)
    about = half_path.mean(axis=1) - antennas.reference_range[pulse]
    near = [np.abs(about - limit[pulse]) < reach for limit in (antennas.near, antennas.far)]
    return np.asarray((near[0] | near[1]) & ~part.is_incoherent)
