"""Checks of arguments that are no numbers: names of files, words, functions, indices. Messages as in `validation`.

Loads nothing that takes time: the command line checks names of files with it.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .text import shown

if TYPE_CHECKING:
    import numpy as np

LONGEST_NAME = 4096  # bytes of a path on Linux
LONGEST_TEXT = 500  # characters of a title: more does not fit on a picture


def path(name: str, value: object) -> Path:
    """`value` as a Path; TypeError for what is no name of a file, ValueError for one that no system takes."""
    if not isinstance(value, (str, os.PathLike)) or isinstance(os.fspath(value), bytes):
        raise TypeError(f"{name} is a {type(value).__name__}; give the name of a file, a string or a pathlib.Path")
    file = Path(value)
    if len(str(file)) > LONGEST_NAME:
        raise ValueError(f"{name} has {len(str(file))} characters: {str(file)!r:.60}; no path is that long: shorten it")
    return file


def text(name: str, value: object) -> str | None:
    """`value` if it is None or a string of at most LONGEST_TEXT characters."""
    if value is not None and not isinstance(value, str):
        raise TypeError(f"{name} is a {type(value).__name__}; give a string or None")
    if value is not None and len(value) > LONGEST_TEXT:
        raise ValueError(f"{name} has {len(value)} characters, wanted at most {LONGEST_TEXT}: shorten it")
    return value


def progress(value: object, called: str = "progress(stage, done, total)") -> Any:
    """`value` where it is None or can be called; TypeError otherwise."""
    if value is not None and not callable(value):
        raise TypeError(f"progress is {shown(value)}; give a function, which is called as {called}, or None")
    return value


def checked_index(name: str, what: str, value: Any, shape: tuple[int, ...]) -> None:
    """IndexError unless NumPy takes `value` as an index of an array, `what`, of `shape`; nothing is read for it."""
    import numpy as np

    try:
        np.broadcast_to(np.False_, shape)[value]
    except (IndexError, TypeError, ValueError):
        raise IndexError(
            f"{name} is {shown(value)}, which is no index of {what} of shape {shape}; give whole numbers within it, "
            "slices, or a mask of its shape"
        ) from None


def chosen(name: str, value: Any, n: int, what: str) -> np.ndarray:
    """Numbers (k,) that `value`, a slice, whole numbers or a mask, chooses of 0 ... n - 1; IndexError for others."""
    import numpy as np

    try:
        numbers = np.atleast_1d(np.arange(n)[value])
    except (IndexError, TypeError, ValueError):
        numbers = None
    if numbers is None or numbers.ndim != 1:
        raise IndexError(
            f"{name} is {shown(value)}, which chooses none of {n} {what}; give a slice, whole numbers from {-n} to "
            f"{n - 1}, or a mask of {n} values True and False"
        )
    return numbers
