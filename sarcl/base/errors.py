"""Warnings and errors of the library, and where a warning points to."""

from __future__ import annotations

import math
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

from .text import tolerance_text

if TYPE_CHECKING:
    import numpy as np

    from ..model.image import Image
    from ..model.phase_history import PhaseHistory

# the folder of the whole package, wherever in it this file lies
_HERE = os.path.dirname(os.path.realpath(str(sys.modules[__name__.partition(".")[0]].__file__))) + os.sep


# topics that have been warned of, where each is to be warned of once
_TOPICS: ContextVar[set[str] | None] = ContextVar("topics", default=None)


# first text and number of the warnings of each topic, where they are counted
_COUNTS: ContextVar[dict[str, tuple[str, int]] | None] = ContextVar("counts", default=None)


class SarclWarning(UserWarning):
    """A warning about a result that is correct as it is.

    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", sarcl.SarclWarning)  # an error, for a script that must not go on
    ...     image = sarcl.backproject(raw, grid)
    """


@contextmanager
def warned_once() -> Iterator[None]:
    """Every topic of `warn` causes one warning at most until this context ends; an inner context changes nothing."""
    if _TOPICS.get() is not None:
        yield
        return
    token = _TOPICS.set(set())
    try:
        yield
    finally:
        _TOPICS.reset(token)


@contextmanager
def warned_together(of: str) -> Iterator[None]:
    """Every topic of `warn` causes one warning when this context ends, with the number of others of it, as `of` these.

    In it `warned_once` holds back what one of them repeats.
    """
    token = _COUNTS.set({})
    try:
        yield
    finally:
        counts = _COUNTS.get() or {}
        _COUNTS.reset(token)
        for text, number in counts.values():
            warn(text if number == 1 else f"{text} (and so of {number - 1} more {of})")


def warn(text: str, topic: str = "") -> None:
    """A SarclWarning that points at the line which called the library, however deep inside it is found.

    topic  what it is about, in a word: in `warned_once` nothing more is said of it; default the text
    """
    said = _TOPICS.get()
    if said is not None:
        if (topic or text) in said:
            return
        said.add(topic or text)
    counts = _COUNTS.get()
    if counts is not None:
        first, number = counts.get(topic or text, (text, 0))
        counts[topic or text] = first, number + 1
        return
    level, frame = 2, sys._getframe(1)
    while frame.f_back and os.path.realpath(frame.f_code.co_filename).startswith(_HERE):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, SarclWarning, stacklevel=level)


# measured over predicted error up to which the predicted terms explain the error, so that it falls with the tolerance
EXPLAINED = 2.0


class ToleranceMissed(ValueError):
    """The check of a finished image, or of finished echoes, measured an error above the tolerance.

    tolerance, measured  relative errors; measured is NaN where values of the result are not finite numbers
    image, raw, values   the finished Image or PhaseHistory, or numbers of `rcs`; the others are None
    raws                 of a list of tracks the finished PhaseHistories of all
    predicted            relative error that the error formulas predicted, None: unknown
    instead              what to do where a smaller tolerance may not help

    >>> try:
    ...     image = sarcl.backproject(raw, grid, tolerance=1e-3, check=True)
    ... except sarcl.ToleranceMissed as missed:
    ...     image = missed.image
    """

    def __init__(
        self,
        tolerance: float,
        measured: float,
        image: Image | None = None,
        raw: PhaseHistory | None = None,
        predicted: float | None = None,
        instead: str = "",
        values: np.ndarray | None = None,
    ) -> None:
        kept = "the image is kept: in its file, or in this error's .image"
        if values is not None:
            kept = "the numbers are kept in this error's .values"
        if raw is not None:
            kept = "the echoes are kept: in their file, or in this error's .raw"
        if not math.isfinite(measured):
            cause, remedies = "values of the result are not finite numbers", [instead]
        elif predicted is None or measured > EXPLAINED * predicted:
            cause = "part of the error is not predicted, and may remain at a smaller tolerance"
            remedies = [instead]
        else:
            cause = "these data are worse than the error formulas allow for"
            remedies = [f"ask for {tolerance**2 / measured / 2:.1e}"]
        advice = ", and ".join([*filter(None, remedies), "please report it"])
        super().__init__(f"tolerance {tolerance:.1e} was missed, {measured:.1e} measured: {cause}; {advice} ({kept})")
        self.tolerance, self.measured, self.image, self.raw = tolerance, measured, image, raw
        self.values = values
        self.raws: list[PhaseHistory] = []


