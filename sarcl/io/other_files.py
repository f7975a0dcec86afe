"""Other files that a mesh or an elevation model names: those of its folder are read, others where that is allowed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from . import _hdf5_safety, input_paths
from .xml import virtual_rasters

# endings of pictures, which a mesh may name as textures: nothing here needs them
PICTURES = (".png", ".jpg", ".jpeg", ".tga", ".tif", ".tiff", ".bmp", ".gif", ".dds", ".webp", ".ktx", ".ktx2", ".hdr")
# GDAL's drivers whose files name others, or addresses of a network; all but GTI are XML or JSON
CATALOGUES = set("WMS WCS WMTS HTTP PLMOSAIC EEDA EEDAI STACIT STACTA ESRIC NGW OGCAPI GTI".split())
NESTED = 8  # levels of virtual rasters of virtual rasters
HDF5 = b"\x89HDF\r\n\x1a\n"
ALLOW = "which sarcl does not follow; external=True allows it for files that you trust"


def beside(path: Path, name: str) -> Path | None:
    """The file of that name in the folder of `path`, or below it; None where it lies outside that folder."""
    folder = path.parent.resolve()
    try:
        file = (folder / name.strip()).resolve()
    except (OSError, ValueError, RuntimeError):  # no name of a file, or links in a circle
        return None
    return file if file.is_relative_to(folder) else None


class Resolver:
    """Files that a mesh names, as trimesh asks for them: buffers and materials, from the mesh's own folder.

    external  files elsewhere are read too
    refused   names of files elsewhere that were asked for
    """

    def __init__(self, path: Path, external: bool) -> None:
        self.path, self.external, self.refused = path, external, list[str]()
        self.file_name, self.file_path = path.name, str(path)

    def get(self, name: str) -> bytes:
        """The bytes of a file; FileNotFoundError for one that there is not, that is refused, or is a picture."""
        if name.strip().lower().endswith(PICTURES):
            raise FileNotFoundError(name)
        for spelling in dict.fromkeys((name, unquote(name))):
            file = beside(self.path, spelling)
            if file is None:
                if not self.external:
                    self.refused.append(name)
                    raise FileNotFoundError(name)
                file = self.path.parent / spelling.strip()
            if file.exists():
                return input_paths.contents(file, "mesh file")
        raise FileNotFoundError(f"there is no file {name!r} beside it")

    __getitem__ = get

    def keys(self) -> list[str]:
        """Names of files: none are offered."""
        return []

    def namespaced(self, namespace: str) -> Resolver:
        """A resolver for names relative to a folder below."""
        return Resolver(self.path.parent / namespace / self.path.name, self.external)


def check_raster(path: Path, name: str, depth: int = 0) -> None:
    """ValueError, beginning with `name`, for a raster that leads to files outside its folder, before GDAL opens it.

    Virtual rasters (VRT) name their sources, HDF5 files (netCDF 4, BAG) may hold external storage and links. Other XML,
    JSON and indices of tiles (GTI) name files anywhere, or addresses of a network.
    depth  virtual rasters that led to this one
    """
    with open(path, "rb") as file:
        head = file.read(512)
    if head.startswith(HDF5):
        _check_hdf5(path, name)
    elif re.match(rb"(\xef\xbb\xbf)?\s*<", head):
        if depth > NESTED:
            raise ValueError(f"{name} is a virtual raster of virtual rasters, {NESTED} deep; give one of its sources")
        for source in _sources(path, name):
            check_raster(source, name, depth + 1)
    elif re.match(rb"(\xef\xbb\xbf)?\s*[{[]", head) or ".gti" in path.name.lower():
        raise _catalogue(name)


def check_parts(path: Path, driver: str, files: list[str], name: str) -> None:
    """ValueError where an open raster is a catalogue, or one of its files lies outside its folder."""
    if driver in CATALOGUES:
        raise _catalogue(name)
    for file in files:
        if beside(path, str(Path(file).absolute())) is None:
            raise ValueError(f"{name} leads to another file: {file!r}, outside its folder, {ALLOW}")


def _catalogue(name: str) -> ValueError:
    return ValueError(f"{name} is a list of rasters elsewhere, and no raster: give one of those, or external=True")


def _sources(path: Path, name: str) -> Iterator[Path]:
    """Files in the folder of a virtual raster, which it is made of."""
    try:
        sources = virtual_rasters.sources(path)
    except virtual_rasters.Refused as exc:
        raise ValueError(f"{name} {exc}") from None
    for source in sources:
        file = beside(path, str(source))
        if file is None:
            raise ValueError(f"{name} leads to another file: '{source}', outside its folder, {ALLOW}")
        if not file.is_file():
            raise ValueError(f"{name} names '{source!s:.100}', and there is no such file in its folder; put it there")
        yield file


def _check_hdf5(path: Path, name: str) -> None:
    import h5py

    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            _hdf5_safety.check_links(file, "external=True")
    except _hdf5_safety.Refused as exc:
        raise ValueError(f"{name} {exc}") from None
    except (OSError, RuntimeError, KeyError) as exc:
        raise ValueError(f"{name} is damaged: its HDF5 tables cannot be read ({exc}); copy it again") from None
