"""The methods of `sarcl focus --method`: which options each takes, its plan, and its image.

A method that is none of sarcl's is the verb of an installed package, called with (raw, grid).
"""

from __future__ import annotations

import argparse
import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .. import verbs
from ..base.options import described
from ..base.text import unknown
from ..io import formats
from ._flags import DEFAULTS, METHODS

if TYPE_CHECKING:
    from ..base.forecast import Forecast
    from ..model.image import Image
    from ..model.image_grid import ImageGrid
    from ..model.phase_history import PhaseHistory
    from ..scenario.scenario import Scenario

BLOCKS = ("tile", "resume")
PLANE = ("grid", "center", "shape", "spacing", "normal", "x_axis")
GROUND = ("side", "heights", "heights_above", "geoid")  # of the default grid, or of range_doppler
RUN = ("device", "tile", "resume", "out", "progress")  # given with the run
# Names of arguments of the command line by verb; "backproject" is auto, direct, factorized
TAKES = {
    "backproject": {*DEFAULTS["backproject"], *PLANE, *GROUND},
    "polar_format": {*DEFAULTS["polar_format"], *PLANE, *GROUND},
    "range_doppler": {*DEFAULTS["range_doppler"], *GROUND} - {"spacing"},
}
WHY = {
    "range_doppler": "makes its own grid, by zero-Doppler time and slant range, of all rows at once",
    "polar_format": "makes its image on one plane, of all rows at once",
    "backproject": "takes no such option",
}


@dataclass(frozen=True)
class Method:
    """A method: the name of its verb, and its options."""

    name: str
    options: dict[str, Any]

    @classmethod
    def of(cls, args: argparse.Namespace) -> Method:
        """The method that is asked for. ValueError names an option that it does not take."""
        if args.method not in METHODS:
            return cls(args.method, _added_options(args))
        if args.option:
            raise ValueError(
                f"--option is for methods of installed packages; --method {args.method} takes its own flags"
            )
        name = args.method if args.method in TAKES else "backproject"
        values = {k: v for k, v in vars(args).items() if v is not None and v is not False and k != "method"}
        for option in values:
            others = [n for n in TAKES if option in TAKES[n]]
            if others and name not in others:
                raise ValueError(
                    f"--{option.replace('_', '-')} is for {' or '.join(others)}; --method {args.method} {WHY[name]}"
                )
        options = {k: values[k] for k in DEFAULTS[name] if k in values and k in TAKES[name] and k not in RUN}
        if name == "backproject":
            options["method"] = args.method
        return cls(name, options)

    def plan(self, raw: PhaseHistory, grid: ImageGrid | None, device: object) -> Forecast[Image]:
        """Of the image."""
        verb = getattr(verbs, self.name)
        on = {"device": device} if "device" in described(verb.options) else {}
        forecast: Forecast[Image] = verbs.plan(verb, *self._subjects(raw, grid), **self.options, **on)
        return forecast

    def image(self, raw: PhaseHistory, grid: ImageGrid | None, device: object, **running: object) -> Image | None:
        """The image; None for a piece. running: `out`, `progress`, and `tile` and `resume` of backproject."""
        verb = getattr(verbs, self.name)
        known, out = described(verb.options), running.get("out")
        running = {name: value for name, value in {"device": device, **running}.items() if name in known}
        image: Image | None = verb(*self._subjects(raw, grid), **self.options, **running)
        if image is not None and isinstance(out, str) and "out" not in known:
            image.save(out)
        return image

    def _subjects(self, raw: PhaseHistory, grid: ImageGrid | None) -> tuple[Any, ...]:
        return (raw,) if grid is None else (raw, grid)


def _added_options(args: argparse.Namespace) -> dict[str, object]:
    """Options of the verb of an installed package: flags of other methods, and NAME=VALUE of --option, as in TOML."""
    known = [*described(getattr(verbs, args.method).options)]
    flags = {name for verb in TAKES for name in DEFAULTS[verb]} - {"method", *PLANE, *GROUND, *RUN}
    options = {k: v for k, v in vars(args).items() if k in flags and v is not None and v is not False}
    for text in args.option:
        name, _, value = text.partition("=")
        try:
            options[name] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            raise ValueError(f"--option {text}: give NAME=VALUE, with a value of TOML, such as 0.5 or true") from None
    for name in options:
        if name not in known:
            raise ValueError(f"--method {args.method} has {unknown(name, known, 'option')}")
    return options


def heights(args: argparse.Namespace) -> object:
    """--heights as a number, m, or an ElevationModel; 0 where it is left out. ValueError for options of the other."""
    text = args.heights
    try:
        number = 0.0 if text is None else float(text)
    except ValueError:
        from ..earth.elevation import ElevationModel

        geoid = args.geoid
        try:
            geoid = None if geoid is None else float(geoid)
        except ValueError:
            pass  # the name of a raster file
        return ElevationModel.read(text, heights=args.heights_above, geoid=geoid)
    for option in ("heights_above", "geoid"):
        if getattr(args, option) is not None:
            raise ValueError(
                f"--{option.replace('_', '-')} is for --heights FILE; a number of --heights is above the ellipsoid"
            )
    return number


def check_default_grid(args: argparse.Namespace, raw: PhaseHistory) -> None:
    """ValueError for --side and --heights where no grid is chosen from Earth-fixed echoes."""
    from ..imaging.default_grid import needs_side

    name = next((n for n in ("side", "heights") if getattr(args, n) is not None), None)
    if name is not None and (args.grid is not None or args.center is not None or not needs_side(raw)):
        local = "the file names an image area" if raw.image_area is not None else "the echoes are in local coordinates"
        why = local if args.grid is None and args.center is None else "the grid is given"
        raise ValueError(
            f"--{name} places the grid that is chosen for Earth-fixed echoes, and {why}: leave it out, or take "
            "--method range_doppler"
        )


def echo_pieces(args: argparse.Namespace, scenario: Scenario) -> dict[str, Any]:
    """The arguments --tile and --resume of `sarcl simulate`. ValueError where they have noise."""
    running = {name: getattr(args, name) for name in BLOCKS if getattr(args, name) is not None}
    if running and scenario.noise is not None:
        raise ValueError(
            f"--{next(iter(running))} keeps tiles beside a file of echoes, and [noise] is added to all at once, in "
            "memory: leave [noise] out, and add it to the finished echoes (sarcl.add_noise)"
        )
    return running


def check_pieces(args: argparse.Namespace, outputs: list[str]) -> None:
    """ValueError for --tile or --resume where no image file is written."""
    for name in BLOCKS:
        if getattr(args, name) and all(formats.named(p, formats.writing("picture")) for p in outputs):
            raise ValueError(f"--{name} keeps tiles beside an image file; give -o IMAGE.h5")
