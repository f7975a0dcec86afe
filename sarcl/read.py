"""read: a file, whatever it holds, as the noun it stands for."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .image import Image
    from .phase_history import PhaseHistory

READABLE = "sarcl's own HDF5 files (raw.save, image.save) and AFRL Gotcha .mat files (MATLAB 5)"


def read(path: Any, *, autofocus: bool = False) -> PhaseHistory | Image:
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
        from .phase_history import PhaseHistory, concatenate

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
        from .files import store

        return store.load(path)
    from .files import gotcha
    from .phase_history import PhaseHistory

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
