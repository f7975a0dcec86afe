"""bounces= of the verbs: what it takes and refuses, and what a report says of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import sarcl
from sarcl.base.errors import NotApplicable, NothingSeen
from sarcl.simulation.echo_check import worth_checking

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=50e6, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(1e3, 998, 1e3), velocity=(0, 1, 0), prf=1.0, n_pulses=4)
CORNER = np.array(
    [[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 0, 0), (0, 0, 1), (1, 0, 0)]], float
)
ANGLES = np.linspace(-0.5, 0.5, 5)
SCENE = sarcl.Scene.facets(CORNER)


def echo(scene: sarcl.Scene = SCENE, **options: object) -> sarcl.PhaseHistory:
    return sarcl.echo(scene, CHIRP, TRACK, **({"bounces": 3, "tolerance": 1e-2, "check": False} | options))


@pytest.mark.parametrize("bounces", [0, 9, -1])
def test_other_numbers_of_reflections_are_refused(bounces):
    with pytest.raises(ValueError, match="bounces"):
        echo(bounces=bounces)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"shadows": False}, "shadows=True"),
        ({"antenna": sarcl.Antenna.rectangular(size=(0.1, 0.1), two_way=True)}, "without two_way=True"),
        ({"antenna": sarcl.Antenna.table(ANGLES, ANGLES, 1j * np.ones((5, 5)), two_way=True)}, "complex somewhere"),
    ],
)
def test_what_does_not_go_with_several_reflections_is_refused_by_name(options, text):
    with pytest.raises(ValueError, match=rf"bounces is 3.*{text}"):
        echo(**options)


def test_spectral_echo_and_fullwave_echo_refuse_bounces():
    with pytest.raises(NotApplicable, match=r"bounces is 2.*echo"):
        sarcl.spectral_echo(SCENE, CHIRP, TRACK, bounces=2)
    for verb, name, value, reason in (
        (sarcl.fullwave_echo, "bounces", 2, "Maxwell's equations hold all reflections"),
        (sarcl.fullwave_echo, "edges", True, "leave it out"),
        (sarcl.fullwave_echo, "forward", True, "leave it out"),
        (sarcl.spectral_echo, "edges", True, "use echo"),
        (sarcl.spectral_echo, "forward", True, "use echo with a receiver"),
    ):
        with pytest.raises(TypeError, match=f"{verb.__name__} has no option '{name}': .*{reason}"):
            verb(SCENE, CHIRP, TRACK, **{name: value})


def test_a_report_counts_contributions_by_reflections_and_has_their_error():
    report = echo().report
    assert "up to 3 reflections" in str(report.plan["model"])
    counts = dict(part.split(": ") for part in str(report.plan["contributions by reflections"]).split(", "))
    assert list(counts) == ["1", "2", "3"]
    assert int(counts["2"]) == int(counts["3"]) == 6 * len(TRACK)  # every order of the three plates
    assert report.contributions_done == sum(map(int, counts.values()))
    assert report.contributions_skipped["no reflection from facet to facet"] >= 0
    assert "bounces" in {term.name for term in report.error_terms}
    assert "contributions by reflections" not in echo(bounces=1).report.plan


def test_a_forecast_has_the_error_and_samples_of_the_run():
    forecast = sarcl.plan(sarcl.echo, SCENE, CHIRP, TRACK, bounces=3, tolerance=1e-2)
    raw = forecast.run()
    assert raw.report.predicted_error <= forecast.predicted_error * (1 + 1e-9)
    assert np.array_equal(raw.samples, echo().samples)


def test_blocks_and_pieces_of_the_track_have_the_same_samples():
    raw = echo()
    single = [
        sarcl.echo(
            SCENE, CHIRP, sarcl.Trajectory(None, TRACK.positions[[p]]), bounces=3, tolerance=1e-2, check=False,
            reference=(0.5, 0.5, 0.5), range_window=(-5, 5),
        ).samples[0]
        for p in range(len(TRACK))
    ]  # fmt: skip
    whole = echo(reference=(0.5, 0.5, 0.5), range_window=(-5, 5)).samples
    assert np.abs(whole - np.array(single)).max() <= 2e-3 * np.abs(whole).max()
    assert np.isfinite(raw.samples).all()


def test_echoes_outside_the_range_window_are_left_out_and_counted():
    far = np.array([[(0, 0, 0), (30, 0, 0), (0, 30, 0)], [(0, 0, 0), (0, 30, 0), (0, 0, 30)]], float)
    scene = sarcl.Scene.facets(far)
    whole, part = (echo(scene, bounces=2, reference=(30, 30, 0), range_window=(-w, w)) for w in (60, 20))
    assert whole.report.contributions_skipped["range window"] == 0
    assert part.report.contributions_skipped["range window"] > 0


def test_echoes_later_than_the_default_window_are_warned_of_with_their_power():
    """A plate that the radar sees at right angles in the ground: its image lies 10 m below, behind all of the scene."""
    wave = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=1e-6)
    plate = sarcl.shapes.plate((1, 1), position=(-10, 0, 10), rotation=(0, -np.pi / 4, 0))
    scene = plate + sarcl.shapes.plate((6, 6))
    track = sarcl.Trajectory(None, np.array([[1e3, 0, 1e3]]))
    options = {"bounces": 3, "tolerance": 1e-2, "check": False}
    with pytest.warns(sarcl.SarclWarning, match=r"outside the range window, with .* % of the power") as caught:
        short = sarcl.echo(scene, wave, track, **options)
    far = float(str(caught[0].message).split(", ")[-1].rstrip(")"))
    long = sarcl.echo(scene, wave, track, range_window=(-far, far), **options)  # no warning
    behind = (np.array([10, 0, 10]) + scene.center) @ [1, 0, 1] / np.sqrt(2)
    assert far == pytest.approx(1.05 * behind, abs=1.5)
    words = str(short.report.plan["late echoes outside the range window"])
    total, within = (np.mean(np.abs(raw.samples) ** 2) for raw in (long, short))
    assert float(words.split(" %")[0]) / 100 == pytest.approx(1 - within / total, rel=0.1)
    assert "late echoes outside the range window" not in long.report.plan


def test_facets_without_coherent_part_shade_and_do_not_reflect_to_others():
    diffuse = sarcl.Scene.facets(CORNER, material=[0, 1, 1], materials=["metal", sarcl.Material(diagram="isotropic")])
    one, three = (echo(diffuse, bounces=n).samples for n in (1, 3))
    assert np.linalg.norm(three - one) <= 2e-2 * np.linalg.norm(one)


def test_gains_are_those_of_the_ways_out_and_back():
    """A wide beam on the corner weighs all ways alike; a radar's amplitudes fall with both lengths of the way."""
    aimed = sarcl.pointing.spotlight(TRACK, (0.3, 0.3, 0.3))
    antenna, radar = sarcl.Antenna.gaussian(width=(0.5, 0.5)), sarcl.Radar(power=1.0)
    plain = echo().samples
    options = {"bounces": 3, "tolerance": 1e-3, "check": False}
    weighted = sarcl.echo(SCENE, CHIRP, aimed, antenna=antenna, **options).samples
    assert np.linalg.norm(weighted - plain) < 1e-2 * np.linalg.norm(plain)
    several, single = (
        sarcl.echo(SCENE, CHIRP, aimed, antenna=antenna, radar=radar, **(options | {"bounces": n})).samples
        for n in (3, 1)
    )
    one = echo(bounces=1, tolerance=1e-3).samples
    ratio = np.vdot(plain - one, several - single) / np.vdot(plain - one, plain - one)
    distance = np.linalg.norm(TRACK.positions - 0.0, axis=1).mean()
    factor = radar.factor(np.array([9.6e9]))[0] / distance**2
    assert np.isclose(ratio, factor, rtol=2e-2)


