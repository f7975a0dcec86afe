"""Contestants take turns, so that what else the machine does falls on all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain, zip_longest
from typing import Any

import numpy as np

from ..base.errors import ToleranceMissed, ToleranceUnreachable
from . import _quiet
from ._cases import Case
from ._contestant import Absent, Contestant, Reading

WARM = 10.0  # s: a first run that is shorter is repeated, a longer one counts (kernels are built in a second or so)
PROCESSES = 3
LONG = 20.0  # s: a whole process that lasts longer differs little from its call
TELLING = 0.5  # s: shorter calls say nothing of larger cases

Row = dict[str, Any]
Paces = dict[tuple[str, str, str, str], float]  # (who, device, method, setting) -> seconds a pair


def alternate(*groups: Sequence[Contestant]) -> list[Contestant]:
    """One of each group in turn: ours, theirs, ours, theirs ..."""
    return [c for c in chain.from_iterable(zip_longest(*groups)) if c is not None]


def measure(
    case: Case,
    contestants: Sequence[Contestant],
    *,
    repeats: int,
    limit: float,
    paces: Paces,
    patience: float = 0.0,
    tick: Callable[[int, int], None] = lambda done, total: None,
) -> list[Row]:
    """A row of figures for every contestant, in the order given; all run once, then all again, `repeats` times.

    limit     s: a run expected to last longer is left out, and one that lasts long is repeated less often
    paces     as measured in smaller cases; added to
    patience  s to wait before each run until the machine is idle; the row's "disturbed" counts runs begun while
              it was not
    tick      called as tick(runs done, runs there will be at most)

    A row has who, device, method, setting and the contestant's facts; then either "absent" with the reason, or
    error, error_of_image, and seconds: name -> one entry a run. Whole processes are timed after the rest, up to
    PROCESSES times, where the call lasts less than LONG.
    """
    rows: list[Row] = [
        {"who": c.who, "device": c.device, "method": c.method, "setting": c.setting, **c.facts, "seconds": {}}
        for c in contestants
    ]
    processes = min(repeats, PROCESSES)
    total, done = len(rows) * (repeats + 1 + processes), 0
    for round_ in range(repeats + 1):
        for row, contestant in zip(rows, contestants, strict=True):
            done += 1
            tick(done, total)
            if "absent" in row or _spent(row, contestant.share, repeats, limit):
                continue
            if not _quiet.wait(patience):
                row["disturbed"] = row.get("disturbed", 0) + 1
            try:
                _take(row, contestant, case, limit, paces, warm=round_ == 0)
            except (Absent, ToleranceUnreachable, ToleranceMissed, MemoryError) as exc:
                row["absent"] = " ".join(str(exc).split())
    for _ in range(processes):
        for row, contestant in zip(rows, contestants, strict=True):
            done += 1
            tick(done, total)
            if "absent" not in row:
                _quiet.wait(patience)
            _take_process(row, contestant)
    for row in rows:
        calls = row["seconds"].get("call", [0.0])
        if min(calls) > TELLING:
            paces[_key(row)] = min(calls) / case.pairs
    return rows


def _spent(row: Row, share: float, repeats: int, limit: float) -> bool:
    """Nothing more to run: often enough, or the next run would pass the limit."""
    runs = row["seconds"].get("call", [])
    return len(runs) >= repeats or (bool(runs) and (sum(runs) + min(runs)) * share > limit)


def _take(
    row: Row,
    contestant: Contestant,
    case: Case,
    limit: float,
    paces: Paces,
    warm: bool,
) -> None:
    """Run once and note it in the row."""
    expected = case.pairs * paces.get(_key(row), 0.0)
    if warm and expected > limit:
        raise Absent(f"about {expected:.0f} s at the pace so far, more than --limit {limit:g}")
    reading = contestant.run()
    if warm:
        _judge(row, contestant, case, reading)
        if reading.seconds["call"] < WARM:
            return
    for name, value in reading.seconds.items():
        row["seconds"].setdefault(name, []).append(value / contestant.share)


def _key(row: Row) -> tuple[str, str, str, str]:
    return row["who"], row["device"], row["method"], row["setting"]


def _take_process(row: Row, contestant: Contestant) -> None:
    """Time a whole process and note it in the row."""
    if "absent" in row or "no_process" in row or contestant.process is None or min(row["seconds"]["call"]) > LONG:
        return
    try:
        row["seconds"].setdefault("process", []).append(contestant.process())
    except Absent as exc:
        row["no_process"] = str(exc)


def _judge(row: Row, contestant: Contestant, case: Case, reading: Reading) -> None:
    """Note the errors of a run and what it says of itself."""
    if contestant.check is None:
        row["error"], row["error_of_image"] = case.errors(reading.values)
    else:
        wanted, norm = contestant.check
        wrong, own = float(np.linalg.norm(reading.values - wanted)), float(np.linalg.norm(wanted))
        row["error"], row["error_of_image"] = wrong / max(own, norm), wrong / own
    if not np.isfinite(row["error"]):
        raise Absent("its image holds NaN or Inf")
    row.update(reading.notes)
