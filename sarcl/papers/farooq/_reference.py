"""Farooq 2009, section 2.2: the reference image for all others, with a chirp and with a tone."""

from __future__ import annotations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...experiments.fda.case import Case
from ...model.waveform import Waveform
from ..paper import Section
from ._lab import Lab

F0, BAND, LENGTH, DISTANCE = 10e9, 900e6, 450.0, 5e3  # table 2.1
PRINTED = 0.167  # m, theoretical resolution both ways, table 2.1
# The positions of the 13 points cannot be read in the scan of figure 2.11: here they are a diamond, 1 m apart.
DIAMOND = tuple((float(x), float(y), 0.0) for x in range(-2, 3) for y in range(-2, 3) if abs(x) + abs(y) <= 2)


def section(lab: Lab) -> Section:
    """Figures 2.13 to 2.16."""
    out = Section.of("farooq", "reference")
    case = Case("table 2.1", aperture=LENGTH, n_pulses=451, distance=DISTANCE)
    chirp = Waveform.chirp(center=F0, bandwidth=BAND, duration=1e-6)
    # 16 lobes of the spectrum: the triangle is right to 2 % of its peak.
    tone = Waveform.tone(center=F0, duration=1 / BAND, bandwidth=16 * BAND)
    curves: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = {"range": {}, "cross-range": {}}
    figures = []
    for name, waveform in (("LFM", chirp), ("tone", tone)):
        point = lab.single(case, waveform)
        for axis, way in enumerate(curves):
            curves[way][name] = lab.cut(point, axis, 0.8, 801)
            null = lab.measure(point, axis)["null"]
            out.number("{name}: first null in {way}", null, expected=PRINTED, name=name, way=way)
        caption = f"{name}: 13 points (figure {'2.13' if name == 'LFM' else '2.14'})."
        # the tone's spectrum fills a sixteenth of the samples' band, which lowers all levels alike
        unit = float(curves["range"][name][1].max())
        figures.append(lab.picture(lab.single(case, waveform, DIAMOND), caption, unit=unit))
    _shapes(out, curves)
    out.say()
    out.draw(*figures)
    for figure, (way, response) in zip(("2.15", "2.16"), curves.items(), strict=True):
        cuts = [(name, places, values / values.max()) for name, (places, values) in response.items()]
        out.plot("Cut through the centre point along {way}", cuts, way=way, figure=figure)
        out.keep(**{f"{way} {name}": {"m": places[::4], "modulus": v[::4]} for name, (places, v) in response.items()})
    return out


def _shapes(out: Section, curves: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]) -> None:
    """Largest difference of the responses from a sinc and a triangle, over main lobe and side lobes."""
    cell = SPEED_OF_LIGHT / (2 * BAND)
    for name, law in (("LFM", "sinc"), ("tone", "triangular")):
        places, values = curves["range"][name]
        x = places / cell
        law_values = np.abs(np.sinc(x)) if law == "sinc" else np.maximum(1 - np.abs(x), 0)
        off = float(np.abs(values / values.max() - law_values).max())
        out.states("{name}: shape of the range response", off, off < 0.05, expected=law, name=name, law=law)
    chirp = curves["cross-range"]["LFM"][1]
    tone = curves["cross-range"]["tone"][1]
    off = float(np.abs(chirp / chirp.max() - tone / tone.max()).max())
    out.states("cross-range responses of both", off, off < 0.05)
