"""Experiments on frequency-diverse apertures: effects of mappings on points, pairs of points and spatial frequencies.

The echoes of every case are made once, mapped in every way asked for, and compared with a conventional antenna of the
same phase centres, band and track. Array and track: case.py; quantities: docs/guide/fda.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypedDict, cast

import numpy as np

from ...arrays.map_aperture import MapKind, map_aperture
from ...base import arguments
from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable
from ...base.rows import spread_over
from ...base.text import shown
from ...base.vectors import unit
from ...model.phase_history import PhaseHistory
from ...opencl.device import DeviceChoice
from .case import RAW, REACH, STEPS, Case

CONVENTIONAL = "conventional"
DRAWN = 2000  # spatial frequencies that are kept, for plots
RESOLVED = 3.0  # dB: least dip between two points that are resolved, and of other peaks below the lower of the two
ALIKE = 0.2  # dB; dips that differ by less count as equal
NEAR = 0.25  # share of the null: distance from two points within which their peaks must lie
WEAK = -6.0  # dB of a unit point in focus: a weaker peak is a side lobe, or of a smeared point


class Pair(TypedDict):
    """Response of two points on a cut: see `pair`."""

    dip_db: float
    shift: float | None
    false_db: float | None
    level_db: float
    peaks: list[float]


class PairApart(Pair):
    """A `Pair`, and the distance of its points, m."""

    separation: float


def run(
    cases: Sequence[Case],
    *,
    device: DeviceChoice | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> list[dict[str, Any]]:
    """Measurements of each of the `cases` on a `device`: plain numbers, ready for JSON; progress(name, case, cases).

    >>> case = sarcl.fda.Case("array", n=9, frequency_step=100e6, mappings=("corrected",))
    >>> [measured["name"] for measured in sarcl.fda.run([case])]
    ['array']
    """
    if not isinstance(cases, Sequence) or not all(isinstance(case, Case) for case in cases):
        raise TypeError(f"cases is {shown(cases)}; give a list of fda.Case")
    arguments.progress(progress)
    out = []
    for i, case in enumerate(cases):
        if progress:
            progress("fda", i, len(cases))
        out.append(measure(case, device))
    if progress:
        progress("fda", len(cases), len(cases))
    return out


def measure(case: Case, device: DeviceChoice | None = None) -> dict[str, Any]:
    """Responses of every point, pairs at every separation and spatial frequencies, for every mapping that applies,
    computed on a `device`.

    "not_applicable" holds the other mappings, with the reason; "collected" the spatial frequencies of the channels;
    "resolved_if" the limits of what `pair` measures within which two points are resolved (`is_resolved`).

    >>> case = sarcl.fda.Case("array", n=9, frequency_step=100e6, mappings=("corrected",))
    >>> "collected" in sarcl.fda.measure(case)
    True
    """
    rows: dict[str, dict[str, Any]] = {}
    refused: dict[str, str] = {}
    for y in case.points:
        for name, raw in _mapped(case, [y], refused, device):
            at, values = cut(raw, case, y, device)
            row = rows.setdefault(name, {"points": [], "dips": []})
            row["points"].append({"place": y, **response(at, values, y)})
            if len(row["points"]) == 1:
                row |= _described(raw, case)
    for separation in case.separations:
        for name, raw in _mapped(case, [-separation / 2, separation / 2], refused, device):
            at, values = cut(raw, case, 0.0, device)
            response_of_pair = pair(at, values, separation)
            rows[name]["dips"].append(
                {"separation": separation, **response_of_pair, "resolved": is_resolved(response_of_pair, case.null)}
            )
    for row in rows.values():
        row["told_apart"] = told_apart(row["dips"], case.null)
    setting = {name: getattr(case, name) for name in Case.__dataclass_fields__}
    derived = {"bandwidth": case.bandwidth, "middle": case.middle, "spacing": case.step, "null": case.null}
    limits = {"dip_db": RESOLVED, "shift": NEAR * case.null, "false_db": -RESOLVED, "level_db": WEAK}
    more = {"swept": dict(case.swept), "is_wide": case.is_wide, "not_applicable": refused, "collected": collected(case)}
    return {**setting, **derived, "resolved_if": limits, **more, "mapped": rows}


def _mapped(
    case: Case, places: Sequence[float], refused: dict[str, str], device: DeviceChoice | None
) -> Iterator[tuple[str, PhaseHistory]]:
    """Name and echoes of the conventional antenna and of every mapping that applies; `refused` gets the others."""
    yield CONVENTIONAL, case.conventional(places, device)
    raw = case.collect(places, device)
    for name in case.mappings:
        if name in refused:
            continue
        try:
            mapped = _map(case, raw, name)
        except NotApplicable as exc:
            refused[name] = str(exc)
        else:
            yield name, mapped


def _map(case: Case, raw: PhaseHistory, name: str) -> PhaseHistory:
    if raw.tx_channel is not None and name in (RAW, "channels"):
        if name == RAW:
            raise NotApplicable(
                "every row already holds the position and carrier of its own channel: that is 'channels'"
            )
        return raw
    return raw if name == RAW else map_aperture(raw, cast(MapKind, name), attitude=case.track().attitude)


def cut(raw: PhaseHistory, case: Case, y: float, device: DeviceChoice | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Image of `raw`, on a `device`, along cross-range about (0, y, 0): positions, m (n,), and amplitudes (n,), 1 for a
    focused unit point.

    >>> case = sarcl.fda.Case("array", n=9, frequency_step=100e6)
    >>> across, amplitudes = sarcl.fda.cut(raw, case, 0.0)
    """
    from ...imaging.backproject import backproject
    from ...model.image_grid import ImageGrid

    step = case.null / STEPS
    positions = y + step * np.arange(-int(REACH * STEPS), int(REACH * STEPS) + 1)
    grid = ImageGrid.points(np.stack([0 * positions, positions, 0 * positions], axis=1))
    image = backproject(raw, grid, tolerance=1e-3, check=False, device=device)
    return positions, np.abs(image.normalized())


