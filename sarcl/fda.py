"""Experiments on frequency-diverse apertures: what a mapping does to a point, to its neighbours, and to the data.

Every case is collected once, mapped in every way asked for, and set beside a conventional antenna at the array's mean
phase centre with the same band and track. What is measured: docs/fda.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import check
from .aperture import MAPPINGS, map_aperture
from .array import AntennaArray
from .check import SPEED_OF_LIGHT
from .echo import echo
from .phase_history import PhaseHistory
from .scene import Scene
from .trajectory import Trajectory
from .waveform import Waveform

CONVENTIONAL, RAW = "conventional", "unmodified"
STEPS = 24  # places in a null width of the conventional aperture
DRAWN = 2000  # spatial frequencies
REACH = 12.0  # null widths on each side of a cut


@dataclass(frozen=True)
class Case:
    """A linear array with a linear frequency progression on a straight, broadside, level track.

    n, spacing m, frequency_step Hz   elements at -i spacing along the track, as Farooq's; spacing None: half a wave of
                                      the centre frequency
    center                            f0, Hz;  distance m;  aperture m;  n_pulses
    mirrored                          the progression changes sign at mid-aperture, the centre frequency stays
    mappings                          of `sarcl.map_aperture`, and "unmodified"
    points                            cross-range places of lone points, m
    separations                       of two points about the centre, m
    """

    name: str
    n: int = 45
    frequency_step: float = 20e6
    center: float = 10e9
    spacing: float | None = None
    distance: float = 5e3
    aperture: float = 430.0
    n_pulses: int = 431
    mirrored: bool = True
    mappings: tuple[str, ...] = ("unmodified", "corrected", "apparent", "channels")
    points: tuple[float, ...] = (0.0, 2.0, 2.25)
    separations: tuple[float, ...] = (0.1, 0.125, 0.15, 0.2, 0.25)

    def __post_init__(self) -> None:
        for name in ("n", "n_pulses"):
            object.__setattr__(self, name, check.count(name, getattr(self, name), 2))
        for name in ("center", "distance", "aperture"):
            object.__setattr__(self, name, check.number(name, getattr(self, name), above=0))
        object.__setattr__(self, "frequency_step", check.number("frequency_step", self.frequency_step))
        if self.frequency_step == 0:
            raise ValueError(
                "frequency_step is 0: a constant-frequency array has nothing to map; the conventional antenna that is "
                "run beside every case is that"
            )
        if self.spacing is not None:
            object.__setattr__(self, "spacing", check.number("spacing", self.spacing, above=0))
        for name in ("points", "separations"):
            values = check.array(name, getattr(self, name), np.float64, ("n",))
            object.__setattr__(self, name, tuple(values.tolist()))
        if any(s <= 0 for s in self.separations):
            raise ValueError(f"separations are {self.separations}; two points need to be some way apart")
        for mapping in self.mappings:
            check.choice("mappings", mapping, (RAW, *MAPPINGS))

    @property
    def bandwidth(self) -> float:
        """n |frequency_step|, Hz."""
        return self.n * abs(self.frequency_step)

    @property
    def middle(self) -> float:
        """Centre frequency, Hz."""
        return self.center + (self.n - 1) / 2 * self.frequency_step

    @property
    def step(self) -> float:
        """Spacing of the elements, m."""
        return SPEED_OF_LIGHT / self.middle / 2 if self.spacing is None else self.spacing

    @property
    def null(self) -> float:
        """How far the first null of the conventional aperture lies off the peak, m."""
        return SPEED_OF_LIGHT / self.middle * self.distance / (2 * self.aperture)

    def track(self) -> Trajectory:
        """Along y, the scene at +x."""
        y = self.aperture * (np.arange(self.n_pulses) / (self.n_pulses - 1) - 0.5)
        return Trajectory(np.arange(self.n_pulses), np.stack([np.full(len(y), -self.distance), y, 0 * y], axis=1))

    def array(self) -> AntennaArray:
        """The array, over all pulses."""
        made = AntennaArray.linear(self.n, spacing=self.step, frequency_step=self.frequency_step, axis=(0.0, -1.0, 0.0))
        return made.mirrored(self.n_pulses // 2, self.n_pulses) if self.mirrored else made

    def collect(self, places: Sequence[float], device: Any = None) -> PhaseHistory:
        """Echoes of unit points at (0, y, 0), channels added up at the reference element."""
        tone = Waveform.tone(center=self.center, duration=1 / abs(self.frequency_step))
        window = 0.49 * SPEED_OF_LIGHT / (2 * abs(self.frequency_step))
        return echo(
            _points(places), tone, self.track(), array=self.array(), reference=(0, 0, 0),
            range_window=(-window, window), tolerance=1e-4, device=device,
        )  # fmt: skip

    def conventional(self, places: Sequence[float], device: Any = None) -> PhaseHistory:
        """The same points as one antenna at the mean phase centre sees them, with a chirp of the same band."""
        track = self.track()
        mean = np.array([0.0, -(self.n - 1) / 4 * self.step, 0.0])  # of sender and receiver
        chirp = Waveform.chirp(center=self.middle, bandwidth=self.bandwidth, duration=1 / abs(self.frequency_step))
        window = 0.49 * SPEED_OF_LIGHT / (2 * abs(self.frequency_step))
        return echo(
            _points(places), chirp, replace(track, positions=track.positions + mean), reference=(0, 0, 0),
            range_window=(-window, window), tolerance=1e-4, device=device,
        )  # fmt: skip


def run(
    cases: Sequence[Case], *, device: Any = None, progress: Callable[[str, int, int], None] | None = None
) -> list[dict[str, Any]]:
    """What was measured of each case: plain numbers, ready for JSON."""
    out = []
    for i, case in enumerate(cases):
        if progress:
            progress("fda", i, len(cases))
        out.append(measure(case, device))
    if progress:
        progress("fda", len(cases), len(cases))
    return out


def measure(case: Case, device: Any = None) -> dict[str, Any]:
    """Responses at every place, dips at every separation and the data's support, of every mapping."""
    names = (CONVENTIONAL, *case.mappings)
    rows: dict[str, dict[str, Any]] = {name: {"points": [], "dips": []} for name in names}
    for y in case.points:
        for name, raw in _mapped(case, [y], names, device):
            at, values = cut(raw, case, y, device)
            rows[name]["points"].append({"place": y, **response(at, values, y)})
            if y == case.points[0]:
                rows[name] |= _described(raw, case)
    for separation in case.separations:
        for name, raw in _mapped(case, [-separation / 2, separation / 2], names, device):
            at, values = cut(raw, case, 0.0, device)
            rows[name]["dips"].append({"separation": separation, "dip_db": dip(at, values, separation)})
    setting = {name: getattr(case, name) for name in Case.__dataclass_fields__}
    derived = {"bandwidth": case.bandwidth, "middle": case.middle, "spacing": case.step, "null": case.null}
    return {**setting, **derived, "mapped": rows}


