"""Write docs/guide/results.md, its pictures and README.md's table from bench/results/*.json: python bench/report.py"""

from pathlib import Path

from sarcl.bench import page

ROOT = Path(__file__).parents[1]

if __name__ == "__main__":
    for path in page.write(ROOT / "bench" / "results", ROOT / "docs" / "guide", ROOT / "README.md"):
        print(path.relative_to(ROOT))
