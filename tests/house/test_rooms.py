"""The rules of the rooms that import-linter cannot say: private files, contents pages, the size of folders."""

from __future__ import annotations

import ast
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from sarcl import verbs

HOMES = verbs.HOMES | verbs.NUMBERS
ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "sarcl"
FULL = 25  # files of a folder: more are two rooms

# Plain names although no other folder imports them.
DOORS_FOR_OTHERS = {
    "sarcl.bench.fastsar_peer": "a program for another environment",
    "sarcl.bench.one_shot": "a program: python -m sarcl.bench.one_shot",
    "sarcl.papers.farooq.range_zones": "for users (docs: papers)",
}


@cache
def files() -> dict[str, Path]:
    """Dotted name -> file of every module of the package; a folder is named by its __init__.py."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        name = ".".join(("sarcl", *path.relative_to(PACKAGE).with_suffix("").parts))
        found[name.removesuffix(".__init__")] = path
    return found


def imported(name: str, path: Path) -> set[str]:
    """Modules of the package that a file imports, anywhere in it and for type checkers too."""
    package = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    out = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            out |= {alias.name for alias in node.names if alias.name in files()}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                out |= {m for m in (source, f"{source}.{alias.name}") if m in files()}
    return out


def folder(name: str) -> str:
    """The folder that holds a module or a sub-room."""
    return name.rpartition(".")[0]


def is_private(name: str) -> bool:
    return name.rpartition(".")[2].startswith("_") and name != "sarcl.__main__"


@cache
def importers() -> dict[str, set[str]]:
    """Module -> the folders of those who import it, from sarcl/ and the scripts of bench/."""
    out: dict[str, set[str]] = {name: set() for name in files()}
    for name, path in files().items():
        here = name if path.name == "__init__.py" else folder(name)
        for other in imported(name, path):
            out[other].add(here)
    stub = imported("sarcl.verbs", PACKAGE / "verbs" / "__init__.pyi")
    for other in {f"sarcl.{home}" for home in HOMES.values()} | stub:  # the verbs are imported by name
        out[other].add("sarcl.verbs")
    for script in (ROOT / "bench").glob("*.py"):
        for other in imported("bench." + script.stem, script):
            out[other].add("bench")
    return out


@cache
def outside_tests() -> dict[str, set[str]]:
    """Module -> the files of tests/ that import it and belong to another room, or to several."""
    out: dict[str, set[str]] = {name: set() for name in files()}
    for path in (ROOT / "tests").rglob("*.py"):
        parts = path.relative_to(ROOT).parts
        for other in imported(".".join(parts), path):
            if other.split(".")[1:2] != [parts[1]]:
                out[other].add("/".join(parts))
    return out


def test_private_files_are_imported_by_their_own_folder_alone():
    wrong = [
        f"{name} is imported by {sorted(others)}"
        for name, users in importers().items()
        if is_private(name) and (others := users - {folder(name)})
    ]
    assert not wrong, "\n".join(wrong)
    assert sum(map(is_private, files())) > 50


def test_tests_of_other_rooms_import_no_private_file():
    wrong = {name: sorted(tests) for name, tests in outside_tests().items() if tests and "._" in name}
    assert not wrong, f"{wrong}: let the tests use public names, stand with the room, or the file have a public name"


def test_files_that_only_their_own_folder_imports_are_private():
    """Neither the reference, whose users are the tests, nor what the front door names (sarcl/__init__.pyi), nor what
    tests of other rooms need.
    """
    front = imported("sarcl", PACKAGE / "__init__.pyi")
    wrong = [
        name
        for name, users in importers().items()
        if not is_private(name) and name.count(".") > 1 and files()[name].name != "__init__.py"
        and not name.startswith("sarcl.reference.") and name not in front and name not in DOORS_FOR_OTHERS
        and not users - {folder(name)} and not outside_tests()[name]
    ]  # fmt: skip
    assert not wrong, f"{wrong}: let their names begin with an underscore"
    assert all(name in files() and not importers()[name] - {folder(name)} for name in DOORS_FOR_OTHERS)


@pytest.mark.parametrize("room", [name for name, path in files().items() if path.name == "__init__.py"][1:])
def test_a_room_has_a_contents_page(room):
    tree = ast.parse(files()[room].read_text())
    lines = (ast.get_docstring(tree, clean=False) or "").splitlines()
    assert lines and lines[0].endswith("."), "the page begins with a sentence on the room"
    listed = {line.split()[0].rstrip("/") for line in lines if line.startswith("    ")}
    inside = {name.rpartition(".")[2] for name in files() if folder(name) == room}
    assert listed == inside, "a line for each file and sub-room"
    private = {line.split()[0].rstrip("/") for line in lines[_begin_of_private(lines) :] if line.startswith("    ")}
    assert private == {n for n in listed if n.startswith("_")} or not any("For other folders:" in x for x in lines)
    public = {
        name for node in tree.body if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        for name in ast.literal_eval(node.value)
    }  # fmt: skip
    own = {n.name for n in tree.body if isinstance(n, (ast.FunctionDef, ast.ClassDef))}
    own |= {a.name for n in tree.body if isinstance(n, ast.ImportFrom) for a in n.names}
    own |= {ast.unparse(n.targets[0]) for n in tree.body if isinstance(n, ast.Assign)}
    own |= set(HOMES) if room == "sarcl.verbs" else set()
    # the page names the files that others may import, so that a list in code is needed where the room has more names
    assert not public or {n for n in inside if not n.startswith("_")} <= public
    assert public <= {n for n in inside if not n.startswith("_")} | own


def _begin_of_private(lines):
    """The line of a contents page after which files of the folder itself stand; beyond the last where there is none."""
    return next((i for i, line in enumerate(lines) if line.startswith("For this folder alone")), len(lines))


def test_the_front_door_stands_alone():
    assert {p.name for p in PACKAGE.iterdir() if p.is_file()} <= {
        "__init__.py",
        "__init__.pyi",
        "__main__.py",
        "py.typed",
    }


def test_no_folder_is_full():
    for top in ("sarcl", "tests"):
        count = Counter(p.parent for p in (ROOT / top).rglob("*.py"))
        for where, n in count.items():
            assert n <= FULL, f"{where.relative_to(ROOT)} has {n} files: two rooms?"


def test_tests_mirror_the_rooms():
    rooms = {p.name for p in PACKAGE.iterdir() if p.is_dir() and (p / "__init__.py").exists()}
    others = {"contract", "gpu_static", "helpers", "house", "mutants", "published"}
    folders = {p.name for p in (ROOT / "tests").iterdir() if p.is_dir() and p.name != "__pycache__"}
    assert folders <= rooms | others
    assert not list((ROOT / "tests").glob("test_*.py"))
    names = Counter(p.name for p in (ROOT / "tests").rglob("test_*.py"))
    assert max(names.values()) == 1, "pytest wants each file's name once"
