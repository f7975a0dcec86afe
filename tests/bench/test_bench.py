"""`sarcl bench`: data that any library can read, errors against the exact sum, peers that may be absent or die."""

from __future__ import annotations

import itertools
import json
import os
import sys
from dataclasses import replace

import numpy as np
import pytest
import report as page

import sarcl
from sarcl.bench import _cases, _measure, _peers, documents, exact, pareto, ratios, spaceborne, tables
from sarcl.bench import backproject as bench
from sarcl.bench import baseline as numpy_baseline
from sarcl.bench._competitor import Absent, Competitor, Reading
from sarcl.cli import parser
from sarcl.figures import plots
from sarcl.reference.backproject import backproject as reference

# A peer that takes the exact sum of the case it is given, and does what else its name says.
STAND_IN = """
import json, sys
if sys.argv[1:2] == ["once"]:
    sys.exit(0)
import numpy as np
from pathlib import Path
from sarcl.bench import _cases, exact
folder = None
def answer(content):
    print(json.dumps(content), flush=True)
answer({"name": "stand-in", "version": "1", "python": "3"})
for line in sys.stdin:
    request = json.loads(line)
    if request["do"] == "load":
        folder = Path(request["folder"])
        answer({})
        continue
    options = request["spec"]["options"]
    if options.get("interp") == "cubic" and DIES:
        sys.exit("the stand-in fell over")
    if options.get("upsample") == 16:
        answer({"error": "ValueError: 16 is too much"})
        continue
    raw, grid = _cases.load(folder)
    at = json.loads((folder / "case.json").read_text())["at"]
    values = exact.backproject(raw, grid.at(*np.array(at)))[0] * 1.01
    answer({"seconds": {"setup": 0.25, "form": 0.5, "cpu": 0.9}, "values": [[v.real, v.imag] for v in values]})
"""


@pytest.fixture
def stand_in(tmp_path):
    """A program that runs a peer of our own in fastsar's place; call with dies=True for one that falls over."""

    def make(dies=False):
        script = tmp_path / "peer.py"
        script.write_text(STAND_IN.replace("DIES", str(dies)))
        program = tmp_path / "python"
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{script}"\n')
        program.chmod(0o755)
        return str(program)

    return make


@pytest.mark.parametrize("n_samples", [1, 2, 37, 64])
def test_the_quick_exact_sum_is_the_reference(n_samples):
    random = np.random.default_rng(n_samples)
    tx = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.07, n_pulses=5).positions
    raw = sarcl.PhaseHistory(
        (random.standard_normal((5, n_samples)) + 1j * random.standard_normal((5, n_samples))).astype(np.complex64),
        frequency=9.3e9 + np.arange(5) * 1e5,
        frequency_step=2e6,
        tx=tx,
        reference_range=np.linalg.norm(tx, axis=1) + random.standard_normal(5),
    )
    points = random.uniform(-45, 45, (20, 3))  # some beyond the range window of 37 m
    got, norm = exact.backproject(raw, points)
    wanted, spread = reference(raw, points)
    assert np.linalg.norm(got - wanted) < 1e-11 * np.linalg.norm(wanted)
    assert norm == pytest.approx(spread, rel=1e-11)


def test_points_make_the_samples_of_the_formula():
    case = _cases.make("straight", 8, "points", pixels=256)
    random = np.random.default_rng(0)
    positions = np.zeros((_cases.N_POINTS, 3))
    positions[:, :2] = (random.random((_cases.N_POINTS, 2)) - 0.5) * 0.98 * 8 * 0.25
    a = random.standard_normal((_cases.N_POINTS, 2)) @ [1, 1j]
    tx = case.raw.tx.astype(np.longdouble)
    path = 2 * (np.linalg.norm(tx[:, None] - positions, axis=2) - np.asarray(case.raw.reference_range)[:, None])
    f = case.raw.frequency[0] + np.arange(8) * case.raw.frequency_step[0]
    turns = (f[:, None, None] * path / np.longdouble(299_792_458)) % 1
    wanted = (a * np.exp(-2j * np.pi * turns.astype(float))).sum(axis=2).T
    assert np.abs(case.raw.samples - wanted).max() < 1e-6 * np.abs(wanted).max()


