"""Echoes written to a file pulse after pulse, and the forecast of their size, time and error."""

from __future__ import annotations

import logging
import subprocess
import sys

import numpy as np
import pytest
from helpers.array_cases import F0, SCENE, TONE, WINDOW, line, passing
from helpers.cases import SCENARIO, thinned

import sarcl
from sarcl import shapes
from sarcl.cli import parser
from sarcl.simulation import echo_output

FACETS = shapes.box((0.5, 0.4, 0.3))
ARRAYS = {
    "one antenna": {},
    "added up": {"array": line(5), "receive": "all"},
    "apart": {"array": line(5), "channels": "separated", "receive": "all"},
    "own": {"array": line(5), "channels": "separated", "receive": "own"},
}


@pytest.mark.parametrize("name, scene", thinned(ARRAYS, [SCENE, FACETS]))
def test_a_file_holds_what_memory_would(name, scene, tmp_path):
    options = {"polarization": ("HH", "VV"), "reference": (0, 0, 0), "range_window": WINDOW, "tolerance": 1e-3}
    options |= ARRAYS[name]
    whole = sarcl.echo(scene, TONE, passing(40), check=True, **options)
    filed = sarcl.echo(scene, TONE, passing(40), check=True, out=tmp_path / "a.h5", **options)
    assert not isinstance(filed.samples, np.ndarray) and filed.report.measured_error == whole.report.measured_error
    for field in ("samples", "frequency", "tx", "rx", "reference_range", "tx_channel", "rx_channel", "polarization"):
        one, two = getattr(whole, field), getattr(filed, field)
        assert (one is None) == (two is None) and (one is None or np.array_equal(one, two[:])), field
    assert filed.report.predicted_error == whole.report.predicted_error


@pytest.mark.parametrize("name", ARRAYS)
def test_blocks_of_pulses_make_the_same_file(name, tmp_path):
    # a block of samples is a quarter of max_bytes
    options = {"reference": (0, 0, 0), "range_window": (-40, 40), "tolerance": 1e-3, **ARRAYS[name]}
    chirp = sarcl.Waveform.chirp(center=F0, bandwidth=600e6, duration=5e-8)
    whole = sarcl.echo(SCENE, chirp, passing(101), **options)
    blocks = []
    filed = sarcl.echo(
        SCENE,
        chirp,
        passing(101),
        out=tmp_path / "a.h5",
        max_bytes=1e6,
        progress=lambda *a: blocks.append(a),
        **options,
    )
    assert np.linalg.norm(filed.samples[:] - whole.samples) <= 1e-6 * np.linalg.norm(whole.samples)
    assert filed.report.contributions_done == whole.report.contributions_done
    done = [d for stage, d, total in blocks if stage == "echo"]
    assert done == sorted(done) and done[-1] == blocks[-1][2]


def test_nothing_is_left_of_echoes_that_failed(tmp_path):
    def stop(stage, done, total):
        if stage == "echo" and done:
            raise KeyboardInterrupt

    old = tmp_path / "a.h5"
    old.write_text("kept")
    with pytest.raises(KeyboardInterrupt):
        sarcl.echo(SCENE, TONE, passing(), out=old, progress=stop, range_window=WINDOW)
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"] and old.read_text() == "kept"
    with pytest.raises(FileNotFoundError, match="no folder"):
        sarcl.echo(
            SCENE, TONE, passing(), out=tmp_path / "none" / "a.h5", progress=lambda *a: pytest.fail("work began")
        )


def test_out_is_a_name():
    with pytest.raises(TypeError, match="out is a int; give the name of a file"):
        sarcl.echo(SCENE, TONE, passing(), out=5, range_window=WINDOW)


