"""Phase histories of frequency-diverse arrays converted to those of other radars: corrected, mapped, or by channel."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, NotRequired, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from ..base import errors, validation
from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..model.antenna_array import AntennaArray
from ..model.phase_history import PhaseHistory
from ..numerics.pulse_geometry import half_path
from .channels import spacing

MapKind = Literal["corrected", "apparent", "channels"]
MAPPINGS = ("corrected", "apparent", "channels")
OFFSETS = ("published", "halved")
NEAR = 1e-3  # m, largest difference of reference ranges from the distances to `center`
LINE = 1e-9  # of an array's length: elements no farther from evenly spaced points of a line are on it


class MapApertureOptions(TypedDict):
    """Arguments of `map_aperture` other than raw."""

    mapping: MapKind
    center: NotRequired[ArrayLike]
    attitude: NotRequired[ArrayLike | None]
    quadratic: NotRequired[bool]
    offset: NotRequired[Literal["published", "halved"]]
    vertical: NotRequired[ArrayLike]


def map_aperture(
    raw: PhaseHistory, mapping: MapKind, *, center: ArrayLike = (0.0, 0.0, 0.0), attitude: ArrayLike | None = None,
    quadratic: bool = True, offset: Literal["published", "halved"] = "published", vertical: ArrayLike = (0.0, 0.0, 1.0),
) -> PhaseHistory:  # fmt: skip
    """Echoes of a frequency-diverse array with summed channels, for a backprojection without a model of arrays.

    mapping    "corrected": the delay and phase of every channel's element, for a point at `center`, are removed: there
               the data are those of one antenna at the reference point (Farooq 2009, equations 5.4 and 5.5)
               "apparent": the same, with the apparent antenna positions from which the wavefront of the peak seems to
               come (equations 5.14 to 5.18, signs corrected: docs/theory/fda.md)
               "channels": a row for each channel, with the position and carrier of its element: backprojection of
               these is the matched filter of the whole model, at any point
    center     the point whose phase and delay are removed from raw, m (3,): the `reference` of `sarcl.echo`
    attitude   (n_pulses, 3, 3) of the track, if it had one
    quadratic  False: only the part that is linear in the channel's number is removed, as in the paper
    offset     "published": the apparent angle uses c dt of the peak as a one-way path; "halved": as a two-way path
    vertical   (3,), normal of the plane over which apparent positions keep their elevation

    Raises ValueError without an array, for channels that are separate already, share samples or lie outside the sampled
    band, for elements or carriers that are not evenly spaced, and for a center other than that of the data.

    >>> array = sarcl.AntennaArray.linear(8, spacing=0.015, frequency_step=10e6)
    >>> tone = sarcl.Waveform.tone(center=10e9, duration=1 / 10e6)
    >>> flight = sarcl.Trajectory.line(start=(-3e3, -50, 4e3), velocity=(0, 100, 0), prf=64, n_pulses=64)
    >>> summed = sarcl.echo(scene, tone, flight, array=array, reference=(0, 0, 0))
    >>> sarcl.map_aperture(summed, "apparent").n_rows
    64
    """
    validation.instance("raw", raw, PhaseHistory)
    validation.choice("mapping", mapping, MAPPINGS)
    validation.choice("offset", offset, OFFSETS)
    point = validation.array("center", center, np.float64, (3,))
    array = _array_of(raw)
    pulse = _pulses(raw, array)
    away = half_path(raw.tx, raw.rx, point)
    if np.abs(away - raw.reference_range).max() > NEAR:
        worst = int(np.abs(away - raw.reference_range).argmax())
        raise ValueError(
            f"reference_range[{worst}] is {raw.reference_range[worst]:.4f} m, but center is {away[worst]:.4f} m away; "
            "give the point that raw's phase is relative to as center (echo's reference)"
        )
    rotation = None if attitude is None else _rotations(attitude, int(pulse.max()) + 1)[pulse]
    element = _elements(raw, array, pulse)
    quadratic = validation.flag("quadratic", quadratic)
    if mapping == "channels":
        return _separate(raw, array, element, rotation)
    towards = point - raw.tx
    distance = np.linalg.norm(towards, axis=1)
    frequencies = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
    if quadratic:
        steps = array.positions if rotation is None else np.einsum("pij,nj->pni", rotation, array.positions)
        near = np.linalg.norm(towards[:, None] - steps, axis=2)
        # |T + d - c| - |T - c| without cancellation
        bent = ((steps**2).sum(axis=-1) - 2 * (towards[:, None] * steps).sum(axis=2)) / (near + distance[:, None])
        cycles = frequencies * np.take_along_axis(bent, element, axis=1) / SPEED_OF_LIGHT
    else:
        assert raw.waveform is not None
        base = raw.waveform.center + array.offsets[_plan(array, pulse), 0]
        along = -(towards * _rotated(rotation, _progression(array))).sum(axis=1) / distance
        cycles = element * (along * base / SPEED_OF_LIGHT)[:, None]
    samples = np.asarray(raw.samples) * np.exp(2j * np.pi * np.mod(cycles, 1.0))
    moved = replace(raw, samples=validation.sealed(samples.astype(raw.samples.dtype)), array=None)
    if mapping == "corrected":
        return moved
    up = validation.direction("vertical", vertical)
    places = _apparent(raw, array, pulse, _rotated(rotation, _progression(array)), towards, up, offset == "halved")
    return replace(moved, tx=point - places, rx=point - places, reference_range=np.linalg.norm(places, axis=1))


def _apparent(
    raw: PhaseHistory,
    array: AntennaArray,
    pulse: np.ndarray,
    step: np.ndarray,
    towards: np.ndarray,
    up: np.ndarray,
    halved: bool,
) -> np.ndarray:
    """Vectors from apparent positions to the point, m (n, 3): along the gradient of r + g kappa, of that length.

    kappa is the sine of the angle from the array's broadside, g = d f0/df; Farooq's elements lie at -n d y.
    """
    assert raw.waveform is not None
    spacing_m = float(np.linalg.norm(_progression(array)))
    change = array.offsets[:, 1] - array.offsets[:, 0]
    g = (spacing_m * raw.waveform.center / change[_plan(array, pulse)] / (2 if halved else 1))[:, None]
    axis = -np.broadcast_to(step / spacing_m, towards.shape)
    r = np.linalg.norm(towards, axis=1, keepdims=True)
    u = towards / r
    kappa = (u * axis).sum(axis=1, keepdims=True)
    gradient = u + g / r * (axis - kappa * u)
    level = gradient - (gradient @ up)[:, None] * up
    sine = (u @ up)[:, None]
    return np.asarray((r + g * kappa) * (np.sqrt(1 - sine**2) * unit(level) + sine * up))


def _rotations(attitude: object, n_pulses: int) -> np.ndarray:
    turns = validation.array("attitude", attitude, np.float64, (n_pulses, 3, 3))
    off = np.abs(np.einsum("nij,nkj->nik", turns, turns) - np.eye(3)).max(axis=(1, 2))
    if off.max() > LINE:
        bad = int(off.argmax())
        raise ValueError(f"attitude[{bad}] is no rotation; give the track's own, orthonormal")
    return turns


def _array_of(raw: PhaseHistory) -> AntennaArray:
    """The array whose channels are summed in the rows of raw."""
    if not isinstance(raw.array, AntennaArray) or raw.waveform is None:
        raise ValueError("raw has no array and waveform: map_aperture needs echoes made with array=")
    if raw.tx_channel is not None:
        raise errors.NotApplicable(
            "raw's channels are separate already, each with its own position and carrier: backproject them as they are"
        )
    return raw.array


def _pulses(raw: PhaseHistory, array: AntennaArray) -> np.ndarray:
    """Pulse number of each row (n_rows,)."""
    if raw.time is None:
        if array.plan is None:
            return np.zeros(raw.n_rows, np.int64)
        raise ValueError("raw has no time, so its pulses cannot be identified; keep all fields that echo returns")
    pulse = np.unique(raw.time, return_inverse=True)[1].ravel()
    if array.plan is not None and pulse.max() + 1 != len(array.plan):
        raise ValueError(
            f"raw has {pulse.max() + 1} pulses, but the array's plan {len(array.plan)}; map all pulses, then choose"
        )
    return pulse


def _plan(array: AntennaArray, pulse: np.ndarray) -> np.ndarray:
    """Index into array.offsets of each row's plan."""
    return np.zeros(len(pulse), np.int64) if array.plan is None else array.plan[pulse]


