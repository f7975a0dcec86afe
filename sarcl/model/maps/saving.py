"""Images saved as maps (GeoTIFF), and layers of terrain on their grids: `Image.save` and `Image.layers`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypedDict

import numpy as np
from numpy.typing import NDArray

from ...base import arguments, validation, wgs84
from ...base.text import unknown
from ...base.types import PathLike
from ...base.vectors import Floats
from ...base.version import __version__
from ...earth.elevation import ElevationModel
from ...earth.layers import Layers, layers
from ...earth.map_projection import MapProjection
from ...io import formats, geotiff
from ..sicd.image_product import EarthOptions
from ._resampling import Resampling
from ._source import Source
from .antennas import antennas_of
from .map_grid import MapAxes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike  # noqa: F401  # of EarthOptions

    from ..image import Image
    from ..image_grid import ImageGrid
    from ..phase_history import PhaseHistory  # noqa: F401  # of EarthOptions

VALUES = ("complex", "amplitude", "db")
LAYERS = ("layover", "shadow", "incidence")
NODES = 65  # along each side of an image, whose heights the file names
HEIGHT_DIGITS = 6  # of a height in metres: those of one height differ by the rounding of Earth-fixed positions
POINTS = 16_384  # positions whose layers are computed at once


class MapOptions(TypedDict, total=False):
    """Options of `Image.save` for GeoTIFF files."""

    value: Literal["complex", "amplitude", "db"]
    crs: str | int | None
    spacing: float | tuple[float, float] | None
    layers: ElevationModel | Literal[False]


class SaveOptions(EarthOptions, MapOptions, total=False):
    """Options of `Image.save` for files of one kind alone: SICD, or GeoTIFF."""


def check_options(path: PathLike, options: SaveOptions, form: formats.Format) -> None:
    """TypeError for options that save() does not know, ValueError for those that files of this kind do not take."""
    takes = EarthOptions if form is formats.SICD else MapOptions if form.is_map else None
    for name in options:
        if name not in SaveOptions.__annotations__:
            raise TypeError(unknown(name, [*SaveOptions.__annotations__], "option of save()"))
        if takes is None or name not in takes.__annotations__:
            kind = "maps (.tif)" if name in MapOptions.__annotations__ else "SICD (.nitf, .ntf or .sicd)"
            raise ValueError(f"{name}: for {kind}, and {str(path)!r} does not end so")


def check_place(grid: ImageGrid, frame: str | None = None) -> None:
    """ValueError where the grid of an image has no two axes, or its frame, told by its place if None, is local."""
    if len(grid.shape) != 2 or min(grid.shape) < 2:
        raise ValueError(f"a map needs two rows and two columns; this image has shape {grid.shape}")
    if frame == "local" or (frame is None and wgs84.vertical_at(grid.bounds.mean(axis=0)) is None):
        raise ValueError(
            "the image is in a local frame, whose place on the Earth is not known, so it makes no map; focus on an "
            "Earth-fixed grid (ImageGrid.on_map, on_terrain(frame='ecef'), grid.on_earth) with Earth-fixed echoes"
        )


def image_layers(image: Image, elevation: ElevationModel) -> dict[str, NDArray[np.bool_] | Floats]:
    """`Image.layers`."""
    check_place(image.grid, image.frame)
    values = _layers_at(image, elevation, image.grid.positions.reshape(-1, 3))
    return {name: getattr(values, name).reshape(image.shape) for name in LAYERS}


def _layers_at(image: Image, elevation: ElevationModel, positions: Floats) -> Layers:
    """Layers at positions, m (n, 3), Earth-fixed or NaN."""
    validation.instance("elevation", elevation, ElevationModel)
    tx_velocity = image.tx_velocity
    rx_velocity = tx_velocity if image.rx is None and image.rx_velocity is None else image.rx_velocity
    speeds = None if tx_velocity is None or rx_velocity is None else (tx_velocity, rx_velocity)
    n = len(positions)
    out = Layers(np.zeros(n, bool), np.zeros(n, bool), np.full(n, np.nan))
    full = np.flatnonzero(np.isfinite(positions[:, 0]))
    for start in range(0, len(full), POINTS):
        rows = full[start : start + POINTS]
        ends = antennas_of(image, "layers", positions[rows])
        for all_values, values in zip(out, layers(elevation, positions[rows], ends, speeds), strict=True):
            all_values[rows] = values
    return out


def save_map(
    image: Image,
    path: PathLike,
    *,
    value: str = "complex",
    crs: str | int | None = None,
    spacing: float | tuple[float, float] | None = None,
    layers: ElevationModel | Literal[False] = False,
) -> None:
    """`Image.save` of a GeoTIFF file."""
    validation.choice("value", value, VALUES)
    check_place(image.grid, image.frame)
    if value == "complex" and not image.is_complex:
        raise ValueError("the image is detected, so it has no complex values; give value='amplitude' or 'db'")
    if layers is not False:
        validation.instance("layers", layers, ElevationModel)
        if value == "complex":
            raise ValueError("layers are real bands beside an amplitude; give value='amplitude' or 'db' with layers=")
    geotiff.check_writable(path)
    picture = _MapPicture.of(image, value, crs, spacing, layers or None)
    geotiff.write(arguments.path("path", path), picture.header(), picture.blocks())


@dataclass(frozen=True, eq=False)
class _MapPicture:
    """An image on a map: pixels as they are where `resampling` is None."""

    image: Image
    value: str
    projection: MapProjection
    axes: MapAxes
    resampling: Resampling | None
    elevation: ElevationModel | None

    @classmethod
    def of(
        cls, image: Image, value: str, crs: str | int | None, spacing: object, elevation: ElevationModel | None
    ) -> _MapPicture:
        grid = image.grid
        if grid.crs is not None and grid.map_axes is not None and spacing is None:
            projection = MapProjection.of(grid.crs)
            if crs is None or MapProjection.of(crs).text == projection.text:
                x, y, dx, dy = grid.map_axes.tolist()
                axes = MapAxes(x, y, dx, dy, (grid.shape[0], grid.shape[1]))
                return cls(image, value, projection, axes, None, elevation)
        source = Source.of(grid, grid.crs if crs is None else crs)
        axes = source.axes(spacing)
        resampling = Resampling(image, source, axes, value == "complex")
        if value == "complex":
            resampling.check_aliasing()
        return cls(image, value, source.projection, axes, resampling, elevation)

    def header(self) -> geotiff.MapImage:
        """Description of the file."""
        west, _, _, north = self.axes.bounds
        bands, kinds = [self.value], [self.value]
        if self.elevation is not None:
            bands, kinds = [*bands, *LAYERS], [*kinds, *("mask",) * len(LAYERS)]
        if self.has_heights:
            bands, kinds = [*bands, *geotiff.HEIGHTS], [*kinds, *("height",) * len(geotiff.HEIGHTS)]
        return geotiff.MapImage(
            shape=self.axes.shape,
            corner=(west, north),
            step=(self.axes.dx, self.axes.dy),
            crs=self.projection.crs.to_wkt(),
            dtype=np.result_type(self.image.dtype, np.complex64) if self.value == "complex" else np.dtype(np.float32),
            bands=tuple(bands),
            kinds=tuple(kinds),
            tags=self._tags(),
        )

    def _tags(self) -> dict[str, str]:
        image = self.image
        tags = {
            "SOFTWARE": f"sarcl {__version__}",
            "VALUE": f"{self.value} over gain: a unit point has modulus 1; its square is a radar cross section, m^2",
        }
        numbers = {"AXES": self.axes[:4], "HEIGHTS": self.heights}
        tags |= {name: " ".join(repr(float(v)) for v in values) for name, values in numbers.items()}
        names = ("frequency", "band", "time", "tx", "rx", "tx_velocity", "rx_velocity", "window", "polarization")
        for name in names:
            field = getattr(image, name)
            if field is not None:
                tags[name.upper()] = " ".join(map(str, np.atleast_1d(field).tolist()))
        return tags

    @cached_property
    def heights(self) -> tuple[float, float]:
        """Least and largest height above the ellipsoid, m, of a lattice of the image's pixels."""
        ends = (np.unique(np.linspace(0, n - 1, NODES).astype(int)) for n in self.image.shape)
        nodes = self.image.grid.positions_of(tuple(np.meshgrid(*ends, indexing="ij"))).reshape(-1, 3)
        heights = np.round(wgs84.geodetic(nodes[np.isfinite(nodes[:, 0])])[2], HEIGHT_DIGITS)
        return float(heights.min()), float(heights.max())

    @cached_property
    def has_heights(self) -> bool:
        """Whether the file needs a height for each pixel: heights differ, or resampled ones by more than LEVEL."""
        low, high = self.heights
        if self.resampling is not None or self.image.grid.listed is None:
            return high - low > geotiff.LEVEL
        if high > low:
            return True
        # the ellipsoid with longer half axes stays within 4 cm of the surface at a height below 10 km
        radius, pole = wgs84.SEMI_MAJOR + low, wgs84.SEMI_MAJOR * (1 - wgs84.FLATTENING) + low
        spread = [np.inf, -np.inf]
        for row in self.image.grid.listed:  # a hill may lie between the lattice's pixels
            distance = radius * (np.linalg.norm(row / [radius, radius, pole], axis=1) - 1)
            spread = [np.fmin(spread[0], np.fmin.reduce(distance)), np.fmax(spread[1], np.fmax.reduce(distance))]
        return bool(spread[1] - spread[0] > geotiff.LEVEL)

    def blocks(self) -> Iterator[np.ndarray]:
        """Blocks of rows of all bands, from north to south."""
        for stop in range(self.axes.shape[0], 0, -geotiff.TILE):
            rows = range(max(stop - geotiff.TILE, 0), stop)
            values = self._values(rows)
            if self.value == "db":
                with np.errstate(divide="ignore"):
                    values = 20 * np.log10(values)
            bands = [values]
            if self.elevation is not None:
                bands += self._layer_bands(rows)
            if self.has_heights:
                bands += geotiff.split_heights(self._heights_of(rows))
            yield np.stack(bands)[:, ::-1].astype(self.header().dtype)

    def _values(self, rows: range) -> np.ndarray:
        """Complex values or amplitudes over the gain (n, columns), NaN without data."""
        if self.resampling is not None:
            return self.resampling.values(rows)
        part = slice(rows.start, rows.stop)
        values = self.image[part].normalized()
        values = values.astype(np.result_type(values.dtype, np.float32))
        gain, empty = self.image.gain, self.image.grid.empty
        if isinstance(gain, np.ndarray):
            values[gain[part] == 0] = np.nan
        if empty is not None:
            values[empty[part]] = np.nan
        if self.value == "complex":
            return values
        return np.abs(values) if self.image.is_complex else np.sqrt(values)

    def _heights_of(self, rows: range) -> Floats:
        """Heights above the ellipsoid, m (n, columns), NaN where there is no position."""
        if self.resampling is not None:
            return self.resampling.heights(rows)
        index = np.meshgrid(np.arange(rows.start, rows.stop), np.arange(self.axes.shape[1]), indexing="ij")
        return wgs84.geodetic(self.image.grid.positions_of(tuple(index)))[2]

    def _layer_bands(self, rows: range) -> list[np.ndarray]:
        assert self.elevation is not None
        x, y = self.axes.rows(rows.start, rows.stop)
        longitude, latitude = self.projection.places(x, y)
        height = self.elevation.heights_at(longitude, latitude)
        values = _layers_at(self.image, self.elevation, wgs84.ecef(longitude, latitude, height).reshape(-1, 3))
        return [getattr(values, name).reshape(x.shape) for name in LAYERS]
