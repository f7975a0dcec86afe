"""Range zones separated by carriers that continue from pulse to pulse.

An echo from zone q, at r0 + q c/(2 PRF) + r', arrives q pulses later, among those of zone 0. Oscillators that run
without a break have the absolute delay tau in their phase. Element n's return in the time of the interval is then

    a P(f - f_n) exp(-j 2 pi f (tau - q/PRF - tau_ref)) exp(-j 2 pi f_n q/PRF)

The last factor steps by 2 pi q df/PRF from element to element. Where df/PRF = 1/P (mod 1) and N is a multiple of P, the
zones 0 ... P - 1 are orthogonal over the elements. The relative level of zone q' in the image of zone q is

    |sin(N x/2)/(N sin(x/2))|,   x = 2 pi (q' - q) df/PRF - 2 pi f0 d (u' - u)/c

d the spacing, u' and u the cosines of the echo and the pixel along the array. With carriers
that restart in every pulse, or equal carriers, it is 1. The receiver must separate the elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...arrays.array_factor import dirichlet
from ...base import validation
from ...base.constants import SPEED_OF_LIGHT
from ...imaging.backproject import backproject
from ...model.antenna_array import AntennaArray
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...opencl.device import DeviceChoice
from ...scene.scene import Scene
from ...simulation.echo import echo

WINDOW = 100.0  # m, half width of the range window about the centre of a zone


@dataclass(frozen=True)
class RangeZones:
    """A radar on a level track along y with a vertical array; zones lie one behind the other along x.

    n, spacing m, step Hz   elements, along z
    center, bandwidth Hz, prf Hz, speed m/s, n_pulses
    distance m              of zone 0's centre from the middle of the track; the others c/(2 prf) farther each
    """

    n: int = 8
    step: float = 40.5e3
    spacing: float = 0.0156
    center: float = 9.6e9
    bandwidth: float = 30e6
    prf: float = 2e3
    speed: float = 7.5e3
    n_pulses: int = 32
    distance: float = 800e3

    def __post_init__(self) -> None:
        for name in ("n", "n_pulses"):
            object.__setattr__(self, name, validation.count(name, getattr(self, name)))
        for name in ("spacing", "center", "bandwidth", "prf", "speed", "distance"):
            object.__setattr__(self, name, validation.number(name, getattr(self, name), above=0))
        object.__setattr__(self, "step", validation.number("step", self.step))

    @property
    def depth(self) -> float:
        """Distance from zone to zone, c/(2 prf), m."""
        return SPEED_OF_LIGHT / (2 * self.prf)

    @property
    def array(self) -> AntennaArray:
        """The elements and their carriers."""
        return AntennaArray.linear(self.n, spacing=self.spacing, frequency_step=self.step, axis=(0.0, 0.0, 1.0))

    def place(self, zone: int, beyond: float = 0.0, elevation: float = 0.0) -> np.ndarray:
        """A position in a zone, m (3,): `beyond` m behind its centre, `elevation` rad above it from the radar."""
        far = self.distance + zone * self.depth + beyond
        return np.array([far * np.cos(elevation), 0.0, far * np.sin(elevation)])

    def track(self, late: int = 0) -> Trajectory:
        """Positions of the radar at each pulse, or `late` pulses before."""
        pulse = np.arange(self.n_pulses)
        y = (pulse - late - (self.n_pulses - 1) / 2) * (self.speed / self.prf)
        return Trajectory(pulse / self.prf, np.stack([0 * y, y, 0 * y], axis=1))


def collect(radar: RangeZones, scenes: Sequence[Scene | None], device: DeviceChoice | None = None) -> PhaseHistory:
    """The received record: echoes of all zones, added up in every interval, a row for each pulse and element.

    scenes  one per zone, from zone 0 on, at positions of `radar.place`; None: an empty zone

    Distances are exact, from the position at transmission to the position at reception. The geometry of the result is
    that of zone 0; `of_zone` gives the geometry of another zone. ValueError: no scene at all.
    """
    total: PhaseHistory | None = None
    for zone, scene in enumerate(scenes):
        if scene is None:
            continue
        own = _echo(radar, zone, scene, device)
        shifted = own.samples * np.exp(-2j * np.pi * _cycles(radar, own, zone))
        total = replace(own, samples=shifted if total is None else total.samples + shifted)
    if total is None:
        raise ValueError(f"scenes has {len(scenes)} zones and all are empty; give one of them a scene")
    return _as_of(radar, total, 0)


def of_zone(radar: RangeZones, received: PhaseHistory, zone: int) -> PhaseHistory:
    """The record with delays and phases of zone `zone`: for `sarcl.backproject`, on a grid in that zone.

    Delays are counted from the pulse that this zone returns. exp(+j 2 pi f_n zone/PRF) takes out the phase of the
    carriers since then, so that echoes of other zones cancel over the elements.
    """
    shifted = received.samples * np.exp(2j * np.pi * _cycles(radar, received, zone))
    return _as_of(radar, replace(received, samples=shifted), zone)


def isolation(radar: RangeZones, apart: int, elevation: float = 0.0) -> float:
    """Level in an image of an echo from `apart` zones farther, `elevation` rad above the pixel, dB <= 0.

    The ratio in the module's docstring; -inf where zones are orthogonal.
    """
    cycles = np.mod(apart * radar.step / radar.prf, 1.0)
    cycles -= radar.center * radar.spacing * np.sin(validation.number("elevation", elevation)) / SPEED_OF_LIGHT
    ratio = abs(float(dirichlet(2 * np.pi * cycles, radar.n))) / radar.n
    return 20 * float(np.log10(ratio)) if ratio > 1e-12 else -np.inf


def amplitudes(
    radar: RangeZones,
    record: PhaseHistory,
    zone: int,
    at: np.ndarray,
    elevation: float = 0.0,
    device: DeviceChoice | None = None,
) -> np.ndarray:
    """Amplitudes of a zone's image, `at` m behind its centre (n,)."""
    grid = ImageGrid.points(np.stack([radar.place(zone, b, elevation) for b in at]))
    image = backproject(of_zone(radar, record, zone), grid, tolerance=1e-5, check=False, device=device)
    return np.abs(image.normalized())