def test_a_saved_case_is_the_same_data(tmp_path):
    case = _cases.make("spotlight", 9, pixels=256)
    _cases.save(case, tmp_path)
    raw, grid = _cases.load(tmp_path)
    assert (np.asarray(raw.samples) == case.raw.samples).all()
    assert (raw.tx == case.raw.tx).all() and (raw.reference_range == case.raw.reference_range).all()
    assert (grid.at(*case.at) == case.grid.at(*case.at)).all()
    assert raw.frequency_step[0] == case.raw.frequency_step[0]


@pytest.mark.parametrize("scene", _cases.SCENES)
def test_the_baseline_is_an_image_of_the_case(scene):
    case = _cases.make(scene, 48, "noise", pixels=256)
    competitor = numpy_baseline.competitors(case)[0]
    wanted, norm = (case.wanted, case.norm) if competitor.share == 1 else competitor.check
    error = np.linalg.norm(competitor.run().values - wanted) / max(np.linalg.norm(wanted), norm)
    assert 1e-4 < error < 4e-3  # the hat at the edge of a 16 times oversampled band, (pi/32)^2/3, is its worst


def test_some_pulses_of_the_baseline_stand_for_all():
    case = _cases.make("spotlight", 240, pixels=256)
    competitor = numpy_baseline.competitors(case)[0]
    assert competitor.share == 139 / 240 and "139 pulses, seconds times 2" in competitor.setting
    ran = competitor.run()
    (row,) = _measure.measure(case, [replace(competitor, run=lambda: ran)], repeats=1, limit=60, paces={})
    assert row["error"] < 4e-3
    assert set(row["seconds"]["call"]) == {ran.seconds["call"] / competitor.share}


def constant(values, seconds, **options):
    def run():
        return Reading(values, {"call": seconds, "form": seconds})

    return Competitor("x", "y", "direct", options.pop("setting", "a"), run, **options)


def test_errors_are_relative_as_docs_accuracy_says():
    case = _cases.make("spotlight", 8, pixels=256)
    wrong = case.wanted + 1e-3 * case.norm / 16  # 256 pixels: a norm of 1e-3
    (row,) = _measure.measure(case, [constant(wrong, 0.1)], repeats=2, limit=60, paces={})
    own = np.linalg.norm(case.wanted)
    assert row["error"] == pytest.approx(1e-3 * case.norm / max(own, case.norm), rel=1e-9)
    assert row["error_of_image"] == pytest.approx(1e-3 * case.norm / own, rel=1e-9)
    assert row["seconds"] == {"call": [0.1, 0.1], "form": [0.1, 0.1]}


def test_no_speed_without_an_error():
    case = _cases.make("spotlight", 8, pixels=256)
    (row,) = _measure.measure(case, [constant(case.wanted * np.nan, 0.1)], repeats=2, limit=60, paces={})
    assert "NaN" in row["absent"] and "error" in row
    assert ratios.ran({"rows": [row]}) == []


def test_competitors_take_turns_and_long_ones_fewer():
    case = _cases.make("spotlight", 8, pixels=256)
    order = []

    def noted(name, seconds):
        def run():
            order.append(name)
            return Reading(case.wanted, {"call": seconds, "form": seconds})

        return Competitor(name, "y", "direct", "a", run)

    lines = _measure.alternate([noted("a", 1.0), noted("b", 40.0)], [noted("c", 1.0)])
    paces = {}
    rows = _measure.measure(case, lines, repeats=3, limit=100, paces=paces)
    assert order == ["a", "c", "b", "a", "c", "b", "a", "c", "a", "c"]
    assert [len(row["seconds"]["call"]) for row in rows] == [3, 3, 2]
    (late,) = _measure.measure(_cases.make("spotlight", 16, pixels=256), lines[2:], repeats=3, limit=100, paces=paces)
    assert "about 320 s" in late["absent"] and order[-1] == "c"


