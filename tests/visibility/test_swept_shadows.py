"""Facets that no shadow reaches at any pulse: against polygons of another library, at each of the pulses."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh
from helpers.cases import planned_within
from helpers.lit_cases import lit_polygon

import sarcl
from sarcl.scattering import facet_shadows
from sarcl.scene.triangles import areas, of_grid
from sarcl.visibility.swept_shadows import far_slopes, never_shaded

ROUGH = sarcl.Material(diagram="cos")


def ground(n, half=10.0, seed=None):
    axis = np.linspace(-half, half, n + 1)
    heights = (
        np.zeros((n + 1, n + 1)) if seed is None else np.random.default_rng(seed).uniform(-0.2, 0.2, (n + 1, n + 1))
    )
    return of_grid(np.stack([*np.meshgrid(axis, axis), heights], axis=-1))


@pytest.mark.parametrize("seed", range(4))
def test_a_terrain_shades_itself_by_its_far_slopes_alone(seed):
    """Hills with facets steeper than the lines of sight, against polygons of all facets at every pulse."""
    facets = ground(24, half=6.0, seed=seed)
    ends = [arc(n=3, start=start, elevation=0.6, width=0.2) for start in (0.0, 1.2)[: 1 + seed % 2]]
    is_far = far_slopes(facets, ends)
    assert 0 < is_far.sum() < 0.2 * len(facets)
    is_lit = never_shaded(facets, np.zeros(len(facets), bool), facets[is_far], ends)
    assert is_lit.any()
    assert not is_lit[is_far].any()
    far = facets[is_far].mean(axis=1)  # facets that lie nearest to these count most
    gaps = [np.linalg.norm(far - facet.mean(axis=0), axis=1).min() for facet in facets[is_lit]]
    for facet in facets[is_lit][np.argsort(gaps)[:3]]:
        assert least_share(facet, facets, ends) > 1 - 1e-6


def test_far_slopes_do_not_depend_on_the_winding_and_gentle_terrains_have_none():
    facets = ground(16, half=2.0, seed=1)
    assert (far_slopes(facets, [arc()]) == far_slopes(facets[:, ::-1], [arc()])).all()
    gentle = ground(16, half=60.0, seed=1)
    assert not far_slopes(gentle, [arc(distance=1e4)]).any()
    none = np.zeros(len(gentle), bool)
    assert never_shaded(gentle, none, gentle[:0], [arc(distance=1e4)]).all()


def box(size, at):
    return np.asarray(trimesh.creation.box(size).triangles) + np.array(at)


def arc(n=5, distance=60.0, elevation=0.6, start=0.0, width=0.4):
    azimuth = start + np.linspace(0, width, n)
    away = np.stack(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.full(n, np.sin(elevation))]
    )
    return distance * away.T


def least_share(facet, occluders, ends):
    """Least share of the area of a facet, m (3, 3), that all antennas of a pulse see."""
    shares = [shapely.area(lit_polygon(facet, occluders, antennas)) for antennas in zip(*ends, strict=True)]
    return min(shares) / areas(facet[None])[0]


@pytest.mark.parametrize("seed", range(8))
def test_all_that_is_said_to_be_lit_is_lit_whole_at_every_pulse(seed):
    random = np.random.default_rng(seed)
    facets = ground(24, seed=seed)
    parts = [box(random.uniform(0.02, 3, 3), [*random.uniform(-6, 6, 2), random.uniform(0.3, 3)]) for _ in range(2)]
    occluders = np.concatenate(
        [*parts, random.uniform(-1, 1, (3, 3, 3)) + random.uniform(-5, 5, (3, 1, 3)) + [0, 0, 7]]
    )
    numbers = {"distance": random.choice([60.0, 300.0, 1e4]), "elevation": random.uniform(0.3, 1.2)}
    ends = [arc(start=start, width=random.choice([1e-3, 0.1, 0.4]), **numbers) for start in (0.0, 1.5)[: 1 + seed % 2]]
    is_lit = never_shaded(facets, np.zeros(len(facets), bool), occluders, ends)
    assert 0.2 < is_lit.mean() < 1
    # those that lie nearest to others count most
    others = facets[~is_lit].mean(axis=1)
    gaps = [np.linalg.norm(others - facet.mean(axis=0), axis=1).min() for facet in facets[is_lit]]
    for facet in facets[is_lit][np.argsort(gaps)[:20]]:
        assert least_share(facet, occluders, ends) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("position", np.linspace(0, 1, 7))
def test_a_pole_whose_shadow_falls_on_a_facet_half_way_alone(position):
    """From both ends of the arc, and from its middle, the shadow falls beside the facet, on either side."""
    track = arc(n=201, distance=1e3, width=0.5)
    away = track[int(40 + 40 * position)]
    foot = np.array([2.0, 0, 0])
    place = foot - 3 * away / away[2]  # where the shadow of the pole's top falls at that pulse
    facets = place * [1, 1, 0] + np.array([[[0.1, 0, 0], [0, 0.1, 0], [-0.1, -0.1, 0]]])
    pole = box((0.01, 0.01, 3.2), (2.0, 0, 1.6))
    for pulse in (0, 100, 200):
        assert least_share(facets[0], pole, [track[[pulse]]]) == pytest.approx(1, abs=1e-9)
    assert least_share(facets[0], pole, [track[int(40 + 40 * position)][None]]) < 0.99
    assert not never_shaded(facets, np.ones(1, bool), pole, [track])
    assert never_shaded(facets + np.array([0, -8, 0]), np.ones(1, bool), pole, [track])


def test_a_higher_occluder_reaches_farther():
    facets, track = ground(40), arc(distance=1e3, width=0.3)
    low, high = (
        never_shaded(facets, np.ones(len(facets), bool), box((1, 1, 1), [0, 0, z]), [track]) for z in (0.5, 4.0)
    )
    assert high.sum() < low.sum() < len(facets)
    assert low.sum() > 0.95 * len(facets)


def test_facets_that_turn_away_and_antennas_nearby_settle_nothing():
    facets, none, away = ground(4), np.zeros(32, bool), box((1, 1, 1), [0, 0, 1e-3])
    assert not never_shaded(facets[:, ::-1], none, away, [arc()]).any()  # from behind
    assert never_shaded(facets[:, ::-1], ~none, away, [arc()]).any()
    assert not never_shaded(facets, none, away, [arc(distance=15.0)]).any()
    sinking = np.array([[60, 0, z] for z in (20.0, 1.0, -1.0)])  # below the ground at last
    assert not never_shaded(facets, none, away, [sinking]).any()
    assert never_shaded(facets[:0], none[:0], away, [arc()]).shape == (0,)


@pytest.mark.parametrize("bistatic", [False, True])
def test_echoes_are_those_of_looks_at_all_pieces(bistatic, monkeypatch):
    """Rough ground with a box: the pieces that are sorted out beforehand, or looked at like the others."""
    axis = np.linspace(-8, 8, 17)
    heights = 0.05 * np.sin(axis) * np.cos(axis[:, None])
    scene = sarcl.Scene.from_heights(axis, axis, heights, material=ROUGH)
    scene = scene + sarcl.Scene.facets(box((2, 3, 2), (0, 0, 1.0)), material=ROUGH)
    track, receiver = (
        sarcl.Trajectory.circle(radius=7e3, height=5e3, start=start, arc=0.05, n_pulses=16) for start in (0.3, 0.9)
    )
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)

    def echo():
        options = {"receiver": receiver if bistatic else None, "tolerance": 1e-2, "seed": 3}
        return planned_within({"few_looks": 0}, sarcl.echo, scene, chirp, track, **options).run()

    sorted_out, number = echo(), []
    real = facet_shadows.never_shaded

    def nothing(*args):
        number.append(int(real(*args).sum()))
        return np.zeros(len(args[0]), bool)

    monkeypatch.setattr(facet_shadows, "never_shaded", nothing)
    all_looked_at = echo()
    assert number[0] > 100
    assert sorted_out.report.contributions_skipped == all_looked_at.report.contributions_skipped
    error = np.linalg.norm(sorted_out.samples - all_looked_at.samples) / np.linalg.norm(all_looked_at.samples)
    assert error <= 2e-3  # other lines, or pulses, of the same tolerance
    terms = [{t.name: t.value for t in raw.report.error_terms} for raw in (sorted_out, all_looked_at)]
    assert terms[0]["shadow edges"] == pytest.approx(terms[1]["shadow edges"], rel=0.2)
