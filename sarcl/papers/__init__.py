"""Papers reproduced with sarcl: published values and statements beside the values measured here.

`sarcl papers` lists them, `sarcl papers farooq` writes a page and its numbers (docs/guide/papers.md).

For other folders:

    lab      echoes and images that several sections share
    paper    a paper: sections, rows of published and measured values, the page
    farooq/  Farooq 2009, frequency-diverse arrays
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from ..base import text

__all__ = ["PAPERS", "farooq", "find", "lab", "listing", "open_lab", "paper"]

if TYPE_CHECKING:
    from ..opencl.device import DeviceChoice
    from .lab import Lab
    from .paper import Paper

PAPERS = {
    "farooq": "J. Farooq, Frequency Diversity for Improving Synthetic Aperture Radar Imaging, dissertation, AFIT 2009",
}


def find(name: str) -> Paper:
    """The paper of this name. ValueError names those there are."""
    if name not in PAPERS:
        raise ValueError(text.unknown(name, list(PAPERS), "paper"))
    paper: Paper = import_module(f".{name}", __name__).PAPER
    return paper


def listing() -> str:
    """A line for each paper: its name, author, title and year."""
    return "\n".join(f"{name:10}{title}" for name, title in PAPERS.items())


def open_lab(device: DeviceChoice | None = None, quick: bool = False) -> Lab:
    """The `Lab` of a run, with its OpenCL device opened; quick: leave out arrays of more than 100 elements."""
    from ..opencl.choose_device import open_device
    from .lab import Lab

    return Lab(open_device(device), quick)
