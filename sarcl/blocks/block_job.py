"""One result that is computed in blocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import DTypeLike

from ..io import output_paths
from ..io.formats import Kind
from .bands import Bands, Tally


@dataclass(frozen=True, eq=False)
class BlockJob:
    """One result that is computed in blocks.

    kind      of its file
    stage     name of the work, for progress and report
    bands     its division;  unit  number of consecutive bands that share work: blocks begin at multiples of it if
              possible
    dtype     of its values;  tally  class of what is known of a block besides its values
    passes    contributions to one unit of work of the bands: progress counts units times passes
    describe  everything that the values depend on, as text and numbers (see tile_files.mark)
    folder    ending of the folder of its tile files, after the path of the result
    """

    kind: Kind
    stage: str
    bands: Bands
    unit: int
    dtype: DTypeLike
    tally: type[Tally]
    passes: int
    describe: Callable[[], dict[str, Any]]
    folder: str = output_paths.TILES
