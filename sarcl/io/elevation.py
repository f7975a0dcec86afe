"""Elevation models through rasterio: points on WGS84, heights above the ellipsoid."""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..base import arguments, errors, validation, wgs84
from . import input_paths, other_files

if TYPE_CHECKING:
    from rasterio import DatasetReader

    from ..base.types import PathLike

log = logging.getLogger(__name__)

MOST_POINTS = 25_000_000  # a point makes two facets; Scene.split has the same limit
LOWEST, HIGHEST = -1000.0, 9000.0  # m; land lies between -430 and 8849
METRES = {"metre": 1.0, "meter": 1.0, "m": 1.0, "foot": 0.3048, "us survey foot": 1200 / 3937}
WGS84 = "EPSG:4326"
Geoid = str | Path | ArrayLike | Callable[[np.ndarray, np.ndarray], ArrayLike] | None


@dataclass(frozen=True, eq=False)
class Tile:
    """longitude, latitude, degrees, and height above the ellipsoid, m, NaN without data: each (n_rows, n_columns)."""

    longitude: np.ndarray
    latitude: np.ndarray
    height: np.ndarray


def load(
    path: PathLike,
    *,
    bounds: ArrayLike | None = None,
    heights: str | None = None,
    geoid: Geoid = None,
    nodata: float | None = None,
    external: bool = False,
) -> Tile:
    """Points of an elevation model within bounds; arguments and errors as in Scene.from_dem."""
    path = arguments.path("path", path)
    name = f"DEM {path.name!r}"
    external = validation.flag("external", external)
    with _open_raster(path, name, external) as file:
        _check_place(file, name)
        above = _reference(file, name, heights, geoid)
        rows, columns = _window(file, name, bounds)
        height = _heights(file, name, rows, columns, nodata)
        longitude, latitude = _places(file, name, rows, columns)
    if above:
        height = height + undulation(geoid, longitude, latitude, name, above, external)
    reference = f"{above} changed to the ellipsoid's" if above else "the ellipsoid"
    log.info(
        f"{name}: {height.shape[0]} x {height.shape[1]} points, longitude {longitude.min():.5f} to "
        f"{longitude.max():.5f}, latitude {latitude.min():.5f} to {latitude.max():.5f}, {np.isnan(height).sum()} "
        f"without data, heights above {reference}"
    )
    return Tile(longitude, latitude, height)


