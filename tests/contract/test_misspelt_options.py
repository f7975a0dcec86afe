"""A forecast takes the options of its verb and no others: a misspelt one would be the forecast of another job."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import sarcl
from sarcl import scenario
from sarcl.fullwave.echoes.fullwave_echo import fullwave_echo
from sarcl.simulation.echo_forecast import plan_spectral_echo

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=100e6, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(0, -8, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=16)
POINTS = sarcl.Scene.points([[1e3, 0.0, 0.0]])
TEXT = """
[waveform.chirp]
center = 9.6e9
bandwidth = 1e8
duration = 1e-6
[trajectory.line]
start = [0, -8, 1000]
velocity = [0, 10, 0]
prf = 16.0
n_pulses = 16
[scene.points]
positions = [[1000, 0, 0]]
"""
GRID = """
[grid.plane]
center = [1000, 0, 0]
shape = [8, 8]
spacing = [1, 1]
"""


def raw():
    return sarcl.echo(POINTS, CHIRP, TRACK, tolerance=1e-2)


def grid():
    return sarcl.ImageGrid.plane(center=(1e3, 0, 0), shape=(8, 8), spacing=(1, 1))


FORECASTS = {
    "plan": lambda **o: sarcl.plan(raw(), grid(), **o),
    "plan_echo": lambda **o: sarcl.plan(sarcl.echo, POINTS, CHIRP, TRACK, **o),
    "plan_spectral_echo": lambda **o: plan_spectral_echo(POINTS, CHIRP, TRACK, **o),
    "plan, fullwave_echo": lambda **o: sarcl.plan(sarcl.fullwave_echo, sarcl.shapes.box((1, 1, 1)), CHIRP, TRACK, **o),
    "plan, polar_format": lambda **o: sarcl.plan(sarcl.polar_format, raw(), grid(), **o),
    "plan, range_doppler": lambda **o: sarcl.plan(sarcl.range_doppler, raw(), side="right", **o),
    **{
        f"scenario.plan, {section or 'echo'}": lambda section=section, **o: scenario.loads(TEXT + section).plan(**o)
        for section in ("", "[spectral_echo]", "[fullwave_echo]")
    },
    **{
        f"scenario.plan_focus, {what}": lambda tail=tail, **o: scenario.loads(TEXT + tail).plan_focus(raw(), **o)
        for what, tail in {
            "backproject": GRID,
            "polar_format": GRID + "[polar_format]",
            "range_doppler": "[range_doppler]",
        }.items()
    },
}


@pytest.mark.parametrize("name", FORECASTS)
@pytest.mark.parametrize("option", ["tolerence", "nonsense"])
def test_misspelt_options_are_refused(name, option):
    with pytest.raises(TypeError, match=option):
        FORECASTS[name](**{option: 1e-5})


def test_the_most_similar_option_is_named():
    with pytest.raises(TypeError, match="echo has unknown option 'tolerence'; did you mean 'tolerance'"):
        sarcl.plan(sarcl.echo, POINTS, CHIRP, TRACK, tolerence=1e-5)


def test_options_of_the_run_alone_are_taken_by_its_forecast(tmp_path):
    def progress(*_):
        pass

    runs = {"check": True, "progress": progress, "out": tmp_path / "raw.h5"}
    assert sarcl.plan(sarcl.echo, POINTS, CHIRP, TRACK, tolerance=1e-2, **runs).n_rows == 16
    assert scenario.loads(TEXT + GRID).plan_focus(raw(), **runs | {"out": tmp_path / "image.h5"}).method == "direct"
    polar = scenario.loads(TEXT + GRID + "[polar_format]").plan_focus(raw(), **runs | {"out": tmp_path / "image.h5"})
    assert polar.method == "polar format"
    assert not list(tmp_path.iterdir())
    assert {"check", "progress", "out"} <= set(inspect.signature(fullwave_echo).parameters)
    assert np.isfinite(polar.seconds)
