"""Image: complex (or multilooked) pixels on a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from ..base import arguments, validation
from ..base.report import Report
from ..io import formats, hdf5
from .image_grid import ImageGrid

if TYPE_CHECKING:
    from types import EllipsisType

    import PIL.Image
    import xarray

    from ..base.types import LazyRows, PathLike
    from ..earth.elevation import ElevationModel
    from .maps.saving import SaveOptions

FRAMES = ("local", "earth-fixed")


@dataclass(frozen=True, eq=False)
class Image(np.lib.mixins.NDArrayOperatorsMixin):
    """An image on a grid.

    NumPy takes it for the array of its pixels: np.asarray(image), np.abs(image), 2 * image and image_a - image_b are
    arrays. image[10:20, ::2] is an Image of those pixels; any other index gives their values.

    data       complex, of grid.shape; real if it is intensity (after `multilook`). It may be a dataset of a file
    grid       positions of the pixels
    gain       sum of the weights of the rows that saw a pixel: a unit point gives |data| = gain at its position. A
               number where it is the same in all pixels, else an array of grid.shape, 0 where no row saw the pixel
    frequency  centre frequency, Hz, and
    tx, rx     antenna positions at mid-aperture, m (3,): the image's local carrier follows from them
    report     how the image was made

    Of the data that it was made from, where they are known:

    tx_velocity, rx_velocity   of the antennas at mid-aperture, m/s (3,)
    time          of the first and the last pulse, s (2,)
    band          lowest and highest frequency, Hz (2,)
    window        the window that it was made with, in words
    polarization  "HH", ..., or the several that were summed: "HH+VV"
    aperture      (k, 13), where rows saw different pixels: up to 256 rows, spread over all. Columns: tx and rx, m;
                  unit direction of the beam and cosine of half its angle (0 and -1: no beam); smallest and largest
                  half path of the range window, m; weight. What saw a position follows from them (`sarcl.measure`)
    metadata      XML of the SICD file that it was read from
    frame         of positions: "earth-fixed" where the grid lies within 32 km of the ellipsoid, or "local"

    >>> image.shape, round(float(abs(image[64, 64]) / image.gain), 2)
    ((128, 128), 1.0)
    >>> image.save("points.png", floor_db=-40)
    >>> round(float(image.decibels().max()), 2), round(float(abs(image.normalized()).max()), 2)  # a unit point
    (0.0, 1.0)
    >>> image.multilook((4, 2)).shape
    (32, 64)
    >>> picture = image.show(floor_db=-30)  # a PIL.Image.Image, which notebooks draw
    >>> dataset = image.to_xarray()  # needs sarcl[xarray]
    """

    data: Any
    grid: ImageGrid
    gain: float | NDArray[np.floating] = 1.0
    frequency: float | None = None
    tx: NDArray[np.float64] | None = None
    rx: NDArray[np.float64] | None = None
    report: Report | None = None
    tx_velocity: NDArray[np.float64] | None = None
    rx_velocity: NDArray[np.float64] | None = None
    time: NDArray[np.float64] | None = None
    band: NDArray[np.float64] | None = None
    window: str | None = None
    polarization: str | None = None
    frame: str | None = None
    aperture: NDArray[np.float64] | None = None
    metadata: str | None = None

    if TYPE_CHECKING:  # types of the arguments; the fields above have the types after conversion

        def __init__(
            self,
            data: ArrayLike | LazyRows,
            grid: ImageGrid,
            gain: ArrayLike = 1.0,
            frequency: float | None = None,
            tx: ArrayLike | None = None,
            rx: ArrayLike | None = None,
            report: Report | None = None,
            tx_velocity: ArrayLike | None = None,
            rx_velocity: ArrayLike | None = None,
            time: ArrayLike | None = None,
            band: ArrayLike | None = None,
            window: str | None = None,
            polarization: str | None = None,
            frame: str | None = None,
            aperture: ArrayLike | None = None,
            metadata: str | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        if isinstance(self.data, Image):
            raise TypeError("image data is an Image; give its pixels (image.data), or dataclasses.replace(image, ...)")
        if isinstance(self.data, (list, tuple)):
            validation.ndim("image data", self.data)
            object.__setattr__(self, "data", np.asarray(self.data))
        object.__setattr__(self, "data", validation.unmasked("image data", self.data))
        validation.instance("image grid", self.grid, ImageGrid)
        if tuple(np.shape(self.data)) != tuple(self.grid.shape):
            raise ValueError(
                f"image data has shape {tuple(np.shape(self.data))} but its grid {tuple(self.grid.shape)}; "
                "give one value per pixel"
            )
        if np.dtype(self.data.dtype).kind not in "fciu":
            raise ValueError(f"image data has type {self.data.dtype}, wanted complex or real numbers")
        if self.frequency is not None:
            object.__setattr__(self, "frequency", validation.number("image frequency", self.frequency, above=0))
        object.__setattr__(self, "gain", _checked_gain(self.gain, self.grid))
        for name, length in (("tx", 3), ("rx", 3), ("tx_velocity", 3), ("rx_velocity", 3), ("time", 2), ("band", 2)):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, validation.array(name, getattr(self, name), np.float64, (length,)))
        if self.aperture is not None:
            rows = validation.array("image aperture", self.aperture, np.float64, ("k", 13))
            object.__setattr__(self, "aperture", rows)
        for name, kind in (("report", Report), ("metadata", str)):
            if getattr(self, name) is not None:
                validation.instance(f"image {name}", getattr(self, name), kind)
        for name in ("window", "polarization"):
            arguments.text(f"image {name}", getattr(self, name))
        if self.frame is not None:
            validation.choice("image frame", self.frame, FRAMES)

    __eq__ = object.__eq__  # images are equal where they are one: their pixels are compared as np.asarray(image)
    __ne__ = object.__ne__
    __hash__ = object.__hash__

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        pixels = np.asarray(self.data, dtype)
        return np.array(pixels) if copy else pixels

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: object, **options: object) -> Any:
        return getattr(ufunc, method)(*(np.asarray(i) if isinstance(i, Image) else i for i in inputs), **options)

    def __len__(self) -> int:
        return int(self.grid.shape[0])

    def __getitem__(self, index: slice | int | np.ndarray | tuple[slice | int | EllipsisType, ...]) -> Any:
        """Pixels: an Image on their part of the grid where every axis has a slice (or none), else their values."""
        arguments.checked_index("index", "an image", index, tuple(self.grid.shape))
        slices = index if isinstance(index, tuple) else (index,)
        if len(slices) <= len(self.grid.shape) and all(isinstance(one, slice) for one in slices):
            gain = self.gain[slices] if isinstance(self.gain, np.ndarray) else self.gain
            return replace(self, data=self.data[slices], grid=self.grid.part(*slices), gain=gain)
        return self.data[index] if isinstance(self.data, np.ndarray) else np.asarray(self)[index]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the data, that of the grid."""
        return tuple(self.grid.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type of the data."""
        return np.dtype(self.data.dtype)

    @property
    def ndim(self) -> int:
        """Number of axes of the data."""
        return len(self.grid.shape)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Edges of the pixels of a plane, m: (left, right, bottom, top), as Matplotlib's imshow(extent=) takes them.

        Give it origin="lower" too: row 0 is drawn at the bottom.
        """
        return self.grid.extent

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.grid.shape))
        gain = f"{np.max(self.gain):.6g}"
        if isinstance(self.gain, np.ndarray):
            gain = f"{self.gain.min():.6g} to {gain}"
        return f"Image({shape} {self.data.dtype} pixels, gain {gain})"

    @property
    def is_complex(self) -> bool:
        """True until the image is detected (multilooked)."""
        return np.dtype(self.data.dtype).kind == "c"

    def normalized(self) -> NDArray[Any]:
        """Pixels over their gain: data/gain, or intensity over gain^2; 0 where no row saw the pixel.

        The squared modulus of a point's peak is its radar cross section, m^2.
        """
        data = np.asarray(self.data)
        if not isinstance(self.gain, np.ndarray):
            return np.asarray(data / (self.gain if self.is_complex else self.gain**2))
        # where no row saw a pixel its data are 0, whatever they are divided by
        gain = np.where(self.gain > 0, self.gain, 1)
        return np.asarray(data / (gain if self.is_complex else gain**2))

    def decibels(self) -> NDArray[np.float32]:
        """20 log10 |data/gain| (10 log10 of an intensity over gain^2), dB, float32; -inf where data is 0."""
        data = np.asarray(self.data)
        if not self.is_complex and (data < 0).any():
            pixel = [int(i) for i in np.unravel_index(int(np.argmin(data)), data.shape)]
            raise ValueError(f"image data{pixel} is {data.min():g}; an intensity is not negative")
        gain = np.where(self.gain > 0, self.gain, 1) if isinstance(self.gain, np.ndarray) else self.gain
        with np.errstate(divide="ignore"):
            if self.is_complex:
                return (20 * np.log10(np.abs(data) / gain)).astype(np.float32)
            return (10 * np.log10(data / gain**2)).astype(np.float32)

    def multilook(self, looks: int | Sequence[int] | np.ndarray) -> Image:
        """Mean intensity |data|^2 over blocks of looks = (rows, columns) pixels; incomplete blocks are left out.

        A gain that varies becomes the root of the mean of its square over the same blocks.
        Raises ValueError when the grid is neither a plane, a map, nor that of `range_doppler`, or the block is larger
        than the image.
        """
        if not self.grid.is_plane and self.grid.times is None and self.grid.map_axes is None:
            raise ValueError(
                "multilook is for images on a plane or a map, or by range_doppler; this grid lists its points"
            )
        a, b = validation.pair("looks", looks)
        a, b = validation.count("looks[0]", a), validation.count("looks[1]", b)
        rows, columns = self.grid.shape[0] // a, self.grid.shape[1] // b
        if rows == 0 or columns == 0:
            raise ValueError(f"looks ({a}, {b}) is larger than the image {self.grid.shape}; take fewer")
        data = np.asarray(self.data)[: rows * a, : columns * b]
        power = np.abs(data) ** 2 if self.is_complex else data

        def mean(values: np.ndarray) -> np.ndarray:
            return np.asarray(values.reshape(rows, a, columns, b).mean(axis=(1, 3)))

        gain = self.gain
        if isinstance(gain, np.ndarray):
            gain = np.sqrt(mean(gain[: rows * a, : columns * b] ** 2))
        return replace(self, data=mean(power), grid=_multilooked_grid(self.grid, a, b), gain=gain)

    def show(
        self,
        floor_db: float = -50.0,
        *,
        top_db: float | None = None,
        percentile: float | None = None,
        title: str | None = None,
    ) -> PIL.Image.Image:
        """The picture as a PIL.Image, grey in dB, with axes, a scale, and a caption that says what white and black are.

        Axes are those of a plane, in metres; of an image by `range_doppler` metres along the track from its middle, in
        the order of time upwards, and slant range less that of its middle; of a map its longitude and latitude or
        metres; of other listed points rows and columns.

        floor_db    black, in dB below white
        top_db      white, dB, where a unit point in focus has 0 dB; None: from the data, by percentile
        percentile  per cent of the pixels of the scene that are no brighter than white; None: 99.5, so that a few
                    bright points do not darken a scene; 100: white is the brightest pixel. Which pixels count:
                    `sarcl.figures.decibels.white_level`. Either top_db or percentile may be given
        title       text above the picture

        ValueError where the image has not two axes, or for levels that no picture can have.
        """
        from ..figures.decibels import picture
        from .maps.picture_axes import picture_axes

        title = arguments.text("title", title)
        if len(self.grid.shape) != 2:
            raise ValueError(f"a picture needs two axes; this image has shape {tuple(self.grid.shape)}")
        db = self.decibels()
        if not (db < np.inf).all():
            i, j = np.unravel_index(int(np.argmin(db < np.inf)), db.shape)
            raise ValueError(f"image data[{i}, {j}] is {np.asarray(self.data)[i, j]}; a picture needs finite pixels")
        return picture(
            db,
            picture_axes(self.grid),
            floor_db,
            title,
            top_db=top_db,
            percentile=percentile,
            zero="a unit point in focus",
        )

    def to_xarray(self) -> xarray.Dataset:
        """All fields as an xarray.Dataset (sarcl[xarray]): data (row, column), and the positions of the pixels.

        Coordinates are longitude, latitude and height of Earth-fixed images, else x, y and z, m: one per column and
        row where the axes are those of the scene. Units are attributes, and so are fields without rows; names of the
        grid's fields begin with grid_. ImportError names the extra.
        """
        from ._labelled import image_dataset

        return image_dataset(self)

    def layers(self, elevation: ElevationModel) -> dict[str, NDArray[np.bool_] | NDArray[np.float64]]:
        """ "layover", "shadow" (bool), "incidence" (rad) of terrain, `elevation`, at the pixels, each of grid.shape.

        They are those of the terrain above or below each pixel, for the antennas that the image keeps: tx and rx at
        mid-aperture, those of `aperture` that saw the pixel, or, of `range_doppler`, where they pass it. layover: other
        terrain has the same range and Doppler frequency; shadow: terrain hides the transmitter or the receiver;
        incidence: from the terrain's normal to the direction of the antenna, or between those of both antennas. Terrain
        beyond the model hides nothing; pixels outside it are False, and NaN in incidence. Equations and steps:
        sarcl/earth/layers.py. ValueError for an image in a local frame or without tx.

        >>> orbit = sarcl.Orbit.kepler(semi_major_axis=7.07e6, eccentricity=0, inclination=1.71)
        >>> lon, lat, _ = sarcl.wgs84.geodetic(orbit.boresight(10.0, look=0.5))  # degrees
        >>> target = sarcl.Scene.points([[0, 0, 0]]).on_earth(lon, lat)
        >>> seen = sarcl.echo(target, chirp, orbit.trajectory(center=10.0, prf=1500, n_pulses=16))
        >>> pixels = sarcl.backproject(seen, sarcl.ImageGrid.plane(shape=(8, 8), spacing=2.0).on_earth(lon, lat))
        >>> flat = sarcl.ElevationModel(lon + np.array([-0.1, 0.1]), lat + np.array([-0.1, 0.1]), np.zeros((2, 2)))
        >>> layers = pixels.layers(flat)
        >>> bool(layers["shadow"].any()), round(float(np.degrees(layers["incidence"].mean())), 1)
        (False, 32.1)
        """
        from .maps.saving import image_layers

        return image_layers(self, elevation)

    def _repr_png_(self) -> bytes | None:
        return self.show()._repr_png_()

    def save(
        self,
        path: PathLike,
        *,
        floor_db: float = -50.0,
        title: str | None = None,
        top_db: float | None = None,
        percentile: float | None = None,
        **options: Unpack[SaveOptions],
    ) -> None:
        """Write "name.png" (the picture of `show`), "name.h5", "name.zarr" or "name.nc", which lose nothing, SICD, or
        the map "name.tif".

        `sarcl.read` opens them all but pictures. Zarr and NetCDF are the dataset of `to_xarray`, made in memory
        (sarcl[xarray]). A map is a GeoTIFF with overviews, cloud-optimised (sarcl[maps]), of an Earth-fixed image. On a
        grid by `ImageGrid.on_map` pixels are written as they are; those of other grids are resampled block by block.
        Values are over the gain: a unit point has modulus 1. NaN means no data. Where heights of pixels differ, two
        bands hold them: "height" and "height remainder", m above the ellipsoid.

        value    "complex" (the default): band-limited interpolation about the carrier at the centre frequency;
                 "amplitude", or "db" of it: power averaged over each pixel of the map
        crs      coordinate reference system of the map; None: that of the grid, or the UTM zone of the image
        spacing  of (rows, columns), in units of the CRS; None: the closer spacing of the image's rows and columns
        layers   an ElevationModel: layover, shadow and incidence as further bands of amplitude or dB (`layers`)

        floor_db, top_db, percentile  of a picture, as in `show`; the PNG's text entries top_db, floor_db and
                                      Description say what white and black are;  title  above the picture
        On any exception `path` is as it was. ValueError for maps of a local frame, a CRS that does not reach the image,
        and complex pixels wider than its resolution; ImportError where a package is missing.

        SICD ("name.nitf", ".ntf", ".sicd"; sarcl[formats]) holds images by `backproject` on a plane, in complex64. Rows
        and columns are turned by quarter turns, so that rows lead away from the antenna; `sarcl.read` gives the same
        pixels at the same places. It takes

        collection    the phase history that the image was made of
        origin, axes  as in `PhaseHistory.save`: where local coordinates lie on the Earth
        metadata      CollectorName, CoreName, ModeType, Classification, CollectionStart (UTC of time 0); for two
                      platforms IlluminatorName; where the echoes lack them TxPol, RcvPol, TxTime (n_rows,). Names of a
                      CPHD file that the echoes were read from need not be given. ModeID, CountryCode, AzAutofocus,
                      RgAutofocus ("NO") and ImpRespWid ((2,), m; computed) may be
        version       "1.3.0" unless given, "1.4.0" for two platforms

        ValueError for what a SICD file must have and these lack, with the key of metadata= that gives it, and for
        spectra that its polynomials do not describe (docs/theory/sicd.md).
        """
        from .maps import saving

        image_formats = formats.writing(*formats.OF_IMAGES, "product")
        form = formats.named(arguments.path("path", path), image_formats)
        if form is None and not options and formats.save_added(path, self):
            return
        if form is None:
            endings = formats.suggested(image_formats, "'")
            raise ValueError(f"image path {str(path)!r} {formats.ending_of(path)}; choose {endings}")
        saving.check_options(path, options, form)
        if form is formats.SICD:
            from ..io.sicd import writing
            from .sicd.image_product import product_of

            writing.save(path, product_of(self, **options), self.data)  # type: ignore[misc]
            return
        if form.is_map:
            saving.save_map(self, path, **options)  # type: ignore[misc]
            return
        if form.is_picture:
            from ..figures.decibels import write_png

            picture = self.show(floor_db, top_db=top_db, percentile=percentile, title=title)
            write_png(picture, path)
            return
        if form.is_dataset:
            form.functions.write(path, self.to_xarray())
            return
        with form.functions.ImageWriter(path, formats.fields_of(self.grid), self.data.dtype) as writer:
            for a, b in hdf5.blocks(writer.data):
                writer.data[a:b] = np.asarray(self.data[a:b])
            writer.close(image_fields(self))


