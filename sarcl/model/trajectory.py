"""Trajectories: positions, velocities and attitudes of an antenna at each pulse."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import arguments, validation
from ..base.text import NotebookTable, interval

BYTES_PER_PULSE = 80  # time, position and velocity, and what they are made of


@dataclass(frozen=True, eq=False)
class Trajectory(NotebookTable):
    """Positions of an antenna's phase centre, one per pulse.

    times          s (n,), increasing; or None where they are not known: then there are no velocities either
    positions      m (n, 3)
    velocities     m/s (n, 3) or None
    attitude       rotation from body to scene axes (n, 3, 3) or None
    accelerations  m/s^2 (n, 3) or None
    stop_and_go    whether the antenna rests while a pulse is on its way (default). False, as Orbit.trajectory makes it:
                   positions are Earth-fixed, and `echo` takes the receiver's when the echo arrives; it needs velocities
                   and accelerations

    Raises ValueError when shapes disagree, a value is not finite, or times do not increase.

    >>> flight = sarcl.Trajectory.line(start=(-5e3, -50, 4e3), velocity=(0, 100, 0), prf=100, n_pulses=101)
    >>> flight.positions[50], flight.velocities[50]
    (array([-5000.,     0.,  4000.]), array([  0., 100.,   0.]))
    >>> orbiting = sarcl.Trajectory.circle(radius=5e3, height=4e3, arc=0.1, n_pulses=101, speed=100)
    """

    times: NDArray[np.float64] | None
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64] | None = None
    attitude: NDArray[np.float64] | None = None
    accelerations: NDArray[np.float64] | None = None
    stop_and_go: bool = True

    if TYPE_CHECKING:  # types of the arguments; the fields above have the types after conversion

        def __init__(
            self,
            times: ArrayLike | None,
            positions: ArrayLike,
            velocities: ArrayLike | None = None,
            attitude: ArrayLike | None = None,
            accelerations: ArrayLike | None = None,
            stop_and_go: bool = True,
        ) -> None: ...

    def __post_init__(self) -> None:
        positions = validation.array("trajectory positions", self.positions, np.float64, ("n_pulses", 3))
        n = len(positions)
        if self.times is None:
            if self.velocities is not None or self.accelerations is not None:
                raise ValueError("a trajectory without times has no velocities and no accelerations; give times too")
        else:
            times = validation.array("trajectory times", self.times, np.float64, (n,))
            if n > 1 and not (np.diff(times) > 0).all():
                pulse = int(np.argmax(np.diff(times) <= 0)) + 1
                raise ValueError(
                    f"trajectory times[{pulse}] is {times[pulse]:g} after {times[pulse - 1]:g}; times must increase: "
                    "give every pulse a later time than the one before"
                )
            object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        for name, shape in (("velocities", (n, 3)), ("attitude", (n, 3, 3)), ("accelerations", (n, 3))):
            if getattr(self, name) is not None:
                value = validation.array(f"trajectory {name}", getattr(self, name), np.float64, shape)
                object.__setattr__(self, name, value)
        object.__setattr__(self, "stop_and_go", validation.flag("stop_and_go", self.stop_and_go))
        if not self.stop_and_go and (self.velocities is None or self.accelerations is None):
            raise ValueError(
                "stop_and_go is False, but the trajectory has no velocities or no accelerations, which say where the "
                "antenna is when an echo arrives; give both, or take Orbit.trajectory"
            )

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        first, last = ("(" + ", ".join(f"{x:.6g}" for x in self.positions[i]) + ")" for i in (0, -1))
        times = "without times" if self.times is None else f"over {np.ptp(self.times):.6g} s"
        optional = ("velocities", "attitude", "accelerations")
        fields_text = "".join(f", {name}" for name in optional if getattr(self, name) is not None)
        motion = "" if self.stop_and_go else ", not stop-and-go"
        return f"Trajectory({len(self)} pulses {times}, from {first} to {last} m{fields_text}{motion})"

    def _notebook_rows(self) -> Iterator[tuple[str, str]]:
        yield "pulses", f"{len(self)}"
        steps = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        if self.times is not None:
            first, last = self.times[0], self.times[-1]
            rate = f", {(len(self) - 1) / (last - first):.6g} Hz" if len(self) > 1 else ""
            yield "times", f"{interval((first, last), 's', 9)}{rate}"
            if len(self) > 1:
                yield "speed", interval(steps / np.diff(self.times), "m/s")
        yield "from", f"({', '.join(f'{x:.6g}' for x in self.positions[0])}) m"
        yield "to", f"({', '.join(f'{x:.6g}' for x in self.positions[-1])}) m"
        yield "length", f"{steps.sum():.6g} m"
        known = [n for n in ("velocities", "attitude", "accelerations") if getattr(self, n) is not None]
        yield "also known", ", ".join(known) or "nothing"
        yield "while a pulse travels", "the antenna rests" if self.stop_and_go else "the antenna moves"

    def __str__(self) -> str:
        return "\n".join(["Trajectory", *(f"  {name:<23}{value}" for name, value in self._notebook_rows())])

    @property
    def known_times(self) -> NDArray[np.float64]:
        """Times, s (n,); ValueError where the track has none."""
        if self.times is None:
            raise ValueError("the track has no times, which this needs; give Trajectory times, or circle(..., prf=)")
        return self.times

    def picked(self, pulses: slice | np.ndarray) -> Trajectory:
        """The track at the pulses of a slice, or at increasing pulse numbers."""
        arguments.checked_index("pulses", "a track", pulses, (len(self.positions),))
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        arrays: dict[str, Any] = {n: value[pulses] for n, value in fields.items() if isinstance(value, np.ndarray)}
        return replace(self, **arrays)

    @classmethod
    def line(cls, *, start: ArrayLike, velocity: ArrayLike, prf: float, n_pulses: int) -> Trajectory:
        """Straight track: pulse i < n_pulses at start + i velocity/prf (m, m/s, Hz)."""
        start = validation.array("start", start, np.float64, (3,))
        velocity = validation.array("velocity", velocity, np.float64, (3,))
        prf = validation.number("prf", prf, above=0)
        n = validation.count("n_pulses", n_pulses)
        validation.room(f"a track of {n:.3g} pulses", BYTES_PER_PULSE * float(n), "give fewer pulses")
        if n > 1 and not velocity.any():
            raise ValueError("velocity is (0, 0, 0); the positions of several pulses must differ")
        times = np.arange(n) / prf
        return cls(times, start + times[:, None] * velocity, np.tile(velocity, (n, 1)))

    @classmethod
    def circle(
        cls,
        *,
        radius: float,
        height: float,
        start: float = 0.0,
        arc: float = 2 * np.pi,
        n_pulses: int,
        center: ArrayLike = (0.0, 0.0, 0.0),
        prf: float | None = None,
        speed: float | None = None,
    ) -> Trajectory:
        """Circle of a `radius`, m, about the z axis through `center`, at `height` above it, m.

        Pulse i is at azimuth start + arc i/(n_pulses - 1), rad from +x towards +y: the first pulse at
        `start`, the last at start + arc. Either prf (Hz) or speed (m/s) gives times and velocities; without both the
        track has none, and the antenna rests at each pulse.
        """
        radius = validation.number("radius", radius, above=0)
        height = validation.number("height", height)
        start = validation.number("start", start)
        arc = validation.number("arc", arc)
        n = validation.count("n_pulses", n_pulses)
        validation.room(f"a track of {n:.3g} pulses", BYTES_PER_PULSE * float(n), "give fewer pulses")
        center = validation.array("center", center, np.float64, (3,))
        if n > 1 and arc == 0:
            raise ValueError("arc is 0; the positions of several pulses must differ")
        with np.errstate(all="ignore"):  # what overflows is refused by its name
            if speed is not None:
                if prf is not None:
                    raise ValueError(f"prf {prf!r} and speed {speed!r} both give the times; give one of them")
                if n == 1:
                    raise ValueError("speed gives the times of several pulses, and n_pulses is 1; give prf instead")
                prf = validation.number("speed", speed, above=0) * (n - 1) / (radius * abs(arc))
            elif prf is not None:
                prf = validation.number("prf", prf, above=0)
            angle = start + arc * (np.arange(n) / max(n - 1, 1))
            zero = np.zeros(n)
            ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), zero + height], axis=-1)
            if prf is None:
                return cls(None, center + ring)
            rate = arc / max(n - 1, 1) * prf
            tangent = np.stack([-np.sin(angle), np.cos(angle), zero], axis=-1)
            return cls(np.arange(n) / prf, center + ring, radius * rate * tangent)


def receiver_positions(track: Trajectory, receiver: Trajectory | None) -> np.ndarray:
    """Receiver positions, m (n_pulses, 3): those of the track without a receiver of its own."""
    if receiver is None:
        return track.positions
    validation.instance("receiver", receiver, Trajectory)
    if len(receiver) != len(track):
        raise ValueError(f"receiver has {len(receiver)} positions but track has {len(track)}; give one per pulse")
    return receiver.positions
