"""Scenario files: a simulation as TOML, with the Python names as tables and keys. See docs/guide/scenarios.md."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from ..base import arguments
from ..base.forecast import Forecast
from ..base.text import unknown
from ..io import input_paths, toml
from . import _focusing, _schema, _simulating
from ._building import Builder
from ._earth import pass_text
from ._schema import Where
from ._verb_call import in_blocks

if TYPE_CHECKING:
    from ..base.types import PathLike
    from ..earth.place import Place
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
    from ..verbs import BackprojectKeywords, EchoKeywords

Table = Mapping[str, object]  # table of a scenario: keys with plain values or further tables


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
    echo         arguments of `sarcl.echo`; or spectral_echo, fullwave_echo, of the functions of that name
    noise        arguments of `sarcl.add_noise`
    backproject  arguments of `sarcl.backproject`; or polar_format, range_doppler, of the functions of that name
    folder       folder that names of mesh and elevation files are relative to

    A section may be left out until it is used. Python objects become tables; arrays and tuples become lists. ValueError
    names the file, line and table of an unknown or missing key, a wrong type, or a value that is refused.

    >>> scenario = sarcl.Scenario(waveform=chirp, trajectory=track, scene=scene, grid=grid)
    >>> scenario.focus(scenario.simulate()).shape
    (128, 128)
    >>> again = sarcl.scenario.loads(scenario.dumps())
    >>> again.save("small.toml")
    >>> again.plan(tolerance=1e-2).run().n_rows, again.plan_focus(raw).run().shape
    (64, (128, 128))
    >>> parts = again.build_waveform(), again.build_track(), again.build_scene(), again.build_grid()
    >>> kepler = {"semi_major_axis": 7.07e6, "eccentricity": 0, "inclination": 1.71}
    >>> orbit = sarcl.Scenario(orbit={"kepler": kepler}).build_orbit()
    >>> again.build_receiver(), again.build_antenna(), again.build_array(), again.build_radar(), again.build_place()
    (None, None, None, None, None)
    """

    waveform: Waveform | Table | None = None
    trajectory: Trajectory | Table | None = None
    receiver: Trajectory | Table | None = None
    scene: Scene | Table | None = None
    grid: ImageGrid | Table | None = None
    echo: Table | None = None
    backproject: Table | None = None
    materials: Mapping[str, Material | Table] | None = None
    pointing: Table | None = None
    antenna: Antenna | Table | None = None
    receiver_pointing: Table | None = None
    receiver_antenna: Antenna | Table | None = None
    array: AntennaArray | Table | None = None
    radar: Radar | Table | None = None
    noise: Table | None = None
    orbit: Orbit | Table | None = None
    place: Place | Table | None = None
    spectral_echo: Table | None = None
    fullwave_echo: Table | None = None
    polar_format: Table | None = None
    range_doppler: Table | None = None
    folder: PathLike = Path()
    where: Where = field(default_factory=Where, repr=False)

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
        """Write the scenario to a file, `path`. Names of mesh files stay relative to the folder of the file."""
        from ..io import output_paths

        with output_paths.atomic(arguments.path("path", path)) as part:
            part.write_text(self.dumps(), encoding="utf-8")

    def build_waveform(self) -> Waveform:
        """The Waveform."""
        return Builder(self).one("waveform")

    def build_orbit(self) -> Orbit:
        """The Orbit."""
        return Builder(self).one("orbit")

    def build_place(self) -> Place | None:
        """The Place that is the origin of local coordinates; None where there is none."""
        return Builder(self).place()

    def build_track(self) -> Trajectory:
        """The transmitter's Trajectory, with the attitude that [pointing] describes.

        With [place] the middle of an orbit's pulses is by default the zero-Doppler time of the place.
        """
        return Builder(self).track()

    def describe_orbit(self) -> str:
        """The orbit, its pulses and how it sees the place, in lines of text; empty where there is no orbit."""
        return "" if self.orbit is None else pass_text(self.build_orbit(), self.build_track(), self.build_place())

    def build_receiver(self) -> Trajectory | None:
        """The receiver's Trajectory, None where it moves with the transmitter."""
        return Builder(self).receiver()

    def build_antenna(self) -> Antenna | tuple[Antenna, Antenna] | None:
        """The Antenna, a pair (transmitting, receiving), or None."""
        return Builder(self).antenna()

    def build_radar(self) -> Radar | None:
        """The Radar; None where amplitudes do not decrease with range."""
        return None if self.radar is None else Builder(self).one("radar")

    def build_array(self) -> AntennaArray | None:
        """The AntennaArray that transmits; None where a single antenna does."""
        return None if self.array is None else Builder(self).one("array")

    def build_grid(self) -> ImageGrid:
        """The ImageGrid; with [place], in Earth-fixed coordinates."""
        return Builder(self).grid()

    def build_scene(self) -> Scene:
        """The Scene: the sum of its tables, in the order they first appear; with [place], Earth-fixed."""
        return Builder(self).scene()

    def simulate(self, **options: Unpack[EchoKeywords]) -> PhaseHistory:
        """Echoes of the scene, with [noise]. `options`, arguments of `sarcl.echo`, take precedence over [echo].

        With [spectral_echo] or [fullwave_echo] they are computed by that function, whose options these are then.
        """
        _focusing.check_window(self)
        level = self._noise_level()
        return self._noisy(_simulating.call_of(self, options).run(), level)

    def _noisy(self, raw: PhaseHistory, level: dict[str, Any]) -> PhaseHistory:
        """Echoes with the noise of [noise], of that level; None stays None: a piece while others are missing."""
        if self.noise is None or raw is None:
            return raw
        from ..effects.noise import add_noise

        if "nesz" in level or "nesz_db" in level:
            level.setdefault("grid", None if "cell_area" in level else self.build_grid())
        with self.where.blame(("noise",), level):
            return add_noise(raw, **level)

    def _noise_level(self) -> dict[str, Any]:
        """Arguments of `add_noise`; ValueError, before echoes are computed, where they are not one level."""
        if self.noise is None:
            return {}
        from ..effects.noise import level_of

        level = Builder(self).options("noise", {})
        with self.where.blame(("noise",), level):
            level_of(level)
        return level

    def plan(self, **options: Unpack[EchoKeywords]) -> Forecast[PhaseHistory]:
        """Forecast of `simulate` with these options, as `sarcl.plan` makes it; its run() returns the echoes."""
        _focusing.check_window(self)
        level = self._noise_level()
        forecast: Forecast[PhaseHistory] = _simulating.call_of(self, options).plan()
        return replace(forecast, run=lambda: self._noisy(forecast.run(), level))

    @property
    def focuses_in_blocks(self) -> bool:
        """Whether `focus` takes several devices, and pieces."""
        return in_blocks(_focusing.section_of(self))

    @property
    def has_image(self) -> bool:
        """Whether the scenario says where an image is made: on [grid], or by [range_doppler]."""
        return self.grid is not None or self.range_doppler is not None

    @property
    def needs_grid(self) -> bool:
        """Whether `focus` wants a grid: range_doppler makes its own."""
        return _focusing.section_of(self) != "range_doppler"

    def describe_image(self) -> str:
        """The function that makes the image, and its grid, in words."""
        return _focusing.image_text(self)

    def default_grid_options(self) -> dict[str, Any]:
        """What [place] says about a grid that is chosen from the echoes: its centre."""
        place = self.build_place()
        return {} if place is None else {"center": place.origin}

    def focus(self, raw: PhaseHistory, grid: ImageGrid | None = None, **options: Unpack[BackprojectKeywords]) -> Image:
        """The image of `raw` on `grid`, default [grid]. `options` take precedence over those in [backproject].

        With [polar_format] or [range_doppler] the image is made by that function, whose options these are then;
        range_doppler makes a grid of its own.
        """
        image: Image = _focusing.call_of(self, raw, grid, options).run()
        return image

    def plan_focus(
        self, raw: PhaseHistory, grid: ImageGrid | None = None, **options: Unpack[BackprojectKeywords]
    ) -> Forecast[Image]:
        """Forecast of `focus(raw, grid)` with these options, as `sarcl.plan` makes it; its run() returns the image."""
        forecast: Forecast[Image] = _focusing.call_of(self, raw, grid, options).plan()
        return forecast


