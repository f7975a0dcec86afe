"""Sweeps of experiments on frequency-diverse apertures: one case for every combination of values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import text, validation
from .case import Case

MOST = 64  # cases in one sweep
NOT_SWEPT = ("name", "mappings", "points", "separations", "series", "swept")
KEYS = (*(name for name in Case.__dataclass_fields__ if name not in NOT_SWEPT), "bandwidth")
UNITS = {
    "frequency_step": ("MHz", 1e-6), "bandwidth": ("MHz", 1e-6), "center": ("GHz", 1e-9), "spacing": ("m", 1.0),
    "distance": ("m", 1.0), "aperture": ("m", 1.0), "height": ("m", 1.0), "squint": ("deg", 180 / np.pi),
    "steer": ("deg", 180 / np.pi),
}  # fmt: skip


def sweep(case: Case, **values: float | Sequence[object] | np.ndarray) -> list[Case]:
    """`case` at every combination of the values of its fields; the values of the last key change fastest.

    values     lists, one per field:  sweep(case, frequency_step=[20e6, 2e6], aperture=[200.0, 400.0])
    bandwidth  Hz, a number or a list: n |frequency_step| is kept at this value; n follows from frequency_step, or
               frequency_step from n where n is swept

    ValueError for a key that no case has, a list without values, more than 64 cases, a band that is not a whole number
    of steps, and a combination that is not a valid case.

    >>> case = sarcl.fda.Case("array", n=9, frequency_step=100e6)
    >>> [c.n for c in sarcl.fda.sweep(case, n=[9, 15])]
    [9, 15]
    """
    validation.instance("case", case, Case)
    return cases({name: getattr(case, name) for name in Case.__dataclass_fields__}, values)


def cases(fields: Mapping[str, Any], values: Mapping[str, Any]) -> list[Case]:
    """The cases of `sweep`, from fields that need not be a valid case alone; missing fields have Case's defaults."""
    lists = {name: _list(name, given) for name, given in values.items()}
    if not lists:
        raise ValueError(f"a sweep without keys sweeps nothing; give a list of values for any of {', '.join(KEYS)}")
    if "bandwidth" in lists and {"n", "frequency_step"} <= set(lists):
        raise ValueError(
            "bandwidth, n and frequency_step depend on each other; sweep bandwidth with one of the other two"
        )
    varied = [name for name in lists if name != "bandwidth" or np.ndim(values["bandwidth"])]
    if not varied:
        raise ValueError("bandwidth alone sweeps nothing; give frequency_step or n a list of values")
    count = prod(len(combination) for combination in lists.values())
    if count > MOST:
        sizes = " x ".join(str(len(combination)) for combination in lists.values())
        raise ValueError(f"the sweep makes {sizes} = {count} cases; at most {MOST} are run: give fewer values")
    out = []
    for chosen in product(*lists.values()):
        given = dict(zip(lists, chosen, strict=True))
        swept = tuple((name, given[name]) for name in varied)
        label = ", ".join(f"{name} {shown(name, value)}" for name, value in swept)
        name = fields["name"]
        try:
            whole = {**fields, **_whole(fields, given)}
            out.append(Case(**{**whole, "name": f"{name}: {label}", "series": name, "swept": swept}))
        except (TypeError, ValueError) as exc:
            raise ValueError(f"{label}: {exc}") from exc
    return out


def shown(name: str, value: ArrayLike | None) -> str:
    """A value with its unit as text, or a word."""
    unit, scale = UNITS.get(name, ("", 1.0))
    if value is None or isinstance(value, (bool, str)):
        return str(value).lower()
    number = " x ".join(f"{scale * v:.4g}" for v in np.atleast_1d(value))
    return f"{number} {unit}".strip()


def _list(name: str, values: Any) -> list[Any]:
    if name not in KEYS:
        raise ValueError(text.unknown(name, list(KEYS), "key"))
    if name == "bandwidth" and np.ndim(values) == 0:
        values = [values]
    if isinstance(values, str) or not isinstance(values, (Sequence, np.ndarray)):
        raise ValueError(f"{name} is {values!r:.60}; a sweep wants a list of values")
    if len(values) == 0:
        raise ValueError(f"{name} has no values to sweep; give at least one, or leave it out")
    plain = [value.item() if isinstance(value, np.generic) else value for value in values]
    return [tuple(value) if isinstance(value, (list, tuple, np.ndarray)) else value for value in plain]


def _whole(fields: Mapping[str, Any], combination: dict[str, Any]) -> dict[str, Any]:
    """The fields set by one combination, with bandwidth replaced by n and frequency_step."""
    if "bandwidth" not in combination:
        return combination
    combination = dict(combination)
    band = validation.number("bandwidth", combination.pop("bandwidth"), above=0)
    fields_in_force = {"progression": Case.progression, "frequency_step": Case.frequency_step, **fields, **combination}
    if fields_in_force["progression"] == "planar":
        raise ValueError("bandwidth is kept for one row of elements; give a planar array's n and frequency_step")
    if "n" in combination:
        return {**combination, "frequency_step": band / validation.count("n", combination["n"], 2)}
    step = validation.number("frequency_step", fields_in_force["frequency_step"])
    n = band / abs(step) if step else 0.0
    if n < 1.5 or abs(n - round(n)) > 1e-6:
        raise ValueError(
            f"bandwidth is {band:g} Hz and frequency_step {step:g} Hz: {n:.4g} elements; give a step of which the "
            "band is a whole multiple, at least twice"
        )
    return {**combination, "n": round(n)}