def _elements(raw: PhaseHistory, array: AntennaArray, pulse: np.ndarray) -> np.ndarray:
    """Element of the channel that each sample belongs to (n_rows, n_samples)."""
    assert raw.waveform is not None
    out = np.empty(raw.samples.shape, np.int64)
    frequencies = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
    plan = _plan(array, pulse)
    for number, offsets in enumerate(array.offsets):
        rows = plan == number
        carriers = raw.waveform.center + offsets
        gap = spacing(carriers)
        if gap is None or len(np.unique(carriers)) < array.n:
            raise errors.NotApplicable(
                "the array's channels share carriers, or are not evenly spaced, so that samples cannot be separated "
                "by frequency; make the echoes with channels='separated'"
            )
        if raw.waveform.kind != "tone" and raw.waveform.bandwidth > gap * (1 + 1e-9):
            raise errors.NotApplicable(
                f"channels {gap / 1e6:g} MHz apart share samples: their pulses are "
                f"{raw.waveform.bandwidth / 1e6:g} MHz wide; make the echoes with channels='separated', or send tones"
            )
        low, high = (
            frequencies[rows].min(axis=1).max() - gap / 2,
            frequencies[rows].max(axis=1).min() + gap / 2,
        )
        outside = np.flatnonzero((carriers < low) | (carriers > high))
        if len(outside):
            raise ValueError(
                f"{len(outside)} of the array's {array.n} channels lie outside the sampled band of "
                f"{(low + gap / 2) / 1e9:.6g} to {(high - gap / 2) / 1e9:.6g} GHz, such as element {outside[0]} at "
                f"{carriers[outside[0]] / 1e9:.6g} GHz; keep all samples that echo returned"
            )
        order = np.argsort(carriers)
        place = np.rint((frequencies[rows] - carriers[order[0]]) / gap)
        steps = np.rint((carriers[order] - carriers[order[0]]) / gap)
        at = np.clip(np.searchsorted(steps, place), 0, array.n - 1)
        out[rows] = order[at]
    return out