def response(at: np.ndarray, values: np.ndarray, place: float) -> dict[str, float]:
    """Response of a point: error of the peak's position, m; its level, dB; null, half-power width, m; PSLR, ISLR, dB.

    at  positions of the cut, m (n,);  values  of the image there (n,);  place  of the point, m

    "inside" is False where the highest value is the first or last of the cut, and therefore no peak.

    >>> at = np.linspace(-10, 10, 401)  # m
    >>> values = np.sinc(at)  # null 1 m from the peak
    >>> response = sarcl.fda.response(at, values, 0.0)
    >>> round(response["null"], 2), round(response["irw"], 2)
    (1.0, 0.89)
    """
    from scipy.interpolate import CubicSpline

    fine = np.linspace(at[0], at[-1], 8 * len(at))
    power = np.maximum(CubicSpline(at, values**2)(fine), 1e-12 * values.max() ** 2)
    peak = before = right = int(power.argmax())
    while before > 0 and power[before - 1] < power[before]:
        before -= 1
    while right < len(power) - 1 and power[right + 1] < power[right]:
        right += 1
    half = np.flatnonzero(power[before : right + 1] >= power[peak] / 2) + before
    sides = np.concatenate([power[:before], power[right + 1 :]])
    return {
        "error": _vertex(fine, power, peak) - place,
        "level_db": float(10 * np.log10(power[peak])),
        "null": (_vertex(fine, power, right) - _vertex(fine, power, before)) / 2,
        "irw": _crossing(fine, power, half[-1], 1) - _crossing(fine, power, half[0], -1),
        "pslr_db": float(10 * np.log10(sides.max(initial=1e-12 * power[peak]) / power[peak])),
        "islr_db": float(10 * np.log10(max(sides.sum(), 1e-12 * power[peak]) / power[before : right + 1].sum())),
        "inside": bool(0 < peak < len(power) - 1),
    }


def _vertex(x: np.ndarray, y: np.ndarray, i: int) -> float:
    """Position of the vertex of the parabola through an extreme sample and its neighbours."""
    if not 0 < i < len(y) - 1:
        return float(x[i])
    bend, slope = y[i - 1] - 2 * y[i] + y[i + 1], (y[i - 1] - y[i + 1]) / 2
    return float(x[i] + np.clip(slope / bend if bend else 0.0, -0.5, 0.5) * (x[1] - x[0]))


