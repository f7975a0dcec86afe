"""Source texts of kernels, and precautions for building programs."""

from __future__ import annotations

import functools
import re
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.text import size_text

if TYPE_CHECKING:
    import pyopencl


POCL = "Portable Computing Language"  # name of PoCL's platform
_building = threading.RLock()  # the filters of warnings belong to all threads
LEAST_FILE = 2**20  # bytes, of a file that PoCL writes for a kernel: the largest have 0.6 MB
STALE = 5.0  # s; an older lock on the cache of binaries belongs to a process that was killed


@functools.cache
def source(file: str) -> str:
    """A kernel file with its #include lines expanded on the host: -I is not portable and breaks on spaces.

    Each header is included once; #line keeps compilers' messages pointing at the real files.
    """
    seen: set[str] = set()

    def expand(name: str) -> str:
        seen.add(name)
        out = [f'#line 1 "{name}"']
        for n, line in enumerate(files("sarcl.kernels").joinpath(name).read_text().splitlines(), 1):
            match = re.match(r'\s*#include "([^"]+)"', line)
            if match and match[1] not in seen:
                out += [expand(match[1]), f'#line {n + 1} "{name}"']
            elif not match:
                out.append(line)
        return "\n".join(out)

    return expand(file)


@functools.cache
def names_in(text: str) -> frozenset[str]:
    """Every identifier of OpenCL source text, those in comments left out."""
    return frozenset(re.findall(r"\b[A-Za-z_]\w*", re.sub(r"//.*", "", text)))


def build(context: pyopencl.Context, text: str, options: list[str]) -> pyopencl.Program:
    """The built program of OpenCL source text; pyopencl.Error where it does not build.

    PoCL reads Clang's declarations of every built-in function, 900 kB, for each build, also of a program that it has
    in its cache. It is told that it has read them (they are guarded by _OPENCL_H_) and given those that kernels use.
    A version of PoCL where this does not build gets the text alone.
    """
    import pyopencl

    if context.devices[0].platform.name == POCL:
        check_file_limit()
        with suppress(pyopencl.Error):
            return pyopencl.Program(context, source("builtins.clh") + "\n" + text).build([*options, "-D_OPENCL_H_"])
    return pyopencl.Program(context, text).build(options)


def check_file_limit() -> None:
    """OSError where files may be so small that PoCL's compiler, which writes what it builds, would end the process."""
    try:
        from resource import RLIM_INFINITY, RLIMIT_FSIZE, getrlimit
    except ImportError:  # Windows has no such limits
        return
    most = getrlimit(RLIMIT_FSIZE)[0]
    if most != RLIM_INFINITY and most < LEAST_FILE:
        raise OSError(
            f"kernels cannot be built: files may have {size_text(most)} at most here (ulimit -f), and PoCL writes what "
            f"it builds to files of up to {size_text(LEAST_FILE)}; raise the limit"
        )


def kernels_of(program: Any) -> dict[str, Any]:
    """The kernels of a built program by their names."""
    import pyopencl

    kernels = {kernel.function_name: kernel for kernel in program.all_kernels()}
    if not kernels:
        platform = program.get_info(pyopencl.program_info.DEVICES)[0].platform.name
        where = "POCL_CACHE_DIR or ~/.cache/pocl" if platform == POCL else "its own folder"
        raise RuntimeError(
            f"{platform} built a program without kernels: its cache of built programs, in {where}, may be damaged; "
            "delete that folder"
        )
    return kernels


@contextmanager
def quiet() -> Iterator[None]:
    """Context of every build: no warnings of a compiler that succeeds, and no wait for the lock of a killed process."""
    _drop_stale_lock()
    with _building, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _drop_stale_lock() -> None:
    """Remove the lock that a killed process has left on pyopencl's cache of binaries.

    pyopencl holds the lock for milliseconds. It waits a minute for a lock left by a killed process, and then fails.
    """
    import platformdirs

    for lock in Path(platformdirs.user_cache_dir("pyopencl", "pyopencl")).glob("pyopencl-compiler-cache-*/lock"):
        try:
            if time.time() - lock.stat().st_mtime > STALE:
                lock.unlink()
        except OSError:  # removed meanwhile, or of another user
            pass
