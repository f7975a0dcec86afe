"""Files read as a PhaseHistory or an Image, and files in the making finished as one.

`read` finds out what a file is and loads it. sarcl/io/sarcl_hdf5.py describes and writes sarcl's own HDF5 file; an
object loaded from one keeps the file open and reads the rows of samples or data that are asked for.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..io import gotcha, hdf5, sarcl_hdf5
from .antenna_array import AntennaArray
from .image import Image, image_fields
from .image_grid import ImageGrid
from .phase_history import PER_ROW, PhaseHistory, concatenate, phase_history_fields
from .waveform import Waveform

if TYPE_CHECKING:
    from ..base.types import PathLike

READABLE = "sarcl's own HDF5 files (raw.save, image.save) and AFRL Gotcha .mat files (MATLAB 5)"


def load(path: Any) -> PhaseHistory | Image:
    """Open a file of sarcl's, read-only: samples or data stay in it as an h5py.Dataset that keeps it open.

    ValueError when the file is not HDF5, is truncated or damaged, is not sarcl's, or is of a newer format.
    """
    import h5py

    name = str(path)
    with open(path, "rb"):
        pass  # FileNotFoundError and its like, as Python words them
    try:
        file = h5py.File(path, "r", locking="best-effort")
    except OSError as exc:
        what = "truncated" if "truncated" in str(exc) else "not an HDF5 file, or damaged"
        raise ValueError(f"{name!r} is {what} ({exc}); copy it again or give a file saved by sarcl") from None
    try:
        kind, version = file.attrs.get("sarcl_file"), file.attrs.get("format")
        if not isinstance(kind, str) or kind not in _LOADERS or version is None:
            raise ValueError(f"{name!r} is HDF5 but not sarcl's (it has no sarcl_file mark); sarcl reads what it saved")
        if version != hdf5.FORMAT:
            raise ValueError(f"{name!r} has format {version}, this sarcl reads format {hdf5.FORMAT}; update sarcl")
        try:
            return _LOADERS[kind](file)
        except (KeyError, OSError, RuntimeError, TypeError, ValueError, AttributeError) as exc:
            raise ValueError(f"{name!r} is damaged: it holds no whole {kind} ({exc}); save or copy it again") from exc
    except BaseException:
        file.close()
        raise


def finish_image(
    writer: sarcl_hdf5.ImageWriter, grid: ImageGrid, *, gain: float = 1.0, frequency: Any = None, tx: Any = None,
    rx: Any = None, report: Any = None,
) -> Image:  # fmt: skip
    """Complete an image file, move it to its path and return the Image, read from there as it is needed.

    ValueError names a field that does not fit; then the file is abandoned.
    """
    writer.check_open()
    try:
        image = Image(writer.data, grid, gain=gain, frequency=frequency, tx=tx, rx=rx, report=report)
    except BaseException:
        writer.abandon()
        raise
    writer.close(image_fields(image))
    made: Any = load(writer.path)
    return made


def finish_phase_history(writer: sarcl_hdf5.EchoWriter, **fields: Any) -> PhaseHistory:
    """Complete a file of echoes with the other fields of a PhaseHistory, and return that, read as it is needed."""
    writer.close(phase_history_fields(PhaseHistory(writer.samples, **fields)))
    made: Any = load(writer.path)
    return made


def _load_phase_history(file: Any) -> PhaseHistory:
    waveform = None
    if "waveform" in file:
        waveform = Waveform(**{n: hdf5.get(file["waveform"], n) for n in Waveform.__dataclass_fields__})
    array = None
    if "array" in file:
        array = AntennaArray(**{n: hdf5.get(file["array"], n) for n in AntennaArray.__dataclass_fields__})
    optional = {n: hdf5.get(file, n) for n in ("rx", *PER_ROW)}
    needed = {n: file[n][...] for n in ("frequency", "frequency_step", "tx", "reference_range")}
    return PhaseHistory(
        file["samples"],
        **needed,
        **optional,
        waveform=waveform,
        array=array,
        compressed=bool(file.attrs["compressed"]),
        report=hdf5.get_report(file),
    )


def _load_image(file: Any) -> Image:
    stored = {n: hdf5.get(file["grid"], n) for n in ImageGrid.__dataclass_fields__}
    plane = ("center", "spacing", "x_axis", "y_axis")
    if stored["listed"] is None and any(stored[n] is None for n in plane):
        raise KeyError("its grid is neither a plane nor a list of points")
    stored["shape"] = tuple(int(n) for n in stored["shape"])
    if stored["spacing"] is not None:
        stored["spacing"] = tuple(float(d) for d in stored["spacing"])
    for value in stored.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    fields = {n: hdf5.get(file, n) for n in ("gain", "frequency", "tx", "rx")}
    return Image(file["data"], ImageGrid(**stored), report=hdf5.get_report(file), **fields)


_LOADERS: dict[str, Any] = {"phase_history": _load_phase_history, "image": _load_image}


def read(path: PathLike | Sequence[PathLike], *, autofocus: bool = False) -> PhaseHistory | Image:
    """Read a file, or several as one phase history, rows in the order given.

    What a file is follows from its first bytes, not its name. HDF5 written by sarcl gives the PhaseHistory or
    Image it holds, its samples left in the file until they are used; an AFRL Gotcha .mat gives a
    PhaseHistory, with autofocus=True the file's own corrections (af.r_correct, af.ph_correct) applied where it
    has them. They are off by default: measured on azimuth 1-2 deg they sharpen the one reflector they were made
    from, blur the others by 6 % and move the scene by 0.7 m.
    FileNotFoundError names the missing file; ValueError the file that is of no known kind, truncated or
    damaged, or does not fit the others.
    """
    if isinstance(path, (list, tuple)):
        if not path:
            raise ValueError("read was given an empty list of files; give at least one (does the pattern match?)")
        parts = [read(p, autofocus=autofocus) for p in path]
        for name, part in zip(path, parts, strict=True):
            if not isinstance(part, PhaseHistory):
                raise ValueError(f"{str(name)!r} holds an image; only phase histories are read together: read it alone")
        return parts[0] if len(parts) == 1 else concatenate(parts)  # type: ignore[arg-type]
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"path is a {type(path).__name__}; give a file name or a list of file names")
    path = Path(path)
    kind = _kind(path)
    if kind == "hdf5":
        return load(path)
    return PhaseHistory(**gotcha.load(path, autofocus))


def _kind(path: Path) -> str:
    """ "hdf5" or "mat", from the first bytes; ValueError for anything else."""
    if path.is_dir():
        raise IsADirectoryError(
            f"{str(path)!r} is a folder; give the files in it, e.g. sorted(Path(folder).glob('*.mat'))"
        )
    try:
        with open(path, "rb") as file:
            head = file.read(520)
    except FileNotFoundError:
        raise FileNotFoundError(f"{str(path)!r} does not exist; check the name and the folder") from None
    if head.startswith(b"\x89HDF\r\n\x1a\n"):
        return "hdf5"
    if head.startswith(b"MATLAB 5.0 MAT-file"):
        return "mat"
    if not head:
        what = "is empty"
    elif head.startswith(b"MATLAB 7.3"):
        what = "is a MATLAB 7.3 file (save it again with -v7)"
    elif head.startswith(b"CPHD/"):
        what = "is a CPHD file, which sarcl does not read yet"
    else:
        what = f"starts with {head[:12]!r}, which is no file kind sarcl knows"
    named = f" although its name ends in {path.suffix!r}" if path.suffix.lower() in (".h5", ".hdf5", ".mat") else ""
    raise ValueError(f"{str(path)!r} {what}{named}; sarcl reads {READABLE}")
