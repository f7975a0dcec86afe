"""Experiments on apertures of frequency-diverse arrays: `sarcl fda`.

For other folders:

    case      Case: array, path, receiver, and what is compared with what
    file      experiment files
    measure   run(): the effect of a mapping on a point, on two points, and on the data's spatial frequencies
    page      the report page
    text      the report's sentences

For this folder alone:

    _array    arrays of experiments
    _sweep    every combination of swept values
    _trends   tables and drawings of sweeps
"""

__all__ = ["case", "file", "measure", "page", "text"]
