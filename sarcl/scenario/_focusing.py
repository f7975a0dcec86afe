"""The image of a scenario: the function that its section names, with that section's arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from ..base import arguments
from . import _schema
from ._building import Builder
from ._earth import side_of, time_over

if TYPE_CHECKING:
    from ..imaging.forecast import Forecast
    from ..model.image import Image
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
        given = _range_doppler_options(scenario, {})
        told = ", ".join(f"{k} {v:g}" if isinstance(v, float) else f"{k} {v}" for k, v in given.items())
        return f"range_doppler, {told}" if told else "range_doppler"
    if scenario.grid is None:
        return f"{section}, on a grid chosen from the echoes"
    return f"{section}, {' x '.join(map(str, scenario.build_grid().shape))} pixels"


def focus(scenario: Scenario, raw: PhaseHistory, grid: ImageGrid | None, options: Mapping[str, Any]) -> Image:
    """See `Scenario.focus`."""
    section = section_of(scenario)
    if section == "backproject":
        from ..imaging.backproject import backproject

        return _focused(scenario, backproject, raw, grid, options, Builder(scenario).options(section, options))
    given = dict(options)
    out = given.pop("out", None)
    if section == "polar_format":
        from ..imaging.polar_format.polar_format import polar_format

        image = _focused(scenario, polar_format, raw, grid, given, Builder(scenario).options(section, given))
    else:
        from ..imaging.range_doppler.range_doppler import range_doppler

        image = _focused(scenario, range_doppler, raw, grid, given, _range_doppler_options(scenario, given))
    if out is not None:
        image.save(out)
    return image


def plan_focus(scenario: Scenario, raw: PhaseHistory, grid: ImageGrid | None, options: Mapping[str, Any]) -> Forecast:
    """See `Scenario.plan_focus`."""
    section = section_of(scenario)
    if section != "backproject":  # `Scenario.focus` writes the file
        options = {k: v for k, v in options.items() if k != "out"}
    if section == "range_doppler":
        from ..imaging.range_doppler.range_doppler import plan_range_doppler

        return _focused(scenario, plan_range_doppler, raw, grid, options, _range_doppler_options(scenario, options))
    given = Builder(scenario).options(section, options)
    if section == "polar_format":
        from ..imaging.polar_format.polar_format import plan_polar_format

        return _focused(scenario, plan_polar_format, raw, grid, options, given)
    from ..imaging.backproject import backproject
    from ..imaging.focus_options import FocusOptions
    from ..imaging.forecast import plan

    arguments.keywords(backproject, given)
    known = {f.name for f in fields(FocusOptions)}
    return _focused(scenario, plan, raw, grid, options, {k: v for k, v in given.items() if k in known})


def _focused(
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


def _range_doppler_options(scenario: Scenario, options: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of range_doppler; with [place], its height and its side of the orbit's track are the defaults."""
    given = Builder(scenario).options("range_doppler", options)
    heights = given.get("heights")
    if isinstance(heights, (str, Mapping)):
        from ..earth.elevation import ElevationModel

        table = {"file": heights} if isinstance(heights, str) else heights
        given["heights"] = Builder(scenario).call(("range_doppler", "heights"), table, ElevationModel.read)
    place = scenario.build_place()
    if place is not None:
        given.setdefault("heights", place.height)
        if scenario.orbit is not None and given.get("side") is None:
            orbit = scenario.build_orbit()
            given["side"] = side_of(orbit, place, time_over(orbit, place))
    return given


def check_window(scenario: Scenario) -> None:
    """Check the window before the simulation: the image would refuse it only after the echoes are computed."""
    from ..numerics.windows import check

    section = section_of(scenario)
    given = Builder(scenario).options(section, {})
    with scenario.where.blame((section,), given, always=False):
        check(given.get("window"))
