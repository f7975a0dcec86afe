"""The notebooks of docs/notebooks: code that runs as it stands, printed numbers that are true, one small picture each.

The code cells are executed one after the other in one namespace, as Jupyter does, but without Jupyter.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from doctest import NORMALIZE_WHITESPACE
from pathlib import Path

import pytest
from sybil.evaluators.doctest import NUMBER, OutputChecker

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
LARGEST = 100_000  # bytes of a file: a forge shows it at once, and the history stays small
NEEDS = {"own_data_to_map": ("rasterio", "pyproj")}  # packages of extras, beside those of tests


def cells(path: Path, kind: str) -> list[dict]:
    return [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == kind]


def outputs(path: Path) -> list[dict]:
    return [output for cell in cells(path, "code") for output in cell["outputs"]]


def test_there_are_five():
    assert len(NOTEBOOKS) == 5


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_is_small_and_shows_its_picture(path):
    text = path.read_text()
    assert len(text) < LARGEST and not re.search(r"[\s\"'(]/(?!/)\w+/\w", text)
    assert sum("image/png" in output.get("data", {}) for output in outputs(path)) == 1
    assert all(output["output_type"] in ("stream", "display_data", "execute_result") for output in outputs(path))
    assert f"](notebooks/{path.name})" in (ROOT / "docs" / "README.md").read_text()
    links = [link for cell in cells(path, "markdown") for link in re.findall(r"\]\(([^)]+)\)", "".join(cell["source"]))]
    assert links and all((path.parent / link.partition("#")[0]).is_file() for link in links)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_runs_and_prints_what_it_shows(path, tmp_path, monkeypatch):
    for package in NEEDS.get(path.stem, ()):
        pytest.importorskip(package)
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {"__name__": "__main__"}
    for number, cell in enumerate(cells(path, "code")):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile("".join(cell["source"]), f"{path.name}, code cell {number}", "exec"), namespace)
        shown = "".join("".join(o["text"]) for o in cell["outputs"] if o["output_type"] == "stream")
        is_true = OutputChecker().check_output(shown, printed.getvalue(), NUMBER | NORMALIZE_WHITESPACE)
        assert is_true, f"the notebook shows {shown!r}, and the code prints {printed.getvalue()!r}"
    pyplot.close("all")
