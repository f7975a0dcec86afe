"""Scenario files: a simulation as TOML, with the Python names as tables and keys. See docs/guide/scenarios.md."""

from __future__ import annotations

import inspect
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..base.text import unknown
from ..io import input_paths, toml
from . import _schema
from ._earth import earth_fixed, on_terrain, pass_text, time_over
from ._focusing import check_window, focused, range_doppler_options, section_of
from ._schema import Where

if TYPE_CHECKING:
    from ..base.types import PathLike
    from ..earth.place import Place
    from ..imaging.backproject import BackprojectOptions
    from ..imaging.focus_options import FocusKeywords
    from ..imaging.forecast import Forecast
    from ..model.antenna import Antenna
    from ..model.antenna_array import AntennaArray
    from ..model.image import Image
    from ..model.image_grid import ImageGrid
    from ..model.orbit import Orbit
    from ..model.phase_history import PhaseHistory
    from ..model.radar import Radar
    from ..model.trajectory import Trajectory
    from ..model.waveform import Waveform
    from ..scene.material import Material
    from ..scene.scene import Scene
    from ..simulation.echo import EchoOptions
    from ..simulation.echo_forecast import EchoForecast

# Arguments that may be complex. TOML has no complex numbers: they are lists of [real, imaginary] pairs.
COMPLEX = {"amplitudes", "signal", "weights"}
Table = dict[str, Any]  # table of a scenario: keys with plain values or further tables


