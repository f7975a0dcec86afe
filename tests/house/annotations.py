"""What annotations stand for: those of a module, with the names that it imports for type checkers, and of the stub."""

from __future__ import annotations

import ast
import functools
import inspect
import sys
import types
import typing
from collections import defaultdict
from pathlib import Path

from sarcl import verbs

STUB = Path(verbs.__file__).with_suffix(".pyi")
EXTRAS = {  # packages of extras, which need not be installed
    "distributed": types.SimpleNamespace(Client=object),
    "xarray": types.SimpleNamespace(Dataset=object, DataArray=object),
}


def execute(node: ast.stmt, names: dict[str, typing.Any]) -> None:
    """Carry out a statement; a package of an extra that is missing gets its stand-in."""
    try:  # not with the annotations of this file, which are texts
        exec(compile(ast.Module([node], []), names["__name__"], "exec", dont_inherit=True), names)
    except ModuleNotFoundError as exc:
        names[exc.name] = EXTRAS[exc.name]


def namespace(thing: typing.Any) -> dict[str, typing.Any]:
    """What annotations of a function or class may name: its module's names, those imported for type checkers too."""
    module = sys.modules[thing.__module__]
    names = dict(vars(module))
    for node in ast.parse(inspect.getsource(module)).body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for line in node.body:
                if isinstance(line, ast.ImportFrom) and line.module == "verbs":  # the stub has more names
                    names |= {alias.asname or alias.name: stub()[0][alias.name] for alias in line.names}
                else:
                    execute(line, names)
    return names


def hints_of(thing: typing.Any, names: dict[str, typing.Any]) -> dict[str, typing.Any]:
    return typing.get_type_hints(thing, names, names)


@functools.cache
def stub() -> tuple[dict[str, typing.Any], dict[str, list[inspect.Signature]]]:
    """Names of the verbs' stub, and the signatures of its functions: of an overloaded one several."""
    names = {"__name__": verbs.__name__, "__package__": verbs.__name__}
    signatures = defaultdict(list)
    for node in ast.parse(STUB.read_text()).body:
        if isinstance(node, ast.FunctionDef):
            node.decorator_list = []
        execute(node, names)
        if isinstance(node, ast.FunctionDef):
            signatures[node.name].append(inspect.signature(names[node.name]))
    return names, dict(signatures)


def verb_signature(verb: typing.Any) -> inspect.Signature:
    """The signature of a verb, or of a constructor whose options are a record, with types for their texts, each as the
    module in which it is written means it."""
    homes = {name: kind for kind in reversed(verb.options.__mro__) for name in inspect.get_annotations(kind)}
    signature = inspect.signature(verb)
    parameters = [
        p.replace(annotation=eval(p.annotation, namespace(homes.get(p.name, verb))))
        for p in signature.parameters.values()
        if p.name != "self"
    ]
    result = eval(signature.return_annotation, namespace(verb))
    return signature.replace(parameters=parameters, return_annotation=result)
