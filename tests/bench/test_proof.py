"""docs/guide/proof.md: what the files of bench/results say now, faults of the trials included."""

from __future__ import annotations

import copy
from pathlib import Path

import contract_trial
import proof_page
import pytest
from helpers import tasks

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def measured():
    return proof_page.read(ROOT / "bench" / "results")


def test_the_page_is_that_of_the_files(measured):
    text = (ROOT / "docs" / "guide" / proof_page.PAGE).read_text()
    assert text == proof_page.page(measured), "out of date; run make results"
    assert text.count("\n") <= 300
    names = [name for name, _ in proof_page.pictures(measured)]
    assert names and all(f"({name})" in text and (ROOT / "docs" / "guide" / name).exists() for name in names)


def test_a_task_that_failed_stands_on_the_page_and_is_not_held(measured):
    changed = copy.deepcopy(measured)
    entry = changed["contract"]["verbs"]["backproject"]
    before = proof_page.held(entry)
    entry["ratios"].append(1.7)
    entry["failures"].append({"seed": 2000007, "outcome": "wrong", "text": "Wrong: image is off", "ratio": 1.7})
    text = proof_page.page(changed)
    assert f"| backproject | {before} of {before + 1} | 1.7 |" in text
    assert "- backproject, number 2000007: wrong: Wrong: image is off" in text
    assert "largest error 1.70 of the tolerance" in text


def test_a_trial_continues_where_its_file_ends_and_counts_what_is_wrong(monkeypatch, tmp_path):
    seen, wrong = [], {1, 5, 6}

    def task(draw):
        seen.append(draw.seed)
        if draw.seed in wrong - {6}:
            raise tasks.Wrong("no result")
        tasks.near([1.1 if draw.seed in wrong else 1.02], [1.0], 0.04)

    monkeypatch.setattr(contract_trial, "VERBS", {"verb": (task,)})
    monkeypatch.setattr(contract_trial, "STEP", 4)
    contract_trial.run(tmp_path / "a.json", 3, ["verb"], 60.0)
    entry = contract_trial.run(tmp_path / "a.json", 6, ["verb"], 60.0)["verbs"]["verb"]
    assert seen == [0, 1, 2, 3, 1, 4, 5, 6, 7] and entry["tried"] == 8
    assert [(f["seed"], f["outcome"]) for f in entry["failures"]] == [(1, "wrong"), (5, "wrong"), (6, "wrong")]
    assert entry["ratios"] == [0.5] * 4 + [2.5, 0.5] and proof_page.held(entry) == contract_trial.held(entry) == 5
    wrong -= {1, 6}
    contract_trial.try_again(entry, "verb")
    assert [f["seed"] for f in entry["failures"]] == [5] and [f["seed"] for f in entry["mended"]] == [1, 6]
    assert sorted(entry["ratios"]) == [0.5] * 7 and proof_page.held(entry) == 7
