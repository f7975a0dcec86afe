"""What takes part in a benchmark, and what a run of it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np


class Absent(Exception):
    """A contestant that cannot take part; the message says why."""


@dataclass(frozen=True, eq=False)
class Reading:
    """One run.

    values   of the image at the case's checked pixels, complex (m,)
    seconds  "call": data in memory to finished image, with whatever is worked out beforehand;
             "form": the same without what can be worked out once for a geometry;
             "kernel": of that in the device's kernels, where it is known;
             "cpu": of all processors together, of sarcl's call and a peer's form; other programs hardly touch it
    notes    what the run says of itself: plan, predicted error
    """

    values: np.ndarray
    seconds: Mapping[str, float]
    notes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Contestant:
    """One line of the table.

    who, device      library; name of the device, or of the peer's backend
    method, setting  "direct" or "factorized"; tolerance or options in words
    run              makes the image: Reading; raises Absent (or ToleranceUnreachable, for what cannot be met)
    process          seconds of a whole new process that makes the image, or None where there is no such
    facts            other columns of its row
    check            (wanted, norm) where the run is of fewer pulses than the case; None: the case's own
    share            of the case's pulses that a run takes: its seconds are divided by it
    """

    who: str
    device: str
    method: str
    setting: str
    run: Callable[[], Reading]
    process: Callable[[], float] | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)
    check: tuple[np.ndarray, float] | None = None
    share: float = 1.0