def test_runs_wait_for_an_idle_machine_but_not_for_ever(monkeypatch):
    ticks = iter([(0, 100), (10, 200), (10, 200), (105, 300)])  # 10 % idle, then 95 %
    monkeypatch.setattr(_measure, "_idle_and_all", lambda: next(ticks))
    assert _measure.wait_idle(60)
    busy = itertools.count(0, 100)
    monkeypatch.setattr(_measure, "_idle_and_all", lambda: (0, next(busy)))
    assert not _measure.wait_idle(0.01)
    case = _cases.make("spotlight", 8, pixels=256)
    (row,) = _measure.measure(case, [constant(case.wanted, 0.1)], repeats=2, limit=60, paces={}, patience=0.01)
    assert row["disturbed"] == 3  # the first run too


def row(who, error, seconds, method="direct", setting="s", device="d"):
    times = {"call": [2 * seconds], "form": [seconds, 3 * seconds]}
    facts = {"who": who, "device": device, "method": method, "setting": setting}
    return {**facts, "error": error, "error_of_image": error, "seconds": times, "predicted": error, "plan": {"taps": 2}}


def result(*rows, n=16):
    return {"scene": "spotlight", "data": "noise", "n": n, "pairs": n**3, "pixels": 256, "norm": 1.0, "rows": [*rows]}


def test_a_peer_is_matched_with_the_fastest_of_no_larger_error():
    ours = [row("sarcl", 1e-2, 1.0, setting="1e-02"), row("sarcl", 1e-3, 2.0), row("sarcl", 1e-4, 3.0)]
    absent = {"who": "sarcl", "device": "d", "method": "direct", "setting": "x", "absent": "why", "seconds": {}}
    found = ratios.matches(result(*ours, absent, row("peer", 1e-3, 5.0), row("peer", 1e-5, 5.0)))
    assert [entry["sarcl"] and entry["sarcl"]["error"] for entry in found] == [1e-3, None]
    assert found[0]["form"] == 2.5 and found[0]["median form"] == 2.5 and found[0]["process"] is None


def test_a_direct_peer_is_matched_with_subapertures_too_but_not_the_other_way():
    rows = [row("sarcl", 1e-3, 1.0, "factorized"), row("sarcl", 1e-3, 4.0), row("peer", 1e-2, 8.0)]
    rows.append(row("peer", 1e-2, 3.0, "factorized"))
    found = [(e["peer"]["method"], e["method"], e["form"]) for e in ratios.matches(result(*rows))]
    assert found == [("direct", "direct", 2.0), ("direct", "factorized", 8.0), ("factorized", "factorized", 3.0)]


def test_the_exponent_of_cost_against_size():
    results = []
    for n in (8, 16, 64):
        line, other = row("sarcl", 1e-3 * n, n**2.5), row("sarcl", 1e-3, n**3.0, setting="t")
        line["seconds"]["cpu"] = [n**2.0, 2 * n**2.0]
        results.append(result(line, other, *([row("once", 1e-3, 1.0)] if n == 8 else []), n=n))
    found = {(entry["who"], entry["setting"]): entry for entry in ratios.growth(results)}
    line = found["sarcl", "s"]
    assert line["exponent"] == pytest.approx(2.5) and line["cpu_exponent"] == pytest.approx(2)
    assert line["sizes"] == [8, 16, 64] and line["error"] == 0.064
    assert found["sarcl", "t"]["exponent"] == pytest.approx(3) and found["sarcl", "t"]["cpu_exponent"] is None
    assert len(found) == 2


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"tolerances": [0]}, r"tolerances\[0\] is 0"),
        ({"tolerances": [1e-3, -1]}, r"tolerances\[1\] is -1"),
        ({"tolerances": [float("nan")]}, "nan"),
        ({"sizes": [7]}, r"sizes\[0\] is 7; it must be at least 8"),
        ({"repeats": 0}, "repeats is 0"),
        ({"pixels": 255}, "at least 256"),
        ({"limit": 0}, "limit is 0"),
        ({"patience": -1}, "patience is -1"),
        ({"scenes": ["moon"]}, "moon"),
        ({"methods": ["fast"]}, "fast"),
        ({"data": "silence"}, "silence"),
        ({"scenes": ["spaceborne"], "data": "points"}, "data of spaceborne"),
        ({"peer_python": "/no/such/python"}, "no program"),
    ],
)
def test_bad_input_is_found_before_the_work(options, said):
    with pytest.raises(ValueError, match=said):
        bench.run(**options)


SMALL = {"scenes": ["straight"], "sizes": [16], "tolerances": [1e-2], "repeats": 2, "pixels": 256, "devices": ["cpu"]}


