"""bench/gpu_session.py: every stage on this machine's device, and what becomes of stages and rows that fail."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import gpu_session
import numpy as np
import pytest

from sarcl.bench.verbs import TASKS


@pytest.mark.slow
def test_all_stages_run_on_a_cpu(tmp_path):
    path = tmp_path / "session.json"
    assert gpu_session.main(["--small", "--json", str(path)]) == 0
    document = json.loads(path.read_text())
    assert document["devices"][0]["name"] and document["devices"][0]["driver"] and document["machine"]["processor"]
    rows = {stage: [r for r in document["rows"] if r["stage"] == stage] for stage in gpu_session.STAGES}
    assert all(row["ok"] and row.get("within", True) for stage in rows.values() for row in stage)
    assert all(stage[-1]["name"] == "end" and len(stage) > 1 for stage in rows.values())
    measured = {(row["verb"], row["fp64"]) for row in rows["correct"][:-1]}
    assert {(name, False) for name in TASKS} <= measured
    assert not document["devices"][0]["fp64"] or {(name, True) for name in TASKS} <= measured
    assert all(
        0 < row["error"] <= row["tolerance"] for stage in ("correct", "rate", "sizes") for row in rows[stage][:-1]
    )
    assert {row["tolerance"] for row in rows["rate"][:-1]} == set(gpu_session.TOLERANCES)
    assert all(row["G_per_s"] > 0 and row["stages"]["backproject"] > 0 for row in rows["rate"][:-1])
    assert all(row["M_per_s"] > 0 and row["stages"] for stage in ("echoes", "sizes") for row in rows[stage][:-1])
    assert all(rate > 0 for row in rows["fdtd"][:-1] for rate in row["M_cells_per_s"].values())


def test_linear_interpolation_of_critical_samples_has_the_error_of_its_formula(tmp_path):
    """Mean square of 1 - (1 - u) exp(-j w u) - u exp(j w (1 - u)) over places u of a sample and the weighted band w."""
    path = tmp_path / "session.json"
    path.write_text('{"rows": []}')
    gpu_session.public(gpu_session.Session(path, "public", None, small=True))
    u, w = (np.arange(200) + 0.5) / 200, np.pi * ((np.arange(400) + 0.5) / 200 - 1)[:, None]
    wrong = np.abs(1 - (1 - u) * np.exp(-1j * w * u) - u * np.exp(1j * w * (1 - u))) ** 2
    for row, weights in zip(json.loads(path.read_text())["rows"], (np.hamming(400), np.ones(400)), strict=True):
        expected = np.sqrt((weights**2 @ wrong.mean(axis=1)) / (weights**2).sum())
        assert row["ok"] and row["error"] == pytest.approx(expected, rel=0.1)  # 1024 pixels of one draw of noise


def test_the_page_has_every_measured_rate_with_its_error():
    root = Path(gpu_session.__file__).parents[1]
    page = (root / "docs" / "developers" / "gpu_benchmarks.md").read_text()
    rows = json.loads((root / "bench" / "results" / "gpu" / "h100.json").read_text())["rows"]
    rates = [row for row in rows if row["stage"] == "rate"]
    assert len(rates) == len(gpu_session.METHODS) * len(gpu_session.TOLERANCES)
    for row in rates:
        error = f"{row['tolerance']:.0e} | {row['error']:.1e} | {row['dB']:.0f} dB | {row['predicted']:.1e}"
        again = f"{row['again']:.2f} | {row['G_again']:.0f}" if row.get("again") else "- | -"
        line = f"| {row['method']} | {error} | {min(row['seconds']):.2f} | {row['G_per_s']:.0f} | {again} |"
        assert line.replace("e-0", "e-") in page and row["error"] <= row["predicted"] <= row["tolerance"]


def test_a_row_that_fails_is_written_and_the_next_one_too(tmp_path):
    path = tmp_path / "session.json"
    path.write_text('{"rows": []}')
    session = gpu_session.Session(path, "rate", None, small=True)
    session.measure("none", lambda: {"value": 1 / 0})
    session.measure("one", lambda: {"value": 1})
    none, one = json.loads(path.read_text())["rows"]
    assert not none["ok"] and none["error_text"] == "ZeroDivisionError: division by zero"
    assert one["ok"] and one["value"] == 1


def test_a_stage_that_hangs_or_dies_ends():
    hanging = gpu_session.process([sys.executable, "-S", "-c", "import time; time.sleep(60)"], 0.5)
    assert not hanging["ok"] and hanging["seconds"] < 30 and "limit" in hanging["end"]
    dead = gpu_session.process([sys.executable, "-S", "-c", "raise SystemExit(3)"], 60)
    assert not dead["ok"] and dead["end"] == "exit status 3"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--stages", "rate,rates"], "no stage rates; the stages are device, correct"),
        (["--json", "/no/such/folder/x.json"], "there is no folder /no/such/folder"),
        (["--limit", "0"], "--limit is 0, must be above 0"),
    ],
)
def test_a_bad_command_line_ends_before_the_work(arguments, said, capsys):
    with pytest.raises(SystemExit) as end:
        gpu_session.main(arguments)
    assert end.value.code == 2 and said in capsys.readouterr().err


def test_echoes_and_images_of_the_session_are_tasks_of_verbs():
    assert {*gpu_session.ECHOES, *gpu_session.IMAGES, *gpu_session.FINEST} <= set(TASKS)
    assert gpu_session.METHODS == TASKS["backproject"].methods