def leak(radar: RangeZones, apart: int, elevation: float = 0.0, device: DeviceChoice | None = None) -> float:
    """Measured level in zone 0's image of a point `apart` zones farther, `elevation` rad above, dB over its own."""
    scenes: list[Scene | None] = [None] * apart
    record = collect(radar, [*scenes, Scene.points([radar.place(apart, 0.0, elevation)])], device)
    levels = [
        float(amplitudes(radar, record, q, np.zeros(1), up, device)[0]) for q, up in ((0, 0.0), (apart, elevation))
    ]
    return 20 * float(np.log10(max(levels[0] / levels[1], 1e-9)))


def _echo(radar: RangeZones, zone: int, scene: Scene, device: DeviceChoice | None) -> PhaseHistory:
    """Echoes of one zone, delays and phases from its own centre, element by element."""
    chirp = Waveform.chirp(center=radar.center, bandwidth=radar.bandwidth, duration=1e-5)
    return echo(
        scene, chirp, radar.track(zone), receiver=radar.track(), array=radar.array, channels="separated",
        reference=radar.place(zone), range_window=(-WINDOW, WINDOW), tolerance=1e-5, check=False, device=device,
    )  # fmt: skip


def _cycles(radar: RangeZones, raw: PhaseHistory, zone: int) -> np.ndarray:
    """Phase, cycles, by which a zone's samples lag; delays in the interval are counted from zone 0's centre."""
    late = 2 * (_ends(radar, zone)[2] - _ends(radar, 0)[2]) / SPEED_OF_LIGHT - zone / radar.prf
    carrier = radar.center + np.tile(radar.array.offsets[0], radar.n_pulses)
    f = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
    return np.asarray(np.mod(f * late[:, None], 1.0) + np.mod(carrier * (zone / radar.prf), 1.0)[:, None])


def _as_of(radar: RangeZones, raw: PhaseHistory, zone: int) -> PhaseHistory:
    """The same samples with a zone's geometry."""
    tx, rx, half = _ends(radar, zone)
    return replace(raw, samples=validation.sealed(raw.samples.astype(np.complex64)), tx=tx, rx=rx, reference_range=half)


def _ends(radar: RangeZones, zone: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions of the sending element and of the receiver, m (n_rows, 3); half the path over the zone's centre, m."""
    tx = (radar.track(zone).positions[:, None] + radar.array.positions).reshape(-1, 3)
    rx = np.repeat(radar.track().positions, radar.n, axis=0)
    ways = [np.linalg.norm(end - radar.place(zone), axis=1) for end in (tx, rx)]
    return tx, rx, (ways[0] + ways[1]) / 2
