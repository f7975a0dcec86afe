"""A phase history as the signals of a CRSD file: the chirps that were sent, and the radiometry that metadata= gives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...base import validation
from ...io.cphd.crsd_writing import Signals
from ..waveform import Waveform
from .collection import CphdOptions, collection_of
from .words import Words

if TYPE_CHECKING:
    from ...io.cphd.writing import Collection
    from ..phase_history import PhaseHistory

# what CRSD must say of power and noise
NUMBERS = (
    *("TxRefRadIntensity", "TxRadIntErrorStdDev", "TxRefLAtm"),
    *("RcvRefIrradiance", "RcvIrradianceErrorStdDev", "RcvRefLAtm", "PNCRSD", "BNCRSD"),
)
PULSE = ("TXmt", "FxRate")


def crsd_of(raw: PhaseHistory, options: CphdOptions) -> tuple[Collection, Signals]:
    """All that a CRSD file says of a phase history; ValueError for what is missing, with the key that gives it."""
    metadata = dict(options.metadata or {})
    words = Words("CRSD", {key: metadata.pop(key) for key in (*NUMBERS, *PULSE) if key in metadata}, (*NUMBERS, *PULSE))
    collection = collection_of(raw, options._replace(metadata=metadata))
    if collection.names["CollectType"] == "BISTATIC" and "IlluminatorName" not in collection.names:
        raise ValueError(
            "two platforms have two sensors; give metadata={'IlluminatorName': ...} of the transmitting one"
        )
    for name in {name for each in collection.channels for name in each.polarizations} - {"H", "V"}:
        raise ValueError(f"polarization {name!r} is not written to CRSD; H and V are: raw.select(polarization=...)")
    numbers = {}
    for key in NUMBERS:
        value = words.need(key, f"the echoes have no {key}")
        numbers[key] = validation.number(f"metadata[{key!r}]", value)
        if numbers[key] < 0 or (key == "BNCRSD" and not 0 < numbers[key] <= 1):
            wanted = "above 0, at most 1" if key == "BNCRSD" else "0 or more"
            raise ValueError(f"metadata[{key!r}] is {numbers[key]:g}, wanted {wanted}")
    chirp = _chirp(raw, words)
    middle = collection.frequency + (raw.n_samples - 1) / 2 * collection.frequency_step
    carrier = np.full(raw.n_rows, chirp.center) if raw.array is None and raw.waveform is not None else middle
    assert chirp.sweep_rate is not None
    return collection, Signals(chirp.duration, chirp.sweep_rate, chirp.bandwidth, carrier, numbers)


def _chirp(raw: PhaseHistory, words: Words) -> Waveform:
    """The chirp that was sent: the waveform of the echoes, or of the length and rate that metadata= gives."""
    if raw.waveform is not None:
        doubled = [key for key in PULSE if key in words.values]
        if doubled:
            raise ValueError(f"metadata has {doubled[0]!r}, and the echoes have a waveform; leave it out")
        if raw.waveform.sweep_rate is None:
            raise ValueError(
                f"the pulse that was sent is a {raw.waveform.kind}, and sarcl writes CRSD of chirps; save "
                "as CPHD, or give dataclasses.replace(raw, waveform=sarcl.Waveform.chirp(...)) for another pulse"
            )
        return raw.waveform
    why = "the echoes do not know their pulse"
    duration, rate = (validation.number(f"metadata[{key!r}]", words.need(key, why)) for key in PULSE)
    if duration <= 0 or rate == 0:
        raise ValueError(
            f"metadata has TXmt = {duration:g} s and FxRate = {rate:g} Hz/s; give a length above 0, a rate not 0"
        )
    center = float(raw.frequency[0] + (raw.n_samples - 1) / 2 * raw.frequency_step[0])
    return Waveform.chirp(center=center, bandwidth=abs(rate) * duration, duration=duration, down=rate < 0)
