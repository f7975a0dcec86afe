"""Options of fullwave_echo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from ...base.options import option
from ...base.types import PathLike
from ...base.validation import flag
from ...blocks.block_options import BlockOptions, Tile
from ...simulation.track_options import Polarization, TrackOptions, file_name, polarizations


@dataclass(frozen=True, eq=False, kw_only=True)
class FullwaveOptions(TrackOptions, BlockOptions):
    """Options of `fullwave_echo`."""

    absent = dict.fromkeys(
        ("bounces", "edges", "crease", "forward", "shadows"),
        "Maxwell's equations hold all reflections, edges, shadows and forward scatter; leave it out",
    )

    polarization: Polarization | Literal["all"] | Sequence[Polarization] = option(
        "HH",
        '"HH", "HV", "VH" or "VV" (first received, then sent), a sequence of these, or "all": one row per pulse for '
        "each, pulse by pulse. One run of the grid gives all polarisations of one that is sent: HH and VH share theirs",
        polarizations,
    )
    range_window: ArrayLike | None = option(
        None,
        "(near, far) m about the reference, which must hold the scene; default the smallest that holds the scene, and "
        "what creeps round its bodies, plus 10 %",
    )
    cells: Literal["auto"] | float = option(
        "auto",
        'cells per shortest wavelength of the waveform\'s band, at least 8; "auto": 12 for conductors, and for '
        "dielectrics of permittivity eps 10 sqrt(eps 3e-2/tolerance), from 8 to 20 sqrt(eps); the number is "
        'report.plan["cells"]. Time grows as their fourth power',
    )
    anchors: Literal["auto"] | int | Sequence[int] = option(
        "auto", '"auto": as many as the tolerance needs; a number, spaced evenly; or pulse numbers'
    )
    max_bytes: float | None = option(
        None,
        "memory for one run of the grid, default half the memory that is installed; frequencies that do not fit take "
        "runs of their own",
    )
    out: PathLike | None = option(
        None,
        "an HDF5 file of sarcl's (.h5) for the samples. Echoes of finished runs are kept beside it, in OUT.anchors, "
        "until it is complete: after a kill, the same call continues from them",
        file_name,
        in_files=False,
    )
    resume: bool | None = option(
        None,
        'whether echoes of finished runs are kept in "PATH.anchors", where the same call finds them if it is killed. '
        "None: they are kept from the first second on; True: also when the call ends in an exception; False: they are "
        "not kept, and those of earlier calls are deleted",
        in_files=False,
    )
    tile: Tile | None = option(
        None,
        '(i, n): compute only piece i of n of the runs, 1 <= i <= n, and keep their echoes in "PATH.anchors"; the call '
        'that finds all others finished returns the echoes, the others return None. With anchors="auto", pieces share '
        "the first runs, and the call that completes these does the others",
        in_files=False,
    )
    tolerance: float = option(
        3e-2, "L2 error of waveform forming: of the samples against those of a run at every pulse, on the same grid"
    )
    check: bool = option(False, "one run more per polarisation sent, between anchors: report.measured_error", flag)
    model_error: bool = option(
        True,
        "predict the error of the grid itself, report.model_error, by a run with larger cells, which takes about a "
        "fifth of the time",
        flag,
    )
