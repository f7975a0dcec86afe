"""A forecast is that of the plan of the whole track, and its run is that of the verb."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from helpers.array_cases import TONE, line, passing
from helpers.cases import planned_within

import sarcl
from sarcl.base.errors import NothingSeen
from sarcl.base.report import root_sum_square
from sarcl.simulation import scene_plan, scene_preparation
from sarcl.simulation.bounces import bounce_spreader
from sarcl.simulation.edges import edge_echoes

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=1e-6)
TRACK = sarcl.Trajectory.circle(radius=800.0, height=600.0, arc=0.02, n_pulses=48, prf=100.0)


def points(n=400):
    random = np.random.default_rng(0)
    return sarcl.Scene.points(random.uniform(-9, 9, (n, 3)), random.normal(size=n) + 1j * random.normal(size=n))


def box():
    return sarcl.shapes.box((2.0, 1.5, 1.0))


def rough():
    return sarcl.shapes.plate((12.0, 12.0), roughness=0.02)


SCENES = {"points": points, "box": box, "rough": rough, "all": lambda: box() + rough() + points()}
CALLS = {name: (make, CHIRP, TRACK, {"tolerance": 2e-2}) for name, make in SCENES.items()}
CALLS["array"] = points, TONE, passing(32), {"array": line(5), "receive": "all", "tolerance": 1e-2}
CALLS["array apart"] = points, TONE, passing(32), CALLS["array"][3] | {"channels": "separated"}


@pytest.fixture(params=CALLS)
def call(request):
    make, waveform, track, options = CALLS[request.param]
    return (make(), waveform, track), options


PREPARED = {"prepared_seconds": np.inf}  # forecasts prepare every scene
UNPREPARED = {"prepared_seconds": 0.0, "prepared_share": 0.0}  # forecasts prepare no scene


def forecast(limits, *subjects, **options):
    return planned_within(limits, sarcl.echo, *subjects, **options).forecast()


def same(raw, other):
    return np.array_equal(raw.samples, other.samples) and raw.report.plan == other.report.plan


def test_errors_of_a_prepared_scene_are_those_of_the_run(call):
    subjects, options = call
    told, raw = forecast(PREPARED, *subjects, **options), sarcl.echo(*subjects, **options)
    assert told.predicted_error == raw.report.predicted_error and told.error_terms == raw.report.error_terms
    assert (told.n_rows, told.n_samples) == raw.samples.shape and told.seconds > told.planning > 0
    assert {name: told.plan[name] for name in raw.report.plan} == raw.report.plan


def test_errors_of_a_scene_that_is_not_prepared_are_bounds(call):
    subjects, options = call
    told, raw = forecast(UNPREPARED, *subjects, **options), sarcl.echo(*subjects, **options)
    assert raw.report.predicted_error <= told.predicted_error <= options["tolerance"] * (1 + 1e-12)
    assert told.predicted_error == root_sum_square(told.error_terms)
    assert told.seconds > 0 and told.plan["method"] == raw.report.plan["method"]
    assert same(told.run(), raw)


@pytest.mark.parametrize(
    "n, n_pulses, method", [(100_000, 300, "factorized"), (100_000, 8, "spread"), (500, 300, "spread")]
)
def test_the_method_of_points_is_known_before_they_are_prepared(device, n, n_pulses, method):
    track = sarcl.Trajectory.line(start=(-7e3, -50.0, 7e3), velocity=(0, 100.0, 0), prf=50.0, n_pulses=n_pulses)
    subjects, options = (points(n), CHIRP, track), {"tolerance": 1e-2, "check": False, "device": device}
    told = forecast(UNPREPARED, *subjects, **options)
    assert told.plan["method"] == (method if device.is_cpu else "spread")
    assert told.run().report.plan["method"] == told.plan["method"]
    assert forecast(UNPREPARED, *subjects, **options, method="direct").method == "pulse by pulse"


def test_the_method_of_many_facets_is_chosen_when_they_are_cut():
    track = sarcl.Trajectory.circle(radius=800.0, height=600.0, arc=0.02, n_pulses=600)
    ground = sarcl.shapes.plate((60.0, 60.0), material=sarcl.Material(diagram="cos"))
    told = forecast(UNPREPARED, ground, CHIRP, track, tolerance=1e-2, shadows=False)
    assert told.method == "pulse by pulse or factorized"


def test_the_shares_of_shadows_that_are_sampled_bound_their_errors():
    ground = sarcl.shapes.plate((12.0, 12.0), material=sarcl.Material(diagram="cos"))
    subjects, options = (box().moved((0, 0, 0.6)) + ground + points(), CHIRP, TRACK), {"tolerance": 5e-2}
    plan = planned_within(UNPREPARED | {"few_looks": 0.0}, sarcl.echo, *subjects, **options)
    told, raw = plan.forecast(), plan.run()
    assert [term.name for term in told.error_terms] == ["points", "facets", "shadows"]
    named = {term.name: term.value for term in raw.report.error_terms}
    shadows = np.hypot(named["shadow edges"], named["motion of shadows"])
    for term, value in zip(told.error_terms, (named["points"], named["facets"], shadows), strict=True):
        assert value <= term.value
    allotted = [term.value / options["tolerance"] for term in told.error_terms]
    # shadows are of facets alone; what they leave is divided among points and facets
    assert allotted == pytest.approx([0.6 / np.sqrt(2), 0.6 / np.sqrt(2), 0.8], rel=1e-6)
    assert told.predicted_error == pytest.approx(options["tolerance"], rel=1e-12)
    assert raw.report.predicted_error <= options["tolerance"]


def test_a_run_does_not_plan_again_and_may_be_repeated(call, monkeypatch):
    subjects, options = call
    raw, told = sarcl.echo(*subjects, **options), forecast(PREPARED, *subjects, **options)
    monkeypatch.setattr(scene_plan, "share_of", lambda *given, **more: pytest.fail("planned again"))
    for name in ("points_of", "facets_of"):
        monkeypatch.setattr(scene_preparation, name, lambda *given, **more: pytest.fail("prepared again"))
    first = told.run()
    assert same(first, raw) and same(told.run(), raw)
    seconds = first.report.seconds
    assert seconds["plan"] + seconds["scene"] >= told.planning > 0 and seconds["echo"] > 0


def test_progress_is_that_of_the_run_alone():
    stages = []
    told = forecast(PREPARED, points(), CHIRP, TRACK, progress=lambda stage, done, total: stages.append(stage))
    assert stages == []
    told.run()
    assert "echo" in stages


@pytest.mark.parametrize("name", ["points", "box", "rough"])
def test_pieces_are_counted_to_a_factor_of_two(name):
    plan = sarcl.echo.planned(SCENES[name](), CHIRP, TRACK, tolerance=1e-2)
    planned, prepared = plan.plan_scene(plan.task.request).with_scene()
    n = 0 if prepared.subdivision is None else prepared.subdivision.plan.n_facets
    assert n / 2 <= sum(planned.scene.n_pieces()) <= 2 * n


def test_a_scene_outside_the_range_window_is_refused():
    with pytest.raises(NothingSeen, match="outside the range window"):
        forecast(UNPREPARED, points(), CHIRP, TRACK, range_window=(100, 120))


def test_a_forecast_of_spectral_echo_is_that_of_its_run(monkeypatch):
    track = sarcl.Trajectory.line(start=(-3e3, -20, 2e3), velocity=(0, 100, 0), prf=400.0, n_pulses=160)
    for scene in (points(), box()):
        raw = sarcl.spectral_echo(scene, CHIRP, track)
        told = sarcl.plan(sarcl.spectral_echo, scene, CHIRP, track)
        assert told.method == "Fourier transforms" and (told.n_rows, told.n_samples) == raw.samples.shape
        assert told.predicted_error == raw.report.predicted_error and told.error_terms == raw.report.error_terms
        assert told.plan["contributions"] == raw.report.contributions_done
        with monkeypatch.context() as patched:
            patched.setattr(scene_plan, "share_of", lambda *given: pytest.fail("planned again"))
            assert same(told.run(), raw) and same(told.run(), raw)


def test_a_forecast_times_other_pulses_only_where_nothing_is_seen(monkeypatch):
    plan = sarcl.echo.planned(points(), CHIRP, TRACK)
    kind = type(plan.plan_scene(plan.task.request).method)
    tried, fill = [], kind.fill

    def unseen(method, scene, samples, start, done, total):
        tried.append(start)
        added = fill(method, scene, samples, start, done, total)
        return replace(added, counts=replace(added.counts, outside_window=added.counts.pairs))

    sarcl.plan(sarcl.echo, points(), CHIRP, TRACK)
    monkeypatch.setattr(kind, "fill", unseen)
    assert sarcl.plan(sarcl.echo, points(), CHIRP, TRACK).plan["contributions"] == 0
    assert len(set(tried)) == 3


@pytest.mark.parametrize("options", [{"bounces": 4}, {"edges": True}])
def test_a_scene_that_is_not_prepared_has_the_seconds_of_reflections_and_edges(options, monkeypatch):
    """By a clock of contributions: it stands still but for these, whose pairs it counts."""
    room = sarcl.shapes.plate((3, 3)) + sarcl.shapes.plate((3, 3), position=(0, 1.5, 1.5), rotation=(np.pi / 2, 0, 0))
    kind = bounce_spreader.BounceSpreader if "bounces" in options else edge_echoes.EdgeEchoes
    clock, added = [0.0], kind.add

    def add(self, samples, pulses, *others):
        clock[0] += 2.0 + 0.5 * len(pulses)
        return added(self, samples, pulses, *others)

    monkeypatch.setattr(kind, "add", add)
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    one, more = (forecast(UNPREPARED, room, CHIRP, TRACK, tolerance=0.1, **o) for o in ({}, options))
    assert more.seconds - one.seconds == pytest.approx(0.5 * len(TRACK) + 2.0, abs=1.0)


def test_what_a_call_costs_whatever_its_pulses_is_forecast_once_per_call(monkeypatch):
    """Plans of 30 channels took 0.07 s for 1 pulse and for 32: counted per pulse, forecasts were 19 times the run.

    By a clock of contributions, on which a call of 5 s has pulses of 0.5 s each; the run needs one call.
    """
    subjects, options = (points(), TONE, passing(32)), {"array": line(5), "channels": "separated", "tolerance": 1e-2}
    plan = sarcl.echo.planned(*subjects, **options)
    kind, clock = type(plan.plan_scene(plan.task.request).method), [0.0]
    fill = kind.fill

    def timed(method, scene, samples, *others):
        clock[0] += 5.0 + 0.5 * len(samples)
        return fill(method, scene, samples, *others)

    monkeypatch.setattr(kind, "fill", timed)
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    told = forecast(PREPARED, *subjects, **options)
    assert told.seconds - told.planning == pytest.approx(5.0 + 0.5 * 32, rel=1e-3)
