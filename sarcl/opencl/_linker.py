"""The linker ld, without which most builds of PoCL end the process with their first kernel."""

from __future__ import annotations

import os
import shutil

from . import _child

PLATFORM = "Portable Computing Language"
PATIENCE = 120.0  # s for the trial of a device in another process; 1 to 10 are usual
TRIAL = "import sys; from sarcl.opencl import device_list; device_list.trial_of(int(sys.argv[1]))"
REMEDY = "add its folder to PATH, usually /usr/bin, or install it (on Debian or Ubuntu: apt-get install binutils)"


def is_missing(platform: str) -> bool:
    """Whether a platform is PoCL's and there is no ld on PATH; some builds of PoCL hold a linker of their own."""
    return platform == PLATFORM and shutil.which("ld", path=os.environ.get("PATH", "")) is None


def trouble(index: int) -> str:
    """Why device `index` builds no kernel without ld; "" where it does. Tried in another process, with empty caches."""
    with _child.empty_caches() as caches:
        _, end = _child.run(TRIAL, str(index), environment=caches, patience=PATIENCE)
    if not end.startswith("SIG"):
        return ""
    path = os.environ.get("PATH", "")
    return f"PoCL links kernels with the program ld, and there is none on PATH ({path!r:.200}): {REMEDY}"
