"""Refusal of OpenCL in a process that was forked after its parent had used it.

A fork copies the memory of a driver but not its threads: what the child enqueues is never computed, and the child waits
for ever. Nothing can be opened again there, because the driver's state belongs to the whole process.
"""

from __future__ import annotations

import os

_state = {"used": False, "lost": False}


def check() -> None:
    """Note that this process uses OpenCL; RuntimeError where a parent did so before it forked."""
    if _state["lost"]:
        raise RuntimeError(
            "OpenCL was used before this process was forked, and its driver has no threads here: a computation would "
            "never end. Start processes with multiprocessing.get_context('spawn'), or fork before sarcl uses a device"
        )
    _state["used"] = True


def _in_child() -> None:
    _state["lost"] = _state["used"]


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_in_child)
