"""Verbs: made of the function that plans them, with the options of a record; and their forecasts."""

from __future__ import annotations

import inspect
import pickle
import pydoc
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from sarcl.base import text
from sarcl.base import verb as verbs
from sarcl.base.forecast import Forecast, Plan
from sarcl.base.options import Options, described, option
from sarcl.base.report import ErrorTerm
from sarcl.base.stage_timer import Clock
from sarcl.base.verb import listed, result_of, verb


def positive(name: str, value: Any) -> float:
    if not value > 0:
        raise ValueError(f"{name} is {value!r}; wanted more than 0")
    return float(value)


@dataclass(frozen=True, eq=False, kw_only=True)
class ThrowOptions(Options):
    """Options of `throw`."""

    speed: float = option(3, "of the ball, m/s", positive)
    spin: bool = option(False, "whether it turns " + 12 * "about its axis " + "as it flies")
    a_name_that_is_long: str | None = option(None, "called so")


@dataclass(frozen=True)
class Throw:
    """A plan that counts its runs."""

    ball: str
    target: str
    options: ThrowOptions
    runs: list[str] = field(default_factory=list)

    def forecast(self) -> Forecast[str]:
        return Forecast("by hand", {}, 1.5, 2e6, 1e-3, self.run)

    def run(self) -> str:
        self.runs.append(self.ball)
        return f"{self.ball} to {self.target} at {self.options.speed} m/s"


@verb(ThrowOptions)
def throw(ball: str, target: str, options: ThrowOptions) -> Plan[str]:
    """Throw a ball.

    ball    any
    {options}

    Returns what happened.
    """
    return Throw(ball, target, options)


def test_a_verb_runs_its_plan():
    assert throw("egg", "tree", speed=5) == "egg to tree at 5.0 m/s"
    plan = throw.planned("egg", "wall", speed=5)
    assert isinstance(plan, Throw) and plan.runs == [] and plan.options.speed == 5.0
    assert plan.run() == plan.forecast().run() == "egg to wall at 5.0 m/s" and plan.runs == ["egg", "egg"]


def test_subjects_are_given_by_position_or_by_name():
    assert throw("egg", target="tree") == throw(target="tree", ball="egg") == "egg to tree at 3.0 m/s"
    with pytest.raises(TypeError, match="multiple values for argument 'ball'"):
        throw("egg", ball="stone")
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'target'"):
        throw("egg", speed=5)


def test_options_are_given_by_name_alone():
    for value in (5, ThrowOptions()):
        with pytest.raises(TypeError, match="throw takes ball, target by position; give options by name"):
            throw("egg", "tree", value)
    with pytest.raises(TypeError, match="throw has unknown option 'options'"):
        throw("egg", "tree", options=ThrowOptions())


@pytest.mark.parametrize("call", [throw, throw.planned], ids=["verb", "plan"])
def test_a_misspelt_option_is_refused_with_the_most_similar_one(call):
    with pytest.raises(TypeError, match="throw has unknown option 'sped'; did you mean 'speed'"):
        call("egg", "tree", sped=5)
    with pytest.raises(TypeError, match="unknown option 'nonsense'; known: speed, spin, a_name_that_is_long"):
        call("egg", "tree", nonsense=5)


@pytest.mark.parametrize("call", [throw, throw.planned], ids=["verb", "plan"])
def test_an_option_that_its_check_refuses_is_refused_before_planning(call):
    with pytest.raises(ValueError, match="speed is -1; wanted more than 0"):
        call("egg", "tree", speed=-1)


def test_the_signature_is_that_of_the_subjects_and_the_record():
    signature = inspect.signature(throw)
    assert str(signature) == (
        "(ball: 'str', target: 'str', *, speed: 'float' = 3, spin: 'bool' = False, "
        "a_name_that_is_long: 'str | None' = None) -> 'str'"
    )
    assert throw.options is ThrowOptions
    assert list(signature.parameters)[2:] == list(described(ThrowOptions))


