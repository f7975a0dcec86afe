"""Wan, Yue and Yang 2004: raw data of spaceborne radars for facet scenes. Figures of the paper, published and measured.

Source: Wan F., Yue H., Yang R., Distributed target's raw data simulation of spaceborne SAR, Journal of Electronics and
Information Technology 26 (8), 2004, 1250-1255 (in Chinese). Numbers of figures and sections are those of the paper.

For this folder alone, a section or a group of sections of the page each, and what they share:

    _errata    errors in the printed equations
    _orbit     figures 6 to 8: solids on rough ground, from an orbit to the image
    _patches   figures 4 and 5: patches of rising roughness or permittivity
    _radar     the radar for flat ground
    _speckle   figure 3: amplitudes and phases of rough ground
"""

from __future__ import annotations

from ..lab import Lab
from ..paper import Paper
from . import _errata, _orbit, _patches, _speckle

__all__ = ["PAPER"]

PAPER = Paper.of("wan", lab=Lab, sections=(_speckle.section, _patches.section, _orbit.section, _errata.section))
