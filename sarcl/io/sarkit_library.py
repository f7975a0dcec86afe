"""sarkit's modules, names for the types of its objects, and the files that they read in place."""

from __future__ import annotations

import io
import os
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import IO, Any, Literal, TypeAlias

Element: TypeAlias = Any  # of lxml, or wrapped by sarkit: neither has types
Reader: TypeAlias = Any  # of sarkit


class OpenFile(io.BufferedReader):
    """A file that is closed, without a warning, when nothing reads it any more."""

    def __del__(self) -> None:
        self.close()


class Refused(Exception):
    """What is wrong with a file, after its name, with a remedy."""


def library(name: Literal["cphd", "sicd"]) -> ModuleType:
    """sarkit.cphd or sarkit.sicd; ImportError names the extra that has it."""
    try:
        return import_module(f"sarkit.{name}")
    except ImportError as exc:
        raise ImportError(
            f"{name.upper()} files need the package sarkit, with NumPy 2: pip install sarcl[formats] ({exc})"
        ) from exc


def opened(source: Path | IO[bytes]) -> tuple[IO[bytes], str]:
    """A file by its path, or the open binary file itself; and its name for messages."""
    if isinstance(source, os.PathLike):
        return OpenFile(io.FileIO(str(source))), repr(str(source))
    return source, repr(getattr(source, "name", "the file object"))


def stamp(file: IO[bytes]) -> tuple[int, int] | None:
    """Size and time of change of an open file; None of objects that are no file of a disk."""
    try:
        state = os.fstat(file.fileno())
    except (OSError, AttributeError, ValueError):  # ValueError: closed; io.UnsupportedOperation is an OSError
        return None
    return state.st_size, state.st_mtime_ns


def text_of(element: Element, path: str) -> str:
    """The text of an element below; KeyError names one that is missing or empty."""
    text = element.findtext("/".join(f"{{*}}{name}" for name in path.split("/")))
    if text is None or not text.strip():
        raise KeyError(f"it has no {path}")
    return str(text).strip()


def damage(exc: Exception) -> str:
    """Words for an exception of the library, of lxml or of text that is no number."""
    words = str(exc.args[0]) if isinstance(exc, KeyError) and exc.args else f"{type(exc).__name__}: {exc}"
    return f"is truncated or damaged ({words}); copy it again"
