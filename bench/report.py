"""Write the pages of results in docs/guide, their plots and README.md's table from bench/results/*.json.

python bench/report.py
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import channels_page
import echo_page
import full_wave_page
import proof_page
import spaceborne_page

from sarcl.bench import pareto, ratios, tables, verb_pictures
from sarcl.bench.documents import FORMAT, slug

ROOT = Path(__file__).parents[1]
WRITTEN_BY = """`make results` writes this page from the JSON files under bench/results; `make bench` measures your
machine. How the figures are measured: [benchmarks](../developers/benchmarks.md).
"""
VERBS = f"""# Results

Every verb: run time against achieved error, and against the size of its task. Pages of their own show
[images beside other programs](results_images.md) and [echoes and full-wave fields](results_echoes.md).

{WRITTEN_BY}
{tables.VERBS_EXPLAINED}

"""
IMAGES = f"""# Results: images

Run time of images against achieved error, beside other programs; [every verb](results.md) by itself.

{WRITTEN_BY}
## How to read this

{tables.EXPLAINED}

"""
ECHOES = f"""# Results: echoes

Run time of echoes, channels of arrays, a pass from orbit and full-wave fields; [every verb](results.md) by itself, and
[images](results_images.md) beside other programs.

{WRITTEN_BY}
"""
# Kinds of documents that are not about run times of images
OTHER = {
    "echo": echo_page.section, "channels": channels_page.section, "spaceborne": spaceborne_page.section,
    "full wave": full_wave_page.section,
}  # fmt: skip
README_HEAD = ["tolerance", "error achieved", "predicted", "seconds", "Gbp/s", "share in kernels"]


def write(folder: Path, docs: Path, readme: Path | None = None) -> list[Path]:
    """Write results.md (verbs), results_images.md and results_echoes.md into the folder `docs`, a picture
    results-NAME.png beside them for each results/NAME.json of images and each verb, and the README's table; and
    proof.md with its pictures, where there is a folder of trials.

    Returns the files written. ValueError where there is no JSON file, or one of another format.
    """
    documents = {path.stem: read(path) for path in sorted(folder.glob("*.json"))}
    if not documents:
        raise ValueError(f"{folder} holds no .json; make one: sarcl bench backproject --json {folder}/1.json")
    written = []
    pages = {"results.md": VERBS, "results_images.md": IMAGES, "results_echoes.md": ECHOES}
    for name, document in documents.items():
        if document.get("kind") == "verbs":
            pages["results.md"] += verbs_section(document, docs, written)
            continue
        if document.get("kind") in OTHER:
            pages["results_echoes.md"] += OTHER[document["kind"]](name, document)
            continue
        drawn = any(ratios.ran(case) for case in document["cases"])
        if drawn:
            picture = docs / f"results-{name}.png"
            picture.write_bytes(pareto.picture(document["cases"]))
            written.append(picture)
        pages["results_images.md"] += section(name, document, drawn)
    for page, text in pages.items():
        (docs / page).write_text(text.rstrip("\n") + "\n")
        written.append(docs / page)
    if (folder / "trials").is_dir():
        written += proof_page.write(folder, docs)
    if readme is not None:
        block = next((readme_table(d) for d in documents.values() if "cases" in d and "kind" not in d), "")
        text = readme.read_text()
        new = re.sub(
            r"<!-- results -->.*?<!-- end of results -->",
            lambda _: f"<!-- results -->\n{block}<!-- end of results -->",
            text,
            flags=re.S,
        )
        if block and new != text:
            readme.write_text(new)
            written.append(readme)
    return written


def read(path: Path) -> dict[str, Any]:
    """A document of `sarcl bench`; ValueError where the file is not JSON, or not of this format."""
    try:
        document = json.loads(path.read_text())
        found = document.get("format") if isinstance(document, dict) else None
    except ValueError as exc:
        raise ValueError(f"{path} is no JSON ({exc}); measure again: sarcl bench backproject --json {path}") from None
    if found != FORMAT:
        raise ValueError(
            f"{path} has format {found}, wanted {FORMAT}; measure again: sarcl bench backproject --json {path}"
        )
    return dict(document)


def section(name: str, document: dict[str, Any], drawn: bool) -> str:
    """One document: machine, picture, tables."""
    text = f"## {name}\n\n" + "".join(f"- {line}\n" for line in tables.machine_text(document)) + "\n"
    if drawn:
        text += f"![rate against achieved error, sarcl and its peers](results-{name}.png)\n\n"
    for case in document["cases"]:
        text += f"### {tables.title(case)}\n\n{tables.markdown(tables.HEAD, tables.body(case))}\n"
        text += "".join(f"- {line}\n" for line in tables.missing(case))
        matches = tables.match_body(case)
        if matches:
            text += "\nPeer's seconds over sarcl's, at equal or smaller error:\n\n"
            text += tables.markdown(tables.MATCH_HEAD, matches) + "\n"
        plans = _plans(case)
        if plans:
            text += f"How sarcl met each tolerance:\n\n{plans}\n"
    growth = tables.growth_body(document["cases"])
    if growth:
        text += f"### {name}: cost against size\n\n{tables.markdown(tables.GROWTH_HEAD, growth)}\n"
    return text


def verbs_section(document: dict[str, Any], docs: Path, written: list[Path]) -> str:
    """The pictures of all verbs, the machine, and a table for each verb; `written` gets the pictures' paths."""
    tasks: dict[str, list[ratios.Result]] = {}
    for case in document["cases"]:
        tasks.setdefault(case["scene"], []).append(case)
    pictures, text = "", "".join(f"- {line}\n" for line in tables.machine_text(document)) + "\n"
    for scene, cases in tasks.items():
        picture = docs / f"results-{slug(scene)}.png"
        picture.write_bytes(verb_pictures.picture(cases))
        written.append(picture)
        pictures += f"![{scene}: CPU seconds against achieved error and size]({picture.name})\n\n"
        lines = [line for case in cases for line in tables.verb_body(case)]
        text += f"## {scene}\n\n{cases[0]['words']}. Contributions: {cases[0]['unit']}.\n\n"
        text += tables.markdown(tables.VERB_HEAD, lines)
        text += "".join(f"- {line}\n" for case in cases for line in tables.missing(case)) + "\n"
    return pictures + text


def _plans(case: ratios.Result) -> str:
    lines = [
        [tables.name(row), row["setting"], f"{row['predicted']:.1e}", ", ".join(f"{k} {v}" for k, v in plan.items())]
        for row in ratios.ran(case)
        if (plan := row.get("plan"))
    ]
    return tables.markdown(["", "tolerance", "predicted", "plan"], lines) if lines else ""


def readme_table(document: dict[str, Any]) -> str:
    """sarcl's direct rows of the first case on the first device: whole calls."""
    case = document["cases"][0]
    ours = [row for row in ratios.ran(case) if ratios.is_sarcl(row) and row["method"] == "direct"]
    lines = []
    for row in ours:
        call, kernel = ratios.best(row, "call"), ratios.best(row, "kernel")
        if row["device"] == ours[0]["device"] and call and kernel:
            rate = ratios.rate(case, row, "call")
            cells = [row["setting"], f"{row['error']:.1e}", f"{row['predicted']:.1e}", f"{call:.2f}", f"{rate:.2f}"]
            lines.append([*cells, f"{kernel / call:.0%}"])
    return tables.markdown(README_HEAD, lines) if lines else ""


if __name__ == "__main__":
    for path in write(ROOT / "bench" / "results", ROOT / "docs" / "guide", ROOT / "README.md"):
        print(path.relative_to(ROOT))
