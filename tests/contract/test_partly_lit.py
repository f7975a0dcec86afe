"""Echoes of facets that shadow one another meet the tolerance: against closed forms, and another library's polygons."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import quick_of, thinned
from helpers.lit_cases import FAR, exact_echo, lit_polygon

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference.facet import facet_amplitude

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
WINDOW = {"range_window": (-20.0, 20.0), "reference": (0.0, 0.0, 0.0)}


def sights(incidence, azimuth, n=8, arc=0.01):
    """Unit vectors from the scene to antennas on an arc (n, 3)."""
    turn = azimuth + np.linspace(-arc / 2, arc / 2, n)
    up = np.full(n, np.cos(incidence))
    return np.stack([np.sin(incidence) * np.cos(turn), np.sin(incidence) * np.sin(turn), up], axis=1)


def track(u):
    return sarcl.Trajectory(np.arange(len(u)) / 100, FAR * u)


def some_frequencies(raw, n=6):
    """Indices of samples, and their frequencies, Hz."""
    some = np.linspace(0, raw.n_samples - 1, n).astype(int)
    return some, np.ravel(raw.frequency)[0] + some * np.ravel(raw.frequency_step)[0]


def relative_error(raw, scene, *, pulses, occluders=None, rx=None):
    """Error of some samples, over the larger of their norm and the norm of facets at random phases."""
    some, frequencies = some_frequencies(raw)
    wrong = right = power = 0.0
    for p in pulses:
        antennas = [raw.tx[p]] if rx is None else [raw.tx[p], rx[p]]
        wanted, powers = exact_echo(scene.triangles, frequencies, antennas, raw.reference_range[p], occluders)
        wrong += (np.abs(raw.samples[p, some] - wanted) ** 2).sum()
        right += (np.abs(wanted) ** 2).sum()
        power += powers.sum()
    return np.sqrt(wrong / max(right, power))


def square(width, height=0.0, cells=8, project=lambda places: places):
    """A square about the z axis, of small triangles."""
    x = np.linspace(-width / 2, width / 2, cells + 1)
    places = np.stack([*np.meshgrid(x, x, indexing="ij"), np.full((cells + 1, cells + 1), height)], axis=-1)
    places = project(places)
    a, b, c, d = places[:-1, :-1], places[1:, :-1], places[1:, 1:], places[:-1, 1:]
    return np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


def closed_form(width, height, wide, raw, some, frequencies):
    """Echo of a square of side `width` at a height above one of side `wide`: both, less the shadow (n_pulses, n)."""
    out = np.zeros((raw.n_rows, len(some)), complex)
    for p, antenna in enumerate(raw.tx):
        stretch = height / (antenna[2] - height)

        def shadow(places, antenna=antenna, stretch=stretch):
            flat = places[..., :2] + (places[..., :2] - antenna[:2]) * stretch
            return np.concatenate([flat, np.zeros_like(places[..., :1])], axis=-1)

        for triangles, sign in (
            (square(wide), 1),
            (square(width, height), 1),
            (square(width, height, project=shadow), -1),
        ):
            centers = triangles.mean(axis=1)
            away = np.sqrt(((centers.astype(np.longdouble) - antenna) ** 2).sum(axis=1))
            delay = 2 * (away - np.longdouble(raw.reference_range[p])) / np.longdouble(SPEED_OF_LIGHT)
            look = (antenna - centers) / np.linalg.norm(antenna - centers, axis=1)[:, None]
            for i, f in enumerate(frequencies):
                sent = facet_amplitude(triangles, np.inf, f, look, look)[:, 0, 0]
                out[p, i] += sign * (sent * np.exp(-2j * np.pi * ((np.longdouble(f) * delay) % 1).astype(float))).sum()
    return out


@pytest.mark.parametrize(  # seed 6: the plate's two triangles have 85 times its echo
    "seed, tolerance", thinned([0, 6, 1, 2], [1e-3, 1e-2, 1e-1])
)
def test_two_plates_are_both_less_the_shadow_of_one_on_the_other(seed, tolerance):
    """A conducting square above another: an exact closed form, whose shadow moves from pulse to pulse."""
    random = np.random.default_rng(seed)
    width, height, incidence = random.uniform(0.3, 2), random.uniform(0.2, 2), np.deg2rad(random.uniform(1, 60))
    wide = max(3.0, 1.2 * (width + 2 * height * np.tan(incidence) + 1))
    scene = sarcl.shapes.plate((wide, wide)) + sarcl.shapes.plate((width, width)).moved((0, 0, height))
    raw = sarcl.echo(
        scene, CHIRP, track(sights(incidence, random.uniform(0, 2 * np.pi))), tolerance=tolerance, **WINDOW
    )
    some, frequencies = some_frequencies(raw, 4)
    wanted = closed_form(width, height, wide, raw, some, frequencies)
    assert np.linalg.norm(raw.samples[:, some] - wanted) <= tolerance * np.linalg.norm(wanted)
    assert raw.report.predicted_error <= tolerance


def boxes():
    """A box through another, on a plate, and one on top: touching faces, faces that cut one another."""
    box = sarcl.shapes.box
    through, on_top = box((0.4, 1.2, 0.3)).moved((0.1, 0, 0.1)), box((0.3, 0.3, 0.3)).moved((-0.2, 0, 0.5))
    return sarcl.shapes.plate((4.0, 4.0)) + box((1.0, 0.6, 0.5)) + through + on_top


def fence(pole):
    """A plate behind poles, `pole` m wide and 0.25 m apart."""
    scene = sarcl.shapes.plate((2.0, 2.0))
    for x in np.arange(-0.9, 1, 0.25):
        scene = scene + sarcl.shapes.plate((pole, 2.0)).moved((x, 0, 0.5))
    return scene


SCENES = {"boxes": boxes, "poles of 5 mm": lambda: fence(0.005), "poles of 20 mm": lambda: fence(0.02)}


@pytest.mark.parametrize("name, tolerance", thinned(SCENES, [1e-2, 1e-1]))
def test_scenes_that_shadow_themselves_keep_the_tolerance(name, tolerance):
    scene = SCENES[name]()
    raw = sarcl.echo(scene, CHIRP, track(sights(0.6, 0.35, n=4)), tolerance=tolerance, **WINDOW)
    assert relative_error(raw, scene, pulses=(0, 3)) <= raw.report.predicted_error <= tolerance


@pytest.mark.parametrize("tolerance", quick_of([1e-2], [1e-1, 1e-2]))
def test_a_facet_is_lit_where_both_antennas_see_it(tolerance):
    scene, u = boxes(), sights(0.6, 0.35, n=3)
    receivers = track(sights(0.5, 0.8, n=3))
    raw = sarcl.echo(scene, CHIRP, track(u), receiver=receivers, tolerance=tolerance, **WINDOW)
    assert relative_error(raw, scene, pulses=(1,), rx=receivers.positions) <= tolerance


def test_every_look_by_itself_is_the_look_among_others():
    scene, u = boxes(), sights(0.6, 0.35, n=3, arc=0.3)
    together = sarcl.echo(scene, CHIRP, track(u), tolerance=1e-2, **WINDOW).samples
    alone = [sarcl.echo(scene, CHIRP, track(u[i : i + 1]), tolerance=1e-2, **WINDOW).samples[0] for i in range(3)]
    assert np.linalg.norm(together - alone) <= 2e-2 * np.linalg.norm(alone)


@pytest.mark.filterwarnings("ignore:mesh too coarse")
@pytest.mark.parametrize("seed", range(6))
def test_a_convex_closed_body_has_the_same_echo_without_shadows(seed):
    random = np.random.default_rng(seed)
    from scipy.spatial import ConvexHull

    places = random.standard_normal((random.integers(6, 30), 3)) * random.uniform(0.3, 1.0, 3)
    hull = ConvexHull(places)
    triangles = places[hull.simplices]
    outward = np.einsum("ij,ij->i", np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]),
                        triangles.mean(axis=1) - places.mean(axis=0)) > 0  # fmt: skip
    triangles = np.where(outward[:, None, None], triangles, triangles[:, ::-1])
    scene = sarcl.Scene.facets(triangles, two_sided=False)
    u = sights(random.uniform(0.2, 1.5), random.uniform(0, 6), n=12, arc=random.choice([0.01, 2.0]))
    for tolerance in (1e-1, 1e-3):
        lit, whole = (
            sarcl.echo(scene, CHIRP, track(u), tolerance=tolerance, shadows=shadows, **WINDOW).samples
            for shadows in (True, False)
        )
        assert np.linalg.norm(lit - whole) <= 1e-6 * np.linalg.norm(whole)


@pytest.mark.parametrize("two_sided, bistatic", thinned([False, True], [False, True]))
def test_a_terrain_and_a_house_sunk_in_it_have_the_echo_of_the_same_facets_without_heights(two_sided, bistatic):
    """Of a terrain only slopes that face away from an antenna are searched for shadows; of other facets, all are."""
    axis, slow = np.linspace(-20.0, 20.0, 7), sarcl.Waveform.chirp(center=1e9, bandwidth=30e6, duration=1e-6)
    scene = sarcl.Scene.from_heights(axis, axis, np.random.default_rng(1).normal(0.0, 2.0, (7, 7)))
    scene += sarcl.shapes.box((5.0, 7.0, 9.0)).moved((1.0, 2.0, -4.0))
    scene = replace(scene, two_sided=np.full(len(scene.triangles), two_sided))
    low, high = (
        sarcl.Trajectory(np.arange(3), [[x, y, z] for y in (-5e3, 0, 5e3)]) for x, z in ((-3e5, 7e4), (-1e5, 1.2e5))
    )
    options = {"receiver": high if bistatic else None, "tolerance": 1e-1, "check": False}
    wanted = sarcl.echo(replace(scene, heights=None), slow, low, **options).samples
    change, dark = (sarcl.echo(scene, slow, low, shadows=s, **options).samples - wanted for s in (True, False))
    assert np.linalg.norm(change) < 1e-5 * np.linalg.norm(wanted) < 1e-4 * np.linalg.norm(dark)


def test_the_check_recomputes_lit_parts_by_the_reference():
    raw = sarcl.echo(boxes(), CHIRP, track(sights(0.6, 0.35, n=4)), tolerance=1e-2, check=True, **WINDOW)
    assert 0 < raw.report.measured_error <= raw.report.predicted_error


def test_rough_facets_send_back_the_power_of_their_lit_part():
    """At the facet's random phase: the amplitude falls as the root of the share."""
    facet = np.array([[[-1, -1, 0], [1, -1, 0], [-1, 1, 0]]], float)
    rough = sarcl.Scene.facets(facet, material=sarcl.Material(diagram="isotropic", height=0.05))
    black = sarcl.Scene.facets(0.8 * facet + [0, 0, 0.4], reflectivity=0.0)
    way = track(sights(0.1, 0.3, n=4, arc=1e-3))
    lit, whole = (
        sarcl.echo(scene, CHIRP, way, max_edge=None, tolerance=1e-3, **WINDOW) for scene in (rough + black, rough)
    )
    for pulse in (0, 3):
        share = lit_polygon(facet[0], black.triangles, [lit.tx[pulse]]).area / 2
        ratio = np.vdot(whole.samples[pulse], lit.samples[pulse]) / np.vdot(whole.samples[pulse], whole.samples[pulse])
        assert ratio == pytest.approx(np.sqrt(share), abs=2e-3)


def test_a_scene_that_reaches_too_far_for_its_facets_is_warned_of():
    """Facets nearer to one another's planes than 1e-6 of the scene do not shadow one another."""
    plates = sarcl.shapes.plate((3, 3)) + sarcl.shapes.plate((0.5, 0.5)).moved((0, 0, 0.5))
    window = {"reference": (0, 0, 0), "range_window": (-5, 5), "tolerance": 1e-1}
    path = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=0.001, n_pulses=2)
    far = plates + sarcl.shapes.plate((1, 1)).moved((1e6, 0, 0))
    with pytest.warns(sarcl.SarclWarning, match=r"the scene reaches over 1e\+06 m: .* 6 are hardly larger than that"):
        sarcl.echo(far, CHIRP, path, **window)
    with warnings.catch_warnings():
        warnings.simplefilter("error", sarcl.SarclWarning)
        sarcl.echo(plates, CHIRP, path, **window)
