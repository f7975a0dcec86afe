"""Files that are made from the records of the verbs' options: python docs/developers/write_options.py

sarcl/verbs/__init__.pyi  signatures of the verbs, for type checkers and editors
docs/guide/options.md     tables of all options
sarcl/cli/flags.json      defaults and words of options for the parser of the command line, which must not import numpy

tests/house/test_options_listed.py fails while these differ from what this script makes.
"""

from __future__ import annotations

import ast
import builtins
import functools
import inspect
import json
import re
import sys
import textwrap
import typing
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path
from types import UnionType
from typing import Any, NamedTuple

from sarcl import verbs
from sarcl.base.options import described
from sarcl.numerics.run_options import RunOptions

COMMAND = "python docs/developers/write_options.py"
STUB, PAGE, FLAGS = "sarcl/verbs/__init__.pyi", "docs/guide/options.md", "sarcl/cli/flags.json"
ON_COMMAND_LINE = ("backproject", "polar_format", "range_doppler")
PIECE = "tile"  # with this option a verb returns None while other pieces are missing
WIDTH = 120


@dataclass(frozen=True)
class Parameter:
    """A subject or an option of a verb; its type as it is written in `module`."""

    name: str
    type: str
    module: str
    default: Any = inspect.Parameter.empty
    doc: str = ""
    in_files: bool = True


@dataclass(frozen=True)
class Verb:
    """A verb as its files need it; what it returns as it is written in `module`.

    lists  names of parameters that may be lists of as many: a list of results is returned then
    """

    name: str
    doc: str
    module: str
    result: str
    subjects: tuple[Parameter, ...]
    options: tuple[Parameter, ...]
    lists: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Its name as that of a class: PolarFormat of polar_format."""
        return self.name.title().replace("_", "")

    @property
    def about(self) -> str:
        """First paragraph of its documentation."""
        return " ".join(self.doc.partition("\n\n")[0].split())


class Origin(NamedTuple):
    """Where a name comes from: `name` of a module, or the module itself where that is None."""

    module: str
    name: str | None


# ---- reading


def read(name: str) -> Verb:
    """A verb, from its record and the signature of the function that plans it."""
    verb = getattr(verbs, name)
    signature = inspect.signature(verb)
    subjects = [
        Parameter(p.name, p.annotation, verb.__module__, p.default)
        for p in signature.parameters.values()
        if p.kind is p.POSITIONAL_OR_KEYWORD
    ]
    doc, result = inspect.getdoc(verb) or "", str(signature.return_annotation)
    return Verb(name, doc, verb.__module__, result, tuple(subjects), tuple(options_of(verb.options)), verb.lists)


def options_of(record: Any) -> list[Parameter]:
    """All options of a record. The type of one is written in the module of the class that declares it."""
    options = []
    for name, (field, told) in described(record).items():
        kind = next(kind for kind in record.__mro__ if name in inspect.get_annotations(kind))
        options.append(Parameter(name, field.type, kind.__module__, field.default, told.doc, told.in_files))
    return options


@functools.cache
def origins(module: str) -> dict[str, Origin]:
    """The names that a module imports, for type checkers alone too, and those that it defines."""
    names: dict[str, Origin] = {}
    imported = import_module(module)
    body = ast.parse(inspect.getsource(imported)).body
    body += [line for node in body if isinstance(node, ast.If) for line in node.body]
    for node in body:
        if isinstance(node, ast.Import):
            names |= {alias.asname or alias.name: Origin(alias.name, None) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            home = resolve_name("." * node.level + (node.module or ""), imported.__package__)
            names |= {alias.asname or alias.name: Origin(home, alias.name) for alias in node.names}
        elif isinstance(node, (ast.Assign, ast.ClassDef)):
            for target in node.targets if isinstance(node, ast.Assign) else [ast.Name(node.name)]:
                names |= {target.id: Origin(module, target.id)} if isinstance(target, ast.Name) else {}
    return names


def origin(name: str, module: str) -> Origin:
    """The module of the package that defines a name which `module` uses, however often it is imported on the way."""
    place = origins(module)[name]
    if place.name and place.module.startswith("sarcl.") and place.module != module:
        if place.name in origins(place.module):
            return origin(place.name, place.module)
    return place


def origins_of(text: str, module: str) -> dict[str, Origin]:
    """The names in a type, but for those of the language."""
    names = {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}
    return {name: origin(name, module) for name in names if not hasattr(builtins, name)}


def choices(parameter: Parameter) -> tuple[str, ...]:
    """Words of an option that takes words alone, or else None or a dict; of other options none."""
    try:
        kind = eval(parameter.type, dict(vars(import_module(parameter.module))))
    except NameError:  # a type that is imported for type checkers alone
        return ()
    union = typing.get_args(kind) if isinstance(kind, UnionType) or typing.get_origin(kind) is typing.Union else [kind]
    literals = [part for part in union if typing.get_origin(part) is typing.Literal]
    others = [part for part in union if part not in literals and part is not type(None)]
    return tuple(w for part in literals for w in typing.get_args(part)) if all(map(typing.is_typeddict, others)) else ()


# ---- text of Python


def literal(value: Any) -> str:
    """A value as the formatter writes it. ValueError for what is no literal."""
    if not isinstance(value, str):
        try:
            ast.literal_eval(repr(value))
        except (SyntaxError, ValueError):
            raise ValueError(f"{value!r} is no literal: it cannot be the default of an option") from None
        return repr(value)
    if '"' in value and "'" not in value:
        return f"'{value}'".replace("\\", "\\\\")
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _requoted(text: str) -> str:
    """A type with the formatter's quotes."""
    return re.sub(r"'([^'\"\\]*)'", r'"\1"', text)


