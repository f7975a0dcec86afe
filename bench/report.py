"""Write docs/results.md, and the table in README.md, from bench/results/*.json.

python bench/report.py
"""

from __future__ import annotations

import json
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
HEAD = "| tolerance | error achieved | predicted | seconds | Gbp/s | of that in kernels |\n|---|---|---|---|---|---|\n"


def table(result: dict) -> str:
    """Rows of one run."""
    return HEAD + "".join(
        f"| {r['tolerance']:.0e} | {r['error']:.1e} | {r['predicted']:.1e} | {r['seconds']:.2f} | {r['gbps']:.2f} |"
        f" {r['gbps'] / r['kernel_gbps']:.0%} |\n"
        for r in result["rows"]
    )


def plans(result: dict) -> str:
    """How each tolerance was met."""
    lines = "| tolerance | taps | profile samples | points a tile | ranges | series |\n|---|---|---|---|---|---|\n"
    for r in result["rows"]:
        p = r["plan"]
        lines += (
            f"| {r['tolerance']:.0e} | {p['taps']} | {p['profile samples']} | {p['points a tile']} |"
            f" {p['ranges']} | {p['series']} |\n"
        )
    return lines


def main() -> None:
    results = [json.loads(p.read_text()) for p in sorted((ROOT / "bench" / "results").glob("*.json"))]
    page = (
        "# Results\n\nMade by `python bench/report.py` from the JSON files under bench/results; `make bench` "
        "measures.\n\nDirect backprojection of white noise, X band, 600 MHz, 4 deg at 10 km, n pulses of n samples on "
        "n x n pixels of 0.1 m.\nTimed is `sarcl.backproject`, plan to finished image, kernels built before; median. "
        "A Gbp is 1e9 pulses x pixels.\nThe error is relative L2 against the exact float64 sum at 256 random pixels. "
        "The machines are shared and noisy: read\nratios within a table.\n"
    )
    for result in results:
        m = result["machine"]
        fp64 = "float64" if m["fp64"] else "no float64"
        page += f"\n## {m['device']} ({m['platform']}, {m['threads']} threads, {fp64}), n = {result['size']}\n\n"
        page += table(result) + "\nHow each was met:\n\n" + plans(result)
    notes = ROOT / "docs" / "results-notes.md"
    page += "\n" + notes.read_text()
    (ROOT / "docs" / "results.md").write_text(page)

    readme = ROOT / "README.md"
    text = readme.read_text()
    block = f"<!-- results -->\n{table(results[0])}<!-- end of results -->"
    if "<!-- end of results -->" in text:
        text = re.sub(r"<!-- results -->.*?<!-- end of results -->", lambda _: block, text, flags=re.S)
    else:
        text = text.replace("<!-- results -->", block)
    readme.write_text(text)


if __name__ == "__main__":
    main()
