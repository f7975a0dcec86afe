"""Forecast of echoes before they are computed: rows, bytes, time, error."""

from __future__ import annotations

import logging
import time
import warnings
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np

from ..arrays.channels import channels_of, is_single, sampling
from ..base import arguments, errors, validation
from ..base.report import ErrorTerm, root_sum_square
from ..base.text import duration, size_text
from ..io import sarcl_hdf5
from ..model.antenna_array import AntennaArray
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..scene.scene import Scene
from . import echo_sampling
from .echo import SKIPS as ECHO_SKIPS
from .echo import EchoOptions, echo
from .echo_output import log as output_log
from .echo_request import echo_request
from .spectral.spectral_echo import SKIPS, spectral_echo
from .spectral.spectral_task import spectral_task

# options of echo that make up its request, and those that a task of spectral_echo takes besides
REQUEST = {
    "polarization", "vertical", "shadows", "seed", "skip", "max_edge", "max_bytes", "tolerance", "device",
}  # fmt: skip
TASK = {"receiver", "array", "reference", "range_window", "antenna", "radar", "compressed"}
FEW, MORE = 8, 40  # pulses from the middle of the track that are computed and timed
KERNELS = 10.0  # s; pulses that take longer are not computed again to leave out the building of kernels


@dataclass(frozen=True, eq=False)
class EchoForecast:
    """Forecast of `echo` with the same arguments.

    n_rows, n_samples  of the phase history;  bytes  of its samples and geometry, in a file or in memory
    seconds            about, on this device at its present speed
    contributions      about the number of pairs of scatterer, pulse and channel that will be added up
    plan               as in the report;  predicted_error  bound of the relative error
    spectral_seconds   about the seconds of `spectral_echo` with these arguments, None where it refuses them
    spectral_refusal   why it does, else empty
    error_terms        parts of predicted_error, whose squares add up to its square
    """

    n_rows: int
    n_samples: int
    bytes: float
    seconds: float
    contributions: float
    plan: dict[str, object]
    predicted_error: float
    spectral_seconds: float | None = None
    spectral_refusal: str = ""
    error_terms: tuple[ErrorTerm, ...] = ()

    def __str__(self) -> str:
        text = f"{self.n_rows} rows of {self.n_samples} samples: {size_text(self.bytes)}, "
        text += f"about {duration(self.seconds)}, error below {self.predicted_error:.1e}"
        if self.spectral_seconds is not None:
            text += f"\nspectral_echo: about {duration(self.spectral_seconds)}"
        return text


