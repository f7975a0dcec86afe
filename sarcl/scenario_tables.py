"""Nouns as the tables of a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .grid import ImageGrid
from .scene import Scene
from .trajectory import Trajectory
from .waveform import Waveform


def table_of(value: Any) -> Any:
    """The table of a noun; anything else as it is. A noun's table gives an equal noun, but names no files."""
    if isinstance(value, Waveform):
        return {value.kind: _waveform(value)}
    if isinstance(value, Trajectory):
        return _without_none(value, ("times", "positions", "velocities", "attitude"))
    if isinstance(value, Scene):
        return _scene(value)
    if isinstance(value, ImageGrid):
        if not value.is_plane:
            return {"points": {"positions": value.listed}}
        return {"plane": _without_none(value, ("center", "shape", "spacing", "normal", "x_axis"))}
    return value


def plain(value: Any) -> Any:
    """Arrays and tuples as lists, complex numbers as [real, imaginary], paths as text, all the way down."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return sorted(value) if isinstance(value, (set, frozenset)) else value


def _waveform(value: Waveform) -> dict[str, Any]:
    if value.kind == "sampled":
        return _without_none(value, ("signal", "rate", "center"))
    return _without_none(value, ("center", "bandwidth", "duration"))


def _scene(value: Scene) -> dict[str, Any]:
    tables: dict[str, Any] = {}
    if len(value.positions):
        tables["points"] = [{"positions": value.positions, "amplitudes": value.amplitudes}]
    if len(value.triangles):
        # one table a run of facets of one reflectivity: their order, and so their random heights, stays
        change = np.flatnonzero(np.diff(value.reflectivity)) + 1
        tables["facets"] = [
            {
                "triangles": value.triangles[a:b],
                "material": value.reflectivity[a],
                "roughness": value.roughness[a:b],
                "two_sided": value.two_sided[a:b],
            }
            for a, b in zip([0, *change], [*change, len(value.triangles)], strict=True)
        ]
    return tables


def _without_none(value: Any, names: tuple[str, ...]) -> dict[str, Any]:
    return {n: getattr(value, n) for n in names if getattr(value, n) is not None}
