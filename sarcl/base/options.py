"""Options of a verb: a frozen record with the type, default, check and documentation of each.

A verb's signature and help (sarcl/base/verb.py), its stub for type checkers, its section in scenario files, its flags
on the command line and its table in the guide are made from its record.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields, replace
from typing import Any, ClassVar

Check = Callable[..., object]  # check(name, value)
_KEY = "option"  # of a field's metadata


@dataclass(frozen=True)
class Option:
    """Documentation of an option; check(name, value) returns the value to keep, or raises.

    in_files  whether scenario files have it as a key: not what belongs to one run, such as a device
    """

    doc: str
    check: Check | None
    in_files: bool


def option(default: object, doc: str = "", check: Check | None = None, *, in_files: bool = True) -> Any:
    """The field of an option. Where the record inherits the option, `doc` and `check` may be left out: those of the
    nearest base count. in_files: whether scenario files may set it.

    >>> sarcl.option(4, "number of parts of the track").default
    4
    """
    return field(default=default, metadata={_KEY: Option(inspect.cleandoc(doc), check, in_files)})


def or_none(check: Check) -> Check:
    """The check of an option that may be None too."""
    return lambda name, value: None if value is None else check(name, value)


@dataclass(frozen=True, eq=False, kw_only=True)
class Options:
    """Base class of records of options: checks every field, in their order, when one is made.

    absent  options of other verbs that this one has not, and why: what an error says

    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, eq=False, kw_only=True)
    ... class LookOptions(sarcl.Options):
    ...     looks: int = sarcl.option(4, "number of parts of the track")
    >>> LookOptions().looks
    4
    """

    absent: ClassVar[Mapping[str, str]] = {}

    def __post_init__(self) -> None:
        for name, (_, details) in described(type(self)).items():
            if details.check:
                object.__setattr__(self, name, details.check(name, getattr(self, name)))


_DESCRIBED: dict[type[Options], dict[str, tuple[Field[Any], Option]]] = {}


def described(record: type[Options]) -> dict[str, tuple[Field[Any], Option]]:
    """Field and Option of every option of a record, in the order of its signature: its own ones, then those that it
    inherits. TypeError for an option that nothing documents."""
    if record not in _DESCRIBED:  # a call of a verb makes several records
        places = {f.name: _declared(record, f) for f in fields(record)}
        ordered = sorted(fields(record), key=lambda f: places[f.name][0])  # keeps the order of equal ones
        _DESCRIBED[record] = {f.name: (f, places[f.name][1]) for f in ordered}
    return _DESCRIBED[record]


def _declared(record: type[Options], own: Field[Any]) -> tuple[tuple[int, int], Option]:
    """Where an option is documented (steps up a record's bases, place in that one), and that Option, with the nearest
    check that any of them has."""
    documented: tuple[tuple[int, int], Option] | None = None
    for depth, kind in enumerate(record.__mro__):
        names = list(inspect.get_annotations(kind))
        if own.name not in names:
            continue
        details: Option = vars(kind)["__dataclass_fields__"][own.name].metadata.get(_KEY, Option("", None, True))
        if documented is None and details.doc:
            documented = (depth, names.index(own.name)), details
        if documented and details.check:
            place, first = documented
            return place, first if first.check else replace(first, check=details.check)
    if documented is None:
        raise TypeError(f"{record.__name__}.{own.name} has no documentation; declare it by option(default, doc)")
    return documented
