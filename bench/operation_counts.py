"""Operations, bytes and instructions of OpenCL kernels, counted as PoCL runs them on a CPU.

PoCL keeps each work-group function as LLVM code (parallel.bc) beside the shared library that it compiles from it, when
POCL_LEAVE_KERNEL_COMPILER_TEMP_FILES is set. `instrument` adds a counter to every basic block of that code and
replaces the library. The next process with the same cache loads it, runs at the same numbers of work-items and loop
steps, and `Counters.take` multiplies the counters by what the instructions of each block do. Nothing is sampled.

A floating-point addition, multiplication, division or square root is one operation of each lane, a multiply-add two;
comparisons, minima, conversions and integers are none. Bytes are those of all loads and stores, the stack included.
An instruction wider than a register of the machine counts as often as it fills one.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import re
import shutil
import subprocess
from collections.abc import Container
from pathlib import Path

import numpy as np

COUNTER = "sarcl_block_counts"
LEAVE_CODE = {"POCL_LEAVE_KERNEL_COMPILER_TEMP_FILES": "1"}  # environment of the process that builds the kernels
REGISTER = 64  # bytes of a vector register of AVX-512
# operations, divisions  of lanes, in float32 and float64: a division or square root is in both
# bytes  loaded and stored
# instructions  but those of addresses, of values under another name, and of jumps without a condition
QUANTITIES = "operations32", "operations64", "divisions32", "divisions64", "bytes", "instructions"
Counts = dict[str, float]
OPERATIONS = {"fadd": 1, "fsub": 1, "fmul": 1, "fdiv": 1, "frem": 1, "fma": 2, "fmuladd": 2, "sqrt": 1}
DIVISIONS = "fdiv", "frem", "sqrt"
# parts of addresses, values under another name, and hints to the compiler
FREE = {
    "alloca", "bitcast", "getelementptr", "phi", "ret", "unreachable", "inttoptr", "ptrtoint", "freeze", "extractvalue",
    "insertvalue", "addrspacecast", "lifetime", "experimental", "assume", "dbg", "prefetch",
}  # fmt: skip
BYTES = {"half": 2, "float": 4, "double": 8, "ptr": 8}
TYPE = re.compile(r"<(\d+) x (\w+)>|\b(float|double|half|ptr|i\d+)\b")
INSTRUCTION = re.compile(r"(?:%[^ ]+ = |)(?:(?:tail|musttail|notail) )?([a-z]\w*)")
CALLED = re.compile(r"@([\w.]+)\(")
# one value in all lanes: what uses it reads it from memory so
SPLAT = re.compile(r"insertelement <\d+ x \w+> (?:poison|undef), .* i64 0$|shufflevector .*> zeroinitializer$")
LABEL = re.compile(r'(?:"[^"]*"|[-\w$.]+):')


class NotCounted(RuntimeError):
    """Code that calls a function whose work is unknown."""


def instrument(cache: Path, clang: str, cpu: str) -> list[Path]:
    """Count in every kernel of PoCL's cache: its libraries are compiled again, by `clang` for `cpu`; their paths.

    The quantities of each block lie beside a library, with the suffix .json.
    """
    libraries = []
    for code in sorted(cache.rglob("parallel.bc")):
        library = code.with_name(f"{code.parents[1].name}.so")
        text = run(clang, "-x", "ir", str(code), "-S", "-emit-llvm", "-Xclang", "-disable-llvm-passes", "-o", "-")
        counting, blocks = with_counters(text)
        written = code.with_name("counting.ll")
        written.write_text(counting)
        options = ["-O2", "-Xclang", "-disable-llvm-passes", f"-march={cpu}", "-fPIC", "-shared", "-lm"]
        run(clang, *options, "-o", str(code.with_name("counting.so")), str(written))
        code.with_name("counting.so").replace(library)
        library.with_suffix(".json").write_text(json.dumps(blocks))
        libraries.append(library)
    return libraries


def run(*command: str) -> str:
    """Output of a command; RuntimeError with its message where it fails."""
    process = subprocess.run([*command, "-Wno-override-module"], capture_output=True, text=True, check=False)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{process.stderr[-2000:]}")
    return process.stdout


def clang_of(version: str) -> str:
    """Path of the compiler of the LLVM that a PoCL platform names in its version text."""
    found = re.search(r"LLVM (\d+)", version)
    path = shutil.which(f"clang-{found[1]}") if found else None
    if path is None:
        wanted = f"clang-{found[1]}" if found else "a PoCL device"
        raise RuntimeError(f"counting needs {wanted}, got the platform {version!r}; install the package of that name")
    return path


def with_counters(text: str) -> tuple[str, list[Counts]]:
    """LLVM code that counts how often each basic block runs, and the quantities of the blocks."""
    lines: list[str] = []
    blocks: list[Counts] = []
    defined = frozenset(re.findall(r"^define .*?@([\w.]+)\(", text, re.MULTILINE))
    inside = waiting = in_switch = False  # in a function; before the first instruction of a block; in a switch's list
    for line in text.splitlines():
        stripped = line.strip()
        if line.startswith("define "):
            inside = waiting = True
            blocks.append(dict.fromkeys(QUANTITIES, 0.0))
        elif line.startswith("}"):
            inside = False
        elif inside and not line.startswith(" ") and LABEL.match(line):
            waiting = True
            blocks.append(dict.fromkeys(QUANTITIES, 0.0))
        elif inside and stripped and not stripped.startswith(";"):
            if waiting and " = phi " not in line:
                lines.append(counting(len(blocks) - 1))
                waiting = False
            if not in_switch:
                for name, value in quantities(stripped, defined).items():
                    blocks[-1][name] += value
            in_switch = (in_switch or stripped.startswith("switch ")) and not stripped.endswith("]")
        lines.append(line)
    lines.append(f"@{COUNTER} = global [{len(blocks)} x i64] zeroinitializer")
    return "\n".join(lines).replace("{BLOCKS}", str(len(blocks))) + "\n", blocks


def counting(block: int) -> str:
    """The instruction that counts a block; several threads count at once."""
    place = f"getelementptr inbounds ([{{BLOCKS}} x i64], ptr @{COUNTER}, i64 0, i64 {block})"
    return f"  %sarcl.count.{block} = atomicrmw add ptr {place}, i64 1 monotonic"


def quantities(line: str, defined: Container[str] = ()) -> Counts:
    """What one instruction of LLVM code does; calls of `defined` functions count in the blocks of these."""
    match = INSTRUCTION.match(line)
    if match is None:
        raise NotCounted(f"no instruction of LLVM code: {line!r}")
    name = match[1]
    if name == "call":
        name = called(line, defined)
    if name in FREE or line.startswith("br label") or SPLAT.search(line):
        return {}
    lanes, kind = type_of(line)
    width = lanes * BYTES.get(kind, int(kind[1:] or 0) / 8 if kind[0] == "i" else 0)
    out: Counts = {"instructions": max(1, math.ceil(width / REGISTER))}
    if name in ("load", "store", "atomicrmw", "cmpxchg"):
        out["bytes"] = width
    elif name in ("gather", "scatter"):
        out = {"instructions": lanes, "bytes": width}
    elif name in ("memcpy", "memmove", "memset"):
        size = re.search(r"i64 (\d+), i1", line)
        if size is None:
            raise NotCounted(f"bytes are not constant: {line!r}")
        moved = int(size[1])
        out = {"instructions": max(1, math.ceil(moved / REGISTER)), "bytes": moved * (1 if name == "memset" else 2)}
    elif name in OPERATIONS:
        precision = 64 if kind == "double" else 32
        out[f"operations{precision}"] = lanes * OPERATIONS[name]
        if name in DIVISIONS:
            out[f"divisions{precision}"] = lanes
    return out


def type_of(line: str) -> tuple[int, str]:
    """Lanes and type of the first value of an instruction: its result, or what it stores."""
    text = line.partition(" = ")[2] or line
    if ".vector.reduce." in text:
        text = text[text.rindex("<") :]  # the vector that is reduced, not the scalar that results or begins
    match = TYPE.search(text)
    if match is None:
        return 1, "i0"
    return (int(match[1]), match[2]) if match[1] else (1, match[3])


def called(line: str, defined: Container[str]) -> str:
    """Name of the operation of an intrinsic function, "call" for a defined one."""
    match = CALLED.search(line)
    name = match[1] if match else ""
    parts = name.split(".")
    if parts[0] != "llvm":
        if name in defined:
            return "call"
        raise NotCounted(f"unknown work of a call: {line!r}")
    if parts[1] == "masked":
        return {"expandload": "gather", "compressstore": "scatter"}.get(parts[2], parts[2])
    if parts[1] == "vector" and parts[2] == "reduce":
        return parts[3]
    if parts[1] == "x86":
        return next((word for word in ("gather", "sqrt") if word in name), "x86")
    return parts[1]


class Counters:
    """Counters of the libraries that `instrument` wrote, as far as this process has loaded them."""

    def __init__(self, libraries: list[Path]) -> None:
        self._waiting = dict.fromkeys(libraries)
        self._loaded: list[tuple[ctypes.Array[ctypes.c_int64], np.ndarray]] = []

    def take(self) -> Counts:
        """What all kernels have done since the last call; counters begin again at 0. No kernel may run."""
        for library in list(self._waiting):
            try:
                opened = ctypes.CDLL(str(library), mode=os.RTLD_NOLOAD | os.RTLD_NOW)
            except OSError:  # not loaded
                continue
            del self._waiting[library]
            blocks = json.loads(library.with_suffix(".json").read_text())
            each = np.array([[block[name] for name in QUANTITIES] for block in blocks])
            self._loaded.append(((ctypes.c_int64 * len(blocks)).in_dll(opened, COUNTER), each))
        total = np.zeros(len(QUANTITIES))
        for counters, each in self._loaded:
            total += np.ctypeslib.as_array(counters) @ each
            ctypes.memset(counters, 0, ctypes.sizeof(counters))
        return dict(zip(QUANTITIES, total.tolist(), strict=True))
