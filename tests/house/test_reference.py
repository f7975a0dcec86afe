"""The reference of the site: no public name is left out, each has an example, and the examples run."""

from __future__ import annotations

import doctest
import importlib.util
import inspect
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import sarcl

SITE = Path(__file__).parents[2] / "docs" / "site"
# packages that lines of examples need: extra of sarcl -> modules
PACKAGES = {
    "jax": ["jax"],
    "maps": ["rasterio", "pyproj"],
    "orbits": ["sgp4"],
    "torch": ["torch"],
    "xarray": ["xarray"],
}


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


def test_every_public_method_has_an_example_and_every_parameter_is_documented(reference):
    names = [n for n in reference.public_names().values() if callable(n.value)]
    listed = [m for n in names if inspect.isclass(n.value) for m in reference.members(n.value) if m[0] != "property"]
    assert len(listed) > 90
    assert [lack for name in names for lack in reference.undocumented(name)] == []


def test_a_method_without_an_example_and_a_parameter_without_a_name_are_found(reference):
    class Probe:
        """A class.

        >>> Probe().shown(1)
        """

        def shown(self, width):
            """The width, m."""

        def silent(self, width, height):
            """The width, m."""

    Probe.__module__ = sarcl.Image.__module__
    lacks = reference.undocumented(reference.Name("Probe", Probe))
    assert lacks == ["Probe.silent: no example", "Probe.silent: height is not named"]


def test_members_left_out_of_the_reference_exist(reference):
    kinds = {n.value.__name__: n.value for n in reference.public_names().values() if inspect.isclass(n.value)}
    for name, left_out in reference.INTERNAL_MEMBERS.items():
        assert [member for member in left_out if not hasattr(kinds[name], member)] == [], name


def test_every_parameter_of_a_signature_is_on_its_page(reference):
    pages = reference.pages()
    for name in ("echo", "rcs", "backproject", "measure", "Waveform"):
        for parameter in inspect.signature(getattr(sarcl, name)).parameters:
            assert f"`{parameter}`" in pages[f"{name}.md"] or f"{parameter}:" in pages[f"{name}.md"], parameter


@pytest.mark.slow
def test_examples_of_docstrings_run(reference, docstrings, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _write_files(monkeypatch)
    begin: dict[str, object] = {}
    parser, wrong = doctest.DocTestParser(), []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE, verbose=False)
    preamble = parser.get_doctest("\n".join(reference.preamble()), {}, "sarcl", None, 0)
    assert runner.run(preamble, out=wrong.append, clear_globs=False).failed == 0, "".join(wrong)
    begin |= preamble.globs
    for name in reference.public_names().values():
        for doc in (name.doc, *_method_docs(reference, name.value)):
            test = parser.get_doctest("\n\n".join(docstrings.examples(doc)), dict(begin), name.path, None, 0)
            test.examples = [example for example in test.examples if _can_run(example.source)]
            runner.run(test, out=wrong.append)
    assert not wrong, "".join(wrong)


def _method_docs(reference, value) -> list[str]:
    return [inspect.getdoc(m[2]) for m in reference.members(value)] if inspect.isclass(value) else []


def _can_run(source: str) -> bool:
    """Whether the package that a line needs is there: "# needs sarcl[EXTRA]", or one that does not exist."""
    extra = re.search(r"# needs (?:sarcl\[(\w+)\]|a package)", source)
    return extra is None or (extra[1] in PACKAGES and all(map(importlib.util.find_spec, PACKAGES[extra[1]])))


def _write_files(monkeypatch) -> None:
    """The files that examples read: an elevation model where rasterio is, an orbit as of Sentinel-1."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "model"))
    importlib.import_module("test_orbit").written(Path("S1A_POEORB.EOF"))
    if importlib.util.find_spec("rasterio"):
        rasterio = importlib.import_module("rasterio")
        grid = {"crs": "EPSG:4326", "transform": rasterio.transform.from_origin(7, 46, 0.001, 0.001)}
        with rasterio.open("terrain.tif", "w", "GTiff", 4, 3, 1, dtype="float32", **grid) as file:
            file.write(np.full((1, 3, 4), 500, np.float32))


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
