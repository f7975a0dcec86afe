"""Zou, Jia and Qiao 2021: full-wave echoes by FDTD with waveform forming. Figures and tables, published and measured.

Source: B. Zou, Y. Jia, Z. Qiao, A high-precision SAR echo simulation method based on FDTD, Proc. SPIE 11742, 1174212
(2021). Numbers of figures, tables and equations are those of the paper.

For this folder alone, a section or a group of sections of the page each, and what they share:

    _forming   figure 8: waveform forming and one run of the grid per azimuth
    _images    figures 5 to 7: field, I/Q samples and images of a target
    _lab       echoes of the targets by full wave and by physical optics
    _radar     table 1: radar, track, samples of a receiver
    _setting   tables 1 and 2: what follows from the parameters, response of a point, targets
    _sphere    the sphere against Mie's series
    _summary   the six targets side by side
    _targets   table 2: the six targets
"""

from __future__ import annotations

from functools import partial

from ..paper import Paper
from . import _forming, _images, _setting, _sphere, _summary, _targets
from ._lab import CELLS, REDUCTION, Lab

__all__ = ["PAPER"]

PAPER = Paper.of(
    "zou",
    lab=Lab,
    sections=(
        _setting.section,
        *(partial(_images.section, target.name) for target in _targets.TARGETS),
        _summary.section,
        _sphere.section,
        _forming.section,
    ),
    long=True,
    reduction=REDUCTION[True],
    few_cells=CELLS[True],
    cells=CELLS[False],
)
