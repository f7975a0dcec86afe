"""Types of arguments that several rooms take, for annotations."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

PathLike: TypeAlias = str | os.PathLike[str]


class LazyRows(Protocol):
    """Rows that may lie in a file: a memmap, an HDF5 dataset, or anything else with shape, dtype and row slicing."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    @property
    def dtype(self) -> np.dtype[Any]: ...

    def __getitem__(self, rows: slice, /) -> ArrayLike: ...


class WritableArray(Protocol):
    """An array or a dataset of a file that a result is written into, block by block."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    @property
    def dtype(self) -> np.dtype[Any]: ...

    def __setitem__(self, at: object, block: object, /) -> None: ...
