"""Stub, page and flags of the verbs' options are those of the records as they are."""

from __future__ import annotations

import ast
import importlib.util
import json
import subprocess
import sys
import typing
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import pytest
from house.annotations import namespace, stub, verb_signature

from sarcl import verbs
from sarcl.base.forecast import Plan
from sarcl.base.options import described, option
from sarcl.base.verb import verb
from sarcl.imaging.backproject import plan_of
from sarcl.imaging.backproject_options import BackprojectOptions
from sarcl.model.image import Image
from sarcl.model.image_grid import ImageGrid
from sarcl.model.phase_history import PhaseHistory

ALL = (*verbs.HOMES, *verbs.NUMBERS)

ROOT = Path(__file__).parents[2]
FLAGS = ROOT / "sarcl" / "cli" / "_flags.py"
SCRIPT = ROOT / "docs" / "developers" / "write_options.py"
Colour = typing.Literal["red", "100 % green"]


@pytest.fixture(scope="module")
def write():
    spec = importlib.util.spec_from_file_location("write_options", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def stale(write, root):
    """Files that differ from what the script makes now."""
    made = write.made(root)
    return sorted(path.name for path, text in made.items() if not path.exists() or path.read_text() != text)


def test_the_files_are_those_of_the_records(write):
    assert stale(write, ROOT) == [], f"out of date; run {write.COMMAND}"


@dataclass(frozen=True, eq=False, kw_only=True)
class MoreOptions(BackprojectOptions):
    """The options of backproject, and one more."""

    tolerance: float = option(0.5)
    colour: Colour | None = option("red", 'the colour | that it has, "red"; at 100 % it\'s green.\n    Or none')


@verb(MoreOptions)
def backproject(raw: PhaseHistory, grid: ImageGrid, options: MoreOptions) -> Plan[Image]:
    """As backproject.

    {options}
    """
    return plan_of(raw, grid, options)


def test_another_record_changes_all_files(write, monkeypatch, tmp_path):
    monkeypatch.setattr(verbs, "backproject", backproject)
    assert stale(write, ROOT) == ["__init__.pyi", "flags.json", "options.md"]
    text = {path.name: text for path, text in write.made(tmp_path).items()}
    assert f"from {__name__} import Colour\n" in text["__init__.pyi"]
    for lines in ('    colour: Colour | None = "red",\n', "    colour: Colour | None\n", "tolerance: float = 0.5,\n"):
        assert lines in text["__init__.pyi"]
    meaning = 'the colour \\| that it has, "red"; at 100 % it\'s green. Or none'
    assert f'| `colour` | `Colour \\| None` | `"red"` | {meaning} |\n' in text["options.md"]
    assert "| `tolerance` | `float` | `0.5` | L2 error" in text["options.md"].partition("## backproject")[2]
    tables = json.loads(text["flags.json"])
    defaults = tables["defaults"]["backproject"]
    assert defaults["colour"] == "red" and defaults["tolerance"] == 0.5
    assert tables["choices"]["backproject"]["colour"] == ["red", "100 % green"]


def test_a_default_that_is_no_literal_is_refused(write, monkeypatch):
    @dataclass(frozen=True, eq=False, kw_only=True)
    class Odd(BackprojectOptions):
        colour: float = option(float("inf"), "inf is a name")

    monkeypatch.setattr(backproject, "options", Odd)
    monkeypatch.setattr(verbs, "backproject", backproject)
    with pytest.raises(ValueError, match="inf is no literal"):
        write.made(ROOT)


@pytest.mark.parametrize("name", ALL)
def test_the_signature_of_the_stub_is_that_of_the_verb(name):
    """Where it has several signatures, the first is for results that are whole, one says what a piece is, and the last
    is for lists."""
    wanted, (whole, *others) = verb_signature(getattr(verbs, name)), stub()[1][name]
    assert whole.return_annotation == wanted.return_annotation
    parameters = dict(whole.parameters)
    if lists := getattr(verbs, name).lists:
        of_lists = others.pop()
        assert of_lists.return_annotation == list[whole.return_annotation]
        changed = {n: p.annotation for n, p in of_lists.parameters.items() if p != parameters[n]}
        assert tuple(changed) == lists
        for n, kind in changed.items():
            one = typing.get_args(kind)[0]
            assert typing.get_origin(one) is list and typing.get_args(one)[0] in (
                parameters[n].annotation,
                *typing.get_args(parameters[n].annotation),
            )
    for piece in others:
        assert piece.return_annotation == whole.return_annotation | None
        assert list(piece.parameters) == list(parameters)
        changed = [n for n, p in piece.parameters.items() if p != parameters[n]]
        assert changed == ["tile"] and parameters["tile"].annotation is None
        parameters["tile"] = parameters["tile"].replace(annotation=piece.parameters["tile"].annotation)
    assert list(parameters.items()) == list(wanted.parameters.items())


@pytest.mark.parametrize("name", ALL)
def test_keywords_of_the_stub_are_the_options_of_the_verb(name):
    names, signatures = stub()
    keywords = typing.get_type_hints(names[f"{name.title().replace('_', '')}Keywords"], names)
    *_, signature = (one for one in signatures[name] if typing.get_origin(one.return_annotation) is not list)
    options = {p.name: p.annotation for p in signature.parameters.values() if p.kind is p.KEYWORD_ONLY}
    assert keywords == options


def test_plan_without_a_verb_has_the_signature_of_backproject():
    names, signatures = stub()
    given, short = signatures["plan"]
    _, piece = signatures["backproject"]
    assert list(given.parameters) == ["verb", "args", "options"]
    assert short.return_annotation == names["Forecast"][names["Image"]]
    parameters = dict(piece.parameters)
    parameters["tile"] = parameters["tile"].replace(default=None)
    assert list(short.parameters.items()) == list(parameters.items())


def test_flags_are_the_options_and_import_nothing(write):
    flags = {"__package__": "sarcl.cli"}
    exec(FLAGS.read_text(), flags)
    for name in write.ON_COMMAND_LINE:
        record = getattr(verbs, name).options
        assert flags["DEFAULTS"][name] == {n: f.default for n, (f, _) in described(record).items()}
        for option_name, words in flags["CHOICES"].get(name, {}).items():
            check = described(record)[option_name][1].check
            assert [check(option_name, word) for word in words] == list(words) if check else words
    imported = [ast.unparse(node) for node in ast.parse(FLAGS.read_text()).body if "import" in ast.unparse(node)]
    assert imported[1:] == ["import json", "from pkgutil import get_data", "from typing import Any"]


def test_flags_come_without_numpy():
    code = "import sys, sarcl.cli._flags; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"


def test_every_option_stands_on_the_page(write):
    page = (ROOT / write.PAGE).read_text()
    shared, *sections = page.partition("## Every verb")[2].split("\n## ")
    assert [section.partition("\n")[0] for section in sections] == list(ALL)
    for name, section in zip(ALL, sections, strict=True):
        for option_name in described(getattr(verbs, name).options):
            assert f"| `{option_name}` |" in section or f"| `{option_name}` |" in shared


def test_names_that_two_verbs_mean_differently_are_told_apart():
    """Both echo and backproject have a type Skip: the stub imports each under a name of its own."""
    skips = [stub()[1][name][0].parameters["skip"].annotation for name in ("echo", "backproject")]
    kinds = [namespace(verb.options)["Skip"] for verb in (verbs.echo, verbs.backproject)]
    assert skips == [bool | Collection[kind] for kind in kinds] and skips[0] != skips[1]


def test_functions_of_the_stub_are_those_of_the_package():
    assert set(stub()[1]) == {*ALL, "plan"} == set(verbs.__all__)
    assert all(getattr(verbs, name).__name__ == name for name in verbs.__all__)
