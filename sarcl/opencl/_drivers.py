"""Drivers of OpenCL as .icd files name them, and why the library of one cannot be loaded."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from . import _child

VENDORS = Path("/etc/OpenCL/vendors")
DLOPEN = "import ctypes, sys\ntry: ctypes.CDLL(sys.argv[1])\nexcept OSError as exc: print(exc)"


@dataclass(frozen=True)
class Driver:
    """A driver: its .icd file, and the library that the file names."""

    icd: Path
    library: str

    def is_among(self, loaded: list[str]) -> bool:
        """Whether its library is among the paths of those that a process has loaded."""
        if os.path.isabs(self.library):
            return os.path.realpath(self.library) in loaded
        return any(f"{Path(path).name}.".startswith(f"{self.library}.") for path in loaded)

    def trouble(self) -> tuple[str, str]:
        """Why the library cannot be loaded, in the words of dlopen, and the remedy; empty texts where it can."""
        if not self.library:
            return f"{self.icd} names no library", "write the path of the driver's library in it, or remove it"
        beside = self.icd.parent / self.library  # a wheel's loader looks in its own folder first
        path = str(beside if beside.exists() else self.library)
        words, end = _child.run(DLOPEN, path)
        if not words + end:
            return "", ""
        what = f"{self.icd} names a library that cannot be loaded: {(words + end).strip()}"
        missing = re.match(r"(\S+): cannot open shared object file", words)
        if missing and missing[1] != path:
            return what, f"install the package that holds {missing[1]}, or add its folder to LD_LIBRARY_PATH"
        roots = (*self.icd.parents[2:4], Path(sys.prefix))  # files of some wheels have a placeholder for the folder
        true = next(
            (root / "lib" / Path(path).name for root in roots if (root / "lib" / Path(path).name).exists()), None
        )
        if missing and true:
            return what, f"write {true} in a copy in a folder that OCL_ICD_VENDORS names (docs/guide/install.md)"
        return what, f"write the right path in it, reinstall the driver, or remove {self.icd}"

    @contextlib.contextmanager
    def alone(self) -> Iterator[_child.Variables]:
        """Variables of a child whose loader sees this driver alone."""
        with tempfile.TemporaryDirectory(prefix="sarcl-icd-") as folder:
            copy = shutil.copy(self.icd, folder)
            yield {"OCL_ICD_VENDORS": copy if wheel() else folder}


def wheel() -> Path | None:
    """Folder of the loader in pyopencl's wheel, where drivers of wheels lie too; None where there is none."""
    spec = importlib.util.find_spec("pyopencl")
    folder = Path(spec.origin or "").parent / ".libs" if spec else None
    return folder if folder and folder.is_dir() else None


def drivers() -> list[Driver]:
    """The drivers that the loader is told of, by OCL_ICD_VENDORS or OPENCL_VENDOR_PATH where one is set."""
    default_folder = Path(sys.prefix, "etc/OpenCL/vendors") if Path(sys.prefix, "conda-meta").is_dir() else VENDORS
    place = Path(os.environ.get("OCL_ICD_VENDORS") or os.environ.get("OPENCL_VENDOR_PATH") or default_folder)
    files = [place] if place.suffix == ".icd" else [p for f in (place, wheel()) if f for p in sorted(f.glob("*.icd"))]
    drivers_of_files = []
    for file in files:
        with contextlib.suppress(OSError):
            drivers_of_files.append(Driver(file, file.read_text(errors="replace").partition("\n")[0].strip()))
    return drivers_of_files
