"""Figures of every program that plans build for a GPU: collected, compiled and counted, each program once."""

from __future__ import annotations

import functools
import hashlib
import json
import shutil
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from gpu_static import compilers, cycles, hot_loops, sass, tasks
from gpu_static.collect import PAPER, WITHOUT_FP64, Use, Variant, collected

from sarcl.opencl.programs import source

ROOT = Path(__file__).resolve().parents[2]
PARTS = 3  # of the tasks of a GPU, each collected by a process
KERNEL = "backproject_shared_lines"  # whose cycles are modelled
COUNTED = "sm_90"  # the target whose machine code is counted
# Figures of one kernel of a variant: {target: {figure: number}}, those that are not zero, or {target: {"error": words}}
Figures = dict[str, dict[str, Any]]


def cache() -> Path:
    """Folder of what earlier runs found, named by hashes of all that it follows from."""
    return Path(platformdirs.user_cache_dir("sarcl")) / "gpu_static"


def digest_of(key: Iterable[str]) -> str:
    """A name for what follows from some texts."""
    return hashlib.sha256("\0".join(key).encode()).hexdigest()


def kept(digest: str, make: Callable[[], Any]) -> Any:
    """What `make` returns, as JSON: from the cache where a run with the same digest has left it there."""
    path = cache() / f"{digest}.json"
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        made = make()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as file:
            json.dump(made, file)
        Path(file.name).replace(path)
    except OSError:  # a cache that cannot be written: the next run computes again
        pass
    return made


def _text(*names: str) -> list[str]:
    """Text of files of this folder, on which what they compute depends."""
    return [Path(__file__).with_name(f"{name}.py").read_text() for name in names]


def variants() -> dict[Variant, Use]:
    """Programs that plans build, and what they do with them, on GPUs with and without float64."""
    files = [*(ROOT / "sarcl").rglob("*.py"), *(ROOT / "kernels").glob("*.cl*"), ROOT / "bench" / "output_hashes.py"]
    found = kept(digest_of([*_text("collect", "tasks"), *(path.read_text() for path in sorted(files))]), _collect)
    return {
        Variant.named(name): Use(names, {kernel: set(groups) for kernel, groups in launched.items()})
        for name, (names, launched) in found.items()
    }


def first() -> dict[str, list[str]]:
    """{task: names of the programs}, of the tasks that the page tells of first: their programs that use pairs."""
    found = variants()
    return {
        name: sorted(v.name for v, use in found.items() if name in use.tasks and v.file.startswith("backproject"))
        for name in tasks.OWN if name.startswith("spaceborne")
    }  # fmt: skip


def _collect() -> dict[str, Any]:
    """As `variants`: {name of the variant: [tasks, {kernel: work-items per group}]}."""
    out: dict[str, Any] = {}
    parts = [(fp64, part) for fp64 in (True, False) for part in range(PARTS)]
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for found in pool.map(_collect_part, parts):
            for variant, use in found.items():
                names, launched = out.setdefault(variant.name, [[], {}])
                names += use.tasks
                for kernel, groups in use.groups.items():
                    launched[kernel] = sorted({*launched.get(kernel, []), *groups})
    return out


def _collect_part(part: tuple[bool, int]) -> dict[Variant, Use]:
    """Programs of a part of the tasks, of a GPU with or without float64: (which, number of the part)."""
    fp64, number = part
    info, chosen = (PAPER, tasks.tasks()) if fp64 else (WITHOUT_FP64, tasks.without_fp64())
    names = np.array_split(list(chosen), PARTS)[number].tolist()
    return collected({name: chosen[name] for name in names}, info, tasks.UNTIL)


