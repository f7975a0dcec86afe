"""The image of a scenario: the function that its section names, with that section's arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from . import _schema
from ._earth import side_of, time_over

if TYPE_CHECKING:
    from ..model.image_grid import ImageGrid
    from ..model.phase_history import PhaseHistory
    from .scenario import Scenario


def section_of(scenario: Scenario) -> str:
    """The section that makes the image: backproject where there is none."""
    return next((s for s in _schema.IMAGES if getattr(scenario, s) is not None), "backproject")


def focused(
    scenario: Scenario, verb: Callable[..., Any], raw: PhaseHistory, grid: ImageGrid | None, options: Mapping[str, Any],
    given: Mapping[str, Any],
) -> Any:  # fmt: skip
    """verb(raw, grid, **given), or without a grid for range_doppler; `options` are those of `given` from the caller."""
    section = section_of(scenario)
    own = {k: v for k, v in given.items() if k not in options}
    pieces: tuple[Any, ...] = raw, scenario.build_grid() if grid is None and section != "range_doppler" else grid
    if section == "range_doppler":
        if grid is not None:
            raise ValueError(
                "range_doppler makes a grid of its own, by zero-Doppler time and slant range; give grid=None"
            )
        pieces = (raw,)
    with scenario.where.blame((section,), own, always=False):
        return verb(*pieces, **given)


def range_doppler_options(scenario: Scenario, options: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of range_doppler; with [place], its height and its side of the orbit's track are the defaults."""
    given = scenario._options("range_doppler", options)
    heights = given.get("heights")
    if isinstance(heights, (str, Mapping)):
        from ..earth.elevation import ElevationModel

        table = {"file": heights} if isinstance(heights, str) else heights
        given["heights"] = scenario._call(("range_doppler", "heights"), table, ElevationModel.read)
    place = scenario.build_place()
    if place is not None:
        given.setdefault("heights", place.height)
        if scenario.orbit is not None and given.get("side") is None:
            orbit = scenario.build_orbit()
            given["side"] = side_of(orbit, place, time_over(orbit, place))
    return given


def check_window(scenario: Scenario) -> None:
    """Check the window before the simulation: the image would refuse it only after the echoes are computed."""
    from ..numerics.windows import weights

    section = section_of(scenario)
    given = scenario._options(section, {})
    with scenario.where.blame((section,), given, always=False):
        weights(given.get("window"), 8)
