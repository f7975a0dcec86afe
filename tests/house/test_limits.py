"""Counts that may fall and not rise: vague annotations, formatting by hand, long functions, conditionals in kernels."""

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 60  # lines of a function, without its docstring and lines that hold a comment alone
PARAMETERS = 9  # a function that has as many counts as one of many


@cache
def sources() -> dict[Path, str]:
    return {path: path.read_text() for path in sorted((ROOT / "sarcl").rglob("*.py"))}


def lines_with(pattern: str) -> int:
    return sum(re.search(pattern, line) is not None for text in sources().values() for line in text.splitlines())


def functions() -> list[tuple[Path, str, ast.FunctionDef]]:
    return [
        (path, text, node)
        for path, text in sources().items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef)
    ]


def lines_of_code(text: str, function: ast.FunctionDef) -> int:
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    docstring = set(range(function.body[0].lineno, function.body[0].end_lineno + 1)) if body != function.body else set()
    lines = text.splitlines()
    return sum(
        number not in docstring and lines[number - 1].strip() != "" and not lines[number - 1].lstrip().startswith("#")
        for number in range(function.lineno, function.end_lineno + 1)
    )


def test_annotations_say_a_type():
    assert 50 < lines_with(": Any|-> Any") <= 100, "give the type, or `object` where any will do"


def test_the_formatter_formats():
    assert 50 < lines_with("fmt: skip") <= 120, "let the formatter break the lines, or pass a record"


def test_functions_are_short_and_have_few_parameters():
    sizes = {f"{path.relative_to(ROOT)}:{node.name}": lines_of_code(text, node) for path, text, node in functions()}
    assert {name: n for name, n in sizes.items() if n > LONGEST} == {}
    assert max(sizes.values()) > LONGEST - 10
    wide = [
        f"{path.relative_to(ROOT)}:{node.name}"
        for path, _, node in functions()
        if len(node.args.args) + len(node.args.kwonlyargs) + len(node.args.posonlyargs) >= PARAMETERS
    ]
    assert 0 < len(wide) <= 15, wide


def test_kernels_have_few_conditionals():
    texts = {path: path.read_text() for path in sorted((ROOT / "kernels").glob("*.cl*"))}
    conditionals = {
        path: len(re.findall(r"^\s*#\s*(?:if|ifdef|ifndef|elif|else)\b", text, re.M)) for path, text in texts.items()
    }
    assert 50 < sum(conditionals.values()) <= 260, conditionals
