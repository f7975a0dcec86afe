"""Reference pages of the site: one page for every public name, from its signature and docstring.

`pages()` makes them; docs/site/build.py writes them where Sphinx reads them. tests/house/test_reference.py fails while
a public name has no page or no example.
"""

from __future__ import annotations

import functools
import inspect
import re
import types
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from docstrings import entries, examples, markdown

import sarcl
from sarcl import verbs

# Functions and classes of public modules that serve other rooms of the package: module -> names without a place here.
INTERNAL = {
    "array_factor": {"reduced", "geometric"},
    "illumination": {"Span", "shares_of", "Lighting", "IlluminationTask", "illuminated"},
    "noise": {"Noisy", "complex_gaussian", "level_of"},
    "papers": {"open_lab"},
    "pointing": {"velocities", "rotations"},
    "shapes": {"SurfaceOptions", "ClosedOptions"},
    "stop_and_go": {"StopAndGo", "pulse_motion"},
    "wgs84": {"vertical_at", "is_earth_fixed"},
}
# Methods and properties that serve other rooms of the package: class -> names without a place here.
INTERNAL_MEMBERS = {
    "Antenna": {"error", "has_root", "limits", "packed", "ratio", "slope"},
    "ElevationModel": {"cells_at", "grid_positions", "heights_in"},
    "Illumination": {"among", "between", "level", "levels_around", "of_nothing", "share", "spans"},
    "ImageGrid": {"filled", "positions_of", "sample"},
    "Echoes": {"result_type"},
    "Scenario": {
        "default_grid_options",
        "describe_image",
        "describe_orbit",
        "focuses_in_blocks",
        "has_image",
        "needs_grid",
    },
    "Scene": {"at_frequency", "has_random_points", "kept", "on_heights", "part", "scattering_models"},
    "ToleranceUnreachable": {"placed", "restated"},
    "Trajectory": {"known_times", "picked"},
    "Bar": {"wipe"},
}
# Names of public modules that are defined elsewhere: module -> names
TAKEN_OVER = {
    "material": ("MATERIALS",),
    "illumination": ("facet_shares", "pixel_shares"),
    "shapes": ("trihedral_rcs", "dihedral_rcs", "top_hat_rcs", "luneburg_rcs"),
}
GROUPS = {
    "Verbs": "Each plans, then runs; `sarcl.plan` forecasts any of them.",
    "Functions": "What comes before and after the verbs.",
    "Types": "The parts of a problem, and results.",
    "Errors and warnings": "Each is raised before a computation begins, or holds its result.",
    "Modules": "Each is an attribute of `sarcl`.",
}


@dataclass(frozen=True)
class Name:
    """A public name: path as it is written behind `sarcl.`, its value, and the page that holds it."""

    path: str
    value: Any

    @property
    def file(self) -> str:
        """Name of its page. Modules get a prefix: radar.md and Radar.md are one file on some systems."""
        return f"module_{self.path}.md" if _is_module(self.value) else f"{self.path}.md"

    @property
    def doc(self) -> str:
        return inspect.getdoc(self.value) or ""

    @property
    def about(self) -> str:
        """First sentence of the docstring."""
        first = " ".join(self.doc.partition("\n\n")[0].split())
        return re.split(r"(?<=[.:])\s", first, maxsplit=1)[0].removesuffix("::").rstrip(":")


@functools.cache
def public_names() -> dict[str, Name]:
    """Every public name, those of public modules behind the module's: path -> Name."""
    names = [Name(name, getattr(sarcl, name)) for name in sarcl.__all__]
    names += [Name(f"{n.path}.{own}", getattr(n.value, own)) for n in names if _is_module(n.value) for own in _own(n)]
    return {name.path: name for name in names}


def members(kind: type) -> Iterator[tuple[str, str, Any]]:
    """(kind of member, name, value) of the documented methods and properties of a class, inherited ones too."""
    seen = set()
    for home in kind.__mro__:
        for name, value in vars(home).items() if home.__module__.startswith("sarcl.") else ():
            if name.startswith("_") or name in seen or not inspect.getdoc(value):
                continue
            if name in INTERNAL_MEMBERS.get(kind.__name__, ()):
                continue
            seen.add(name)
            if isinstance(value, (classmethod, staticmethod)):
                yield "classmethod" if isinstance(value, classmethod) else "staticmethod", name, value.__func__
            elif inspect.isfunction(value):
                yield "method", name, value
            elif isinstance(value, (property, functools.cached_property)):
                yield "property", name, value


def pages() -> dict[str, str]:
    """The pages: file name -> Markdown."""
    names = public_names()
    tops = [name for name in names.values() if "." not in name.path]
    made = {name.file: _page(name) for name in tops}
    groups = {title: [name for name in tops if _group(name) == title] for title in GROUPS}
    made |= {f"{_slug(title)}.md": _group_page(title, names) for title, names in groups.items()}
    return made | {"README.md": _contents(groups)}