def load(path: PathLike) -> Scenario:
    """The scenario of a file, `path`; mesh files are found relative to its folder.

    ValueError names file and line where the text is not TOML or not a scenario; FileNotFoundError.

    >>> from pathlib import Path
    >>> file = Path("small.toml")
    >>> _ = file.write_text('''
    ... waveform.chirp = {center = 9.6e9, bandwidth = 150e6, duration = 2e-6}
    ... trajectory.circle = {radius = 7e3, height = 5e3, arc = 0.02, n_pulses = 64}
    ... scene.points = [{positions = [[10, 0, 0]]}]
    ... ''')
    >>> raw = sarcl.scenario.load(file).simulate()
    """
    path = arguments.path("path", path)
    try:
        text = input_paths.contents(path, "scenario file").decode("utf-8")
    except UnicodeDecodeError as exc:
        raise ValueError(f"{path}: byte {exc.start} is not UTF-8 text; a scenario is a TOML file") from None
    return loads(text, name=str(path), folder=path.parent)


def loads(text: str, *, name: str = "scenario", folder: PathLike = ".") -> Scenario:
    """A scenario from TOML text. Raises as `load` does.

    name  of the file, in messages;  folder  that names of mesh files are relative to

    >>> small = '''
    ... waveform.chirp = {center = 9.6e9, bandwidth = 150e6, duration = 2e-6}
    ... trajectory.circle = {radius = 7e3, height = 5e3, arc = 0.02, n_pulses = 64}
    ... scene.points = [{positions = [[10, 0, 0]]}]
    ... '''
    >>> sarcl.scenario.loads(small).simulate().n_rows
    64
    """
    from ..io import toml

    if not isinstance(text, str):
        raise TypeError(f"text is a {type(text).__name__}; give the text of a scenario; scenario.load reads a file")
    tables = toml.tables(text, name)
    where = Where(name, toml.locate(text.replace("\r\n", "\n")))
    for section, value in tables.items():
        if section not in _schema.SECTIONS:
            what = "table" if isinstance(value, (dict, list)) else "key"
            raise ValueError(f"{where.text((), section)} {unknown(section, list(_schema.SECTIONS), what)}")
    return Scenario(**tables, folder=folder, where=where)
