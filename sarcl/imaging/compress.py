"""Pulse compression."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.validation import sealed
from ..model.phase_history import PhaseHistory
from ..model.waveform import Waveform


def compress(raw: PhaseHistory, waveform: Waveform | None = None) -> PhaseHistory:
    """Apply the matched filter conj(P(f)) to uncompressed echoes; compressed ones come back as they are.

    waveform  default raw.waveform. ValueError where there is none: data of an unknown pulse cannot be compressed.
    """
    if raw.compressed:
        return raw
    pulse = raw.waveform if waveform is None else waveform
    if pulse is None:
        raise ValueError("raw names no waveform, so its matched filter is unknown; pass compress(raw, waveform)")
    if not isinstance(pulse, Waveform):
        raise TypeError(f"waveform is a {type(pulse).__name__}; give a sarcl.Waveform")
    samples = raw.read(0, raw.n_rows)
    out = np.empty_like(samples)
    n = np.arange(raw.n_samples)
    last: tuple[float, float] | None = None
    for p in range(raw.n_rows):
        plan = raw.frequency[p], raw.frequency_step[p]
        if plan != last:  # rows mostly share one frequency plan
            matched, last = np.conj(pulse.pulse_spectrum(plan[0] + plan[1] * n)), plan
        out[p] = samples[p] * matched
    return replace(raw, samples=sealed(out), waveform=pulse, compressed=True)
