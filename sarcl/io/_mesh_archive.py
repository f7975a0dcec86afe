"""Meshes in archives (.zip, .zae, .bz2): unpacked within bounds. trimesh leaves out what it cannot read of them."""

from __future__ import annotations

import bz2
import io
import posixpath
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path

from ..base.text import size_text
from . import _mesh_checks, input_paths

KINDS = (".zip", ".zae", ".bz2")
ZIPPED = (".3mf", ".3dxml")  # mesh files that are zip files, which trimesh unpacks
UNPACKED = 2**26  # bytes that an archive may always hold
RATIO = 100  # bytes per byte of an archive above that; text of meshes is packed to a tenth, at most a thirtieth
PIECE = 2**20  # bytes unpacked at a time


def check_size(data: bytes, what: str) -> None:
    """ValueError for a zip file that unpacks to more than a mesh would."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(member.file_size for member in archive.infolist())
    except (zipfile.BadZipFile, NotImplementedError) as exc:
        raise ValueError(f"{what} cannot be read as a zip file ({exc}): {_mesh_checks.TAKE}") from None
    if size > _most(data):
        raise _too_much(data, what, size_text(size))


def contents(path: Path, what: str) -> dict[str, bytes]:
    """Files in an archive, by their names; a .bz2 holds one. ValueError for one that cannot be unpacked, or is huge."""
    data = input_paths.contents(path, "mesh file")
    if path.suffix.lower() == ".bz2":
        return {path.stem: _of_bz2(data, what)}
    check_size(data, what)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [member for member in archive.infolist() if not member.is_dir()]
            made = {member.filename: archive.read(member) for member in members}
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError) as exc:  # RuntimeError: a password
        raise ValueError(f"{what} cannot be unpacked ({exc}): {_mesh_checks.TAKE}") from None
    if len(made) < len(members):
        raise ValueError(f"{what} holds {len(members)} files of {len(made)} names: {_mesh_checks.TAKE}")
    return made


def meshes(path: Path, files: dict[str, bytes], kinds: Collection[str], what: str) -> list[str]:
    """Names of the meshes among the files of an archive; a .zae holds one .dae. kinds  endings that are read.

    ValueError where there are none, and for an archive in an archive, whose meshes would be left out.
    """
    kinds = {"dae"} if path.suffix.lower() == ".zae" else set(kinds) - {"zae"}
    found = [name for name in files if Path(name).suffix.lower().lstrip(".") in kinds and not _of_macos(name)]
    if not found or (len(found) > 1 and path.suffix.lower() == ".zae"):
        there = ", ".join(map(repr, list(files)[:5])) or "it is empty"
        wanted = "one .dae" if path.suffix.lower() == ".zae" else "at least one"
        raise ValueError(
            f"{what} holds {len(found) or 'no'} meshes ({there}), wanted {wanted}: unpack it, and give the mesh itself"
        )
    inner = next((name for name in files if Path(name).suffix.lower() in KINDS and not _of_macos(name)), None)
    if inner is not None:
        raise ValueError(f"{what} holds another archive, {inner!r:.100}: unpack it, and give the meshes themselves")
    return found


def beside(files: dict[str, bytes], name: str) -> dict[str, bytes]:
    """The files of an archive by their paths from the folder of one of them, `name`: as that one names them."""
    return {posixpath.relpath(f"/{other}", posixpath.dirname(f"/{name}")): data for other, data in files.items()}


def _of_macos(name: str) -> bool:
    """What macOS adds to archives: attributes of each file, under its name."""
    return name.startswith("__MACOSX/") or Path(name).name.startswith("._")


def _of_bz2(data: bytes, what: str) -> bytes:
    made, most = io.BytesIO(), _most(data)
    try:
        with bz2.open(io.BytesIO(data), "rb") as file:
            while piece := file.read(PIECE):
                made.write(piece)
                if made.tell() > most:
                    raise _too_much(data, what, f"more than {size_text(most)}")
    except (OSError, EOFError) as exc:
        raise ValueError(f"{what} cannot be unpacked ({exc}): {_mesh_checks.TAKE}") from None
    return made.getvalue()


def _most(data: bytes) -> int:
    return max(UNPACKED, RATIO * len(data))


def _too_much(data: bytes, what: str, size: str) -> ValueError:
    return ValueError(
        f"{what} has {size_text(len(data))} and unpacks to {size}, more than {RATIO} times as much: unpack it yourself "
        "if you trust it, and give the mesh in it"
    )
