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

from .. import PAPERS
from ..lab import Lab
from ..paper import Paper
from . import _errata, _patches, _raw, _relief, _speckle

__all__ = ["PAPER"]

ABOUT = (
    "SARAS computes the raw signal of a terrain that is described by plane facets: electromagnetic reflection of every "
    "facet, statistics of heights and of roughness within facets, layover and shadow. This page computes the paper's "
    "scenes with sarcl and compares the images with the printed figures and tables. Source: " + PAPERS["saras"] + "."
)
TERMS = (
    ("facet", "A plane triangle or rectangle, larger than the wavelength and smaller than a resolution cell."),
    ("null", "Distance from the peak of the response of a point to its first zero, m; the size of a resolution cell."),
    ("look", "An image of the scene with its own random numbers; a mean of looks has less speckle."),
    ("speckle", "Random brightness of rough ground, from the interference of many facets in a resolution cell. Fully "
     "developed speckle has amplitudes of Rayleigh's distribution, uniform phases and a contrast (standard deviation "
     "of the intensity over its mean) of 1."),
    ("small-scale, large-scale statistics", "Roughness within a facet (random amplitude and phase of its echo), and "
     "random heights of the corners of facets."),
    ("layover, shadow", "A high point appears nearer to the radar than the ground below it; ground that it hides sends "
     "nothing back."),
    ("p", "Probability of a deviation at least as large as the measured one, if the pixels had the stated distribution "
     "(test of Kolmogorov and Smirnov). Below 0.01 the distribution is rejected here."),
    ("raw signal", "Samples as received, before compression in range and in azimuth."),
    ("lambda, R0, X", "Wavelength, slant range of the scene's centre, and width of the beam on the ground, m."),
)  # fmt: skip

PAPER = Paper(
    name="saras",
    title="SARAS: Franceschetti et al. 1992, published and measured",
    about=ABOUT,
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
    quick="fields are smaller and looks fewer than in the paper.",
    terms=TERMS,
    main=(
        "autocorrelation at all 25 lags",
        "autocorrelation along range and the response of a point",
        "raw signal by Fourier transforms and by the sum over facets and pulses",
        "power in the shadow",
        "HV over HH of tilted facets of a perfect conductor",
    ),
)
