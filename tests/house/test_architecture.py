"""The drawing and the table of rooms are those of the imports as they are, and what the page cites exists."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "docs" / "developers" / "draw_architecture.py"
TOML = """
[[tool.importlinter.contracts]]
name = "within a room"
type = "layers"
containers = ["sarcl.imaging"]
layers = ["b", "a"]

[[tool.importlinter.contracts]]
name = "imports point down"
type = "layers"
containers = ["sarcl"]
layers = ["cli", "simulation | imaging", "(earth)", "base"]
"""
FILES = {
    "__init__.py": "",
    "__main__.py": "from .cli import main\n",
    "cli/__init__.py": "def main():\n    from sarcl.imaging import run\n    from ..base import text, errors as e\n",
    "simulation/__init__.py": "import sarcl.base.text\n",
    "simulation/channels/__init__.py": "from ...base.text import size_text\nfrom .. import echo\n",
    "simulation/echo.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..imaging import Image\n",
    "imaging/__init__.py": "from .backproject import backproject\n",
    "imaging/backproject.py": "import numpy as np\nfrom ..base.text import (\n    size_text,\n    duration,\n)\n",
    "base/__init__.py": "",
    "base/text.py": "",
    "base/errors.py": "import warnings\n",
}
IMPORTS = {
    ("sarcl", "cli"): 1, ("cli", "imaging"): 1, ("cli", "base"): 2, ("simulation", "base"): 2, ("imaging", "base"): 1,
}  # fmt: skip


@pytest.fixture(scope="module")
def draw():
    spec = importlib.util.spec_from_file_location("draw_architecture", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def house(tmp_path, draw):
    """A small package with its page, made up to date."""
    for name, text in FILES.items():
        path = tmp_path / "sarcl" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tmp_path / "pyproject.toml").write_text(TOML)
    (tmp_path / draw.PAGE).parent.mkdir(parents=True)
    (tmp_path / draw.PAGE).write_text("before\n\n" + "\n".join(draw.MARKERS) + "\n\nafter\n")
    draw.main(tmp_path)
    return tmp_path


def stale(draw, root):
    """Files that differ from what the script makes now."""
    made = draw.made(root)
    return sorted(path.name for path, text in made.items() if not path.exists() or path.read_text() != text)


def test_the_page_and_the_drawing_are_those_of_the_imports(draw):
    assert stale(draw, ROOT) == [], f"out of date; run {draw.COMMAND}"


def test_the_page_says_what_every_room_holds(draw):
    page = (ROOT / draw.PAGE).read_text()
    described = re.findall(r"^\| `(\w+)` \|", page.partition("## The rooms")[2].partition("![")[0], flags=re.M)
    assert described == draw.read(ROOT).rooms


def test_files_cited_on_pages_of_developers_and_theory_exist(draw):
    pages = [*SCRIPT.parent.glob("*.md"), *SCRIPT.parents[1].glob("theory/*.md")]
    rooms = {path.name for path in (ROOT / "sarcl").iterdir() if path.is_dir()}
    cited = {
        found for page in pages for found in re.findall(r"`(\w+)/([\w/]+)(?::\w+)?`", page.read_text())
        if found[0] in rooms
    }  # fmt: skip
    assert len(cited) > 100
    for room, rest in sorted(cited):
        path = ROOT / "sarcl" / room / rest
        assert path.exists() or path.with_name(f"{path.name}.py").exists(), f"{room}/{rest}"


def test_every_import_statement_is_counted_once_for_each_pair_of_files(draw, house):
    made = draw.read(house)
    assert made.layers == [["sarcl"], ["cli"], ["simulation", "imaging"], ["base"]]
    assert made.imports == IMPORTS
    assert made.files == {"sarcl": 2, "cli": 1, "simulation": 3, "imaging": 2, "base": 3}
    assert "| cli | 1 | 3 | imaging 1, base 2 |" in (house / draw.PAGE).read_text()
    assert (house / draw.PAGE).read_text().startswith("before\n") and stale(draw, house) == []


def test_a_new_import_makes_the_page_and_the_drawing_stale(draw, house):
    path = house / "sarcl" / "simulation" / "echo.py"
    path.write_text(path.read_text() + "from sarcl.base import text\n")
    assert stale(draw, house) == ["architecture.md", "architecture.svg"]
    draw.main(house)
    assert stale(draw, house) == [] and draw.read(house).imports["simulation", "base"] == 3


def test_imports_that_do_not_point_down_are_named_and_red(draw, house):
    assert draw.RED not in draw.drawing(draw.read(house))
    for name, line in (
        ("base/text.py", "from .. import cli"),
        ("imaging/backproject.py", "from ..simulation import echo"),
    ):
        path = house / "sarcl" / name
        path.write_text(path.read_text() + line + "\n")
    made = draw.read(house)
    assert "**not downwards: cli**" in draw.table(made) and "**not downwards: simulation**" in draw.table(made)
    assert draw.drawing(made).count(f'fill="{draw.RED}"') == 2


def test_lines_are_written_anew_when_they_are_off_by_a_tenth(draw, house):
    path = house / "sarcl" / "base" / "text.py"
    path.write_text("#\n" * 1003)  # with the line of errors.py 1004
    draw.main(house)
    assert draw.shown_lines((house / draw.PAGE).read_text())["base"] == 1000
    path.write_text("#\n" * 1090)
    assert stale(draw, house) == []
    path.write_text("#\n" * 1130)
    assert stale(draw, house) == ["architecture.md", "architecture.svg"]


def test_what_is_missing_is_said(draw, house):
    (house / "sarcl" / "attic").mkdir()
    (house / "sarcl" / "attic" / "a.py").write_text("")
    with pytest.raises(ValueError, match=r"sarcl/attic/ is in no layer"):
        draw.read(house)
    (house / "pyproject.toml").write_text("[project]\n")
    with pytest.raises(ValueError, match=r"no \[\[tool.importlinter.contracts\]\] with type = \"layers\""):
        draw.read(house)
    (house / "pyproject.toml").write_text(TOML)
    (house / draw.PAGE).write_text("no markers\n")
    with pytest.raises(ValueError, match="lacks the markers"):
        draw.made(house)


def test_the_drawing_is_well_formed_and_names_every_room(draw, house):
    from xml.etree import ElementTree

    words = [text.text for text in ElementTree.fromstring((house / draw.DRAWING).read_text()).iter() if text.text]
    for room in draw.read(house).rooms:
        assert words.count(room) == 2  # at the left, and at its column
    assert {"1", "2"} <= set(words) and "3 files, 1 line" in words
