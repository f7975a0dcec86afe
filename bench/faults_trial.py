"""Faults survived, mutated files read, and wrong formulas noticed: counts of three searches, in one file.

    python bench/faults_trial.py faults|fuzz|mutants [--cases 100] [--sample 25] [--seed 0] [--seconds S]

faults   runs the tests that kill processes, fill disks, lose devices, take memory away or press Ctrl-C (FAULTS below)
fuzz     reads --cases mutated files of every format, numbered from --seed on: tests/io/test_fuzz.py
mutants  makes a random --sample of the wrong formulas of tests/mutants/mutations.toml, one after the other

Each part replaces its own entry of the file, which also holds the command.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
RESULT = ROOT / "bench" / "results" / "trials" / "faults.json"
# Fault -> parts of the names of tests
FAULTS = {
    "a process is killed, at any change of files": ("killed",),
    "the disk is full": ("full_disk", "disk_that_fills", "no_room", "full_folder", "cannot_be_finished"),
    "tiles or rows are damaged": (
        "damaged_tile",
        "damaged_job",
        "damaged_files_of",
        "damaged_file_is",
        "damaged_rows",
        "damaged_field",
        "bit_of_a_tile",
        "foreign_tile",
    ),
    "a device or a cluster's worker is lost": ("is_lost", "are_lost", "device_failed"),
    "memory is missing": ("finds_no_memory", "memory_too_small", "memory_holds", "memory_that_is", "more_memory_than"),
    "Ctrl-C or SIGTERM": ("ctrl_c", "sigterm", "interrupt", "stopped_write"),
}
TESTS = (
    "tests/imaging/test_checkpoint.py", "tests/imaging/test_devices_together.py", "tests/imaging/test_backproject.py",
    "tests/simulation/test_echo_blocks.py", "tests/simulation/test_echo_out.py", "tests/simulation/tracks",
    "tests/simulation/spectral/test_spectral_blocks.py", "tests/fullwave/test_run_blocks.py", "tests/cli/test_job.py",
    "tests/base/test_host_memory.py", "tests/io/test_hostile_files.py", "tests/io/test_files.py",
    "tests/model/test_labelled.py", "tests/linear/test_echoes.py", "tests/opencl/test_failures.py",
)  # fmt: skip


def pytest(*words: str, **variables: str) -> str:
    """What pytest prints."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | variables, capture_output=True, text=True)
    return done.stdout


def counts(text: str) -> dict[str, int]:
    """Tests that passed, failed and were skipped, from pytest's last line."""
    last = text.strip().splitlines()[-1]
    found = {name: int(n) for n, name in re.findall(r"(\d+) (passed|failed|skipped|error)", last)}
    return {"passed": found.get("passed", 0), "failed": found.get("failed", 0) + found.get("error", 0),
            "skipped": found.get("skipped", 0)}  # fmt: skip


def faults() -> dict[str, Any]:
    """Counts of the quick tests of every fault: one run of pytest."""
    words = [word for parts in FAULTS.values() for word in parts]
    said = pytest("-vv", "-k", " or ".join(words), *TESTS)
    verdicts = re.findall(r"^tests/\S+?::(\w+).*? (PASSED|FAILED|SKIPPED|ERROR)\b", said, flags=re.M)
    rows = []
    for fault, parts in FAULTS.items():
        own = [verdict for name, verdict in verdicts if any(part in name for part in parts)]
        rows.append({"fault": fault, **{v.lower(): own.count(v) for v in ("PASSED", "FAILED", "SKIPPED", "ERROR")}})
        print(rows[-1], flush=True)
    if not verdicts or counts(said)["passed"] != sum(row["passed"] for row in rows):
        raise RuntimeError(f"counts differ from pytest's: {said[-2000:]}")
    return {"rows": rows}


def fuzz(cases: int, seed: int) -> dict[str, Any]:
    """Outcomes of mutated files, by format."""
    said = pytest(
        "-m", "slow", "-s", "tests/io/test_fuzz.py", SARCL_FUZZ_CASES=str(cases), SARCL_FUZZ_SEED=str(seed)
    )  # fmt: skip
    found = re.findall(r"([\w.]+): (\d+) mutations from \d+: \{(.*?)\}", said)
    rows = [
        {
            "format": name.lstrip("."),
            "files": int(n),
            **{what: int(k) for what, k in re.findall(r"'([\w ]+)': (\d+)", outcome)},
        }
        for name, n, outcome in found
    ]
    print(*rows, sep="\n")
    return {"first": seed, "rows": rows, **counts(said)}


def mutants(sample: int, seed: int, seconds: float) -> dict[str, Any]:
    """Verdicts on a random sample of the list, fewer after `seconds` of the clock."""
    start = time.monotonic()
    spec = importlib.util.spec_from_file_location("run_mutants", ROOT / "tests" / "mutants" / "run.py")
    assert spec is not None and spec.loader is not None
    runner = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(runner)
    entries = runner.entries()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        copy = runner.copied(Path(folder))
        for entry in random.Random(seed).sample(entries, sample):
            if time.monotonic() - start > seconds:
                break
            word, took, said = runner.verdict(entry, copy, False)
            change = f"{' '.join(entry['old'].split())} -> {' '.join(entry['new'].split())}"
            rows.append({"file": entry["file"], "change": change, "verdict": word, "noticed by": said.split("\n")[0]})
            print(f"{word} {took:.0f} s {entry['file']}: {change}", flush=True)
    return {"seed": seed, "listed": len(entries), "rows": rows}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=["faults", "fuzz", "mutants"])
    parser.add_argument("--cases", type=int, default=100, help="mutated files of every format")
    parser.add_argument("--sample", type=int, default=25, help="wrong formulas")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="of the clock, for wrong formulas")
    parser.add_argument("--json", type=Path, default=RESULT)
    asked = parser.parse_args()
    if asked.part == "faults":
        entry, words = faults(), ""
    elif asked.part == "fuzz":
        entry, words = fuzz(asked.cases, asked.seed), f" --cases {asked.cases} --seed {asked.seed}"
    else:
        entry = mutants(asked.sample, asked.seed, asked.seconds)
        words = f" --sample {asked.sample} --seed {asked.seed} --seconds {asked.seconds:g}"
    document = json.loads(asked.json.read_text()) if asked.json.exists() else {"kind": "faults"}
    document[asked.part] = {"command": f"python bench/faults_trial.py {asked.part}{words}", **entry}
    asked.json.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
