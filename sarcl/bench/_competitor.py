"""A program that is measured, and the result of one run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np


class Absent(Exception):
    """A competitor that cannot be measured; the message says why."""


@dataclass(frozen=True, eq=False)
class Reading:
    """One run.

    values   of the image at the case's checked pixels, complex (m,)
    seconds  "call": data in memory to finished image, preparation included;
             "form": the same without the preparation that a geometry needs once;
             "kernel": the part in the device's kernels, where it is known;
             "cpu": CPU seconds of all processors, of sarcl's call and of a peer's form; other programs hardly change it
    notes    what the program reports: plan, predicted error
    errors   error and error relative to |I|, of a task whose values are not those of a case's pixels
    """

    values: np.ndarray
    seconds: Mapping[str, float]
    notes: Mapping[str, Any] = field(default_factory=dict)
    errors: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Competitor:
    """One row of the table.

    who, device      library; name of the device, or of the peer's backend
    method, setting  "direct" or "factorized"; tolerance or options in words
    run              makes the image: Reading; raises Absent (or ToleranceUnreachable, for what cannot be met)
    process          seconds of a whole new process that makes the image; None where there is none
    facts            other entries of its row
    check            (wanted, norm) where the run is of fewer pulses than the case; None: the case's own
    share            share of the case's pulses that a run takes; its seconds are divided by it
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