FIELDS = tuple(f.name for f in fields(Image) if f.name not in ("data", "grid"))  # as files hold them


def _checked_gain(gain: object, grid: ImageGrid) -> float | NDArray[np.floating]:
    """A gain as a number, or as a read-only array of the grid's shape; ValueError for one that cannot be."""
    if validation.ndim("image gain", gain) == 0:
        return validation.number("image gain", gain, above=0)
    kind = np.float32 if getattr(gain, "dtype", None) == np.float32 else np.float64
    gains = gain if isinstance(gain, np.ndarray) and gain.dtype == kind and gain.shape == grid.shape else None
    if gains is None or gains.flags.writeable:
        gains = validation.array("image gain", gain, kind, tuple(grid.shape))
    low = float(gains.min())
    if low < 0 or not np.isfinite(low) or not 0 < float(gains.max()) < np.inf:
        raise ValueError(
            f"image gain is {low:g} to {gains.max():g}; it is a sum of weights, 0 where no row saw a pixel, and "
            "greater than 0 elsewhere"
        )
    return gains


def _multilooked_grid(grid: ImageGrid, a: int, b: int) -> ImageGrid:
    """The grid of means over blocks of (a, b) pixels: the mean of a block lies at the mean position of its pixels."""
    rows, columns = grid.shape[0] // a, grid.shape[1] // b
    if grid.spacing is not None:
        center = grid.at((rows // 2) * a + (a - 1) / 2, (columns // 2) * b + (b - 1) / 2)
        spacing = grid.spacing[0] * a, grid.spacing[1] * b
        return replace(grid, shape=(rows, columns), center=center, spacing=spacing)
    if grid.map_axes is not None and grid.listed is not None:
        blocks = grid.listed[: rows * a, : columns * b].reshape(rows, a, columns, b, 3)
        x, y, dx, dy = grid.map_axes
        axes = np.array([x + (b - 1) / 2 * dx, y + (a - 1) / 2 * dy, b * dx, a * dy])
        return replace(ImageGrid.points(blocks.mean(axis=(1, 3))), crs=grid.crs, map_axes=axes)
    assert grid.times is not None and grid.ranges is not None
    i, j = np.arange(rows) * a + (a - 1) / 2, np.arange(columns) * b + (b - 1) / 2
    times, ranges = (
        values[: n * k].reshape(n, k).mean(axis=1)
        for values, n, k in ((grid.times, rows, a), (grid.ranges, columns, b))
    )
    return ImageGrid.zero_doppler(times, ranges, grid.at(i[:, None], j))


def image_fields(image: Image) -> dict[str, Any]:
    """All fields except data and grid, by name, as sarcl's files hold them."""
    return {name: getattr(image, name) for name in FIELDS}
