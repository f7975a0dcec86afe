"""Images as GeoTIFF through rasterio (pip install sarcl[maps]): cloud-optimised files (COG) with overviews, and back.

Rows come block by block, north first. Overviews halve both axes until the image fits into one tile: levels in dB and
amplitudes are averaged in power, which keeps the brightness of speckle; of complex numbers and masks every second
pixel is taken, because a mean would cancel phases.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import warn
from . import output_paths
from .formats import Make, T
from .sarkit_library import Refused, made_of, parsing, stamp

if TYPE_CHECKING:
    from types import ModuleType

    import rasterio

    from ..base.types import PathLike

# tags of sarcl's files that are numbers: fields of an image by their names, and the size of each
NUMBERS = {"band": 2, "time": 2, "tx": 3, "rx": 3, "tx_velocity": 3, "rx_velocity": 3}
# bands of heights above the ellipsoid, m, whose sum counts: float32 holds 48 bits of a height in two numbers
HEIGHTS = "height", "height remainder"
DIGITS = 8  # of a height in metres: finer than positions in float64 are
LEVEL = 0.1  # m, by which heights of pixels may differ that are taken for one: level planes follow no ellipsoid
SAME = 1e-6  # pixels, by which the axes in the tags may differ from those of the file: rounding of its corner
TILE = 512  # pixels along a tile's side, and rows that are written at once
COPIES = 3  # of the pixels on the disk while a file is made: without tiles, overviews, and the file itself
POWER = {"db": 10.0, "amplitude": 0.5}  # 10 log10 of a power, or its root


@dataclass(frozen=True)
class MapImage:
    """Description of a GeoTIFF.

    shape   (rows, columns);  corner  x and y of the outer corner of the north-western pixel;  step  of x and y, above 0
    crs     as WKT
    dtype   of all bands: float32, complex64 or complex128; NaN means no data
    bands   their names;  kinds  "amplitude" and "db" are averaged in overviews, others are not
    tags    metadata, as text
    """

    shape: tuple[int, int]
    corner: tuple[float, float]
    step: tuple[float, float]
    crs: str
    dtype: np.dtype
    bands: tuple[str, ...] = ("data",)
    kinds: tuple[str, ...] = ("complex",)
    tags: Mapping[str, str] = field(default_factory=dict)

    @property
    def n_bytes(self) -> int:
        """Bytes of the pixels."""
        return int(np.prod(self.shape)) * len(self.bands) * self.dtype.itemsize


def import_rasterio(what: str) -> ModuleType:
    """The package rasterio; ImportError names the extra."""
    try:
        import rasterio
    except ImportError as exc:
        raise ImportError(f"{what} needs the package rasterio: pip install sarcl[maps]") from exc
    return rasterio


def check_writable(path: PathLike, n_bytes: int = 0) -> Path:
    """As `output_paths.check_writable`; ImportError where a package is missing."""
    import_rasterio(str(path))
    return output_paths.check_writable(path, n_bytes)


def write(path: PathLike, header: MapImage, blocks: Iterable[np.ndarray]) -> None:
    """Write blocks (bands, rows, columns), which follow one another from north to south; on any exception `path` is
    as it was.

    Raises what `check_writable` raises.
    """
    target = check_writable(path, COPIES * header.n_bytes)
    rasterio = import_rasterio(str(path))
    with (
        rasterio.Env(GDAL_CACHEMAX=64, GDAL_DISABLE_READDIR_ON_OPEN="FALSE"),  # MB
        tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as folder,
    ):
        from rasterio.shutil import copy

        base = Path(folder) / "pixels.tif"
        options = {"COMPRESS": "DEFLATE", "OVERVIEWS": "FORCE_USE_EXISTING", "BIGTIFF": "IF_SAFER"}
        options |= {"BLOCKSIZE": str(TILE), "PREDICTOR": "NO" if header.dtype.kind == "c" else "YES"}
        try:
            _write_level(base, header, blocks)
            _write_overviews(base, header)
            output_paths.put_in_place(target, lambda new: copy(base, new, driver="COG", **options))
        except rasterio.errors.RasterioError as exc:
            raise OSError(f"cannot write {str(path)!r}: GDAL says {exc}; is there room on the disk?") from exc


def _write_level(path: Path, header: MapImage, blocks: Iterable[np.ndarray]) -> None:
    import rasterio
    from rasterio.windows import Window

    (x, y), (dx, dy) = header.corner, header.step
    with rasterio.open(
        path, "w", driver="GTiff", height=header.shape[0], width=header.shape[1], count=len(header.bands),
        dtype=header.dtype, crs=rasterio.crs.CRS.from_wkt(header.crs), nodata=np.nan, tiled=True, blockxsize=TILE,
        blockysize=TILE, transform=rasterio.Affine(dx, 0.0, x, 0.0, -dy, y), BIGTIFF="IF_SAFER", interleave="band",
    ) as file:  # fmt: skip
        file.update_tags(**header.tags)
        for i, name in enumerate(header.bands, 1):
            file.set_band_description(i, name)
            if name in HEIGHTS:
                file.set_band_unit(i, "m")
        row = 0
        for block in blocks:
            file.write(block, window=Window(0, row, block.shape[2], block.shape[1]))
            row += block.shape[1]


def _write_overviews(path: Path, header: MapImage) -> None:
    """Each level is the overview of the one before: GDAL's file x.tif.ovr, and x.tif.ovr.ovr of that."""
    import rasterio

    while max(header.shape) > TILE:
        half = replace(
            header,
            shape=(-(-header.shape[0] // 2), -(-header.shape[1] // 2)),
            step=(2 * header.step[0], 2 * header.step[1]),
            tags={},
        )
        with rasterio.open(path) as finer:
            path = path.with_name(path.name + ".ovr")
            _write_level(path, half, _halved(finer, header))
        header = half


def _halved(file: rasterio.DatasetReader, header: MapImage) -> Iterator[np.ndarray]:
    """Blocks of half the rows and columns; pixels without data do not count."""
    from rasterio.windows import Window

    rows, columns = header.shape
    for row in range(0, rows, 2 * TILE):
        fine = file.read(window=Window(0, row, columns, min(2 * TILE, rows - row)))
        coarse = fine[:, ::2, ::2].copy()
        for i, kind in enumerate(header.kinds):
            if kind in POWER:
                coarse[i] = _mean_level(fine[i], kind)
        yield coarse


def _mean_level(values: np.ndarray, kind: str) -> np.ndarray:
    """Means in power of 2 x 2 pixels with data, NaN where none has."""
    power = 10 ** (values / 10) if kind == "db" else values**2
    power = np.pad(power, [(0, n % 2) for n in power.shape], constant_values=np.nan)
    quarters = power.reshape(power.shape[0] // 2, 2, -1, 2)
    has_data = ~np.isnan(quarters)
    with np.errstate(divide="ignore", invalid="ignore"):  # NaN of no data, and -inf dB of no signal
        mean = np.where(has_data, quarters, 0).sum(axis=(1, 3)) / has_data.sum(axis=(1, 3))
        return np.asarray(10 * np.log10(mean) if kind == "db" else np.sqrt(mean))


def load(path: Path, make: Make[T]) -> T:
    """make("image", fields) of a map: one of sarcl's, or of complex pixels in one band of a north-up map with a CRS.

    Amplitudes and decibels become intensities; pixels without data 0, where the gain is 0. fields["grid"] has the CRS,
    `map_axes`, and a height for each pixel where the file has them, else one for all.
    ValueError, which names the file: truncated, damaged, without a CRS, rotated, pixels of unknown meaning. OSError:
    it changed while it was read. ImportError without rasterio.
    """
    rasterio = import_rasterio(str(path))
    name = repr(str(path))
    with (
        open(path, "rb") as opened,
        rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR", GDAL_PAM_ENABLED="NO"),  # no other files
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)  # becomes an error here
        before = stamp(opened)
        with parsing(name), rasterio.open(path, driver="GTiff") as file:
            fields = _fields(file)
        if stamp(opened) != before:
            raise OSError(f"{name} has changed while it was read; read it again with sarcl.read")
    low, high = fields.pop("heights")
    if np.ndim(fields["grid"]["height"]) == 0 and not high - low <= LEVEL:
        known = "does not say the heights of its pixels" if np.isnan(low) else f"has pixels at {low:g} to {high:g} m"
        warn(f"{name} {known}: positions are {fields['grid']['height']:g} m above the ellipsoid")
    return made_of(make, "image", fields, name)


def _fields(file: rasterio.DatasetReader) -> dict[str, Any]:
    """Fields of an Image; "heights" are the least and largest of its pixels, NaN where the file has none."""
    tags = file.tags()
    value = tags.get("VALUE", "").split(" ")[0] if tags.get("SOFTWARE", "").startswith("sarcl ") else ""
    kind = np.dtype(file.dtypes[0]).kind if file.dtypes[0] != "complex_int16" else "c"
    if file.crs is None:
        raise Refused("is no map: it has no coordinate reference system; have it geocoded to one")
    if (file.count > 1 and not value) or (value or "complex") not in (*POWER, "complex"):
        raise Refused(f"has {file.count} bands, wanted one of complex pixels, or a map that sarcl wrote")
    if not value and kind != "c":
        raise Refused(
            f"has {file.dtypes[0]} pixels, which may be amplitudes, intensities, decibels or no radar image; sarcl "
            "reads complex pixels, and its own maps"
        )
    t = file.transform
    if t.b or t.d or t.a <= 0 or t.e >= 0:
        raise Refused("is rotated, or its first row is not the northern one; have it warped to a north-up map")
    axes = np.array([t.c + t.a / 2, t.f + t.e * (file.height - 0.5), t.a, -t.e])
    stored = _numbers(tags, "AXES", 4)
    if stored is not None and (np.abs(stored - axes) <= SAME * axes[[2, 3, 2, 3]]).all():
        axes = stored
    pixels = file.read(1)[::-1]
    has_data = ~np.isnan(pixels) if file.nodata is None or np.isnan(file.nodata) else pixels != file.nodata
    if value in POWER:
        pixels = pixels.astype(np.float64)
        pixels = 10 ** (pixels / 10) if value == "db" else pixels**2
    elif pixels.dtype.kind != "c":
        raise Refused(f"is said to be complex, and has {file.dtypes[0]} pixels: another program has changed it")
    if not np.isfinite(pixels[has_data]).all():
        raise Refused("has pixels that are infinite; have it written without")
    heights = _numbers(tags, "HEIGHTS", 2)
    heights = np.full(2, np.nan) if heights is None else heights
    numbers = {name: _numbers(tags, name.upper(), n) for name, n in NUMBERS.items()} if value else {}
    frequency = _numbers(tags, "FREQUENCY", 1) if value else None
    words = {name: tags.get(name.upper()) for name in ("window", "polarization")} if value else {}
    by_pixel = _heights_by_pixel(file) if value else None
    height = by_pixel if by_pixel is not None else 0.0 if np.isnan(heights[0]) else float(heights.mean())
    return {
        "data": np.where(has_data, pixels, 0),
        "grid": {"shape": file.shape, "crs": file.crs.to_wkt(), "map_axes": axes, "height": height},
        "gain": 1.0 if has_data.all() else has_data.astype(np.float32),
        "frame": "earth-fixed",
        "heights": tuple(heights.tolist()),
        "frequency": None if frequency is None else float(frequency[0]),
        **numbers,
        **words,
    }


def split_heights(heights: np.ndarray) -> list[np.ndarray]:
    """Bands of heights (rows, columns), m, in the order of HEIGHTS."""
    heights = np.round(heights, DIGITS)
    coarse = heights.astype(np.float32).astype(np.float64)
    return [coarse, heights - coarse]


def _heights_by_pixel(file: rasterio.DatasetReader) -> np.ndarray | None:
    """Heights (rows, columns), m, of the bands HEIGHTS, south first; NaN where there is no position, None without."""
    if not set(HEIGHTS) <= set(file.descriptions):
        return None
    bands = (file.read(1 + file.descriptions.index(name))[::-1] for name in HEIGHTS)
    heights = sum(np.asarray(band.real, np.float64) for band in bands)
    if np.isinf(heights).any():
        raise Refused("has heights that are infinite: it is damaged")
    return np.round(heights, DIGITS)


def _numbers(tags: Mapping[str, str], name: str, n: int) -> np.ndarray | None:
    """The numbers (n,) of a tag; None where there is none. ValueError for others."""
    if name not in tags:
        return None
    values = np.array([float(word) for word in tags[name].split()])
    if values.shape != (n,) or not np.isfinite(values).all():
        raise Refused(f"has the tag {name} = {tags[name]!r:.60}, wanted {n} numbers: it is damaged")
    return values
