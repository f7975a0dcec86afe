"""Channels of an array: carriers and positions of its elements, and the frequencies at which echoes are sampled."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import warn
from ..model.antenna_array import AntennaArray
from ..model.waveform import Waveform

LEAST_CUT = 1e-9  # share of a spectrum's norm below which nothing counts as left out
EVEN = 1e-9  # of the carriers' total span: carriers no farther from multiples of their spacing are evenly spaced


@dataclass(frozen=True, eq=False)
class Channel:
    """Elements with one carrier and one position, and the pulses first ... stop - 1 at which they transmit it.

    elements  their numbers;  offset  their position in the array, m (3,);  carrier  Hz;  weight  sum of theirs, complex
    """

    elements: np.ndarray
    offset: np.ndarray
    carrier: float
    weight: complex
    first: int
    stop: int


def is_single(array: AntennaArray) -> bool:
    """Whether the array is one element at the reference point with the base frequency: equivalent to no array."""
    return array.n == 1 and not (array.positions.any() or array.offsets.any()) and array.weights[0] == 1


def channels_of(array: AntennaArray, center: float, n_pulses: int, merge: bool = True) -> list[Channel]:
    """Channels of an array about a base frequency, Hz; with `merge`, elements of equal carrier and position are one.

    Raises ValueError for carriers of 0 Hz or less.
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
    """(plan, first, stop) of each run of pulses with one plan."""
    if array.plan is None:
        yield 0, 0, n_pulses
        return
    if len(array.plan) != n_pulses:
        raise ValueError(
            f"the array's plan names {len(array.plan)} pulses but the track has {n_pulses}; give one entry per pulse"
        )
    ends = [0, *(np.flatnonzero(np.diff(array.plan)) + 1).tolist(), n_pulses]
    for first, stop in pairwise(ends):
        yield int(array.plan[first]), first, stop


def spacing(carriers: np.ndarray) -> float | None:
    """The step, Hz, of which differences of carriers, Hz (n,), are multiples; None if there is none, or one carrier."""
    steps = np.diff(np.unique(carriers))
    if len(steps) == 0:
        return None
    step = float(steps.min())
    rounds = np.rint(steps / step)
    step = float(steps.sum() / rounds.sum())
    return step if (np.abs(steps - rounds * step) <= EVEN * steps.sum()).all() else None


@dataclass(frozen=True)
class Sampling:
    """Samples at frequency + i step, Hz, i < n, of which `width` about its carrier belong to each channel."""

    frequency: float
    step: float
    n: int
    width: int

    def part(self, carrier: float) -> slice:
        """The samples of a channel with this carrier."""
        first = round((carrier - self.frequency) / self.step - (self.width - 1) / 2)
        return slice(max(first, 0), min(first + self.width, self.n))

    def holds(self, carriers: Iterable[float]) -> bool:
        """Whether the samples that each channel has by itself are among these."""
        places = (np.fromiter(carriers, float) - self.frequency) / self.step - (self.width - 1) / 2
        inside = (places > -0.5) & (places + self.width < self.n + 0.5)
        return bool((inside & (np.abs(places - np.rint(places)) < 1e-6)).all())

    def of(self, carrier: float) -> Sampling:
        """The samples of one channel by itself."""
        return replace(self, frequency=carrier - (self.width - 1) / 2 * self.step, n=self.width)


def sampling(carriers: np.ndarray, waveform: Waveform, near: float, far: float, compressed: bool) -> Sampling:
    """Samples over the bands of all carriers, Hz (n,), so close that a range window (near, far), m, is unambiguous.

    Evenly spaced carriers lie on samples. A tone is sampled up to halfway to the next carriers; if its duration and the
    window's are 1/spacing, that is one sample per channel.
    """
    period = 4 * max(abs(near), abs(far)) / SPEED_OF_LIGHT
    if not compressed:
        period += waveform.duration
    low, high, gap = float(carriers.min()), float(carriers.max()), spacing(carriers)
    own = waveform.bandwidth if gap is None or waveform.kind != "tone" else min(waveform.bandwidth, gap)
    if gap is None:
        n = max(1, int(np.ceil(period * (high - low + own) * (1 - 1e-12))))
        step = (high - low + own) / n
        width = max(1, round(own / step))
        return Sampling(low - own / 2 + step / 2, step, n, n if high == low else width)
    parts = max(1, int(np.ceil(period * gap * (1 - 1e-9))))
    step = gap / (parts + 1 - parts % 2)  # odd: carriers lie on samples, and bands end between them
    width = max(1, int(np.ceil(own / step * (1 - 1e-9))))
    width += 1 - width % 2
    return Sampling(low - (width - 1) / 2 * step, step, round((high - low) / step) + width, width)


def cut_of(grid: Sampling, waveform: Waveform, carriers: np.ndarray, compressed: bool) -> float:
    """Share of a tone's spectrum, in norm, that is left out: what its own samples, up to half-way to its neighbours,
    leave of all samples in its bandwidth. 0 for other waveforms, and for carriers that are not evenly spaced.

    For tones shorter than 1/spacing: warn of it. Source: docs/theory/fda.md, "Tones between carriers".
    """
    gap = spacing(carriers)
    if waveform.kind != "tone" or gap is None:
        return 0.0
    most = int(waveform.bandwidth / 2 / grid.step * (1 + 1e-9))
    spectrum = np.sinc(np.arange(-most, most + 1) * grid.step * waveform.duration) ** (2 if compressed else 1)
    power = spectrum**2
    own = np.abs(np.arange(-most, most + 1)) <= grid.width // 2
    cut = float(np.sqrt(power[~own].sum() / power.sum()))
    if waveform.duration * gap < 1 - 1e-9 and cut > LEAST_CUT:
        warn(
            f"the pulse of {waveform.duration:.4g} s is shorter than 1/|df| = {1 / gap:.4g} s: each channel is "
            f"sampled up to half-way to the next carriers, which leaves out {100 * cut:.2g} % of its spectrum's norm; "
            f"take a pulse of {1 / gap:.4g} s, or carriers {1 / waveform.duration:.4g} Hz apart"
        )
    return cut


def warn_of(array: AntennaArray, waveform: Waveform, carriers: np.ndarray) -> None:
    """Warn where ranges are ambiguous with these channels, or images defocus."""
    gap = spacing(carriers)
    if gap is not None and waveform.duration * gap > 1 + 1e-9:
        warn(
            f"the pulse of {waveform.duration:.4g} s is longer than 1/|df| = {1 / gap:.4g} s: the channels' sum "
            f"peaks {waveform.duration * gap:.3g} times in it, so that ranges {SPEED_OF_LIGHT / (2 * gap):.4g} m "
            f"apart are ambiguous; shorten the pulse to {1 / gap:.4g} s"
        )
    jump = array.center_jump
    if jump:
        share = jump / (np.ptp(carriers) or 1.0)
        warn(
            f"the array's centre frequency jumps by {jump:.4g} Hz from plan to plan, {100 * share:.3g} % of the band: "
            f"a point r m from the reference changes its phase there by {4 * np.pi * jump / SPEED_OF_LIGHT:.3g} r rad, "
            "and images of it defocus beyond a quarter of a cycle; move the base frequency as well (array.mirrored)"
        )
