"""Wan, Yue and Yang 2004: raw data of spaceborne radars for facet scenes. Figures of the paper, published and measured.

Source: Wan F., Yue H., Yang R., Distributed target's raw data simulation of spaceborne SAR, Journal of Electronics and
Information Technology 26 (8), 2004, 1250-1255 (in Chinese). Numbers of figures and sections are those of the paper.

For this folder alone, a section or a group of sections of the page each, and what they share:

    _errata    errors in the printed equations
    _maps      figure 7: power of the facets in cells of the ground and of the slant plane
    _orbit     figures 6 to 8: solids on rough ground, from an orbit to the image
    _patches   figures 4 and 5: patches of rising roughness or permittivity
    _radar     the radar for flat ground
    _speckle   figure 3: amplitudes and phases of rough ground
"""

from __future__ import annotations

from .. import PAPERS
from ..lab import Lab
from ..paper import Paper
from . import _errata, _orbit, _patches, _speckle

__all__ = ["PAPER"]

ABOUT = (
    "The paper simulates the raw data of a spaceborne radar: an elliptical orbit, a rotating ellipsoidal Earth, and "
    "ground of plane facets with Gaussian heights. This page computes its scenes with sarcl and compares the images "
    "with the printed figures. Source: " + PAPERS["wan"] + " (in Chinese)."
)
TERMS = (
    ("coefficient", "Amplitude that a facet, or all facets of a resolution cell, send back."),
    ("roughness", "Standard deviation of the Gaussian heights of the corners of facets, m."),
    ("permittivity", "Relative permittivity of the ground."),
    ("contrast", "Standard deviation of the intensity over its mean; 1 for fully developed speckle."),
    ("rank correlation", "Spearman's: 1 where a quantity always grows with another, -1 where it always falls."),
)

PAPER = Paper(
    name="wan",
    title="Spaceborne raw data of facet scenes: Wan et al. 2004, published and measured",
    about=ABOUT,
    lab=Lab,
    sections=(_speckle.section, _patches.section, _orbit.section, _errata.section),
    quick="patches are smaller and looks fewer.",
    terms=TERMS,
    main=(
        "amplitudes",
        "phases",
        "coefficient as roughness grows",
        "coefficient as permittivity grows",
        "end of the cylinder's shadow",
    ),
)
