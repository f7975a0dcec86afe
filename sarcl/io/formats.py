"""The table of file formats for phase histories and images: names, first bytes, and what reads and writes each.

A new format is a new file of this folder and one line of FORMATS. That file holds, as far as the line says so:

    load(path, make, **options)                 the file as make("phase history" or "image", its fields by name)
    EchoWriter(path, n_rows, n_samples, dtype)  as in sarcl_hdf5
    ImageWriter(path, grid, dtype, resumes)     as in sarcl_hdf5
    job_of(path)                                where by_blocks is True: the mark of the job that made an image

An installed package adds a format by an entry point of the group sarcl.formats (docs/developers/extensions.md).
Nothing here loads NumPy, so that the command line can print its help at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import IO, TYPE_CHECKING, Any, Literal, TypeVar

from ..base import arguments
from . import entry_points, input_paths

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from ..base.types import PathLike

Kind = Literal["phase history", "image"]
Written = Literal["phase history", "image", "picture", "dataset", "product", "map"]
OF_IMAGES: tuple[Written, ...] = ("picture", "image", "dataset", "map")  # what is written of an image
T = TypeVar("T")
Make = Callable[[Kind, Mapping[str, Any]], T]


@dataclass(frozen=True)
class Format:
    """A file format.

    endings    of names of its files; the first is the one that messages suggest
    starts     first bytes of its files; none where the format is not read
    name       for the list of what can be read
    file       the file of this folder that reads and writes it; none where other rooms do
    options    of `load` that this format takes; the others have no effect on it, or are applied to what was read
    writes     what can be written: of an image, "picture" is made by sarcl/figures, "dataset" by sarcl/model/_labelled,
               "product", with the collection that it was made of, by sarcl/model/sicd; a "map" by sarcl/model/maps
    by_blocks  True where an image can be written block by block, and a killed run go on
    """

    endings: tuple[str, ...]
    starts: bytes | tuple[bytes, ...] = b""
    name: str = ""
    file: str = ""
    options: tuple[str, ...] = ()
    writes: tuple[Written, ...] = ()
    by_blocks: bool = False

    @property
    def functions(self) -> ModuleType:
        """The file of this folder that reads and writes the format."""
        return import_module(f".{self.file}", __package__)

    @property
    def is_dataset(self) -> bool:
        """True where an image's dataset of xarray is written."""
        return "dataset" in self.writes

    @property
    def is_map(self) -> bool:
        """True where an image is written on a map."""
        return "map" in self.writes

    @property
    def is_picture(self) -> bool:
        """True where an image's grey picture is written, not its numbers."""
        return "picture" in self.writes


HDF5 = Format(
    (".h5", ".hdf5"),
    b"\x89HDF\r\n\x1a\n",
    "sarcl's own HDF5 files (raw.save, image.save)",
    "sarcl_hdf5",
    ("external",),
    writes=("phase history", "image"),
    by_blocks=True,
)
CPHD = Format((".cphd",), b"CPHD/", "CPHD files", "cphd._reading", ("channel", "polarization"))
CRSD = Format((".crsd",), b"CRSDsar/", "CRSD files", "cphd._crsd_reading", ("channel", "polarization"))
SICD = Format((".nitf", ".ntf", ".sicd"), b"NITF", "SICD files", "sicd._reading", writes=("product",))
# recognised by their content: a folder, and HDF5 of another kind
ZARR, NETCDF = (Format((ending,), file="labelled_files", writes=("dataset",)) for ending in (".zarr", ".nc"))
TIFF = b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"  # of either order of bytes, and of files of more than 4 GB
GEOTIFF = Format((".tif", ".tiff"), TIFF, "GeoTIFF maps (image.save)", "geotiff", writes=("map",))
FORMATS = (
    Format((".png",), writes=("picture",)),
    HDF5,
    Format((".mat",), b"MATLAB 5.0 MAT-file", "AFRL Gotcha .mat files (MATLAB 5)", "_gotcha", ("autofocus",)),
    CPHD,
    CRSD,
    SICD,
    ZARR,
    NETCDF,
    GEOTIFF,
)
NOT_READ = {  # first bytes of files that are often met, and what to say of them
    b"MATLAB 7.3": "is a MATLAB 7.3 file (save it again with -v7)",
}


def load(path: Path, make: Make[T], **options: object) -> tuple[T, Format]:
    """The object that make(kind, fields) makes of a file, whose format follows from its first bytes; and the format.

    options  those that the format takes are handed on
    ValueError for a file that is of no known format, truncated or damaged, or a pipe; FileNotFoundError,
    IsADirectoryError, PermissionError.
    """
    if is_zarr(path):
        return ZARR.functions.load(path, make), ZARR
    head = input_paths.head(path, folder="give the files in it, e.g. sorted(Path(folder).glob('*.mat'))")
    functions = added(path)
    if functions is not None:
        return _function(functions, "load", path)(path), Format((path.suffix.lower(),))
    form = next((f for f in FORMATS if f.starts and head.startswith(f.starts)), None)
    if form is not None:
        return form.functions.load(path, make, **{n: v for n, v in options.items() if n in form.options}), form
    unreadable = (text for starts, text in NOT_READ.items() if head.startswith(starts))
    unknown = f"starts with {head[:12]!r}, which is no file kind sarcl knows" if head else "is empty"
    is_named_so = any(path.suffix.lower() in f.endings for f in FORMATS if f.starts)
    although = f" although its name ends in {path.suffix!r}" if is_named_so else ""
    raise ValueError(f"{str(path)!r} {next(unreadable, unknown)}{although}; sarcl reads {readable('and')}")