@dataclass(frozen=True, eq=False)
class Scenario:
    """A simulation and how to focus it, as tables of plain values: `Scenario(...)` or `load(path)`.

    waveform     {"chirp": {"center": 9.6e9, ...}}, or a Waveform
    orbit        {"file": "orbit.EOF"}, {"kepler": {...}}, {"tle": {...}}, {"states": {...}}, or an Orbit
    trajectory   {"circle": {...}}, {"line": {...}}, {"times": ..., "positions": ...}, or a Trajectory; {"orbit": {...}}
                 for pulses along the orbit
    receiver     the same for a separate receiver, or None
    pointing     {"spotlight": {"point": [0, 0, 0]}}, {"stripmap": ...}, {"fixed": ...}: attitude along the track
    antenna      {"gaussian": {...}}, {"rectangular": ...}, {"table": ...}, {"isotropic": ...}, or an Antenna
    array        {"linear": {"n": 45, ...}}, {"planar": ...}, {"costas": ...}, or an AntennaArray
    receiver_pointing, receiver_antenna   of the receiver, where they differ from the transmitter's
    radar        {"power": ...}, or a Radar
    materials    {name: {"eps_r": 4.0, ...}, ...}, or Material objects; tables of the scene refer to them by name
    place        {"longitude": ..., "latitude": ..., "height": ...}: scene, grid and points are east, north, up of it
    scene        {"points": [{...}], "from_mesh": [{...}], ...}, or a Scene
    grid         {"plane": {...}}, {"on_terrain": {...}} or {"points": {...}}, or an ImageGrid
    echo         arguments of `sarcl.echo`; or spectral_echo, of `sarcl.spectral_echo`;  noise  of `sarcl.add_noise`
    backproject  arguments of `sarcl.backproject`; or polar_format, range_doppler, of the functions of that name
    folder       folder that names of mesh and elevation files are relative to

    A section may be left out until it is used. Python objects become tables; arrays and tuples become lists. ValueError
    names the file, line and table of an unknown or missing key, a wrong type, or a value that is refused.
    """

    waveform: Table | None = None
    trajectory: Table | None = None
    receiver: Table | None = None
    scene: Table | None = None
    grid: Table | None = None
    echo: Table | None = None
    backproject: Table | None = None
    materials: Table | None = None
    pointing: Table | None = None
    antenna: Table | None = None
    receiver_pointing: Table | None = None
    receiver_antenna: Table | None = None
    array: Table | None = None
    radar: Table | None = None
    noise: Table | None = None
    orbit: Table | None = None
    place: Table | None = None
    spectral_echo: Table | None = None
    polar_format: Table | None = None
    range_doppler: Table | None = None
    folder: Path = Path()
    where: Where = field(default_factory=Where, repr=False)

    if TYPE_CHECKING:  # types that the constructor takes; the fields above have the types that are stored

        def __init__(
            self,
            waveform: Waveform | Mapping[str, object] | None = None,
            trajectory: Trajectory | Mapping[str, object] | None = None,
            receiver: Trajectory | Mapping[str, object] | None = None,
            scene: Scene | Mapping[str, object] | None = None,
            grid: ImageGrid | Mapping[str, object] | None = None,
            echo: Mapping[str, object] | None = None,
            backproject: Mapping[str, object] | None = None,
            materials: Mapping[str, Material | Mapping[str, object]] | None = None,
            pointing: Mapping[str, object] | None = None,
            antenna: Antenna | Mapping[str, object] | None = None,
            receiver_pointing: Mapping[str, object] | None = None,
            receiver_antenna: Antenna | Mapping[str, object] | None = None,
            array: AntennaArray | Mapping[str, object] | None = None,
            radar: Radar | Mapping[str, object] | None = None,
            noise: Mapping[str, object] | None = None,
            orbit: Orbit | Mapping[str, object] | None = None,
            place: Place | Mapping[str, object] | None = None,
            spectral_echo: Mapping[str, object] | None = None,
            polar_format: Mapping[str, object] | None = None,
            range_doppler: Mapping[str, object] | None = None,
            folder: PathLike = Path(),
            where: Where = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        from ..scene.scene import Scene
        from ._tables import named, plain, table_of

        object.__setattr__(self, "folder", Path(self.folder))
        if isinstance(self.scene, Scene):
            own = {name: m for name, m in named(self.scene).items() if name != "metal"}
            object.__setattr__(self, "materials", {**(self.materials or {}), **own} or None)
        for name in _schema.SECTIONS:
            value = getattr(self, name)
            if value is not None:
                if name == "materials" and isinstance(value, Mapping):
                    value = {k: table_of(v) for k, v in value.items()}
                value = plain(table_of(value))
                _schema.check_section(name, value, self.where)
                object.__setattr__(self, name, value)
        _schema.check_choices(self.tables, self.where)

    @property
    def tables(self) -> dict[str, Any]:
        """The sections of this scenario, as nested dicts and lists."""
        return {n: getattr(self, n) for n in _schema.SECTIONS if getattr(self, n) is not None}

    def dumps(self) -> str:
        """The scenario as TOML text. `loads` of it returns the same tables, with every float exact."""
        return toml.dumps(self.tables)

    def save(self, path: PathLike) -> None:
        """Write the scenario to a file. Names of mesh files stay relative to the folder of the file."""
        from ..io import output_paths

        with output_paths.atomic(path) as part:
            part.write_text(self.dumps(), encoding="utf-8")

    def build_waveform(self) -> Waveform:
        """The Waveform."""
        return self._one("waveform")

    def build_orbit(self) -> Orbit:
        """The Orbit."""
        return self._one("orbit")

    def build_place(self) -> Place | None:
        """The Place that is the origin of local coordinates; None where there is none."""
        return None if self.place is None else self._one("place")

    def build_track(self) -> Trajectory:
        """The transmitter's Trajectory, with the attitude that [pointing] describes.

        With [place] the middle of an orbit's pulses is by default the zero-Doppler time of the place.
        """
        kind = next(iter(self._section("trajectory")))
        if kind != "orbit":
            if self.orbit is not None:
                raise ValueError(
                    f"{self.where.text(('orbit',))} has no pulses: [trajectory.{kind}] describes another track; give "
                    "[trajectory.orbit] with prf, n_pulses and start or center"
                )
            self._check_local(kind, "trajectory")
            return self._aimed(self._one("trajectory"), "pointing")
        orbit, table = self.build_orbit(), dict(self.trajectory["orbit"])  # type: ignore[index]
        place = self.build_place()
        if place is not None and not {"start", "center"} & set(table):
            with self.where.blame(("place",), {}):
                table["center"] = time_over(orbit, place)
        return self._aimed(self._call(("trajectory", "orbit"), table, orbit.trajectory), "pointing")

    def describe_orbit(self) -> str:
        """The orbit, its pulses and how it sees the place, in lines of text; empty where there is no orbit."""
        return "" if self.orbit is None else pass_text(self.build_orbit(), self.build_track(), self.build_place())

    def build_receiver(self) -> Trajectory | None:
        """The receiver's Trajectory, None where it moves with the transmitter."""
        if self.receiver is None:
            return None
        self._check_local(next(iter(self.receiver)), "receiver")
        return self._aimed(self._one("receiver"), "receiver_pointing" if self.receiver_pointing else "pointing")

    def build_antenna(self) -> Antenna | tuple[Antenna, Antenna] | None:
        """The Antenna, a pair (transmitting, receiving), or None."""
        if self.antenna is None:
            if self.receiver_antenna is not None:
                raise ValueError(f"{self.where.text(('receiver_antenna',))} has no [antenna] to transmit; add one")
            return None
        sends = self._one("antenna")
        return sends if self.receiver_antenna is None else (sends, self._one("receiver_antenna"))

    def build_radar(self) -> Radar | None:
        """The Radar; None where amplitudes do not decrease with range."""
        return None if self.radar is None else self._one("radar")

    def build_array(self) -> AntennaArray | None:
        """The AntennaArray that transmits; None where a single antenna does."""
        return None if self.array is None else self._one("array")

    def build_grid(self) -> ImageGrid:
        """The ImageGrid; with [place], in Earth-fixed coordinates."""
        place = self.build_place()
        if place is None:
            return self._one("grid")
        ((kind, table),) = self._section("grid").items()
        if kind == "zero_doppler":  # Earth-fixed by its nature
            return self._one("grid")
        with self.where.blame(("grid", kind), table):
            local = on_terrain(place, table) if kind == "on_terrain" else table
        made: ImageGrid = self._call(("grid", kind), local, _schema.calls("grid")[kind])
        return made.on_earth(place.longitude, place.latitude, place.height)

    def build_scene(self) -> Scene:
        """The Scene: the sum of its tables, in the order they first appear; with [place], Earth-fixed."""
        from ..scene.material import Material
        from ._tables import look_up

        materials = {
            name: self._call(("materials", name), table, partial(Material, name=name))
            for name, table in (self.materials or {}).items()
        }
        scene, origin = None, self.build_place()
        for kind, value in self._section("scene").items():
            for path, table in _schema.tables_of("scene", kind, value):
                place = table.get(_schema.ON)
                table = {k: look_up(k, v, materials) for k, v in table.items() if k != _schema.ON}
                if origin is not None and kind == "from_dem":
                    with self.where.blame(path, table):
                        table = on_terrain(origin, table)
                part = self._call(path, table, _schema.calls("scene")[kind])
                if place is not None:
                    with self.where.blame(path, {_schema.ON: place}):
                        part = _stand(part, scene, place)
                scene = part if scene is None else scene + part
        assert scene is not None
        return scene if origin is None else scene.on_earth(origin.longitude, origin.latitude, origin.height)

    def simulate(self, **options: Unpack[EchoOptions]) -> PhaseHistory:
        """Echoes of the scene, with [noise]. `options`, arguments of `sarcl.echo`, take precedence over [echo].

        With [spectral_echo] they are computed by, and take precedence for, `sarcl.spectral_echo`.
        """
        if self.spectral_echo is not None:
            from ..simulation.spectral.spectral_echo import spectral_echo as verb
        else:
            from ..simulation.echo import echo as verb  # type: ignore[assignment]

        raw = self._echo(verb, options)
        if self.noise is None:
            return raw
        from ..effects.noise import add_noise

        level = self._options("noise", {})
        if "nesz" in level or "nesz_db" in level:
            level.setdefault("grid", None if "cell_area" in level else self.build_grid())
        with self.where.blame(("noise",), level):
            return add_noise(raw, **level)

    def plan(self, **options: Unpack[EchoOptions]) -> EchoForecast:
        """Forecast of `simulate` with these options: rows, bytes, seconds, predicted error."""
        from ..simulation.echo_forecast import plan_echo, plan_spectral_echo

        return self._echo(plan_echo if self.spectral_echo is None else plan_spectral_echo, options)

    def _echo(self, verb: Callable[..., Any], options: Mapping[str, Any]) -> Any:
        check_window(self)
        pieces = (self.build_scene(), self.build_waveform(), self.build_track())
        section = "echo" if self.spectral_echo is None else "spectral_echo"
        given = {**earth_fixed(self.build_place(), getattr(self, section) or {}), **options}
        given = {k: tuple(v) if isinstance(v, list) else v for k, v in given.items()}
        with self.where.blame((section,), {k: v for k, v in given.items() if k not in options}, always=False):
            return verb(
                *pieces, receiver=self.build_receiver(), antenna=self.build_antenna(), array=self.build_array(),
                radar=self.build_radar(), **given,
            )  # fmt: skip

    @property
    def has_image(self) -> bool:
        """Whether the scenario says where an image is made: on [grid], or by [range_doppler]."""
        return self.grid is not None or self.range_doppler is not None

    @property
    def needs_grid(self) -> bool:
        """Whether `focus` wants a grid: range_doppler makes its own."""
        return section_of(self) != "range_doppler"

    def describe_image(self) -> str:
        """The function that makes the image, and its grid, in words."""
        section = section_of(self)
        if not self.needs_grid:
            given = range_doppler_options(self, {})
            told = ", ".join(f"{k} {v:g}" if isinstance(v, float) else f"{k} {v}" for k, v in given.items())
            return f"range_doppler, {told}" if told else "range_doppler"
        if self.grid is None:
            return f"{section}, on a grid chosen from the echoes"
        return f"{section}, {' x '.join(map(str, self.build_grid().shape))} pixels"

    def default_grid_options(self) -> dict[str, Any]:
        """What [place] says about a grid that is chosen from the echoes: its centre."""
        place = self.build_place()
        return {} if place is None else {"center": place.origin}

    def focus(self, raw: PhaseHistory, grid: ImageGrid | None = None, **options: Unpack[BackprojectOptions]) -> Image:
        """The image of `raw` on `grid`, default [grid]. `options` take precedence over those in [backproject].

        With [polar_format] or [range_doppler] the image is made by that function, whose options these are then (and
        `out`, a file that is written in the end); range_doppler makes a grid of its own.
        """
        section = section_of(self)
        if section == "backproject":
            from ..imaging.backproject import backproject

            return focused(self, backproject, raw, grid, options, self._options(section, options))
        given: dict[str, Any] = dict(options)
        out = given.pop("out", None)
        if section == "polar_format":
            from ..imaging.polar_format.polar_format import polar_format

            image = focused(self, polar_format, raw, grid, given, self._options(section, given))
        else:
            from ..imaging.range_doppler.range_doppler import range_doppler

            image = focused(self, range_doppler, raw, grid, given, range_doppler_options(self, given))
        if out is not None:
            image.save(out)
        return image

    def plan_focus(
        self, raw: PhaseHistory, grid: ImageGrid | None = None, **options: Unpack[FocusKeywords]
    ) -> Forecast:
        """Forecast of `focus` with these options: method, seconds, bytes, predicted error."""
        section = section_of(self)
        if section == "range_doppler":
            from ..imaging.range_doppler.range_doppler import plan_range_doppler

            return focused(self, plan_range_doppler, raw, grid, options, range_doppler_options(self, options))
        given = self._options(section, options)
        if section == "polar_format":
            from ..imaging.polar_format.polar_format import plan_polar_format

            return focused(self, plan_polar_format, raw, grid, options, given)
        from ..imaging.focus_options import FocusOptions
        from ..imaging.forecast import plan

        known = {f.name for f in fields(FocusOptions)}
        return focused(self, plan, raw, grid, options, {k: v for k, v in given.items() if k in known})

    def _aimed(self, track: Trajectory, section: str) -> Trajectory:
        table = getattr(self, section)
        if table is None:
            return track
        ((kind, given),) = table.items()
        given = earth_fixed(self.build_place(), given)
        return self._call((section, kind), given, partial(_schema.calls(section)[kind], track))

    def _check_local(self, kind: str, section: str) -> None:
        """ValueError for a track in local coordinates where [place] makes the scene Earth-fixed."""
        if self.place is not None and kind in ("line", "circle"):
            raise ValueError(
                f"{self.where.text((section, kind))} is a track in local coordinates, while [place] makes the scene "
                "Earth-fixed, for orbits; leave [place] out"
            )

    def _section(self, name: str) -> dict[str, Any]:
        table = getattr(self, name)
        if table is None:
            kinds = [k for k in _schema.calls(name) if k]
            more = f"{name}.{kinds[0]}"
            raise ValueError(f"{self.where.name}: there is no {name}; add a [{more}] table")
        return table

    def _one(self, name: str) -> Any:
        table = self._section(name)
        known = _schema.calls(name)
        kind = next(iter(table))
        if kind in known:
            return self._call((name, kind), table[kind], known[kind])
        return self._call((name,), table, known[""])

    def _call(self, path: _schema.Path, table: Mapping[str, Any], call: _schema.Call) -> Any:
        """call(**table), with files relative to the scenario's folder; messages name file, line and table."""
        renamed = {new: old for old, new in _schema.RENAMED.items() if old in inspect.signature(call).parameters}
        with self.where.blame(path, table):
            given = {renamed.get(k, k): _argument(k, v) for k, v in table.items()}
            for name in ("mesh", "path", "dem", "geoid"):
                if isinstance(given.get(name), str):
                    given[name] = self.folder / given[name]
            left_out = [p.name for p in inspect.signature(call).parameters.values() if _schema.may_be_left_out(p)]
            return call(**{**dict.fromkeys(left_out), **given})

    def _options(self, name: str, options: Mapping[str, Any]) -> dict[str, Any]:
        """Arguments of a function. A list is a pair, or a name with its parameters: a tuple in Python."""
        table = getattr(self, name) or {}
        return {k: tuple(v) if isinstance(v, list) else v for k, v in {**table, **options}.items()}


def load(path: PathLike) -> Scenario:
    """Read a scenario file; mesh files are found relative to its folder.

    ValueError names file and line where the text is not TOML or not a scenario; FileNotFoundError.
    """
    path = Path(path)
    try:
        text = input_paths.contents(path, "scenario file").decode("utf-8")
    except UnicodeDecodeError as exc:
        raise ValueError(f"{path}: byte {exc.start} is not UTF-8 text; a scenario is a TOML file") from None
    return loads(text, name=str(path), folder=path.parent)


def loads(text: str, *, name: str = "scenario", folder: PathLike = ".") -> Scenario:
    """A scenario from TOML text; messages name the file `name`. Raises as `load` does."""
    from ..io.toml import locate

    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as exc:
        raise ValueError(_syntax(name, text, str(exc))) from None
    where = Where(name, locate(text.replace("\r\n", "\n")))
    for section, value in tables.items():
        if section not in _schema.SECTIONS:
            what = "table" if isinstance(value, (dict, list)) else "key"
            raise ValueError(f"{where.text((), section)} {unknown(section, list(_schema.SECTIONS), what)}")
    return Scenario(**tables, folder=folder, where=where)


def _syntax(name: str, text: str, message: str) -> str:
    """tomllib's message with file and line in front, the form that editors recognise."""
    match = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)", message)
    line = int(match[1]) if match and match[1] else text.rstrip().count("\n") + 1
    column = f" (column {match[2]})" if match and match[2] else " (at the end)" if match else ""
    said = message[: match.start()] if match else message
    return f"{name}:{line}: {said}{column}; this is not valid TOML"


def _stand(part: Scene, ground: Scene | None, place: Any) -> Scene:
    """`part` placed on the earlier parts of the scenario, at place = [x, y] or [x, y, depth], m."""
    if ground is None:
        raise ValueError("on has no ground: put the table of the ground before this one")
    if not isinstance(place, list) or len(place) not in (2, 3):
        raise ValueError(f"on is {place!r}; give [x, y], m, or [x, y, depth]")
    return part.on(ground, place[0], place[1], depth=place[2] if len(place) == 3 else 0.0)


def _argument(key: str, value: Any) -> Any:
    """A value as its call takes it: pairs of a complex key become complex numbers."""
    if key in COMPLEX and isinstance(value, list) and value and all(isinstance(v, list) for v in value):
        for i, pair in enumerate(value):
            if len(pair) != 2 or not all(isinstance(v, (int, float)) for v in pair):
                raise ValueError(f"{key}[{i}] is {pair}; a complex number is a pair [real, imaginary]")
        return np.asarray(value, np.float64) @ (1, 1j)
    if key == "values" and np.ndim(value) == 3:  # gains of an antenna's table
        return np.asarray(value, np.float64) @ (1, 1j)
    return value
