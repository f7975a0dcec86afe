"""Random legal tasks: each is drawn from one number, run in a process of its own kind, and judged.

    refused   an error that a `raise` of sarcl made, of a kind that users can act on, in words that name an argument
    right     within its tolerance of the float64 reference, or as a law says where there is no reference
    wrong     anything else that comes back: also a number that is not finite
    bare      another error, or a warning of NumPy's
    crashed, hung   the process ended, or went on for PATIENCE seconds

`python -m helpers.tasks SEED`, from the folder tests, runs one with its traceback.
"""

from __future__ import annotations

import ast
import functools
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl.scattering import facet_plan

ROOT = Path(sarcl.__file__).resolve().parent
PATIENCE = 30.0  # CPU seconds for a task, which takes a few tenths; HUNG: seconds on the clock of a loaded machine
HUNG = 600
WORKER = ["-m", "helpers.tasks"]
REFUSALS = (ValueError, TypeError, OSError, MemoryError)
# words of numpy, scipy and Python that a message of sarcl's must not have
FOREIGN = (
    "Unable to allocate", "inhomogeneous", "setting an array element", "matmul", "__init__", "truth value",
    "could not convert", "broadcast", "unsupported operand", "not iterable", "not subscriptable", "unhashable",
    "has no attribute", "missing 1", "float()", "too large to convert", "must be real", "only length-1",
    "please report",
)  # fmt: skip


ratios: list[float] = []  # errors over what was allowed, of the task that runs: bench/contract_trial.py reads them


class Wrong(Exception):
    """A result that is not what the reference or a law says."""


