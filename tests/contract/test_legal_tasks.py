"""Random legal tasks over all verbs: right, or refused in words; never a bare error, NaN, crash or hang.

`make tasks` runs the long part: SARCL_TASKS of them (10000), from SARCL_TASKS_SEED on (random, printed). The tests run
the same ones each time: a few, and where CI is set as many as SECONDS of CPU allow. A failure names its number:
`python -m helpers.tasks NUMBER`, in the folder tests, repeats it.
"""

from __future__ import annotations

import os
import signal
from collections import Counter

import numpy as np
import pytest
from helpers import tasks

pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers that end a task")
SECONDS = 30.0  # of CPU, in CI
FIRST, FEW = 2000, 8  # number of the first task, and how many run elsewhere
FEWEST_RIGHT = 0.6  # share of tasks that are done, not refused: else they would try nothing


def hold(seeds, seconds=float("inf")):
    found = tasks.run(seeds, seconds)
    print(f"tasks from {seeds.start}\n{tasks.table(found)}")
    assert not [line for line in found if line["outcome"] not in ("right", "refused")], tasks.table(found)
    return found


def test_random_legal_tasks_are_right_or_refused_in_words():
    wanted = os.environ.get("SARCL_TASKS")
    first = os.environ.get("SARCL_TASKS_SEED") or (int.from_bytes(os.urandom(4), "little") if wanted else FIRST)
    within = SECONDS if os.environ.get("CI") and not wanted else float("inf")
    number = int(wanted or (1000 if within == SECONDS else FEW))
    found = hold(range(int(first), int(first) + number), within)
    counts = Counter(line["outcome"] for line in found)
    assert counts["right"] >= FEWEST_RIGHT * len(found)


def test_the_harness_sees_what_is_wrong(monkeypatch):
    def wrong(draw):
        tasks.near([1.0, np.nan], [1.0, 2.0], 0.1)

    def off(draw):
        tasks.near([1.0, 2.5], [1.0, 2.0], 0.1)

    def foreign(draw):
        np.zeros(3) @ np.zeros(4)

    def warned(draw):
        np.float64(1) / np.float64(0)

    def refused(draw):
        tasks.sarcl.Trajectory.line(start=(0, 0, 0), velocity=(1, 0, 0), prf=-1, n_pulses=3)

    families = {"wrong": wrong, "off": off, "foreign": foreign, "warned": warned, "refused": refused}
    monkeypatch.setattr(tasks, "families", lambda: {name: (1, verb) for name, verb in families.items()})
    found = {(line["verb"], line["outcome"]) for line in (tasks.one(seed) for seed in range(60))}
    assert found == {
        ("wrong", "wrong"), ("off", "wrong"), ("foreign", "bare"), ("warned", "bare"), ("refused", "refused"),
    }  # fmt: skip


def test_the_harness_sees_crashes_and_hangs_and_goes_on(monkeypatch, tmp_path):
    worker = tmp_path / "worker.py"
    worker.write_text(
        "import json, os, signal, sys\n"
        "for seed in range(int(sys.argv[-2]), int(sys.argv[-1])):\n"
        "    if seed == 2: os.kill(os.getpid(), signal.SIGSEGV)\n"
        "    if seed == 4: os.kill(os.getpid(), signal.SIGPROF)\n"
        "    line = {'seed': seed, 'verb': 'x', 'outcome': 'right', 'text': '', 'seconds': 0.1}\n"
        "    print(json.dumps(line), flush=True)\n"
    )
    monkeypatch.setattr(tasks, "WORKER", [str(worker)])
    found = tasks.run(range(6))
    assert [line["outcome"] for line in found] == ["right", "right", "crashed", "right", "hung", "right"]
    assert [line["seed"] for line in found] == list(range(6))
    assert len(tasks.run(range(1000), seconds=1.0)) < 20


def test_tasks_are_the_same_from_their_numbers():
    assert [tasks.verb_of(seed) for seed in range(20)] == [tasks.verb_of(seed) for seed in range(20)]
    assert tasks.Draw(3).normal(4).tolist() == tasks.Draw(3).normal(4).tolist() != tasks.Draw(4).normal(4).tolist()
