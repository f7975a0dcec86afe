"""The radar of Zou et al. 2021, table 1, at its range or nearer by a whole factor; samples as its receiver has them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform

# Table 1
CENTER, BANDWIDTH, SAMPLING, DURATION = 1.5e9, 500e6, 600e6, 20e-9  # Hz, Hz, Hz, s
SPEED, PRF, PULSES, INCIDENCE = 300.0, 1200.0, 1536, np.radians(45)  # m/s, Hz, number, rad
RANGE_RESOLUTION = AZIMUTH_RESOLUTION = 0.3  # m
DOPPLER = 1000.0  # Hz

CHIRP = Waveform.chirp(center=CENTER, bandwidth=BANDWIDTH, duration=DURATION)
WAVELENGTH = SPEED_OF_LIGHT / CENTER
HALF_BEAM = float(np.arcsin(DOPPLER * WAVELENGTH / (4 * SPEED)))  # rad: 9.59 deg
RANGE = PULSES / PRF * SPEED / 2 / np.tan(HALF_BEAM)  # m: the pulses just cross the beam. The paper prints no range
GUARD = 2e-9  # s, of the record before and after the echoes


@dataclass(frozen=True, eq=False)
class Radar:
    """Stripmap at -x, looking at the origin; range, track and number of pulses are table 1's over `reduction`.

    The track runs along y, symmetrical about 0; the beam and the interval of pulses are table 1's.
    """

    reduction: int = 1

    @property
    def range_(self) -> float:
        """Of the origin where the track passes it, m."""
        return RANGE / self.reduction

    @cached_property
    def track(self) -> Trajectory:
        """Positions at the pulses; time 0 is where the origin is passed."""
        n = PULSES // self.reduction
        times = (np.arange(n) - (n - 1) / 2) / PRF
        middle = np.array([-np.sin(INCIDENCE), 0.0, np.cos(INCIDENCE)]) * self.range_
        velocity = np.array([0.0, SPEED, 0.0])
        return Trajectory(times, middle + times[:, None] * velocity, np.tile(velocity, (n, 1)))

    def grid(self, half: tuple[float, float], spacing: float) -> ImageGrid:
        """Pixels in the plane of track and origin: azimuth and slant range from -half to half, m, about the origin."""
        shape = [2 * round(h / spacing) + 1 for h in half]
        return ImageGrid.plane(
            shape=shape,
            spacing=spacing,
            normal=(np.cos(INCIDENCE), 0.0, np.sin(INCIDENCE)),
            x_axis=(np.sin(INCIDENCE), 0.0, -np.cos(INCIDENCE)),
        )

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Azimuth and slant range of points (n, 3) about the origin, m (n, 2), as images show them."""
        across = np.hypot(
            points[:, 0] + self.range_ * np.sin(INCIDENCE), points[:, 2] - self.range_ * np.cos(INCIDENCE)
        )
        return np.column_stack([points[:, 1], across - self.range_])


@dataclass(frozen=True, eq=False)
class Record:
    """Samples in time of all pulses, one receiver: complex (n_pulses, n), sqrt(m^2).

    A pulse of a point of RCS 1 m^2 has modulus 1, but for the ripples of its spectrum, which is cut at the band.
    rate  Hz;  start  of sample 0 after the middle of the pulse sent, s;  carrier  Hz that was mixed to 0
    """

    samples: np.ndarray
    rate: float
    start: float
    carrier: float

    @property
    def times(self) -> np.ndarray:
        """Of the samples, s (n,)."""
        return np.asarray(self.start + np.arange(self.samples.shape[1]) / self.rate)


def received(raw: PhaseHistory, rate: float = SAMPLING, carrier: float = CENTER) -> Record:
    """Samples that a receiver takes of the echoes of `CHIRP`, from the compressed echoes: the pulse is put back.

    One window of time for all pulses, whatever their range; carrier 0: the field itself, its imaginary part being its
    Hilbert transform.
    """
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    delay = 2 * raw.reference_range / SPEED_OF_LIGHT
    half = 0.5 / raw.frequency_step[0]  # s: echoes repeat themselves in time
    start = float(delay.min()) - half - GUARD
    n = int(np.ceil((delay.max() + half + GUARD - start) * rate)) + 1
    times = start + np.arange(n) / rate
    # of the pulse exp(j pi t^2 BANDWIDTH/DURATION): stationary phase adds pi/4
    peak = np.sqrt(DURATION / BANDWIDTH) * np.exp(0.25j * np.pi)
    pulse = CHIRP.pulse_spectrum(f) * raw.frequency_step[0] * peak
    # from a common time on, so that all pulses share the waves
    waves = np.exp(2j * np.pi * np.outer(f, times - start))
    shifted = raw.read(0, raw.n_rows) * (pulse * np.exp(2j * np.pi * np.outer(start - delay, f)))
    samples = (shifted @ waves) * np.exp(-2j * np.pi * carrier * times)
    samples[np.abs(times - delay[:, None]) >= half] = 0
    return Record(samples, rate, start, carrier)


def recorded(record: Record, raw: PhaseHistory) -> PhaseHistory:
    """Echoes from a receiver's samples, still with the spectrum of the pulse; geometry of `raw`, of which they are.

    The pulse of `received` has the spectrum of `CHIRP` alone, of modulus 1 in the band; a pulse with sharp ends has
    another.
    """
    history = PhaseHistory.from_time(
        record.samples, kind="compressed", rate=record.rate, start=record.start, carrier=record.carrier,
        bandwidth=BANDWIDTH, tx=raw.tx, time=raw.time, tx_velocity=raw.tx_velocity, rx_velocity=raw.rx_velocity,
    )  # fmt: skip
    peak = np.sqrt(DURATION * BANDWIDTH) * np.exp(0.25j * np.pi)  # as in `received`, and BANDWIDTH from_time takes
    samples = (history.read(0, history.n_rows) / peak).astype(np.complex64)
    return replace(history, samples=samples, waveform=CHIRP, compressed=False)
