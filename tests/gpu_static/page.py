"""The tables of docs/developers/gpu_static.md and of tests/gpu_static/variants.md, from recorded figures."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from gpu_static import occupancy, wavefronts
from gpu_static.compilers import AMD
from gpu_static.figures import COUNTED, ROOT
from gpu_static.hot_loops import HOT
from gpu_static.ratchet import MAY_BE_ALONE, MAY_SPILL, NOT_ON_GPUS

PAGE = ROOT / "docs" / "developers" / "gpu_static.md"
VARIANTS = ROOT / "tests" / "gpu_static" / "variants.md"  # a table per kernel, too long for a page of the docs
BEGIN, END = "<!-- tables: begin, made by `make gpu-static ARGS=--record` -->", "<!-- tables: end -->"
SHOWN = (
    "TAPS",
    "LINE_TAPS",
    "SLOPE_TAPS",
    "FINE",
    "RANGE",
    "FP64",
    "NATIVE",
)  # macros by which the first table names programs
# H200, inferred: 132 multiprocessors that issue to 4 x 32 lanes, and pass a wavefront, in each cycle at 1.75 GHz.
WAVEFRONTS = 132 * 1.75e9
LANE_INSTRUCTIONS = 4 * 32 * WAVEFRONTS
# Programs of the gather kernel for the same pulses and pixels, which take what lines cannot hold: the macros by which
# they are found, and samples of a range profile per pulse as plans would choose them.
GATHER = {
    "1e-3": ({"TAPS": "4", "TERMS": "2", "RANGE": "0"}, 32768),
    "3e-5": ({"TAPS": "4", "TERMS": "2", "RANGE": "3"}, 65536),
}
GATHER_TILE = 1024  # pixels of its tiles
# Kernels that make records, of the gather kernel and of lines that a work-group shares.
RECORDS = ({"tile_constants"}, {"line_constants", "schedule_pulses"})
PLAIN = {"BEAM": "0", "BISTATIC": "0", "FP64": "1", "LOCAL": "0", "ORDER": "2", "WEIGHT": "0", "WRAP": "0"}


def tables(record: dict[str, Any]) -> str:
    """The generated part of the page."""
    tools = ", ".join(f"{name} {version}" for name, version in record["tools"].items())
    return "\n".join([BEGIN, f"\nMade by {tools}.\n", *_first(record), *_left_out(), END])


def variants(record: dict[str, Any]) -> str:
    """The file of all kernels and variants."""
    return "\n".join(_files(record))


def written(text: str, record: dict[str, Any]) -> str:
    """The page with new tables."""
    before, rest = text.split(BEGIN)
    return before + tables(record) + rest.split(END)[1]


def _first(record: dict[str, Any]) -> list[str]:
    """Direct backprojection of a plane from a satellite: instructions, wavefronts, and the ceilings that follow."""
    out = [
        "## Direct backprojection of a plane\n",
        "8192 x 8192 pixels of 0.25 m from 770 km, X band, 600 MHz: per pulse and pixel on sm_90. Instructions are "
        "counted, wavefronts replayed; the ceilings in 10^9 pulses times pixels per second on an H200 are inferred "
        "from both: an H100 was measured, see gpu_benchmarks.md.\n",
        "Instructions are those of this program for pairs that lie inside of windows, then with both sides of every "
        "branch, then with the records of tiles and pulses, which other programs make.\n",
        "| tolerance | program | instructions | both sides | with records | loads | wavefronts of 32 pairs, range "
        "along a line of pixels / across | ceiling by instructions with records, inferred | by wavefronts, inferred "
        "| model of cycles (groups) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    rows = [(task.split()[1], name) for task, names in record["first"].items() for name in names]
    for tolerance, (wanted, _) in GATHER.items():
        rows += [
            (tolerance, name) for name in record["figures"]
            if name.startswith("backproject.cl ") and {**PLAIN, **wanted}.items() <= _macros(name).items()
        ]  # fmt: skip
    for tolerance, name in rows:
        macros, file = _macros(name), name.split()[0]
        kernel = next(k for k in record["figures"][name] if k.startswith("backproject"))
        here = record["figures"][name][kernel][COUNTED]
        fronts = _replayed(tolerance, file, {k: int(v) for k, v in macros.items()}, here["loads"])
        chosen = ", ".join(f"{k} {macros[k]}" for k in SHOWN if k in macros)
        ceilings = " / ".join(f"{WAVEFRONTS * 32 / f / 1e9:.0f}" for f in fronts)
        each, words = here["instructions"], " / ".join(f"{f:.0f}" for f in fronts)
        whole = each + _of_records(record, file, macros)
        out.append(
            f"| {tolerance} | {file}, {chosen} | {each:g} | {here.get('both sides', each):g} | {whole:.1f} | "
            f"{here['loads']:g} | {words} | {LANE_INSTRUCTIONS / whole / 1e9:.0f} | {ceilings} | "
            f"{_modelled(record, name)} |"
        )
    return [*out, ""]


def _modelled(record: dict[str, Any], name: str) -> str:
    """The model's 10^9 contributions per second, and groups on a multiprocessor; "" for a program without."""
    groups, rate = record["models"].get(name, (0, 0.0))
    return f"{rate / 1e9:.0f} ({groups:.0f})" if rate else ""


