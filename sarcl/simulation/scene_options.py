"""Options that the verbs which compute echoes of points and facets share, beside those of every track."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal

from ..base.options import option, or_none
from ..base.validation import choice, count, flag, instance, number
from ..model.antenna import Antenna
from ..model.antenna_array import AntennaArray
from ..model.radar import Radar
from .reflection_options import BounceOptions
from .track_options import TrackOptions

FORWARD = (
    "True: what the transmitter lights radiates to all sides, so that a receiver behind a body gets the field of its "
    "shadow too; other bodies still block both ways. False: to a receiver in front of a facet alone, which holds for "
    "bistatic angles up to about 90 deg. Of no effect for one antenna"
)


def _shadows(name: str, asked: object) -> bool:
    if isinstance(asked, str) and asked == "embree":
        raise ValueError(
            "shadows is 'embree'; rays of Embree were taken out, since sarcl's own became faster and exact: give True"
        )
    return flag(name, asked)


def _max_edge(name: str, asked: object) -> float | str | None:
    if isinstance(asked, str):
        return choice(name, asked, ("auto",))
    return None if asked is None else number(name, asked, above=0)


def antenna_array(name: str, value: Any) -> AntennaArray:
    """`value`, an AntennaArray; TypeError for anything else."""
    instance(name, value, AntennaArray)
    return value


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneOptions(BounceOptions, TrackOptions):
    """Options of every verb that computes echoes of points and facets."""

    array: AntennaArray | None = option(
        None,
        "sarcl.AntennaArray at the transmitter, along the axes of the track's attitude where it has one: element n "
        "sends the waveform shifted by its offset, Hz; None: one element",
        or_none(antenna_array),
        in_files=False,
    )
    antenna: Antenna | tuple[Antenna, Antenna] | None = option(
        None,
        "sarcl.Antenna, or (transmitting, receiving), aimed by the tracks' attitude (sarcl.pointing); None: 1",
        in_files=False,
    )
    radar: Radar | None = option(
        None,
        "sarcl.Radar: amplitudes fall with range, samples are in sqrt(W); None: |sample|^2 = RCS at any range",
        in_files=False,
    )
    shadows: bool = option(
        True,
        "True: of every facet only the part counts that both antennas see at each pulse (docs/theory/shadows.md; "
        "points are always seen)",
        _shadows,
    )
    seed: int = option(
        0,
        "of the facets' random heights (scene.roughness); the same for any device and block size",
        lambda name, value: count(name, value, 0),
    )
    skip: bool | Collection[Any] = option(True, "True, False or a set of reasons to leave out contributions")
    max_edge: float | Literal["auto"] | None = option(
        "auto",
        'facets are cut until no edge is longer, m; "auto": as finely as the tolerance needs, rough ones at least to '
        "half a resolution cell; None: they are not cut",
        _max_edge,
    )
    max_bytes: float | None = option(
        None,
        "memory for blocks, default 1 GiB on CPUs, half the memory of a GPU; facets are cut into as many as it holds "
        "(512 bytes each; at least 256 MiB), by default a quarter of the machine's memory; "
        "rough facets that a device cuts take 180 MB, however many there are",
    )
    check: bool | None = option(
        None,
        "recompute 256 random samples exactly, fewer above 20 000 facets; None: where that costs less than 2 %, not "
        "with bounces, edges and thin sheets",
    )
