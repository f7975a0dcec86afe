"""The waveform of the incident wave, by its spectrum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import log, pi, sqrt

import numpy as np

from ..base.validation import number

EDGE = 0.1  # spectrum of a gaussian pulse at both ends of its band, relative to its middle
SILENCE = 1e-8  # of the peak: weaker values of a pulse are zero, in time and in frequency


@dataclass(frozen=True, eq=False)
class Pulse:
    """A waveform about time zero.

    spectrum     complex or real values at frequencies, Hz (n,), all positive; any scale
    half_length  s: the waveform is negligible before -half_length and after half_length
    highest      Hz: the spectrum is negligible above
    """

    spectrum: Callable[[np.ndarray], np.ndarray]
    half_length: float
    highest: float

    def __post_init__(self) -> None:
        number("half_length", self.half_length, above=0)
        number("highest", self.highest, above=0)

    @classmethod
    def gaussian(cls, low: float, high: float) -> Pulse:
        """A sine under a Gaussian, for frequencies from `low` to `high`, Hz; its mean over time is 0."""
        low, high = number("low", low, least=0), number("high", high, above=low)
        middle, sigma = (low + high) / 2, (high - low) / 2 / sqrt(-2 * log(EDGE))
        reach = sqrt(-2 * log(SILENCE))

        def spectrum(f: np.ndarray) -> np.ndarray:
            lines = (np.exp(-(((f + side * middle) / sigma) ** 2) / 2) for side in (-1, 1))
            return np.asarray(-1j * np.subtract(*lines))

        return cls(spectrum, reach / (2 * pi * sigma), middle + reach * sigma)
