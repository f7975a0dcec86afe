"""Numbers of a kernel's launch as one struct by value: given by name, so that none takes another's place."""

from __future__ import annotations

import functools
import re

import numpy as np
from numpy.typing import ArrayLike

from .programs import source

TYPES = {"int": np.int32, "uint": np.uint32, "ulong": np.uint64, "float": np.float32}


def launch_numbers(file: str, kernel: str, **values: ArrayLike) -> np.ndarray:
    """The argument of type `<kernel>_numbers` of a kernel of kernels/<file>, as Device.run takes it.

    values  one for each member of the struct; for an array of the struct, as many numbers

    TypeError: values are missing, or the struct has no such members; OverflowError: an integer that is too large.
    """
    layout = struct_layout(file, f"{kernel}_numbers")
    names = layout.names or ()
    row = tuple(values[name] for name in names if name in values)
    if len(row) != len(names) or len(values) != len(names):
        missing, unknown = set(names) - values.keys(), values.keys() - set(names)
        raise TypeError(f"{kernel}_numbers of {file}: missing {sorted(missing)}, unknown {sorted(unknown)}")
    return np.array([row], layout)


@functools.cache
def struct_layout(file: str, struct: str) -> np.dtype:
    """Types and places of the members of a struct in a kernel's source text, as C lays them out."""
    definition = re.search(r"typedef struct \{([^}]*)\} " + struct + ";", re.sub(r"//.*", "", source(file)))
    if definition is None:
        raise TypeError(f"kernels/{file} has no `typedef struct {{ ... }} {struct};`")
    members: list[tuple[str, type, tuple[int, ...]]] = []
    for line in filter(str.strip, definition[1].split(";")):
        kind, names = line.strip().split(" ", 1)
        for name in names.split(","):
            at = re.fullmatch(r"\s*(\w+)(?:\[(\d+)\])?\s*", name)
            if at is None or kind not in TYPES:
                raise TypeError(f"{struct} of kernels/{file}: cannot read {line.strip()!r}")
            members.append((at[1], TYPES[kind], (int(at[2]),) if at[2] else ()))
    return np.dtype(members, align=True)
