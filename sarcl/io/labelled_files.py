"""Images as xarray writes them: Zarr stores (x.zarr, a folder) and NetCDF files (x.nc); pip install sarcl[xarray].

The datasets are those of sarcl/model/_labelled.py, which hold every field of an Image. NetCDF has no complex numbers:
there data is data_real and data_imag. A report or XML of more than 60 kB is a variable there: no
attribute of NetCDF holds it. NetCDF files have checksums behind their end (_checksums.py), which other readers ignore.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _checksums, hdf5, output_paths
from .formats import Make, T, is_zarr

if TYPE_CHECKING:
    from types import ModuleType

    import xarray

    from ..base.types import PathLike

GRID = "grid_"  # begins the names of a grid's fields
MARK = "sarcl_file"  # attribute that tells sarcl's datasets from others
LONGEST = 60_000  # bytes of an attribute of NetCDF, whose limit is 64 kB with its name and type


def import_xarray(what: str, engine: str | None = None) -> ModuleType:
    """The package xarray, after a look for the one that it writes files with; ImportError names the extra."""
    try:
        import xarray

        if engine is not None:
            __import__(engine)
    except ImportError as exc:
        raise ImportError(f"{what} needs the package {exc.name}: pip install sarcl[xarray]") from exc
    return xarray


def check_writable(path: PathLike, n_bytes: int = 0) -> Path:
    """As `output_paths.check_writable`, of "x.zarr" too; FileExistsError where that is a folder but no Zarr store.

    ImportError where a package is missing.
    """
    is_store = Path(path).suffix.lower() == ".zarr"
    import_xarray(str(path), "zarr" if is_store else "h5netcdf")
    target = output_paths.place(path)
    if is_store and os.path.lexists(target) and not is_zarr(target):
        raise FileExistsError(f"cannot write {str(path)!r}: this name is taken by what is no Zarr store; move it away")
    output_paths.check_writable(target.with_name(f"{target.name}.new") if is_store else path, n_bytes)
    return target


def write(path: PathLike, dataset: xarray.Dataset) -> None:
    """Write an image's dataset to "x.zarr" or "x.nc"; on any exception `path` is as it was.

    Raises what `check_writable` raises.
    """
    target = check_writable(path, int(dataset.nbytes))
    dataset = dataset.assign_attrs({MARK: "image", "format": hdf5.FORMAT})
    if target.suffix.lower() == ".zarr":
        output_paths.put_in_place(target, lambda new: dataset.to_zarr(new, mode="w", consolidated=False))
        return
    data = dataset["data"]
    if np.iscomplexobj(data):
        dataset = dataset.drop_vars("data").assign({"data_real": data.real, "data_imag": data.imag})
    for name in [name for name in ("report", "metadata") if len(dataset.attrs.get(name, "")) > LONGEST]:
        dataset = dataset.assign({name: ((), dataset.attrs[name])})
        del dataset.attrs[name]
    output_paths.put_in_place(target, lambda new: _write_netcdf(new, dataset))


def _write_netcdf(path: Path, dataset: xarray.Dataset) -> None:
    """Write a NetCDF file with checksums behind its end, as sarcl's HDF5 files have them."""
    import h5py

    dataset.to_netcdf(path, engine="h5netcdf")
    with h5py.File(path, "r", locking="best-effort") as file:
        sums = _checksums.layout(file, file.id.get_filesize(), "", None)
    _checksums.append(path, sums)


def load(path: Path, make: Make[T]) -> T:
    """make("image", fields) of a Zarr store or NetCDF file of `write`, read into memory.

    ValueError for one that is damaged, or not by sarcl.
    """
    name, is_store = str(path), path.is_dir()
    xarray = import_xarray(name, "zarr" if is_store else "h5netcdf")
    options: dict[str, Any] = {"engine": "zarr", "consolidated": False} if is_store else {"engine": "h5netcdf"}
    try:
        with xarray.open_dataset(path, decode_times=False, mask_and_scale=False, **options) as file:
            dataset = file.load()
    except Exception as exc:  # of many kinds, by zarr, h5py and xarray
        raise ValueError(f"{name!r} is damaged or no dataset of xarray's ({exc}); save or copy it again") from exc
    if dataset.attrs.get(MARK) != "image" or dataset.attrs.get("format") != hdf5.FORMAT:
        raise ValueError(
            f"{name!r} is a dataset, but not an image of this sarcl (it has no attribute {MARK} = 'image', format = "
            f"{hdf5.FORMAT}); open it with xarray and give its values to sarcl.Image"
        )
    try:
        return make("image", _fields(dataset))
    except (KeyError, TypeError, ValueError) as exc:
        raise ValueError(f"{name!r} is damaged: it holds no whole image ({exc}); save or copy it again") from exc


def _fields(dataset: xarray.Dataset) -> dict[str, Any]:
    """Fields of an Image by name, those of its grid as a mapping."""
    values: dict[str, Any] = {name: _plain(value) for name, value in dataset.attrs.items()}
    values |= {str(name): variable.values for name, variable in dataset.data_vars.items()}
    if "data_real" in values:
        real, imaginary = values.pop("data_real"), values.pop("data_imag")
        values["data"] = np.empty(real.shape, np.result_type(real, np.complex64))
        values["data"].real, values["data"].imag = real, imaginary
    fields = {name: value for name, value in values.items() if not name.startswith(GRID)}
    grid = {name.removeprefix(GRID): value for name, value in values.items() if name.startswith(GRID)}
    grid |= {name: dataset.coords[name].values for name in ("times", "ranges") if name in dataset.coords}
    fields["grid"] = {"shape": values["data"].shape, **grid}
    if "report" in fields:
        fields["report"] = hdf5.report_of(str(fields["report"]))
    if "metadata" in fields:
        fields["metadata"] = str(fields["metadata"])
    return fields


def _plain(value: object) -> object:
    """An attribute as it was given: Zarr makes lists of arrays, NetCDF scalars of NumPy."""
    if isinstance(value, list):
        return np.array(value)
    return value.item() if isinstance(value, np.generic) else value
