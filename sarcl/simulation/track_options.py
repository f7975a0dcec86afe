"""Options that the verbs which make echoes along a track share: their records contain these."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..base import wgs84
from ..base.options import option, or_none
from ..base.types import PathLike
from ..base.validation import array, choice, direction, flag
from ..model.trajectory import Trajectory
from ..numerics.run_options import RunOptions
from ..scattering.facets import POLARIZATIONS

Polarization = Literal["HH", "HV", "VH", "VV"]


def polarizations(_: str, asked: object) -> tuple[str, ...]:
    """Names in the order of a pulse's rows; ValueError for unknown, repeated or none."""
    if isinstance(asked, str):
        asked = POLARIZATIONS if asked == "all" else (asked,)
    names = tuple(asked) if isinstance(asked, Sequence) else ()
    for name in names:
        choice("polarization", name, POLARIZATIONS)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"polarization is {asked!r:.60}; give at least one, and each once")
    return names


def file_name(_: str, out: object) -> object:
    """`out`, the name of a file or None; TypeError for anything else."""
    if out is not None and not isinstance(out, (str, os.PathLike)):
        raise TypeError(f"out is a {type(out).__name__}; give the name of a file such as 'raw.h5', or None")
    return out


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackOptions(RunOptions):
    """Options of every verb that makes the echoes of a track."""

    receiver: Trajectory | None = option(
        None,
        "a track of as many pulses, default the transmitter's; its positions count as they are given",
        in_files=False,
    )
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = option(
        "HH",
        '"HH", "HV", "VH" or "VV" (first received, then sent), a sequence of these, or "all": one row per pulse for '
        "each, pulse by pulse. Points keep the polarisation: they have no echo in HV and VH",
        polarizations,
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
        "are left out, row by row, and of smooth facets the part outside",
    )
    reference: ArrayLike | None = option(
        None,
        "point of zero phase, m (3,), default the centre of the scene's box",
        or_none(lambda name, value: array(name, value, np.float64, (3,))),
    )
    compressed: bool = option(True, "False keeps the pulse's own spectrum (see `sarcl.compress`)", flag)
    out: PathLike | None = option(
        None,
        "an HDF5 file of sarcl's (.h5): samples are written there pulse after pulse, and read when needed",
        file_name,
        in_files=False,
    )

    def vertical_at(self, center: np.ndarray) -> np.ndarray:
        """Unit vector (3,) that H is perpendicular to, for a scene with its centre at `center`, m (3,)."""
        if self.vertical is not None:
            return np.asarray(self.vertical)
        normal = wgs84.vertical_at(center)
        return np.array([0.0, 0.0, 1.0]) if normal is None else normal
