"""sarcl.plan, for every verb: its forecast carries out the very plan that it forecasts, with the verb's bits."""

from __future__ import annotations

import os
import time
import tracemalloc
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from helpers.cases import noise_on, straight

import sarcl
from sarcl import verbs
from sarcl.base.options import described
from sarcl.base.report import root_sum_square

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=100e6, duration=1e-6)
LOW = sarcl.Waveform.chirp(center=1.25e9, bandwidth=500e6, duration=2e-8)
TRACK = sarcl.Trajectory.line(start=(0, -8, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=16)
FLIGHT = sarcl.Trajectory.line(start=(0, -60, 6e3), velocity=(0, 100, 0), prf=250, n_pulses=300)
CLOUD = np.random.default_rng(0).uniform(-5, 5, (40, 3))  # m, about the origin
GRID = sarcl.ImageGrid.plane(shape=(24, 20), spacing=0.3)


@dataclass(frozen=True)
class Case:
    """A call of a verb: its subjects, and options without which it would take long."""

    subjects: dict[str, Any]
    options: dict[str, Any]

    def planned(self, name: str, **more: Any) -> sarcl.Forecast:
        return sarcl.plan(getattr(sarcl, name), **self.subjects, **self.options, **more)

    def result(self, name: str, **more: Any) -> Any:
        return getattr(sarcl, name)(**self.subjects, **self.options, **more)


def noise():
    """Echoes of a straight flight, with times."""
    return noise_on(straight(120), n_samples=80, bandwidth=150e6, time=np.linspace(0, 0.6, 120))


def case(name: str) -> Case:
    """A small case of a verb."""
    if name in ("echo", "spectral_echo"):
        distance, track = (1e3, TRACK) if name == "echo" else (8e3, FLIGHT)
        return Case(
            {"scene": sarcl.Scene.points(CLOUD + np.array([distance, 0, 0])), "waveform": CHIRP, "track": track}, {}
        )
    if name == "fullwave_echo":
        box = {"scene": sarcl.shapes.box((0.1, 0.12, 0.08)), "waveform": LOW}
        seen = sarcl.Trajectory(None, [(40.0, 0, 9), (0, 40.0, 9)])
        return Case({**box, "track": seen}, {"cells": 10, "model_error": False})
    return Case({"raw": noise()} | ({} if name == "range_doppler" else {"grid": GRID}), {})


FOCUSING = [name for name in verbs.HOMES if "scene" not in case(name).subjects]
MEASURED_PLAN = ("run_seconds",)  # of report.plan: how long a run of the grid took
ESTIMATED_BY_RUN = ("fullwave_echo",)  # its forecast has the error that is allowed, its report the one that runs show


@pytest.fixture(params=verbs.HOMES)
def name(request):
    return request.param


def bits(result: Any) -> list[bytes]:
    """Data of an image, with its gain, or samples and geometry of echoes."""
    if isinstance(result, sarcl.Image):
        return [np.asarray(result.data).tobytes(), np.asarray(result.gain).tobytes()]
    rows = (result.samples, result.frequency, result.frequency_step, result.reference_range, result.tx, result.rx)
    return [np.asarray(values[:]).tobytes() for values in rows]


def choices(result: Any) -> dict[str, Any]:
    """What the plan of a result has decided."""
    return {key: value for key, value in result.report.plan.items() if key not in MEASURED_PLAN}


def test_a_run_of_the_forecast_is_the_verb_bit_by_bit_and_may_be_repeated(name):
    forecast = case(name).planned(name, check=False)
    wanted = case(name).result(name, check=False)
    for result in (forecast.run(), forecast.run()):
        assert bits(result) == bits(wanted)
        assert choices(result) == choices(wanted)


def test_a_run_plans_nothing_and_its_seconds_are_its_own(name, monkeypatch):
    """report.seconds: those of planning, and those of this run alone."""
    forecast = case(name).planned(name, check=False)
    monkeypatch.setattr(getattr(verbs, name), "planned", None)
    assert 0 <= forecast.planning <= forecast.seconds
    for _ in range(2):
        start = time.perf_counter()
        seconds = forecast.run().report.seconds
        assert forecast.planning < sum(seconds.values()) <= forecast.planning + time.perf_counter() - start + 1e-6


def test_the_predicted_error_is_the_root_of_the_sum_of_the_squares_of_its_terms(name):
    forecast = case(name).planned(name, check=False)
    report = forecast.run().report
    assert forecast.error_terms and forecast.predicted_error > 0
    assert forecast.predicted_error == pytest.approx(root_sum_square(forecast.error_terms), rel=1e-12)
    assert report.predicted_error == pytest.approx(root_sum_square(report.error_terms), rel=1e-12)
    if name in ESTIMATED_BY_RUN:
        assert [term.name for term in report.error_terms] == [term.name for term in forecast.error_terms]
        assert report.predicted_error <= forecast.predicted_error
    else:
        assert report.predicted_error == forecast.predicted_error and report.error_terms == forecast.error_terms
    assert report.predicted_error <= report.tolerance
    assert all(term.name and term.remedy and term.value > 0 for term in report.error_terms)


def test_size_and_method_are_those_of_the_result(name):
    forecast = case(name).planned(name, check=False)
    result = forecast.run()
    if name in FOCUSING:
        assert (forecast.n_rows, forecast.n_samples) == (None, None)
        assert forecast.bytes >= np.asarray(result.data).nbytes
    else:
        assert (forecast.n_rows, forecast.n_samples) == (result.n_rows, result.n_samples)
        assert forecast.bytes >= np.asarray(result.samples[:]).nbytes
    assert forecast.method in str(forecast) and 0 < forecast.seconds < 60


def test_options_of_the_run_alone_are_taken_and_wait_for_it(name, tmp_path):
    calls, record = [], described(getattr(verbs, name).options)
    runs = {"check": True, "progress": lambda *stage: calls.append(stage)}
    path = tmp_path / "result.h5"
    runs |= {"out": path} if "out" in record else {}
    forecast = case(name).planned(name, **runs)
    assert not calls and not list(tmp_path.iterdir())
    result = forecast.run()
    assert calls and result.report.measured_error is not None
    assert list(tmp_path.glob("*.h5")) == ([path] if "out" in record else [])


@pytest.mark.parametrize("name", FOCUSING)
@pytest.mark.parametrize("by_name", [True, False], ids=["by name", "by position"])
def test_a_file_that_has_changed_since_the_plan_is_refused(name, by_name, tmp_path):
    path = tmp_path / "raw.h5"
    noise().save(path)
    subjects = {**case(name).subjects, "raw": sarcl.read(path)}
    given = ((), subjects) if by_name else (tuple(subjects.values()), {})
    forecast = sarcl.plan(getattr(sarcl, name), *given[0], **given[1], check=False)
    assert bits(forecast.run()) == bits(case(name).result(name, check=False))
    state = path.stat()
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns + 10**9))
    with pytest.raises(ValueError, match=r"raw\.h5.* has changed since the plan was made from it"):
        forecast.run()


