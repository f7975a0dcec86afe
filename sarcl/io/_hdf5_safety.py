"""HDF5 files that lead into other files, declare sizes that they do not have, or never end: refused."""

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
        command = [sys.executable, "-c", TRIAL, str(path), str(SMALL)]
        silent = subprocess.DEVNULL
        trial = subprocess.run(command, stdin=silent, stdout=silent, stderr=silent, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        raise Refused(f"HDF5 does not come to an end with its tables within {PATIENCE:g} s") from None
    except OSError:
        return
    if trial.returncode < 0:
        raise Refused(f"HDF5 crashes on its tables (signal {-trial.returncode})")


def check_contents(file: h5py.File, file_bytes: int, external: bool, how: str = "read(..., external=True)") -> None:
    """Refused where an open file leads into other files, unless `external`, or declares more than it has.

    how  to allow it, for the message
    """
    import h5py

    def visit(group: h5py.Group) -> None:
        for name in group:
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                check_external(f"{name} is a link", link.filename)
                continue
            member = group[name]
            if isinstance(member, h5py.Group):
                visit(member)
            elif isinstance(member, h5py.Dataset):
                check_dataset(member.name.strip("/"), member)

    def check_external(what: str, target: str) -> None:
        if not external:
            raise Refused(
                f"leads into another file: {what} into {target!r}, which sarcl does not follow; {how} allows it "
                "for files that you trust"
            )

    def check_dataset(name: str, member: h5py.Dataset) -> None:
        if member.is_virtual:
            check_external(f"{name} is virtual", ", ".join(sorted({s.file_name for s in member.virtual_sources()})))
            return
        if member.external:
            check_external(f"{name} lies", member.external[0][0])
            return
        declared = int(member.size or 0) * member.dtype.itemsize
        is_packed = member.chunks and member.id.get_create_plist().get_nfilters()
        if declared > file_bytes * (DEFLATED if is_packed else 1) + ALLOWED:
            raise Refused(
                f"is damaged: it declares {size_text(declared)} for {name} {member.shape} and has "
                f"{size_text(file_bytes)}; save or copy it again"
            )

    visit(file)