def _of_records(record: dict[str, Any], file: str, macros: dict[str, str]) -> float:
    """Instructions per pair of pulse and pixel that make the records of tiles and pulses which a program reads."""
    total, shared = 0.0, file == "backproject_shared_lines.cl"
    pixels = int(macros["SIDE"]) ** 2 if shared else GATHER_TILE
    for name, kernels in record["figures"].items():
        other = {**{"SHARED": "0"}, **_macros(name)}
        wanted = {"SHARED": "0", "LOCAL": "0", "RANGE": "0", **macros}
        if all(wanted.get(key) == value for key, value in other.items()):
            for kernel in RECORDS[shared] & set(kernels):
                total += kernels[kernel][COUNTED]["instructions"] / pixels
    return total


def _macros(name: str) -> dict[str, str]:
    """Macros of a variant."""
    return dict(macro.split("=") for macro in name.split()[1:])


def _replayed(tolerance: str, file: str, macros: dict[str, int], loads: float) -> list[float]:
    """Wavefronts per 32 contributions, with range along a line of pixels and across. Loads whose addresses are not
    replayed count once: all lanes read one place."""
    if file == "backproject_shared_lines.cl":
        names = "SIDE", "ITEMS", "FINE", "LINE_TAPS", "SLOPE_TAPS"
        return [loads + wavefronts.shared_lines(*(macros[name] for name in names))]
    taps = macros["TAPS"]
    samples = wavefronts.samples_of_pixels(2 / 299792458.0 * 600e6 / 8192 * GATHER[tolerance][1])
    alike = loads - taps  # the others load a complex sample per tap, 8 bytes
    return [alike + wavefronts.gather(s, taps, macros["VECTORS"], 8)[0] for s in (samples, samples.transpose(0, 2, 1))]


def _left_out() -> list[str]:
    """Programs that no GPU runs."""
    found = [f"- `{file}` is not compiled: {reason}." for file, reason in sorted(NOT_ON_GPUS.items())]
    found += [f"- `{file}` spills registers: {reason}." for file, reason in sorted(MAY_SPILL.items())]
    found += [
        f"- One group of `{file}` fits a multiprocessor: {reason}." for file, reason in sorted(MAY_BE_ALONE.items())
    ]
    return ["## Known exceptions\n", "No other kernel spills, and none has a stack.\n", *found, ""]


def _files(record: dict[str, Any]) -> list[str]:
    """A table for each kernel, with a line for each variant."""
    by_kernel: dict[tuple[str, str], list[str]] = defaultdict(list)
    for name, kernels in record["figures"].items():
        for kernel in kernels:
            by_kernel[name.split()[0], kernel].append(name)
    out = [
        "# Every kernel and variant\n",
        "Written by `make gpu-static ARGS=--record`; "
        "[how it is counted](../../docs/developers/gpu_static.md#how-instructions-are-counted).\n",
        "Registers of sm_80 / sm_90, for images also of sm_89 and sm_120 behind them; "
        "vector registers and waves per SIMD of gfx90a / gfx1100. Local memory, B per "
        "group, and occupancy are those of sm_90, the latter for groups as launched, or of 256 where the driver "
        "chooses. "
        "Instructions and loads from global memory are counted in the hot loop on sm_90.\n",
    ]
    for (file, kernel), names in sorted(by_kernel.items()):
        hot = HOT.get((file, kernel))
        macros = {name: _macros(name) for name in names}
        differ = [k for k in macros[names[0]] if len({m.get(k) for m in macros.values()}) > 1]
        same = " ".join(f"{k}={v}" for k, v in macros[names[0]].items() if k not in differ)
        unit = f"per {hot.unit}" if hot else "per trip of the largest innermost loop, or per work-item without loops"
        out += [
            f"## {file}: {kernel}\n",
            f"Instructions {unit}.{f' All with {same}.' if same else ''}\n",
            f"| {', '.join(differ) or 'variant'} | registers | local | occupancy | instructions | loads "
            "| AMD registers | AMD waves |",
            "|---|---|---|---|---|---|---|---|",
        ]
        for name in names:
            n = record["figures"][name][kernel]
            new, red, blue = (n[t] for t in ("sm_90", "gfx90a", "gfx1100"))
            cards = " / ".join(str(n[t].get("registers", 0)) for t in n if t not in ("group", *AMD))
            share = occupancy.nvidia("sm_90", new.get("registers", 0), new.get("local memory", 0), n["group"])
            amd = " / ".join(str(t.get("registers", 0) + t.get("accumulators", 0)) for t in (red, blue))
            out.append(
                f"| {', '.join(str(macros[name].get(k)) for k in differ) or 'one'} | "
                f"{cards} | {new.get('local memory', 0)} | "
                f"{share:.0%} | {new.get('instructions', 0):g} | {new.get('loads', 0):g} | {amd} | "
                f"{red.get('waves', 0)} / {blue.get('waves', 0)} |"
            )
        out.append("")
    return out
