"""Beams with hard edges: where scatterers pass them, their maps against the sum, and echoes against the exact sum."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import opened, variants

import sarcl
from sarcl import pointing
from sarcl.model.antenna import Antenna
from sarcl.reference import spectral_echo as twin
from sarcl.reference.equations import point_echo as exact_echo
from sarcl.scattering.antenna_weights import weights_of
from sarcl.simulation.spectral import _edge_map as edge
from sarcl.simulation.spectral._aspect_window import aspects, wavenumber
from sarcl.simulation.spectral._beam_edges import beam_edges, continued_weights
from sarcl.simulation.spectral._map_plan import plan_map, tile_of
from sarcl.simulation.spectral._map_spectrum import ReflectivityMap
from sarcl.simulation.spectral._straight_track import straight_track
from sarcl.simulation.spectral.planning_time import PlanningTime

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=2e-6)
LOOK, DISTANCE, SPACING = float(np.arctan2(8e3, 6e3)), 1e4, 0.4
AZIMUTH, ELEVATION = np.linspace(-0.004, 0.004, 9), np.linspace(-0.1, 0.1, 5)
FLAT = Antenna.table(AZIMUTH, ELEVATION, np.ones((9, 5)))
UNEVEN = Antenna.table(
    AZIMUTH, ELEVATION, np.outer(1 + np.cos(np.linspace(-2, 1, 9)) + 0.3j * np.linspace(-1, 1, 9), np.ones(5))
)


@pytest.fixture(scope="module")
def device():
    return opened(variants(names=())[0].values[0])


def track_of(squint=0.0, n=300):
    start = (0, -n * SPACING / 2 - np.tan(squint) * DISTANCE, 6e3)
    line = sarcl.Trajectory.line(start=start, velocity=(0, 100, 0), prf=100 / SPACING, n_pulses=n)
    return pointing.stripmap(line, look=LOOK, side="right", squint=squint)


def points(extent, n=60):
    random = np.random.default_rng(0)
    places = random.uniform(-0.5, 0.5, (n, 3)) * extent + (8e3, 0, 0)
    return sarcl.Scene.points(places, random.normal(size=n) + 1j * random.normal(size=n))


def edges_of(antenna, track, positions):
    weights = weights_of(antenna, None, track, None, CHIRP, positions.mean(axis=0))
    line = straight_track(track, CHIRP.center, 1e-3)
    continued = continued_weights(weights, 1e-3)
    return beam_edges(weights, continued, line, positions), continued, weights, line


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("squint", [0.0, 0.3])
def test_gain_ends_at_the_edges_and_their_aspect_depends_on_elevation(squint, side):
    track = pointing.stripmap(track_of(squint), look=LOOK, side=side, squint=squint)
    sign = 1 if side == "right" else -1
    positions = points((900, 100, 300)).positions * (sign, 1, 1)
    edges, _, _, line = edges_of(FLAT, track, positions)
    azimuth, slant_range = line.coordinates(positions)
    for tangents, outwards in ((edges.first, -1), (edges.last, 1)):
        for shift, inside in ((-2e-9 * outwards, True), (2e-9 * outwards, False)):
            s = np.sin(np.arctan(tangents + shift))
            antennas = line.antennas(azimuth, slant_range, s)
            gain = FLAT.gain((positions - antennas) @ FLAT.axes(track)[0], CHIRP.center)
            assert (np.abs(gain) > 0.9).all() if inside else not gain.any()
    # an edge at one aspect for all would be wrong by more than a pulse
    assert np.ptp(edges.first) * DISTANCE > (1.5 if squint else 0.02) * SPACING


def test_a_continued_table_is_the_same_inside_and_smooth_at_its_ends():
    track = track_of()
    _, continued, weights, _ = edges_of(UNEVEN, track, points((100, 100, 10)).positions)
    old, new = weights.pair[0], continued.pair[0]
    step = 2e-6  # rad: twice the slack
    a = np.concatenate([np.linspace(-0.004, 0.004, 33), 0.004 + step * np.arange(-3, 4)])
    toward = np.stack([np.cos(a), np.sin(a), 0.01 + 0 * a], axis=-1)
    g, h = old.gain(toward, 1e10), new.gain(toward, 1e10)
    assert np.allclose(g[:33], h[:33], rtol=1e-12)
    assert not g[-3:].any()  # the table itself ends
    assert np.abs(np.diff(h[33:], n=3)).max() < 1e-2 * np.abs(np.diff(h[33:], n=2)).max()
    tapered = Antenna.table(AZIMUTH, ELEVATION, np.outer(1 - (AZIMUTH / 0.004) ** 2, np.ones(5)))
    assert edges_of(tapered, track, points((100, 100, 10)).positions)[0] is None


@pytest.mark.parametrize("side", [1, -1])
def test_the_map_of_an_edge_is_the_sum_over_scatterers_and_pulses(side, device):
    line = straight_track(track_of(), CHIRP.center, 1e-3)
    random, n = np.random.default_rng(1), 40
    azimuth, slant_range = random.uniform(-60, 160, n), random.uniform(9900, 10100, n)
    band = (9.5e9, 9.7e9)
    seen = aspects(-0.004, 0.004, (9900.0, 10100.0), band, (-200.0, 200.0), 1e-4, (True, True))

    def functions(sines, frequency):
        return np.stack([1 + 0 * sines, 50 * sines]).astype(complex)

    tangents = side * -0.004 + random.uniform(-1e-5, 0, n) * side
    inner = seen.low if side > 0 else seen.high
    places = edge.edge_places(tangents, azimuth, slant_range, side, inner, line)
    task = edge.EdgeTask(seen, functions, np.eye(2), line, 1e-4, 1e-3, PlanningTime(200, lambda: 0.0))
    transfer, nodes = edge.plan_edge(task, places, 1e4)
    grid, numbers = edge.edge_wavenumbers(transfer, nodes, places.length, line)
    assert transfer.error <= 1e-4 and grid.n_lags >= line.n_pulses + places.length
    plan = plan_map(1e-4, numbers, grid, (9890.0, 10110.0), 1.0, tile_of(device), 1e-3)
    x = places.pulse * line.spacing
    held = ReflectivityMap(device, plan, numbers, grid, x, places.distance)
    b = (random.normal(size=n) + 1j * random.normal(size=n))[places.picked]
    f, whole = np.linspace(*band, 3), slice(0, grid.count)
    for term in range(2):
        out = np.zeros((grid.count, 3), np.complex64)
        for tables, share in zip(transfer.tables[term], nodes.shares(places.sine, places.distance), strict=True):
            over = np.concatenate([made for _, made in held.over_azimuth(b * share, whole, 1e9)], axis=1)
            held.add(over, whole, tables, transfer, f, out, 1e9)
        samples = np.fft.ifft(grid.folded(np.ascontiguousarray(out.T))) * grid.n_lags / grid.period

        def weight(s, term=term):
            rest = np.where(side * s < 0, 1 - seen.window(s), 0)
            return rest * functions(s, 0.0)[term]

        scatterers = twin.EdgeScatterers(b, azimuth[places.picked], slant_range[places.picked], places.pulse)
        track = np.arange(line.n_pulses) * line.spacing
        for i, one in enumerate(f.tolist()):
            wanted = twin.beam_edge(scatterers, side, track, weight, float(wavenumber(one)), 1e4)
            assert np.linalg.norm(samples[i, : line.n_pulses] - wanted) <= 3e-4 * np.linalg.norm(wanted)


CASES = {
    "broadside": (FLAT, 0.0, (100, 100, 10)),
    "squint": (FLAT, 0.3, (100, 100, 10)),
    "edges by elevation": (UNEVEN, 0.3, (200, 60, 200)),
    "beam wider than the track": (Antenna.table(4 * AZIMUTH, ELEVATION, np.ones((9, 5))), 0.0, (100, 240, 10)),
}


@pytest.mark.parametrize("tolerance", [1e-2, pytest.param(1e-3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", CASES)
def test_echoes_of_points_are_the_exact_sum(case, tolerance, device):
    antenna, squint, extent = CASES[case]
    scene, track = points(extent), track_of(squint)
    raw = sarcl.spectral_echo(scene, CHIRP, track, antenna=antenna, tolerance=tolerance, device=device)
    f, axes = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples), antenna.axes(track)

    def wanted(p, shift=0.0):
        seen = (scene.positions - raw.tx[p] - (0, shift, 0)) @ axes[p]
        amplitudes = scene.amplitudes * antenna.gain(seen, CHIRP.center) ** 2
        return exact_echo(scene.positions, amplitudes, f, raw.tx[p], raw.tx[p], raw.reference_range[p])

    rows = range(0, raw.n_rows, 11)
    exact = np.stack([wanted(p) for p in rows])
    found = np.linalg.norm(raw.samples[::11] - exact) / np.linalg.norm(exact)
    assert found <= raw.report.predicted_error <= tolerance
    assert raw.report.measured_error == pytest.approx(found, rel=1)
    assert raw.report.plan["maps of hard edges of the beam"] > 1
    # edges that lie two pulses elsewhere are not these edges
    moved = np.stack([wanted(p, 2 * SPACING) for p in rows])
    assert np.linalg.norm(moved - exact) > 3 * raw.report.predicted_error * np.linalg.norm(exact)


@pytest.mark.slow
def test_rough_facets_under_a_beam_with_hard_edges(device):
    axis = np.linspace(-6, 6, 7)
    material = sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="cos2")
    heights = np.random.default_rng(1).normal(size=(7, 7)) * 0.05
    scene = sarcl.Scene.from_heights(8e3 + axis, axis, heights, material=material)
    raw = sarcl.spectral_echo(
        scene, CHIRP, track_of(), antenna=FLAT, tolerance=1e-2, shadows=False, check=True, device=device
    )
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-2


@pytest.mark.slow
def test_beams_narrower_than_their_edges_spread_over_elevation_are_refused(device):
    narrow = Antenna.table(AZIMUTH / 40, 4 * ELEVATION, np.ones((9, 5)))
    with pytest.raises(ValueError, match=r"use echo"):
        sarcl.spectral_echo(points((2e3, 10, 10)), CHIRP, track_of(0.3), antenna=narrow, tolerance=1e-1, device=device)


def test_a_scene_that_only_a_part_of_the_track_sees(device):
    # the responses end before the track does
    scene = sarcl.Scene.points([(8e3, -20.0, 0.0)], [1.0])
    raw = sarcl.spectral_echo(scene, CHIRP, track_of(), antenna=FLAT, tolerance=2e-3, check=True, device=device)
    assert raw.report.measured_error <= raw.report.predicted_error <= 2e-3
    power = np.abs(raw.samples).max(axis=1)
    seen = np.flatnonzero(power > 0.5)
    assert np.ptp(seen) + 1 == len(seen) == pytest.approx(0.008 * DISTANCE / SPACING, abs=2)
    assert power[np.setdiff1d(np.arange(300), seen)].max() < 1e-2
