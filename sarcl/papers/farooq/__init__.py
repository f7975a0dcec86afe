"""Farooq 2009: frequency-diverse arrays in synthetic aperture radar. Every figure and table, published and measured.

Source: J. Farooq, Frequency Diversity for Improving Synthetic Aperture Radar Imaging, dissertation, Air Force Institute
of Technology, AFIT/DEE/ENG/09-04, 2009. Figures, tables and equations are numbered as there.

For other folders:

    range_zones   range zones separated by carriers that continue from pulse to pulse (sarcl's own experiment)

For this folder alone, a section or a group of sections of the page each, and what they share:

    _aperture     5.2, 5.3: apparent apertures, without and with the switch of carriers at mid-aperture
    _errata       errors in the printed equations and figures
    _field        4.4: delay of the pulse's peak against direction
    _focus        5.1: backprojection of frequency-diverse echoes, unmodified and corrected
    _lab          echoes and images that several sections share
    _off_centre   points off the centre, two points, spatial frequencies (sarcl's own check)
    _pattern      chapter 3: patterns of planar arrays
    _pulse        chapter 4: the pulse, its spectrum and its ambiguity function
    _reference    2.2: the reference image
    _trend        5.3.2: nulls and side lobes against the frequency step
    _zones        range zones (sarcl's own experiment)
"""

from __future__ import annotations

from ..paper import Paper
from . import _aperture, _errata, _field, _focus, _lab, _off_centre, _pattern, _pulse, _reference, _trend, _zones

__all__ = ["PAPER", "range_zones"]

PAPER = Paper.of(
    "farooq",
    lab=_lab.Lab,
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
        _off_centre.section,
        _zones.section,
        _errata.section,
    ),
)
