"""Options of rcs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from ...base.options import option
from ...base.validation import flag
from ...numerics.run_options import RunOptions
from ..reflection_options import BounceOptions, EdgeOptions
from ..scene_options import FORWARD
from ..track_options import Polarization, polarizations


def _polarization(name: str, value: object) -> str | tuple[str, ...]:
    """`value`, one name or a tuple of them: a single name adds no axis to the result."""
    names = polarizations(name, value)
    return names[0] if isinstance(value, str) and value != "all" else names


@dataclass(frozen=True, eq=False, kw_only=True)
class RcsOptions(BounceOptions, EdgeOptions, RunOptions):
    """Options of `rcs`."""

    receiver: tuple[ArrayLike, ArrayLike] | None = option(
        None, "(azimuth, elevation) of the receiver, rad, which broadcast with the transmitter's; None: the same"
    )
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = option(
        "HH",
        '"HH", "HV", "VH" or "VV" (first received, then sent); a sequence of these, or "all", adds an axis to the '
        "result. H is horizontal, V in a plane with z. Points keep the polarisation: they have no echo in HV and VH",
        _polarization,
    )
    forward: bool = option(False, FORWARD, flag)
    shadows: bool = option(
        True, "True: of every facet only the part counts that both directions see; points are always seen", flag
    )
    check: bool | None = option(
        None,
        "True: recompute 16 random values exactly, and raise ToleranceMissed where they differ by more. Of single "
        "reflections: refused with bounces and edges",
    )
