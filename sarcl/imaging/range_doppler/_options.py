"""Options of range_doppler."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...base.options import option, or_none
from ...base.validation import array, number
from ...earth.elevation import ElevationModel
from ..focus_options import FocusOptions


def _beam(name: str, value: object) -> float:
    """A full angle, rad, less than half a turn."""
    angle = number(name, value, above=0)
    if angle >= np.pi:
        raise ValueError(f"{name} is {angle:g} rad, which looks backwards too; give less than pi: was it in degrees?")
    return angle


def _interval(name: str, value: object) -> tuple[float, float]:
    """(first, last), of which the first is less."""
    first, last = array(name, value, np.float64, (2,)).tolist()
    if not first < last:
        raise ValueError(f"{name} is ({first:g}, {last:g}); the first must be less than the last")
    return first, last


def _number(unit: str, name: str, value: object) -> float:
    """A number in `unit`."""
    if isinstance(value, str):
        raise ValueError(f"{name} is {value!r}; choose 'geometry', 'data' or a number in {unit}")
    return number(name, value)


def _word_or_number(unit: str, name: str, value: object) -> str | float:
    """ "geometry", "data", or a number in `unit`."""
    return value if isinstance(value, str) and value in ("geometry", "data") else _number(unit, name, value)


@dataclass(frozen=True, eq=False, kw_only=True)
class RangeDopplerOptions(FocusOptions):
    """Options of `range_doppler`."""

    heights: float | ElevationModel = option(
        0.0,
        "z of the pixels, m; in Earth-fixed coordinates heights above the ellipsoid, m, or a sarcl.ElevationModel. "
        "Positions depend on them, the pixels of a straight track do not",
    )
    side: Literal["left", "right"] | None = option(
        None, '"left" or "right" of the track, seen from above; None: where the origin is, if the echoes contain it'
    )
    times: Sequence[float] | None = option(
        None,
        "(first, last) zero-Doppler time, s, on the clock of raw.time, which may be absolute (2e9 s); None: those of "
        "the rows, less where a pixel's Doppler band and the image's exceed the pulse rate",
        or_none(_interval),
    )
    ranges: Sequence[float] | None = option(
        None,
        "(near, far) slant range, m; None: the ranges that the range window holds in every row",
        or_none(_interval),
    )
    spacing: tuple[float | None, float | None] | None = option(
        None,
        "(s, m) between rows and columns, or None for either: the spectrum of a pixel then fills 0.8 of the sampling "
        "rate at most. Rows are a whole fraction of the pulse interval apart, no farther than asked",
    )
    azimuth_beam: float | None = option(
        None,
        "full angle in rad about the Doppler centroid: rows that see a pixel outside it do not contribute; None: all "
        "rows contribute to every pixel. Its ends are tapered, beyond the angle without a window along the track (the "
        "log and the report say how much that is), else within it",
        or_none(_beam),
    )
    doppler: Literal["geometry", "data"] | float = option(
        "geometry",
        'centroid of the beam, and of the default times: "geometry", from reference ranges that change (else '
        'broadside); "data", from the phases of neighbouring rows; or in Hz, at the centre frequency',
        lambda name, value: _word_or_number("Hz", name, value),
    )
    near: float | None = option(
        None,
        "Hz: data determine the centroid but for multiples of the pulse rate; the one nearest to this is taken. None: "
        "the one nearest to that of the geometry, with a warning where the echoes tell another one",
        or_none(lambda name, value: _number("Hz", name, value)),
    )
    doppler_rate: Literal["geometry", "data"] | float = option(
        "geometry",
        'that of the azimuth compression: "geometry", from the track; "data", from the displacement of two looks (map '
        "drift), which needs ground with contrast; or in Hz/s at the centre frequency, in the middle of the ranges and "
        "at the centroid. Effective velocities at all ranges are scaled alike. `tolerance` then refers to "
        "backprojection with ranges that have this rate",
        lambda name, value: _word_or_number("Hz/s", name, value),
    )
    tolerance: float = option(
        1e-2,
        "L2 error allowed against `backproject` at the same positions, relative to the larger of the norm of the image "
        "and the norm of the same contributions with random phases",
    )
    max_bytes: float | None = option(
        None,
        "memory for blocks on the device, as `backproject` takes it; arrays of all pulses or Doppler bins that are "
        "larger than a third of it, or of half the machine's memory, are temporary files",
    )
    check: bool | None = option(None, "compute 128 random pixels exactly; None: where that costs less than 2 %")