def test_images_of_the_public_gpu_benchmark_of_any_size():
    options = {"sizes": [32], "methods": ["direct"], "with_peers": False, "repeats": 1}
    (case,) = bench.run(**{**SMALL, **options, "scenes": ["spaceborne"]})["cases"]
    assert (case["data"], case["n"], case["pairs"]) == ("noise", 32, 45 * 32**2)
    assert all(0 < row["error"] <= row["predicted"] <= 1e-2 for row in case["rows"])
    assert "770 km, 0.25 m pixels; 1.41 n pulses of n samples" in tables.title(case)
    assert spaceborne.pulses(8192) == 11566 and _cases.make("spaceborne", 8).raw.n_rows == spaceborne.pulses(8) == 11


@pytest.mark.slow
def test_sarcl_and_a_peer_in_one_run(stand_in, tmp_path):
    lines = []
    document = bench.run(**SMALL, peer_python=stand_in(), say=lines.append)
    assert document["peers"] == [{"name": "fastsar", "version": "1", "python": "3", "backend": "cpu"}]
    rows = document["cases"][0]["rows"]
    ours = [r for r in rows if r["who"] == "sarcl" and "absent" not in r]
    assert ours and all(0 < r["error"] <= r["predicted"] <= 1e-2 for r in ours)
    assert all(len(r["seconds"]["call"]) == 2 and len(r["seconds"]["process"]) == 2 for r in ours)
    theirs = [r for r in rows if r["who"] == "stand-in 1"]
    right = [r for r in theirs if "absent" not in r]
    assert len(right) == 8 and all(r["error_of_image"] == pytest.approx(0.01, rel=1e-6) for r in right)
    assert all(r["seconds"]["call"] == [0.75] * 2 and r["seconds"]["form"] == [0.5] * 2 for r in right)
    assert all(r["seconds"]["cpu"] == [0.9] * 2 for r in right)
    assert all(r["absent"] == "ValueError: 16 is too much" for r in theirs if r not in right)
    text = "\n".join(lines)
    assert "stand-in 1" in text and "16 is too much" in text and "-40.0 dB" in text
    documents.write(document, tmp_path / "x.json")
    assert json.loads((tmp_path / "x.json").read_text())["cases"][0]["rows"][0]["who"] == "sarcl"


def test_a_peer_that_dies_costs_its_own_lines_only(stand_in):
    document = bench.run(**{**SMALL, "methods": ["direct"], "repeats": 1}, peer_python=stand_in(dies=True))
    rows = {(r["who"], r["setting"]): r for r in document["cases"][0]["rows"]}
    for upsample in (4, 8, 16):
        assert "the stand-in fell over" in rows["stand-in 1", f"cubic, {upsample} x"]["absent"]
    assert rows["stand-in 1", "linear, 8 x"]["error_of_image"] == pytest.approx(0.01, rel=1e-6)


def test_a_python_without_the_peer_is_a_line_not_an_error(tmp_path, monkeypatch):
    empty = tmp_path / "fastsar.py"
    empty.write_text("raise ImportError('No module named fastsar')")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    lines = []
    document = bench.run(**{**SMALL, "methods": ["direct"], "repeats": 1}, say=lines.append)
    assert "No module named fastsar" in document["peers"][0]["absent"]
    assert sum("peer fastsar: absent: No module named fastsar" in line for line in lines) == 1
    assert {r["who"] for r in document["cases"][0]["rows"]} == {"sarcl", "NumPy"}


def test_a_program_that_is_no_peer_is_absent_in_words(tmp_path):
    program = tmp_path / "python"
    program.write_text("#!/bin/sh\necho nothing to see here; sleep 60\n")
    program.chmod(0o755)
    with pytest.raises(Absent, match="nothing to see here"):
        _peers.Peer(str(program))


