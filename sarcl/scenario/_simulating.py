"""The function that makes the echoes of a scenario, its forecast, and their arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from ._earth import earth_fixed
from ._schema import ECHOES

if TYPE_CHECKING:
    from .scenario import Scenario

NO_ANTENNA = ("antenna", "receiver_antenna", "array", "radar")  # sections that fullwave_echo does not take


def section_of(scenario: Scenario) -> str:
    """The section that names the function; [echo] where there is none."""
    return next((name for name in ECHOES if getattr(scenario, name) is not None), "echo")


def functions_of(section: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """The function of a section, and the function that forecasts it."""
    if section == "fullwave_echo":
        from ..fullwave.echoes.fullwave_echo import fullwave_echo
        from ..fullwave.echoes.fullwave_forecast import plan_fullwave_echo

        return fullwave_echo, plan_fullwave_echo
    from ..simulation.echo_forecast import plan_echo, plan_spectral_echo

    if section == "spectral_echo":
        from ..simulation.spectral.spectral_echo import spectral_echo

        return spectral_echo, plan_spectral_echo
    from ..simulation.echo import echo

    return echo, plan_echo


def call(scenario: Scenario, options: Mapping[str, Any], *, forecast: bool) -> Any:
    """The echoes, or their forecast; options  take precedence over the section's keys."""
    section = section_of(scenario)
    function = functions_of(section)[forecast]
    pieces = (scenario.build_scene(), scenario.build_waveform(), scenario.build_track())
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
    given = {**earth_fixed(scenario.build_place(), getattr(scenario, section) or {}), **options}
    given = {k: tuple(v) if isinstance(v, list) else v for k, v in given.items()}
    named = {k: v for k, v in given.items() if k not in options}
    with scenario.where.blame((section,), named, always=False):
        return function(*pieces, **parts, **given)
