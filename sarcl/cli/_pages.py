"""Commands that write pages and tables of results: sarcl fda, papers and bench."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..io import formats
from ._job import Job

# Names of arguments of the command line that each kind of benchmark takes
BENCH = {
    "verbs": ("verbs", "quick", "sizes", "tolerances", "devices", "repeats", "limit", "patience"),
    "backproject": (
        "scenes", "data", "sizes", "tolerances", "methods", "devices", "peer_python", "peer_backend", "repeats",
        "pixels", "limit", "patience",
    ),
}  # fmt: skip
SECTION_BYTES = 40_000  # of a section of a page with one figure: the least room that a page needs for each


def fda(args: argparse.Namespace, job: Job) -> int:
    """Run an experiment on frequency-diverse apertures: a page and its numbers."""
    import json

    from ..experiments.fda import experiment
    from ..experiments.fda import page as fda_page
    from ..experiments.fda.file import load
    from ..experiments.fda.text import conclusion, rule, setting, verdicts
    from ..figures import plots
    from ..opencl.choose_device import open_device

    title, cases = load(args.experiment)
    output = args.output or f"{Path(args.experiment).stem}.html"
    numbers = str(Path(output).with_suffix(".json"))
    job.expect_named([output], [formats.Format((".html", ".htm"))], [args.experiment], SECTION_BYTES * len(cases))
    job.expect(numbers)
    plots.require("the page of sarcl fda")
    results, sections = [], []
    for i, case in enumerate(cases):
        results.append(experiment.measure(case, open_device(args.device)))
        sections.append(fda_page.section(results[-1]))
        job.progress("fda", i + 1, len(cases))
        # Both files are written after every case, so that a later failure does not lose them.
        page = fda_page.html(results, title, args.command_line, sections, finished=len(results) == len(cases))
        _write(numbers, json.dumps(results))
        _write(output, page)
    for result in results:
        job.say(f"{result['name']}: {setting(result)}")
        for verdict in verdicts(result):
            job.say(f"  {verdict}")
    for line in conclusion(results):
        job.say(line)
    job.say(f"Two points are resolved where the image has {rule()}.")
    job.say(f"wrote {output} and {numbers}")
    return 0


def papers(args: argparse.Namespace, job: Job) -> int:
    """List the papers, or reproduce one: a page and its numbers."""
    import json

    from .. import papers as shelf
    from ..figures import plots

    if args.paper is None:
        job.say(shelf.listing())
        return 0
    paper = shelf.find(args.paper)
    output = Path(f"{paper.name}.html" if args.output is None else args.output)
    if output.suffix.lower() not in (".html", ".htm"):  # a folder
        output = output / f"{paper.name}.html"
    numbers = output.with_suffix(".json")
    job.expect(output, SECTION_BYTES * len(paper.sections))
    job.expect(numbers)
    plots.require("the page of sarcl papers")
    lab, sections = shelf.open_lab(paper, args.device, args.quick, output.with_suffix(".runs"), job.progress), []
    for section in paper.run(lab):
        sections.append(section)
        job.progress("papers", len(sections), len(paper.sections))
        # Both files are written after every section, so that a later failure does not lose them.
        _write(numbers, json.dumps(paper.document(sections, args.quick), allow_nan=False))
        _write(output, paper.html(sections, args.quick, args.command_line))
        fine = sum(row.holds for row in section.rows)
        tally = f": {fine} of {len(section.rows)} as expected" if section.rows else ""
        job.say(f"{section.title}{tally} ({section.seconds:.1f} s)")
        for row in section.rows:
            if not row.holds:
                origin = "printed" if row.basis == "paper" else "expected"
                job.say(f"  differs: {row.item}: {origin} {row.expected}, measured {row.measured}")
    job.say(f"wrote {output} and {numbers}")
    return 0


def bench(args: argparse.Namespace, job: Job) -> int:
    """Measure run time against achieved error: tables and, if asked for, JSON and plots."""
    from ..bench import backproject, documents, verbs
    from ..figures import plots

    if args.json is not None:
        job.expect_named([args.json], [formats.Format((".json",))], [])
    options = {name: value for name in BENCH[args.what] if (value := getattr(args, name)) is not None}
    for name in sorted({*BENCH["verbs"], *BENCH["backproject"]} - set(BENCH[args.what])):
        if getattr(args, name) not in (None, False):
            raise ValueError(f"--{name.replace('_', '-')} is not for sarcl bench {args.what}")
    pictures = {} if args.picture is None else _bench_pictures(args.what, args.picture, options)
    if pictures:
        job.expect_named([str(path) for path in pictures], formats.writing("picture"), [])
        plots.require("--picture")
    if args.what == "backproject":
        options["with_peers"] = not args.no_peers

    def keep(document: documents.Document) -> None:
        if args.json is not None:
            documents.write(document, Path(args.json))

    room = {"verbs": verbs, "backproject": backproject}[args.what]
    document = room.run(**options, no_fp64=args.no_fp64, say=job.say, progress=job.progress, keep=keep)
    for path, scenes in pictures.items():
        _draw(path, [case for case in document["cases"] if not scenes or case["scene"] == scenes])
    return 0


def _bench_pictures(what: str, picture: str, options: dict[str, Any]) -> dict[Path, str]:
    """Paths of the pictures, and the task that each is of; "" for the one of all images."""
    from ..bench.documents import slug
    from ..bench.verbs import TASKS

    path = Path(picture)
    if what == "backproject":
        return {path: ""}
    return {path.with_stem(f"{path.stem}-{slug(name)}"): name for name in options.get("verbs", TASKS)}


def _draw(path: Path, cases: list[dict[str, Any]]) -> None:
    from ..bench import pareto, verb_pictures
    from ..io import output_paths

    picture = verb_pictures.picture if "words" in cases[0] else pareto.picture
    with output_paths.atomic(path) as part:
        part.write_bytes(picture(cases))


def _write(path: str | Path, text: str) -> None:
    """A text file that appears whole."""
    from ..io import output_paths

    with output_paths.atomic(path) as part:
        part.write_text(text, encoding="utf-8")