def menu() -> list[str]:
    """Entries of the site's menu, as Sphinx writes them."""
    return [
        "Reference <reference/README>",
        *(f"{title} <reference/{_slug(title)}>" for title in GROUPS),
    ]


# ---- pages


def _page(name: Name) -> str:
    if not _is_module(name.value):
        return f"# {name.path}\n\n{_entry(name)}"
    inside = [n for n in public_names().values() if n.path.startswith(f"{name.path}.")]
    place = f"```{{py:module}} sarcl.{name.path}\n```\n\n```{{py:currentmodule}} None\n```"
    text = f"# sarcl.{name.path}\n\n{place}\n\n{_text(name.doc, {}, name.path)}\n"
    if examples(name.doc):
        text += _note()
    return text + "".join(f"\n## {n.path.partition('.')[2]}\n\n{_entry(n)}" for n in inside)


def _entry(name: Name) -> str:
    """One name: signature, docstring, and for a class its methods and properties."""
    value, note = name.value, _note() if examples(name.doc) else ""
    if inspect.isclass(value):
        kind = "exception" if issubclass(value, BaseException) else "class"
        body = _text(name.doc, _types(value), name.path) + note
        body += "".join(f"\n{_member(name, *member)}" for member in members(value))
        return _directive(kind, name.path, _signature(value, name.doc), body, colons=6)
    if callable(value):
        signature = _signature(value, name.doc)
        return _directive("function", name.path, signature, _text(name.doc, _types(value), name.path) + note, colons=6)
    return _directive("data", name.path, "", f"Keys: {', '.join(f'`{key}`' for key in value)}\n", colons=6)


def _member(owner: Name, kind: str, name: str, value: Any) -> str:
    doc, path = inspect.getdoc(value) or "", f"{owner.path}.{name}"
    if kind == "property":
        result = getattr(getattr(value, "fget", None) or value.func, "__annotations__", {}).get("return", "")
        return _directive("property", path, "", _text(doc, {}, owner.path), [f":type: {_plain(result)}"] * bool(result))
    flags = [f":{kind}:"] if kind != "method" else []
    text = _text(doc, _types(value), owner.path) + (_note() if examples(doc) else "")
    return _directive("method", path, _signature(value, doc, kind != "staticmethod"), text, flags)


def undocumented(name: Name) -> list[str]:
    """What the page of a public name leaves out: methods without an example, parameters that no docstring names.

    An example of a method is its own, or one of its class that calls it. A parameter is named by its own docstring,
    or by that of the class for a classmethod, of the module for a function.
    """
    if not inspect.isclass(name.value):
        return _unnamed(name.path, name.value, inspect.getdoc(inspect.getmodule(name.value)) or "")
    calls, lacks = "\n".join(examples(name.doc)), []
    for kind, member, value in members(name.value) if not issubclass(name.value, tuple) else ():
        if kind == "property":
            continue
        path = f"{name.path}.{member}"
        if not examples(inspect.getdoc(value) or "") and f".{member}(" not in calls:
            lacks.append(f"{path}: no example")
        lacks += _unnamed(path, value, name.doc if kind == "classmethod" else "", skip=kind != "staticmethod")
    return lacks


def _unnamed(path: str, value: Any, context: str, skip: bool = False) -> list[str]:
    """Parameters of a function that neither its docstring nor `context` names."""
    text = re.sub(r"^ *(>>>|\.\.\.) .*$", "", f"{inspect.getdoc(value)}\n{context}", flags=re.M)  # without examples
    parameters = list(inspect.signature(value).parameters.values())[skip:]
    named = [p.name for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD) and p.name[0] != "_"]
    return [f"{path}: {name} is not named" for name in named if not re.search(rf"(?<![\w.]){name}\b", text)]


def _directive(
    kind: str, path: str, signature: str, body: str, flags: list[str] | None = None, *, colons: int = 4
) -> str:
    fence = ":" * colons
    flags = [*(flags or []), *([":no-contents-entry:"] if colons == 6 else [])]  # its heading has the entry
    return "\n".join([f"{fence}{{py:{kind}}} sarcl.{path}{signature}", *flags, "", body.rstrip(), fence, ""])


def _contents(groups: dict[str, list[Name]]) -> str:
    """The first page of the reference, with the lines that every example continues."""
    text = "# Reference\n\nEvery public name, from its docstring. Lengths are in metres, times in seconds, frequencies "
    text += "in hertz, angles in radians.\nExamples continue from these lines:\n\n"
    text += "\n\n".join(f"```python\n{block}\n```" for block in preamble()) + "\n"
    for title, names in groups.items():
        text += f"\n**[{title}]({_slug(title)}.md):** {', '.join(f'[{n.path}]({n.file})' for n in names)}\n"
    return text