def _progression(array: AntennaArray) -> np.ndarray:
    """Step from element to element, m (3,). ValueError where positions or carriers are not evenly spaced."""
    step = array.positions[-1] / max(array.n - 1, 1)
    off = np.abs(array.positions - np.arange(array.n)[:, None] * step).max()
    change = array.offsets[:, -1:] - array.offsets[:, :1]
    bent = np.abs(array.offsets - array.offsets[:, :1] - np.arange(array.n) / max(array.n - 1, 1) * change).max()
    if (
        array.n < 2
        or not step.any()
        or off > LINE * np.linalg.norm(array.positions[-1])
        or bent > LINE * np.abs(change).max()
    ):
        raise errors.NotApplicable(
            "apparent positions and the paper's linear correction need elements and carriers in even steps "
            "along a line; use mapping='corrected' with quadratic=True, or 'channels'"
        )
    return np.asarray(step)


def _separate(raw: PhaseHistory, array: AntennaArray, element: np.ndarray, rotation: np.ndarray | None) -> PhaseHistory:
    """A row for each channel of each row, with the samples that belong to it."""
    width = int(np.bincount(element[0], minlength=array.n).max())
    starts = np.array([np.searchsorted(np.sort(row), np.arange(array.n)) for row in np.sort(element, axis=1)])
    order = np.argsort(element, axis=1, kind="stable")
    index = np.take_along_axis(order, np.minimum(starts, raw.n_samples - width), axis=1)[:, :, None] + np.arange(width)
    if (
        np.take_along_axis(element, index.reshape(len(element), -1), 1).reshape(index.shape)
        != np.arange(array.n)[:, None]
    ).any():
        raise ValueError("channels differ in their number of samples; make the echoes with channels='separated'")
    n, rows = array.n, np.repeat(np.arange(raw.n_rows), array.n)
    samples = np.take_along_axis(np.asarray(raw.samples), index.reshape(raw.n_rows, -1), axis=1).reshape(-1, width)
    steps = np.broadcast_to(array.positions, (raw.n_rows, n, 3)) if rotation is None else rotation @ array.positions.T
    steps = steps if rotation is None else np.swapaxes(steps, 1, 2)
    first = replace(raw, samples=validation.sealed(np.array(raw.samples[:, :1])))[rows]
    return replace(
        first,
        samples=validation.sealed(samples),
        frequency=(raw.frequency[:, None] + raw.frequency_step[:, None] * index[:, :, 0]).ravel(),
        tx=(raw.tx[:, None] + steps).reshape(-1, 3),
        tx_channel=np.tile(np.arange(n), raw.n_rows),
    )


def _rotated(rotation: np.ndarray | None, step: np.ndarray) -> np.ndarray:
    return step if rotation is None else rotation @ step
