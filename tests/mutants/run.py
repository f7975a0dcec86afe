"""Do the tests notice a wrong sign, unit or factor? Each entry of mutations.toml is made in a copy of the project.

    python tests/mutants/run.py [--only TEXT] [--jobs N] [--all]

An entry names a file, a text that occurs once in it, what that text is changed into, and the tests that must fail. It
is killed where at least one of them fails; it survives where all pass. Exit status 1: something survived, or the tests
could not be run. Only quick tests run, but for entries with slow = true; --all runs every test of the named files.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
LIST = Path(__file__).with_name("mutations.toml")
FAILED = 1  # pytest's exit status where tests ran and some failed
LONGEST = 900  # s for the tests of one entry


def entries() -> list[dict[str, Any]]:
    """The list: file, old, new, tests, and why; slow where a slow test notices it."""
    found: list[dict[str, Any]] = tomllib.loads(LIST.read_text())["mutation"]
    return found


def copied(to: Path) -> Path:
    """A copy of the project, without what git ignores."""
    names = subprocess.run(
        ["git", "ls-files", "-zco", "--exclude-standard"], cwd=ROOT, capture_output=True, check=True
    ).stdout.split(b"\0")
    for name in filter(None, map(os.fsdecode, names)):
        if (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)
    (to / "sarcl" / "kernels").symlink_to("../kernels")  # where the installed package has them
    return to


def verdict(entry: dict[str, Any], copy: Path, all_tests: bool) -> tuple[str, float, str]:
    """Killed, survived or not run; seconds; and the test that failed, or what pytest printed last."""
    path = copy / entry["file"]
    right = path.read_text()
    path.write_text(right.replace(entry["old"], entry["new"]))
    marks = ["-mslow or not slow"] if all_tests or entry.get("slow") else []
    started = time.monotonic()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *marks, *entry["tests"]],
            cwd=copy, env=os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LONGEST,
        )  # fmt: skip
        status, said = done.returncode, done.stdout
    except subprocess.TimeoutExpired as error:
        status, said = FAILED, f"{error}"  # an endless loop is noticed too
    finally:
        path.write_text(right)
    word = "killed" if status == FAILED else "survived" if status == 0 else "not run"
    lines = said.strip().splitlines()
    failed = [line.split(" - ")[0].split(" ", 1)[1] for line in lines if line.startswith("FAILED ")]
    return word, time.monotonic() - started, "\n".join(failed or lines[-4:])


def main() -> int:
    """Run the list, and print a line per entry."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="entries whose file or change holds this text")
    parser.add_argument("--jobs", type=int, default=max(1, (os.cpu_count() or 1) // 2))
    parser.add_argument("--all", action="store_true", help="slow tests of the named files too")
    asked = parser.parse_args()
    chosen = [e for e in entries() if asked.only in e["file"] + e["old"] + e["new"]]
    counts = {"killed": 0, "survived": 0, "not run": 0}
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(asked.jobs) as pool:
        copies: Queue[Path] = Queue()
        for n in range(asked.jobs):
            copies.put(copied(Path(scratch) / str(n)))

        def one(entry: dict[str, Any]) -> tuple[dict[str, Any], tuple[str, float, str]]:
            copy = copies.get()
            try:
                return entry, verdict(entry, copy, asked.all)
            finally:
                copies.put(copy)

        for entry, (word, seconds, said) in pool.map(one, chosen):
            counts[word] += 1
            change = f"{' '.join(entry['old'].split())}  ->  {' '.join(entry['new'].split())}"
            print(f"{word:9}{seconds:6.1f} s  {entry['file']}: {change}", flush=True)
            print("    " + said.replace("\n", "\n    "), flush=True)
    print(", ".join(f"{n} {word}" for word, n in counts.items()))
    return int(counts["killed"] < len(chosen) or not chosen)


if __name__ == "__main__":
    sys.exit(main())