def _group_page(title: str, names: list[Name]) -> str:
    listed = "\n".join(f"| [{n.path}]({n.file}) | {_one_line(n)} |" for n in names)
    files = "\n".join(f"{n.path} <{n.file}>" for n in names)
    table = f"| name | what it is |\n|---|---|\n{listed}\n"
    return f"# {title}\n\n{GROUPS[title]}\n\n{table}\n```{{toctree}}\n:hidden:\n\n{files}\n```\n"


def _slug(title: str) -> str:
    return title.lower().replace(" ", "_")


def preamble() -> list[str]:
    """Lines of the docstring of sarcl that every example continues."""
    return examples(inspect.getdoc(sarcl) or "")


def _note() -> str:
    return "\n*The example continues from [these lines](README.md).*\n"


def _one_line(name: Name) -> str:
    return markdown(name.about, {}, public_name).replace("|", "\\|").strip()


def _group(name: Name) -> str:
    if _is_module(name.value):
        return "Modules"
    if inspect.isclass(name.value):
        return "Errors and warnings" if issubclass(name.value, BaseException) else "Types"
    return "Verbs" if name.path in (*verbs.HOMES, *verbs.NUMBERS) else "Functions"


# ---- signatures and text


def _text(doc: str, types: dict[str, str], path: str) -> str:
    return markdown(doc, types, functools.partial(public_name, page=path))


def _signature(value: Any, doc: str, bound: bool = False) -> str:
    """Names and defaults, and types of those parameters that the docstring does not list."""
    try:
        signature = inspect.signature(value)
    except ValueError:  # exceptions of the language have none
        return ""
    listed, shown, starred = entries(doc), [], False
    for parameter in list(signature.parameters.values())[1 if bound else 0 :]:
        if parameter.name.startswith("_"):
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not starred:
            shown.append("*")
        starred = starred or parameter.kind in (parameter.KEYWORD_ONLY, parameter.VAR_POSITIONAL)
        stars = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
        kind = "" if parameter.name in listed or stars else _plain(parameter.annotation)
        default = "" if parameter.default is parameter.empty else _default(parameter.default)
        equals = " = " if kind else "="
        shown.append(stars + parameter.name + (f": {kind}" if kind else "") + (equals + default if default else ""))
    result = _plain(signature.return_annotation)
    return f"({', '.join(shown)})" + (f" -> {result}" if result and not inspect.isclass(value) else "")


def _types(value: Any) -> dict[str, str]:
    """Type and default of each parameter, for the list of parameters."""
    try:
        parameters = inspect.signature(value).parameters.values()
    except ValueError:
        return {}
    told = {}
    for parameter in parameters:
        kind, default = _plain(parameter.annotation), parameter.default
        told[parameter.name] = f"(`{kind}`)" if kind else ""
        if default is not parameter.empty and kind:
            told[parameter.name] = f"(`{kind}`, default `{_default(default)}`)"
    return told


def _plain(annotation: Any) -> str:
    """A type as it is read: the words of a Literal without its name."""
    if annotation in (inspect.Parameter.empty, None):
        return ""
    text = getattr(annotation, "__forward_arg__", None) or (
        annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))
    )
    text = re.sub(r"Literal\[([^\[\]]*)\]", lambda match: match[1].replace(", ", " | "), text.strip("'"))
    return text.replace("'", '"').replace("NDArray[np.", "array[")


def _default(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return value.__name__ if callable(value) else repr(value)


def public_name(code: str, page: str = "") -> str | None:
    """The public name that a text is, with `sarcl.` before it or not; members of the class or module of `page` too."""
    bare = code.partition("(")[0].removeprefix("sarcl.")
    for path in (bare, f"{page.partition('.')[0]}.{bare}", f"{page}.{bare}"):
        if path in public_names() and path != page:
            return path
        home, _, name = path.rpartition(".")
        owner = public_names().get(home)
        if owner and inspect.isclass(owner.value) and name in {member for _, member, _ in members(owner.value)}:
            return path
    return None


def _is_module(value: Any) -> bool:
    return isinstance(value, types.ModuleType)


def _own(module: Name) -> list[str]:
    """Functions and classes that a public module defines, and those that it takes over."""
    found = {
        name
        for name, value in vars(module.value).items()
        if not name.startswith("_")
        and (inspect.isfunction(value) or inspect.isclass(value))
        and value.__module__.startswith(module.value.__name__)
        and (name not in sarcl.__all__ or value is not getattr(sarcl, name))
    }
    found -= INTERNAL.get(module.path, set())
    return sorted(found | set(TAKEN_OVER.get(module.path, ())))
