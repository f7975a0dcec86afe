"""Pulse compression."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.errors import warn
from ..base.rows import spread_over
from ..base.validation import instance, sealed
from ..model.phase_history import PhaseHistory
from ..model.waveform import Waveform

SOME_ROWS = 16  # rows in which the contrast is measured
NOISE = 2.0  # contrast of the intensity of complex Gaussian noise


def compress(raw: PhaseHistory, waveform: Waveform | None = None) -> PhaseHistory:
    """Apply the matched filter conj(P(f)) to uncompressed echoes; compressed ones come back as they are.

    waveform  default raw.waveform. ValueError where there is none: data of an unknown pulse cannot be compressed.
    SarclWarning where the result has less contrast than noise would, or half of what the filter of a chirp of the other
    sign gives: the pulse that was sent is another one.

    >>> received = sarcl.echo(scene, chirp, track, compressed=False)
    >>> sarcl.compress(received).compressed
    True
    """
    instance("raw", raw, PhaseHistory)
    if waveform is not None and not isinstance(waveform, Waveform):
        raise TypeError(f"waveform is a {type(waveform).__name__}; give a sarcl.Waveform")
    if raw.compressed:
        return raw
    pulse = raw.waveform if waveform is None else waveform
    if pulse is None:
        raise ValueError("raw names no waveform, so its matched filter is unknown; pass compress(raw, waveform)")
    samples = raw.read(0, raw.n_rows)
    out = np.empty_like(samples)
    n = np.arange(raw.n_samples)
    last: tuple[float, float] | None = None
    for p in range(raw.n_rows):
        plan = raw.frequency[p], raw.frequency_step[p]
        if plan != last:  # rows mostly share one frequency plan
            matched, last = np.conj(pulse.pulse_spectrum(plan[0] + plan[1] * n)), plan
        out[p] = samples[p] * matched
    compressed = replace(raw, samples=sealed(out), waveform=pulse, compressed=True)
    _check_contrast(compressed, raw, pulse)
    return compressed


def _check_contrast(compressed: PhaseHistory, raw: PhaseHistory, pulse: Waveform) -> None:
    """Warn where compression has spread the echoes: by a wrong chirp they become longer, not shorter."""
    rows = spread_over(raw.n_rows, SOME_ROWS)
    level = _contrast([compressed.read(p, p + 1)[0] for p in rows])
    # the contrast of n samples of noise is 2, with a standard deviation of 2/sqrt(n)
    doubt = 10 / np.sqrt(len(rows) * raw.n_samples)
    other = 0.0
    if pulse.sweep_rate is not None:
        f = raw.frequency[rows, None] + raw.frequency_step[rows, None] * np.arange(raw.n_samples)
        other = _contrast([raw.read(p, p + 1)[0] * pulse.pulse_spectrum(f[i]) for i, p in enumerate(rows)])
    if other > max(2 * level, NOISE + doubt):
        down = pulse.kind == "chirp"
        warn(
            f"the compressed echoes have a contrast (mean square over squared mean of intensity) of {level:.3g}, and "
            f"{other:.3g} with a chirp of the other sign; noise has {NOISE:g}: the sweep that was sent probably "
            f"{'falls' if down else 'rises'}, give Waveform.chirp(..., down={down})"
        )
    elif 0 < level < NOISE - doubt:
        warn(
            f"the compressed echoes have a contrast (mean square over squared mean of intensity) of {level:.3g}, less "
            f"than the {NOISE:g} of noise: the pulse that was sent is probably another one; check the waveform's "
            "bandwidth, duration and sign, or give Waveform.sampled(...) of a replica"
        )


def _contrast(rows: list[np.ndarray]) -> float:
    """Mean square over squared mean of the intensity in range, the average of rows that are not zero; 0 of none."""
    intensity = (np.abs(np.fft.ifft(row.astype(np.complex128))) ** 2 for row in rows if row.any())
    contrasts = [float(np.mean((i / i.max()) ** 2) / np.mean(i / i.max()) ** 2) for i in intensity]
    return float(np.mean(contrasts)) if contrasts else 0.0
