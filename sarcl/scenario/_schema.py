"""Tables and keys that a scenario may hold: those of the Python calls that they describe.

A section of a scenario ([waveform.chirp], [[scene.points]], [echo]) describes one call. Its keys are the call's
arguments, read from the signature, so that file format and library always agree.
"""

from __future__ import annotations

import datetime
import functools
import inspect
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from operator import attrgetter
from typing import Any

from ..base.errors import ToleranceMissed, ToleranceUnreachable
from ..base.options import described
from ..base.text import unknown
from ..io import entry_points

Path = tuple[str | int, ...]
Call = Callable[..., Any]

# Arguments that are called `file` in a scenario: a mesh or an elevation model is always a file there.
RENAMED = {"mesh": "file", "path": "file", "dem": "file"}
# Arguments that are no keys: other sections describe them; a material is named by its table.
NOT_KEYS = {"self", "track", "raw", "grid", "name"}
ON = "on"  # key of a part of the scene: the part stands on the parts before it
_TYPES = {
    "float": ("a number", lambda v: isinstance(v, (int, float)) and not isinstance(v, bool)),
    "int": (
        "a whole number",
        lambda v: not isinstance(v, bool) and isinstance(v, (int, float)) and float(v).is_integer(),
    ),
    "str": ("a string", lambda v: isinstance(v, str)),
    "Date": ('a date in UTC, such as "2024-03-01T05:00:12.5"', lambda v: isinstance(v, (str, datetime.date))),
    "bool": ("true or false", lambda v: isinstance(v, bool)),
}


_ON = inspect.Parameter(ON, inspect.Parameter.KEYWORD_ONLY, default=None)


ECHOES = ("echo", "spectral_echo", "fullwave_echo")  # sections for echoes, and for images: one of each at most
IMAGES = ("backproject", "polar_format", "range_doppler")


def _kinds(place: str, names: str) -> dict[str, str]:
    return {name: place + name for name in names.split()}


_TRACK = {**_kinds("model.trajectory:Trajectory.", "line circle"), "": "model.trajectory:Trajectory"}
_POINTING = _kinds("model.pointing:", "spotlight stripmap fixed")
_ANTENNA = _kinds("model.antenna:Antenna.", "isotropic rectangular gaussian table")
# section -> name of the table -> the call that it describes, as file and name; "" is the section's own table
_CALLS: dict[str, dict[str, str]] = {
    "waveform": _kinds("model.waveform:Waveform.", "chirp tone sampled"),
    "orbit": {**_kinds("model.orbit:Orbit.", "kepler tle states"), "": "model.orbit:Orbit.read"},
    "trajectory": {**_TRACK, "orbit": "model.orbit:Orbit.trajectory"},
    "pointing": _POINTING,
    "receiver": _TRACK,
    "receiver_pointing": _POINTING,
    "antenna": _ANTENNA,
    "receiver_antenna": _ANTENNA,
    "array": {
        **_kinds("model.antenna_array:AntennaArray.", "linear planar costas"),
        "": "model.antenna_array:AntennaArray",
    },
    "radar": {"": "model.radar:Radar"},
    "materials": {"": "scene.material:Material"},
    "place": {"": "earth.place:Place.above"},
    "scene": _kinds("scene.scene:Scene.", "points from_mesh from_heights from_dem facets"),  # and all shapes
    "grid": _kinds("model.image_grid:ImageGrid.", "plane points on_terrain on_map zero_doppler"),
    **{verb: {"": f"verbs:{verb}"} for verb in ECHOES},
    "noise": {"": "effects.noise:add_noise"},
    **{verb: {"": f"verbs:{verb}"} for verb in IMAGES},
}
SECTIONS = tuple(_CALLS)