def _counted(variant: Variant) -> dict[str, Figures]:
    """{kernel: figures} of one program, all kernels of it."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        made = compilers.compiled(variant, folder)
        out: dict[str, Figures] = {}
        for target, found in made.items():
            if "error" in found:
                out.setdefault("", {})[target] = {"error": found["error"]}
                continue
            for kernel, numbers in found.items():
                out.setdefault(kernel, {})[target] = {k: v for k, v in dict(numbers).items() if v}
        if "error" not in made[COUNTED]:
            listing = compilers.listing(COUNTED, folder)
            for kernel in made[COUNTED]:
                try:
                    found = hot_loops.cost(
                        sass.code_of(listing, kernel), hot_loops.HOT.get((variant.file, kernel)), dict(variant.macros)
                    )
                except hot_loops.NotCounted as exc:
                    out[kernel][COUNTED]["error"] = str(exc)
                else:
                    out[kernel][COUNTED]["instructions"] = round(found.each, 1)
                    if round(found.each_at_most, 1) != round(found.each, 1):
                        out[kernel][COUNTED]["both sides"] = round(found.each_at_most, 1)
                    out[kernel][COUNTED]["loads"] = round(found.by_kind.get("load global", 0) / found.contributions, 1)
    return out


def models() -> dict[str, list[float]]:
    """A model: {name of a program of `first`: groups on a multiprocessor of sm_90, contributions per second}."""
    names = sorted({name for some in first().values() for name in some if (name.split()[0], KERNEL) in hot_loops.HOT})
    texts = _text("compilers", "sass", "hot_loops", "occupancy", "cycles")
    return {
        name: kept(digest_of([*texts, name, source(name.split()[0])]), functools.partial(_modelled, name))
        for name in names
    }


def _modelled(name: str) -> list[float]:
    """As `models`, of one program."""
    variant = Variant.named(name)
    with tempfile.TemporaryDirectory() as scratch:
        program, groups = cycles.compiled(variant, KERNEL, source(variant.file), Path(scratch))
    return [groups, cycles.rate(program, hot_loops.HOT[variant.file, KERNEL], dict(variant.macros), groups)]


def intel(digests: dict[str, str], record: dict[str, Any]) -> tuple[int, list[str]]:
    """Number of the programs without float64 that Intel's compiler, which is installed, builds; its refusals in words.

    Those with a digest of the record are not built again where Intel's compiler built the record's programs.
    """
    tool = str(Path(str(shutil.which(compilers.OCLOC))).resolve().stat().st_mtime_ns)
    known = record.get("digests", {}) if record.get("intel") else {}
    chosen = [v for v in map(Variant.named, digests) if not _wide(v)]

    def one(variant: Variant) -> str:
        if known.get(variant.name) == digests[variant.name]:
            return ""
        return str(kept(digest_of([tool, digests[variant.name]]), lambda: compilers.intel_refusal(variant)))

    with ThreadPoolExecutor() as pool:
        said = list(pool.map(one, chosen))
    refused = [
        f"{variant.name} on Intel's {compilers.INTEL} cannot be compiled: {words}"
        for variant, words in zip(chosen, said, strict=True) if words
    ]  # fmt: skip
    return len(chosen) - len(refused), refused


def _wide(variant: Variant) -> bool:
    """Whether a program computes in float64."""
    macros = dict(variant.macros)
    return bool(macros["FP64"]) if "FP64" in macros else "double" in source(variant.file)


def figures(progress: Callable[[int, int], None], record: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """{name of a variant: {kernel: figures}}, of kernels that tasks launch, and {name: digest of all they follow from}.

    A program whose digest is in the record has the figures there. One that a compiler refuses has its errors under the
    name of each kernel.
    """
    chosen = {variant: use for variant, use in variants().items() if use.groups}
    common = [json.dumps(compilers.versions()), *_text("compilers", "sass", "hot_loops")]
    digests = {variant.name: digest_of([*common, variant.name, source(variant.file)]) for variant in chosen}

    def one(variant: Variant) -> dict[str, Figures]:
        digest, known = digests[variant.name], record["figures"].get(variant.name, {})
        if record.get("digests", {}).get(variant.name) == digest and set(chosen[variant].groups) <= set(known):
            return {kernel: {k: v for k, v in found.items() if k != "group"} for kernel, found in known.items()}
        return dict(kept(digest, lambda: _counted(variant)))

    out: dict[str, dict[str, Figures]] = {}
    with ThreadPoolExecutor() as pool:
        for done, (variant, found) in enumerate(zip(chosen, pool.map(one, chosen), strict=True), 1):
            refused = found.pop("", {})
            out[variant.name] = {
                kernel: {"group": max(groups), **found.get(kernel, {}), **refused}
                for kernel, groups in sorted(chosen[variant].groups.items())
            }
            progress(done, len(chosen))
    return dict(sorted(out.items())), dict(sorted(digests.items()))
