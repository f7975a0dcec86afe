"""Meshes in archives (.zip, .zae, .bz2). trimesh would leave out what it cannot read of them."""

from __future__ import annotations

import bz2
import io
import posixpath
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path

from .. import input_paths
from . import _checks

KINDS = (".zip", ".zae", ".bz2")


def contents(path: Path, what: str) -> dict[str, bytes]:
    """Files in an archive, by their names; a .bz2 holds one. ValueError for one that cannot be unpacked."""
    data = io.BytesIO(input_paths.contents(path, "mesh file"))
    try:
        if path.suffix.lower() == ".bz2":
            with bz2.open(data, "rb") as file:
                return {path.stem: file.read()}
        with zipfile.ZipFile(data) as archive:
            members = [member for member in archive.infolist() if not member.is_dir()]
            files = {member.filename: archive.read(member) for member in members}
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError) as exc:  # RuntimeError: a password
        raise ValueError(f"{what} cannot be unpacked ({exc}): {_checks.TAKE}") from None
    if len(files) < len(members):
        raise ValueError(f"{what} holds {len(members)} files of {len(files)} names: {_checks.TAKE}")
    return files


def meshes(path: Path, files: dict[str, bytes], kinds: Collection[str], what: str) -> list[str]:
    """Names of the meshes among the files of an archive; a .zae holds one .dae. kinds  endings that are read.

    ValueError where there are none, and for an archive in an archive, whose meshes would be left out.
    """
    kinds = {"dae"} if path.suffix.lower() == ".zae" else set(kinds) - {"zae"}
    names = [name for name in files if Path(name).suffix.lower().lstrip(".") in kinds and not _of_macos(name)]
    if not names or (len(names) > 1 and path.suffix.lower() == ".zae"):
        contents_text = ", ".join(map(repr, list(files)[:5])) or "it is empty"
        expected = "one .dae" if path.suffix.lower() == ".zae" else "at least one"
        raise ValueError(
            f"{what} holds {len(names) or 'no'} meshes ({contents_text}), wanted {expected}: unpack it, and give the "
            "mesh itself"
        )
    inner = next((name for name in files if Path(name).suffix.lower() in KINDS and not _of_macos(name)), None)
    if inner is not None:
        raise ValueError(f"{what} holds another archive, {inner!r:.100}: unpack it, and give the meshes themselves")
    return names


def beside(files: dict[str, bytes], name: str) -> dict[str, bytes]:
    """The files of an archive by their paths from the folder of one of them, `name`: as that one names them."""
    return {posixpath.relpath(f"/{other}", posixpath.dirname(f"/{name}")): data for other, data in files.items()}


def _of_macos(name: str) -> bool:
    """Whether macOS added a file to an archive: attributes of another one, under its name."""
    return name.startswith("__MACOSX/") or Path(name).name.startswith("._")
