"""Options of echo."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from ..base.options import option
from ..base.validation import choice, flag
from ..blocks.block_options import BlockOptions
from ..numerics import plan
from .reflection_options import EdgeOptions
from .scene_options import FORWARD, SceneOptions

Skip = Literal[
    "zero reflectivity", "facing away", "range window", "out of beam", "equal channels", "interpolated channels"
]
METHODS = ("auto", "direct", "factorized")
CHANNELS = ("simultaneous", "separated")
RECEIVE = ("reference", "own", "all")
SKIPS = ("zero reflectivity", "facing away", "range window", "out of beam", "equal channels", "interpolated channels")


@dataclass(frozen=True, eq=False, kw_only=True)
class EchoOptions(EdgeOptions, SceneOptions, BlockOptions):
    """Options of `echo`."""

    method: Literal["auto", "direct", "factorized"] = option(
        "auto",
        '"direct": every pair of scatterer and pulse that is not skipped; "factorized": scatterers are spread at few '
        "antenna positions about small cells, which are joined level by level; what changes too fast along the "
        'track directly; "auto": the cheapest',
        lambda name, value: choice(name, value, METHODS),
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
