"""Options of spectral_echo."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from ...base.options import option, or_none
from ...base.validation import choice, flag
from ...blocks.block_options import BlockOptions
from ...model.antenna_array import AntennaArray
from ...model.trajectory import Trajectory
from ...numerics import plan
from ..scene_options import SceneOptions, antenna_array

SKIPS = ("zero reflectivity", "facing away", "range window")


@dataclass(frozen=True, eq=False, kw_only=True)
class SpectralEchoOptions(SceneOptions, BlockOptions):
    """Options of `spectral_echo`."""

    absent = dict.fromkeys(
        ("edges", "crease"),
        "it transforms maps of facets, whose amplitudes change slowly along the track, as those of edges do "
        "not; use echo",
    ) | {"forward": "it is for one antenna, to which nothing is scattered forwards; use echo with a receiver"}

    variant: Literal["exact", "saras"] = option(
        "exact",
        '"exact": no approximation but those that the tolerance bounds. The response of a scatterer along the track is '
        "transformed numerically, with the antenna's pattern, squint and range migration. \"saras\": the paper's "
        "transfer function and grid deformation, by stationary phase, with amplitudes as seen from broadside: for "
        "comparison, it is no faster",
        lambda name, value: choice(name, value, ("exact", "saras")),
    )
    ripple: bool = option(
        False,
        "multiply by the Fresnel ripples of the spectrum of a rectangular chirp (SARAS's function d), which `echo` "
        "leaves out",
        flag,
    )
    receiver: Trajectory | None = option(None, "not supported: None", in_files=False)
    array: AntennaArray | None = option(
        None,
        "not supported: None",
        or_none(antenna_array),
        in_files=False,
    )
    bounces: int = option(1, "not supported: 1")
    range_window: ArrayLike | None = option(
        None,
        "(near, far) m about the reference, default the smallest that holds the scene plus 10 %; it must hold every "
        "scatterer at every pulse that sees it",
    )
    skip: bool | Collection[Literal["zero reflectivity", "facing away", "range window"]] = option(
        True,
        'True, False or a set of reasons: "zero reflectivity", "facing away", "range window"',
        lambda name, value: plan.skips(value, SKIPS),
    )
    max_bytes: float | None = option(
        None,
        "memory for blocks of the map and its spectra. What it does not hold goes to temporary files: beside `out`, or "
        "where the system has temporary files",
    )
    tolerance: float = option(
        1e-2,
        "L2 error of the samples, relative to the larger of their norm and the norm that they would have if scatterers "
        "added with random phases",
    )
    check: bool | None = option(
        None,
        "recompute samples at 16 random pulses exactly, fewer above 20 000 facets: report.measured_error; None: where "
        "that takes about a second at most",
    )
