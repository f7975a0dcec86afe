"""sarkit's CPHD module, and names for the types of its objects."""

from __future__ import annotations

from types import ModuleType
from typing import Any, TypeAlias

Element: TypeAlias = Any  # of lxml, or wrapped by sarkit: neither has types
Reader: TypeAlias = Any  # of sarkit


def cphd_library() -> ModuleType:
    """sarkit.cphd; ImportError names the extra that has it."""
    try:
        from sarkit import cphd
    except ImportError as exc:
        raise ImportError(
            f"CPHD files need the package sarkit, with NumPy 2: pip install sarcl[formats] ({exc})"
        ) from exc
    library: ModuleType = cphd
    return library
