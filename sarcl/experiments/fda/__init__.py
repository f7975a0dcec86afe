"""Experiments on apertures of frequency-diverse arrays: `sarcl fda`.

For other folders:

    case         Case: array, track, receiver, and the conventional antenna for comparison
    experiment   run(), measure(): what mappings do to single points, pairs of points and spatial frequencies
    file         experiment files
    page         the report page
    text         the sentences of the page and of the command

For this folder alone:

    _array       arrays of experiments
    _sweep       every combination of swept values
    _trends      table of all cases, plots of sweeps
"""

from ._sweep import sweep
from .case import Case
from .experiment import (
    CONVENTIONAL,
    collected,
    cut,
    dip,
    is_resolved,
    measure,
    pair,
    response,
    run,
    spatial_frequencies,
    told_apart,
)

__all__ = [
    "CONVENTIONAL",
    "Case",
    "case",
    "collected",
    "cut",
    "dip",
    "experiment",
    "file",
    "is_resolved",
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
