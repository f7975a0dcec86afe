"""Results that follow from a read-only object alone, kept with it: several radars, tracks and threads share them."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import fields, is_dataclass
from typing import TypeVar, cast

import numpy as np

Result = TypeVar("Result")

MOST = 2.0**26  # bytes of all results that an object keeps, by default


class Kept:
    """Results of one object, up to a number of bytes: the oldest go first, and all go with the object.

    Keys name everything that a result depends on beside the object, so that results are the same whether they are kept
    or not. Arrays in them are made read-only. Copies and pickles of the object begin without results. There is no lock,
    which a fork could leave locked: two threads may compute the same result, and one of them is kept.
    """

    def __init__(self) -> None:
        self._results: dict[Hashable, tuple[object, float]] = {}
        self._most = MOST

    def of(self, key: Hashable, compute: Callable[[], Result]) -> Result:
        """The result of `compute`, kept under `key`."""
        known = self._results.get(key)
        if known is not None:
            return cast(Result, known[0])
        result = compute()
        self._results[key] = result, sum(map(_sealed, _arrays(result)))
        self._shrink()
        return result

    def limit(self, most: float) -> None:
        """Keep no more than `most` bytes from now on."""
        self._most = min(MOST, most)
        self._shrink()

    @property
    def nbytes(self) -> float:
        """Bytes of the arrays that are kept."""
        return sum(nbytes for _, nbytes in list(self._results.values()))

    def _shrink(self) -> None:
        for key in list(self._results):
            if self.nbytes <= self._most:
                break
            self._results.pop(key, None)

    def __reduce__(self) -> tuple[type[Kept], tuple[()]]:
        return Kept, ()


def _arrays(result: object) -> list[np.ndarray]:
    """The arrays in a result: an array, or tuples, lists and dataclasses of such."""
    if isinstance(result, np.ndarray):
        return [result]
    if is_dataclass(result):
        result = [getattr(result, field.name) for field in fields(result)]
    return [array for part in result for array in _arrays(part)] if isinstance(result, (tuple, list)) else []


def _sealed(array: np.ndarray) -> int:
    """Bytes of an array, which is read-only from now on."""
    array.flags.writeable = False
    return array.nbytes
