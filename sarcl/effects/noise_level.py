"""The level of noise: given in one way of several."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

LEVELS = ("nesz_db", "nesz", "temperature", "radar", "variance")


def level_of(given: Mapping[str, Any]) -> str:
    """The name of the one level among the arguments of `add_noise`; ValueError where there is none, or several."""
    named = [name for name in LEVELS if given.get(name) is not None]
    if len(named) != 1:
        raise ValueError(f"noise has one level; give one of {', '.join(LEVELS)}, got {', '.join(named) or 'none'}")
    return named[0]