def calls(section: str, kinds: Collection[str] = ()) -> dict[str, Call]:
    """The calls that a section can describe, by the name of the table; "" is the section's own table.

    kinds  names of the tables that a file has: a grid may be one of an installed package

    Each section imports only the folders that it needs: the verbs load pyopencl.
    """
    known: dict[str, Call] = {}
    for kind, place in _CALLS[section].items():
        file, _, name = place.partition(":")
        known[kind] = attrgetter(name)(import_module(f"..{file}", __package__))
    if section == "scene":
        from ..scene import shapes

        known |= {shape.__name__: shape for shape in (*shapes.SHAPES, shapes.luneburg)}
    if section == "grid":
        for kind in kinds:
            if kind not in known and callable(source := entry_points.added("grids", kind)):
                extension = functools.partial(
                    import_module("..model.image_grid", __package__).ImageGrid.extension, kind
                )
                known[kind] = functools.wraps(source)(extension)  # with the signature of the package's
    return known


def parameters(call: Call) -> dict[str, inspect.Parameter]:
    """Keys of the table that describes `call`: of a verb the options that its record has for files."""
    signature = inspect.signature(call).parameters
    known = {n: p for n, p in signature.items() if n not in NOT_KEYS}
    if hasattr(call, "options"):
        known = {n: signature[n] for n, (_, details) in described(call.options).items() if details.in_files}
    return {RENAMED.get(n, n): p.replace(default=None) if may_be_left_out(p) else p for n, p in known.items()}


def may_be_left_out(parameter: inspect.Parameter) -> bool:
    """Whether an argument without a default may be None, which TOML cannot say: the times of a Trajectory."""
    return parameter.default is inspect.Parameter.empty and str(parameter.annotation).endswith("| None")


@dataclass(frozen=True)
class Where:
    """The file of a scenario and the line of each key; no lines for a scenario that was made in Python."""

    name: str = "scenario"
    lines: Mapping[Path, int] = field(default_factory=dict)

    def text(self, path: Path, key: str | None = None) -> str:
        """ "FILE.toml:12: [waveform.chirp]", with the line of `key` where that is known."""
        line = self.lines.get((*path, key)) if key else None
        at = path
        while line is None and at:
            line, at = self.lines.get(at), at[:-1]
        name = ".".join(str(p) for p in path if isinstance(p, str))
        many = path and isinstance(path[-1], int)
        table = f" [[{name}]]" if many else f" [{name}]" if name else ""
        if many and line is None:
            table += f" number {path[-1] + 1}"  # type: ignore[operator]
        return f"{self.name}:{line}:{table}" if line else f"{self.name}:{table}"

    @contextmanager
    def blame(self, path: Path, keys: Mapping[str, Any], always: bool = True) -> Iterator[None]:
        """Put file, line and table in front of the message when a call refuses its arguments.

        The line is that of the first key that the message names. Without `always`, only messages that name a key of
        the table are changed.
        """
        try:
            yield
        except (ValueError, TypeError, FileNotFoundError, MemoryError) as exc:
            words = re.findall(r"\w+", str(exc))
            # messages of from_mesh name the argument mesh, which is the key file
            named = next((RENAMED.get(w, w) for w in words if RENAMED.get(w, w) in keys), None)
            if named is None and not always:
                raise
            if isinstance(exc, ToleranceMissed):  # the exception holds the finished result
                raise
            if isinstance(exc, ToleranceUnreachable):
                raise exc.placed(self.text(path, named)) from exc
            kind = ValueError if isinstance(exc, TypeError) else type(exc)
            raise kind(f"{self.text(path, named)} {exc}") from exc


def check_section(section: str, table: object, where: Where) -> None:
    """Check keys and types of a section. ValueError names the line of an unknown key, a missing key or a wrong type."""
    known = calls(section, table if isinstance(table, Mapping) else ())
    if section == "materials" and isinstance(table, Mapping):
        for name, part in table.items():
            if not isinstance(part, Mapping):
                raise ValueError(f"{where.text((section,), name)} {name} is {_shown(part)}, wanted a table")
            _check_table((section, name), part, known[""], where)
        return
    if not isinstance(table, Mapping):
        raise ValueError(f"{where.text((), section)} {section} is {_shown(table)}, wanted a table")
    if set(known) == {""} or ("" in known and not any(_is_table(v) for v in table.values())):
        _check_table((section,), table, known[""], where, [k for k in known if k])
        return
    kinds = [k for k in known if k]
    for kind in table:
        if kind not in kinds:
            raise ValueError(f"{where.text((section,), kind)} {unknown(kind, kinds, 'table')}")
    if section == "scene":
        if not table:
            raise ValueError(f"{where.text((section,))} is empty; add a [[scene.points]] or [[scene.from_mesh]] table")
    elif len(table) != 1:
        given = " and ".join(table) or "none"
        raise ValueError(f"{where.text((section,))} wants exactly one of the tables {', '.join(kinds)}, got {given}")
    for kind, value in table.items():
        for path, part in tables_of(section, kind, value):
            if not isinstance(part, Mapping):
                raise ValueError(f"{where.text((section,), kind)} {kind} is {_shown(part)}, wanted a table")
            stands = section == "scene" and kind not in ("from_heights", "from_dem")
            _check_table(path, part, known[kind], where, stands=stands)