def test_a_method_that_cannot_is_absent_in_words(monkeypatch):
    def refuse(*_, **__):
        raise sarcl.ToleranceUnreachable(1e-3, 2e-2, "thinning", how="with sub-apertures")

    monkeypatch.setattr("sarcl.imaging.backproject.backproject", refuse)
    document = bench.run(**{**SMALL, "methods": ["factorized"]}, with_peers=False)
    (only,) = document["cases"][0]["rows"]
    assert only["absent"].startswith("tolerance 1.0e-03 cannot be met with sub-apertures")
    assert "absent: tolerance 1.0e-03 cannot be met" in tables.text(document["cases"][0])
    with pytest.raises(ValueError, match="nothing to draw"):
        pareto.picture(document["cases"])


def document_of(*cases_):
    machine = {
        "processor": "P",
        "processors": 2,
        "threads": 2,
        "python": "3",
        "numpy": "2",
        "sarcl": "0",
        "load": [1.0],
    }
    device = {"index": 0, "name": "d", "platform": "p", "driver": "1", "kind": "cpu", "fp64": True}
    peer = {"name": "fastsar", "absent": "not here"}
    return {"format": documents.FORMAT, "machine": machine, "devices": [device], "peers": [peer], "cases": list(cases_)}


def test_the_picture_has_a_panel_for_each_case_and_marks_the_figures(monkeypatch):
    made = []
    monkeypatch.setattr(plots, "png", lambda figure, *_: made.append(figure))
    one = result(row("sarcl", 1e-3, 1e-6, setting="1e-03"), row("peer", 1e-2, 2e-6, setting="linear, 8 x"))
    pareto.picture([one]), pareto.picture([one, result(), one])
    assert [len(figure.axes) for figure in made] == [1, 2]
    axes = made[0].axes[0]
    ours, theirs = axes.get_lines()
    assert (ours.get_label(), theirs.get_label()) == ("sarcl direct, d", "peer direct, linear")
    np.testing.assert_allclose([ours.get_xydata()[0], theirs.get_xydata()[0]], [[1e-3, 4.096], [1e-2, 2.048]])
    assert ours.get_marker() != theirs.get_marker() and ours.get_linestyle() != theirs.get_linestyle()
    assert [text.get_text() for text in axes.texts] == ["1e-3", "8 x"]


def test_labels_that_would_overlap_stand_on_the_other_side_or_are_left_out(monkeypatch):
    made = []
    monkeypatch.setattr(plots, "png", lambda figure, *_: made.append(figure))
    rows = [row("sarcl", 1e-3 * (1 + i / 1000), 1e-6, setting=f"1e-0{i}") for i in range(1, 5)]
    pareto.picture([result(*rows, row("peer", 1e-1, 2e-6, setting="linear, 8 x"))])
    boxes = [text.get_window_extent() for text in made[0].axes[0].texts]
    assert len(boxes) == 3 and not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def test_the_page_is_made_from_the_files(tmp_path):
    results, docs = tmp_path / "results", tmp_path / "docs"
    results.mkdir(), docs.mkdir()
    rows = row("sarcl", 1.5e-3, 1e-6, setting="1e-02"), row("peer", 2e-3, 3e-6, setting="linear, 8 x")
    rows[0]["seconds"]["kernel"] = [1e-6]
    documents.write(document_of(result(*rows), result(*rows, n=32)), results / "a.json")
    readme = tmp_path / "README.md"
    readme.write_text("before\n<!-- results -->\nold\n<!-- end of results -->\nafter\n")
    written = page.write(results, docs, readme)
    assert [p.name for p in written] == [
        "results-a.png",
        "results.md",
        "results_images.md",
        "results_echoes.md",
        "README.md",
    ]
    text = (docs / "results_images.md").read_text()
    for words in ("results-a.png", "1.5e-03", "3.00 x", "not here", "cost against size", "taps 2"):
        assert words in text
    assert "old" not in readme.read_text() and "| 1e-02 | 1.5e-03 |" in readme.read_text()


def test_an_old_or_broken_file_is_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match=r"holds no \.json"):
        page.write(tmp_path, tmp_path)
    (tmp_path / "a.json").write_text('{"rows": []}')
    with pytest.raises(ValueError, match=r"a\.json has format None, wanted 2"):
        page.write(tmp_path, tmp_path)
    (tmp_path / "a.json").write_text("{")
    with pytest.raises(ValueError, match=r"a\.json is no JSON"):
        page.write(tmp_path, tmp_path)