def _crossing(x: np.ndarray, power: np.ndarray, i: int, side: int) -> float:
    """Position, next to sample i, at which the power falls through half its peak."""
    if not 0 <= i + side < len(power):
        return float(x[i])
    share = (power[i] - power.max() / 2) / max(power[i] - power[i + side], 1e-300)
    return float(x[i] + np.clip(share, 0, 1) * (x[i + side] - x[i]))


def dip(at: np.ndarray, values: np.ndarray, separation: float) -> float:
    """Fall of the image between two points, dB below the lower of their peaks; 0 where there is only one peak.

    at  positions, m (n,);  values  amplitudes there (n,);  separation  of the points, m

    >>> at = np.linspace(-10, 10, 401)  # m
    >>> values = np.sinc(at - 1) + np.sinc(at + 1)  # two points, nulls 1 m from each
    >>> sarcl.fda.dip(at, abs(values), separation=2.0) > 20
    True
    """
    return float(pair(at, values, separation)["dip_db"])


def pair(at: np.ndarray, values: np.ndarray, separation: float) -> Pair:
    """Response on a cut of two points `separation` m apart about 0.

    at  positions of the cut, m (n,);  values  of the image there, amplitudes of a unit point (n,)

    dip_db    the `dip`, dB;  level_db  the lower of the two peaks, dB
    shift     larger distance of the two peaks from their points, m
    false_db  highest other peak relative to the lower of the two, dB
    peaks     positions, m, of all peaks that are at most 3 dB below the lower of the two

    Where there are not two peaks, one on each side and nearer to its point than the other point is, dip_db is 0, shift
    and false_db are None, and level_db and peaks refer to the highest value. An end of the cut counts as a peak where
    the level rises towards it.

    >>> at = np.linspace(-10, 10, 401)  # m
    >>> values = np.sinc(at - 1) + np.sinc(at + 1)  # two points, nulls 1 m from each
    >>> apart = sarcl.fda.pair(at, abs(values), separation=2.0)
    >>> [round(float(place), 2) for place in apart["peaks"]]
    [-1.13, 1.13]
    """
    around = np.concatenate([[-1.0], values, [-1.0]])
    peaks = np.flatnonzero((values > around[:-2]) & (values >= around[2:]))
    found = []
    for side in (-1, 1):
        near = np.flatnonzero((side * at >= separation / 8) & (side * at <= separation))
        if not len(near):
            raise ValueError(
                f"separation is {separation:g} m, and `at` has no position between an eighth and all of it on each "
                "side of 0; give positions that are closer together"
            )
        peak = int(near[values[near].argmax()])
        if peak in (near[0], near[-1]):  # no peak: the level only rises, towards the middle or outwards
            break
        found.append(peak)
    two = len(found) == 2
    lower = max(float(values[found].min() if two else values.max()), 1e-300)
    out: Pair = {
        "dip_db": 0.0,
        "shift": None,
        "false_db": None,
        "level_db": float(20 * np.log10(lower)),
        "peaks": [_vertex(at, values, int(i)) for i in peaks[values[peaks] >= lower * 10 ** (-RESOLVED / 20)]],
    }
    if two:
        between = float(values[found[0] : found[1] + 1].min())
        others = values[np.setdiff1d(peaks, found)].max(initial=1e-6 * lower)
        points = -separation / 2, separation / 2
        out["dip_db"] = float(20 * np.log10(lower / max(between, 1e-6 * lower)))
        out["shift"] = max(abs(_vertex(at, values, i) - x) for i, x in zip(found, points, strict=True))
        out["false_db"] = float(20 * np.log10(others / lower))
    return out


def is_resolved(two: Pair, null: float, least: float = RESOLVED) -> bool:
    """Whether a cut shows two points resolved: as many peaks as points, each in its place.

    There is a dip of `least` dB between two peaks, each within a quarter of `null`, m, of its point and at most 6 dB
    below a unit point in focus, and every other peak is 3 dB or more below the lower of the two. two: from `pair`

    >>> at = np.linspace(-10, 10, 401)  # m
    >>> values = np.sinc(at - 1) + np.sinc(at + 1)  # two points, nulls 1 m from each
    >>> sarcl.fda.is_resolved(sarcl.fda.pair(at, abs(values), separation=2.0), null=1.0)
    True
    """
    if two["shift"] is None or two["false_db"] is None:
        return False
    in_place = two["shift"] <= NEAR * null and two["level_db"] >= WEAK
    return in_place and two["dip_db"] >= least and two["false_db"] <= -RESOLVED