class Names:
    """Names of types in the stub. Those that stand for two types, by the verb, get the verb's name before theirs."""

    def __init__(self, entries: Iterable[Verb]) -> None:
        self.imports: dict[Origin, str] = {}
        users: dict[str, dict[Origin, str]] = defaultdict(dict)  # name -> what it stands for -> the verb's title
        for entry in entries:
            typed = [(p.type, p.module) for p in (*entry.subjects, *entry.options)]
            for text, module in [*typed, (entry.result, entry.module)]:
                for name, place in origins_of(text, module).items():
                    users[name].setdefault(place, entry.title)
        for name, places in users.items():
            self.imports |= {place: name if len(places) == 1 else title + name for place, title in places.items()}

    def type(self, text: str, module: str) -> str:
        """A type of `module` as the stub writes it."""
        tree, places = ast.parse(text), origins_of(text, module)
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id in places:
                node.id = self.imports[places[node.id]]
        return _requoted(ast.unparse(tree))

    def lines(self) -> str:
        """The import statements, in the order of the linter."""
        plain, members = set(), defaultdict(set)
        for place, alias in self.imports.items():
            if place.name is None:
                plain.add(place.module if alias == place.module else f"{place.module} as {alias}")
            else:
                members[place.module].add(place.name if alias == place.name else f"{place.name} as {alias}")
        groups: dict[int, list[str]] = defaultdict(list)
        for name in sorted(plain):
            groups[_section(name)].append(f"import {name}")
        for module in sorted(members):
            home = module.replace("sarcl.", "..", 1) if _section(module) == 2 else module
            groups[_section(module)] += _imported(home, members[module])
        return "\n\n".join("\n".join(groups[section]) for section in sorted(groups))


def _section(module: str) -> int:
    """Place of an import: 0 the standard library, 1 other packages, 2 sarcl."""
    top = re.split(r"[. ]", module)[0]
    return 2 if top == "sarcl" else 0 if top in sys.stdlib_module_names else 1


def _imported(module: str, names: set[str]) -> list[str]:
    """Import statements of a module: one, and one for every name that gets another."""
    own = sorted((name for name in names if " as " not in name), key=lambda name: (not name[0].isupper(), name.lower()))
    text = f"from {module} import {', '.join(own)}"
    if len(text) > WIDTH:
        text = f"from {module} import (\n" + "".join(f"    {name},\n" for name in own) + ")"
    return [text] * bool(own) + [f"from {module} import {name}" for name in sorted(names - set(own))]


def _docstring(text: str) -> str:
    lines = textwrap.wrap(text, WIDTH - 10, break_long_words=False, break_on_hyphens=False)
    return '    """' + "\n    ".join(lines) + '"""\n'


# ---- the three files


def stub(entries: list[Verb]) -> str:
    """Signatures of the verbs and of plan(), and the options of each verb as a TypedDict."""
    names = Names(entries)
    own = [("collections.abc", "Callable"), ("sarcl.base.forecast", "Forecast")]
    own += [("typing", name) for name in ("ParamSpec", "TypedDict", "TypeVar", "overload")]
    names.imports |= {Origin(module, name): name for module, name in own}
    parts = [f"# Made from the records of the verbs' options by {COMMAND}\n", names.lines() + "\n"]
    parts += ['_P = ParamSpec("_P")\n_R = TypeVar("_R")\n\nHOMES: dict[str, str]\n']
    for entry in entries:
        fields = "".join(f"    {p.name}: {names.type(p.type, p.module)}\n" for p in entry.options)
        about = f"Options of `{entry.name}`, for functions that hand them on."
        parts.append(f"class {entry.title}Keywords(TypedDict, total=False):\n{_docstring(about)}\n{fields}")
    for entry in entries:
        parts += _functions(entry, names)
    return "\n".join([*parts, *_plan(entries, names)])


