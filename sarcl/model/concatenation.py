"""Phase histories joined by their rows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Any, TypeAlias

import numpy as np

from .antenna_array import AntennaArray
from .lazy_rows import stack
from .phase_history import PhaseHistory
from .waveform import Waveform

_Common: TypeAlias = Waveform | AntennaArray | np.ndarray | str | None  # fields that rows have in common


def concatenate(parts: Sequence[PhaseHistory]) -> PhaseHistory:
    """One phase history with the rows of several `parts`, in order; all need the same number of samples.

    Optional fields per row, the waveform, image area and metadata are kept where every part has them; lazy samples stay
    lazy.
    ValueError names the part that differs.

    >>> both = sarcl.concatenate([raw, sarcl.echo(scene, chirp, track, polarization="VV")])
    >>> both.n_rows, both.select(polarization="VV").n_rows
    (128, 64)
    """
    if isinstance(parts, PhaseHistory):
        raise TypeError("concatenate takes a list of phase histories, got one; give [raw, ...]")
    if not isinstance(parts, Iterable):
        raise TypeError(f"parts is a {type(parts).__name__}; give a list of phase histories")
    parts = list(parts)
    if not parts:
        raise ValueError("concatenate was given no phase history; give at least one")
    for i, part in enumerate(parts):
        if not isinstance(part, PhaseHistory):
            raise TypeError(f"part {i} is a {type(part).__name__}; concatenate joins phase histories")
        if part.n_samples != parts[0].n_samples:
            raise ValueError(f"part {i} has {part.n_samples} samples per row, part 0 has {parts[0].n_samples}")
        if part.compressed != parts[0].compressed:
            raise ValueError(f"part {i} and part 0 differ: one is compressed, one is not; call compress on it first")
    joined: dict[str, Any] = {}
    for name in (f.name for f in fields(PhaseHistory) if f.name != "_rx_of_tx"):
        values = [getattr(p, name) for p in parts]
        if name == "samples":
            joined["samples"] = stack(values)
        elif name in ("waveform", "array", "image_area", "metadata"):
            joined[name] = values[0] if all(_alike(v, values[0]) for v in values) else None
        elif isinstance(values[0], np.ndarray) and all(v is not None for v in values):
            joined[name] = np.concatenate(values)
    if not parts[0].compressed and joined["waveform"] is None and any(p.waveform for p in parts):
        raise ValueError("parts that are not compressed have different waveforms; call compress on each first")
    if all(p.rx is p.tx for p in parts):
        joined["rx"] = None
    return PhaseHistory(**joined, compressed=parts[0].compressed)


def _alike(a: _Common, b: _Common) -> bool:
    """True where two waveforms have equal fields, or two arrays or texts are equal, or both are None."""
    if a is b or a is None or b is None or type(a) is not type(b):
        return a is b
    if isinstance(a, str):
        return a == b
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(np.asarray(a), np.asarray(b))
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
