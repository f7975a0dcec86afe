"""The verb that makes the echoes of a scenario, and its arguments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ._earth import earth_fixed
from ._schema import ECHOES
from ._verb_call import VerbCall

if TYPE_CHECKING:
    from .scenario import Scenario

NO_ANTENNA = ("antenna", "receiver_antenna", "array", "radar")  # sections that fullwave_echo does not take


def section_of(scenario: Scenario) -> str:
    """The section that names the verb; [echo] where there is none."""
    return next((name for name in ECHOES if getattr(scenario, name) is not None), "echo")


def call_of(scenario: Scenario, options: Mapping[str, Any]) -> VerbCall:
    """The call that makes the echoes; options  take precedence over the section's keys."""
    section = section_of(scenario)
    subjects = scenario.build_scene(), scenario.build_waveform(), scenario.build_track()
    parts: dict[str, Any] = {"receiver": scenario.build_receiver()}
    if section == "fullwave_echo":
        for name in NO_ANTENNA:
            if getattr(scenario, name) is not None:
                raise ValueError(
                    f"{scenario.where.text((name,))} goes with [echo], and the echoes are those of [fullwave_echo], "
                    f"without antenna gains and at any range the RCS: leave [{name}] out"
                )
    else:
        parts["antenna"], parts["array"] = scenario.build_antenna(), scenario.build_array()
        parts["radar"] = scenario.build_radar()
    keys = {**earth_fixed(scenario.build_place(), getattr(scenario, section) or {}), **options}
    keys = {k: tuple(v) if isinstance(v, list) else v for k, v in keys.items()}
    own = {k: v for k, v in keys.items() if k not in options}
    return VerbCall(scenario.where, section, subjects, {**parts, **keys}, own)
