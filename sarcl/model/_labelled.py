"""Images and echoes as xarray datasets: every field by its name, coordinates and units beside it.

A field is a variable where it is an array of several rows, else an attribute; None is left out. Fields of the grid have
names that begin with grid_. sarcl/io/labelled_files.py writes these datasets, and gives their fields back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import wgs84
from ..io import formats, hdf5
from ..io.labelled_files import GRID, import_xarray
from ._row_fields import PER_ROW

if TYPE_CHECKING:
    import xarray

    from .image import Image
    from .image_grid import ImageGrid
    from .phase_history import PhaseHistory

# units of fields and coordinates, in the words of UDUNITS, which xarray's other users read
UNITS = {
    "frequency": "Hz", "frequency_step": "Hz", "time": "s", "times": "s", "ranges": "m", "reference_range": "m",
    "tx": "m", "rx": "m", "tx_velocity": "m s-1", "rx_velocity": "m s-1", "x": "m", "y": "m", "z": "m",
    "height": "m", "longitude": "degrees_east", "latitude": "degrees_north", f"{GRID}listed": "m",
}  # fmt: skip
AXES = ("x", "y", "z")


def image_dataset(image: Image) -> xarray.Dataset:
    """`Image.to_xarray`."""
    xarray = import_xarray("to_xarray")
    shape = image.shape
    dims = ("row", "column") if len(shape) == 2 else tuple(f"axis_{i}" for i in range(len(shape)))
    fields = formats.fields_of(image)
    fields |= {GRID + name: value for name, value in formats.fields_of(image.grid).items()}
    del fields["grid"], fields[f"{GRID}shape"], fields[f"{GRID}times"], fields[f"{GRID}ranges"]  # in the dataset's axes
    fields["report"] = None if image.report is None else hdf5.report_text(image.report)
    axes = {"data": dims, "gain": dims, "aperture": ("aperture_row", "quantity"), f"{GRID}listed": (*dims, "axis")}
    variables, attributes = _split(fields, axes)
    coordinates = _positions(image.grid, dims, image.frame)
    for name, dim in (("times", dims[0]), ("ranges", dims[-1])):
        if getattr(image.grid, name) is not None:
            coordinates[name] = ((dim,), getattr(image.grid, name))
    return xarray.Dataset(_with_units(variables), _with_units(coordinates), attributes)


def phase_history_dataset(raw: PhaseHistory) -> xarray.Dataset:
    """`PhaseHistory.to_xarray`."""
    xarray = import_xarray("to_xarray")
    step, first = raw.frequency_step[:, None], raw.frequency[:, None]
    is_common = bool((step == step[0]).all() and (first == first[0]).all())
    rows = slice(0, 1) if is_common else slice(None)
    frequencies = first[rows] + np.arange(raw.n_samples) * step[rows]
    coordinates: dict[str, Any] = {
        "frequency": (("sample",), frequencies[0]) if is_common else (("row", "sample"), frequencies)
    }
    variables: dict[str, Any] = {"samples": (("row", "sample"), np.asarray(raw.samples[:]))}
    for name in ("reference_range", "tx", "rx", *PER_ROW):
        value = getattr(raw, name)
        if value is not None:
            coordinates[name] = (("row", "axis") if value.ndim == 2 else ("row",), value)
    coordinates["axis"] = (("axis",), list(AXES))
    attributes: dict[str, str | float] = {"compressed": int(raw.compressed), "swath": float(raw.swath.min())}
    attributes |= {} if raw.report is None else {"report": hdf5.report_text(raw.report)}
    attributes |= {} if raw.waveform is None else {"waveform": str(raw.waveform)}
    return xarray.Dataset(_with_units(variables), _with_units(coordinates), attributes)


def _split(fields: dict[str, Any], axes: dict[str, tuple[str, ...]]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables of the fields that have axes, and attributes of all others; fields that are None are in neither."""
    variables, attributes = {}, {}
    for name, value in fields.items():
        if value is None:
            continue
        if name in axes and np.ndim(value):
            variables[name] = (axes[name], np.asarray(value))
        else:
            attributes[name] = value if isinstance(value, (str, float, int)) else np.asarray(value)
    return variables, attributes


def _positions(grid: ImageGrid, dims: tuple[str, ...], frame: str | None) -> dict[str, Any]:
    """Coordinates of the pixels: longitude, latitude and height, or x, y and z, of rows and columns where they can be.

    A plane whose axes are those of the scene has one x per column and one y per row.
    """
    if frame == "earth-fixed":
        positions = grid.positions
        full = np.isfinite(positions).all(axis=-1)
        places = {name: np.full(full.shape, np.nan) for name in ("longitude", "latitude", "height")}
        for name, values in zip(places, wgs84.geodetic(positions[full]), strict=True):
            places[name][full] = values
        return {name: (dims, values) for name, values in places.items()}
    if grid.center is not None and np.array_equal(np.array([grid.x_axis, grid.y_axis]), np.eye(3)[:2]):
        return {"x": (dims[1:], grid.x), "y": (dims[:1], grid.y), "z": ((), float(grid.center[2]))}
    return {name: (dims, grid.positions[..., i]) for i, name in enumerate(AXES)}


def _with_units(variables: dict[str, Any]) -> dict[str, Any]:
    """Variables (dimensions, values), each with its unit as an attribute where it has one."""
    return {name: (*value, {"units": UNITS[name]} if name in UNITS else {}) for name, value in variables.items()}