def confirm_tolerance(*, image: Image | None = None, raw: PhaseHistory | None = None, instead: str = "") -> None:
    """ToleranceMissed where the check of a finished image, or of finished echoes, measured more than the tolerance.

    NaN and Inf are never within a tolerance: neither as errors, nor anywhere in the data of a result that was checked.

    instead  what to do where a smaller tolerance may not help
    """
    report, data = (image.report, image.data) if image is not None else (raw.report, raw.samples)  # type: ignore[union-attr]
    assert report is not None
    measured, tolerance = report.measured_error, report.tolerance
    if measured is None:
        return
    if measured <= tolerance and not _finite(data):
        measured = math.nan
    if not measured <= tolerance:
        raise ToleranceMissed(tolerance, measured, image, raw, report.predicted_error, instead)


def _finite(data: Any) -> bool:
    """Whether all values of an array, or of anything with shape and row slicing, are finite; read in parts."""
    import numpy as np

    n = max(1, 2**20 // max(1, math.prod(data.shape[1:]))) if len(data) else 1
    return all(np.isfinite(data[start : start + n]).all() for start in range(0, len(data), n))


class ToleranceUnreachable(ValueError):
    """A planner's refusal: no plan meets the tolerance. Planners alone raise it; callers catch it by this name.

    asked   the tolerance that was asked for: that of the user, where a verb raises this
    best    the smallest tolerance known to be met, rounded up: it can be asked for as it is; None: none is known
    limit   the term that limits the error, such as "float32 range profiles"
    remedy  what to do: pass the best tolerance, where nothing else is known to help
    how     what cannot meet the tolerance, in words, such as "in complex64"; default: the limit

    >>> try:
    ...     sarcl.echo(scene, chirp, track, tolerance=1e-9)
    ... except sarcl.ToleranceUnreachable as refusal:
    ...     samples = sarcl.echo(scene, chirp, track, tolerance=refusal.best).samples
    """

    def __init__(self, asked: float, best: float | None, limit: str, remedy: str = "", how: str = "") -> None:
        self.asked, self.limit, self.how, self._remedy = float(asked), limit, how, remedy
        self.best = None if best is None else float(best)
        text = f"tolerance {tolerance_text(self.asked)} cannot be met {how or f'here: the limit is {limit}'}"
        if self.best is not None:
            text += f"; the best here is {tolerance_text(self.best)}"
        if remedy:
            text += f"{';' if self.best is None else ':'} {remedy}"
        super().__init__(text)
        self.where = ""

    @property
    def remedy(self) -> str:
        if self._remedy or self.best is None:
            return self._remedy
        return f"pass tolerance={tolerance_text(self.best)} or larger"

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.asked, self.best, self.limit, self._remedy, self.how), {"where": self.where}

    def __str__(self) -> str:
        return " ".join(part for part in (self.where, super().__str__()) if part)

    def restated(self, asked: float, best: float | None, remedy: str | None = None) -> ToleranceUnreachable:
        """The same refusal for the tolerance `asked`, of which self.asked was a share."""
        return ToleranceUnreachable(asked, best, self.limit, self._remedy if remedy is None else remedy, self.how)

    def placed(self, where: str) -> ToleranceUnreachable:
        """The same refusal, its message after `where`: the file and line that asked for the tolerance."""
        out = self.restated(self.asked, self.best)
        out.where = " ".join(part for part in (where, self.where) if part)
        return out


class TooThin(ValueError):
    """Parts of a mesh are too thin for the cells of a grid; cell: the largest, m, that resolve them, None: none do."""

    def __init__(self, text: str, cell: float | None = None) -> None:
        super().__init__(text)
        self.cell = cell


class NothingSeen(ValueError):
    """No scatterer contributes to the echoes of these pulses. Other pulses may see some.

    Each scatterer lies outside the beam or the range window, lies in shadow, or faces away.
    """


class NotApplicable(ValueError):
    """A method does not apply to these data, whatever the tolerance; the message says why."""
