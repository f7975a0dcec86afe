"""Compilers for GPUs that are not here: clang and libclc, then ptxas for NVIDIA; clang for AMD; ocloc for Intel."""

from __future__ import annotations

import functools
import re
import shutil
import subprocess
import sysconfig
import tempfile
from pathlib import Path

from gpu_static.collect import Variant

from sarcl.opencl.programs import source

CLANG = "clang-19"
LIBRARY = Path("/usr/lib/clc")  # of Debian's package libclc-19: OpenCL's built-in functions as LLVM bitcode
NVIDIA, AMD = ("sm_80", "sm_90"), ("gfx90a", "gfx1100")
TARGETS = (*NVIDIA, *AMD)
MORE = ("sm_89", "sm_120")  # NVIDIA's GPUs for graphics, for the kernels that make images
IMAGES = (
    "assemble_image.cl", "backproject.cl", "backproject_float64.cl", "backproject_shared_lines.cl",
    "expand_subapertures.cl", "merge_subapertures.cl", "nufft2d.cl", "range_doppler.cl", "range_profiles.cl",
    "schedule_pulses.cl", "tile_constants.cl", "tile_constants_float64.cl", "transposition.cl", "weighted_samples.cl",
)  # fmt: skip
INTEL, OCLOC = "dg2", "ocloc"  # Intel's Arc; the compiler is Debian's package intel-opencl-icd, or Ubuntu's intel-ocloc
REMEDY = "type: sh .ci/setup.sh gpu-static"
COMMON = ("-x", "cl", "-cl-std=CL1.2", "-O3", "-nogpulib", "-Wno-linker-warnings")
PTX = ("--target=nvptx64-nvidia-nvcl", "-Xclang", "-target-cpu", "-Xclang", "sm_80", "-Xclang", "-target-feature",
       "-Xclang", "+ptx78", "-Dcl_khr_fp64")  # fmt: skip
# clang has no instruction for native_sin and native_cos of libclc; NVIDIA's OpenCL takes those of approximate values
NATIVE = ("-Dnative_sin=__nvvm_sin_approx_f", "-Dnative_cos=__nvvm_cos_approx_f")
FOUND = re.compile(
    r"Function properties for (\w+)\s*\n\s*(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads"
    r"\s*\nptxas info\s*: Used (\d+) registers(.*)"
)
AMD_FIGURES = {
    "registers": "VGPRs", "accumulators": "AGPRs", "scalar registers": "SGPRs", "stack": r"ScratchSize \[bytes/lane\]",
    "waves": r"Occupancy \[waves/SIMD\]", "spilled scalars": "SGPRs Spill", "spills": "VGPRs Spill",
    "local memory": r"LDS Size \[bytes/block\]",
}  # fmt: skip


def targets_of(file: str) -> tuple[str, ...]:
    """Targets for which a file of kernels/ is compiled."""
    return (*TARGETS, *MORE) if file in IMAGES else TARGETS


class DoesNotCompile(Exception):
    """A compiler refused a program; the message is the compiler's own."""


def called(command: list[str], given: str | None = None) -> str:
    """Standard output and error of a command. DoesNotCompile where its exit status is not 0."""
    done = subprocess.run(command, input=given, capture_output=True, text=True)
    if done.returncode:
        raise DoesNotCompile("\n".join((done.stdout + done.stderr).strip().splitlines()[-12:]))
    return done.stdout + done.stderr


@functools.cache
def tool(name: str) -> str:
    """Path of ptxas or nvdisasm, from the packages of the extra gpu-static or from PATH."""
    packages = Path(sysconfig.get_paths()["purelib"]) / "nvidia"
    found = sorted(packages.glob(f"*/bin/{name}")) or [shutil.which(name)]
    if found[0] is None:
        raise FileNotFoundError(f"{name} is not installed; {REMEDY}")
    return str(found[0])


@functools.cache
def versions() -> dict[str, str]:
    """Version of each tool that figures depend on. FileNotFoundError names a tool that is missing, and the remedy."""
    if shutil.which(CLANG) is None or not (LIBRARY / "nvptx64--nvidiacl.bc").exists():
        raise FileNotFoundError(f"{CLANG} or its libclc in {LIBRARY} is not installed; {REMEDY}")
    release = r"release [\d.]+, V([\d.]+)"
    return {
        "clang": re.search(r"clang version ([\d.]+)", called([CLANG, "--version"]))[1],  # type: ignore[index]
        "ptxas": re.search(release, called([tool("ptxas"), "--version"]))[1],  # type: ignore[index]
        "nvdisasm": re.search(release, called([tool("nvdisasm"), "--version"]))[1],  # type: ignore[index]
    }


