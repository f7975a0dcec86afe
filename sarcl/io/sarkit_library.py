"""sarkit's modules, names for the types of its objects, and the files that they read in place."""

from __future__ import annotations

import io
import logging
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import IO, TYPE_CHECKING, Any, Literal, NoReturn, TypeAlias

from .formats import Make, T

if TYPE_CHECKING:  # NumPy is loaded late
    import numpy as np

Element: TypeAlias = Any  # of lxml, or wrapped by sarkit: neither has types
Reader: TypeAlias = Any  # of sarkit
_NO_LOG = logging.NullHandler()


class OpenFile(io.BufferedReader):
    """A file that is closed, without a warning, when nothing reads it any more."""

    def __del__(self) -> None:
        self.close()


class Refused(Exception):
    """What is wrong with a file, after its name, with a remedy."""


def library(name: Literal["cphd", "crsd", "sicd"]) -> ModuleType:
    """sarkit.cphd, crsd or sicd; ImportError names the extra that has it."""
    try:
        module = import_module(f"sarkit.{name}")
        nitf = import_module("jbpy")  # sarkit's reader of NITF
    except ImportError as exc:
        raise ImportError(
            f"{name.upper()} files need the package sarkit, with NumPy 2: pip install sarcl[formats] ({exc})"
        ) from exc
    # of damaged files it logs every field with a traceback, on stderr where nobody handles logs
    logging.getLogger(nitf.__name__).addHandler(_NO_LOG)
    return module


@contextmanager
def opened(source: Path | IO[bytes]) -> Iterator[tuple[IO[bytes], str]]:
    """A file by its path, or the open binary file itself, and its name for messages. It stays open; a file by its path
    is closed where the block fails."""
    if not isinstance(source, os.PathLike):
        yield source, repr(getattr(source, "name", "the file object"))
        return
    file = OpenFile(io.FileIO(str(source)))
    try:
        yield file, repr(str(source))
    except BaseException:
        file.close()
        raise


@contextmanager
def parsing(name: str) -> Iterator[None]:
    """ValueError, which names the file, for whatever the block raises: it parses a file that others wrote."""
    try:
        yield
    except Refused as exc:
        raise ValueError(f"{name} {exc}") from None
    except Exception as exc:  # of the library, of lxml and of text that is no number
        raise ValueError(f"{name} {damage(exc)}") from exc


def made_of(make: Make[T], kind: Literal["phase history", "image"], fields: dict[str, Any], name: str) -> T:
    """make(kind, fields), whose ValueErrors name the file."""
    try:
        return make(kind, fields)
    except ValueError as exc:
        raise ValueError(f"{name}: {exc}") from None


class FileRows:
    """Rows that sarkit reads from an open file when they are asked for, one thread at a time.

    OSError where the file has changed since it was opened, or ends too early.
    """

    def __init__(self, file: IO[bytes], values: str, remedy: str) -> None:
        """values  what the rows hold;  remedy  the expression that takes them into memory"""
        self._file, self._values, self._remedy = file, values, remedy
        self._lock, self._stamp = threading.Lock(), stamp(file)

    def _of_file(self, rows: str, read: Callable[[], np.ndarray]) -> np.ndarray:
        """What `read` returns; rows  its place in the file, for messages."""
        with self._lock:
            self._check()
            try:
                values = read()
            except Exception as exc:  # of the library and of file objects, which fail in many ways
                raise OSError(
                    f"{self._name} cannot be read at {rows} ({exc}); it is truncated, or was closed: copy it again, or "
                    "open it again"
                ) from exc
            self._check()
        return values

    def _check(self) -> None:
        if stamp(self._file) != self._stamp:
            raise OSError(f"{self._name} has changed since it was opened; read it again with sarcl.read")

    def __reduce__(self) -> NoReturn:
        """Refused: copy, pickle and multiprocessing cannot hand an open file on."""
        raise TypeError(
            f"the {self._values} are rows of the open file {self._name}, which cannot be copied or sent to another "
            f"process: read the file there, sarcl.read(path), or take them into memory first, such as {self._remedy}"
        )

    @property
    def _name(self) -> str:
        return repr(getattr(self._file, "name", "the file object"))


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
