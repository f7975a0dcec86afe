"""Farooq 2009: frequency-diverse arrays in synthetic aperture radar. Every figure and table, published beside measured.

Source: J. Farooq, Frequency Diversity for Improving Synthetic Aperture Radar Imaging, dissertation, Air Force Institute
of Technology, AFIT/DEE/ENG/09-04, 2009. Figures, tables and equations are numbered as there.
"""

from __future__ import annotations

from .. import PAPERS
from ..paper import Paper
from . import _aperture, _errata, _field, _focus, _honest, _pattern, _pulse, _reference, _trend, _zones

ABOUT = (
    "An array whose elements send a carrier each makes a pulse, by the sum of its carriers, that passes at another "
    "time in every direction. The dissertation makes images of such echoes, and proposes to backproject them from "
    "apparent places, so that a short aperture does what a longer one would. This page does all of it again. Source: "
    + PAPERS["farooq"] + " (AFIT/DEE/ENG/09-04)."
)  # fmt: skip

PAPER = Paper(
    name="farooq",
    title="Frequency-diverse arrays: Farooq 2009, published beside measured",
    about=ABOUT,
    sections=(
        _reference.section,
        _pattern.patterns,
        _pattern.errors,
        _pulse.waveform,
        _pulse.ambiguities,
        _field.delays,
        _field.snapshots,
        _focus.section,
        _aperture.steady,
        _aperture.switched,
        _aperture.nulls,
        _trend.trends,
        _trend.abstract,
        _honest.section,
        _zones.section,
        _errata.section,
    ),
)