def test_the_documentation_lists_the_options_in_columns():
    lines = throw.__doc__.splitlines()
    assert lines[:4] == ["Throw a ball.", "", "ball    any", "speed  of the ball, m/s"]
    assert lines[4].startswith("spin   whether it turns about its axis") and lines[5].startswith("       about its")
    assert lines[-3:] == ["a_name_that_is_long  called so", "", "Returns what happened."]
    assert max(map(len, lines)) <= verbs.WIDTH and verbs.MARK not in throw.__doc__
    assert listed(ThrowOptions).splitlines() == lines[3:-2]
    shown = pydoc.render_doc(throw)
    assert "speed: 'float' = 3" in shown and "a_name_that_is_long  called so" in shown


def test_a_verb_has_the_name_and_place_of_its_function():
    assert (throw.__name__, throw.__module__) == ("throw", __name__)
    assert pickle.loads(pickle.dumps(throw)) is throw


def test_what_a_plan_returns_is_what_its_verb_returns():
    assert result_of("Plan[Image]") == "Image" and result_of("Plan[list[Image]]") == "list[Image]"


def test_a_forecast_says_what_it_is_about():
    forecast = Forecast("direct", {"taps": 4}, 2.0, 3e9, 2e-4, lambda: "image", (ErrorTerm("taps", 2e-4, "more"),))
    assert str(forecast) == "direct: about 2 s, 3 GB, error below 2.0e-04"
    assert "run=" not in repr(forecast) and forecast.run() == "image"
    rows = Forecast("direct", {}, 2.0, 3e9, 2e-4, str, n_rows=5, n_samples=7, search_cheaper=lambda: (1e-3, 0.5))
    assert str(rows) == (
        "direct: 5 rows of 7 samples, about 2 s, 3 GB, error below 2.0e-04 (next cheaper plan: 1.0e-03 in 0.5 s)"
    )


def test_a_forecast_says_times_that_a_person_can_plan_with_and_numbers_of_four_digits():
    plan = {"taps": 4, "run_seconds": 12013.4, "contributions": 123456789.123, "grid": "3 x 4"}
    long = Forecast("full wave", plan, 12013.4, 3e9, 2e-4, str, search_cheaper=lambda: pytest.fail("it planned again"))
    assert repr(long) == "<Forecast full wave: about 3 h 20 min, 3 GB, error below 2.0e-04>"
    html = replace(long, search_cheaper=lambda: (1e-3, 5000.0))._repr_html_()
    assert "about 3 h 20 min" in html and "1.0e-03 in 83 min" in html
    assert "taps 4, run_seconds 3 h 20 min, contributions 1.235e+08, grid 3 x 4" in html


@pytest.mark.parametrize(
    "seconds, said",
    [
        (0, "0 s"), (1.2e-5, "0.012 ms"), (0.0248, "25 ms"), (0.25, "0.25 s"), (2.46, "2.5 s"), (9.96, "10 s"),
        (57.4, "57 s"), (119, "119 s"), (121, "2 min"), (3599, "60 min"), (7169, "119 min"), (7171, "2 h"),
        (12013.4, "3 h 20 min"), (35_900, "10 h"), (79_000, "22 h"), (2 * 86400, "2 days"), (1e6, "12 days"),
        (1e8, "1157 days"),
    ],
)  # fmt: skip
def test_durations_are_said_in_the_unit_that_a_person_counts_them_in(seconds, said):
    assert text.duration(seconds) == said


def test_the_clock_of_a_run_begins_with_the_seconds_of_planning_and_leaves_these_alone():
    planning = {"plan": 2.0}
    for _ in range(2):
        clock = Clock(planning)
        clock.lap("plan")
        clock.lap("run")
        assert 2.0 <= clock.seconds["plan"] < 3.0 and list(clock.seconds) == ["plan", "run"]
    assert planning == {"plan": 2.0}
