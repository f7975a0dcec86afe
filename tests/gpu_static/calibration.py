"""How far the model of cycles is from rates measured on an H100, for variants of the lines that work-groups share.

    python tests/gpu_static/run.py --model    the model's rate beside each measured one, and its errors

Measured variants are those of bench/results/gpu/h100.json that the kernel has today: sizes of tiles and groups, taps,
samples per pixel, registers, and whether profiles are read ahead. Coefficients of taps are as many as plans take.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gpu_static import cycles, hot_loops
from gpu_static.collect import Variant
from gpu_static.figures import KERNEL, ROOT

from sarcl.opencl.programs import source

FILE = "backproject_shared_lines.cl"
STAGE = "variants of lines that work-groups share"
NAME = re.compile(r"at (\S+), tiles of (\d+), (\d+) taps, (\d+) samples per pixel, (\d+) slope taps")  # of a row
TERMS = {0: 0, 2: 2, 4: 3, 6: 4, 8: 5}  # coefficients of the taps of a line, by their number


@dataclass(frozen=True)
class Measured:
    """A variant: its macros, whether profiles are read ahead, and its measured contributions per second."""

    macros: dict[str, int]
    ahead: bool
    rate: float

    @property
    def words(self) -> str:
        """The variant in words."""
        shown = ("SIDE", "ITEMS", "LINE_TAPS", "FINE", "SLOPE_TAPS", "REGISTERS")
        return ", ".join([*(f"{name} {self.macros[name]}" for name in shown), "ahead" * self.ahead]).rstrip(", ")


def measured() -> list[Measured]:
    """The measured variants that the kernel has today, whose entries are copied to local memory."""
    rows = json.loads((ROOT / "bench" / "results" / "gpu" / "h100.json").read_text())["rows"]
    return [_of(row) for row in rows if row["stage"] == STAGE and row["copied"]]


def _of(row: dict[str, Any]) -> Measured:
    found = NAME.search(row["name"])
    assert found
    tolerance, (side, taps, fine, slopes) = float(found[1]), map(int, found.groups()[1:])
    fits = 4 if tolerance >= 1e-3 else 6  # taps of range profiles
    bound = [int(option.split("=")[1]) for option in row["options"]]
    macros = {
        "BEAM": 0, "BISTATIC": 0, "CHUNK": 64, "FINE": fine, "FP64": 1, "GROUP": 64, "ITEMS": row["items"],
        "LINE_TAPS": taps, "LINE_TERMS": TERMS[taps], "NATIVE": 1, "ORDER": 2, "REGISTERS": sum(bound), "SHARED": 1,
        "SIDE": side, "SLOPE_TAPS": slopes, "SLOPE_TERMS": TERMS[slopes], "TAPS": fits, "TERMS": fits // 2 + 2,
        "VW": 1, "WRAP": 0,
    }  # fmt: skip
    return Measured(macros, bool(row["ahead"]), row["kernel_Gbp_s"] * 1e9)


def compared(machine: cycles.Machine = cycles.H100) -> Iterator[tuple[Measured, int, float]]:
    """Each measured variant, groups on a multiprocessor, and the model's contributions per second."""
    hot = hot_loops.HOT[FILE, KERNEL]

    def one(variant: Measured) -> tuple[Measured, int, float] | None:
        text, n = re.subn(r"#define AHEAD .*", f"#define AHEAD {int(variant.ahead)}", source(FILE))
        assert n == 1, f"{FILE} does not define AHEAD once"
        macros = tuple(sorted(variant.macros.items()))
        with tempfile.TemporaryDirectory() as scratch:
            program, groups = cycles.compiled(Variant(FILE, macros), KERNEL, text, Path(scratch))
        try:
            return variant, groups, cycles.rate(program, hot, variant.macros, groups, machine)
        except hot_loops.NotCounted:
            return None

    with ThreadPoolExecutor(2) as pool:
        yield from filter(None, pool.map(one, measured()))


def shown() -> None:
    """Print the model's rate beside each measured one, then the median and the worst error."""
    ratios = []
    for variant, groups, rate in compared():
        ratios.append(rate / variant.rate)
        print(f"{variant.words}: {groups} groups, measured {variant.rate / 1e9:.0f}, model {rate / 1e9:.0f} Gbp/s")
    errors = np.abs(np.array(ratios) - 1)
    print(
        f"{len(ratios)} of {len(measured())} variants: error {np.median(errors):.0%} in the median, {errors.max():.0%} "
        f"at worst; measured rates are {np.median(1 / np.array(ratios)):.3f} of the model's in the median"
    )
