"""Reading of files as a PhaseHistory or an Image, and completion of files that are being written.

sarcl/io/formats.py is the table of file formats. An object read from sarcl's own HDF5 file keeps the file open: rows of
samples or data are read when they are asked for.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import IO, Any, cast

import numpy as np

from ..base import arguments, validation
from ..base.types import PathLike
from ..io import formats, sarcl_hdf5
from ._row_fields import PER_ROW
from .antenna_array import AntennaArray
from .concatenation import concatenate
from .image import FIELDS, Image, image_fields
from .image_grid import ImageGrid
from .lazy_rows import pick, stack
from .phase_history import PhaseHistory, phase_history_fields
from .waveform import Waveform


def finish_image(writer: sarcl_hdf5.ImageWriter, grid: ImageGrid, **fields: Any) -> Image:
    """Complete an image file, move it to its path and return the Image, which reads it when needed.

    fields  of the Image, but data and grid
    ValueError names a wrong field; then the file is abandoned.
    """
    writer.check_open()
    try:
        image = Image(writer.data, grid, **fields)
    except BaseException:
        writer.abandon()
        raise
    writer.close(image_fields(image))
    return cast(Image, read(writer.path))


def finish_phase_history(writer: sarcl_hdf5.EchoWriter, **fields: Any) -> PhaseHistory:
    """Complete a file of echoes with the other fields of a PhaseHistory, and return it; samples stay in the file."""
    writer.close(phase_history_fields(PhaseHistory(writer.samples, **fields)))
    return cast(PhaseHistory, read(writer.path))


def read(
    path: PathLike | IO[bytes] | Sequence[PathLike | IO[bytes]],
    *,
    autofocus: bool = False,
    external: bool = False,
    channel: str | int | None = None,
    polarization: str | None = None,
) -> PhaseHistory | Image:
    """Read a file, or several as one phase history, rows in the order given.

    The format is recognised from the first bytes of a file, not from its name. HDF5 written by sarcl gives the
    PhaseHistory or Image that it holds, whose samples stay in the file until they are used. An AFRL Gotcha .mat gives a
    PhaseHistory; with autofocus=True the corrections in the file (af.r_correct, af.ph_correct), if any, are applied.
    They are off by default: measured on azimuth 1-2 deg they sharpen the one reflector from which they were estimated,
    blur the others by 6 % and move the scene by 0.7 m.
    A CPHD file (pip install sarcl[formats]), by its path or an open binary file, gives a PhaseHistory in Earth-fixed
    coordinates, whose samples stay in the file. Its channels become rows where they have equally many samples.
    Echoes of chirps in a CRSD file are compressed when they are read.
    A SICD file whose grid is a plane gives an Image, whose pixels stay in the file. A GeoTIFF (sarcl[maps]) that
    `Image.save` wrote gives an Image on the grid of its map, and so do complex pixels of other programs in one band.
    An ending that sarcl has not may be that of an installed package (docs/developers/extensions.md).
    external=True follows links and datasets of an HDF5 file that lead into other files, for files that you trust.
    channel, polarization   only these rows, as `PhaseHistory.select` takes them; of CPHD the name of a channel too
    FileNotFoundError names the missing file; ValueError the file that is of unknown format, truncated, damaged or
    different from the others, a pipe, or one that leads into other files. Rows are compared with the file's checksums
    when they are read: OSError names rows that are damaged.

    >>> raw.save("echoes.h5")
    >>> sarcl.read("echoes.h5").samples.shape == raw.samples.shape
    True
    """
    autofocus, external = validation.flag("autofocus", autofocus), validation.flag("external", external)
    if isinstance(path, (list, tuple)):
        if not path:
            raise ValueError("read was given an empty list of files; give at least one (does the pattern match any?)")
        parts = [
            read(p, autofocus=autofocus, external=external, channel=channel, polarization=polarization) for p in path
        ]
        for name, part in zip(path, parts, strict=True):
            if not isinstance(part, PhaseHistory):
                raise ValueError(f"{str(name)!r} holds an image; only phase histories are read together: read it alone")
        return parts[0] if len(parts) == 1 else concatenate(parts)  # type: ignore[arg-type]
    rows = {"channel": channel, "polarization": polarization}
    if isinstance(path, (str, os.PathLike)):
        options = {"autofocus": autofocus, "external": external, **rows}
        result, form = formats.load(arguments.path("path", path), _make, **options)
        if not isinstance(result, (PhaseHistory, Image)):
            raise TypeError(
                f"the package for {form.endings[0]} read {str(path)!r} as {type(result).__name__}, not echoes"
            )
    elif hasattr(path, "read") and hasattr(path, "seek"):
        result, form = formats.load_open(cast(IO[bytes], path), _make, **rows)
    else:
        raise TypeError(f"path is a {type(path).__name__}; give a file name or a list of file names")
    if form in (formats.CPHD, formats.CRSD) or (channel is None and polarization is None):
        return result
    if not isinstance(result, PhaseHistory):
        raise ValueError(f"{str(path)!r} holds an image; channel= and polarization= choose rows of echoes")
    if isinstance(channel, str) and channel.isdecimal():
        channel = int(channel)
    return result.select(channel=channel, polarization=polarization)  # type: ignore[arg-type]  # its errors name a word


def _make(kind: formats.Kind, fields: Mapping[str, Any]) -> PhaseHistory | Image:
    """The object that a file holds, of its fields by name; KeyError names a missing field."""
    return _phase_history(fields) if kind == "phase history" else _image(fields)


def _phase_history(stored: Mapping[str, Any]) -> PhaseHistory:
    fields: dict[str, Any] = {n: stored[n] for n in ("samples", "frequency", "frequency_step", "tx", "reference_range")}
    fields |= {name: stored.get(name) for name in ("rx", *PER_ROW, "report", "image_area", "metadata")}
    if isinstance(fields["samples"], list):  # of several sources, whose rows are only read
        fields["samples"] = stack([pick(rows, np.arange(rows.shape[0])) for rows in fields["samples"]])
    kinds: dict[str, Any] = {"waveform": Waveform, "array": AntennaArray}
    fields |= {name: kind(**_fields(kind, stored[name])) for name, kind in kinds.items() if name in stored}
    return PhaseHistory(**fields, compressed=bool(stored["compressed"]))


def _fields(kind: type[Waveform | AntennaArray | ImageGrid], stored: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a dataclass by name; None for those that the file does not have."""
    return {name: stored.get(name) for name in kind.__dataclass_fields__}


def _image(stored: Mapping[str, Any]) -> Image:
    grid = _fields(ImageGrid, stored["grid"])
    if "height" in stored["grid"]:  # a map
        from .maps.map_grid import placed

        grid["crs"], grid["listed"] = placed(grid["crs"], grid["map_axes"], grid["shape"], stored["grid"]["height"])
    if grid["listed"] is None and any(grid[n] is None for n in ("center", "spacing", "x_axis", "y_axis")):
        raise KeyError("its grid is neither a plane nor a list of points")
    grid["shape"] = tuple(int(n) for n in grid["shape"])
    if grid["spacing"] is not None:
        grid["spacing"] = tuple(float(d) for d in grid["spacing"])
    for value in grid.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    others: dict[str, Any] = {name: stored.get(name) for name in FIELDS}
    return Image(stored["data"], ImageGrid(**grid), **others)
