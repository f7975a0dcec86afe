"""The linker ld, without which most builds of PoCL end the process with their first kernel."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile

PLATFORM = "Portable Computing Language"
PATIENCE = 120.0  # s for the trial of a device in another process; 1 to 10 are usual
TRIAL = "import sys; from sarcl.opencl import device_list; device_list.trial_of(int(sys.argv[1]))"


def is_missing(platform: str) -> bool:
    """Whether a platform is PoCL's and there is no ld on PATH; some builds of PoCL hold a linker of their own."""
    return platform == PLATFORM and shutil.which("ld", path=os.environ.get("PATH", "")) is None


def trouble(index: int) -> str:
    """Why device `index` builds no kernel without ld; "" where it does. Tried in another process, with empty caches."""
    if not sys.executable or getattr(sys, "frozen", False):
        return ""
    with tempfile.TemporaryDirectory(prefix="sarcl-trial-") as folder:
        own = {"XDG_CACHE_HOME": folder, "POCL_CACHE_DIR": folder, "PYOPENCL_NO_CACHE": "1"}
        try:
            process = subprocess.run(
                [sys.executable, "-c", TRIAL, str(index)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=PATIENCE,
                env={**os.environ, **own},
            )
        except (OSError, subprocess.TimeoutExpired):
            return ""
    if process.returncode >= 0:
        return ""
    return (
        f"PoCL links kernels with the program ld, and there is none on PATH ({os.environ.get('PATH', '')!r:.200}): add "
        "its folder to PATH, usually /usr/bin, or install it (on Debian or Ubuntu: apt-get install binutils)"
    )
