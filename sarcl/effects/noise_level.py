"""The level of noise: given in one way of several."""

from __future__ import annotations

from collections.abc import Mapping

LEVELS = ("nesz_db", "nesz", "temperature", "radar", "variance")


def level_of(levels: Mapping[str, object]) -> str:
    """The name of the one level among the arguments of `add_noise`; ValueError where there is none, or several."""
    names = [name for name in LEVELS if levels.get(name) is not None]
    if len(names) != 1:
        raise ValueError(f"noise has one level; give one of {', '.join(LEVELS)}, got {', '.join(names) or 'none'}")
    return names[0]