class Draw:
    """Random choices of one task, all from its number."""

    def __init__(self, seed: int) -> None:
        self.seed, self.random = seed, np.random.default_rng(seed)

    def chance(self, probability: float) -> bool:
        return bool(self.random.random() < probability)

    def log(self, low: float, high: float) -> float:
        """A number whose logarithm is evenly distributed."""
        return float(np.exp(self.random.uniform(np.log(low), np.log(high))))

    def uniform(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def whole(self, low: int, high: int) -> int:
        """A whole number, both ends included; small ones as often as large ones."""
        return int(min(high, np.floor(self.log(low, high + 1))))

    def pick(self, *options: Any) -> Any:
        return options[int(self.random.integers(len(options)))]

    def some(self, *options: Any) -> list[Any]:
        return [one for one in options if self.chance(0.5)]

    def normal(self, *shape: int) -> np.ndarray:
        return self.random.standard_normal(shape)

    def noise(self, *shape: int) -> np.ndarray:
        return self.normal(*shape) + 1j * self.normal(*shape)


def expect(holds: Any, text: str) -> None:
    """Wrong with this text unless `holds`."""
    if not holds:
        raise Wrong(text)


def near(found: Any, wanted: Any, allowed: float, scale: float | None = None, what: str = "result") -> None:
    """Wrong unless the L2 norm of the difference is at most `allowed` of `scale`, by default of the norm wanted."""
    found, wanted = (np.asarray(values).astype(np.complex128) for values in (found, wanted))  # squares fit
    expect(found.shape == wanted.shape, f"{what} has shape {found.shape}, wanted {wanted.shape}")
    finite(found, what)
    size = float(np.linalg.norm(wanted)) if scale is None else scale
    off = float(np.linalg.norm((found - wanted).ravel()))
    note(off, allowed * size)
    expect(off <= allowed * size * (1 + 1e-9), f"{what} is off by {off / (size or 1):.3g}, allowed {allowed:.3g}")


def note(error: float, allowed: float) -> None:
    """Keep the ratio of an error to what is allowed, unless nothing is."""
    if allowed > 0:
        ratios.append(error / allowed)


def finite(values: Any, what: str = "result") -> None:
    expect(np.isfinite(np.asarray(values)).all(), f"{what} is not finite")


def within_report(made: Any, tolerance: float) -> None:
    """Wrong unless errors are in the order measured, predicted, tolerance."""
    report = made.report
    expect(report.predicted_error <= tolerance * (1 + 1e-9), f"predicted {report.predicted_error} above {tolerance}")
    if report.measured_error is not None:
        note(report.measured_error, tolerance)
        expect(report.measured_error <= tolerance * (1 + 1e-9), f"measured {report.measured_error} above {tolerance}")


def families() -> dict[str, tuple[int, Callable[[Draw], None]]]:
    """Verbs with how often each is drawn, and the function that draws, runs and judges one task."""
    from . import echo_tasks, image_tasks, model_tasks

    return {**image_tasks.VERBS, **echo_tasks.VERBS, **model_tasks.VERBS}


@functools.cache
def _raises(path: str) -> list[tuple[int, int]]:
    """First and last lines of the `raise` statements of a file."""
    nodes = (n for n in ast.walk(ast.parse(Path(path).read_text())) if isinstance(n, ast.Raise) and n.exc is not None)
    return [(n.lineno, n.end_lineno or n.lineno) for n in nodes]


def outcome(exc: BaseException) -> tuple[str, str]:
    """What an exception is, "refused", "wrong" or "bare", and its text."""
    text = f"{type(exc).__name__}: {exc}"
    if isinstance(exc, (Wrong, sarcl.ToleranceMissed)):
        return "wrong", text
    last = traceback.extract_tb(exc.__traceback__)[-1]
    own = Path(last.filename).resolve().is_relative_to(ROOT) and any(
        a <= (last.lineno or 0) <= b for a, b in _raises(last.filename)
    )
    worded = not any(words in str(exc) for words in FOREIGN) and len(str(exc)) > 20
    if isinstance(exc, REFUSALS) and own and worded:
        return "refused", text
    return "bare", f"{text} ({Path(last.filename).name}:{last.lineno})"


def verb_of(seed: int) -> str:
    """The verb of a task."""
    known = families()
    shares = np.array([share for share, _ in known.values()], float)
    return list(known)[int(np.random.default_rng([seed, 1]).choice(len(known), p=shares / shares.sum()))]


def one(seed: int, raises: bool = False) -> dict[str, Any]:
    """Run a task: its verb, outcome, text and CPU seconds."""
    verb, start = verb_of(seed), time.process_time()
    said = {"seed": seed, "verb": verb, "outcome": "right", "text": ""}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            families()[verb][1](Draw(seed))
    except Exception as exc:
        if raises:
            traceback.print_exc()
        said["outcome"], said["text"] = outcome(exc)
    return {**said, "seconds": time.process_time() - start}


def work(seeds: Iterable[int]) -> None:
    """Run tasks, a line of JSON for each. A task that takes too long ends the process by a signal."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    facet_plan.MOST_FACETS = 20_000  # so that a scene is refused which would take minutes
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        for seed in seeds:
            signal.setitimer(signal.ITIMER_PROF, PATIENCE)
            signal.alarm(HUNG)
            start = os.lseek(2, 0, os.SEEK_END)
            line = one(seed)
            text = os.pread(2, 2000, start).decode(errors="replace")
            if re.search("errors? generated", text):
                line |= {"outcome": "bare", "text": f"{line['outcome']}, and a compiler says: {text}"}
            print(json.dumps(line), flush=True)
            signal.alarm(0)


def run(seeds: range, seconds: float = float("inf")) -> list[dict[str, Any]]:
    """The tasks of these numbers, in processes that are started again after a crash; fewer after `seconds` of CPU."""
    found: list[dict[str, Any]] = []
    while len(found) < len(seeds) and sum(line["seconds"] for line in found) < seconds:
        todo = seeds[len(found) :]
        command = [sys.executable, *WORKER, str(todo.start), str(todo.stop)]
        with subprocess.Popen(command, cwd=Path(__file__).parents[1], stdout=subprocess.PIPE, text=True) as worker:
            assert worker.stdout is not None
            for line in worker.stdout:
                found.append(json.loads(line))
                if sum(x["seconds"] for x in found) >= seconds:
                    worker.kill()
                    return found
            status = worker.wait()
        if status:
            ended = "hung" if -status in (signal.SIGALRM, signal.SIGPROF) else "crashed"
            seed = todo[len(found) - (len(seeds) - len(todo))]
            found.append(
                {"seed": seed, "verb": verb_of(seed), "outcome": ended, "text": f"status {status}", "seconds": PATIENCE}
            )
    return found


def table(found: list[dict[str, Any]]) -> str:
    """Counts by verb and outcome, and what is neither right nor refused."""
    kinds = ("right", "refused", "wrong", "bare", "crashed", "hung")
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for line in found:
        for verb in (line["verb"], "all"):
            counts[verb][line["outcome"]] += 1
    rows = [f"{'':20}" + "".join(f"{kind:>9}" for kind in kinds)]
    rows += [f"{verb:20}" + "".join(f"{counts[verb][kind]:9}" for kind in kinds) for verb in sorted(counts)]
    bad = [line for line in found if line["outcome"] not in ("right", "refused")]
    rows += [f"seed {x['seed']}, {x['verb']}: {x['outcome']}: {x['text']}" for x in bad]
    return "\n".join([*rows, f"{sum(x['seconds'] for x in found):.0f} CPU s"])


if __name__ == "__main__":
    from helpers import tasks  # the module that the families import, not this second copy of it

    numbers = [int(word) for word in sys.argv[1:]]
    if len(numbers) == 1:
        print(tasks.one(numbers[0], raises=True))
    else:
        tasks.work(range(*numbers))
