"""State vectors of orbit files in XML: Sentinel-1 orbits (EOF) and annotations, and orbits as ISCE3 writes them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from .xml import parser

_SPACE = re.compile(r"\{[^}]*\}")


@dataclass(frozen=True)
class _Layout:
    """Tags of a state vector in a file, and in it of the time and of components: axes after these beginnings.

    frame  the tag, in the state or in the head of the file, of the frame's name, where the file gives one
    """

    name: str
    state: str
    time: str
    axes: str
    position: str
    velocity: str
    frame: str


# By the tag of the root
LAYOUTS = {
    "Earth_Explorer_File": _Layout("an Earth Explorer orbit file (EOF)", "OSV", "UTC", "XYZ", "", "V", "Ref_Frame"),
    "product": _Layout("a Sentinel-1 annotation", "orbit", "time", "xyz", "position/", "velocity/", "frame"),
    "orbitEphemeris": _Layout("an orbit of ISCE3", "orbitStateVector", "utc", "xyz", "", "v", "frame"),
}


def load(path: Path) -> tuple[np.datetime64, np.ndarray, np.ndarray, np.ndarray]:
    """Epoch (UTC of the first state), seconds since then (n,), positions, m, and velocities, m/s (n, 3), Earth-fixed.

    FileNotFoundError where there is no file; ValueError where it is not XML, of an unknown layout, has no state vectors
    or fewer than it announces, or states in another frame or other units.
    """
    name = f"orbit file {path.name!r}"
    try:
        root = parser.parsed(path, "orbit file")
    except parser.Refused as exc:
        raise ValueError(f"{name} {exc}: it is damaged, or no orbit file; copy it again") from None
    for element in root.iter():
        element.tag = _SPACE.sub("", element.tag) if isinstance(element.tag, str) else ""
    layout = LAYOUTS.get(root.tag)
    if layout is None:
        readable = ", ".join(f"{one.name} (<{tag}>)" for tag, one in LAYOUTS.items())
        raise ValueError(f"{name} begins with <{root.tag}>; orbits are read from {readable}")
    states = list(root.iter(layout.state))
    if not states:
        raise ValueError(f"{name} is {layout.name} without state vectors (<{layout.state}>); give one that has them")
    for heading in root.iter(f"List_of_{layout.state}s"):
        count = heading.get("count", "")
        if count.isdigit() and count.lstrip("0") != str(len(states)):
            raise ValueError(
                f"{name} announces {count:.20} state vectors and has {len(states)}: it was cut off; copy it again"
            )
    frames = [f for state in states for f in state.iter(layout.frame)] or [*root.iter(layout.frame)]
    for frame in frames:
        if (frame.text or "").strip().upper().replace(" ", "_") != "EARTH_FIXED":
            raise ValueError(f"{name} has states in the frame {frame.text!r}; give Earth-fixed ones")
    dates = np.array([_date(name, layout, state) for state in states])
    seconds = (dates - dates[0]) / np.timedelta64(1, "ns") * 1e-9
    positions, velocities = (
        np.array([[_number(name, state, beginning + axis) for axis in layout.axes] for state in states])
        for beginning in (layout.position, layout.velocity)
    )
    return dates[0], seconds, positions, velocities


def _text(name: str, state: ElementTree.Element, tag: str) -> str:
    text = state.findtext(tag)
    if text is None:
        raise ValueError(f"{name} has a state vector without <{tag}>: it is damaged")
    return str(text).strip()


def _date(name: str, layout: _Layout, state: ElementTree.Element) -> np.datetime64:
    text = _text(name, state, layout.time).removeprefix("UTC=").removesuffix("Z")
    if not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?", text):
        raise ValueError(f"{name} has the time {text!r}; wanted UTC such as 2021-12-23T05:10:21.029300")
    try:
        return np.datetime64(text, "ns")
    except ValueError as exc:
        why = (
            "is within a leap second; keep the states before it, or those after it"
            if text[17:19] == "60"
            else f"does not exist ({exc})"
        )
        raise ValueError(f"{name} has the time {text!r}, which {why}") from None


def _number(name: str, state: ElementTree.Element, tag: str) -> float:
    text = _text(name, state, tag)
    unit = next(state.iterfind(tag)).get("unit")
    if unit not in (None, "m", "m/s"):
        raise ValueError(f"{name} has <{tag}> in {unit!r}; wanted m and m/s")
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", text):
        raise ValueError(f"{name} has <{tag}> {text!r}; wanted a number")
    return float(text)
