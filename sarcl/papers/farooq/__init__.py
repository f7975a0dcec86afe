"""Farooq 2009: frequency-diverse arrays in synthetic aperture radar. Every figure and table, published beside measured.

Source: J. Farooq, Frequency Diversity for Improving Synthetic Aperture Radar Imaging, dissertation, Air Force Institute
of Technology, AFIT/DEE/ENG/09-04, 2009. Figures, tables and equations are numbered as there.

For other folders:

    range_zones   range zones separated by carriers that continue from pulse to pulse (sarcl's own)

For this folder alone, a section or a group of sections each:

    _aperture     5.2, 5.3: apparent apertures, without the switch and with it
    _errata       errors in print
    _field        4.4: delay of the pulse's peak against direction
    _focus        5.1: backprojection of diverse data, unmodified and corrected
    _honest       off-centre points, two points, spatial frequencies (sarcl's own check)
    _pattern      chapter 3: patterns of planar arrays
    _pulse        chapter 4: the pulse, its spectrum and its ambiguity function
    _reference    2.2: the reference image
    _trend        5.3.2: nulls and side lobes against the frequency step
    _zones        range zones (sarcl's own experiment)
"""

from __future__ import annotations

from .. import PAPERS
from ..paper import Paper
from . import _aperture, _errata, _field, _focus, _honest, _pattern, _pulse, _reference, _trend, _zones

__all__ = ["PAPER", "range_zones"]

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
