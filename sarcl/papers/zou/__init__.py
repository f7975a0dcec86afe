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

from .. import PAPERS
from ..paper import Paper
from . import _forming, _images, _setting, _sphere, _summary, _targets
from ._lab import CELLS, REDUCTION, Lab

__all__ = ["PAPER"]

ABOUT = (
    "The paper computes the echoes of an airborne L-band radar by solving Maxwell's equations around a target on a "
    "grid (FDTD), once, and delays the surface currents that it finds for all other pulses (waveform forming). This "
    "page computes its targets with sarcl.fullwave_echo, which takes several anchors where the tolerance needs them, "
    "and with physical optics (sarcl.echo) on the same meshes. Source: " + PAPERS["zou"] + "."
)
TERMS = (
    ("HH, VH", "Received and sent polarisation: VH is what is received vertically of what is sent horizontally."),
    ("anchor", "A pulse whose currents are computed on the grid. The paper has one, in the middle of the track."),
    ("waveform forming", "Currents of an anchor, delayed cell by cell, radiate the echoes of another pulse."),
    ("run", "A solution of Maxwell's equations on the grid, for one anchor and one polarisation sent."),
    ("physical optics", "Currents of every lit facet as on an infinite plane; no edges, no second reflection."),
    ("dB re 1 m²", "Radar cross section of a point as bright as the pixel; of samples, of a point with such an echo."),
    ("Mie's series", "The exact field that a conducting sphere scatters."),
)

PAPER = Paper(
    name="zou",
    title="Full-wave echoes with waveform forming: Zou et al. 2021, published and measured",
    about=ABOUT,
    lab=Lab,
    sections=(
        _setting.section,
        *(partial(_images.section, target.name) for target in _targets.TARGETS),
        _summary.section,
        _sphere.section,
        _forming.section,
    ),
    quick=f"targets, range and track are 1/{REDUCTION[True]} of the paper's while the wavelength is the same, with "
    f"{CELLS[True]} cells per shortest wavelength instead of {CELLS[False]}.",
    terms=TERMS,
    main=(
        "range resolution of a point: distance of peak and null",
        "azimuth resolution of a point: distance of peak and null",
        "VH over HH, brightest pixels of the targets but the sphere",
        "cuboid: one anchor against one run per azimuth",
        "sharp cone: one anchor against one run per azimuth",
        "sphere: echoes in HH against Mie's series",
    ),
    long=True,
)
