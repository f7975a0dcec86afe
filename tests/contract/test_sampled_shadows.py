"""Echoes of many rough facets, whose shadows are counted in samples from some pulses, against lit parts at all."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import trimesh
from helpers.cases import planned_within, quick_of, thinned

import sarcl

pytestmark = pytest.mark.filterwarnings("ignore:too few facets for speckle:sarcl.SarclWarning")

ROUGH = sarcl.Material(diagram="cos")
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
PULSES = 12


def box(size, at):
    x, y = at
    return sarcl.Scene.facets(trimesh.creation.box(size).triangles + np.array([x, y, size[2] / 2]), material=ROUGH)


def hills():
    axis = np.linspace(-8, 8, 9)
    heights = 0.6 * np.random.default_rng(0).standard_normal((9, 9))
    return sarcl.Scene.from_heights(axis, axis, heights, material=ROUGH)


def field():
    return sarcl.Scene.facets(sarcl.shapes.plate((16, 16)).triangles, material=ROUGH)


def gentle():
    axis = np.linspace(-8, 8, 9)
    return sarcl.Scene.from_heights(axis, axis, 0.1 * np.sin(axis) * np.cos(axis[:, None]), material=ROUGH)


HOUSE, POLE = (4.0, 5.0, 3.0), (0.02, 0.02, 3.0)
SCENES = {
    "house": lambda: field() + box(HOUSE, (0, 0)),
    "poles": lambda: (
        field() + box((0.02, 0.02, 3), (1, 2)) + box((0.02, 0.02, 3), (-3, 1)) + box((0.05, 0.05, 3), (2, -4))
    ),
    "hills": lambda: hills() + box(HOUSE, (0, 0)),
    "gentle hills": lambda: gentle() + box(HOUSE, (0, 0)),
}


def circle(radius=7e3, height=5e3, start=0.3, arc=0.03):
    return sarcl.Trajectory.circle(radius=radius, height=height, start=start, arc=arc, n_pulses=PULSES)


TRACKS = {
    "arc": (circle(), None),
    "wide": (circle(arc=0.6), None),
    "bistatic": (circle(), circle(start=1.0)),
    "near": (circle(25.0, 18.0), None),
}


def echo(scene, track, few, tolerance, most=None, **options):
    tx, receiver = track
    window = {"range_window": (-15, 15), "reference": scene.center}
    options |= {"receiver": receiver, "tolerance": tolerance, "seed": 3, **window}
    limits = {"few_looks": few, "most_looks": few if most is None else most}
    return planned_within(limits, sarcl.echo, scene, CHIRP, tx, **options).run()


@pytest.mark.parametrize("name, track", thinned(SCENES, TRACKS))
def test_sampled_shadows_meet_the_tolerance(name, track):
    scene = SCENES[name]()
    wanted = echo(scene, TRACKS[track], np.inf, 3e-4)
    assert "shadow edges" not in wanted.report.plan
    for tolerance in (1e-1, 1e-2):
        raw = echo(scene, TRACKS[track], 0, tolerance)
        assert raw.report.plan["shadow edges"].startswith("sampled, ")
        error = np.linalg.norm(raw.samples - wanted.samples) / np.linalg.norm(wanted.samples)
        assert 0 < error <= raw.report.predicted_error <= tolerance


@pytest.mark.parametrize("name", ["hills", "gentle hills"])
def test_facets_edge_on_to_one_of_two_antennas_and_slivers_that_both_see(name):
    """Some hills turn edge-on to the transmitter; ground under the house is lit in strips by both antennas."""
    scene = SCENES[name]()
    wanted, raw = (echo(scene, TRACKS["bistatic"], few, tolerance) for few, tolerance in ((np.inf, 1e-4), (0, 1e-3)))
    error = np.linalg.norm(raw.samples - wanted.samples, axis=1) / np.linalg.norm(wanted.samples, axis=1)
    assert error.max() <= 0.9e-3  # at every pulse


def plate_behind(screen, n, length):
    """A rough plate of 1 m, and a screen between it and a line that sends nothing back, m (y from, to, z from, to)."""
    left, right, low, high = screen
    corners = np.array([[6, left, low], [6, right, low], [6, right, high], [6, left, high]], float)
    screen = sarcl.Scene.facets(corners[[[0, 1, 2], [0, 2, 3]]], material=ROUGH, reflectivity=0.0)
    plate = sarcl.Scene.facets(sarcl.shapes.plate((1, 1)).triangles, material=ROUGH)
    start, speed = (6e3, -length / 2, 5e3), length * 100 / max(n - 1, 1)
    return plate + screen, (sarcl.Trajectory.line(start=start, velocity=(0, speed, 0), prf=100, n_pulses=n), None)


@pytest.mark.parametrize(
    "screen, length, n",
    thinned([((-0.7, 0.7, 0, 12), 4e3), ((0.55, 1.05, 0, 12), 2e4), ((-3.6, -0.2, -0.1, 9), 6e3)], [9, 33, 129]),
)
def test_one_facet_and_one_screen(screen, length, n):
    """Wholly dark half-way; dark between looks far apart; partly lit there alone: errors of up to a half before."""
    scene, track = plate_behind(screen, n, length)
    wanted = echo(scene, track, np.inf, 1e-3)
    raw = echo(scene, track, 0, 1e-2)
    error = np.linalg.norm(raw.samples - wanted.samples) / np.linalg.norm(wanted.samples)
    assert error <= raw.report.predicted_error + 1e-3


def terms_of(report):
    terms = {term.name: term.value for term in report.error_terms}
    assert np.sqrt(sum(value**2 for value in terms.values())) == pytest.approx(report.predicted_error, rel=1e-12)
    assert min(terms.values()) > 0 and all(term.remedy for term in report.error_terms)
    return terms


def test_terms_of_the_error_name_shadows(tmp_path):
    scene = SCENES["house"]() + sarcl.Scene.points([[0, 0, 9.0]], [1e-6])
    raw = echo(scene, TRACKS["arc"], 0, 1e-2)
    terms = terms_of(raw.report)
    assert set(terms) == {"points", "facets", "shadow edges", "motion of shadows"}
    assert f"shadow edges {terms['shadow edges']:.1e}, motion of shadows" in str(raw.report)
    raw.save(tmp_path / "raw.h5")
    assert sarcl.read(tmp_path / "raw.h5").report.error_terms == raw.report.error_terms
    assert pickle.loads(pickle.dumps(raw.report)).error_terms == raw.report.error_terms
    assert set(terms_of(echo(scene, TRACKS["arc"], np.inf, 1e-2).report)) == {"points", "facets"}
    raw = spectral(SCENES["house"](), 1e-2)  # facets that are transformed, and others
    assert set(terms_of(raw.report)) == {"facets", "shadow edges", "motion of shadows"}
    assert raw.report.predicted_error <= 1e-2
    assert not sarcl.Report().error_terms


@pytest.mark.parametrize("few", [0, np.inf])
def test_progress_tells_which_pulses_are_done(few):
    said = []
    echo(SCENES["house"](), TRACKS["wide"], few, 1e-1, progress=lambda *a: said.append(a))
    shadows = [done for stage, done, total in said if stage == "shadows" and total == PULSES]
    assert len(shadows) > (few == 0) and shadows == sorted(shadows) and shadows[-1] == PULSES
    stages = [stage for stage, *_ in said]
    assert stages.index("shadows") > stages.index("scene") and said[-1][0] == "echo"


def test_more_lines_of_samples_and_pulses_are_taken_for_a_smaller_tolerance():
    scene, track = SCENES["house"](), TRACKS["arc"]
    wanted, raw = (echo(scene, track, few, 1e-3) for few in (np.inf, 0))
    error = np.linalg.norm(raw.samples - wanted.samples) / np.linalg.norm(wanted.samples)
    assert error <= 1.7e-3  # those of both


def test_a_tolerance_that_samples_cannot_meet_is_refused_with_the_best():
    scene, track = SCENES["hills"](), TRACKS["bistatic"]
    with pytest.raises(sarcl.ToleranceUnreachable, match="shadow edges on rough facets") as refused:
        echo(scene, track, 0, 3e-5, max_edge=1.0)
    best = refused.value.best
    assert best == float(f"{best:.1e}")  # two digits: it can be typed as it is printed
    assert echo(scene, track, 0, best, max_edge=1.0).report.predicted_error <= best


def test_lit_parts_are_computed_where_samples_do_not_meet_a_tolerance():
    scene, track = SCENES["hills"](), TRACKS["bistatic"]
    raw, wanted = (echo(scene, track, few, 3e-5, most=np.inf, max_edge=1.0) for few in (0, np.inf))
    assert np.array_equal(raw.samples, wanted.samples)
    assert "shadow edges" not in raw.report.plan and raw.report.predicted_error <= 3e-5


def test_little_memory_for_shares_changes_nothing():
    scene, track = SCENES["house"](), TRACKS["wide"]
    much, little = (echo(scene, track, 0, 1e-2, max_bytes=size) for size in (1e9, 2e7))
    assert np.linalg.norm(much.samples - little.samples) <= 1e-6 * np.linalg.norm(much.samples)


def test_levels_change_from_pulse_to_pulse_between_viewpoints():
    """The check adds the levels of each pulse: they are not the steps of viewpoints, of which there are fewer."""
    scene, track = SCENES["house"](), sarcl.Trajectory.circle(radius=7e3, height=5e3, start=0.3, arc=0.03, n_pulses=200)
    report = echo(scene, (track, None), 0, 1e-2, check=True).report
    assert 0 < report.measured_error < 0.3 * report.predicted_error


LINE = sarcl.Trajectory.line(start=(6e3, -30, 5e3), velocity=(0, 100, 0), prf=100.0, n_pulses=60)


def spectral(scene, tolerance, **options):
    window = {"range_window": (-15, 15), "reference": scene.center}
    options |= {"tolerance": tolerance, "seed": 3, **window}
    return planned_within({"few_looks": 0}, sarcl.spectral_echo, scene, CHIRP, LINE, **options).run()


@pytest.mark.parametrize("name", quick_of(["poles", "hills"], SCENES))
def test_spectral_echoes_with_sampled_shadows_meet_the_tolerance(name):
    scene = SCENES[name]()
    wanted = echo(scene, (LINE, None), np.inf, 3e-4)
    for tolerance in (1e-1, 1e-2):
        raw = spectral(scene, tolerance)
        assert raw.report.plan["shadow edges"].startswith("sampled, ")
        error = np.linalg.norm(raw.samples - wanted.samples) / np.linalg.norm(wanted.samples)
        assert 0 < error <= raw.report.predicted_error <= tolerance


def test_the_variant_saras_says_that_sampled_shadows_are_not_part_of_the_error():
    raw = spectral(SCENES["house"](), 0.3, variant="saras")
    assert raw.report.plan["shadow edges"] == "sampled, not part of the error"
