"""Simulations as TOML files.

For other folders:

    scenario     Scenario, load(), loads()

For this folder alone:

    _building    objects that the tables describe
    _earth       local coordinates of a place on the Earth, passes of orbits
    _focusing    the function that makes the image, and its arguments
    _schema      tables and keys that a scenario may hold
    _simulating  the function that makes the echoes, and its arguments
    _tables      Python objects (Scene, Trajectory, ...) written as tables
    _verb_call   the call of a verb that a section describes
"""

from .scenario import Scenario, load, loads

__all__ = ["Scenario", "load", "loads", "scenario"]
