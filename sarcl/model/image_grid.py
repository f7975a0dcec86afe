"""Image grids: positions of the pixels."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import arguments, validation
from ..base.boxes import box
from . import listed_surface
from ._grid_checks import FARTHEST, cells, pixels_of, side, steps, text

if TYPE_CHECKING:
    from ..base.types import PathLike
    from ..earth.elevation import ElevationModel, Geoid

MOST_NUMBERED = 2**63 - 1  # largest number of pixels that int64 can count


@dataclass(frozen=True, eq=False)
class ImageGrid:
    """Pixel positions: a plane (`ImageGrid.plane`), points of terrain (`on_terrain`), pixels of a map (`on_map`), any
    points (`points`), or a grid that an installed package adds (`extension`).

    shape    of the image
    center, spacing, x_axis, y_axis   of a plane: pixel [i, j] lies at
             center + (i - shape[0]//2) spacing[0] y_axis + (j - shape[1]//2) spacing[1] x_axis
    listed   positions of any points, m shape + (3,), or None; NaN in all three where a cell is empty
    times, ranges   zero-Doppler times of the rows, s, and slant ranges of the columns, m, where `range_doppler` listed
             the points; else None
    crs, map_axes  of `on_map`: coordinate reference system, and x and y of pixel [0, 0] with the steps from column to
             column and from row to row, in its units (4,); else None

    >>> grid = sarcl.ImageGrid.plane(center=(0, 0, 2), shape=(3, 5), spacing=0.5)
    >>> grid.positions.shape, grid.positions[1, 2]
    ((3, 5, 3), array([0., 0., 2.]))
    >>> grid.at(1.5, 2), grid.index((0.1, 0, 2))  # a position, and fractional (row, column)
    (array([0.  , 0.25, 2.  ]), array([1. , 2.2]))
    >>> grid.normal_at(1, 2), grid.spacing_at(1, 2)
    (array([0., 0., 1.]), (0.5, 0.5))
    >>> grid.columns(1, 3).shape, grid.part(slice(0, 3, 2), slice(4)).shape
    ((3, 2), (2, 4))
    >>> sarcl.ImageGrid.points([[0, 0, 1], [5, 0, 1]]).shape  # any positions
    (2,)
    >>> alps = sarcl.ElevationModel([7.0, 7.01, 7.02], [46.0, 46.01], [[500, 600, 700], [600, 700, 800]])
    >>> terrain = sarcl.ImageGrid.on_terrain(alps, spacing=50)
    >>> place = grid.on_earth(longitude=7.01, latitude=46.005, height=640)
    >>> utm = (350e3, 5.1e6, 351e3, 5.101e6)  # west, south, east, north, m
    >>> on_map = sarcl.ImageGrid.on_map("EPSG:32632", bounds=utm, spacing=10)  # needs sarcl[maps]
    >>> orbit = sarcl.Orbit.kepler(semi_major_axis=7.07e6, eccentricity=0, inclination=1.71)
    >>> times, ranges = np.linspace(0, 0.1, 3), 900e3 + 10 * np.arange(4)  # s, m
    >>> swath = sarcl.ImageGrid.zero_doppler(times, ranges, orbit.geolocate(times[:, None], ranges, heights=0.0))
    """

    shape: tuple[int, ...]
    center: NDArray[np.float64] | None = None
    spacing: tuple[float, float] | None = None
    x_axis: NDArray[np.float64] | None = None
    y_axis: NDArray[np.float64] | None = None
    listed: NDArray[np.float64] | None = None
    times: NDArray[np.float64] | None = None
    ranges: NDArray[np.float64] | None = None
    crs: str | None = None
    map_axes: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if (self.listed is None) == (self.spacing is None):
            raise ValueError("a grid is a plane or a list of points; make it with ImageGrid.plane or ImageGrid.points")
        if not isinstance(self.shape, (tuple, list, np.ndarray)):
            raise TypeError(f"shape is {self.shape!r:.60}; give a number of pixels for each axis: see ImageGrid.plane")
        object.__setattr__(self, "shape", tuple(validation.count(f"shape[{i}]", n) for i, n in enumerate(self.shape)))
        if self.listed is not None:
            validation.ndim("listed", self.listed)
            if np.shape(self.listed) != (*self.shape, 3):
                raise ValueError(
                    f"listed has shape {np.shape(self.listed)}, wanted {(*self.shape, 3)}, as the grid has shape "
                    f"{self.shape}; make it with ImageGrid.points"
                )
        arguments.text("crs", self.crs)
        lengths: dict[str, tuple[int | str]] = {"times": ("n",), "ranges": ("n",), "map_axes": (4,)}
        for name in ("center", "x_axis", "y_axis", "listed", "times", "ranges", "map_axes"):
            value = getattr(self, name)
            if value is None or (isinstance(value, np.ndarray) and not value.flags.writeable):
                continue
            if name == "listed":
                array = cells(validation.converted(name, value, np.float64))
            else:
                array = validation.array(name, value, np.float64, lengths.get(name, (3,)))
            object.__setattr__(self, name, array)
        if self.spacing is not None:
            object.__setattr__(self, "spacing", steps(self.spacing))
            if len(self.shape) != 2 or self.center is None or self.x_axis is None or self.y_axis is None:
                raise ValueError(
                    f"a plane has a shape of two axes, center, x_axis and y_axis, got shape {self.shape}; make it with "
                    "ImageGrid.plane"
                )

    @classmethod
    def plane(
        cls,
        *,
        center: ArrayLike = (0.0, 0.0, 0.0),
        shape: int | Sequence[int] | np.ndarray,
        spacing: float | Sequence[float] | np.ndarray,
        normal: ArrayLike = (0.0, 0.0, 1.0),
        x_axis: ArrayLike | None = None,
    ) -> ImageGrid:
        """A plane of shape (rows, columns) and spacing (row, column) m about `center`, m (3,).

        Columns run along x_axis (projected on the plane; default: the scene's x, or its y where x is the
        normal), rows along y_axis = normal x x_axis; row 0 is drawn at the bottom.
        """
        center = validation.array("center", center, np.float64, (3,))
        rows, columns = validation.pair("shape", shape)
        n = validation.direction("normal", normal)
        if x_axis is None:
            x_axis = (1.0, 0.0, 0.0) if abs(n[0]) < 0.999 else (0.0, 1.0, 0.0)
        x = validation.direction("x_axis", x_axis)
        x = x - (x @ n) * n
        if np.linalg.norm(x) < 1e-6:
            raise ValueError(f"x_axis {text(x_axis)} is along the normal {text(n)}; give one that lies in the plane")
        x /= np.linalg.norm(x)
        grid = cls(
            shape=(side("shape[0]", rows), side("shape[1]", columns)),
            center=center,
            spacing=steps(spacing),
            x_axis=x,
            y_axis=np.cross(n, x),
        )
        with np.errstate(over="ignore", invalid="ignore"):
            far = not (np.abs(grid.bounds) < FARTHEST).all()
        if far:
            assert grid.spacing is not None
            raise ValueError(
                f"pixels of center {text(center)} and spacing {text(grid.spacing)} reach beyond {FARTHEST:g} m, "
                "where distances overflow; give both in metres"
            )
        return grid

    @classmethod
    def points(cls, positions: ArrayLike, *, valid: ArrayLike | None = None) -> ImageGrid:
        """Any positions, m (..., 3); the image has the shape of all axes but the last.

        valid  bool, of that shape: False where a cell is empty (a height model without data there), whatever its
               position; NaN in all three coordinates means the same. The pixel of an empty cell is 0.
        Raises ValueError for NaN in one or two coordinates, for Inf, and where every cell is empty.
        """
        listed = validation.converted("positions", positions, np.float64)
        shape = listed.shape
        if len(shape) < 2 or shape[-1] != 3 or 0 in shape:
            raise ValueError(f"positions has shape {shape}, wanted (..., 3) with an axis before the last, none zero")
        if valid is not None:
            validation.ndim("valid", valid)
            mask = np.asarray(valid)
            if mask.dtype != bool or mask.shape != shape[:-1]:
                raise ValueError(f"valid is {mask.dtype} of shape {mask.shape}, wanted bool of shape {shape[:-1]}")
            listed[~mask] = np.nan
        return cls(shape=shape[:-1], listed=cells(listed))

    @classmethod
    def on_terrain(
        cls,
        dem: PathLike | ElevationModel,
        spacing: float | Sequence[float] | np.ndarray,
        *,
        bounds: Sequence[float] | np.ndarray | None = None,
        center: Sequence[float] | np.ndarray | None = None,
        frame: Literal["local", "ecef"] = "local",
        heights: str | None = None,
        geoid: Geoid = None,
        nodata: float | None = None,
        external: bool = False,
    ) -> ImageGrid:
        """Points on an elevation model, at even steps north (row) and east (column), m, seen from above.

        dem     a file, read as by `Scene.from_dem` with bounds, heights, geoid, nodata and external; or a
                `sarcl.ElevationModel`
        center, frame   as in `Scene.from_dem`: with the same values the grid lies on the scene's terrain

        Between the points of the model heights are bilinear. Cells without data are empty. ValueError, ImportError and
        FileNotFoundError as from `Scene.from_dem`.
        """
        from ..earth.elevation import ElevationModel

        external = validation.flag("external", external)
        spacing = steps(spacing)
        if not isinstance(dem, ElevationModel):
            dem = ElevationModel.read(
                arguments.path("dem", dem),
                bounds=bounds,
                heights=heights,
                geoid=geoid,
                nodata=nodata,
                external=external,
            )
        elif any(option is not None for option in (bounds, heights, geoid, nodata)):
            raise ValueError("bounds, heights, geoid and nodata are for files; an ElevationModel has been read already")
        return cls.points(dem.grid_positions(spacing, frame, center))

    @classmethod
    def on_map(
        cls,
        crs: str | int,
        *,
        bounds: Sequence[float] | np.ndarray | None = None,
        spacing: float | Sequence[float] | np.ndarray | None = None,
        heights: ArrayLike | ElevationModel = 0.0,
    ) -> ImageGrid:
        """Pixels on a regular grid of a map, Earth-fixed (pip install sarcl[maps]); row 0 is the southernmost.

        crs      coordinate reference system, as pyproj takes it: "EPSG:32633" (UTM), "EPSG:4326" (degrees)
        bounds   (west, south, east, north), in units of the CRS; None: those of the elevation model
        spacing  of (rows, columns), in units of the CRS; None: that of the elevation model
        heights  above the ellipsoid, m: a number, one for each pixel, or an elevation model; pixels without are empty

        `Image.save` writes an image on this grid as GeoTIFF without resampling. ValueError for an unknown CRS, one that
        does not reach the bounds, and units that do not fit; MemoryError: too many pixels; ImportError without pyproj.
        """
        from .maps.map_grid import on_map

        text, axes, positions = on_map(crs, bounds, spacing, heights)
        return replace(cls.points(positions), crs=text, map_axes=axes)

    @classmethod
    def zero_doppler(cls, times: ArrayLike, ranges: ArrayLike, positions: ArrayLike) -> ImageGrid:
        """Positions, m (rows, columns, 3), by zero-Doppler time, s (rows,), and slant range, m (columns,).

        Both axes must be evenly spaced: ValueError where they are not, or do not fit the positions.
        """
        grid = cls.points(positions)
        axes = []
        for name, value, n in (("times", times, grid.shape[0]), ("ranges", ranges, grid.shape[-1])):
            axis = validation.array(name, value, np.float64, (n,))
            change = np.diff(axis)
            rounding = 4 * float(np.spacing(np.abs(axis).max())) if n > 2 else 0.0  # of absolute times
            if not (change > 0).all() or (n > 2 and np.ptp(change) > 1e-6 * change.mean() + rounding):
                raise ValueError(f"{name} must increase in even steps; give one per row (times) or column (ranges)")
            axes.append(axis)
        return replace(grid, times=axes[0], ranges=axes[1])

    @classmethod
    def extension(cls, name: str, **options: object) -> ImageGrid:
        """The grid that an installed package adds under a name (docs/developers/extensions.md), with its options.

        ValueError for a name that no package adds; ImportError for a package that cannot be loaded; and as `points`.

        >>> fan = sarcl.ImageGrid.extension("fan", near=1, far=9)  # needs a package that adds "fan"
        """
        from ..io.added_grids import positions_of

        return cls.points(positions_of(name, options))

    def on_earth(self, longitude: float, latitude: float, height: float = 0.0) -> ImageGrid:
        """This grid, in x east, y north, z up of a place, in Earth-fixed coordinates: see `Scene.on_earth`.

        longitude, latitude  of the place, degrees;  height  above the ellipsoid, m
        """
        from ..earth.place import Place

        place = Place(longitude, latitude, height)
        if self.center is None or self.x_axis is None or self.y_axis is None:
            return replace(self, listed=place.positions(self.positions), crs=None, map_axes=None)
        axes: dict[str, Any] = {name: getattr(self, name) @ place.axes for name in ("x_axis", "y_axis")}
        return replace(self, center=place.positions(self.center), **axes)

    @property
    def is_plane(self) -> bool:
        """Whether the grid was made by `plane`."""
        return self.listed is None

    @property
    def size(self) -> int:
        """Number of pixels."""
        return math.prod(self.shape)

    @functools.cached_property
    def empty(self) -> np.ndarray | None:
        """True where a cell is empty, bool of the grid's shape; None where no cell is."""
        if self.listed is None:
            return None
        mask = np.isnan(self.listed[..., 0])
        return validation.sealed(mask) if mask.any() else None

    @functools.cached_property
    def _middle(self) -> int:
        """The column that lies at `center`."""
        return self.shape[1] // 2

    def columns(self, start: int, stop: int) -> ImageGrid:
        """Columns start ... stop - 1 of a plane, with the same positions to the bit."""
        self._plane("columns")
        start, stop = validation.count("start", start, None), validation.count("stop", stop, None)
        if not 0 <= start < stop <= self.shape[1]:
            raise IndexError(f"columns {start} to {stop} were requested, of {self.shape[1]}; start must be below stop")
        part = replace(self, shape=(self.shape[0], stop - start))
        part.__dict__["_middle"] = self._middle - start
        return part

    def part(self, *slices: slice) -> ImageGrid:
        """The grid of some of the pixels: `slices`, one for each of the first axes, with positive steps.

        IndexError where a step is not positive or nothing is left.
        """
        ranges = pixels_of(slices, self.shape)
        shape = tuple(map(len, ranges))
        if self.spacing is not None:
            rows, columns = ranges
            center = self.at(rows.start + rows.step * (shape[0] // 2), columns.start + columns.step * (shape[1] // 2))
            spacing = self.spacing[0] * rows.step, self.spacing[1] * columns.step
            return replace(self, shape=shape, center=validation.sealed(center), spacing=spacing)
        assert self.listed is not None
        listed = self.listed[tuple(slice(r.start, r.stop, r.step) for r in ranges)]
        if self.times is not None and self.ranges is not None:
            return ImageGrid.zero_doppler(self.times[list(ranges[0])], self.ranges[list(ranges[1])], listed)
        grid = ImageGrid.points(listed)
        if self.map_axes is None:
            return grid
        x, y, dx, dy = self.map_axes
        (a, b), (i, j) = (ranges[0].start, ranges[1].start), (ranges[0].step, ranges[1].step)
        return replace(grid, crs=self.crs, map_axes=np.array([x + b * dx, y + a * dy, dx * j, dy * i]))

    @property
    def x(self) -> NDArray[np.float64]:
        """Coordinates of a plane's columns along its x_axis, m (columns,)."""
        return self._along(1)

    @property
    def y(self) -> NDArray[np.float64]:
        """Coordinates of a plane's rows along its y_axis, m (rows,)."""
        return self._along(0)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Edges of a plane's pixels along x_axis and y_axis, m: (left, right, bottom, top)."""
        x, y = self.x, self.y
        dy, dx = (d / 2 for d in self._plane("extent").spacing)
        return float(x[0] - dx), float(x[-1] + dx), float(y[0] - dy), float(y[-1] + dy)

    def _along(self, axis: int) -> NDArray[np.float64]:
        plane = self._plane("x, y or extent")
        direction = (plane.y_axis, plane.x_axis)[axis]
        middle = (self.shape[0] // 2, self._middle)[axis]
        return np.asarray(plane.center @ direction + (np.arange(self.shape[axis]) - middle) * plane.spacing[axis])

    def filled(self) -> ImageGrid:
        """The grid with some position of another cell in every empty cell; itself where no cell is empty."""
        if self.empty is None or self.listed is None:
            return self
        listed = self.listed.copy()
        listed[self.empty] = listed[~self.empty][0]
        return ImageGrid(shape=self.shape, listed=validation.sealed(listed))

    def sample(self, most: int, seed: int) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
        """Up to `most` random pixels that are not empty: indices into an image, and positions, m (n, 3)."""
        most, random = validation.count("most", most), np.random.default_rng(validation.count("seed", seed, 0))
        if self.size > MOST_NUMBERED:  # the same pixel twice is unlikely
            index = tuple(random.integers(0, n, most) for n in self.shape)
            return index, self.positions_of(index)
        if self.empty is None:
            picked = np.sort(random.choice(self.size, min(most, self.size), replace=False))
        else:
            cells = np.flatnonzero(~self.empty)
            picked = cells[np.sort(random.choice(len(cells), min(most, len(cells)), replace=False))]
        index = np.unravel_index(picked, self.shape)
        return index, self.positions_of(index)

    def positions_of(self, index: tuple[np.ndarray, ...]) -> NDArray[np.float64]:
        """Positions, m (..., 3), of the pixels at whole indices into an image."""
        if not isinstance(index, tuple):
            raise TypeError(f"index is a {type(index).__name__}; give a tuple of whole numbers, an array per axis")
        if self.listed is None:
            return self.at(*index)
        arguments.checked_index("index", "a grid", index, self.shape)
        return self.listed[index]

    def normal_at(self, row: int, column: int) -> NDArray[np.float64]:
        """Unit normal (3,) at the pixel (row, column) of a plane, or of a grid that `zero_doppler` made."""
        down, right = self._steps_at(row, column)
        if self.is_plane:
            return self.normal
        across = np.cross(right, down)
        return np.asarray(across / np.linalg.norm(across))

    def spacing_at(self, row: int, column: int) -> tuple[float, float]:
        """Distance to the next row and column, m, at a pixel of a plane, or of a grid that `zero_doppler` made."""
        down, right = self._steps_at(row, column)
        return self.spacing or (float(np.linalg.norm(down)), float(np.linalg.norm(right)))

    def _steps_at(self, row: int, column: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Vectors from row to row and from column to column, m (3,), at a pixel or next to it."""
        pixel = [validation.number("row", row), validation.number("column", column)]
        i, j = np.clip(pixel, 0.5, np.array(self.shape) - 1.5)
        after_row, before_row, after_column, before_column = self.at([i + 0.5, i - 0.5, i, i], [j, j, j + 0.5, j - 0.5])
        return after_row - before_row, after_column - before_column

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal of a plane (3,)."""
        plane = self._plane("normal")
        return np.cross(plane.x_axis, plane.y_axis)

    @property
    def positions(self) -> NDArray[np.float64]:
        """All pixel positions, m, float64 shape + (3,); NaN where a cell is empty. MemoryError: too many."""
        if self.listed is not None:
            return self.listed
        shape = " x ".join(map(str, self.shape))
        validation.room(f"positions of {shape} pixels", 24.0 * self.size, "take rows of them: grid.at(row, column)")
        return self.at(np.arange(self.shape[0])[:, None], np.arange(self.shape[1]))

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the box around all pixels that are not empty, m (2, 3)."""
        if self.listed is not None:
            p = self.listed.reshape(-1, 3) if self.empty is None else self.listed[~self.empty]
        else:
            p = self.at(np.array([0, 0, 1, 1]) * (self.shape[0] - 1), np.array([0, 1, 0, 1]) * (self.shape[1] - 1))
        return box(p)

    def at(self, row: ArrayLike, column: ArrayLike) -> NDArray[np.float64]:
        """Position, m (..., 3), of (fractional) indices row, column of a plane, or of a grid by `zero_doppler`."""
        if self.times is not None and self.listed is not None:
            return listed_surface.at(self.listed, np.asarray(row), np.asarray(column))
        plane = self._plane("at")
        i = (validation.values("row", row) - self.shape[0] // 2) * plane.spacing[0]
        j = (validation.values("column", column) - self._middle) * plane.spacing[1]
        with np.errstate(invalid="ignore"):  # infinite indices have no position: NaN, as of NaN
            return plane.center + i[..., None] * plane.y_axis + j[..., None] * plane.x_axis

    def index(self, position: ArrayLike) -> NDArray[np.float64]:
        """Fractional (row, column) (..., 2) of a `position`, m (..., 3), projected on a plane or zero-Doppler grid."""
        if self.times is not None and self.listed is not None:
            return listed_surface.index(self.listed, np.asarray(position))
        plane = self._plane("index")
        offset = validation.vectors("position", position) - plane.center
        with np.errstate(over="ignore", invalid="ignore"):  # positions that are infinite have no index: NaN
            row = offset @ plane.y_axis / plane.spacing[0] + self.shape[0] // 2
            return np.stack([row, offset @ plane.x_axis / plane.spacing[1] + self._middle], axis=-1)

    def _plane(self, what: str) -> _Plane:
        """The axes of a plane; ValueError, which begins with `what`, where the grid lists its points."""
        if self.center is None or self.spacing is None or self.x_axis is None or self.y_axis is None:
            raise ValueError(f"{what} is for planes; this grid lists its points: use ImageGrid.plane")
        return _Plane(self.center, self.spacing, self.x_axis, self.y_axis)


class _Plane(NamedTuple):
    """Fields of an ImageGrid that is a plane."""

    center: NDArray[np.float64]
    spacing: tuple[float, float]
    x_axis: NDArray[np.float64]
    y_axis: NDArray[np.float64]
