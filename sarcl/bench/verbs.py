"""`sarcl bench`: every verb, run time against achieved error and against growing size, on tasks of its own."""

from __future__ import annotations

import functools
import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.validation import choice
from ..opencl.device import Device
from ._competitor import Competitor, Reading
from ._measure import Paces, measure
from ._run_sarcl import describe
from ._verb_cases import TASKS, VerbCase, VerbTask
from .documents import Document, Measuring, header, load

QUICK_TOLERANCES = 2  # of the tolerances of a verb, with quick
QUICK_REPEATS = 1
NOTHING = np.zeros(0)  # values of a reading whose errors the case has


@dataclass(frozen=True, kw_only=True)
class VerbSetting(Measuring):
    """What is measured, and how: sizes and tolerances are by default those of TASKS.

    verbs  names of TASKS, default all;  quick  small tasks, few tolerances, one run: at most 3 CPU minutes
    """

    verbs: Sequence[str] = tuple(TASKS)
    quick: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for verb in self.verbs:
            choice("verb", verb, tuple(TASKS))

    def cases(self) -> Iterator[tuple[VerbTask, VerbCase, Sequence[float]]]:
        """Each task with its cases in growing size, and the tolerances they are measured at."""
        for name in self.verbs:
            task = TASKS[name]
            tolerances = self.tolerances or (task.tolerances[:QUICK_TOLERANCES] if self.quick else task.tolerances)
            for n in sorted(set(self.sizes or (task.quick_sizes if self.quick else task.sizes))):
                yield task, task.make(name, n), tolerances


def run(
    *,
    say: Callable[[str], None] = lambda text: None,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
    keep: Callable[[Document], None] = lambda document: None,
    **options: Any,
) -> Document:
    """Measure; returns a document ready for JSON.

    say, progress  lines of text; progress(stage, done, total);  keep(document) is called after every case
    options        those of a VerbSetting. ValueError for what does not fit, before the work; NoDeviceError.
    """
    from . import tables

    setting = VerbSetting(**({"repeats": QUICK_REPEATS} if options.get("quick") else {}) | options)
    devices = setting.opened_devices()
    document: Document = {**header(devices), "kind": "verbs", "cases": []}
    for line in tables.machine_text(document):
        say(line)
    paces: dict[str, Paces] = {}  # of each verb
    for task, case, tolerances in setting.cases():
        rows = measure(
            case,
            list(competitors(task, case, devices, tolerances)),
            repeats=setting.repeats,
            limit=setting.limit,
            paces=paces.setdefault(case.scene, {}),
            patience=setting.patience,
            tick=functools.partial(progress, case.scene),
        )
        words = {"scene": case.scene, "data": "", "words": task.words, "unit": task.unit}
        document["cases"].append({**words, "n": case.n, "pairs": case.pairs, "rows": rows})
        document["machine"]["load"] = [document["machine"]["load"][0], *load()]
        keep(document)
        say("\n" + tables.text(document["cases"][-1]))
    say("\n" + tables.growth_text(document["cases"]))
    return document


def competitors(
    task: VerbTask, case: VerbCase, devices: Sequence[Device], tolerances: Sequence[float]
) -> Iterator[Competitor]:
    """sarcl on every device, by every method of the verb, at every tolerance."""
    for device, method, tolerance in itertools.product(devices, task.methods, tolerances):
        facts = {"tolerance": tolerance, "kind": device.info.kind, "fp64": device.info.fp64}
        yield Competitor(
            "sarcl", describe(device), method, f"{tolerance:.0e}", _runs(case, device, method, tolerance), None, facts
        )


def _runs(case: VerbCase, device: Device, method: str, tolerance: float) -> Callable[[], Reading]:
    """A function that computes the result and times it; its first run is compared with the exact result."""
    checks = itertools.chain([True], itertools.repeat(False))
    options = {"method": method} if method else {}

    def run() -> Reading:
        check = next(checks)
        start, busy = time.perf_counter(), time.process_time()
        result = case.call(tolerance=tolerance, device=device, check=check, **options)
        call, busy = time.perf_counter() - start, time.process_time() - busy
        report = getattr(result, "report", None)  # a beam is an array, without one
        notes = {} if report is None else {"predicted": report.predicted_error, "plan": dict(report.plan)}
        errors = case.compare(result) if check else None
        return Reading(NOTHING, {"call": call, "form": call, "cpu": busy}, notes, errors)

    return run