def test_the_command_writes_what_it_is_asked_for(tmp_path, capsys):
    files = tmp_path / "x.json", tmp_path / "x.png"
    options = ["--scenes", "spotlight", "--sizes", "16", "--tolerances", "1e-2", "--repeats", "1", "--pixels", "256"]
    options += ["--methods", "direct", "--no-peers", "--devices", "cpu", "--no-fp64"]
    assert parser.main(["bench", "backproject", *options, "--json", str(files[0]), "--picture", str(files[1])]) == 0
    out = capsys.readouterr().out
    document = json.loads(files[0].read_text())
    assert len(document["cases"][0]["rows"]) == len(document["devices"])
    assert "no float64" in out and "Gbp/s" in out and files[1].stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--json", "x.txt"], "ends in '.txt'"),
        (["--picture", "/no/such/folder/x.png"], "there is no folder"),
        (["--tolerances", "0"], "greater than 0"),
        (["--tolerances", "nan"], "nan"),
        (["--sizes", "4"], "at least 8"),
        (["--peer-python", "/no/python"], "no program"),
    ],
)
def test_bad_options_end_in_one_line(options, said, capsys):
    assert parser.main(["bench", "backproject", *options]) == parser.BAD_INPUT
    assert said in capsys.readouterr().err


def test_echo_documents_become_tables(tmp_path):
    """A document of bench/echo.py: spreading, whole echoes and scenes."""
    spread = [
        {
            "name": "sarcl, delays from geometry", "setting": "1e-03", "seconds": [0.5, 0.4], "error": 2e-4,
            "call": [1, 0.8], "cpu": [1.5, 1.3],
        },
        {"name": "finufft, delays given", "setting": "1e-03 complex64", "seconds": [1.0, 1.2], "error": 7e-4},
    ]  # fmt: skip
    whole = [
        {"name": "metal", "setting": "1e-02", "seconds": [2.0], "pairs": 4_000_000, "error": 1e-3, "predicted": 8e-3}
    ]
    long = [
        {"name": "SARAS", "setting": "1e-02", "seconds": [9.0], "pairs": 5e6, "error": 1e-3, "samples": 7, "vax": 490}
    ]
    document = documents.header([]) | {
        "kind": "echo", "points": 1000, "pulses": 40000, "samples": 7, "spread": spread, "whole": whole, "scenes": long,
    }  # fmt: skip
    (tmp_path / "results").mkdir()
    documents.write(document, tmp_path / "results" / "2-echo.json")
    page.write(tmp_path / "results", tmp_path)
    text = (tmp_path / "results_echoes.md").read_text()
    assert "| sarcl, delays from geometry | 1e-03 | 2.0e-04 | 0.4 | 100 | 80 | 50 | 1.3 |" in text
    assert "| 1e-03 complex64 | 7.0e-04 | 1e-03 | 2.0e-04 | 2.50 x | 2.40 x |" in text
    assert "| metal | 1e-02 | 1.0e-03 | 8.0e-03 | 2 |  | 2.0 | 0.05 x its rate |" in text
    assert "| SARAS | 1e-02 | 1.0e-03 | 5e+06 | 7 | 9 | 490 |" in text


def test_documents_of_channels_become_tables(tmp_path):
    """A document of bench/channels.py: ways of the same channels beside one another."""
    row = {"scene": "points", "n": 45, "contributions": 9_000_000_000, "error": 2e-5, "predicted": 8e-4, "visited": 1}
    rows = [
        row | {"way": "one call", "seconds": [3.0, 2.0, 4.0], "positions": 3},
        row | {"way": "one call per channel", "seconds": [9.0, 8.0, 7.0], "positions": None},
    ]
    document = documents.header([]) | {"kind": "channels", "pulses": 101, "growth": rows, "one": [], "many": rows[:1]}
    (tmp_path / "results").mkdir()
    documents.write(document, tmp_path / "results" / "4-channels.json")
    page.write(tmp_path / "results", tmp_path)
    text = (tmp_path / "results_echoes.md").read_text()
    assert "| points | 45 | one call, 3 positions | 2.0e-05 | 8.0e-04 | 2 | 3 | 4.5 | 1.00 |" in text
    assert "| points | 45 | one call per channel | 2.0e-05 | 8.0e-04 | 7 | 8 | 1.29 | 3.50 |" in text
    assert "Carriers of 900 MHz in all x 101 pulses" in text and "One carrier" not in text


