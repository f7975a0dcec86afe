"""Options that the verbs which compute echoes of points and facets share: their records contain these."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..base.options import option, or_none
from ..base.types import PathLike
from ..base.validation import array as numbers
from ..base.validation import choice, count, direction, flag, instance, number
from ..model.antenna import Antenna
from ..model.antenna_array import AntennaArray
from ..model.radar import Radar
from ..model.trajectory import Trajectory
from ..numerics.run_options import RunOptions
from ..scattering.facets import POLARIZATIONS
from .echo_output import check_name

Polarization = Literal["HH", "HV", "VH", "VV"]


def _polarizations(_: str, asked: Any) -> tuple[str, ...]:
    """Names in the order of a pulse's rows; ValueError for unknown, repeated or none."""
    if isinstance(asked, str):
        asked = POLARIZATIONS if asked == "all" else (asked,)
    names = tuple(asked) if isinstance(asked, Sequence) else ()
    for name in names:
        choice("polarization", name, POLARIZATIONS)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"polarization is {asked!r:.60}; give at least one, and each once")
    return names


def _shadows(name: str, asked: Any) -> bool:
    if isinstance(asked, str) and asked == "embree":
        raise ValueError(
            "shadows is 'embree'; rays of Embree were taken out, since sarcl's own became faster and exact: give True"
        )
    return flag(name, asked)


def _max_edge(name: str, asked: Any) -> float | str | None:
    if isinstance(asked, str):
        return choice(name, asked, ("auto",))
    return None if asked is None else number(name, asked, above=0)


def antenna_array(name: str, value: Any) -> AntennaArray:
    """`value`, an AntennaArray; TypeError for anything else."""
    instance(name, value, AntennaArray)
    return value


def _file(_: str, out: Any) -> Any:
    check_name(out)
    return out


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneOptions(RunOptions):
    """Options of every verb that computes echoes of points and facets."""

    receiver: Trajectory | None = option(
        None,
        "a track of as many pulses, default the transmitter's; its positions count as they are given",
        in_files=False,
    )
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = option(
        "HH",
        '"HH", "HV", "VH" or "VV" (first received, then sent), a sequence of these, or "all": one row per pulse for '
        "each, pulse by pulse. Points keep the polarisation: they have no echo in HV and VH",
        _polarizations,
    )
    vertical: ArrayLike | None = option(
        None,
        "(3,), direction: H is perpendicular to it, V in a plane with it; default z, or in Earth-centred coordinates "
        "the ellipsoid's normal at the scene's centre",
        or_none(direction),
    )
    range_window: ArrayLike | None = option(
        None,
        "(near, far) m about the reference, default the smallest that holds the scene plus 10 %; scatterers outside it "
        "are left out, row by row",
    )
    reference: ArrayLike | None = option(
        None,
        "point of zero phase, m (3,), default the centre of the scene's box",
        or_none(lambda name, value: numbers(name, value, np.float64, (3,))),
    )
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
        "True: of every facet only the part counts that both antennas see at each pulse (docs/theory/shadows.md; points "
        "are always seen)",
        _shadows,
    )
    seed: int = option(
        0,
        "of the facets' random heights (scene.roughness); the same for any device and block size",
        lambda name, value: count(name, value, 0),
    )
    skip: bool | Collection[Any] = option(True, "True, False or a set of reasons to leave out contributions")
    compressed: bool = option(True, "False keeps the pulse's own spectrum (see `sarcl.compress`)", flag)
    max_edge: float | Literal["auto"] | None = option(
        "auto",
        'facets are cut until no edge is longer, m; "auto": as finely as the tolerance needs, rough ones at least to '
        "half a resolution cell; None: they are not cut",
        _max_edge,
    )
    max_bytes: float | None = option(
        None,
        "memory for blocks, default 1 GiB on CPUs, half the memory of a GPU; facets are cut into as many as it holds "
        "(512 bytes each; at least 256 MiB), by default a quarter of the machine's memory",
    )
    out: PathLike | None = option(
        None,
        "an HDF5 file of sarcl's (.h5): samples are written there pulse after pulse, and read when needed",
        _file,
        in_files=False,
    )
    check: bool | None = option(
        None,
        "recompute 256 random samples exactly, fewer above 20 000 facets; None: where that costs less than 2 %",
        or_none(flag),
    )
