"""Echoes of terrain: scenes keep their heights, which change no shadow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import planned_within
from scipy.ndimage import gaussian_filter

import sarcl
from sarcl import shapes
from sarcl.scattering import facet_shadows
from sarcl.scene.terrain import facets_on
from sarcl.visibility import illumination

WAVE = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=1e-6)
LAMBERT = sarcl.Material(eps_r=4.0, diagram="cos")


def hills(n=60, height=3.0, **options):
    axis = np.arange(n + 1) - n / 2
    z = gaussian_filter(np.random.default_rng(1).standard_normal((n + 1, n + 1)), 5)
    return sarcl.Scene.from_heights(axis, axis, height * z / z.std(), **{"material": LAMBERT, **options})


def track(elevation=0.3, n=16, distance=2e4):
    azimuth = 0.02 * np.arange(n) / n + 0.3
    flat = distance * np.cos(elevation) * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    return sarcl.Trajectory(np.arange(n) / 100.0, np.column_stack([flat, np.full(n, distance * np.sin(elevation))]))


@pytest.fixture
def sampled(monkeypatch):
    """Tasks of sampled shadows and their shares, call by call of `echo`."""
    calls, illuminated = [], illumination.illuminated

    def spy(task, *rest):
        _, slopes, floor = task.occlusions
        assert not (slopes.hidden & floor.hidden).any() and len(slopes.occluders) <= len(floor.occluders)
        calls.append((task, illuminated(task, *rest)))
        return calls[-1][1]

    monkeypatch.setattr(facet_shadows, "illuminated", spy)
    return calls


def terrain_facets(sampled):
    """Facets of the terrain of which shadows are sampled, 0 where none is known as such, of each task."""
    return [len(task.occlusions[2].occluders) for task, _ in sampled]


def without(scene):
    """The same facets, of no known terrain."""
    return replace(scene, heights=None)


SCENES = {
    "terrain": hills,
    "rough terrain": lambda: hills(point_roughness=0.05),
    "moved": lambda: hills().moved((3.1, -2.7, 10.3)),
    "a tank and points on it": lambda: (
        (ground := hills())
        + shapes.box((4, 3, 3), material=LAMBERT).on(ground, 5, 5, depth=1)
        + sarcl.Scene.points([[0, 0, 9.0]])
    ),
}


OPTIONS = {"tolerance": 1e-2, "check": False, "max_edge": 0.5}


def sampled_echo(*subjects, **options):
    """Echoes as of scenes too large for lit parts at every pulse."""
    return planned_within({"few_looks": 0}, sarcl.echo, *subjects, **options).run()


@pytest.mark.filterwarnings("ignore:.*moves posts:sarcl.SarclWarning")
@pytest.mark.parametrize("name", SCENES)
def test_heights_change_no_shadow_on_rough_terrain(name, sampled):
    scene = SCENES[name]()
    known, unknown = (sampled_echo(one, WAVE, track(), **OPTIONS) for one in (scene, without(scene)))
    assert terrain_facets(sampled) == [2 * 60**2, 0]
    tasks, found = zip(*sampled, strict=True)
    np.testing.assert_array_equal(tasks[0].triangles, tasks[1].triangles)
    shares = [np.array([one.fraction_at(pulse) for pulse in range(len(track().positions))]) for one in found]
    assert np.abs(shares[0] - shares[1]).mean() <= 1e-5  # 1 facet in 1000 differs, by some of its samples
    norm = np.linalg.norm(unknown.samples)
    assert np.linalg.norm(known.samples - unknown.samples) <= 1e-3 * norm
    assert known.report.plan["shadow edges"].startswith("sampled, ")
    shadowed = [r.report.contributions_skipped["shadowed"] for r in (known, unknown)]
    # a facet of which one sample of 512 is seen counts as lit; the shares themselves are compared above
    assert shadowed[0] == pytest.approx(shadowed[1], rel=3e-3) and shadowed[0] > 0
    dark = sampled_echo(without(scene), WAVE, track(), **OPTIONS, shadows=False)
    assert np.linalg.norm(dark.samples - unknown.samples) > 0.1 * norm


def test_terrain_below_every_line_of_sight_hides_what_stands_under_it_alone(monkeypatch):
    """Gentle hills are left out as occluders, but for a box that is half in the ground."""
    ground, asked = hills(height=0.3), []
    illuminated = illumination.illuminated
    monkeypatch.setattr(
        facet_shadows, "illuminated", lambda task, *rest: asked.append(task) or illuminated(task, *rest)
    )
    scene = ground + shapes.box((4, 3, 3), material=LAMBERT).moved((5, 5, 0.2))
    known, unknown = (sampled_echo(one, WAVE, track(), **OPTIONS) for one in (scene, without(scene)))
    assert np.linalg.norm(known.samples - unknown.samples) <= 1e-2 * np.linalg.norm(unknown.samples)
    solid, slopes, floor = asked[0].occlusions
    assert len(floor.occluders) == len(ground.triangles) and len(solid.occluders) == 12
    assert 0 < floor.hidden.sum() < 0.1 * len(floor.hidden) and not slopes.hidden.any()
    assert not len(asked[1].occlusions[2].occluders)


def test_large_smooth_terrain_is_clipped_like_a_small_one(sampled):
    scene = hills(material=sarcl.Material(eps_r=4.0))
    exact = sarcl.echo(scene, WAVE, track(n=2), **OPTIONS)
    raw = sampled_echo(scene, WAVE, track(n=2), **OPTIONS)
    assert sampled == [] and "shadow edges" not in raw.report.plan
    np.testing.assert_array_equal(raw.samples, exact.samples)


def test_smooth_terrain_is_clipped_whether_its_heights_are_known_or_not(sampled):
    """Cut into smaller facets: n = 12 has the same bits. Two facets of n = 16 turn away during the track, and shade one
    another then: their amplitudes are interpolated between pulses in one echo alone."""
    for n, bound in ((12, 0.0), (16, 1e-3)):
        scene = hills(n=n, height=1.5, material="metal")
        known, unknown = (sarcl.echo(s, WAVE, track(), tolerance=1e-2, check=False) for s in (scene, without(scene)))
        assert sampled == [] and known.report.contributions_skipped["shadowed"] > 0
        assert known.report.plan["partly lit facets"] > 30
        assert np.linalg.norm(known.samples - unknown.samples) <= bound * np.linalg.norm(unknown.samples)


@pytest.mark.parametrize("height", [0.0, 2.0])
def test_smooth_plates_beside_gentle_hills_are_shaded_alike_whether_heights_are_known_or_not(height):
    """Upright ones, the second one behind the first: above the ground, which shades nothing, and half in it."""
    upright = shapes.plate((2, 2), material="metal", two_sided=True).triangles[:, :, [2, 0, 1]]
    places = np.array([(0.0, 0.5, height), (-3.0, 0.0, height)])
    plates = sarcl.Scene.facets((places[:, None, None] + upright).reshape(-1, 3, 3))
    scene = hills(n=12, height=0.05) + plates
    known, bare = (sarcl.echo(s, WAVE, track(n=2), tolerance=1e-2, check=False) for s in (scene, without(scene)))
    lit = sarcl.echo(scene, WAVE, track(n=2), tolerance=1e-2, check=False, shadows=False)
    norm = np.linalg.norm(bare.samples)
    assert (
        np.linalg.norm(known.samples - bare.samples) <= 1e-5 * norm < 0.1 * np.linalg.norm(lit.samples - bare.samples)
    )


def test_scenes_keep_heights_as_long_as_they_are_theirs():
    scene = hills(n=20)
    x, _, z = scene.heights
    assert not any(v.flags.writeable for v in scene.heights)
    assert facets_on(scene.heights, scene.triangles).all()
    cut = scene.split(0.4)
    assert facets_on(cut.heights, cut.triangles).all()
    moved = scene.moved((1, 2, 3))
    assert (moved.heights[2] == z + 3).all() and (moved.heights[0] == x + 1).all()
    tower = shapes.cylinder(1.0, 20.0)
    for both in (scene + tower, tower + scene):
        assert both.heights is scene.heights
        assert facets_on(both.heights, both.triangles).sum() == len(scene.triangles)
    small = hills(n=8).moved((0, 0, 50))
    assert (small + scene).heights is scene.heights and (scene + small).heights is scene.heights
    rough = hills(n=20, point_roughness=0.2)
    made = rough.realized(5)
    assert facets_on(made.heights, made.triangles).all() and 0.1 < (made.heights[2] - rough.heights[2]).std() < 0.3


def test_what_is_no_longer_all_of_a_terrain_is_taken_by_its_facets(sampled):
    scene = hills(n=20)
    holed = scene.part(np.arange(len(scene.triangles)) != 7)
    shifted = replace(scene, triangles=scene.triangles + np.array([0, 0, 0.5]))
    sheared = hills(n=20, point_roughness=0.1)
    sheared = replace(sheared, point_roughness=sheared.point_roughness[..., ::-1]).realized(1)  # moves sideways
    for other in (holed, shifted, sheared):
        sampled_echo(other, WAVE, track(n=4), tolerance=1e-1, check=False)
    assert terrain_facets(sampled) == [0] * 3


def test_an_antenna_under_the_terrain_is_refused():
    scene = hills()
    with pytest.raises(ValueError, match=r"track\[0\] stands .* m under the terrain; raise the track"):
        sarcl.echo(scene, WAVE, sarcl.Trajectory([0.0], [[5.0, 5.0, -400.0]]), max_edge=5.0, tolerance=1e-1)


def test_no_shadow_is_looked_for_on_terrain_below_lines_of_sight_steeper_than_its_slopes(sampled):
    above, low = (
        sampled_echo(hills(height=1.5), WAVE, track(elevation, n=4), tolerance=3e-2) for elevation in (1.2, 0.15)
    )
    assert len(sampled) == 1 and low.report.contributions_skipped["shadowed"] > 0
    assert above.report.contributions_skipped.get("shadowed", 0) == 0


def test_other_ray_casters_are_refused():
    with pytest.raises(TypeError, match=r"shadows is .*optix"):
        sarcl.echo(hills(n=4), WAVE, track(n=4), shadows="optix")
    with pytest.raises(ValueError, match="shadows is 'embree'; rays of Embree were taken out"):
        sarcl.echo(hills(n=4), WAVE, track(n=4), shadows="embree")


def test_shadows_move_evenly_between_the_pulses_at_which_they_are_found():
    # as a pole's shadow sweeps over the ground; the check takes the shares of every pulse
    x, n = np.linspace(-20, 20, 31), 240
    ground = sarcl.Scene.from_heights(x, x, np.zeros((31, 31))).triangles
    pole = shapes.box((0.8, 0.8, 6.0)).triangles
    rough = sarcl.Material(eps_r=4, conductivity=1e-3, diagram="cos2")
    scene = sarcl.Scene.facets(np.concatenate([ground, pole]), two_sided=False, material=rough)
    track = sarcl.Trajectory.circle(radius=7e3, height=7e3, arc=0.5, n_pulses=n, prf=100.0)
    chirp = sarcl.Waveform.chirp(center=0.3e9, bandwidth=50e6, duration=1e-6)
    report = sampled_echo(
        scene, chirp, track, range_window=(-40, 40), max_edge=None, seed=3, tolerance=1e-2, check=True
    ).report
    assert report.contributions_skipped["shadowed"] > 0
    assert report.measured_error <= report.predicted_error <= 1e-2
