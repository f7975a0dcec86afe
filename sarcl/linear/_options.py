"""Options of Echoes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from ..base import validation
from ..base.options import Options, option
from ..imaging.antenna_beam import AntennaBeam
from ..imaging.choose_method import METHODS
from ..imaging.focusing_task import BeamCone
from ..model.waveform import Waveform
from ..numerics.windows import Window
from ..opencl.device import DeviceChoice


@dataclass(frozen=True, eq=False, kw_only=True)
class EchoesOptions(Options):
    """Options of `Echoes`; those without a check are checked where they are used."""

    tolerance: float = option(
        1e-3,
        "bound of the L2 error of A @ x, for amplitudes of random phases or equal ones, and of A.H @ y, for samples "
        "whose energy lies in the ranges of the points; relative as in `sarcl.backproject`",
        lambda name, value: validation.tolerance(value),
    )
    exact: bool = option(
        False,
        "True: A.H is the adjoint of the very A that is computed, to rounding: both in float64, by the same "
        "interpolation weights and phases. False: each direction is the cheapest plan of `echo` or `backproject`",
        validation.flag,
    )
    method: Literal["auto", "direct", "factorized"] = option(
        "auto",
        '"auto", "direct" or "factorized", as of `sarcl.echo` and `sarcl.backproject`; exact=True is direct',
        lambda name, value: validation.choice(name, value, METHODS),
    )
    waveform: Waveform | None = option(None, "W is its matched spectrum; None: that of like.waveform, or 1")
    weights: ArrayLike | None = option(None, "w_p, one per row (n_rows,)")
    antenna: AntennaBeam | None = option(
        None, "g_p: an Antenna, or (Antenna, aim), as beam= of `sarcl.backproject`: gains at the centre of the band"
    )
    beam: BeamCone | None = option(
        None, "the cone in which v_p is 1: its angle, rad, or (angle, direction), as of `sarcl.backproject`"
    )
    window: Window | None = option(None, "over samples and rows, as of `sarcl.backproject`")
    wrap: bool = option(False, "False: v_p is 1 for |tau - tau_ref| <= 1/(2 frequency_step) alone", validation.flag)
    device: DeviceChoice | None = option(None, "see `sarcl.devices`")
    max_bytes: float | None = option(None, "memory for blocks, as of `sarcl.backproject`")
