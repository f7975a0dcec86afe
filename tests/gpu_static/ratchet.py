"""Whether figures are no worse than those recorded, and within what every GPU allows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from gpu_static import occupancy
from gpu_static.compilers import AMD, IMAGES, targets_of
from gpu_static.figures import COUNTED, ROOT

RECORD = Path(__file__).with_name("figures.json")
REMEDY = (
    "Make the kernel cheaper; or, if it is worth this, record it with `make gpu-static ARGS=--record` and say why in "
    "the commit"
)
LEAST_GROUPS = 2  # per multiprocessor of NVIDIA, of kernels that make images: one computes while the other waits
MOST_LOCAL = 48 * 1024  # bytes of local memory per work-group that every GPU has
# Programs that no plan for a GPU builds, and why.
NOT_ON_GPUS = {
    "trial.cl": "the trial of a device builds it, no plan does",
    "backproject_lines.cl": "a work-item owns a tile of pixels; plans for one lane per work-item do not choose it",
}
# kernels that may spill, as much as is recorded and no more, and why that costs little
MAY_SPILL = {
    "row_gradients_float64.cl": "with gains of antennas; 20 spills are few beside 3300 instructions a pulse and point",
    "backproject_shared_lines.cl": "within the registers that let two groups fit a multiprocessor; on an H100 5 % "
    "faster than one group without spills",
}
# Programs for images, of which one group fits a multiprocessor, and why: file and some of their macros.
MAY_BE_ALONE = {
    "backproject.cl RANGE=3 TAPS=6": "132 and 134 registers on sm_80 and sm_89",
    "backproject_float64.cl GAINS=2": "gradients with gains of antennas, 3355 instructions a pulse and pixel",
}
RATCHETED = {"registers": "registers", "accumulators": "registers", "spills": "bytes or registers that spill",
             "stack": "bytes of stack", "local memory": "bytes of local memory",
             "instructions": "instructions per contribution"}  # fmt: skip

Record = dict[str, Any]


def recorded() -> Record:
    """As committed: {"tools": versions, "intel": number of programs that Intel's compiler built, "digests": {variant:
    text}, "figures": {variant: {kernel: figures}}}."""
    found: Record = json.loads(RECORD.read_text())
    return found


def text_of(record: Record) -> str:
    """JSON of a record: a line per target of each kernel."""
    lines = ["{", f' "tools": {json.dumps(record["tools"])},',
             f' "first": {json.dumps(record["first"])},',
             *(f' "{key}": {json.dumps(record[key])},' for key in ("intel", "models")),
             ' "digests": {', ",\n".join(f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in record["digests"].items()),
             " },", ' "figures": {']  # fmt: skip
    for i, (variant, kernels) in enumerate(record["figures"].items()):
        lines.append(f"  {json.dumps(variant)}: {{")
        for j, (kernel, found) in enumerate(kernels.items()):
            rows = [f"    {json.dumps(key)}: {json.dumps(value)}" for key, value in found.items()]
            lines += [f"   {json.dumps(kernel)}: {{", ",\n".join(rows), "   }" + "," * (j + 1 < len(kernels))]
        lines.append("  }" + "," * (i + 1 < len(record["figures"])))
    return "\n".join([*lines, " }", "}"]) + "\n"


def limits(found: dict[str, Any]) -> list[str]:
    """Sentences on kernels that do not compile, spill, use a stack, take more local memory than every GPU has, or make
    images in groups of which fewer than LEAST_GROUPS fit a multiprocessor."""
    out = []
    for variant, kernels in found.items():
        for kernel, numbers in kernels.items():
            for target in targets_of(variant.split()[0]):
                here = numbers[target]
                where = f"{variant}: kernel {kernel} on {target}"
                if "error" in here:
                    out.append(f"{where} cannot be compiled or counted: {here['error']}")
                    continue
                for name in ("spills", "stack"):
                    if here.get(name) and not (name == "spills" and variant.split()[0] in MAY_SPILL):
                        out.append(
                            f"{where}: {here[name]} {RATCHETED[name]}, wanted none. Keep arrays that are indexed by "
                            "variables out of the kernel, or in local memory"
                        )
                if here.get("local memory", 0) > MOST_LOCAL:
                    out.append(
                        f"{where}: {here['local memory']} bytes of local memory, wanted at most {MOST_LOCAL}. "
                        "Make the tile or the group smaller"
                    )
                if target not in AMD and _alone(variant, target, here, numbers["group"]):
                    out.append(
                        f"{where}: one group on a multiprocessor, wanted {LEAST_GROUPS}. Take fewer registers or less "
                        "local memory, or give a reason in tests/gpu_static/ratchet.py:MAY_BE_ALONE"
                    )
    return out


def _alone(variant: str, target: str, here: dict[str, int], group: int) -> bool:
    """Whether too few groups of a kernel that makes images fit a multiprocessor, for no reason that is known."""
    file = variant.split()[0]
    fits = occupancy.groups(target, here.get("registers", 0), here.get("local memory", 0), group)
    known = any(set(some.split()) <= set(variant.split()) for some in MAY_BE_ALONE)
    return file in IMAGES and not known and fits < LEAST_GROUPS


def coverage(found: dict[str, Any]) -> list[str]:
    """Sentences on files of kernels/ of which no task builds a program, and on reasons that hold no longer."""
    built = {variant.split()[0] for variant in found}
    files = {path.name for path in (ROOT / "kernels").glob("*.cl")}
    return [
        *(f"kernels/{name}: no task of tests/gpu_static/tasks.py launches a kernel of it; add one that does, or give a "
          "reason in tests/gpu_static/ratchet.py:NOT_ON_GPUS" for name in sorted(files - built - set(NOT_ON_GPUS))),
        *(f"{name} is launched on GPUs; take it out of tests/gpu_static/ratchet.py:NOT_ON_GPUS"
          for name in sorted(built & set(NOT_ON_GPUS))),
    ]  # fmt: skip


def worse(found: dict[str, Any], before: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Sentences on figures above the recorded ones, and on figures below them.

    A variant that is not recorded may cost what the costliest recorded variant of its kernel costs, of those with its
    FP64. A kernel that is not recorded at all is worse.
    """
    above, below = [], []
    for variant, kernels in found.items():
        for kernel, numbers in kernels.items():
            known = before.get(variant, {}).get(kernel)
            alike = [known] if known else _alike(before, variant, kernel)
            if not alike:
                above.append(f"{variant}: kernel {kernel} has no recorded figures. {REMEDY}")
                continue
            for target in targets_of(variant.split()[0]):
                for name, words in RATCHETED.items():
                    got = numbers[target].get(name, 0)
                    wanted = max(other.get(target, {}).get(name, 0) for other in alike)
                    line = f"{variant}: kernel {kernel} on {target}: {got} {words}, recorded {wanted}"
                    if got > wanted:
                        note = "" if known else " at most, for variants of this kernel"
                        above.append(f"{line}{note}. {REMEDY}")
                    elif got < wanted and known:
                        below.append(line)
    return above, below


def _alike(before: dict[str, Any], variant: str, kernel: str) -> list[dict[str, Any]]:
    """Recorded figures of variants of the same file, kernel and FP64."""
    file, *macros = variant.split()
    mark = next((m for m in macros if m.startswith("FP64=")), "")
    return [
        kernels[kernel] for name, kernels in before.items()
        if name.split()[0] == file and kernel in kernels and (not mark or mark in name.split())
    ]  # fmt: skip


def counted(numbers: dict[str, Any]) -> float | None:
    """Instructions per contribution."""
    value = numbers[COUNTED].get("instructions")
    return None if value is None else float(value)
