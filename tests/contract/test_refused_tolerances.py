"""Tolerances that cannot be meant, 0.5 and 1e-12, are refused by every verb: name, value, limit and remedy."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from helpers.cases import SCENARIO, noise_on, straight

import sarcl
from sarcl.cli import parser

REFUSED = {
    0.5: "tolerance is 0.5; an error above 0.3 of the norm leaves no image: give less, such as 1e-1",
    1e-12: "tolerance is 1e-12; positions, frequencies and ranges in float64 do not carry an error below 1e-11: give "
    "more, such as 1e-6",
}
RAW = noise_on(straight(16), n_samples=32)
GRID = sarcl.ImageGrid.plane(shape=(8, 8), spacing=0.1)
CHIRP = sarcl.Waveform.chirp(center=9e9, bandwidth=1e8, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(0, -5, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=16)
POINT, BODY = sarcl.Scene.points([[0, 0, 0]]), sarcl.shapes.box((0.1, 0.1, 0.1))
TOWARDS = {"times": [0.0], "positions": [[1e3, 0, 0]]}
VERBS = {
    "backproject": lambda t: sarcl.backproject(RAW, GRID, tolerance=t),
    "plan": lambda t: sarcl.plan(RAW, GRID, tolerance=t),
    "polar_format": lambda t: sarcl.polar_format(RAW, GRID, tolerance=t),
    "range_doppler": lambda t: sarcl.range_doppler(RAW, tolerance=t),
    "echo": lambda t: sarcl.echo(POINT, CHIRP, TRACK, tolerance=t),
    "plan, echo": lambda t: sarcl.plan(sarcl.echo, POINT, CHIRP, TRACK, tolerance=t),
    "spectral_echo": lambda t: sarcl.spectral_echo(POINT, CHIRP, TRACK, tolerance=t),
    "fullwave_echo": lambda t: sarcl.fullwave_echo(BODY, CHIRP, TRACK, tolerance=t),
    "rcs": lambda t: sarcl.rcs(BODY, 0.0, 0.0, 1e10, tolerance=t),
    "beam": lambda t: sarcl.beam(sarcl.AntennaArray.linear(3, spacing=0.015), 1e10, **TOWARDS, tolerance=t),
}


@pytest.mark.parametrize("asked", REFUSED)
@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_refuses_them_in_the_same_words(verb, asked):
    with pytest.raises(ValueError) as refused:
        VERBS[verb](asked)
    assert str(refused.value) == REFUSED[asked]


def test_these_are_all_verbs_that_take_a_tolerance():
    public = {name: getattr(sarcl, name) for name in sarcl.__all__}
    named = {
        name
        for name, value in public.items()
        if callable(value) and not inspect.isclass(value) and "tolerance" in inspect.signature(value).parameters
    }
    passed_on = {"plan", "plan, echo"} | {name for name in public if name.startswith("plan_")}  # to their verbs
    assert set(VERBS) == named | passed_on


@pytest.mark.parametrize("asked", REFUSED)
def test_the_command_line_refuses_them(asked, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SCENARIO)
    RAW.save("raw.h5")
    for command in (["focus", "raw.h5"], ["focus", "raw.h5", "--dry-run"], ["simulate", "s.toml"]):
        assert parser.main([*command, "--tolerance", str(asked)]) == 2
        assert capsys.readouterr().err == f"sarcl: error: {REFUSED[asked]}\n"
    (tmp_path / "s.toml").write_text(f"{SCENARIO}[echo]\ntolerance = {asked}\n")
    assert parser.main(["simulate", "s.toml"]) == 2
    assert f"[echo] {REFUSED[asked]}" in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["raw.h5", "s.toml"]


def test_shares_take_no_tolerance_or_accuracy_of_zero():
    facet = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], float)
    antenna = np.array([[0, 0, 5.0]])
    assert (sarcl.illumination.lit(facet, antenna, tolerance=1e-12, accuracy=1e-12).share(0) == 255).all()
    for name in ("tolerance", "accuracy"):
        with pytest.raises(ValueError, match=f"{name} is 0"):
            sarcl.illumination.lit(facet, antenna, **{name: 0.0})
