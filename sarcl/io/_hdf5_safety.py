"""What an HDF5 file may do to its reader: lead into other files, declare sizes that it does not have, never end."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

from ..base.text import size_text

if TYPE_CHECKING:
    import h5py

    from ..base.types import PathLike

PATIENCE = 20.0  # s for the tables of a file; they are read in milliseconds
DEFLATED = 1032  # bytes that one compressed byte may hold
ALLOWED = 2**24  # bytes that a file may declare without having them: rows that were never written
SMALL = 2**20  # bytes of a dataset that the trial reads
TRIAL = """
import sys, h5py
def visit(name, found):
    dict(found.attrs)
    if isinstance(found, h5py.Dataset) and not found.is_virtual and found.nbytes <= int(sys.argv[2]):
        found[()]
with h5py.File(sys.argv[1], "r", locking="best-effort") as file:
    visit("", file)
    file.visititems(visit)
"""


class Refused(Exception):
    """The message says why the file is not read, and follows its name."""


def check_readable(path: PathLike) -> None:
    """Refused where HDF5 does not come to an end with a file, or crashes: tried in another process.

    For files without checksums. Their damaged tables make HDF5 wait for ever, which nothing in this process can end.
    Where no other process can be started, nothing is checked.
    """
    if not sys.executable or getattr(sys, "frozen", False):
        return
    try:
        done = subprocess.run(
            [sys.executable, "-c", TRIAL, str(path), str(SMALL)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, timeout=PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise Refused(f"HDF5 does not come to an end with its tables within {PATIENCE:g} s") from None
    except OSError:
        return
    if done.returncode < 0:
        raise Refused(f"HDF5 crashes on its tables (signal {-done.returncode})")


def check_contents(file: h5py.File, file_bytes: int, external: bool, how: str = "read(..., external=True)") -> None:
    """Refused where an open file leads into other files, unless `external`, or declares more than it has.

    how  to allow it, for the message
    """
    import h5py

    def visit(group: h5py.Group, depth: int) -> None:
        if depth > 8:
            raise Refused("has groups within groups to a depth that sarcl never writes; save it again with sarcl")
        for name in group:
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                leads(f"{name} is a link", link.filename)
                continue
            found = group[name]
            if isinstance(found, h5py.Group):
                visit(found, depth + 1)
            elif isinstance(found, h5py.Dataset):
                look(found.name.strip("/"), found)

    def leads(what: str, to: str) -> None:
        if not external:
            raise Refused(
                f"leads into another file: {what} into {to!r}, which sarcl does not follow; {how} allows it "
                "for files that you trust"
            )

    def look(name: str, found: h5py.Dataset) -> None:
        if found.is_virtual:
            leads(f"{name} is virtual", ", ".join(sorted({s.file_name for s in found.virtual_sources()})))
            return
        if found.external:
            leads(f"{name} lies", found.external[0][0])
            return
        declared = int(found.size or 0) * found.dtype.itemsize
        most = file_bytes * (DEFLATED if found.chunks and found.id.get_create_plist().get_nfilters() else 1) + ALLOWED
        if declared > most:
            raise Refused(
                f"is damaged: it declares {size_text(declared)} for {name} {found.shape} and has "
                f"{size_text(file_bytes)}; save or copy it again"
            )

    visit(file, 0)
