"""Options of what echo and rcs add to single reflections: several reflections, and edges."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..base.errors import NotApplicable
from ..base.options import Options, option
from ..base.validation import count, flag, number

MOST_BOUNCES = 8
# Why forward scatter is not computed with others: what an error says after the name of the other
NOT_WITH_FORWARD = {
    "bounces": "between facets waves are those of geometrical optics, in which a body's shadow is dark already: the "
    "field that forward=True adds behind it would count that shadow twice",
    "edges": "currents of edges on a face that the wave grazes are infinite straight ahead, where forward=True is "
    "needed",
}


def refuse_forward_with(bounces: int, edges: bool) -> None:
    """NotApplicable, with the reason, for options that do not go with forward=True."""
    for name, said, value in (("edges", "edges=True", edges), ("bounces", f"bounces={bounces}", bounces > 1)):
        if value:
            raise NotApplicable(
                f"forward=True is not computed together with {said}; {NOT_WITH_FORWARD[name]}: give one of them"
            )


def _bounces(name: str, asked: object) -> int:
    bounces = count(name, asked, 1)
    if bounces > MOST_BOUNCES:
        raise ValueError(f"{name} is {bounces}; give 1 to {MOST_BOUNCES} reflections")
    return bounces


def _crease(name: str, asked: object) -> float:
    angle = number(name, asked, above=0)
    if angle > math.pi:
        raise ValueError(f"{name} is {angle:g} rad; normals differ by pi at most. Did you give degrees?")
    return angle


@dataclass(frozen=True, eq=False, kw_only=True)
class BounceOptions(Options):
    """Options of verbs that know several reflections, or refuse them by name."""

    bounces: int = option(
        1,
        "1 to 8: reflections that are followed from facet to facet, conductors and dielectrics alike; the last one is "
        "that of physical optics. Parts without coherent reflection are seen once (docs/theory/bounces.md)",
        _bounces,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class EdgeOptions(Options):
    """Options of verbs that know diffraction by edges."""

    edges: bool = option(
        False,
        "True: edges of smooth perfect conductors diffract too (docs/theory/edges.md)",
        flag,
    )
    crease: float = option(
        0.35,
        "rad: facets whose normals differ by less are parts of one smooth surface, without an edge between them",
        _crease,
    )
