"""Phase histories joined by their rows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from .antenna_array import AntennaArray
from .lazy_rows import stack
from .phase_history import PhaseHistory
from .waveform import Waveform


def concatenate(parts: Sequence[PhaseHistory]) -> PhaseHistory:
    """One phase history with the rows of several, in order; all need the same number of samples.

    Optional fields per row and the waveform are kept where every part has them; lazy samples stay lazy.
    ValueError names the part that differs.
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
        elif name in ("waveform", "array"):
            joined[name] = values[0] if all(_alike(v, values[0]) for v in values) else None
        elif isinstance(values[0], np.ndarray) and all(v is not None for v in values):
            joined[name] = np.concatenate(values)
    if not parts[0].compressed and joined["waveform"] is None and any(p.waveform for p in parts):
        raise ValueError("parts that are not compressed have different waveforms; call compress on each first")
    if all(p.rx is p.tx for p in parts):
        joined["rx"] = None
    return PhaseHistory(**joined, compressed=parts[0].compressed)


def _alike(a: Waveform | AntennaArray | None, b: Waveform | AntennaArray | None) -> bool:
    """True where two waveforms (or None) have equal fields."""
    if a is None or b is None or type(a) is not type(b):
        return a is b
    return a is b or all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