def added(path: PathLike) -> object | None:
    """What an installed package adds for files of this ending: functions load(path) and save(path, value), or one of
    them. None: sarcl has the ending itself, or no package adds it. ImportError as from `entry_points.added`."""
    ending = Path(path).suffix.lower()
    is_other = ending and named(path, [*FORMATS]) is None
    return entry_points.added("formats", ending.removeprefix(".")) if is_other else None


def save_added(path: PathLike, value: object) -> bool:
    """Write a value in a format that an installed package adds; False where none does.

    `path` is replaced when the file is complete. ValueError where the package only reads the format.
    """
    functions = added(path)
    if functions is None:
        return False
    save, output_paths = _function(functions, "save", path), import_module(".output_paths", __package__)
    target = output_paths.check_writable(path)

    def write_to(new: Path) -> None:
        save(new.with_name(target.name), value)  # libraries look at the ending
        new.with_name(target.name).rename(new)

    output_paths.put_in_place(target, write_to)
    return True


def _function(functions: object, name: str, path: PathLike) -> Callable[..., Any]:
    """The function of an installed package of this name; ValueError where it has none."""
    if not hasattr(functions, name):
        raise ValueError(f"{str(path)!r}: the package for {Path(path).suffix} has no {name}(); choose another ending")
    function: Callable[..., Any] = getattr(functions, name)
    return function


def is_zarr(path: Path) -> bool:
    """Whether a path is a folder that holds a Zarr store, of version 3 or 2."""
    return path.is_dir() and any((path / name).is_file() for name in ("zarr.json", ".zgroup"))


def check_writable(path: PathLike, n_bytes: int = 0) -> None:
    """Raises what writing a file of this name would, as far as that can be known before."""
    form = named(path, [ZARR, NETCDF, GEOTIFF])
    (import_module(".output_paths", __package__) if form is None else form.functions).check_writable(path, n_bytes)


def load_open(file: IO[bytes], make: Make[T], **options: object) -> tuple[T, Format]:
    """`load` of an open binary file, which CPHD, CRSD and SICD are read from. ValueError for other formats."""
    file.seek(0)
    head = file.read(len(CRSD.starts))
    form = next((f for f in (CPHD, CRSD, SICD) if head.startswith(f.starts)), None)
    if form is None:
        raise ValueError(
            f"the open file starts with {head!r:.40}; open files are read as CPHD, CRSD or SICD: give a path"
        )
    return form.functions.load(file, make, **{n: v for n, v in options.items() if n in form.options}), form


def writing(*kinds: Written, by_blocks: bool = False) -> list[Format]:
    """The formats that any of `kinds` is written in; with by_blocks those alone that take an image block by block."""
    return [f for f in FORMATS if set(kinds) & set(f.writes) and (f.by_blocks or not by_blocks)]


def suggested(among: list[Format], quote: str = "") -> str:
    """The endings that messages and help texts name: .png or .h5."""
    return _listed([f"{quote}{f.endings[0]}{quote}" for f in among], "or")


def readable(word: str) -> str:
    """The names of the formats that are read, the last two joined by a word."""
    return _listed([f.name for f in FORMATS if f.starts], word)


def _listed(names: list[str], word: str) -> str:
    return f" {word} ".join([*([", ".join(names[:-1])] if names[1:] else []), names[-1]])


def named(path: PathLike, among: list[Format]) -> Format | None:
    """The format, of those given, that has the suffix of a path."""
    ending = Path(path).suffix.lower()
    return next((f for f in among if ending in f.endings), None)


def ending_of(path: PathLike) -> str:
    """Words for the end of a path: that it is a folder, its suffix, or that it has none."""
    suffix = Path(path).suffix
    return "is a folder" if Path(path).is_dir() else f"ends in {suffix!r}" if suffix else "has no ending"


def writer_functions(path: PathLike, kind: Written) -> ModuleType:
    """Functions of the format in which `path` is written, by its suffix; ValueError where no format is written so."""
    among, path = writing(kind), arguments.path("path", path)
    form = named(path, among)
    if form is None:
        endings = suggested(among, "'")
        raise ValueError(f"{kind} path {str(path)!r} {ending_of(path)}; sarcl writes a {kind} to {endings}")
    return form.functions


def fields_of(value: DataclassInstance) -> dict[str, Any]:
    """The fields of a dataclass by name, as the writers take them; arrays are not copied."""
    return {field.name: getattr(value, field.name) for field in fields(value)}