@pytest.mark.parametrize("name", FOCUSING)
def test_a_file_that_is_gone_is_refused(name, tmp_path):
    path = tmp_path / "raw.h5"
    noise().save(path)
    forecast = sarcl.plan(getattr(sarcl, name), **{**case(name).subjects, "raw": sarcl.read(path)}, check=False)
    path.unlink()
    with pytest.raises(ValueError, match="has changed"):
        forecast.run()


@pytest.mark.parametrize("thing", [sarcl.compress, sarcl.ImageGrid, print, None, "echo"])
def test_what_is_no_verb_is_refused(thing):
    with pytest.raises(TypeError, match=r"which is no verb; give one of echo, .*backproject"):
        sarcl.plan(thing, noise(), GRID)


@pytest.mark.parametrize("verb", [sarcl.polar_format, sarcl.range_doppler], ids=lambda verb: verb.__name__)
def test_an_output_that_is_no_path_is_named_before_the_work(verb):
    with pytest.raises(TypeError, match=r"out is a int; give the name of a file"):
        sarcl.plan(verb, noise(), *([GRID] if verb is sarcl.polar_format else []), out=3)


def test_subjects_that_are_missing_are_named():
    for call in (lambda: sarcl.plan(), lambda: sarcl.plan(sarcl.backproject), lambda: sarcl.plan(noise())):
        with pytest.raises(TypeError, match=r"backproject.* missing .*'grid'"):
            call()


def test_without_a_verb_backproject_is_planned():
    short, whole = sarcl.plan(noise(), GRID, check=False), sarcl.plan(sarcl.backproject, noise(), GRID, check=False)
    by_name = sarcl.plan(grid=GRID, raw=noise(), check=False)
    assert short.plan == whole.plan == by_name.plan and short.error_terms == whole.error_terms == by_name.error_terms
    assert bits(short.run()) == bits(whole.run()) == bits(by_name.run())


@pytest.mark.parametrize("name", FOCUSING)
def test_a_plan_refers_to_its_echoes_and_copies_none(name):
    track = straight(2000)
    raw = noise_on(track, n_samples=500, bandwidth=150e6, time=np.linspace(0, 10, len(track)))
    subjects = {**case(name).subjects, "raw": raw}
    sarcl.plan(getattr(sarcl, name), **subjects)  # fills caches
    tracemalloc.start()
    forecast = sarcl.plan(getattr(sarcl, name), **subjects)
    more = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert more < raw.samples.nbytes / 4 and forecast.seconds > 0