def check_choices(given: Collection[str], where: Where) -> None:
    """Refuse sections that exclude one another, and an orbit without its pulses."""
    for sections, what in ((ECHOES, "echoes"), (IMAGES, "image")):
        both = [s for s in sections if s in given]
        if len(both) > 1:
            raise ValueError(f"{where.text((both[1],))} [{both[0]}] makes the {what} too; keep one of them")
    if "grid" in given and "range_doppler" in given:
        raise ValueError(
            f"{where.text(('grid',))} range_doppler makes a grid of its own, by zero-Doppler time and slant range; "
            "leave [grid] out, and say times, ranges and spacing in [range_doppler]"
        )


def tables_of(section: str, kind: str, value: object) -> list[tuple[Path, Any]]:
    """Each table of a kind with its path: a scene may hold several tables of one kind."""
    if section == "scene" and isinstance(value, list):
        return [((section, kind, i), part) for i, part in enumerate(value)]
    return [((section, kind), value)]


def _check_table(
    path: Path, table: Mapping[str, Any], call: Call, where: Where, kinds: Collection[str] = (), stands: bool = False
) -> None:
    """kinds: names of tables beside this one;  stands: it describes a part of the scene that may stand on others."""
    known = {**parameters(call), **({ON: _ON} if stands else {})}
    for key, value in table.items():
        if key in kinds:
            raise ValueError(f"{where.text(path, key)} {key} is {_shown(value)}, wanted a table")
        if key not in known:
            raise ValueError(f"{where.text(path, key)} {unknown(key, [*known, *kinds], 'key')}")
        if isinstance(value, Mapping) and "ElevationModel" in str(known[key].annotation):
            from ..earth.elevation import ElevationModel

            _check_table((*path, key), value, ElevationModel.read, where)
            continue
        type_text = _wanted(known[key], value, key)
        if type_text:
            raise ValueError(f"{where.text(path, key)} {key} is {_shown(value)}, wanted {type_text}")
    for key, parameter in known.items():
        if parameter.default is inspect.Parameter.empty and key not in table:
            needed = [k for k, p in known.items() if p.default is inspect.Parameter.empty]
            raise ValueError(f"{where.text(path)} lacks the key {key!r}; it needs {', '.join(needed)}")


def _wanted(parameter: inspect.Parameter, value: object, key: str) -> str:
    """The type that the annotation asks for, in words, where `value` has another; else ""."""
    if key == RENAMED["mesh"]:
        names = {"str"}
    else:
        names = {n.strip() for n in str(parameter.annotation).split("|")} - {"None"}
        names = {"str" if n.startswith("Literal[") else n for n in names}  # the call checks which words are allowed
    if names and names <= set(_TYPES):
        return "" if any(_TYPES[n][1](value) for n in names) else " or ".join(_TYPES[n][0] for n in sorted(names))
    if re.search("Mapping|MapApertureOptions", str(parameter.annotation)) and isinstance(value, Mapping):
        return ""
    kinds = (bool, int, float, str, list) + ((datetime.date,) if "Date" in names else ())
    good = isinstance(value, kinds) and not _is_table(value)
    return "" if good else "a number, a string, true, false or an array"


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, list) and any(isinstance(v, Mapping) for v in value))


def _shown(value: object) -> str:
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = repr(value) if isinstance(value, (int, float, str, list)) else str(value)
    kind = " (a string)" if isinstance(value, str) else " (an array)" if isinstance(value, list) else ""
    return (text if len(text) <= 60 else text[:57] + "...") + kind
