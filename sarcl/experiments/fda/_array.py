"""Arrays of experiments: elements along the track, along z or both; carriers in a line, scrambled, or in groups."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...base import validation
from ...base.constants import SPEED_OF_LIGHT
from ...model.antenna_array import AntennaArray

PROGRESSIONS = ("linear", "costas", "vertical", "planar", "subarrays")
DOWN = (0.0, 0.0, -1.0)


def size(progression: str, n: Any, frequency_step: Any) -> tuple[Any, Any]:
    """n as integers and frequency_step as numbers, pairs for a planar array. ValueError for others, and for no step."""
    pair = progression == "planar"
    for name, value in (("n", n), ("frequency_step", frequency_step)):
        if (np.shape(value) == (2,)) != pair:
            form = "two values, along the track and z" if pair else "one value: two go with progression 'planar'"
            raise ValueError(f"{name} is {value!r:.60}; progression {progression!r} takes {form}")
    counts = [validation.count("n", value, 1 if pair else 2) for value in (n if pair else (n,))]
    steps = [validation.number("frequency_step", value) for value in (frequency_step if pair else (frequency_step,))]
    if all(step == 0 or count == 1 for count, step in zip(counts, steps, strict=True)):
        raise ValueError(
            "frequency_step is 0: a constant-frequency array has nothing to map; the conventional antenna of "
            "every case is that already"
        )
    return (tuple(counts), tuple(steps)) if pair else (counts[0], steps[0])


def groups_of(progression: str, groups: object, steer: float, receive: str) -> int | None:
    """The number of groups, None without groups. ValueError for options that exclude each other."""
    if progression != "subarrays":
        if groups is not None or steer:
            raise ValueError(f"groups and steer go with progression 'subarrays', not {progression!r}; leave them out")
        return None
    if groups is None:
        raise ValueError("progression 'subarrays' needs groups: give a divisor of n")
    if receive != "reference":
        raise ValueError(
            f"receive is {receive!r}, but a row holds a whole group: subarrays are received at the reference "
            "element; give each group as one element of a linear array, with the spacing of the groups"
        )
    return validation.count("groups", groups, 2)


def highest(n: Any, frequency_step: Any, groups: int | None) -> float:
    """Offset of the last element's carrier, Hz: twice that of the centre frequency."""
    last = np.asarray(n) - 1 if groups is None else np.asarray(n - n // groups)
    return float(np.sum(last * np.asarray(frequency_step)))


def make(progression: str, n: Any, frequency_step: Any, spacing: float, ahead: np.ndarray) -> AntennaArray:
    """The array with element i at -i spacing, m, along `ahead` (3,) or z; subarrays are not yet formed."""
    if progression == "planar":
        steps = (spacing, spacing)
        return AntennaArray.planar(n, spacing=steps, frequency_step=frequency_step, axes=(-ahead, DOWN))
    kind = AntennaArray.costas if progression == "costas" else AntennaArray.linear
    axis = DOWN if progression == "vertical" else -ahead
    return kind(n, spacing=spacing, frequency_step=frequency_step, axis=axis)


def subarrays(line: AntennaArray, groups: int, center: float, look: np.ndarray) -> AntennaArray:
    """Subarrays of a line, each steered along `look` (3,) about its middle; the first middle is the reference point.

    The weights of a subarray add up to 1 along `look`, so that it is as strong as one element there.
    """
    grouped, each = line.subarrays(groups), line.n // groups
    places = grouped.positions - grouped.positions[:each].mean(axis=0)
    off = places - np.repeat(_middles(places, groups), each, axis=0)
    cycles = (center + grouped.offsets[0]) * (off @ look) / SPEED_OF_LIGHT
    return replace(grouped, positions=places, weights=np.exp(-2j * np.pi * cycles) / each)


def as_channels(array: AntennaArray, groups: int) -> AntennaArray:
    """One element per group, at its middle."""
    each = array.n // groups
    return AntennaArray(positions=_middles(array.positions, groups), offsets=array.offsets[:, ::each], plan=array.plan)


def _middles(places: np.ndarray, groups: int) -> np.ndarray:
    return np.asarray(places.reshape(groups, -1, 3).mean(axis=1))
