"""Cost of every verb against the size of its task, one run, a factor of four or more in size at one tolerance.

    python bench/scaling.py [--tolerance 1e-2] [--repeats 2] [--json FILE]

The tasks are those of `sarcl bench`, at the sizes below. Exponents of CPU seconds are slopes of least-squares lines
through logarithms, for the larger three sizes: at the smallest, fixed costs of a call count.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from sarcl.bench import documents, tables, verbs

RESULT = Path(__file__).parents[1] / "bench" / "results" / "trials" / "scaling.json"
SIZES = {
    "echo of points": (64, 128, 256, 512),
    "echo of facets": (16, 32, 64, 128),
    "spectral echo": (256, 512, 1024, 2048),
    "channels of an array": (9, 45, 135, 450),
    "beam of an array": (32, 64, 128, 256),
    "backproject": (128, 256, 512, 1024),
    "polar format": (128, 256, 512, 1024),
    "range-Doppler": (128, 256, 512, 1024),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tolerance", type=float, default=1e-2)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--json", type=Path, default=RESULT)
    asked = parser.parse_args()
    document: documents.Document = {}
    for verb, sizes in SIZES.items():
        part = verbs.run(
            verbs=[verb], sizes=sizes, tolerances=[asked.tolerance], repeats=asked.repeats, devices=["cpu"], say=print
        )
        document = document or {**part, "cases": []}
        document["cases"] += part["cases"]
        documents.write(document, asked.json)
    print(tables.growth_text(document["cases"]))


if __name__ == "__main__":
    main()
