"""Objects that installed packages add to sarcl by Python's entry points: docs/developers/extensions.md.

An entry point is looked up by its name, when that name is used and sarcl has none such of its own. Packages therefore
cost nothing before, and a package that cannot be loaded breaks nothing that does not use it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Group = Literal["scattering", "formats", "grids", "verbs"]  # of the groups sarcl.scattering and so on


def names(group: Group) -> list[str]:
    """Names that installed packages add to a group, sorted; none of them is loaded."""
    return sorted({point.name for point in _points(group)})


def added(group: Group, name: str) -> object | None:
    """The object that an installed package adds to a group under a name; None: no package does.

    ImportError, with the package and its entry point, where several packages add the name, or it cannot be loaded.
    """
    points = [point for point in _points(group) if point.name == name]
    if not points:
        return None
    if len(points) > 1:
        texts = " and ".join(sorted(map(_text, points)))
        raise ImportError(f"{name!r} of the group sarcl.{group} is ambiguous: {texts}; keep one of these packages")
    try:
        return points[0].load()
    except Exception as exc:
        text = f"{_text(points[0])} cannot be loaded: {type(exc).__name__}: {exc}"
        raise ImportError(f"{text}; update or uninstall that package") from exc


def _points(group: Group) -> tuple[EntryPoint, ...]:
    entry_points = import_module("importlib.metadata").entry_points  # takes longer than the rest of `import sarcl`
    return tuple(entry_points(group=f"sarcl.{group}"))


def _text(point: EntryPoint) -> str:
    package = f"{point.dist.name} {point.dist.version}" if point.dist else "an unknown package"
    return f"entry point '{point.name} = {point.value}' of {package}"
