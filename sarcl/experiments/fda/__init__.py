"""Experiments on apertures of frequency-diverse arrays: `sarcl fda`.

For other folders:

    case         Case: array, path, receiver, and what is compared with what
    experiment   run(), measure(): effects of a mapping on one point, on two points and on spatial frequencies
    file         experiment files
    page         the report page
    text         the report's sentences

For this folder alone:

    _array       arrays of experiments
    _sweep       every combination of swept values
    _trends      tables and drawings of sweeps
"""

from ._sweep import sweep
from .case import Case
from .experiment import CONVENTIONAL, collected, cut, dip, measure, pair, response, run, spatial_frequencies, told_apart

__all__ = [
    "CONVENTIONAL",
    "Case",
    "case",
    "collected",
    "cut",
    "dip",
    "experiment",
    "file",
    "measure",
    "page",
    "pair",
    "response",
    "run",
    "spatial_frequencies",
    "sweep",
    "text",
    "told_apart",
]