def _functions(entry: Verb, names: Names) -> list[str]:
    """Signatures of a verb: a second where it may return None, and one more where it takes lists."""
    doc = _docstring(f"{entry.about} Options: docs/guide/options.md.")
    result, takes_pieces = names.type(entry.result, entry.module), PIECE in [p.name for p in entry.options]
    whole = f"    {PIECE}: None = None,\n"
    texts = [_function(entry.name, _parameters(entry, names, whole), result, doc)]
    if takes_pieces:
        piece = _parameters(entry, names, "    {name}: {type},\n")
        texts.append(_function(entry.name, piece, f"{result} | None", doc))
    if entry.lists:
        texts.append(_function(entry.name, _parameters(_of_lists(entry), names, whole), f"list[{result}]", doc))
    return texts if len(texts) == 1 else [f"@overload\n{text}" for text in texts]


def _of_lists(entry: Verb) -> Verb:
    """A verb with lists in place of the parameters that may be lists."""

    def of_list(p: Parameter) -> Parameter:
        alone = p.type.removesuffix(" | None")
        return (
            replace(p, type=p.type.replace(alone, f"list[{alone}] | tuple[{alone}, ...]", 1))
            if p.name in entry.lists
            else p
        )

    parts = {name: tuple(map(of_list, getattr(entry, name))) for name in ("subjects", "options")}
    return replace(entry, **parts)


def _parameters(entry: Verb, names: Names, piece: str = "    {name}: {type} = {default},\n") -> str:
    """Lines of all parameters; piece  that of the option with which the verb may return None."""
    text = "".join(f"    {p.name}: {names.type(p.type, p.module)},\n" for p in entry.subjects) + "    *,\n"
    for p in entry.options:
        line = piece if p.name == PIECE else "    {name}: {type} = {default},\n"
        text += line.format(name=p.name, type=names.type(p.type, p.module), default=literal(p.default))
    return text


def _function(name: str, parameters: str, result: str, doc: str) -> str:
    return f"def {name}(\n{parameters}) -> {result}:\n{doc}"


def _plan(entries: list[Verb], names: Names) -> list[str]:
    """Signatures of plan(): with a verb, and short for backproject."""
    doc = _docstring(inspect.getdoc(verbs.plan).partition("\n\n")[0])
    first = next(entry for entry in entries if entry.name == "backproject")
    result = f"Forecast[{names.type(first.result, first.module)}]"
    return [
        "@overload\ndef plan(verb: Callable[_P, _R], /, *args: _P.args, **options: _P.kwargs) -> Forecast[_R]:\n" + doc,
        "@overload\n" + _function("plan", _parameters(first, names), result, doc),
    ]


def page(entries: list[Verb]) -> str:
    """The guide's page of options."""
    shared = options_of(RunOptions)
    text = f"""# Options of all verbs

<!-- written by {COMMAND} -->

Options are given by name: `sarcl.backproject(raw, grid, tolerance=1e-4)`. A misspelt option is refused, and the most
similar one is named. `sarcl.plan(sarcl.backproject, raw, grid, tolerance=1e-4)` takes the same options, and
`help(sarcl.backproject)` lists them too. In [scenario files](scenarios.md) options are keys of the verb's table, except
those that are named below each table: they belong to a single run, or have tables of their own.

## Every verb

{_table(shared)}"""
    for entry in entries:
        own = [p for p in entry.options if p not in shared]
        subjects = ", ".join(p.name for p in entry.subjects)
        text += f"\n## {entry.name}\n\n`sarcl.{entry.name}({subjects}, ...)`, beside the options of every verb:\n\n"
        text += _table(own)
    return text


def _table(options: Iterable[Parameter]) -> str:
    text = "| option | type | default | meaning |\n|---|---|---|---|\n"
    for p in options:
        cells = f"`{p.name}`", f"`{_requoted(p.type)}`", f"`{literal(p.default)}`", " ".join(p.doc.split())
        text += f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |\n"
    alone = ", ".join(f"`{p.name}`" for p in options if not p.in_files)
    return text + (f"\nNot in scenario files: {alone}.\n" if alone else "")


def flags(entries: list[Verb]) -> str:
    """The file of the command line: verb -> option -> its default, and the words that it takes, where it takes only
    these."""
    shown = [entry for entry in entries if entry.name in ON_COMMAND_LINE]
    tables = {
        "defaults": {
            entry.name: {p.name: ast.literal_eval(literal(p.default)) for p in entry.options} for entry in shown
        },
        "choices": {entry.name: {p.name: choices(p) for p in entry.options if choices(p)} for entry in shown},
    }
    return json.dumps(tables, indent=1) + "\n"


def made(root: Path) -> dict[Path, str]:
    """The files as they should be now: path -> text."""
    entries = [read(name) for name in (*verbs.HOMES, *verbs.NUMBERS)]
    return {root / STUB: stub(entries), root / PAGE: page(entries), root / FLAGS: flags(entries)}


def main(root: Path) -> int:
    """Write what has changed and name it."""
    for path, text in made(root).items():
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
            print(path.relative_to(root))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(__file__).parents[2]))
