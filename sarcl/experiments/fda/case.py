"""A case of an experiment on frequency-diverse apertures: array, track, receiver, conventional antenna beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...arrays.channels import spacing
from ...arrays.map_aperture import MAPPINGS
from ...base import validation
from ...base.constants import SPEED_OF_LIGHT
from ...model.antenna_array import AntennaArray
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...opencl.device import DeviceChoice
from ...scene.scene import Scene
from ...simulation.echo import echo
from ...simulation.echo_options import RECEIVE
from ._array import PROGRESSIONS, as_channels, groups_of, highest, make, size, subarrays

RAW = "unmodified"
PATHS = ("line", "circle")
REACH = 12.0  # length of a cut on each side of a point, in nulls of the conventional antenna
STEPS = 24  # samples of a cut per null of the conventional antenna
WIDE = 0.05  # share of the aperture; phase centres spread over less change widths by at most a thousandth
STEEPEST = 1.55  # rad, largest squint


@dataclass(frozen=True)
class Case:
    """An array, its carriers, its track and the points it observes. x is along the line of sight from mid-aperture in
    the ground plane, y across it, z up, the scene's centre at the origin.

    n, spacing m, frequency_step Hz   elements at -i spacing along the track, as in Farooq 2009; spacing None: half a
                                      wavelength at the centre frequency
    center                            f0, Hz;  distance of mid-aperture m;  aperture, length of the track m;  n_pulses
    mirrored                          from mid-aperture on the carriers run in reverse; the centre frequency stays
    mappings                          of `sarcl.map_aperture`, and "unmodified"
    points                            cross-range positions y of single points, m
    separations                       of two points about the centre, m
    progression  "linear"; "costas": carriers in a Costas order; "vertical": elements at -i spacing along z; "planar":
                 n (ny, nz), frequency_step (dfy, dfz), elements along the track and z; "subarrays": a line in `groups`,
                 each sending the carrier of its first element, the middle of the first at the reference point
    steer        direction of subarrays from the scene's centre, seen from mid-aperture, rad from x towards y
    path         "line"; "circle": an arc about the scene's centre, along which the array turns
    squint       angle of the line of sight ahead of broadside, in the ground plane, rad;  height: of the track, m
    receive      "reference": one receiver, at the reference element, channels added up; "own": every element its own
                 channel; "all": every element all channels; both kept separate
    series, swept  of a case made by `sarcl.fda.sweep`: name of the original case, (key, value) pairs

    Where phase centres spread over more than 5 % of the aperture, their mean follows the track, otherwise the
    reference element does. ValueError names the key that does not fit.

    >>> case = sarcl.fda.Case("array", n=9, frequency_step=100e6)
    >>> case.n, case.frequency_step
    (9, 100000000.0)
    >>> len(case.track().positions), case.array().n, case.channels().n
    (431, 9, 9)
    >>> raw = case.collect([0.0, 2.0])  # echoes of two points
    >>> peer = case.conventional([0.0, 2.0])
    """

    name: str
    n: int | tuple[int, int] = 45
    frequency_step: float | tuple[float, float] = 20e6
    center: float = 10e9
    spacing: float | None = None
    distance: float = 5e3
    aperture: float = 430.0
    n_pulses: int = 431
    mirrored: bool = True
    mappings: tuple[str, ...] = ("unmodified", "corrected", "apparent", "channels")
    points: tuple[float, ...] = (0.0, 2.0, 2.25)
    separations: tuple[float, ...] = (0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.35)
    progression: Literal["linear", "costas", "vertical", "planar", "subarrays"] = "linear"
    groups: int | None = None
    steer: float = 0.0
    path: Literal["line", "circle"] = "line"
    squint: float = 0.0
    height: float = 0.0
    receive: Literal["reference", "own", "all"] = "reference"
    series: str = ""
    swept: tuple[tuple[str, object], ...] = ()

    def __post_init__(self) -> None:
        for name, allowed in (("progression", PROGRESSIONS), ("path", PATHS), ("receive", RECEIVE)):
            validation.choice(name, getattr(self, name), allowed)
        self._put("n_pulses", validation.count("n_pulses", self.n_pulses, 2))
        for name in ("center", "distance", "aperture", "spacing"):
            if name != "spacing" or self.spacing is not None:
                self._put(name, validation.number(name, getattr(self, name), above=0))
        for name in ("squint", "height", "steer"):
            self._put(name, validation.number(name, getattr(self, name)))
        for name in ("points", "separations"):
            values = validation.array(name, getattr(self, name), np.float64, ("n",))
            self._put(name, tuple(values.tolist()))
        if any(s <= 0 for s in self.separations):
            raise ValueError(f"separations are {self.separations}; two points must be some distance apart")
        if not isinstance(self.name, str):
            raise ValueError(f"name is {self.name!r:.60}; give a text")
        if not isinstance(self.mirrored, bool):
            raise ValueError(f"mirrored is {self.mirrored!r:.60}; give true or false")
        if isinstance(self.mappings, str) or len(set(self.mappings)) < len(self.mappings):
            raise ValueError(f"mappings is {self.mappings!r:.60}; give a list, each of them once")
        for mapping in self.mappings:
            validation.choice("mappings", mapping, (RAW, *MAPPINGS))
        n, step = size(self.progression, self.n, self.frequency_step)
        self._put("n", n)
        self._put("frequency_step", step)
        self._put("groups", groups_of(self.progression, self.groups, self.steer, self.receive))
        self._geometry()
        self._carriers()
        self._window()

    def _put(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def _geometry(self) -> None:
        if abs(self.height) >= self.distance:
            raise ValueError(f"height is {self.height:g} m, but mid-aperture is {self.distance:g} m away; give less")
        if abs(self.squint) > STEEPEST:
            raise ValueError(
                f"squint is {self.squint:g} rad; a track that points at the scene, pi/2, resolves nothing across: give "
                f"at most {STEEPEST}"
            )
        if self.path == "circle" and self.squint:
            raise ValueError("squint goes with path 'line': on a circle the scene's centre is always at broadside")
        around = 2 * np.pi * self.ground
        if self.path == "circle" and self.aperture >= around:
            raise ValueError(f"aperture is {self.aperture:g} m, the whole circle {around:g} m; give less")

    def _carriers(self) -> None:
        low = self.middle - abs(self.middle - self.center)
        if low > 0:
            if spacing(np.unique(self.array().offsets)) is None:
                raise ValueError(
                    f"frequency_step is {self.frequency_step}: the differences of these carriers are no whole "
                    "multiples of one step, so that they share no samples; give steps that are multiples of one another"
                )
            low = self.middle - self.bandwidth / 2
        if low <= 0:
            raise ValueError(
                f"frequency_step {self.frequency_step} Hz from center {self.center:g} Hz on reaches down to {low:g} "
                "Hz; frequencies must be positive: raise center, or lower frequency_step or n"
            )

    def _window(self) -> None:
        """Refuse what cannot be measured: separations beyond the cut, and points whose echoes leave the range window in
        some pulses."""
        reach = REACH * self.null
        if max(self.separations) > reach:
            raise ValueError(
                f"separations reach {max(self.separations):g} m, but the cut {reach:.3g} m to each side, {REACH:g} "
                "nulls; give smaller ones"
            )
        least, step = min(self.separations), self.null / STEPS
        if least < step:
            raise ValueError(
                f"separations go down to {least:g} m, but samples of the cut are {step:.3g} m apart, {STEPS} to a null "
                f"of {self.null:.3g} m; give larger ones, or a longer aperture"
            )
        track, centers = self.track(), self.phase_centers
        ends = [_moved(track, centers[i]).positions for i in (0, -1)]
        for y in (*self.points, *(s / 2 for s in self.separations), *(-s / 2 for s in self.separations)):
            off = max(np.abs(np.linalg.norm(p - (0, y, 0), axis=1) - np.linalg.norm(p, axis=1)).max() for p in ends)
            if off >= self.window:
                raise ValueError(
                    f"the point at {y:g} m is up to {off:.3g} m nearer or farther than the centre, but one sample "
                    f"per channel covers {self.window:.3g} m; move the point inwards, or lower frequency_step"
                )

    @property
    def channel_step(self) -> float:
        """Difference of neighbouring carriers, Hz."""
        return float(spacing(np.unique(self.array().offsets)) or 0.0)

    @property
    def bandwidth(self) -> float:
        """From the lowest to the highest carrier plus half a step on each side, Hz: n |frequency_step| of a line."""
        return self.array().span + self.channel_step

    @property
    def middle(self) -> float:
        """Centre frequency, Hz."""
        return self.center + highest(self.n, self.frequency_step, self.groups) / 2

    @property
    def step(self) -> float:
        """Spacing of the elements, m."""
        return SPEED_OF_LIGHT / self.middle / 2 if self.spacing is None else self.spacing

    @property
    def ground(self) -> float:
        """Distance of mid-aperture on the ground, m."""
        return float(np.sqrt(self.distance**2 - self.height**2))

    @property
    def null(self) -> float:
        """Distance across from the peak to the first null of the track's aperture, m: wavelength over twice the spread
        of sines, L cos(squint)/R on a line and 2 sin(arc/2) ground/R on a circle."""
        if self.path == "line":
            spread = self.aperture * np.cos(self.squint) / self.distance
        else:
            spread = 2 * np.sin(min(self.aperture / self.ground, np.pi) / 2) * self.ground / self.distance
        return float(SPEED_OF_LIGHT / self.middle / (2 * spread))

    @property
    def window(self) -> float:
        """Range on each side of the centre that one sample per channel covers, m."""
        return 0.49 * SPEED_OF_LIGHT / (2 * self.channel_step)

    @property
    def ahead(self) -> np.ndarray:
        """Direction of flight at mid-aperture, (3,)."""
        return np.array([np.sin(self.squint), np.cos(self.squint), 0.0])

    @property
    def phase_centers(self) -> np.ndarray:
        """Phase centres of the channels from the reference point in axes of mid-aperture, m (n, 3); "all": senders."""
        return np.asarray(self.channels().positions / (2 if self.receive == "reference" else 1))

    @property
    def is_wide(self) -> bool:
        """Whether phase centres spread so far that one antenna at their mean cannot represent them."""
        return bool(np.linalg.norm(np.ptp(self.phase_centers, axis=0)) > WIDE * self.aperture)

    def track(self) -> Trajectory:
        """Positions of the reference point."""
        along = self.aperture * (np.arange(self.n_pulses) / (self.n_pulses - 1) - 0.5)
        middle, times = np.array([-self.ground, 0.0, self.height]), np.arange(self.n_pulses)
        if self.path == "line":
            line = Trajectory(times, middle + along[:, None] * self.ahead)
        else:
            turn = _about_z(-along / self.ground)
            line = Trajectory(times, turn @ middle, attitude=turn)
        return _moved(line, -self.phase_centers.mean(axis=0)) if self.is_wide else line

    def array(self) -> AntennaArray:
        """The array and its carriers in all pulses."""
        elements = make(self.progression, self.n, self.frequency_step, self.step, self.ahead)
        if self.groups is not None:
            level, turn = self.ground / self.distance, self.steer
            look = np.array([level * np.cos(turn), level * np.sin(turn), -self.height / self.distance])
            elements = subarrays(elements, self.groups, self.center, look)
        return elements.mirrored(self.n_pulses // 2, self.n_pulses) if self.mirrored else elements

    def channels(self) -> AntennaArray:
        """One element per channel: the array; of subarrays each group as one element at its middle."""
        return self.array() if self.groups is None else as_channels(self.array(), self.groups)

    def collect(self, places: Sequence[float], device: DeviceChoice | None = None) -> PhaseHistory:
        """Echoes of unit points at (0, y, 0), y of `places`, m, computed on a `device`: channels added up at the
        reference element, or kept separate."""
        tone = Waveform.tone(center=self.center, duration=1 / self.channel_step)
        kept = "simultaneous" if self.receive == "reference" else "separated"
        raw = self._echo(places, tone, self.track(), device, array=self.array(), channels=kept, receive=self.receive)
        return raw if self.groups is None else replace(raw, array=self.channels())

    def conventional(self, places: Sequence[float], device: DeviceChoice | None = None) -> PhaseHistory:
        """Echoes of the points of `places`, m, on a `device`, with a conventional antenna: the same phase centres and
        track, a chirp of the band.

        One antenna at the mean phase centre; where phase centres spread (`is_wide`), an element for each channel. All
        send the chirp; their echoes are kept separate, and received as the array's channels are.
        """
        chirp = Waveform.chirp(center=self.middle, bandwidth=self.bandwidth, duration=1 / self.channel_step)
        if not self.is_wide:
            return self._echo(places, chirp, _moved(self.track(), self.phase_centers.mean(axis=0)), device)
        channels = self.channels()
        alike = AntennaArray(positions=channels.positions, offsets=np.zeros((1, channels.n)))
        return self._echo(places, chirp, self.track(), device, array=alike, channels="separated", receive=self.receive)

    def _echo(
        self,
        places: Sequence[float],
        waveform: Waveform,
        track: Trajectory,
        device: DeviceChoice | None,
        **options: object,
    ) -> PhaseHistory:
        return echo(
            Scene.points([[0.0, y, 0.0] for y in places]), waveform, track, reference=(0, 0, 0), check=False,
            range_window=(-self.window, self.window), tolerance=1e-4, device=device, **options,
        )  # fmt: skip


def _moved(track: Trajectory, offset: np.ndarray) -> Trajectory:
    """Track of a point at `offset`, m (3,) in the axes of mid-aperture, from the reference point."""
    turned = offset if track.attitude is None else track.attitude @ offset
    return replace(track, positions=track.positions + turned)


def _about_z(angle: np.ndarray) -> np.ndarray:
    """Rotations about z, (n, 3, 3)."""
    c, s, out = np.cos(angle), np.sin(angle), np.zeros((len(angle), 3, 3))
    out[:, 0, 0], out[:, 0, 1], out[:, 1, 0], out[:, 1, 1], out[:, 2, 2] = c, -s, s, c, 1
    return out