def place(tile: Tile, frame: str, center: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    """Points and the ellipsoid's unit normals there, both (n_rows, n_columns, 3), in a frame of Scene.from_dem."""
    validation.choice("frame", frame, ("local", "ecef"))
    if frame == "ecef":
        if center is not None:
            raise ValueError("center is the origin of a local frame; leave it out with frame='ecef'")
        points = wgs84.ecef(tile.longitude, tile.latitude, tile.height)
        return points, wgs84.up(tile.longitude, tile.latitude)
    origin, axes = local_frame(tile, center)
    points = (wgs84.ecef(tile.longitude, tile.latitude, tile.height) - origin) @ axes.T
    return points, wgs84.up(tile.longitude, tile.latitude) @ axes.T


def local_frame(tile: Tile, center: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    """Origin, m (3,), and axes east, north, up (3, 3) of the local frame of Scene.from_dem, in Earth-centred axes."""
    longitudes = tile.longitude
    if np.ptp(longitudes) > 180:  # across the antimeridian: counted from the first one
        near = longitudes[0, 0] + (longitudes - longitudes[0, 0] + 180) % 360 - 180
        longitudes = near if np.ptp(near) < np.ptp(longitudes) else longitudes
    middle = [(a.min() + a.max()) / 2 for a in (longitudes, tile.latitude)]
    if center is None:
        center = middle
    center = validation.array("center", center, np.float64, ("n",))
    if len(center) not in (2, 3):
        raise ValueError(f"center has {len(center)} numbers; give (longitude, latitude), degrees, or with a height, m")
    longitude, latitude, height = [*map(float, center), 0.0][:3]
    origin = wgs84.ecef(longitude, latitude, height)
    if abs(latitude) > 90 or np.linalg.norm(wgs84.ecef(middle[0], middle[1], 0.0) - origin) > 1e6:
        raise ValueError(
            f"center ({longitude:g}, {latitude:g}) is more than 1000 km from the heights, which are about "
            f"({middle[0]:.4f}, {middle[1]:.4f}); give (longitude, latitude) in degrees"
        )
    return origin, wgs84.local_axes(longitude, latitude)


@contextmanager
def _open_raster(path: Path, name: str, external: bool) -> Iterator[DatasetReader]:
    """A raster, open for reading."""
    is_file = not path.is_dir()  # some formats are folders
    if is_file:
        input_paths.check(path, "DEM file")
    try:
        import rasterio
        from rasterio._err import CPLE_BaseError  # errors of GDAL that have no class in rasterio.errors
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
    except ImportError as exc:
        raise ImportError("elevation models need the package rasterio: pip install sarcl[maps]") from exc
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)  # the code below raises an error for it
        try:
            if is_file and not external:
                other_files.check_raster(path, name)
            with rasterio.open(path) as file:
                if is_file and not external:
                    other_files.check_parts(path, file.driver, file.files, name)
                yield file
        # a UnicodeDecodeError comes of GDAL's messages about names in the file
        except (RasterioError, CPLE_BaseError, UnicodeDecodeError) as exc:
            raise ValueError(f"{name} cannot be read ({exc}): it is damaged or no raster") from exc


def _check_place(file: DatasetReader, name: str) -> None:
    if file.crs is None or file.transform.is_identity:
        what = "CRS" if file.crs is None else "georeferencing"
        raise ValueError(
            f"{name} has no {what}, so its heights belong to no place; write it into the file (rio edit-info --crs "
            "EPSG:4326), or read the array yourself and use Scene.from_heights"
        )
    if not (file.crs.is_geographic or file.crs.is_projected):
        raise ValueError(f"{name} has a CRS that is neither geographic nor projected: {file.crs.to_wkt():.80}")
    if file.count != 1:
        raise ValueError(f"{name} has {file.count} bands; an elevation model has one: extract it (gdal_translate -b 1)")
    if file.width < 2 or file.height < 2:
        raise ValueError(f"{name} has {file.height} x {file.width} points; a cell needs two in either direction")


def _reference(file: DatasetReader, name: str, heights: str | None, geoid: Geoid) -> str:
    """The geoid that heights are above, by its name; "" for the ellipsoid."""
    wkt = file.crs.to_wkt(version="WKT2_2019")
    vertical = re.search(r'VERTCRS\["([^"]+)"', wkt)
    stated = vertical[1] if vertical else "ellipsoid" if "CS[ellipsoidal,3]" in wkt else ""
    if heights is not None and not (isinstance(heights, str) and heights):
        raise ValueError(f"heights is {heights!r}; give 'ellipsoid' or the name of a geoid, such as 'EGM96'")
    if heights is None and not stated:
        raise ValueError(
            f"{name} does not say what its heights are above; pass heights='ellipsoid', or the geoid's name "
            "(heights='EGM96' for SRTM, 'EGM2008' for Copernicus) with geoid=..."
        )
    words = [re.sub(r"[\W_]|height|geoid", "", s.lower()) for s in (stated, heights or stated)]
    ellipsoid = ["ellipsoid" in w for w in words]
    if stated and ellipsoid[0] != ellipsoid[1]:
        raise ValueError(f"heights is {heights!r}, but {name} says that its heights are above {stated!r}")
    if ellipsoid[1]:
        if geoid is not None:
            raise ValueError(f"{name} has heights above the ellipsoid; geoid=... would count the undulation twice")
        return ""
    if words[0] and words[0] != words[1]:
        log.info("%s says %r; its heights are taken above %r as asked", name, stated, heights)
    above = heights or stated
    if geoid is None:
        raise ValueError(
            f"{name} has heights above {above!r}, not above the ellipsoid; give the undulation as geoid=...: a number "
            "(m), an array, a function of longitude and latitude, or a raster file of it; geoid=0 leaves it out"
        )
    return above


def _window(file: DatasetReader, name: str, bounds: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the points within bounds."""
    if bounds is None:
        low, high = np.zeros(2), np.array([file.height, file.width]) - 1
    else:
        bounds = validation.array("bounds", bounds, np.float64, (4,))
        west, south, east, north = bounds
        if not (west < east and south < north and max(abs(south), abs(north)) <= 90 and max(abs(bounds)) <= 360):
            raise ValueError(
                f"bounds is ({west:g}, {south:g}, {east:g}, {north:g}); give (west, south, east, north) in degrees, "
                "west < east and south < north"
            )
        from rasterio.warp import transform_bounds

        left, bottom, right, top = transform_bounds(WGS84, file.crs, *bounds) if _is_warped(file) else bounds
        t = ~file.transform
        corners = [(t.d * x + t.e * y + t.f, t.a * x + t.b * y + t.c) for x in (left, right) for y in (bottom, top)]
        indices = np.array(corners) - 0.5  # points are centres of pixels
        low = np.maximum(np.ceil(indices.min(axis=0) - 1e-6), 0)
        high = np.minimum(np.floor(indices.max(axis=0) + 1e-6), (file.height - 1, file.width - 1))
    if (high - low < 1).any():
        from rasterio.warp import transform_bounds

        extent = ", ".join(f"{v:.5f}" for v in transform_bounds(file.crs, WGS84, *file.bounds))
        raise ValueError(
            f"bounds hold no cell of {name}, which reaches over ({extent}); check west, south, east, north"
        )
    shape = [int(b) - int(a) + 1 for a, b in zip(low, high, strict=True)]
    if shape[0] * shape[1] > MOST_POINTS:  # before there are lists of them
        raise MemoryError(
            f"{name} has {shape[0]} x {shape[1]} points, more than {MOST_POINTS:,}; give bounds=(west, south, "
            "east, north) of the part that the radar sees"
        )
    rows, columns = (np.arange(int(a), int(b) + 1) for a, b in zip(low, high, strict=True))
    return rows, columns


def _heights(file: DatasetReader, name: str, rows: np.ndarray, columns: np.ndarray, nodata: float | None) -> np.ndarray:
    """Heights in metres, NaN where there are none."""
    from rasterio.windows import Window

    window = Window(columns[0], rows[0], len(columns), len(rows))
    stored = file.read(1, window=window, masked=True)
    if stored.dtype.kind not in "iuf":
        raise ValueError(f"{name} holds {stored.dtype}; heights are real numbers")
    missing = np.ma.getmaskarray(stored) | ~np.isfinite(stored.data)
    if nodata is not None:
        missing |= stored.data == validation.number("nodata", nodata)
    unit = (file.units[0] or "metre").lower()
    if unit not in METRES:
        raise ValueError(f"{name} has heights in {unit!r}; known units are {', '.join(METRES)}")
    height = (stored.data.astype(np.float64) * file.scales[0] + file.offsets[0]) * METRES[unit]
    if missing.all():
        raise ValueError(f"{name} has no data there: every height is nodata; check bounds and nodata")
    odd = ~missing & ~((height >= LOWEST) & (height <= HIGHEST))
    if odd.any():
        i, j = np.unravel_index(int(odd.argmax()), odd.shape)
        raise ValueError(
            f"{name} has a height of {height[i, j]:g} m at row {rows[i]}, column {columns[j]} ({odd.sum()} of that "
            f"kind), which no land has; if {stored.data[i, j]:g} means no data, pass nodata={stored.data[i, j]:g}"
        )
    return np.where(missing, np.nan, height)


def _places(file: DatasetReader, name: str, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Longitude and latitude of points, degrees on WGS84 (n_rows, n_columns) each."""
    column, row = np.meshgrid(columns + 0.5, rows + 0.5)
    t = file.transform
    x, y = t.a * column + t.b * row + t.c, t.d * column + t.e * row + t.f
    longitude, latitude, off = x, y, np.zeros((2, 4))
    if _is_warped(file):
        from rasterio.warp import transform

        longitude, latitude = (np.reshape(a, x.shape) for a in transform(file.crs, WGS84, x.ravel(), y.ravel()))
        corners = np.ix_((0, -1), (0, -1))  # far beyond a map projection other numbers than infinity may come out
        back = transform(WGS84, file.crs, longitude[corners].ravel(), latitude[corners].ravel())
        with np.errstate(invalid="ignore"):  # infinite coordinates give NaN, which is refused below
            off = np.subtract(back, (x[corners].ravel(), y[corners].ravel()))
    on_earth = (abs(latitude) <= 90) & np.isfinite(longitude)
    if not (on_earth.all() and (np.hypot(*off) <= abs(t.a) + abs(t.b)).all()):
        raise ValueError(
            f"{name} has points that are on no place of the Earth (corners at {x[0, 0]:g}, {y[0, 0]:g} and "
            f"{x[-1, -1]:g}, {y[-1, -1]:g} in its CRS); check its georeferencing and its CRS"
        )
    return longitude, latitude


def _is_warped(file: DatasetReader) -> bool:
    """True where coordinates are not degrees on WGS84 already."""
    wkt = file.crs.to_wkt()
    degrees = re.search(r'GEOGCS\[.*?UNIT\["degree"', wkt) is not None
    return not (file.crs.is_geographic and 'DATUM["WGS_1984"' in wkt and degrees)


def undulation(
    geoid: Geoid, longitude: np.ndarray, latitude: np.ndarray, name: str, above: str, external: bool = False
) -> np.ndarray:
    """Height above the ellipsoid, m, of the geoid called `above`, at points, degrees (n_rows, n_columns)."""
    if isinstance(geoid, (str, Path)):
        return _raster(Path(geoid), longitude, latitude, external)
    if callable(geoid):
        geoid = geoid(longitude, latitude)
    if geoid is None or np.ndim(geoid) == 0:
        value = validation.number("geoid", geoid)
        if value == 0:
            errors.warn(
                f"{name} has heights above {above!r}, taken as heights above the ellipsoid (geoid=0): the scene lies "
                "wrong by the undulation, -107 to +86 m over the Earth"
            )
        return np.full(longitude.shape, value)
    return validation.array("geoid", geoid, np.float64, longitude.shape)


def _raster(path: Path, longitude: np.ndarray, latitude: np.ndarray, external: bool) -> np.ndarray:
    """A raster of undulations, in degrees, read bilinearly at points."""
    name = f"geoid {path.name!r}"
    with _open_raster(path, name, external) as file:
        _check_place(file, name)
        if _is_warped(file):
            raise ValueError(f"{name} is not in degrees on WGS84; convert it (gdalwarp -t_srs EPSG:4326)")
        t = ~file.transform
        around = abs(file.width * file.transform.a - 360) < 1e-6  # columns cover all longitudes
        west = file.bounds.left
        lon = west + (longitude - west) % 360 if around or (longitude < west).any() else longitude
        column, row = t.a * lon + t.b * latitude + t.c - 0.5, t.d * lon + t.e * latitude + t.f - 0.5
        i, j = np.floor(row).astype(int), np.floor(column).astype(int)
        i = np.clip(i, 0, file.height - 2)  # within half a pixel of the poles
        if not around:
            j = np.where(column == file.width - 1, j - 1, j)
        inside = (row >= -0.5) & (row <= file.height - 0.5) & (around | ((j >= 0) & (j < file.width - 1)))
        if not inside.all():
            raise ValueError(f"{name} covers {tuple(file.bounds)} degrees, not all of the heights")
        band = file.read(1, window=((i.min(), i.max() + 2), (0, file.width)), masked=True).astype(np.float64)
        values = band.filled(np.nan) * file.scales[0] + file.offsets[0]
        i0, j1, width = i - i.min(), (j + 1) % file.width, file.width
        u, v = row - i, column - j
        out = (1 - u) * ((1 - v) * values[i0, j % width] + v * values[i0, j1])
        out += u * ((1 - v) * values[i0 + 1, j % width] + v * values[i0 + 1, j1])
    validation.finite(name, out)
    return out
