"""HDF5 files that lead into other files: refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import h5py


class Refused(Exception):
    """The message says why the file is not read, and follows its name."""


def check_links(group: h5py.Group, how: str = "read(..., external=True)") -> None:
    """Refused where a group of an open file leads into other files; how  to allow it, for the message."""
    import h5py

    for name in group:
        link = group.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise _elsewhere(f"{name} is a link", link.filename, how)
        member = group[name]
        if isinstance(member, h5py.Group):
            check_links(member, how)
        elif isinstance(member, h5py.Dataset) and member.is_virtual:
            sources = ", ".join(sorted({source.file_name for source in member.virtual_sources()}))
            raise _elsewhere(f"{member.name.strip('/')} is virtual", sources, how)
        elif isinstance(member, h5py.Dataset) and member.external:
            raise _elsewhere(f"{member.name.strip('/')} lies", member.external[0][0], how)


def _elsewhere(what: str, target: str, how: str) -> Refused:
    return Refused(
        f"leads into another file: {what} into {target!r}, which sarcl does not follow; {how} allows it for files that "
        "you trust"
    )