def _mapped(case: Case, places: Sequence[float], names: Sequence[str], device: Any) -> list[tuple[str, PhaseHistory]]:
    raw = case.collect(places, device)
    out = []
    for name in names:
        if name == CONVENTIONAL:
            out.append((name, case.conventional(places, device)))
        else:
            out.append((name, raw if name == RAW else map_aperture(raw, name)))
    return out


def cut(raw: PhaseHistory, case: Case, y: float, device: Any = None) -> tuple[np.ndarray, np.ndarray]:
    """Image along cross-range about (0, y, 0): places, m (n,), and amplitudes (n,), 1 for a focused unit point."""
    from .backproject import backproject
    from .grid import ImageGrid

    step = case.null / STEPS
    at = y + step * np.arange(-int(REACH * STEPS), int(REACH * STEPS) + 1)
    grid = ImageGrid.points(np.stack([0 * at, at, 0 * at], axis=1))
    image = backproject(raw, grid, tolerance=1e-3, check=False, device=device)
    return at, np.abs(np.asarray(image.data)) / image.gain


def response(at: np.ndarray, values: np.ndarray, place: float) -> dict[str, float]:
    """Of one point: error of the peak's place and its level, null and half-power widths, m, PSLR and ISLR, dB."""
    from scipy.interpolate import CubicSpline

    fine = np.linspace(at[0], at[-1], 8 * len(at))
    power = np.maximum(CubicSpline(at, values**2)(fine), 1e-12 * values.max() ** 2)
    peak = left = right = int(power.argmax())
    while left > 0 and power[left - 1] < power[left]:
        left -= 1
    while right < len(power) - 1 and power[right + 1] < power[right]:
        right += 1
    half = np.flatnonzero(power[left : right + 1] >= power[peak] / 2) + left
    sides = np.concatenate([power[:left], power[right + 1 :]])
    return {
        "error": float(fine[peak] - place),
        "level_db": float(10 * np.log10(power[peak])),
        "null": float(fine[right] - fine[left]) / 2,
        "irw": float(fine[half[-1]] - fine[half[0]]),
        "pslr_db": float(10 * np.log10(sides.max() / power[peak])),
        "islr_db": float(10 * np.log10(sides.sum() / power[left : right + 1].sum())),
    }


def dip(at: np.ndarray, values: np.ndarray, separation: float) -> float:
    """How far the image falls between two points, dB below the lower of their peaks; 0 where there is but one peak."""
    found = []
    for side in (-1, 1):
        near = np.flatnonzero((side * at >= separation / 8) & (side * at <= separation))
        peak = int(near[values[near].argmax()])
        if peak in (near[0], near[-1]):  # it only rises towards the middle, or goes on rising outwards
            return 0.0
        found.append(peak)
    lower, between = float(values[found].min()), float(values[found[0] : found[1] + 1].min())
    return float(20 * np.log10(lower / max(between, 1e-6 * lower)))


def _described(raw: PhaseHistory, case: Case) -> dict[str, Any]:
    """Lengths of the positions backprojected from, and the spatial frequencies they claim, turns/m."""
    y = raw.tx[:, 1]
    support = spatial_frequencies(raw)
    across = support[:, 1]
    return {
        "length": float(np.ptp(y)),
        "gap": float(np.diff(np.unique(np.round(y, 6))).max(initial=0.0)),
        "claimed": float(np.ptp(across)),
        "support": np.random.default_rng(0).permutation(support)[:DRAWN].round(4).tolist(),
    }


def spatial_frequencies(raw: PhaseHistory, most: int = 40) -> np.ndarray:
    """K = f/c (u_T + u_R) at the origin, of up to `most` samples of every row, turns/m (n, 2): along x and y."""
    some = np.unique(np.linspace(0, raw.n_samples - 1, most).astype(int))
    f = raw.frequency[:, None] + raw.frequency_step[:, None] * some
    look = sum(end / np.linalg.norm(end, axis=1, keepdims=True) for end in (raw.tx, raw.rx))
    return np.asarray((f[:, :, None] / SPEED_OF_LIGHT * look[:, None, :2]).reshape(-1, 2))


def _points(places: Sequence[float]) -> Scene:
    return Scene.points([[0.0, y, 0.0] for y in places])
