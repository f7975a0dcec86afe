"""Papers reproduced with sarcl: published values and statements beside the values measured here.

`sarcl papers` lists them, `sarcl papers farooq` writes a page and its numbers (docs/guide/papers.md).

For other folders:

    far_radar  a far radar for scenes of papers that give no geometry; statistics of speckle
    lab        looks at scenes, pictures and histograms, for papers whose figures are images
    paper      a paper: sections, rows of published and measured values, the page
    farooq/    Farooq 2009, frequency-diverse arrays
    saras/     Franceschetti et al. 1992, raw signals of facet scenes
    wan/       Wan, Yue, Yang 2004, spaceborne raw data of facet scenes
    zou/       Zou, Jia, Qiao 2021, full-wave echoes with waveform forming
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base import text

__all__ = ["PAPERS", "far_radar", "farooq", "find", "lab", "listing", "open_lab", "paper", "saras", "wan", "zou"]

if TYPE_CHECKING:
    from ..opencl.device import DeviceChoice
    from .paper import Paper

PAPERS = {
    "farooq": "J. Farooq, Frequency Diversity for Improving Synthetic Aperture Radar Imaging, dissertation, AFIT 2009",
    "saras": "G. Franceschetti et al., SARAS: A Synthetic Aperture Radar Raw Signal Simulator, IEEE TGRS 30(1), 1992",
    "wan": "Wan F., Yue H., Yang R., Distributed Target's Raw Data Simulation of Spaceborne SAR, JEIT 26(8), 2004",
    "zou": "Zou B., Jia Y., Qiao Z., A High-Precision SAR Echo Simulation Method Based on FDTD, Proc. SPIE 11742, 2021",
}


def find(name: str) -> Paper:
    """The paper of this name. ValueError names those there are.

    >>> sarcl.papers.find("saras").title
    'SARAS: Franceschetti et al. 1992, published and measured'
    """
    if not isinstance(name, str) or name not in PAPERS:
        if not isinstance(name, str):
            raise TypeError(f"name is a {type(name).__name__}; give one of {', '.join(PAPERS)}")
        raise ValueError(text.unknown(name, list(PAPERS), "paper"))
    paper: Paper = import_module(f".{name}", __name__).PAPER
    return paper


def listing() -> str:
    """A line for each paper: its name, author, title and year.

    >>> print(sarcl.papers.listing().splitlines()[0])
    farooq    J. Farooq, Frequency Diversity for Improving Synthetic Aperture Radar Imaging, dissertation, AFIT 2009
    """
    return "\n".join(f"{name:10}{title}" for name, title in PAPERS.items())


def open_lab(
    paper: Paper,
    device: DeviceChoice | None = None,
    quick: bool = False,
    folder: Path | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Any:
    """Lab that the sections of a paper share, with its OpenCL device opened.

    quick     less of it (`Paper.quick`)
    folder    where long runs are kept (`Paper.long`);  progress  called as progress(stage, done, total) by these
    """
    from ..opencl.choose_device import open_device

    options: dict[str, Any] = {"folder": folder, "progress": progress} if paper.long else {}
    return paper.lab(open_device(device), quick, **options)
