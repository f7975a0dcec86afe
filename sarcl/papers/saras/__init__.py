"""SARAS 1992: raw signals of facet scenes. Figures and tables of the paper, published and measured.

Source: G. Franceschetti, M. Migliaccio, D. Riccio, G. Schirinzi, SARAS: a synthetic aperture radar (SAR) raw signal
simulator, IEEE Transactions on Geoscience and Remote Sensing 30 (1), 1992. Numbers of figures, tables and equations are
those of the paper.

For this folder alone, a section or a group of sections of the page each, and what they share:

    _errata    errors in the printed equations
    _ground    material of the ground, radar for flat ground
    _patches   figure 12: patches of different materials and statistics
    _raw       figures 9 and 10, section V: raw signals, their image, run times
    _relief    figures 13 to 17: layover, shadow, polarisation
    _speckle   figures 5 to 7 and table I: speckle of homogeneous ground
"""

from __future__ import annotations

from ..lab import Lab
from ..paper import Paper
from . import _errata, _patches, _raw, _relief, _speckle

__all__ = ["PAPER"]

PAPER = Paper.of(
    "saras",
    lab=Lab,
    sections=(
        _speckle.section,
        _patches.section,
        _raw.figure_9,
        _relief.parallelepiped,
        _relief.cone,
        _relief.composite,
        _raw.times,
        _errata.section,
    ),
)
