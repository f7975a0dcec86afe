"""Channels of an array: which carriers its elements send from where, and on which frequencies they are sampled."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import warn
from ..model.antenna_array import AntennaArray
from ..model.waveform import Waveform

EVEN = 1e-9  # of the carriers' spacing: what lies no further off its multiples is on them


@dataclass(frozen=True, eq=False)
class Channel:
    """What elements of one carrier and one place send, from pulse `first` to `stop`.

    elements  their numbers;  offset  their place, m (3,);  carrier  Hz;  weight  the sum of theirs, complex
    """

    elements: np.ndarray
    offset: np.ndarray
    carrier: float
    weight: complex
    first: int
    stop: int


def is_single(array: AntennaArray) -> bool:
    """One element at the reference point that sends the base frequency: no array at all."""
    return array.n == 1 and not (array.positions.any() or array.offsets.any()) and array.weights[0] == 1


def channels_of(array: AntennaArray, center: float, n_pulses: int, merge: bool = True) -> list[Channel]:
    """Channels of an array about a base frequency, Hz; equal ones are one (merge), or each is by itself.

    ValueError for carriers of 0 Hz or less.
    """
    low = center + float(array.offsets.min())
    if low <= 0:
        at, element = divmod(int(array.offsets.argmin()), array.n)
        raise ValueError(
            f"element {element} would send at {low:g} Hz (offset {array.offsets[at, element]:g} Hz about "
            f"{center:g} Hz); carriers must be positive: raise the waveform's center or lower frequency_step"
        )
    out = []
    for plan, first, stop in _runs(array, n_pulses):
        keys = np.column_stack([array.offsets[plan], array.positions])
        keys = keys if merge else np.arange(array.n)[:, None]
        _, start, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        for group in np.argsort(start, kind="stable").tolist():
            elements = np.flatnonzero(index.ravel() == group)
            one = int(elements[0])
            carrier = center + float(array.offsets[plan, one])
            weight = complex(array.weights[elements].sum())
            out.append(Channel(elements, array.positions[one], carrier, weight, first, stop))
    return out


def _runs(array: AntennaArray, n_pulses: int) -> Iterator[tuple[int, int, int]]:
    """(plan, first, stop) of pulses that follow one another under one plan."""
    if array.plan is None:
        yield 0, 0, n_pulses
        return
    if len(array.plan) != n_pulses:
        raise ValueError(
            f"the array's plan names {len(array.plan)} pulses but the track has {n_pulses}; give one entry a pulse"
        )
    ends = [0, *(np.flatnonzero(np.diff(array.plan)) + 1).tolist(), n_pulses]
    for first, stop in pairwise(ends):
        yield int(array.plan[first]), first, stop


def spacing(carriers: np.ndarray) -> float | None:
    """The step that carriers, Hz (n,), are whole multiples of apart; None where there is none, or one carrier."""
    steps = np.diff(np.unique(carriers))
    if len(steps) == 0:
        return None
    step = float(steps.min())
    rounds = np.rint(steps / step)
    step = float(steps.sum() / rounds.sum())
    return step if (np.abs(steps - rounds * step) <= EVEN * steps.sum()).all() else None


@dataclass(frozen=True)
class Sampling:
    """Samples frequency + i step, Hz, i < n; `width` of them belong to one channel, about its carrier."""

    frequency: float
    step: float
    n: int
    width: int

    def part(self, carrier: float) -> slice:
        """The samples of a channel."""
        first = round((carrier - self.frequency) / self.step - (self.width - 1) / 2)
        return slice(max(first, 0), min(first + self.width, self.n))

    def holds(self, carriers: Iterable[float]) -> bool:
        """Whether the samples of each channel alone are among these."""
        places = (np.fromiter(carriers, float) - self.frequency) / self.step - (self.width - 1) / 2
        inside = (places > -0.5) & (places + self.width < self.n + 0.5)
        return bool((inside & (np.abs(places - np.rint(places)) < 1e-6)).all())

    def of(self, carrier: float) -> Sampling:
        """Samples of one channel alone."""
        return replace(self, frequency=carrier - (self.width - 1) / 2 * self.step, n=self.width)


def sampling(carriers: np.ndarray, waveform: Waveform, near: float, far: float, compressed: bool) -> Sampling:
    """Frequencies of all carriers, Hz (n,), so fine that a range window (near, far), m, does not repeat.

    Where carriers are evenly spaced each lies on a sample. A tone is sampled no further than halfway to the next
    carrier; if it is as long as 1/spacing, and so is the window, that is one sample a channel.
    """
    period = 4 * max(abs(near), abs(far)) / SPEED_OF_LIGHT
    if not compressed:
        period += waveform.duration
    low, high, apart = float(carriers.min()), float(carriers.max()), spacing(carriers)
    own = waveform.bandwidth if apart is None or waveform.kind != "tone" else min(waveform.bandwidth, apart)
    if apart is None:
        n = max(1, int(np.ceil(period * (high - low + own) * (1 - 1e-12))))
        step = (high - low + own) / n
        width = max(1, round(own / step))
        return Sampling(low - own / 2 + step / 2, step, n, n if high == low else width)
    parts = max(1, int(np.ceil(period * apart * (1 - 1e-9))))
    step = apart / (parts + 1 - parts % 2)  # odd: carriers lie on samples, and bands end between them
    width = max(1, int(np.ceil(own / step * (1 - 1e-9))))
    width += 1 - width % 2
    return Sampling(low - (width - 1) / 2 * step, step, round((high - low) / step) + width, width)


def warn_of(array: AntennaArray, waveform: Waveform, carriers: np.ndarray) -> None:
    """SarclWarnings of what these channels cannot tell apart, or do not focus."""
    apart = spacing(carriers)
    if apart is not None and waveform.duration * apart > 1 + 1e-9:
        warn(
            f"the pulse of {waveform.duration:.4g} s is longer than 1/|df| = {1 / apart:.4g} s: the channels' sum "
            f"peaks {waveform.duration * apart:.3g} times in it, so that ranges {SPEED_OF_LIGHT / (2 * apart):.4g} m "
            f"apart are ambiguous; shorten the pulse to {1 / apart:.4g} s"
        )
    jump = array.center_jump
    if jump:
        share = jump / (np.ptp(carriers) or 1.0)
        warn(
            f"the array's centre frequency jumps by {jump:.4g} Hz from plan to plan, {100 * share:.3g} % of the band: "
            f"a point r m from the reference changes its phase there by {4 * np.pi * jump / SPEED_OF_LIGHT:.3g} r rad, "
            "and images of it defocus beyond a quarter turn; move the base frequency as well (array.mirrored)"
        )
