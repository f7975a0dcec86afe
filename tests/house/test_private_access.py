"""Tests reach results through public names: few files import private ones, few constants are replaced."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

TESTS = Path(__file__).parents[1]
MOST_PRIVATE = 30  # files of tests/ that name a private file or a private name of the package
MOST_CONSTANTS = 5  # calls that replace a constant of the package
PATCHERS = ("setattr", "patch", "object")  # of pytest's monkeypatch, and of unittest.mock


@cache
def is_module(name: str) -> bool:
    """Whether a dotted name is a module of the package."""
    try:
        return name.split(".")[0] == "sarcl" and find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def is_private(name: str) -> bool:
    """Whether any part of a dotted name is private; names such as __version__ are not."""
    return any(part.startswith("_") and not part.startswith("__") for part in name.split("."))


def resolved(node: ast.expr, names: dict[str, str]) -> str:
    """Dotted name in the package of an expression such as `module.NAME`, or nothing."""
    if isinstance(node, ast.Attribute):
        base = resolved(node.value, names)
        return f"{base}.{node.attr}" if base else ""
    return names.get(node.id, "") if isinstance(node, ast.Name) else ""


def imported_names(tree: ast.AST) -> dict[str, str]:
    """Names of a file -> dotted names in the package that its import statements bind to them."""
    names = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] == "sarcl":
                    names[alias.asname or "sarcl"] = alias.name if alias.asname else "sarcl"
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "sarcl":
            names |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    return names


def private_names(tree: ast.AST) -> Iterator[str]:
    """Private names of the package in a file: imported, attributes of a module, or targets of a patch."""
    names = imported_names(tree)
    yield from filter(is_private, names.values())
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and is_private(node.attr) and is_module(resolved(node.value, names)):
            yield resolved(node, names)
        elif isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.startswith("sarcl.") and is_private(a.name))
        elif isinstance(node, ast.Call):
            yield from (name for name in patch_targets(node, names) if is_private(name))


def patch_targets(node: ast.Call, names: dict[str, str]) -> Iterator[str]:
    """Dotted name of what a call of monkeypatch.setattr or mock.patch replaces in the package, if anything."""
    if not (isinstance(node.func, ast.Attribute) and node.func.attr in PATCHERS and node.args):
        return
    texts = [a.value if isinstance(a, ast.Constant) and isinstance(a.value, str) else None for a in node.args[:2]]
    if texts[0]:
        yield from [texts[0]] if texts[0].startswith("sarcl.") else []
    elif (base := resolved(node.args[0], names)) and len(texts) == 2:
        yield f"{base}.{texts[1] or '?'}"


@cache
def trees() -> dict[str, ast.AST]:
    return {str(path.relative_to(TESTS)): ast.parse(path.read_text()) for path in sorted(TESTS.rglob("*.py"))}


def test_few_tests_know_private_names():
    users = {path: sorted(set(private_names(tree))) for path, tree in trees().items()}
    users = {path: names for path, names in users.items() if names}
    text = "\n".join(f"{path}: {', '.join(names)}" for path, names in users.items())
    assert len(users) <= MOST_PRIVATE, f"{text}\n{len(users)} files: reach the same results through public names"


def test_few_tests_replace_constants():
    replaced = []
    for path, tree in trees().items():
        names = imported_names(tree)
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        targets = [target for call in calls for target in patch_targets(call, names)]
        replaced += [f"{path}: {name}" for name in targets if name.rpartition(".")[2].isupper()]
    text = "\n".join(replaced)
    assert len(replaced) <= MOST_CONSTANTS, f"{text}\n{len(replaced)} constants: choose inputs, options or limits"