def test_documents_of_full_wave_runs_become_tables(tmp_path):
    """A document of bench/full_wave_peers.py: rates of the solvers, and ratios."""
    peer = {"name": "gprMax", "version": "4.0.1", "python": "3.11.7", "backend": "OpenMP, OpenCL"}
    rates = {
        "sarcl": {"Mcells/s": 450.0, "Mcells per two CPU s": 500.0},
        "gprMax OpenMP": {"Mcells/s": 150.0, "Mcells per two CPU s": 125.0},
    }
    document = documents.header([]) | {
        "kind": "full wave", "cells": [200, 200, 208], "frequencies": 50, "rounds": 2, "resting": 0.185,
        "peers": [peer], "rates": rates,
    }  # fmt: skip
    (tmp_path / "results").mkdir()
    documents.write(document, tmp_path / "results" / "6-full-wave.json")
    page.write(tmp_path / "results", tmp_path)
    text = (tmp_path / "results_echoes.md").read_text()
    assert "200 x 200 x 208 cells, 50 frequencies; 18% of the cells" in text and "- peer gprMax 4.0.1" in text
    assert "| gprMax OpenMP | 150 | 125 | 3.0 | 4.0 |" in text


def test_documents_of_a_spaceborne_pass_become_tables(tmp_path):
    """A document of bench/spaceborne.py: cost of the stages, theory beside both images."""
    rows = [
        {"item": "width", "unit": "m", "theory": 2.2, "fast": 2.21, "slow": 2.19, "digits": ".2f"},
        {"item": "rate", "unit": "", "theory": -1848.0, "fast": -1848.3, "slow": None, "digits": ".1f"},
    ]
    document = documents.header([]) | {
        "kind": "spaceborne", "swath": [5000.0, 1500.0], "pulses": 1500, "samples": 7, "facets": 2_400_000,
        "incidence_deg": 38.7, "slant_km": 980.0, "rows": rows, "cpu": {"raw data": 155.4, "backprojection": 17.0},
        "errors": {"raw data": 2.3e-3, "backprojection": None}, "pixels": {"fast": [4, 5], "slow": [6, 7]},
    }  # fmt: skip
    (tmp_path / "results").mkdir()
    documents.write(document, tmp_path / "results" / "5-spaceborne.json")
    page.write(tmp_path / "results", tmp_path)
    text = (tmp_path / "results_echoes.md").read_text()
    assert "5 x 1.5 km of ground in 2,400,000 facets" in text and "4 x 5 pixels by range-Doppler and 6 x 7" in text
    assert "| raw data | 155.4 | 2.3e-03 |" in text and "| backprojection | 17.0 |  |" in text
    assert "| width, m | 2.20 | 2.21 | 2.19 |" in text and "| rate | -1848.0 | -1848.3 |  |" in text


@pytest.mark.slow
def test_a_spaceborne_pass_is_as_theory_says():
    """Raw data of facets and reflectors from an orbit, range-Doppler and backprojection: the quick pass."""
    import spaceborne

    rows = {row["item"]: row for row in spaceborne.Run(spaceborne.QUICK, None).document()["rows"]}
    for words, allowed in (
        ("Doppler centroid, from the track", 1.0), ("Doppler centroid, from the data", 20.0),
        ("Doppler rate, from the track", 1.0), ("Doppler rate, from the data", 2.0),
        ("reflectors alone: IRW in slant range, mean", 0.02), ("reflectors alone: IRW in azimuth, mean", 0.02),
        ("reflectors alone: PSLR in azimuth, mean", 0.2), ("reflectors alone: largest error of position", 0.06),
        ("reflectors alone: largest error of phase", 0.02), ("reflectors in the scene: cross section, mean", 0.2),
        ("layover of the reflector on a mast of 80 m", 0.3), ("level ground, sigma0", 1.0),
        ("frustum, shadow ends", 12.0), ("cuboid, shadow ends", 12.0), ("cylinder, shadow ends", 12.0),
    ):  # fmt: skip
        row = rows[words]
        for key in ("fast", "slow"):
            if row[key] is not None:
                assert row[key] == pytest.approx(row["theory"], abs=allowed), words