def test_geometry_of_more_rows_than_memory_holds_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(echo_output.host_memory, "installed", lambda: 1e5)
    with pytest.raises(MemoryError, match=r"1000 rows, whose geometry alone takes .*'simultaneous'"):
        sarcl.echo(
            SCENE, TONE, passing(40), array=line(5), channels="separated", receive="all", range_window=WINDOW,
            out=tmp_path / "a.h5",
        )  # fmt: skip
    assert not list(tmp_path.iterdir())


def test_size_is_told_before_the_work(caplog):
    told = []
    with caplog.at_level(logging.INFO, "sarcl"):
        sarcl.echo(
            SCENE, TONE, passing(40), array=line(5), channels="separated", receive="all", range_window=WINDOW,
            progress=lambda *a: told.append(caplog.text),
        )  # fmt: skip
    assert "echoes of 40 pulses, 1000 rows of 1 samples: 8 kB, and 130 kB of geometry" in told[0]


@pytest.mark.parametrize("name", ARRAYS)
def test_a_forecast_equals_the_run(name):
    array = ARRAYS[name].get("array")
    options = ARRAYS[name] | ({"array": array.mirrored(60, 120)} if array is not None else {})
    options |= {"reference": (0, 0, 0), "range_window": WINDOW, "tolerance": 1e-2}
    told = sarcl.plan(sarcl.echo, SCENE, TONE, passing(120), **options)
    raw = sarcl.echo(SCENE, TONE, passing(120), **options)
    assert (told.n_rows, told.n_samples) == raw.samples.shape
    assert told.bytes >= raw.samples.nbytes and told.seconds > 0
    assert told.plan["contributions"] == pytest.approx(raw.report.contributions_done, rel=0.5)
    assert told.predicted_error == raw.report.predicted_error and told.error_terms == raw.report.error_terms
    assert str(told).startswith(f"pulse by pulse: {raw.n_rows} rows of {raw.n_samples} samples, about ")
    again = told.run()
    assert np.array_equal(again.samples, raw.samples) and again.report.plan == raw.report.plan


@pytest.mark.filterwarnings("ignore:.*shorter than 1/:sarcl.SarclWarning")  # of the first plan's carriers
def test_a_forecast_includes_later_plans_of_carriers():
    array = line(5, step=20e6).switched(line(5, step=40e6), 10, 120)
    tone = sarcl.Waveform.tone(center=F0, duration=1 / 40e6)
    with pytest.warns(sarcl.SarclWarning, match="centre frequency jumps"):
        raw = sarcl.echo(SCENE, tone, passing(120), array=array, reference=(0, 0, 0), range_window=WINDOW)
        told = sarcl.plan(sarcl.echo, SCENE, tone, passing(120), array=array, reference=(0, 0, 0), range_window=WINDOW)
    assert (told.n_rows, told.n_samples) == raw.samples.shape


def test_a_forecast_looks_where_there_is_something_to_see():
    # the antenna turns away from the scene after a third of the track
    track, away = (sarcl.pointing.spotlight(passing(120), (0, y, 0)) for y in (0, 3e3))
    turns = np.where((np.arange(120) < 40)[:, None, None], track.attitude, away.attitude)
    track = sarcl.Trajectory(track.times, track.positions, attitude=turns)
    beam = sarcl.Antenna.gaussian(width=(0.02, 0.02))
    options = {"antenna": beam, "reference": (0, 0, 0), "range_window": (-40, 40)}
    chirp = sarcl.Waveform.chirp(center=F0, bandwidth=100e6, duration=1e-6)
    told = sarcl.plan(sarcl.echo, SCENE, chirp, track, **options)
    assert told.n_rows == sarcl.echo(SCENE, chirp, track, **options).n_rows and told.plan["contributions"] > 0