def told_apart(dips: Sequence[PairApart], null: float, least: float = RESOLVED) -> float | None:
    """The smallest separation, m, from which on two points are resolved at all that were tried; None: not even at the
    largest. dips: from `pair`, with "separation"; null, m, and least: as for `is_resolved`.

    >>> at, dips = np.linspace(-10, 10, 401), []
    >>> for d in (1.0, 1.5, 2.0):  # m
    ...     cut = abs(np.sinc(at - d / 2) + np.sinc(at + d / 2))
    ...     dips.append(sarcl.fda.pair(at, cut, d) | {"separation": d})
    >>> sarcl.fda.told_apart(dips, null=1.0)
    2.0
    """
    out = None
    for row in sorted(dips, key=lambda d: -d["separation"]):
        if not is_resolved(row, null, least):
            break
        out = row["separation"]
    return out


def nearer(row: Mapping[str, Any], plain: Mapping[str, Any], null: float) -> int | None:
    """1 where `row` resolves two points closer together than `plain`, -1 only farther apart or not at all, 0 at the
    same separation (dips that differ by less than 0.2 dB count as equal), None where neither resolves them."""
    mine, other = (_no_less(row["told_apart"]), _no_less(plain["told_apart"]))
    if mine == other:
        return None if mine == np.inf else 0
    late, early = (row, plain) if mine > other else (plain, row)
    if _no_less(told_apart(late["dips"], null, RESOLVED - ALIKE)) <= _no_less(early["told_apart"]):
        return 0
    return 1 if mine < other else -1


def _no_less(separation: float | None) -> float:
    return np.inf if separation is None else separation


def _described(raw: PhaseHistory, case: Case) -> dict[str, Any]:
    """Length and largest gap of the phase centres, m, and the spatial frequencies that they imply, cycles/m."""
    centers = (raw.tx + raw.rx) / 2
    if case.path == "line":
        along = centers @ case.ahead
    else:
        along = case.ground * np.arctan2(centers[:, 1], -centers[:, 0])
    return {
        "length": float(np.ptp(along)),
        "gap": float(np.diff(np.unique(np.round(along, 6))).max(initial=0.0)),
        **_support(spatial_frequencies(raw)),
    }


def _support(frequencies: np.ndarray) -> dict[str, Any]:
    sample = np.random.default_rng(0).permutation(frequencies)[:DRAWN]
    return {"claimed": float(np.ptp(frequencies[:, 1])), "support": sample.round(4).tolist()}


def spatial_frequencies(raw: PhaseHistory, most: int = 40) -> np.ndarray:
    """K = f/c (u_T + u_R) at the origin, of up to `most` samples per row of `raw`, cycles/m (n, 2): along x and y.

    >>> sarcl.fda.spatial_frequencies(raw).shape[1]
    2
    """
    rows = spread_over(raw.n_samples, most)
    f = raw.frequency[:, None] + raw.frequency_step[:, None] * rows
    look = unit(raw.tx) + unit(raw.rx)
    return np.asarray((f[:, :, None] / SPEED_OF_LIGHT * look[:, None, :2]).reshape(-1, 2))


def collected(case: Case, most: int = 101) -> dict[str, Any]:
    """Spread across, cycles/m, and spatial frequencies of the channels, each from its own phase centre, of up to `most`
    pulses.

    >>> case = sarcl.fda.Case("array", n=9, frequency_step=100e6)
    >>> sorted(sarcl.fda.collected(case))
    ['claimed', 'support']
    """
    array, track = case.channels(), case.track()
    pulses = spread_over(case.n_pulses, most)
    turn = np.eye(3)[None] if track.attitude is None else track.attitude[pulses]
    tx = track.positions[pulses, None] + np.einsum("pij,nj->pni", turn, array.positions)
    f = case.center + np.stack([array.offsets_at(int(p)) for p in pulses])
    ends = {"reference": track.positions[pulses, None, None], "own": tx[:, :, None], "all": tx[:, None]}
    look = unit(tx)[:, :, None] + unit(ends[case.receive])
    return _support((f[:, :, None, None] / SPEED_OF_LIGHT * look[..., :2]).reshape(-1, 2))
