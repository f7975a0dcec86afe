"""Competitors run in turns, so that other load of the machine affects all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import ToleranceMissed, ToleranceUnreachable
from . import exact
from ._cases import BenchCase
from ._competitor import Absent, Competitor, Reading
from ._verb_cases import VerbCase

WARM = 10.0  # s; a first run counts only if it is longer, because it may build kernels, and if it checks nothing
PROCESSES = 3  # runs of a whole process, at most
LONG = 20.0  # s; where a call is longer, a whole process takes about as long and is not timed
LOOK = 0.2  # s over which the idle share is measured
ENOUGH = 0.93  # share of the processors' time that must be idle
TELLING = 0.5  # s; the pace of a shorter call does not predict larger cases

Row = dict[str, Any]
Paces = dict[tuple[str, str, str, str], float]  # (who, device, method, setting) -> seconds a pair


def alternate(*groups: Sequence[Competitor]) -> list[Competitor]:
    """One of each group in turn: sarcl, peer, sarcl, peer ..."""
    return [c for c in chain.from_iterable(zip_longest(*groups)) if c is not None]


def measure(
    case: BenchCase | VerbCase,
    competitors: Sequence[Competitor],
    *,
    repeats: int,
    limit: float,
    paces: Paces,
    patience: float = 0.0,
    tick: Callable[[int, int], None] = lambda done, total: None,
) -> list[Row]:
    """A row of measurements for every competitor, in the order given; all run once, then all again, `repeats` times.

    limit     s; a run expected to last longer is left out, and a long run is repeated less often
    paces     seconds per pair of pulse and pixel, from smaller cases; this case is added
    patience  s to wait before each run until the machine is idle; "disturbed" of a row counts runs that began while
              it was not idle
    tick      called as tick(runs done, runs there will be at most)

    A row has who, device, method, setting and the competitor's facts; then either "absent" with the reason, or
    error, error_of_image, and seconds: name -> one entry per run. Whole processes are timed after the rest, up to
    PROCESSES times, where the call lasts less than LONG.
    """
    rows: list[Row] = [
        {"who": c.who, "device": c.device, "method": c.method, "setting": c.setting, **c.facts, "seconds": {}}
        for c in competitors
    ]
    processes = min(repeats, PROCESSES)
    total, done = len(rows) * (repeats + 1 + processes), 0
    for round_ in range(repeats + 1):
        for row, competitor in zip(rows, competitors, strict=True):
            done += 1
            tick(done, total)
            if "absent" in row or _spent(row, competitor.share, repeats, limit):
                continue
            if not wait_idle(patience):
                row["disturbed"] = row.get("disturbed", 0) + 1
            try:
                _take(row, competitor, case, limit, paces, warm=round_ == 0)
            except (Absent, ToleranceUnreachable, ToleranceMissed, MemoryError) as exc:
                row["absent"] = " ".join(str(exc).split())
    for _ in range(processes):
        for row, competitor in zip(rows, competitors, strict=True):
            done += 1
            tick(done, total)
            if "absent" not in row:
                wait_idle(patience)
            _take_process(row, competitor)
    for row in rows:
        calls = row["seconds"].get("call", [0.0])
        if min(calls) > TELLING:
            paces[_key(row)] = min(calls) / case.pairs
    return rows


def _spent(row: Row, share: float, repeats: int, limit: float) -> bool:
    """Whether the competitor ran often enough, or its next run would exceed the limit."""
    runs = row["seconds"].get("call", [])
    return len(runs) >= repeats or (bool(runs) and (sum(runs) + min(runs)) * share > limit)


def _take(row: Row, competitor: Competitor, case: BenchCase | VerbCase, limit: float, paces: Paces, warm: bool) -> None:
    """Run once and record it in the row."""
    expected = case.pairs * paces.get(_key(row), 0.0)
    if warm and expected > limit:
        raise Absent(f"about {expected:.0f} s at the pace so far, more than --limit {limit:g}")
    reading = competitor.run()
    if warm:
        _judge(row, competitor, case, reading)
        if reading.errors is not None or reading.seconds["call"] < WARM:
            return
    for name, value in reading.seconds.items():
        row["seconds"].setdefault(name, []).append(value / competitor.share)


def _key(row: Row) -> tuple[str, str, str, str]:
    return row["who"], row["device"], row["method"], row["setting"]


def _take_process(row: Row, competitor: Competitor) -> None:
    """Time a whole process and record it in the row."""
    if "absent" in row or "no_process" in row or competitor.process is None or min(row["seconds"]["call"]) > LONG:
        return
    try:
        row["seconds"].setdefault("process", []).append(competitor.process())
    except Absent as exc:
        row["no_process"] = str(exc)


def _judge(row: Row, competitor: Competitor, case: BenchCase | VerbCase, reading: Reading) -> None:
    """Record the errors of a run and what it reports."""
    if reading.errors is not None:
        row["error"], row["error_of_image"] = reading.errors
    else:
        assert isinstance(case, BenchCase)  # readings of other cases have their errors
        exact_values = competitor.check or (case.wanted, case.norm)
        row["error"], row["error_of_image"] = exact.relative(reading.values, *exact_values)
    if not np.isfinite(row["error"]):
        raise Absent("its result holds NaN or Inf")
    row.update(reading.notes)


def wait_idle(patience: float) -> bool:
    """Wait up to `patience` s until the machine is idle; True when it is, or where the system does not say."""
    end = time.monotonic() + patience
    while patience > 0:
        before = _idle_and_all()
        if before is None:
            return True
        time.sleep(LOOK)
        after = _idle_and_all()
        if after is None or after[0] - before[0] >= ENOUGH * (after[1] - before[1]):
            return True
        if time.monotonic() > end:
            return False
    return True


def _idle_and_all() -> tuple[int, int] | None:
    """Clock ticks of all processors since the system started: idle, total; None where the system does not say."""
    try:
        ticks = [int(v) for v in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    except (OSError, ValueError):
        return None
    return ticks[3] + ticks[4], sum(ticks[:8])
