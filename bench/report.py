"""Write docs/results.md, its pictures and the table in README.md from bench/results/*.json: python bench/report.py"""

from pathlib import Path

from sarcl.bench import page

ROOT = Path(__file__).parents[1]

if __name__ == "__main__":
    for path in page.write(ROOT / "bench" / "results", ROOT / "docs", ROOT / "README.md"):
        print(path.relative_to(ROOT))
