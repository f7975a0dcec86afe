"""What a move of files would break without a sound: citations, names in strings, the wheel, where warnings point."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import inspect
import io
import json
import logging
import os
import re
import shutil
import subprocess
import sys
import tokenize
import tomllib
import warnings
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import sarcl
from sarcl.base import fingerprint
from sarcl.io import entry_points

ROOT = Path(__file__).resolve().parents[2]
CITED = re.compile(r"(?<![\w./-])((?:[\w.-]+/)*[\w-]+\.(?:py|clh|cl|md))(?!\w)(?::([A-Za-z_]\w*))?")
DOTTED = re.compile(r"(?<![\w./-])sarcl(?:\.[A-Za-z_]\w*)+(?![\w/])")


@cache
def tree(*suffixes: str) -> list[str]:
    """Files of the repository with one of these suffixes, paths from its root."""
    skipped = {"build", "out", "dist", "__pycache__"}
    found = (p.relative_to(ROOT) for p in ROOT.rglob("*") if p.suffix in suffixes)
    return sorted(p.as_posix() for p in found if not any(q in skipped or q.startswith(".") for q in p.parts[:-1]))


@cache
def parsed(path: str) -> ast.Module:
    return ast.parse((ROOT / path).read_text())


@cache
def prose(path: str) -> str:
    """Docstrings and comments of a Python file; other files whole."""
    text = (ROOT / path).read_text()
    if not path.endswith(".py"):
        return text
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    parts = [token.string for token in tokens if token.type == tokenize.COMMENT]
    kinds = ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef
    docs = (ast.get_docstring(node, clean=False) for node in ast.walk(parsed(path)) if isinstance(node, kinds))
    return "\n".join([*parts, *(doc for doc in docs if doc)])


def strings(path: str) -> Iterator[str]:
    """String constants of a Python file, docstrings included."""
    return (n.value for n in ast.walk(parsed(path)) if isinstance(n, ast.Constant) and isinstance(n.value, str))


def defines(path: str, name: str) -> bool:
    """Whether a file defines a function, class or variable of this name (kernels: at least holds the word)."""
    if not path.endswith(".py"):
        return re.search(rf"\b{name}\b", (ROOT / path).read_text()) is not None
    for node in ast.walk(parsed(path)):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.name == name:
            return True
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id == name:
            return True
    return False


def resolves(dotted: str) -> bool:
    """Whether a dotted name of the package can be reached, by imports and attributes."""
    value = sarcl
    for i, name in enumerate(dotted.split(".")[1:], 2):
        if not hasattr(value, name):
            try:
                value = importlib.import_module(".".join(dotted.split(".")[:i]))
            except ModuleNotFoundError:
                return False
        else:
            value = getattr(value, name)
    return True


# ---- citations


@pytest.mark.slow
def test_cited_files_and_names_exist():
    files, wrong, seen = tree(".py", ".cl", ".clh", ".md"), [], 0
    for path in files:
        for cited, name in CITED.findall(prose(path)):
            seen += 1
            beside = os.path.normpath(os.path.join(os.path.dirname(path), cited))
            places = {cited, beside} if "/" in cited else {f for f in files if Path(f).name == cited}
            places &= set(files)
            if not places or (name and not any(defines(p, name) for p in places)):
                wrong.append(f"{path} cites {cited}{name and ':'}{name}")
    assert not wrong, "\n".join(wrong)
    assert seen > 150  # else the pattern finds nothing any more


def test_every_kernel_names_a_reference():
    for path in tree(".cl"):
        assert re.search(r"^// reference: sarcl/\S+\.py:\w+", (ROOT / path).read_text(), re.M), path


def test_dotted_names_of_the_package_resolve():
    """In prose (`sarcl.pointing`), and in strings that code uses as names of modules ("sarcl.kernels")."""
    found = {(path, name) for path in tree(".py", ".cl", ".clh", ".md") for name in DOTTED.findall(prose(path))}
    found |= {(path, text) for path in tree(".py") for text in strings(path) if DOTTED.fullmatch(text)}
    assert len(found) > 100
    groups = {f"sarcl.{group}" for group in get_args(entry_points.Group)}
    wrong = [f"{path} names {name}" for path, name in sorted(found) if name not in groups and not resolves(name)]
    assert not wrong, "\n".join(wrong)


def test_loggers_are_named_by_their_module():
    """A logger named by a string would go stale when its module moves: only the package's own may be. Another
    library's is named by that library's module."""
    for path in tree(".py"):
        if path.startswith("sarcl/"):
            for node in ast.walk(parsed(path)):
                if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("getLogger"):
                    name = ast.unparse(node.args[0])
                    assert name in ("__name__", "'sarcl'") or name.endswith(".__name__"), f"{path}:{node.lineno}"


def test_planning_echoes_is_quiet_about_the_few_pulses_it_makes(caplog):
    caplog.set_level(logging.INFO, logger="sarcl")
    short, cloud = sarcl.Trajectory([0.0], [[1e4, 0, 1e4]]), sarcl.Scene.points([[0, 0, 0], [500.0, 0, 0]])
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=50e6, duration=1e-6)
    sarcl.echo(cloud, chirp, short)
    loud = [r.name for r in caplog.records]
    caplog.clear()
    sarcl.plan(sarcl.echo, cloud, chirp, short)
    assert loud and not caplog.records


# ---- programs that are started, files beside modules


def started() -> list[tuple[str, str]]:
    """(file, module) of every list [..., "-m", "module", ...]."""
    out = []
    for path in tree(".py"):
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.List):
                for flag, module in zip(node.elts, node.elts[1:], strict=False):
                    if isinstance(flag, ast.Constant) and flag.value == "-m" and isinstance(module, ast.Constant):
                        out.append((path, module.value))
    return out


def test_modules_started_with_python_m_are_programs():
    found = set(started())
    assert {path.split("/")[0] for path, _ in found} >= {"sarcl", "tests"}
    for path, name in found:
        spec = importlib.util.find_spec(name)
        if spec is None and name == "basedpyright":  # of the extra dev: its tests are skipped
            continue
        assert spec and spec.origin, f"{path} starts {name}"
        if spec.submodule_search_locations:
            spec = importlib.util.find_spec(f"{name}.__main__")
            assert spec and spec.origin, f"{path} starts {name}, a package without __main__.py"
        else:
            assert 'if __name__ == "__main__"' in Path(spec.origin).read_text(), f"{name} does nothing when started"


def test_the_commands_of_an_installation_answer():
    module, name = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]["sarcl"].split(":")
    assert callable(getattr(importlib.import_module(module), name))
    done = subprocess.run([sys.executable, "-m", "sarcl", "--help"], capture_output=True, text=True)
    assert done.returncode == 0 and "simulate" in done.stdout


def test_files_beside_modules_are_there():
    found = [
        (path, node.args[0].value)
        for path in tree(".py") if not path.startswith("tests/")
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("(__file__).with_name")
    ]  # fmt: skip
    assert found
    for path, name in found:
        assert (ROOT / path).with_name(name).is_file(), f"{path} wants {name} beside it"


# ---- the wheel


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel's files, unpacked. Built from a copy, so that nothing is left in the repository."""
    folder = tmp_path_factory.mktemp("wheel")
    copy, out = folder / "copy", folder / "unpacked"
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in ("sarcl", "kernels"):
        shutil.copytree(ROOT / name, copy / name, ignore=ignored)
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    build = f"from setuptools import build_meta; build_meta.build_wheel({str(folder)!r})"
    done = subprocess.run([sys.executable, "-c", build], cwd=copy, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    zipfile.ZipFile(next(folder.glob("sarcl-*.whl"))).extractall(out)
    return out


def test_every_module_and_kernel_is_in_the_wheel(wheel):
    kinds = ".py", ".pyi", ".typed", ".cl", ".clh", ".j2", ".json", ".toml"
    wanted = {p for p in tree(*kinds) if p.startswith("sarcl/")}
    wanted |= {f"sarcl/{p}" for p in tree(*kinds) if p.startswith("kernels/")}
    assert {p.relative_to(wheel).as_posix() for p in wheel.rglob("*") if p.suffix in kinds} == wanted
    folders = {os.path.dirname(p) for p in wanted}
    assert {p for p in folders if f"{p}/__init__.py" not in wanted} == set()  # each is a package


def test_the_description_of_the_wheel_has_no_link_that_leads_nowhere(wheel):
    text = next(wheel.glob("*.dist-info/METADATA")).read_text()
    assert "Description-Content-Type: text/markdown" in text and "physical optics" in text
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"].get("urls", {})
    assert [link for link in re.findall(r"\]\(([^)]*)\)", text) if not link.startswith(("http", "#"))] == []
    assert ("](http" in text) or "Source" not in urls


def test_links_of_the_description_lead_to_the_page_of_the_repository():
    place, text = {"__file__": str(ROOT / "setup.py")}, (ROOT / "setup.py").read_text()
    exec(text[: text.index("class SourcesAndTests")], place)  # the functions alone: nothing is built
    page = "![a](b.png) [c `d` [e]](pages/f.md#g) [h](https://i.example) [j](#k)"
    assert place["description"](page, None) == "c `d` [e] [h](https://i.example) [j](#k)"
    here = "https://host.example/own/sarcl"
    wanted = f"![a]({here}/raw/HEAD/b.png) [c `d` [e]]({here}/blob/HEAD/pages/f.md#g) [h](https://i.example) [j](#k)"
    assert place["description"](page, here + "/") == wanted


LOOK = """
import json, sarcl
from importlib.resources import files
names = sorted(p.name for p in files("sarcl.kernels").iterdir() if p.name.endswith((".cl", ".clh")))
print(json.dumps([sarcl.__file__, {n: len(files("sarcl.kernels").joinpath(n).read_text()) for n in names}]))
"""


def test_kernels_are_found_in_an_unpacked_wheel_and_here(wheel, tmp_path):
    wanted = {p.name: len(p.read_text()) for p in (ROOT / "kernels").rglob("*.cl*") if p.suffix in (".cl", ".clh")}
    for path in (wheel, ROOT):
        environment = {**os.environ, "PYTHONPATH": str(path)}
        done = subprocess.run(
            [sys.executable, "-c", LOOK], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        home, found = json.loads(done.stdout)
        assert Path(home).is_relative_to(path) and found == wanted


def test_a_change_of_any_kernel_changes_the_fingerprint_of_all(tmp_path, monkeypatch):
    copy = tmp_path / "kernels"
    shutil.copytree(ROOT / "kernels", copy)
    monkeypatch.setattr("importlib.resources.files", lambda package: copy)
    marks = {fingerprint.kernels.__wrapped__()}
    changed = [p for p in sorted(copy.rglob("*")) if p.suffix in (".cl", ".clh")]
    for path in changed:
        path.write_text(path.read_text() + "\n")
        marks.add(fingerprint.kernels.__wrapped__())
    assert len(changed) > 20 and len(marks) == len(changed) + 1


# ---- warnings

TRACK = sarcl.Trajectory(np.arange(3) / 10, [[-5e3, y, 800.0] for y in (-1.0, 0.0, 1.0)])
LONG = sarcl.Waveform.tone(center=10e9, duration=1e-7)  # longer than 1/|df|
POINT = sarcl.Scene.points([[0.0, 0, 0]])
ARRAY = {
    "array": sarcl.AntennaArray.linear(3, spacing=0.015, frequency_step=20e6),
    "range_window": (-3.0, 3.0),
}


def _here():
    return inspect.currentframe().f_back.f_lineno


def coarse():
    from sarcl import shapes

    return shapes.sphere(1.0, facets=320)


def warned(call):
    """(file, line) of every SarclWarning of a call."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        call()
    return [(w.filename, w.lineno) for w in found if issubclass(w.category, sarcl.SarclWarning)]


def test_warnings_point_at_the_line_that_called_the_library():
    """Each of these is found at another depth: in the verb, below it, and below a verb that calls a verb."""
    raw = sarcl.echo(POINT, sarcl.Waveform.chirp(center=10e9, bandwidth=50e6, duration=1e-6), TRACK)
    wide = sarcl.ImageGrid.plane(shape=(400, 400), spacing=5.0)
    scene = coarse()
    sphere_wave = sarcl.Waveform.chirp(center=3e9, bandwidth=3e6, duration=1e-6)
    scenario = sarcl.Scenario(waveform=LONG, trajectory=TRACK, scene=POINT, **{"array": ARRAY["array"]})
    calls = {
        "polar_format": (lambda: sarcl.polar_format(raw, wide, check=False), _here()),
        "echo of an array": (lambda: sarcl.echo(POINT, LONG, TRACK, **ARRAY), _here()),
        "echo of a mesh": (lambda: sarcl.echo(scene, sphere_wave, TRACK, tolerance=1e-2, shadows=False), _here()),
        "plan of echo": (lambda: sarcl.plan(sarcl.echo, POINT, LONG, TRACK, **ARRAY), _here()),
        "Scenario.simulate": (lambda: scenario.simulate(), _here()),
    }
    for name, (call, line) in calls.items():
        found = warned(call)
        assert found and set(found) == {(__file__, line)}, f"{name} warns at {found}"