def test_a_full_disk_ends_in_words(tmp_path):
    script = tmp_path / "full.py"
    script.write_text(FULL)
    for room in ("0.3", "0.9", "1.0", "1.1"):
        found = subprocess.run(
            [sys.executable, "-W", "ignore", str(script), str(tmp_path / "a.h5"), room], capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        assert found.returncode == 0 and "cannot write" in found.stdout and "raise the limit" in found.stdout, found
        assert [p.name for p in tmp_path.iterdir()] == ["full.py"]


FULL = """
import resource, signal, sys, numpy as np, sarcl
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
track = sarcl.Trajectory.line(start=(-5e3, -150, 800), velocity=(0, 300, 0), prf=400.0, n_pulses=400)
options = {"array": sarcl.AntennaArray.linear(5, spacing=0.015), "receive": "all", "range_window": (-40, 40)}
wave, scene = sarcl.Waveform.chirp(center=10e9, bandwidth=100e6, duration=1e-7), sarcl.Scene.points([[0.0, 0, 0]])
whole = sarcl.echo(scene, wave, track, **options)
limit = int(float(sys.argv[2]) * whole.samples.nbytes)
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
for call in (
    lambda: sarcl.echo(scene, wave, track, out=sys.argv[1], max_bytes=1e6, **options),
    lambda: whole.save(sys.argv[1]),
):
    try:
        call()
    except OSError as exc:
        print(exc)
"""


def test_a_forecast_refuses_what_echo_refuses():
    with pytest.raises(ValueError, match="tolerance"):
        sarcl.plan(sarcl.echo, SCENE, TONE, passing(), tolerance=0)
    with pytest.raises(ValueError, match="plan names 3 pulses"):
        sarcl.plan(sarcl.echo, SCENE, TONE, passing(12), array=line(3).mirrored(1, 3), range_window=WINDOW)
    with pytest.raises(TypeError, match="track"):
        sarcl.plan(sarcl.echo, SCENE, TONE, None)
    with pytest.raises(ValueError, match="plan names 8 pulses but the track has 120"):
        sarcl.plan(sarcl.echo, SCENE, TONE, passing(120), array=line(3).mirrored(4, 8), range_window=WINDOW)
    with pytest.raises(ValueError, match="reference"):
        sarcl.plan(sarcl.echo, SCENE, TONE, passing(), reference=(0, 0))


def test_dry_run_says_what_simulating_takes_and_writes_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SCENARIO)
    assert parser.main(["simulate", "s.toml", "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("pulse by pulse: 48 rows of ") and "about" in said and "error below" in said
    assert [p.name for p in tmp_path.iterdir()] == ["s.toml"]


MEASURE = """
import resource, sys, numpy as np, sarcl
from helpers.array_cases import line, passing
scene = sarcl.Scene.points([[0.0, 0, 0], [0.2, 0.4, 0]])
tone = sarcl.Waveform.tone(center=10e9, duration=5e-7)
def run(n, pulses, **options):
    array = line(n, step=2e6, spacing=0.0144)
    return sarcl.echo(scene, tone, passing(pulses), array=array, receive="all", reference=(0, 0, 0),
        range_window=(-36, 36), tolerance=1e-3, max_bytes=2e7, **options)
def peak(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
run(9, 3)
before = peak()
raw = run(450, 60, out=sys.argv[1])
print(peak() - before, raw.n_rows, raw.n_samples, raw.report.predicted_error)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="kilobytes of memory as Linux counts them")
def test_450_senders_and_450_receivers_stream_within_their_limit(tmp_path):
    script = tmp_path / "_measure.py"
    script.write_text(MEASURE)
    import os
    from pathlib import Path

    path = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    found = subprocess.run(
        [sys.executable, "-W", "ignore", str(script), str(tmp_path / "a.h5")], capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": path}, check=True,
    ).stdout.split()  # fmt: skip
    assert [int(n) for n in found[1:3]] == [60 * 450, 450] and float(found[3]) <= 1e-3
    # samples are 97 MB; the limit 20 MB, rows' geometry 4 MB, twice; the rest is kernels and FFTs being set up
    assert float(found[0]) < 2e7 + 2 * 60 * 450 * 130 + 5e7
