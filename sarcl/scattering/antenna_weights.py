"""Weights of scatterers: antenna gains, spreading loss, and the factor of the radar equation that all share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.boxes import box
from ..base.errors import ToleranceUnreachable
from ..base.validation import instance
from ..model.antenna import AMPLITUDE, HEADER, Antenna, pair_of
from ..model.radar import Radar, spreading
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import PulseGeometry
from ..numerics.subapertures import Decimation
from ..opencl.device import Device

if TYPE_CHECKING:
    from ..opencl.device import Buffer

ANGLE = 1e-7  # rad, bound of the rms error of float32 directions: 1e-8 to 3e-8 measured
PATTERN = 1e-6  # bound of the rms error of float32 patterns relative to their peak: 1e-7 to 5e-7 measured
PRODUCTS = 5e-7  # bound of the relative error of products of gains and spreading in float32
MOST_NODES = 16  # frequencies, Chebyshev nodes over the band
# of a tolerance: the most that rounding of gains in float32 may take, and with it their interpolation over the band
ROUNDING, OVER_BAND = 0.3, 0.7
LEBESGUE = 4.0  # 1 + the Lebesgue constant of up to 16 Chebyshev nodes: interpolation error over that of the best fit


@dataclass(frozen=True, eq=False)
class WeightError:
    """Relative L2 errors of echoes that are due to errors of the antenna weights.

    peak_to_rms  largest possible weight over the root mean square of all weights, weighted by echo power; at least 1
    rounding     error of directions and patterns in float32;  at_peak: the same, were all echoes at the beam's peak
    gradient     1/m, relative change of the weights per metre: the weight at a facet's centre is used for all of it
    over_band    [n]: error of interpolation between n Chebyshev nodes over the band, n = 1 ... MOST_NODES
    """

    peak_to_rms: float = 1.0
    rounding: float = 0.0
    at_peak: float = 0.0
    gradient: float = 0.0
    over_band: np.ndarray = field(default_factory=lambda: np.zeros(MOST_NODES + 1))

    def nodes(self, tolerance: float) -> int:
        """Fewest nodes whose error is at most `tolerance`; MOST_NODES where no number suffices."""
        enough = np.flatnonzero(self.over_band[1:] <= tolerance)
        return int(enough[0]) + 1 if len(enough) else MOST_NODES

    def check(self, tolerance: float) -> None:
        """Raise ToleranceUnreachable where rounding leaves too little of the tolerance."""
        if not self.rounding <= ROUNDING * tolerance:
            below = 20 * np.log10(self.peak_to_rms)
            helps = below > 0 and self.at_peak <= ROUNDING * tolerance
            raise ToleranceUnreachable(
                tolerance,
                self.rounding / ROUNDING * (1 + 1e-9),
                "float32 gains of the antennas",
                "aim at the scene" if helps else "",
                how="with these antennas: gains are in float32"
                + (f", and the echoes lie {below:.0f} dB below the beam's peak" if below >= 0.5 else ""),
            )

    def of(self, n: int, tolerance: float) -> float:
        """Error of points with n nodes; ToleranceUnreachable where it leaves too little of the tolerance."""
        error = self.rounding + float(self.over_band[n])
        if not error <= OVER_BAND * tolerance:
            raise ToleranceUnreachable(
                tolerance,
                error / OVER_BAND * (1 + 1e-9),
                "gains over the band",
                "halve the band and add the halves' images",
                how=f"with these antennas: gains change too much over the band to be interpolated between {n} "
                "frequencies",
            )
        return error

    def with_phase(self, n: int, of_phase: Sequence[float]) -> float:
        """Error with n nodes of weights times facet amplitudes, whose own errors are of_phase[1 ... n]."""
        if not self.over_band[1]:
            return of_phase[n]
        if n == 1:
            return of_phase[1] + float(self.over_band[1])
        # a product of polynomials of degrees p - 1 and n - p has degree n - 1
        return LEBESGUE * min(of_phase[p] + float(self.over_band[n + 1 - p]) for p in range(1, n + 1))


@dataclass(frozen=True, eq=False)
class AntennaWeights:
    """Amplitude weights of scatterers, g_t g_r (R/R_t) (R/R_r); a factor that is not asked for is 1.

    geometry   positions of the antennas at n pulses;  frequency  Hz, centre of the band
    pair       antennas as `antenna.pair_of` gives them; None: gains of 1
    axes       axes of the transmitting and of the receiving antenna in the scene, (n, 3, 3) each
    radar      None: no spreading loss;  range  R, m, at which the spreading factor is 1
    limits     directions beyond which the gains are taken as 0 (6,), as kernels/gains.clh reads them; zeros: none
    """

    geometry: PulseGeometry
    frequency: float
    pair: tuple[Antenna, Antenna | None] | None = None
    axes: tuple[np.ndarray, np.ndarray] | None = None
    radar: Radar | None = None
    range: float = 1.0
    limits: np.ndarray = field(default_factory=lambda: np.zeros(6, np.float32))

    @property
    def is_needed(self) -> bool:
        """Whether any weight differs from 1."""
        return self.pair is not None or self.radar is not None

    @property
    def patterns(self) -> list[Antenna]:
        """Patterns whose gains are multiplied: one where it is a two-way pattern, else two, or none."""
        return [] if self.pair is None else [one for one in self.pair if one is not None]

    @property
    def varies_over_band(self) -> bool:
        """Whether gains depend on frequency."""
        return any(one.kind == "aperture" or one.frequency is not None for one in self.patterns)

    @cached_property
    def is_two_way(self) -> bool:
        """Whether one antenna transmits and receives, with one position and attitude: its gain is then squared."""
        if self.pair is None or self.axes is None or self.pair[1] is not self.pair[0]:
            return False
        return self.geometry.is_monostatic and np.array_equal(*self.axes)

    @property
    def is_same_both_ways(self) -> bool:
        """Whether a path has the weight of the same path the other way round, where both antennas stand in one place:
        without gains, with a two-way pattern, or with one antenna that transmits and receives."""
        return len(self.patterns) < 2 or self.is_two_way

    @property
    def peak(self) -> float:
        """Largest two-way gain, an amplitude."""
        return float(np.prod([one.amplitude for one in self.patterns]))

    def factor(self, frequencies: np.ndarray) -> np.ndarray:
        """Factor of the radar equation that all scatterers share, over R^2, at frequencies, Hz (n,)."""
        return np.ones(len(frequencies)) if self.radar is None else self.radar.factor(frequencies) / self.range**2

    def weights(self, points: np.ndarray, pulse: int, frequency: float) -> np.ndarray:
        """Weights (n,), complex128, of points, m (n, 3), at one pulse: the reference of kernels/gains.clh."""
        sent, received = points - self.geometry.tx[pulse], points - self.geometry.rx[pulse]
        return self._weighted(self.pair or (None, None), sent, received, pulse, frequency)

    def of_paths(self, sent: np.ndarray, received: np.ndarray, pulse: int, frequency: float) -> np.ndarray:
        """Weights (n,), complex128, of paths at one pulse: vectors m (n, 3) along which a wave leaves the transmitter,
        as long as its way to the last scatterer, and from the receiver to that scatterer.

        A two-way pattern G is that of an antenna with the gain sqrt(G) each way: see Antenna.has_root.
        """
        both = self.pair or (None, None)
        if both[0] is None or both[1] is not None:
            return self._weighted(both, sent, received, pulse, frequency)
        squares = [self._weighted(both, way, way, pulse, frequency).real for way in (sent, received)]
        # splines of tables may pass below 0 between their values
        return np.prod([np.sqrt(np.maximum(one, 0)) for one in squares], axis=0).astype(np.complex128)

    def _weighted(
        self,
        pair: Sequence[Antenna | None],
        sent: np.ndarray,
        received: np.ndarray,
        pulse: int,
        frequency: float,
    ) -> np.ndarray:
        """Gains of a pair of patterns, 1 where one is None, times the spreading loss: see `of_paths`."""
        from ..model.antenna_pattern import pattern_gain

        out = np.ones(len(sent), np.complex128)
        if self.axes is not None:
            for one, way, axes in zip(pair, (sent, received), self.axes, strict=True):
                out *= 1 if one is None else pattern_gain(one, way @ axes[pulse], frequency)
        if self.radar is not None:
            out *= self.range**2 * spreading(*(np.linalg.norm(way, axis=1) for way in (sent, received)))
        return out

    def at(self, geometry: PulseGeometry, pulses: slice = slice(None)) -> AntennaWeights:
        """Weights at other antenna positions, such as those of an array's elements; `pulses`: whose axes they have."""
        axes = None if self.axes is None else (self.axes[0][pulses], self.axes[1][pulses])
        return replace(self, geometry=geometry, axes=axes)

    def decimated(self, decimation: Decimation) -> AntennaWeights:
        """Weights at the positions that a decimation of these keeps; beyond the ends of a track antennas turn on."""
        axes = None
        if self.axes is not None:
            tx, rx = (_orthonormal(decimation.taken(one.reshape(-1, 9)).reshape(-1, 3, 3)) for one in self.axes)
            axes = tx, rx
        return replace(self, geometry=decimation.kept, axes=axes)

    def culled(self, level: float, waveform: Waveform) -> AntennaWeights:
        """The same weights, but 0 in directions where they are below `level` of the peak, over the waveform's band."""
        if self.pair is None:
            return self
        # one antenna attenuates twice, so that each way may be above the square root of the level
        level = min(1.0, np.sqrt(level) if self.is_two_way else level)
        band = [waveform.center + side * waveform.bandwidth / 2 for side in (-1, 1)]
        limits = [np.max([one.limits(level, f) for f in band], axis=0) for one in self.patterns]
        return replace(self, limits=np.concatenate([limits[0], limits[-1]]).astype(np.float32))

    def check_clearance(self, points: np.ndarray) -> None:
        """Raise ValueError where an antenna stands on one of points, m (n, 3), and amplitudes fall with range."""
        if self.radar is None:
            return
        from scipy.spatial import cKDTree

        bounds = box(points)
        for end in self.geometry.ends:
            inside = np.flatnonzero(((end >= bounds[0]) & (end <= bounds[1])).all(axis=1))
            if len(inside):
                spreading(cKDTree(points).query(end[inside])[0], 1.0)

    def describe(self, error: WeightError) -> dict[str, Any]:
        """Words and numbers for a report."""
        out: dict[str, Any] = {}
        if self.pair is not None:
            out["antennas"] = "two-way " * (self.pair[1] is None) + " and ".join(
                dict.fromkeys(a.kind for a in self.patterns)
            )
            out["beam's peak over the echoes' mean, dB"] = round(20 * float(np.log10(error.peak_to_rms)), 1)
        if self.radar is not None:
            out["units"] = "sqrt(W)"
        return out

    def macros(self, n_nodes: int) -> dict[str, int]:
        """Build-time macros of kernels/gains.clh."""
        return {
            "NODES": n_nodes,
            "GAINS": len(self.patterns),
            "ALIKE": int(self.is_two_way),
            "VARIES": int(n_nodes > 1 and self.varies_over_band),
            "CULL": int(self.limits.any()) * (2 if len(self.patterns) == 2 and not self.is_two_way else 1),
            "SPREADING": int(self.radar is not None),
        }

    def upload(
        self, device: Device, dtype: type[np.floating] = np.float32, *, relative: bool = False
    ) -> tuple[Buffer, int]:
        """Patterns on a device, one after the other, and the index at which the second begins; the last number of the
        first header is that index too.

        relative  gains over `peak`, whose squares no number type loses
        """
        packed = [one.packed(self.frequency, dtype) for one in self.patterns] or [np.zeros(HEADER, dtype)]
        for one in packed if relative else ():
            one[AMPLITUDE] = 1
        packed[0].view(f"i{packed[0].itemsize}")[HEADER - 1] = len(packed[0])
        return device.upload(np.concatenate(packed)), len(packed[0])

    def packed_axes(self, pulses: np.ndarray, dtype: type[np.floating] = np.float32) -> np.ndarray:
        """Axes of both antennas at pulses (n,), one axis after another (n, 18), as kernels/gains.clh reads them."""
        if self.axes is None:
            return np.zeros((1, 18), dtype)
        both = np.stack([a[pulses].swapaxes(1, 2) for a in self.axes], axis=1)
        return np.ascontiguousarray(both, dtype).reshape(-1, 18)