def test_sums_by_range_profiles_are_those_at_single_frequencies():
    small = sarcl.Scene.facets(0.3 * CORNER)
    raw = echo(small, range_window=(-100, 100), tolerance=1e-3, check=True)
    assert raw.n_samples > 60  # far more than nodes over the band
    assert raw.report.measured_error is not None
    assert raw.report.measured_error <= raw.report.predicted_error


@pytest.mark.parametrize("part", [None, "bounced", "edges", "behind_sheets"])
def test_several_reflections_edges_and_sheets_are_checked_only_where_that_is_asked_for(part):
    """However long the echoes took: the exact sums of these take minutes or hours."""
    request = SimpleNamespace(clock=SimpleNamespace(seconds={"echo": 1e4}), limits=SimpleNamespace(checked_facets=100))
    parts = dict.fromkeys(("points", "bounced", "edges", "behind_sheets"))
    weights = SimpleNamespace(varies_over_band=False)
    scene = SimpleNamespace(request=request, facets=(), weights=weights, **(parts | ({part: "some"} if part else {})))
    assert worth_checking(scene, None) == (part is None)
    assert worth_checking(scene, True) and not worth_checking(scene, False)


def test_weak_reflections_are_left_out_and_counted():
    rough = sarcl.Material(3.0, height=0.025)
    scene = sarcl.Scene.facets(CORNER, material=[0, 0, 1], materials=["metal", rough])
    coarse, fine, two = (echo(scene, bounces=n, tolerance=t) for n, t in ((3, 1e-2), (3, 1e-5), (2, 1e-2)))
    # the third reflection alone is weak: where the rough plate comes before the last one
    assert coarse.report.contributions_skipped["weak reflections"] == 4 * len(TRACK)
    assert fine.report.contributions_skipped["weak reflections"] == 0
    assert two.report.contributions_skipped["weak reflections"] == 0
    assert np.linalg.norm(coarse.samples - fine.samples) <= 1e-2 * np.linalg.norm(fine.samples)


def test_facets_that_all_face_away_are_named_as_such():
    away = sarcl.Scene.facets(CORNER[:, ::-1], two_sided=False)
    with pytest.raises(NothingSeen, match="away"):
        echo(away)
