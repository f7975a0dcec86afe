"""What compilers say of the kernels on GPUs, without a GPU.

    python tests/gpu_static/run.py             compile the programs that plans build for GPUs, those that are recorded
                                               from the same text by the same compilers left out, and compare figures
    python tests/gpu_static/run.py --all       compile every program
    python tests/gpu_static/run.py --record    the same, and write figures.json, variants.md and the tables of the page
    python tests/gpu_static/run.py --count FILE [MACRO=VALUE ...]    count one program: figures of every target, loops
    python tests/gpu_static/run.py --model     the model of cycles beside rates measured on an H100: its errors
    options: --text PATH (source text to compile in place of kernels/FILE), --keep FOLDER (PTX, cubin, listing)

docs/developers/gpu_static.md says what is counted, and how.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "bench")]

from gpu_static import calibration, compilers, figures, hot_loops, page, ratchet, sass  # noqa: E402
from gpu_static.collect import Variant, kernels_in  # noqa: E402

from sarcl.opencl.programs import source  # noqa: E402


def count(file: str, macros: list[str], text: str, folder: Path) -> int:
    """Print the figures of one program. 1 where a target's compiler refuses it."""
    variant = Variant(file, tuple(sorted((k, int(v)) for k, v in (m.split("=") for m in macros))))
    figures = compilers.compiled(variant, folder, text)
    refused = {target: found["error"] for target, found in figures.items() if "error" in found}
    for target, words in refused.items():
        print(f"{target}: {words}")
    listing = "" if "sm_90" in refused else compilers.listing("sm_90", folder)
    (folder / "sm_90.sass").write_text(listing)
    for kernel in kernels_in(text):
        print(kernel)
        for target in compilers.targets_of(file):
            if target not in refused:
                print(f"  {target}: " + ", ".join(f"{name} {value}" for name, value in figures[target][kernel].items()))
        if not listing:
            continue
        code = sass.code_of(listing, kernel)
        try:
            cost = hot_loops.cost(code, hot_loops.HOT.get((file, kernel)), dict(variant.macros))
        except hot_loops.NotCounted as exc:
            print(f"  not counted: {exc}")
        else:
            print(
                f"  sm_90: {cost.each:.1f} instructions per {cost.unit} ({cost.trip:.0f} per trip of the hot loop), "
                f"{cost.each_at_most:.1f} with both sides of every branch"
            )
            print("  per trip: " + ", ".join(f"{name} {n:g}" for name, n in cost.by_kind.items()))
        print(f"  loops: {hot_loops.described(code) or 'none'}")
    return 1 if refused else 0


def compare(record: bool, everything: bool) -> int:
    """Compile what has changed, or everything; compare with recorded figures, or record: 1 where one is not allowed."""
    start = time.monotonic()

    def progress(done: int, total: int) -> None:
        if sys.stderr.isatty():
            print(f"\r{done} of {total} programs", end="" if done < total else "\n", file=sys.stderr)

    before = ratchet.recorded() if ratchet.RECORD.exists() else {"tools": {}, "figures": {}}
    found, digests = figures.figures(progress, {"figures": {}} if record or everything else before)
    wrong = ratchet.limits(found) + ratchet.coverage(found)
    built, words = 0, "ocloc is not installed, nothing was compiled for it"
    if shutil.which(compilers.OCLOC):
        built, refused = figures.intel(digests, {} if record or everything else before)
        wrong, words = wrong + refused, f"{built} programs built for {compilers.INTEL}"
    below: list[str] = []
    if record:
        now = {
            "tools": compilers.versions(),
            "first": figures.first(),
            "intel": built,
            "models": figures.models(),
            "digests": digests,
            "figures": found,
        }
        ratchet.RECORD.write_text(ratchet.text_of(now))
        page.PAGE.write_text(page.written(page.PAGE.read_text(), now))
        page.VARIANTS.write_text(page.variants(now))
        gone = sorted(set(before["figures"]) - set(found))
        print(f"recorded {len(found)} programs, {len(set(found) - set(before['figures']))} new, {len(gone)} gone")
    elif before["tools"] == compilers.versions():
        above, below = ratchet.worse(found, before["figures"])
        wrong += above
    else:
        print(f"figures are of {before['tools']}, and are not compared with those of {compilers.versions()}")
    print("\n".join(wrong))
    if below and not wrong:
        print(f"{len(below)} figures are below the recorded ones, such as\n{below[0]}\nKeep what is won: "
              "make gpu-static ARGS=--record")  # fmt: skip
    kernels = sum(map(len, found.values()))
    print(
        f"{len(found)} programs, {kernels} kernels for {', '.join(compilers.TARGETS)}, for images also "
        f"{', '.join(compilers.MORE)}: {len(wrong)} findings, {time.monotonic() - start:.0f} s. Intel: {words}"
    )
    return 1 if wrong else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", action="store_true", help="write figures.json, variants.md and the page's tables")
    parser.add_argument("--all", action="store_true", help="compile also what has not changed since it was recorded")
    parser.add_argument("--model", action="store_true", help="the model of cycles beside rates measured on an H100")
    parser.add_argument("--count", nargs="+", metavar=("FILE", "MACRO=VALUE"), help="count one program")
    parser.add_argument("--text", type=Path, help="source text to compile in place of kernels/FILE, #include expanded")
    parser.add_argument("--keep", type=Path, help="folder for PTX, machine code and nvdisasm's listing")
    args = parser.parse_args()
    try:
        print(", ".join(f"{name} {version}" for name, version in compilers.versions().items()))
    except FileNotFoundError as exc:
        print(exc, file=sys.stderr)
        return 2
    if args.model:
        calibration.shown()
        return 0
    if not args.count:
        return compare(args.record, args.all)
    file, *macros = args.count
    text = args.text.read_text() if args.text else source(file)
    with tempfile.TemporaryDirectory() as scratch:
        folder = args.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        return count(file, macros, text, folder)


if __name__ == "__main__":
    sys.exit(main())
