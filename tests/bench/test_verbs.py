"""`sarcl bench`: tasks of every verb, their errors against exact results, and what the command writes of them."""

from __future__ import annotations

import json

import pytest
import report as page

from sarcl import verbs as all_verbs
from sarcl.bench import tables, verb_pictures, verbs
from sarcl.cli import parser
from sarcl.figures import plots

SIZES = {
    "channels of an array": 9, "spectral echo": 512, "range-Doppler": 256, "full wave": 16, "beam of an array": 8,
    "echo with edges": 3, "echo with bounces": 3, "radar cross section": 3,
}  # fmt: skip
SLOW = ("full wave", "echo of facets")


def test_every_verb_has_a_task():
    calls = [task.make(name, SIZES.get(name, 32)).call for name, task in verbs.TASKS.items()]
    measured = {call.func for call in calls if hasattr(call, "func")}
    assert measured == {getattr(all_verbs, name) for name in all_verbs.HOMES}


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in verbs.TASKS])
def test_errors_are_within_the_tolerance_and_those_of_the_result(name):
    """The error of a result is that of its exact twin, and grows when the result is changed."""
    task = verbs.TASKS[name]
    case = task.make(name, SIZES.get(name, 32))
    options = {"method": task.methods[0]} if task.methods[0] else {}
    result = case.call(tolerance=task.tolerances[1], device=None, check=True, **options)
    error, of_image = case.compare(result)
    assert 0 < error <= task.tolerances[1] and error <= 1.001 * of_image
    if hasattr(result, "report"):
        assert result.report.predicted_error <= task.tolerances[1]
        # The full wave predicts an estimate, from the differences of a few anchors, and no bound.
        assert error <= result.report.predicted_error or name == "full wave"
    else:
        assert case.compare(1.5 * result)[0] > 0.1


def test_a_document_of_verbs_has_rows_with_errors_and_both_kinds_of_seconds():
    lines, kept = [], []
    options = {"verbs": ["polar format", "beam of an array"], "sizes": [16, 32], "tolerances": [1e-2], "repeats": 1}
    document = verbs.run(**options, devices=["cpu"], say=lines.append, keep=lambda d: kept.append(len(d["cases"])))
    assert kept == [1, 2, 3, 4]
    assert [(c["scene"], c["n"]) for c in document["cases"]] == [
        ("polar format", 16), ("polar format", 32), ("beam of an array", 16), ("beam of an array", 32),
    ]  # fmt: skip
    for case in document["cases"]:
        (row,) = case["rows"]
        assert 0 < row["error"] <= 1e-2 and len(row["seconds"]["cpu"]) == len(row["seconds"]["call"]) == 1
        assert ("predicted" in row) == (case["scene"] == "polar format")
    text = "\n".join(lines)
    assert "cost against size" in text and "polar format, n = 32: white noise" in text and tables.VERB_HEAD[4] in text
    assert verb_pictures.picture(document["cases"][:2]).startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="nothing to draw"):
        verb_pictures.picture([{**document["cases"][0], "rows": []}])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"verbs": ["focus"]}, "focus"),
        ({"sizes": [7]}, r"sizes\[0\] is 7"),
        ({"tolerances": [1e-2, 0]}, r"tolerances\[1\] is 0"),
        ({"repeats": 0}, "repeats is 0"),
        ({"limit": 0}, "limit is 0"),
        ({"patience": -1}, "patience is -1"),
    ],
)
def test_bad_input_is_found_before_the_work(options, said):
    with pytest.raises(ValueError, match=said):
        verbs.run(**options)


def test_a_tolerance_has_one_marker_and_one_size_has_no_panel_of_sizes(monkeypatch):
    drawn = []
    monkeypatch.setattr(plots, "png", lambda figure, *_: drawn.append(figure))

    def case(n):
        rows = [
            {
                "who": "sarcl",
                "device": "d",
                "method": "direct",
                "setting": setting,
                "error": error,
                "seconds": {"form": [1.0], "cpu": [n]},
            }
            for setting, error in (("1e-01", 0.05), ("1e-03", 5e-4))
        ]
        return {"scene": "task", "words": "a task", "n": n, "rows": rows}

    verb_pictures.picture([case(8)])
    verb_pictures.picture([case(8), case(16)])
    assert [len(figure.axes) for figure in drawn] == [1, 2]
    for figure in drawn:
        marks = [{line.get_label(): line.get_marker() for line in axes.get_lines()} for axes in figure.axes]
        named = [{name: mark for name, mark in panel.items() if name[0] != "_"} for panel in marks]
        assert all(panel == {"direct, d at 1e-1": "o", "direct, d at 1e-3": "s"} for panel in named)
        legends = [axes.get_legend() is not None for axes in figure.axes]
        assert legends == [False] * (len(legends) - 1) + [True]


def test_the_command_writes_a_picture_for_each_verb_and_the_page_is_made_from_its_file(tmp_path, capsys):
    results, docs = tmp_path / "results", tmp_path / "docs"
    results.mkdir(), docs.mkdir()
    options = ["--verbs", "polar format", "--sizes", "16", "32", "--tolerances", "1e-2", "--repeats", "1"]
    options += ["--devices", "cpu", "--json", str(results / "0.json"), "--picture", str(tmp_path / "x.png")]
    assert parser.main(["bench", *options]) == 0
    assert (tmp_path / "x-polar-format.png").stat().st_size > 1000 and "M/s" in capsys.readouterr().out
    assert json.loads((results / "0.json").read_text())["kind"] == "verbs"
    names = [path.name for path in page.write(results, docs)]
    assert names == ["results-polar-format.png", "results.md", "results_images.md", "results_echoes.md"]
    text = (docs / "results.md").read_text()
    assert text.index("results-polar-format.png") < text.index("## polar format") < text.index("| sarcl")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["verbs", "--methods", "direct"], "--methods is not for sarcl bench verbs"),
        (["backproject", "--quick"], "--quick is not for sarcl bench backproject"),
        (["--verbs", "focus"], "'focus'"),
        (["--picture", "/no/such/folder/x.png"], "there is no folder"),
    ],
)
def test_options_of_the_other_kind_end_in_one_line(options, said, capsys):
    assert parser.main(["bench", *options]) == parser.BAD_INPUT
    assert said in capsys.readouterr().err
