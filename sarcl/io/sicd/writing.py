"""A SICD file of an image: its metadata, and its pixels by blocks of rows.

Equations: docs/theory/sicd.md.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.types import PathLike
from .. import output_paths
from ..sarkit_library import Element
from ..sarkit_library import library as sarkit_module
from ._pixel_rows import turned
from ._product import tree_of

BLOCK_BYTES = 2**24  # bytes of pixels of a block of rows, about


@dataclass(frozen=True)
class Order:
    """How the pixels of an image lie in the file: transposed, then reversed along its rows, or columns, or both."""

    image_shape: tuple[int, int]
    is_transposed: bool
    reversed: tuple[bool, bool]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the file."""
        rows, columns = self.image_shape
        return (columns, rows) if self.is_transposed else (rows, columns)

    @property
    def scp_pixel(self) -> tuple[int, int]:
        """Row and column of the file that show the middle pixel of the image."""
        rows, columns = (
            n - 1 - n // 2 if is_reversed else n // 2 for n, is_reversed in zip(self.shape, self.reversed, strict=True)
        )
        return rows, columns

    def rows(self, pixels: Any, start: int, stop: int) -> np.ndarray:
        """Rows start ... stop - 1 of the file, of the pixels of an image."""
        n = self.shape[0]
        part = slice(n - stop, n - start) if self.reversed[0] else slice(start, stop)
        block = np.asarray(pixels[:, part]).T if self.is_transposed else np.asarray(pixels[part])
        with np.errstate(over="ignore"):  # becomes Inf, which `save` names
            return block[tuple(slice(None, None, -1 if r else 1) for r in self.reversed)].astype(np.complex64)


@dataclass(frozen=True, eq=False)
class Direction:
    """Rows or columns of the file: unit vector (3,); step and half-power width, m; in cycles per metre the bandwidth,
    the frequency that a constant has, and the middle of the spectrum less that, a polynomial by image coordinates."""

    axis: np.ndarray
    spacing: float
    width: float
    bandwidth: float
    center: float
    offset: np.ndarray


@dataclass(frozen=True, eq=False)
class Tracks:
    """Coefficients (degree + 1, 3) of positions by the file's clock: of the antenna, or of the equivalent of both."""

    arp: np.ndarray
    tx: np.ndarray | None = None
    rx: np.ndarray | None = None

    @property
    def is_monostatic(self) -> bool:
        """Whether one antenna sends and receives."""
        return self.tx is None


@dataclass(frozen=True, eq=False)
class Product:
    """What a SICD file says, Earth-fixed, SI units, times in s after `start`.

    scp        scene centre point, m (3,): the middle pixel;  directions  of rows and columns
    time_coa   time at which a pixel is seen, a polynomial by image coordinates
    duration   of the collection;  processed  first and last pulse;  band  lowest and highest frequency, Hz
    names      texts by element;  gain, window   of the image, where they have one value
    backscatter   of power: a polynomial by image coordinates of the factor to a backscatter coefficient, or None
    """

    order: Order
    scp: np.ndarray
    directions: tuple[Direction, Direction]
    time_coa: np.ndarray
    tracks: Tracks
    start: np.datetime64
    duration: float
    processed: tuple[float, float]
    band: tuple[float, float]
    polarization: tuple[str, str]
    names: dict[str, str]
    gain: float | None
    window: str | None
    backscatter: np.ndarray | None
    version: str

    def blocks(self) -> Iterator[tuple[int, int]]:
        """First row and stop of blocks of rows."""
        rows, columns = self.order.shape
        step = max(1, BLOCK_BYTES // (8 * columns))
        return ((a, min(a + step, rows)) for a in range(0, rows, step))


def save(path: PathLike, product: Product, pixels: Any) -> None:
    """Write an image to `path`, whole or not at all. ValueError names the first pixel that is not finite."""
    library = sarkit_module("sicd")
    tree = tree_of(library, product)
    security = {"security": {"clas": _letter(product.names["Classification"])}}
    station = product.names["CollectorName"]
    metadata = library.NitfMetadata(
        xmltree=tree,
        file_header_part={"ostaid": _ascii(station, 10), "ftitle": _ascii(product.names["CoreName"], 80), **security},
        im_subheader_part={"isorce": _ascii(station, 42), **security},
        de_subheader_part=security,
    )
    nitf = library.jbp_from_nitf_metadata(metadata)
    rows, columns = product.order.shape
    with output_paths.atomic(path, 8 * rows * columns) as part, open(part, "r+b") as file, warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # XML that is against the schema of the standard
        library.NitfWriter(file, metadata, jbp_override=nitf)
        quarters = [
            np.rint(4 * each.center * each.spacing) * (np.arange(n) - origin)
            for each, n, origin in zip(product.directions, product.order.shape, product.order.scp_pixel, strict=True)
        ]
        place = _places(nitf, 8 * columns)
        for a, b in product.blocks():
            block = product.order.rows(pixels, a, b)
            _check_finite(block, product.order, a)
            block = turned(block, -quarters[0][a:b], -quarters[1])
            for i in range(b - a):
                if i == 0 or place(a + i) != place(a + i - 1) + 8 * columns:
                    file.seek(place(a + i))
                file.write(block[i].astype(">c8").tobytes())


def _places(nitf: Element, n_bytes: int) -> Callable[[int], int]:
    """Bytes at which rows of n_bytes lie, in the one or several image segments of a NITF file."""
    segments = list(nitf["ImageSegments"])
    counts = [int(segment["subheader"]["NROWS"].value) for segment in segments]
    starts = [int(segment["Data"].get_offset()) for segment in segments]
    first = np.concatenate([[0], np.cumsum(counts)])

    def place(row: int) -> int:
        segment = int(np.searchsorted(first, row, "right")) - 1
        return starts[segment] + (row - int(first[segment])) * n_bytes

    return place


def _check_finite(block: np.ndarray, order: Order, first: int) -> None:
    """ValueError names a pixel of the image, by its own row and column, that is NaN or Inf."""
    if np.isfinite(block).all():
        return
    i, j = (int(k) for k in np.argwhere(~np.isfinite(block))[0])
    at = [n - 1 - k if r else k for n, k, r in zip(order.shape, (i + first, j), order.reversed, strict=True)]
    row, column = at[::-1] if order.is_transposed else at
    raise ValueError(f"image data[{row}, {column}] is {block[i, j]}; SICD holds finite pixels: set it to 0")


def _letter(classification: str) -> str:
    """The letter of a classification in NITF headers: T, S, C, R or U."""
    letters = {"TOP SECRET": "T", "SECRET": "S", "CONFIDENTIAL": "C", "RESTRICTED": "R", "UNCLASSIFIED": "U"}
    words = classification.strip().upper().replace("TS", "TOP SECRET", 1 if classification.startswith("TS") else 0)
    for name, letter in letters.items():
        if words.startswith(name) or words == letter or words.startswith(f"{letter}/"):
            return letter
    raise ValueError(
        f"metadata['Classification'] is {classification!r:.60}, and a NITF file wants one that begins with "
        f"{', '.join(letters)}"
    )


def _ascii(text: str, length: int) -> str:
    """The beginning of a text for a NITF header, which holds printable ASCII."""
    return text.encode("ascii", "replace").decode()[:length].strip()