def compiled(variant: Variant, folder: Path, text: str | None = None) -> dict[str, dict[str, dict[str, int] | str]]:
    """{target: {kernel: figures}} of a program; {"error": message} of a target whose compiler refuses it.

    Writes PTX, cubin and listing to `folder`. text: other source text than that of the file
    """
    text = source(variant.file) if text is None else text
    macros = [f"-D{k}={v}" for k, v in variant.macros]
    out: dict[str, dict[str, dict[str, int] | str]] = {}
    cards = [target for target in targets_of(variant.file) if target not in AMD]
    bound = dict(variant.macros).get("REGISTERS", 0)
    try:
        ptx = nvidia_ptx(text, macros, folder)
        _require_groups(ptx, text, dict(variant.macros))
    except DoesNotCompile as exc:
        out |= {target: {"error": str(exc)} for target in cards}
    else:
        for target in cards:
            try:
                out[target] = nvidia(ptx, target, folder, bound)
            except DoesNotCompile as exc:
                out[target] = {"error": str(exc)}
    for target in AMD:
        try:
            out[target] = amd(text, macros, target)
        except DoesNotCompile as exc:
            out[target] = {"error": str(exc)}
    return out


def nvidia_ptx(text: str, macros: list[str], folder: Path) -> Path:
    """NVIDIA's intermediate language for a program: one text, of which ptxas makes each target's machine code."""
    ptx = folder / "all.ptx"
    builtins = ["-Xclang", "-mlink-builtin-bitcode", "-Xclang", str(LIBRARY / "nvptx64--nvidiacl.bc")]
    called([CLANG, *PTX, *COMMON, *NATIVE, *macros, *builtins, "-S", "-o", str(ptx), "-"], text)
    return ptx


def _require_groups(ptx: Path, text: str, macros: dict[str, int]) -> None:
    """Write the size of groups that a kernel requires into its PTX, as NVIDIA's OpenCL does and clang does not.

    ptxas then gives a work-item of 256 at most 128 registers, so that two groups fit a multiprocessor.
    """
    required = re.search(r"reqd_work_group_size\((\w+), 1, 1\)", text)
    if required and not macros.get("REGISTERS"):
        items = macros.get(required[1]) or int(required[1])
        ptx.write_text(re.sub(r"(\.entry \w+\([^)]*\))", rf"\1\n.reqntid {items}, 1, 1", ptx.read_text()))


def nvidia(ptx: Path, target: str, folder: Path, bound: int = 0) -> dict[str, dict[str, int]]:
    """{kernel: registers, bytes of spills, stack, local memory} as ptxas says; its machine code is in `folder`.

    bound  most registers of a work-item, which plans ask of the driver; 0: none
    """
    cubin, options = folder / f"{target}.cubin", [f"--maxrregcount={bound}"] if bound else []
    words = called([tool("ptxas"), f"-arch={target}", "-v", "-O3", *options, str(ptx), "-o", str(cubin)])
    out = {}
    text = ptx.read_text()
    for name, stack, stores, loads, registers, rest in FOUND.findall(words):
        body = text.split(f".entry {name}(", 1)[1].split(".entry ", 1)[0]
        if not re.search(r"\b(ld|st)\.local\b", body):  # clang leaves frames that nothing reads or writes
            stack = "0"
        shared = re.search(r"(\d+) bytes smem", rest)
        out[name] = {
            "registers": int(registers), "spills": int(stores) + int(loads), "stack": int(stack),
            "local memory": int(shared[1]) if shared else 0,
        }  # fmt: skip
    return out


def listing(target: str, folder: Path) -> str:
    """nvdisasm's listing of the machine code that `nvidia` left in `folder`, with the words of each instruction."""
    return subprocess.run(
        [tool("nvdisasm"), "-c", "-hex", str(folder / f"{target}.cubin")], capture_output=True, text=True, check=True
    ).stdout


def amd(text: str, macros: list[str], target: str) -> dict[str, dict[str, int]]:
    """{kernel: figures as in AMD_FIGURES}, as clang's back end for AMD says."""
    builtins = ["-Xclang", "-mlink-builtin-bitcode", "-Xclang", str(LIBRARY / "amdgcn--amdhsa.bc")]
    remarks = called(
        [CLANG, "--target=amdgcn-amd-amdhsa", f"-mcpu={target}", *COMMON, *macros, *builtins,
         "-Rpass-analysis=kernel-resource-usage", "-S", "-o", "/dev/null", "-"], text
    )  # fmt: skip
    out = {}
    for part in remarks.split("Function Name: ")[1:]:
        name = re.match(r"\w+", part)
        assert name
        out[name[0]] = {
            key: int(found[1]) if (found := re.search(rf"\b{label}: (\d+)", part)) else 0
            for key, label in AMD_FIGURES.items()
        }
    return out


def intel_refusal(variant: Variant) -> str:
    """What ocloc says of a program that it does not build for Intel's Arc; "" where it builds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "program.cl"
        path.write_text(source(variant.file))
        options = " ".join(["-cl-std=CL1.2", *(f"-D{k}={v}" for k, v in variant.macros)])
        try:
            called([OCLOC, "compile", "-file", str(path), "-device", INTEL, "-options", options, "-out_dir", folder])
        except DoesNotCompile as exc:
            return str(exc)
    return ""
