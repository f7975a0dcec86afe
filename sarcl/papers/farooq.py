"""Farooq 2009: frequency-diverse arrays in synthetic aperture radar. Every figure and table, published beside measured.

Source: J. Farooq, Frequency Diversity for Improving Synthetic Aperture Radar Imaging, dissertation, Air Force Institute
of Technology, AFIT/DEE/ENG/09-04, 2009. Figures, tables and equations are numbered as there.
"""

from __future__ import annotations

from . import (
    PAPERS,
    farooq_aperture,
    farooq_errata,
    farooq_field,
    farooq_focus,
    farooq_honest,
    farooq_pattern,
    farooq_pulse,
    farooq_reference,
    farooq_trend,
    farooq_zones,
)
from .paper import Paper

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
        farooq_reference.section,
        farooq_pattern.patterns,
        farooq_pattern.errors,
        farooq_pulse.waveform,
        farooq_pulse.ambiguities,
        farooq_field.delays,
        farooq_field.snapshots,
        farooq_focus.section,
        farooq_aperture.steady,
        farooq_aperture.switched,
        farooq_aperture.nulls,
        farooq_trend.trends,
        farooq_trend.abstract,
        farooq_honest.section,
        farooq_zones.section,
        farooq_errata.section,
    ),
)
