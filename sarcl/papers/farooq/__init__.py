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

from .. import PAPERS
from ..paper import Paper
from . import _aperture, _errata, _field, _focus, _lab, _off_centre, _pattern, _pulse, _reference, _trend, _zones

__all__ = ["PAPER", "range_zones"]

ABOUT = (
    "In a frequency-diverse array every element sends a carrier of its own. The sum of the carriers is a pulse whose "
    "delay depends on the direction. The dissertation focuses echoes of such arrays. It proposes to backproject them "
    "from apparent positions of the antenna, so that a short aperture would resolve like a longer one. This page "
    "reproduces its figures and tables. Source: " + PAPERS["farooq"] + " (AFIT/DEE/ENG/09-04)."
)
TERMS = (
    ("FDA, CFA", "Frequency-diverse array: a carrier per element, f0 + n df at element n of N. Constant-frequency "
     "array: one carrier for all elements."),
    ("d, k, t'", "Spacing of the elements, m; wavenumber 2 pi f/c, rad/m; time since a wave from the reference element "
     "passed, s."),
    ("null", "Half the distance between the first minima on both sides of a peak, m; the printed resolution."),
    ("PSLR", "Peak side-lobe ratio: highest side lobe over the peak, dB."),
    ("corrected, apparent, channels", "Mappings of the echoes before they are focused (sarcl.map_aperture). corrected: "
     "delay and phase of every channel, as seen from the scene's centre, are taken out. apparent: the corrected echoes "
     "are focused from the positions of the dissertation's equations. channels: every channel is focused from its own "
     "element and carrier."),
    ("switch", "The sign of df changes at mid-aperture, so that the two halves of the aperture are displaced in "
     "opposite directions (systems marked +-)."),
    ("conventional", "An antenna with the same phase centres, track and band that sends a chirp."),
    ("LFM", "Linear frequency modulation: a chirp."),
)  # fmt: skip

PAPER = Paper(
    name="farooq",
    title="Frequency-diverse arrays: Farooq 2009, published and measured",
    about=ABOUT,
    lab=_lab.Lab,
    quick="arrays of more than 100 elements were left out.",
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
    terms=TERMS,
    main=(
        "LFM: first null in cross-range",
        "largest error of the power pattern, 30 MHz",
        "N 45, +-20 MHz: apparent length",
        "N 45, +-20 MHz: nulls",
        "N 45, 20 MHz: two points resolved",
    ),
)