def plan_echo(scene: Scene, waveform: Waveform, track: Trajectory, **options: Unpack[EchoOptions]) -> EchoForecast:
    """Forecast of `echo(scene, waveform, track, ...)` with these options, as an EchoForecast.

    Up to 40 pulses from the middle of the track are computed and timed, and `spectral_echo` is planned where it takes
    the track. Raises as `echo` does; `out` is not written.
    """
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        validation.instance(name, value, kind)
    arguments.keywords(echo, options)
    receiver, array = options.get("receiver"), options.get("array")
    given: dict[str, Any] = {
        k: v for k, v in options.items() if k not in ("out", "progress", "receiver", "array", "check")
    }
    real, asked = scene.realized(options.get("seed", 0)), options.get("reference")
    point = scene.center if asked is None else validation.array("reference", asked, np.float64, (3,))
    whole = track
    track, receiver, motion = echo_sampling.in_flight(track, receiver, scene, point)
    rx = echo_sampling.receiver_positions(track, receiver)
    reference_range = echo_sampling.half_path(track.positions, rx, point)
    near, far = echo_sampling.window(real, waveform, track.positions, rx, reference_range, options.get("range_window"))
    given |= {"reference": point, "range_window": (near, far)}  # of the whole track
    n_samples = None
    if isinstance(array, AntennaArray) and not is_single(array):
        carriers = np.array([c.carrier for c in channels_of(array, waveform.center, len(track))])
        grid = sampling(carriers, waveform, near, far, options.get("compressed", True))
        n_samples = grid.width if options.get("channels") == "separated" else grid.n

    def made(n: int) -> tuple[float, Any]:
        """Seconds for n pulses from the middle of the track, else from where anything is seen; and their echoes."""
        said: ValueError | None = None
        for first in ((len(track) - n) // 2, 0, len(track) - n):
            at, some = slice(first, first + n), array
            if isinstance(array, AntennaArray) and array.plan is not None:
                some = replace(array, plan=array.plan[at])
            start = time.perf_counter()
            try:
                raw = echo(
                    scene, waveform, track.picked(at), receiver=None if receiver is None else receiver.picked(at),
                    array=some, check=False, **given,
                )  # fmt: skip
            except (errors.NothingSeen, errors.ToleranceUnreachable) as exc:  # elsewhere more may be seen
                said = said or exc
            else:
                return time.perf_counter() - start, raw
        assert said is not None
        raise said

    level = output_log.level
    output_log.setLevel(logging.WARNING)  # the log is for the echoes that were asked for, not for these pulses
    try:
        few, more = min(FEW, len(track)), min(MORE, len(track))
        with errors.warned_once():  # the pulses are computed two or three times
            once, _ = made(few)  # builds kernels, which takes seconds
            if once < KERNELS:
                once, _ = made(few)
            longer, raw = made(more)
    finally:
        output_log.setLevel(level)
    slope = max(longer - once, 0.0) / (more - few) if more > few else longer / more
    rows = raw.n_rows // more * len(track)
    n_samples = raw.n_samples if n_samples is None else n_samples
    return EchoForecast(
        rows, n_samples, rows * (8.0 * n_samples + sarcl_hdf5.ROW_BYTES), longer + slope * (len(track) - more),
        raw.report.contributions_done / more * len(track), dict(raw.report.plan) | motion, raw.report.predicted_error,
        *_spectral(scene, waveform, whole, options), error_terms=raw.report.error_terms,
    )  # fmt: skip


def plan_spectral_echo(
    scene: Scene, waveform: Waveform, track: Trajectory, *, variant: str = "exact", tolerance: float = 1e-2,
    **options: Any,
) -> EchoForecast:  # fmt: skip
    """Forecast of `spectral_echo(scene, waveform, track, ...)` with these options, as an EchoForecast.

    Nothing is transformed. Raises as `spectral_echo` does; `out` is not written.
    """
    validation.choice("variant", variant, ("exact", "saras"))
    arguments.keywords(spectral_echo, options)
    request = echo_request(scene, SKIPS, tolerance=tolerance, **{k: v for k, v in options.items() if k in REQUEST})
    task = spectral_task(scene, waveform, track, request, **{k: v for k, v in options.items() if k in TASK})
    prepared, parts, direct, terms = task.planned(variant)
    rows, n_samples = len(track) * len(request.polarizations), len(task.frequencies)
    return EchoForecast(
        rows, n_samples, rows * (8.0 * n_samples + sarcl_hdf5.ROW_BYTES), task.seconds(parts, direct),
        float(rows) * len(prepared), {**task.describe(parts, direct), **task.motion}, root_sum_square(terms),
        error_terms=terms,
    )  # fmt: skip


def _spectral(scene: Scene, waveform: Waveform, track: Trajectory, options: EchoOptions) -> tuple[float | None, str]:
    """About the seconds of spectral_echo, or None and why it refuses these arguments."""
    try:
        given: dict[str, Any] = dict(options)
        request = echo_request(scene, ECHO_SKIPS, **{k: v for k, v in given.items() if k in REQUEST})
        task = spectral_task(scene, waveform, track, request, **{k: v for k, v in given.items() if k in TASK})
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", errors.SarclWarning
            )  # those of the mesh came with the pulses that were timed
            _, parts, direct, _ = task.planned("exact")
    except (errors.NotApplicable, errors.NothingSeen, errors.ToleranceUnreachable) as refused:
        return None, str(refused)
    return task.seconds(parts, direct), ""
