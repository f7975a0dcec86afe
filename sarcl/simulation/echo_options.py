"""Options of echo."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from ..base.options import option
from ..base.validation import choice, flag, number
from ..blocks.block_options import BlockOptions
from ..numerics import plan
from .scene_options import FORWARD, SceneOptions

Skip = Literal[
    "zero reflectivity", "facing away", "range window", "out of beam", "equal channels", "interpolated channels"
]
METHODS = ("auto", "direct", "factorized")
CHANNELS = ("simultaneous", "separated")
RECEIVE = ("reference", "own", "all")
SKIPS = ("zero reflectivity", "facing away", "range window", "out of beam", "equal channels", "interpolated channels")


def _crease(name: str, asked: object) -> float:
    angle = number(name, asked, above=0)
    if angle > math.pi:
        raise ValueError(f"{name} is {angle:g} rad; normals differ by pi at most. Did you give degrees?")
    return angle


@dataclass(frozen=True, eq=False, kw_only=True)
class EchoOptions(SceneOptions, BlockOptions):
    """Options of `echo`."""

    method: Literal["auto", "direct", "factorized"] = option(
        "auto",
        '"direct": every pair of scatterer and pulse that is not skipped; "factorized": scatterers are spread at few '
        "antenna positions about small cells, which are joined level by level; what changes too fast along the "
        'track directly; "auto": the cheapest',
        lambda name, value: choice(name, value, METHODS),
    )
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
    forward: bool = option(False, FORWARD + ". For coherent surfaces, and not with an array; sums are in float64", flag)
    channels: Literal["simultaneous", "separated"] = option(
        "simultaneous",
        '"simultaneous": all channels of the array are added up, each after its own matched filter, a row for every '
        'pulse and receiver; "separated": a row of its own for every pulse, sending element and receiver',
        lambda name, value: choice(name, value, CHANNELS),
    )
    receive: Literal["reference", "own", "all"] = option(
        "reference",
        '"reference": at the array\'s reference point; "own": every element receives its own channel ("separated" '
        'only); "all": every element receives all',
        lambda name, value: choice(name, value, RECEIVE),
    )
    skip: bool | Collection[Skip] = option(
        True,
        'True, False or a set of reasons: "zero reflectivity", "facing away", "range window", "out of beam", "equal '
        'channels" (of one carrier and position), "interpolated channels" (from echoes at a few positions of an array '
        "to all its elements)",
        lambda name, value: plan.skips(value, SKIPS),
    )
