"""The image of a scenario: the function that its section names, with that section's arguments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from . import _schema
from ._building import Builder
from ._earth import side_of, time_over
from ._verb_call import VerbCall

if TYPE_CHECKING:
    from ..model.image_grid import ImageGrid
    from ..model.phase_history import PhaseHistory
    from .scenario import Scenario


def section_of(scenario: Scenario) -> str:
    """The section that makes the image: backproject where there is none."""
    return next((s for s in _schema.IMAGES if getattr(scenario, s) is not None), "backproject")


def image_text(scenario: Scenario) -> str:
    """The function that makes the image, and its grid, in words."""
    section = section_of(scenario)
    if not scenario.needs_grid:
        arguments = _range_doppler_options(scenario, {})
        words = ", ".join(f"{k} {v:g}" if isinstance(v, float) else f"{k} {v}" for k, v in arguments.items())
        return f"range_doppler, {words}" if words else "range_doppler"
    if scenario.grid is None:
        return f"{section}, on a grid chosen from the echoes"
    return f"{section}, {' x '.join(map(str, scenario.build_grid().shape))} pixels"


def call_of(scenario: Scenario, raw: PhaseHistory, grid: ImageGrid | None, options: Mapping[str, object]) -> VerbCall:
    """The call that makes the image of echoes, on a grid or that of the scenario; options  precede the section's."""
    section = section_of(scenario)
    if section == "range_doppler":
        keys = _range_doppler_options(scenario, options)
    else:
        keys = Builder(scenario).options(section, options)
    own = {k: v for k, v in keys.items() if k not in options}
    if section != "range_doppler":
        return VerbCall(scenario.where, section, (raw, scenario.build_grid() if grid is None else grid), keys, own)
    if grid is not None:
        raise ValueError("range_doppler makes a grid of its own, by zero-Doppler time and slant range; give grid=None")
    return VerbCall(scenario.where, section, (raw,), keys, own)


def _range_doppler_options(scenario: Scenario, options: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of range_doppler; with [place], its height and its side of the orbit's track are the defaults."""
    arguments = Builder(scenario).options("range_doppler", options)
    heights = arguments.get("heights")
    if isinstance(heights, (str, Mapping)):
        from ..earth.elevation import ElevationModel

        table = {"file": heights} if isinstance(heights, str) else heights
        arguments["heights"] = Builder(scenario).call(("range_doppler", "heights"), table, ElevationModel.read)
    place = scenario.build_place()
    if place is not None:
        arguments.setdefault("heights", place.height)
        if scenario.orbit is not None and arguments.get("side") is None:
            orbit = scenario.build_orbit()
            arguments["side"] = side_of(orbit, place, time_over(orbit, place))
    return arguments


def check_window(scenario: Scenario) -> None:
    """Check the window before the simulation: the image would refuse it only after the echoes are computed."""
    from ..numerics.windows import check

    section = section_of(scenario)
    arguments = Builder(scenario).options(section, {})
    with scenario.where.blame((section,), arguments, always=False):
        check(arguments.get("window"))
