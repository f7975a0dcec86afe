"""The reference of the site: no public name is left out, each has an example, and the examples run."""

from __future__ import annotations

import doctest
import importlib
import inspect
from pathlib import Path
from types import ModuleType

import pytest

import sarcl

SITE = Path(__file__).parents[2] / "docs" / "site"


@pytest.fixture(scope="module")
def reference():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SITE))
        yield importlib.import_module("reference")


@pytest.fixture(scope="module")
def docstrings(reference):
    return importlib.import_module("docstrings")


def test_every_public_name_has_a_page(reference):
    pages = reference.pages()
    text = "\n".join(pages.values())
    for name in sarcl.__all__:
        value = getattr(sarcl, name)
        assert (f"module_{name}.md" if isinstance(value, ModuleType) else f"{name}.md") in pages
        assert f"sarcl.{name}" in text
    for path in reference.public_names():
        assert "." not in path or f"}} sarcl.{path}" in text, path


def test_functions_and_classes_of_public_modules_are_public_or_listed_as_internal(reference):
    for name in sarcl.__all__:
        module = getattr(sarcl, name)
        if isinstance(module, ModuleType):
            own = {
                path.partition(".")[2] for path in reference.public_names() if path.startswith(f"{name}.")
            } | reference.INTERNAL.get(name, set())
            defined = {
                n
                for n, value in vars(module).items()
                if not n.startswith("_") and inspect.isroutine(value) and value.__module__ == module.__name__
            }
            assert defined - own - set(sarcl.__all__) == set()
            assert all(hasattr(module, n) for n in own), name


def test_every_public_name_has_an_example(reference, docstrings):
    names = [n for n in reference.public_names().values() if callable(n.value)]
    assert len(names) > 100
    assert [n.path for n in names if not docstrings.examples(n.doc)] == []


def test_every_parameter_of_a_signature_is_on_its_page(reference):
    pages = reference.pages()
    for name in ("echo", "rcs", "backproject", "measure", "Waveform"):
        for parameter in inspect.signature(getattr(sarcl, name)).parameters:
            assert f"`{parameter}`" in pages[f"{name}.md"] or f"{parameter}:" in pages[f"{name}.md"], parameter


@pytest.mark.slow
def test_examples_of_docstrings_run(reference, docstrings, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    begin: dict[str, object] = {}
    parser, wrong = doctest.DocTestParser(), []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE, verbose=False)
    preamble = parser.get_doctest("\n".join(reference.preamble()), {}, "sarcl", None, 0)
    assert runner.run(preamble, out=wrong.append, clear_globs=False).failed == 0, "".join(wrong)
    begin |= preamble.globs
    for name in reference.public_names().values():
        text = "\n\n".join(docstrings.examples(name.doc))
        if text:
            runner.run(parser.get_doctest(text, dict(begin), name.path, None, 0), out=wrong.append)
    assert not wrong, "".join(wrong)


def test_docstrings_become_markdown(docstrings):
    doc = inspect.cleandoc("""
        One sentence with 2*x and `name`.

            y = x^2

        first    its meaning, m,
                 continued;  second  another, of `thing`
        a, b     both; see docs/theory/facets.md
        Returns a number. Source: none.

        >>> 1 + 1
        2
        """)
    text = docstrings.markdown(doc, {"first": "(`int`)"}, lambda code: "Thing" if code == "thing" else None)
    assert text == "\n\n".join([
        "One sentence with 2\\*x and `name`.",
        "```text\ny = x^2\n```",
        "`first` (`int`)\n: its meaning, m, continued",
        "`second`\n: another, of {py:obj}`thing <sarcl.Thing>`",
        "`a`, `b`\n: both; see [facets](../docs/theory/facets.md)",
        "**Returns** a number. Source: none.",
        "```python\n>>> 1 + 1\n2\n```\n",
    ])  # fmt: skip
    assert docstrings.entries(doc).keys() == {"first", "second", "a", "b"}
    assert docstrings.examples(doc) == [">>> 1 + 1\n2"]
