"""How many processors computations of this process use."""

from __future__ import annotations

import os


def threads() -> int:
    """SARCL_THREADS, or the number of processors this process may use."""
    text = os.environ.get("SARCL_THREADS", "")
    if text and not (text.isdigit() and int(text) > 0):
        raise ValueError(f"SARCL_THREADS is {text!r}; give a whole number of at least 1, or unset it")
    return (
        int(text) if text else len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
