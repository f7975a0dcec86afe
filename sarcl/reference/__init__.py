"""Float64 NumPy twin of every kernel: short, slow and obviously right.

Tests and the check= code of simulation and imaging import them; plans never do.

For other folders:

    backproject    the image equation, term by term
    compress       the matched filter
    echo           the echo equation, term by term
    facet          echo of triangular facets by physical optics
    field          field of an array
    geometry       half the two-way path less the reference range
    image          multilooking
    interp         interpolation of one profile
    merge          profiles about a tile's centre, and their decimation
    polar_format   the image of plane waves
    quality        a point response by brute force
    shadow         which samples of facets are hidden
"""

__all__ = [
    "backproject",
    "compress",
    "echo",
    "facet",
    "field",
    "geometry",
    "image",
    "interp",
    "merge",
    "polar_format",
    "quality",
    "shadow",
]