def _orthonormal(axes: np.ndarray) -> np.ndarray:
    """The axes nearest to some that are about at right angles (n, 3, 3)."""
    u, _, v = np.linalg.svd(axes)
    return np.asarray(u @ v)


def weights_of(
    antenna: object,
    radar: Radar | None,
    track: Trajectory,
    receiver: Trajectory | None,
    waveform: Waveform,
    center: np.ndarray,
) -> AntennaWeights:
    """The weights for the arguments `antenna` and `radar` of `sarcl.echo`; center  of the scene, m (3,).

    Raises ValueError where an antenna is not aimed, and where `antenna` is neither an Antenna nor a pair of them.
    """
    back = track if receiver is None else receiver
    geometry = PulseGeometry(track.positions, back.positions)
    pair = axes = None
    if antenna is not None:
        pair = pair_of(antenna, receiver is not None)
        axes = pair[0].axes(track), (pair[1] or pair[0]).axes(back)
    scale = 1.0
    if radar is not None:
        instance("radar", radar, Radar)
        tx_range, rx_range = (np.linalg.norm(end - center, axis=1) for end in (geometry.tx, geometry.rx))
        scale = float(np.sqrt(np.mean(tx_range * rx_range))) or 1.0
    return AntennaWeights(geometry, waveform.center, pair, axes, radar, scale)
