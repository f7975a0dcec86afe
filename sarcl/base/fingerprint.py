"""Checksums of everything that a result depends on: arrays, numbers, options, the kernels."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np


def checker(*parts: Any) -> Any:
    """A checksum object that has taken `parts`, bytes or views of them."""
    digest = hashlib.blake2b(digest_size=32)
    for part in parts:
        digest.update(part)
    return digest


def as_bytes(values: np.ndarray) -> np.ndarray:
    """The bytes of an array, in C order."""
    return np.ascontiguousarray(values).reshape(-1).view(np.uint8)


def checksum(*values: object) -> str:
    """Checksum of arrays, numbers (or tuples of them), strings and None, with shapes and types."""
    digest = checker()
    for value in values:
        if value is None or isinstance(value, str):
            digest.update(repr(value).encode())
        else:
            array = np.asarray(value)
            digest.update(f"{array.dtype.str}{array.shape}".encode())
            digest.update(as_bytes(array))
    return str(digest.hexdigest()[:32])


def leaves(value: Any) -> list[Any]:
    """The names, arrays, numbers, strings and None in a dataclass, or in a tuple, list or dict of such, for
    `checksum`. TypeError for anything else."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {name: getattr(value, name) for name in value.__dataclass_fields__}
    if isinstance(value, Mapping):
        return [leaf for name in sorted(value) for leaf in (str(name), *leaves(value[name]))]
    if isinstance(value, (tuple, list, frozenset, set)):
        return [
            leaf for part in (value if isinstance(value, (tuple, list)) else sorted(value)) for leaf in leaves(part)
        ]
    if value is None or isinstance(value, (str, bool, int, float, complex, np.ndarray, np.generic)):
        return [value]
    raise TypeError(f"results computed with a {type(value).__name__} among the options cannot be identified")


@functools.cache
def kernels() -> str:
    """Checksum of the kernel sources: results of two versions are not mixed."""
    from importlib.resources import files

    sources = [(p.name, p.read_text()) for p in files("sarcl.kernels").iterdir() if p.name.endswith((".cl", ".clh"))]
    return checksum(*(text for pair in sorted(sources) for text in pair))[:12]
