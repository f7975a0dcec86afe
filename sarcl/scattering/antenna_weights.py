"""What antennas and distance make of echoes: gains towards every scatterer, spreading, the radar's own factor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base.boxes import box
from ..base.errors import ToleranceUnreachable
from ..base.validation import instance
from ..model.antenna import Antenna, pair_of
from ..model.radar import Radar, spreading
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..opencl.device import Device

MOST_NODES = 16
ROUNDING, OVER_BAND = 0.3, 0.7  # of a tolerance: the most that float32 gains, and gains over the band, may take
LEBESGUE = 4.0  # 1 + the Lebesgue constant of up to 16 Chebyshev nodes: what interpolation adds to the best fit's error


@dataclass(frozen=True, eq=False)
class BeamError:
    """Relative L2 errors of echoes that come of their weights.

    dim        the largest weight over the root mean square of all, by what scatterers send back; 1 or more
    rounding   of float32 directions and patterns
    steepness  1/m: weights change by this over a metre, where a facet's centre stands for all of it
    over_band  [n] of n Chebyshev nodes over the band, n = 1 ... MOST_NODES
    """

    dim: float = 1.0
    rounding: float = 0.0
    steepness: float = 0.0
    over_band: np.ndarray = field(default_factory=lambda: np.zeros(MOST_NODES + 1))

    def nodes(self, tolerance: float) -> int:
        """Fewest nodes that keep `tolerance`; MOST_NODES where none do."""
        enough = np.flatnonzero(self.over_band[1:] <= tolerance)
        return int(enough[0]) + 1 if len(enough) else MOST_NODES

    def check(self, tolerance: float) -> None:
        """ToleranceUnreachable where rounding leaves too little of the tolerance."""
        if self.rounding > ROUNDING * tolerance:
            raise ToleranceUnreachable(
                tolerance, self.rounding / ROUNDING * (1 + 1e-9), "float32 gains of the antennas", "aim at the scene",
                how="with these antennas: gains are in float32, and the echoes lie "
                f"{20 * np.log10(self.dim):.0f} dB below the beam's peak",
            )  # fmt: skip

    def of(self, n: int, tolerance: float) -> float:
        """Error of points at n nodes. ToleranceUnreachable where it leaves too little of the tolerance."""
        error = self.rounding + float(self.over_band[n])
        if error > OVER_BAND * tolerance:
            raise ToleranceUnreachable(
                tolerance, error / OVER_BAND * (1 + 1e-9), "gains over the band",
                "halve the band and add the halves' images",
                how=f"with these antennas: gains change too much over the band to be interpolated between {n} "
                "frequencies",
            )  # fmt: skip
        return error

    def with_phase(self, n: int, of_phase: Sequence[float]) -> float:
        """Error of n nodes for weights times facets whose own errors are of_phase[1 ... n]."""
        if not self.over_band[1]:
            return of_phase[n]
        if n == 1:
            return of_phase[1] + float(self.over_band[1])
        # a product of polynomials of degrees p - 1 and n - p has degree n - 1
        return LEBESGUE * min(of_phase[p] + float(self.over_band[n + 1 - p]) for p in range(1, n + 1))


@dataclass(frozen=True, eq=False)
class Beam:
    """Weights of scatterers: g_t g_r (R/R_t) (R/R_r), each factor only where it is asked for.

    tx, rx  m (n, 3);  frequency  Hz, the band's middle
    pair    antennas as `antenna.pair_of` gives them, None: gains of 1;  axes  theirs in the scene, (n, 3, 3) each
    radar   None: no loss by spreading;  range  R, m: where spreading is counted from
    limits  beyond which either antenna need not be asked (6,), as kernels/gains.clh reads them; zeros: none
    """

    tx: np.ndarray
    rx: np.ndarray
    frequency: float
    pair: tuple[Antenna, Antenna | None] | None = None
    axes: tuple[np.ndarray, np.ndarray] | None = None
    radar: Radar | None = None
    range: float = 1.0
    limits: np.ndarray = field(default_factory=lambda: np.zeros(6, np.float32))

    @property
    def weighs(self) -> bool:
        """Anything at all is asked for."""
        return self.pair is not None or self.radar is not None

    @property
    def ways(self) -> list[Antenna]:
        """The patterns that are multiplied."""
        return [] if self.pair is None else [one for one in self.pair if one is not None]

    @property
    def varies(self) -> bool:
        """Gains differ from frequency to frequency."""
        return any(one.kind == "aperture" or one.frequency is not None for one in self.ways)

    @property
    def alike(self) -> bool:
        """The same antenna sends and receives, at the same place."""
        return self.pair is not None and self.pair[1] is self.pair[0] and self.tx is self.rx

    @property
    def peak(self) -> float:
        """Largest gain there and back, an amplitude."""
        return float(np.prod([one.amplitude for one in self.ways]))

    def factor(self, frequencies: np.ndarray) -> np.ndarray:
        """What all scatterers share at frequencies, Hz (n,): the radar equation's, over R^2."""
        return np.ones(len(frequencies)) if self.radar is None else self.radar.factor(frequencies) / self.range**2

    def weights(self, points: np.ndarray, pulse: int, frequency: float) -> np.ndarray:
        """Weights (n,), complex128, of points, m (n, 3): what kernels/gains.clh computes."""
        from ..model.antenna_pattern import two_way_gain

        out = np.ones(len(points), np.complex128)
        tx, rx = self.tx[pulse], self.rx[pulse]
        if self.pair is not None and self.axes is not None:
            out *= two_way_gain(self.pair, (self.axes[0][pulse], self.axes[1][pulse]), tx, rx, points, frequency)
        if self.radar is not None:
            out *= self.range**2 * spreading(*(np.linalg.norm(points - end, axis=1) for end in (tx, rx)))
        return out

    def seen_from(self, tx: np.ndarray, rx: np.ndarray, pulses: slice) -> Beam:
        """The weights of some pulses from other places, m (n, 3): an array's elements."""
        axes = None if self.axes is None else (self.axes[0][pulses], self.axes[1][pulses])
        return replace(self, tx=tx, rx=rx, axes=axes)

    def within(self, level: float, waveform: Waveform) -> Beam:
        """The same, leaving out places where weights are below `level` of the peak, over the waveform's band."""
        if self.pair is None:
            return self
        # what the same antenna loses on its way out it loses again on its way back
        level = min(1.0, np.sqrt(level) if self.alike else level)
        band = [waveform.center + side * waveform.bandwidth / 2 for side in (-1, 1)]
        limits = [np.max([one.limits(level, f) for f in band], axis=0) for one in self.ways]
        return replace(self, limits=np.concatenate([limits[0], limits[-1]]).astype(np.float32))

    def clear_of(self, points: np.ndarray) -> None:
        """ValueError where an antenna stands on one of points, m (n, 3), and amplitudes fall with range."""
        if self.radar is None:
            return
        from scipy.spatial import cKDTree

        bounds = box(points)
        for end in (self.tx, self.rx):
            inside = np.flatnonzero(((end >= bounds[0]) & (end <= bounds[1])).all(axis=1))
            if len(inside):
                spreading(cKDTree(points).query(end[inside])[0], 1.0)

    def describe(self, error: BeamError) -> dict[str, Any]:
        """For a report."""
        out: dict[str, Any] = {}
        if self.pair is not None:
            out["antennas"] = "two-way " * (self.pair[1] is None) + " and ".join(
                dict.fromkeys(a.kind for a in self.ways)
            )
            out["beam's peak over the echoes' mean, dB"] = round(20 * float(np.log10(error.dim)), 1)
        if self.radar is not None:
            out["units"] = "sqrt(W)"
        return out

    def macros(self, n_nodes: int) -> dict[str, int]:
        """Build-time macros of kernels/gains.clh."""
        return {
            "NODES": n_nodes,
            "GAINS": len(self.ways),
            "ALIKE": int(self.alike),
            "VARIES": int(n_nodes > 1 and self.varies),
            "CULL": int(self.limits.any()),
            "SPREADING": int(self.radar is not None),
        }

    def upload(self, device: Device) -> tuple[Any, int]:
        """Patterns on a device, one after the other, and where the second begins."""
        packed = [one.packed(self.frequency) for one in self.ways] or [np.zeros(1, np.float32)]
        return device.upload(np.concatenate(packed)), len(packed[0])

    def turned(self, pulses: np.ndarray) -> np.ndarray:
        """Axes of both antennas at pulses (n,), one axis after another, float32 (n, 18)."""
        if self.axes is None:
            return np.zeros((1, 18), np.float32)
        both = np.stack([a[pulses].swapaxes(1, 2) for a in self.axes], axis=1)
        return np.ascontiguousarray(both, np.float32).reshape(-1, 18)


def beam_of(
    antenna: Any, radar: Any, track: Trajectory, receiver: Trajectory | None, waveform: Waveform, center: np.ndarray
) -> Beam:
    """The weights that `sarcl.echo`'s antenna and radar ask for; center  of the scene, m (3,).

    ValueError where an antenna is not aimed, or what is given is neither an Antenna nor a pair of them.
    """
    back = track if receiver is None else receiver
    tx, rx = track.positions, back.positions
    pair = axes = None
    if antenna is not None:
        pair = pair_of(antenna, receiver is not None)
        axes = pair[0].axes(track), (pair[1] or pair[0]).axes(back)
    scale = 1.0
    if radar is not None:
        instance("radar", radar, Radar)
        scale = (
            float(np.sqrt(np.mean(np.linalg.norm(tx - center, axis=1) * np.linalg.norm(rx - center, axis=1)))) or 1.0
        )
    return Beam(tx, rx, waveform.center, pair, axes, radar, scale)
