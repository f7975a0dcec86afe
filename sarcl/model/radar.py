"""The radar equation as named factors: the signal that a radar receives from a unit cross section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import constants, validation
from .phase_history import PhaseHistory
from .waveform import Waveform

MOST_DECIBELS = 300.0  # largest losses, dB: amplitudes stay within float32
BOLTZMANN = 1.380649e-23  # Boltzmann's constant, J/K, exact


@dataclass(frozen=True, kw_only=True)
class Radar:
    """Factors of the radar equation other than range and antenna gains.

    power                W, transmitted power at the peak of the pulse
    losses_db            dB, sum of all losses, both ways, 0 to 300
    noise_temperature    K, of the whole receiving system; None: unknown

    ValueError names the wrong argument. Samples with a Radar are in sqrt(W): |sample|^2 is the power received from the
    scatterers during the pulse. Without one (the default of `sarcl.echo`) a unit cross section gives samples of modulus
    1 at any range.

    >>> radar = sarcl.Radar(power=5e3, losses_db=3, noise_temperature=600)
    >>> received = sarcl.echo(scene, chirp, track, radar=radar)  # samples in sqrt(W)
    >>> level = radar.factor(9.6e9)  # sqrt(W) m
    >>> float(radar.amplitude(9.6e9, tx_range=1e4, rx_range=1e4, tx_gain=1e2, rx_gain=1e2) / level)
    0.0001
    """

    power: float
    losses_db: float = 0.0
    noise_temperature: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "power", validation.number("radar power", self.power, above=0))
        object.__setattr__(self, "losses_db", validation.number("radar losses_db", self.losses_db, least=0))
        if self.losses_db > MOST_DECIBELS:
            raise ValueError(f"radar losses_db is {self.losses_db:g}; at most {MOST_DECIBELS:g} dB: was it a factor?")
        if self.noise_temperature is not None:
            value = validation.number("radar noise_temperature", self.noise_temperature, above=0)
            object.__setattr__(self, "noise_temperature", value)

    def factor(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """sqrt(P lambda^2/((4 pi)^3 L)), sqrt(W) m, at `frequency` Hz (...): all that does not depend on position."""
        f = validation.values("frequency", frequency)
        if not (f > 0).all():
            raise ValueError(f"frequency is {f.min():g} Hz; it must be positive")
        wave = constants.SPEED_OF_LIGHT / f
        loss = 10 ** (self.losses_db / 10)
        return np.asarray(np.sqrt(self.power / ((4 * np.pi) ** 3 * loss)) * wave)

    def amplitude(
        self,
        frequency: ArrayLike,
        tx_range: ArrayLike,
        rx_range: ArrayLike,
        tx_gain: ArrayLike = 1.0,
        rx_gain: ArrayLike = 1.0,
    ) -> NDArray[np.inexact]:
        """sqrt(W) received from a cross section of 1 m^2: factor x spreading x amplitude gains.

        frequency           Hz (...);  tx_range, rx_range  from each antenna, m (...)
        tx_gain, rx_gain    amplitude gains (...), sqrt(G), which may be complex (`Antenna.gain`)

        Its square is P G_t G_r lambda^2/((4 pi)^3 R_t^2 R_r^2 L). Source: Skolnik, Radar Handbook, 3rd ed., ch. 1, for
        two antennas.
        """
        named_gains = (("tx_gain", tx_gain), ("rx_gain", rx_gain))
        gains = [validation.values(name, gain, np.complex128) for name, gain in named_gains]
        out = self.factor(frequency) * spreading(tx_range, rx_range) * gains[0] * gains[1]
        return out if np.iscomplexobj(tx_gain) or np.iscomplexobj(rx_gain) else out.real


def spreading(tx_range: ArrayLike, rx_range: ArrayLike) -> NDArray[np.float64]:
    """1/(tx_range rx_range), 1/m^2. ValueError where a range is 0 or less: an antenna stands on a scatterer.

    >>> float(sarcl.radar.spreading(5e3, 1e4))
    2e-08
    """
    ranges = []
    for name, value in (("tx_range", tx_range), ("rx_range", rx_range)):
        r = validation.values(name, value)
        if not (r > 0).all():
            least = r[~(r > 0)].ravel()[0]
            raise ValueError(
                f"{name} is {least:g} m: an antenna stands on a scatterer, where the radar equation is not defined; "
                "move it, or give ranges above 0"
            )
        ranges.append(r)
    return 1 / (ranges[0] * ranges[1])


def noise_variance(raw: PhaseHistory, temperature: float, waveform: Waveform | None = None) -> NDArray[np.float64]:
    """Mean |noise|^2, W, of samples of the echoes `raw` at W = 1, one per row: k T_s/(df E), E the peak of |P|^2, s^2.

    temperature  T_s of the system's noise, K;  waveform  of the pulse, None: that of `raw`

    A sample is the received spectrum over P's largest value (times the matched filter's, of peak 1, once compressed);
    noise of k T_s W/Hz over one period 1/df of the row contributes k T_s/df. A chirp has E = duration/bandwidth, so a
    point's focused signal-to-noise ratio is (its power) duration n_pulses/(k T_s): the energy over the noise density.

    >>> variance = sarcl.radar.noise_variance(raw, temperature=290)  # W
    >>> variance.shape
    (64,)
    """
    validation.instance("raw", raw, PhaseHistory)
    if waveform is not None:
        validation.instance("waveform", waveform, Waveform)
    temperature = validation.number("temperature", temperature, above=0)
    pulse = raw.waveform if waveform is None else waveform
    if pulse is None:
        raise ValueError("raw has no waveform, so its pulse energy is unknown; set raw.waveform, or give nesz_db=")
    return np.asarray(BOLTZMANN * temperature / (raw.frequency_step * pulse.peak_energy_density))
