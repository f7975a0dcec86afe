"""docs/guide/proof.md: what is claimed, what was measured, and the command of each figure, from bench/results."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import proof_pictures
import roofline_page

from sarcl.bench import ratios, tables

Row = dict[str, Any]
QUANTILES = (0.5, 0.9, 0.99)
PAGE = "proof.md"
WRITTEN_BY = """`make results` writes this page from the files of bench/results; no figure on it is typed. Each
section names the command that measures it again. Seconds are CPU seconds unless they say otherwise:
other work on the machine hardly affects these.
"""
CONTRACT = """Random legal tasks of tests/helpers: distances from 1 m to 36 000 km, carriers from 1 MHz to 10 THz,
odd tracks and grids, bistatic geometry, tolerances down to 1e-9, devices without float64. Echoes of
points, channels and images are compared with sums in float64 or extended precision
(sarcl/reference); echoes of facets and of antennas, and range-Doppler, at random samples by
`check=True`, which computes them again in float64. A ratio of 1 is the tolerance. "Refused": sarcl
says before the computation what cannot be met. Tasks without an exact result, such as an image of
nothing, do not count. `fullwave_echo` is compared with a run of the same grid at every pulse, which
is what its tolerance bounds: bodies of 0.15 to 0.7 wavelengths, metal and dielectric, 4 to 9 pulses.
Its [errors against Mie's series](../theory/full_wave.md) are those of the grid.
"""
PEERS = """Ratios are the peer's seconds over those of the fastest row of sarcl whose error is no larger:
smallest and largest over all rows of the peer. [Images](results_images.md) and
[echoes](results_echoes.md) have every row, [benchmarks](../developers/benchmarks.md) how it is
measured.
"""
FAULTS = """Tests that make the fault happen, and then want the result of an undisturbed run bit by bit, or an
error that names the fault and loses nothing that was finished.
"""
FUZZ = """Mutated files of every format that is read: the right outcome is the same data or an error that
names the file. "Other data" is right where a format has no checksum. Wrong data, a crash, a hang or
another library's error would fail.
"""
MUTANTS = """Wrong signs, factors, units and error terms are put into the code, one at a time; a test must fail
for each.
"""
SCALING = """One run at a tolerance of 1e-2; slopes through the logarithms of the larger three sizes.
"""
MEMORY = """Backprojection from and to files within `max_bytes`. "Peak" is the largest resident memory above
that of the same process after a first small image, which loads code, driver and kernels.
"""
SKIPPING = """Share of all pairs of facet and pulse (or of pixel and pulse) that is not computed, by reason.
"Without" computes the pairs of a reason after all, through `skip=` or `shadows=False`; the change
is relative to the norm of the result, at a tolerance of 1e-2. Shadows are part of the model:
leaving them out changes the result, and is no error.
"""


def write(results: Path, docs: Path) -> list[Path]:
    """Write the page and its pictures into `docs`; the paths written. results  the folder bench/results."""
    measured = read(results)
    written = [docs / PAGE]
    written[0].write_text(page(measured))
    for name, draw in pictures(measured):
        (docs / name).write_bytes(draw())
        written.append(docs / name)
    return written


def read(results: Path) -> dict[str, Row]:
    """Documents by name: those of the trials, and those of the benchmarks beside other programs."""
    files = [*sorted((results / "trials").glob("*.json")), *sorted(results.glob("*.json"))]
    return {path.stem: json.loads(path.read_text()) for path in files}


def pictures(measured: dict[str, Row]) -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Names of the page's own pictures, and the functions that draw them."""
    yield "proof-contract.png", lambda: proof_pictures.contract(measured["contract"])
    yield "proof-echo-peers.png", lambda: proof_pictures.echo_peers(measured["3-echo-pocl"])
    yield "proof-roofline.png", lambda: roofline_page.picture(measured["roofline"])
    yield "proof-skipping.png", lambda: proof_pictures.skipping(measured["skipping"])


def page(measured: dict[str, Row]) -> str:
    """The text of the page."""
    head = "# Proof", "What sarcl claims, what was measured, and how to measure it again.", WRITTEN_BY
    machine = "".join(f"- {line}\n" for line in tables.machine_text(measured["contract"]))
    table = tables.markdown(["claim", "measured", "section"], claims(measured))
    return joined(*head, machine, "## Claims", table, *(section(measured) for section in SECTIONS))


def joined(*parts: str) -> str:
    """Paragraphs, tables and pictures, with an empty line between them."""
    return "\n\n".join(part.rstrip("\n") for part in parts if part) + "\n"


def command(*lines: str) -> str:
    """Commands in a sentence: the tests run the shell blocks of pages."""
    return f"Measured by {' and '.join(f'`{line}`' for line in lines)}.\n"


# Figures of single documents


def held(entry: Row) -> int:
    """Compared tasks whose errors are within the tolerance."""
    return len(entry["ratios"]) - sum(failure["ratio"] is not None for failure in entry["failures"])


def refusals(entry: Row) -> str:
    return f"{entry['refused']} of {entry['tried']}"


def exponents(document: Row) -> list[Row]:
    """Exponents over the larger three sizes of every task, of CPU seconds."""
    largest: dict[str, list[Row]] = {}
    for case in sorted(document["cases"], key=lambda case: case["n"]):
        largest.setdefault(case["scene"], []).append(case)
    return [entry for cases in largest.values() for entry in ratios.growth(cases[-3:])]


def peer_ratios(measured: dict[str, Row]) -> list[list[str]]:
    """Peer, what it computes, its errors, smallest and largest ratio."""
    lines = []
    for name, what in (("1-spotlight-pocl", "images, pulse by pulse"), ("2-straight-pocl", "images, sub-apertures")):
        found: dict[str, list[Row]] = {}
        for case in measured[name]["cases"]:
            for entry in ratios.matches(case):
                if entry["sarcl"] is not None and entry["method"] == entry["peer"]["method"]:
                    found.setdefault(entry["peer"]["who"], []).append(entry)
        for who, entries in found.items():
            errors, faster = [e["peer"]["error"] for e in entries], [e["form"] for e in entries]
            lines.append([who, what, span(errors, "1e"), f"{span(faster, '.3g')} x"])
    spread = measured["3-echo-pocl"]["spread"]
    ours = [row for row in spread if row["name"].startswith("sarcl")]
    theirs = [row for row in spread if not row["name"].startswith("sarcl")]
    faster = [
        min(row["seconds"]) / min(min(own["seconds"]) for own in ours if own["error"] <= row["error"]) for row in theirs
    ]
    lines.append(
        [
            "finufft",
            "spreading of points into profiles",
            span([r["error"] for r in theirs], "1e"),
            f"{span(faster, '.3g')} x",
        ]
    )
    rates = measured["6-full-wave-pocl"]["rates"]
    steps = [rates["sarcl"]["Mcells/s"] / rate["Mcells/s"] for name, rate in rates.items() if name.startswith("gprMax")]
    lines.append(["gprMax", "time steps of full-wave grids", "not measured", f"{span(steps, '.3g')} x"])
    return lines


def span(values: list[float], form: str) -> str:
    """Smallest to largest; the form "1e" is two digits and an exponent."""
    text = [f"{v:.1e}" if form == "1e" else f"{v:{form}}" for v in (min(values), max(values))]
    return text[0] if text[0] == text[1] else f"{text[0]} to {text[1]}"


def claims(measured: dict[str, Row]) -> list[list[str]]:
    """The first table: claim, measured value, section."""
    verbs = measured["contract"]["verbs"].values()
    tasks, good = sum(len(v["ratios"]) for v in verbs), sum(held(v) for v in verbs)
    worst = max(max(v["ratios"]) for v in verbs)
    found = f"{good} of {tasks} random tasks of {len(verbs)} verbs; largest error {worst:.2f} of the tolerance"
    lines = [["Errors are within the tolerance asked for", found, "[contract](#the-accuracy-contract)"]]
    for who, what, errors, faster in peer_ratios(measured):
        claim = f"Faster than {who}" + ("" if errors == "not measured" else " at no larger error")
        lines.append([claim, f"{what}: {faster}", "[peers](#beside-other-programs)"])
    slopes = [entry["cpu_exponent"] for entry in exponents(measured["scaling"])]
    lines.append(
        [
            "Cost against size",
            f"CPU seconds as n^{min(slopes):.2f} to n^{max(slopes):.2f}",
            "[size](#cost-against-size)",
        ]
    )
    return lines + claims_of_faults(measured["faults"]) + claims_of_work(measured)


def claims_of_faults(document: Row) -> list[list[str]]:
    """Claims of three searches for faults."""
    faults, fuzz, mutants = (document[part]["rows"] for part in ("faults", "fuzz", "mutants"))
    passed, failed = sum(row["passed"] for row in faults), sum(row["failed"] + row["error"] for row in faults)
    files, killed = sum(row["files"] for row in fuzz), sum(row["verdict"] == "killed" for row in mutants)
    survived = f"{passed} tests of {len(faults)} kinds of faults passed, {failed} failed"
    read = f"{files} mutated files of {len(fuzz)} formats: {document['fuzz']['failed']} formats with a fault"
    noticed = f"{killed} of {len(mutants)}, drawn at random from {document['mutants']['listed']}"
    return [
        ["Faults lose nothing that was finished", survived, "[faults](#faults)"],
        ["Damaged files are read right or refused", read, "[files](#mutated-files)"],
        ["Tests notice wrong formulas", noticed, "[formulas](#wrong-formulas)"],
    ]


def claims_of_work(measured: dict[str, Row]) -> list[list[str]]:
    """Claims of memory, kernels, and what is skipped."""
    rows = measured["memory"]["rows"]
    growth, limit = rows[-1]["image_bytes"] / rows[0]["image_bytes"], measured["memory"]["max_bytes"] / 1e6
    peaks = f"images {growth:.0f} times as large: peaks of {span([peak(row) for row in rows], '.0f')} MB"
    entries = [entry for _, _, entry in skipped(measured["skipping"])]
    left_out = span([100 * (1 - entry["shares"]["computed"]) for entry in entries], ".0f")
    changes = [s["change"] for e in entries for s in e["switches"] if s["computed after all"] != "shadows"]
    skipped_pairs = (
        f"{left_out} % of the pairs; results change by {max(changes, default=0):.0e} at most, tolerance 1e-2"
    )
    return [
        [f"Memory of images in files, `max_bytes` {limit:.0f} MB", peaks, "[memory](#memory)"],
        [
            "Kernels use the machine",
            roofline_page.claim(measured["roofline"]),
            "[kernels](#kernels-beside-the-ceilings-of-the-machine)",
        ],
        ["What adds nothing is not computed", skipped_pairs, "[skipping](#what-is-skipped)"],
    ]


# Sections


def contract(measured: dict[str, Row]) -> str:
    verbs, body = measured["contract"]["verbs"], []
    for verb, entry in verbs.items():
        values = entry["ratios"]
        quantiles = [f"{v:.2g}" for v in np.quantile(values, QUANTILES)]
        body.append([verb, f"{held(entry)} of {len(values)}", f"{max(values):.2g}", *quantiles, refusals(entry)])
    head = ["verb", "held", "largest error / tolerance", "median", "9 of 10 below", "99 of 100 below", "refused"]
    failed, mended = (
        "".join(
            f"- {verb}, number {task['seed']}: {task['outcome']}: {task['text'].splitlines()[0]}\n"
            for verb, entry in verbs.items()
            for task in entry[kind]
        )
        for kind in ("failures", "mended")
    )
    return joined(
        "## The accuracy contract",
        "![distribution of errors over tolerances](proof-contract.png)",
        CONTRACT,
        tables.markdown(head, body),
        "Tasks that failed:" if failed else "",
        failed,
        "Tasks that failed in this trial, and are right since the code was mended:" if mended else "",
        mended,
        command("python bench/contract_trial.py -n 300"),
    )


def peers(measured: dict[str, Row]) -> str:
    return joined(
        "## Beside other programs",
        "![rate against achieved error, images](results-1-spotlight-pocl.png)",
        "![rate against achieved error, images by sub-apertures](results-2-straight-pocl.png)",
        "![rate against achieved error, spreading of points](proof-echo-peers.png)",
        "[Results](results.md) has a picture of every verb: seconds against achieved error, and against size.",
        PEERS,
        tables.markdown(["program", "what", "its errors", "its seconds over sarcl's"], peer_ratios(measured)),
        command(
            "make bench ARGS='backproject --peer-python PATH'",
            "python bench/echo.py --peer-python PATH",
            "python bench/full_wave_peers.py --peer PATH",
        ),
    )


def scaling(measured: dict[str, Row]) -> str:
    document = measured["scaling"]
    words = {case["scene"]: case["words"] for case in document["cases"]}
    body = []
    for entry in exponents(document):
        task, sizes = ", ".join(filter(None, (entry["scene"], entry["method"]))), ", ".join(map(str, entry["sizes"]))
        growth = f"n^{entry['cpu_exponent']:.2f}"
        body.append([task, sizes, growth, f"{entry['error']:.1e}", words[entry["scene"]]])
    head = ["task", "n", "CPU seconds", "error at most", "size"]
    return joined("## Cost against size", SCALING, tables.markdown(head, body), command("python bench/scaling.py"))


def faults(measured: dict[str, Row]) -> str:
    document = measured["faults"]["faults"]
    body = [
        [row["fault"], str(row["passed"]), str(row["failed"] + row["error"]), str(row["skipped"])]
        for row in document["rows"]
    ]
    table = tables.markdown(["fault", "tests passed", "failed", "skipped"], body)
    return joined("## Faults", FAULTS, table, command(document["command"]))


def fuzz(measured: dict[str, Row]) -> str:
    document, kinds = measured["faults"]["fuzz"], ("right", "refused", "other data")
    body = [
        [f"`{row['format']}`", str(row["files"]), *(str(row.get(kind, 0)) for kind in kinds)]
        for row in document["rows"]
    ]
    table = tables.markdown(["format", "files", *kinds], body)
    return joined("## Mutated files", FUZZ, table, command(document["command"]))


def mutants(measured: dict[str, Row]) -> str:
    document = measured["faults"]["mutants"]
    rows = document["rows"]
    counts = {word: sum(row["verdict"] == word for row in rows) for word in ("killed", "survived", "not run")}
    text = f"{len(rows)} entries, drawn at random from the {document['listed']} of tests/mutants/mutations.toml: "
    text += ", ".join(f"{n} {word}" for word, n in counts.items()) + "."
    others = [f"- {r['verdict']}: {r['file']}: `{r['change']}`\n" for r in rows if r["verdict"] != "killed"]
    return joined("## Wrong formulas", MUTANTS, text, "".join(others), command(document["command"]))


def memory(measured: dict[str, Row]) -> str:
    document = measured["memory"]
    body = [
        [f"{row['size']} x {row['size']}", f"{row['image_bytes'] / 1e6:.0f}", f"{peak(row):.0f}"]
        for row in document["rows"]
    ]
    table = tables.markdown(["pixels", "image, MB", "peak, MB"], body)
    limit = f"`max_bytes` = {document['max_bytes'] / 1e6:.0f} MB:"
    return joined("## Memory", MEMORY, limit, table, command(document["command"]))


def peak(row: Row) -> float:
    """MB above the process after a small image."""
    return float(row["peak_gib"]) * 2**30 / 1e6


def roofline(measured: dict[str, Row]) -> str:
    document = measured["roofline"]
    return joined(*roofline_page.section(document, command(document["command"])))


def skipped(document: Row) -> list[tuple[str, str, Row]]:
    """Scene, verb, and what was measured."""
    return [
        (scene, verb, found[verb]) for scene, found in document["scenes"].items() for verb in ("echo", "backproject")
    ]


def skipping(measured: dict[str, Row]) -> str:
    document, body, costs = measured["skipping"], [], []
    for scene, verb, entry in skipped(document):
        name, seconds = f"{scene}, {verb}", f"{entry['seconds']:.3g}"
        reasons = [f"{why} {100 * share:.2g} %" for why, share in entry["shares"].items() if why != "computed"]
        body.append([name, f"{entry['pairs']:.2g}", ", ".join(reasons), f"{entry['shares']['computed']:.1%}", seconds])
        costs += [
            [name, s["computed after all"], f"{s['seconds']:.3g}", seconds, f"{s['change']:.0e}"]
            for s in entry["switches"]
        ]
    return joined(
        "## What is skipped",
        "![shares of pairs, by reason](proof-skipping.png)",
        SKIPPING,
        tables.markdown(["scene", "pairs", "not computed", "computed", "CPU s"], body),
        tables.markdown(["scene", "without", "CPU s without", "CPU s with", "change"], costs),
        command(document["command"]),
    )


SECTIONS = (contract, peers, scaling, faults, fuzz, mutants, memory, roofline, skipping)
