"""Objects that the tables of a scenario describe: waveform, track, scene, grid."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _schema
from ._earth import earth_fixed, on_terrain, time_over

if TYPE_CHECKING:
    from ..earth.place import Place
    from ..model.antenna import Antenna
    from ..model.image_grid import ImageGrid
    from ..model.trajectory import Trajectory
    from ..scene.scene import Scene
    from .scenario import Scenario

# Arguments that may be complex. TOML has no complex numbers: they are lists of [real, imaginary] pairs.
COMPLEX = {"amplitudes", "signal", "weights"}


@dataclass(frozen=True, eq=False)
class Builder:
    """Makes the objects of a scenario; ValueError names file, line and table of what cannot be made."""

    scenario: Scenario

    def place(self) -> Place | None:
        """The Place that is the origin of local coordinates; None where there is none."""
        return None if self.scenario.place is None else self.one("place")

    def track(self) -> Trajectory:
        """The transmitter's Trajectory, see `Scenario.build_track`."""
        kind = next(iter(self.section("trajectory")))
        if kind != "orbit":
            if self.scenario.orbit is not None:
                raise ValueError(
                    f"{self.scenario.where.text(('orbit',))} has no pulses: [trajectory.{kind}] describes another "
                    "track; give [trajectory.orbit] with prf, n_pulses and start or center"
                )
            self._check_local(kind, "trajectory")
            return self._aimed(self.one("trajectory"), "pointing")
        orbit, table = self.one("orbit"), dict(self.section("trajectory")["orbit"])
        place = self.place()
        if place is not None and not {"start", "center"} & set(table):
            with self.scenario.where.blame(("place",), {}):
                table["center"] = time_over(orbit, place)
        return self._aimed(self.call(("trajectory", "orbit"), table, orbit.trajectory), "pointing")

    def receiver(self) -> Trajectory | None:
        """The receiver's Trajectory, None where it moves with the transmitter."""
        if self.scenario.receiver is None:
            return None
        self._check_local(next(iter(self.section("receiver"))), "receiver")
        return self._aimed(self.one("receiver"), "receiver_pointing" if self.scenario.receiver_pointing else "pointing")

    def antenna(self) -> Antenna | tuple[Antenna, Antenna] | None:
        """The Antenna, a pair (transmitting, receiving), or None."""
        if self.scenario.antenna is None:
            if self.scenario.receiver_antenna is not None:
                raise ValueError(
                    f"{self.scenario.where.text(('receiver_antenna',))} has no [antenna] to transmit; add one"
                )
            return None
        sends = self.one("antenna")
        return sends if self.scenario.receiver_antenna is None else (sends, self.one("receiver_antenna"))

    def grid(self) -> ImageGrid:
        """The ImageGrid; with [place], in Earth-fixed coordinates."""
        place = self.place()
        if place is None:
            return self.one("grid")
        ((kind, table),) = self.section("grid").items()
        if kind in ("zero_doppler", "on_map"):  # Earth-fixed by its nature
            return self.one("grid")
        with self.scenario.where.blame(("grid", kind), table):
            local = on_terrain(place, table) if kind == "on_terrain" else table
        grid: ImageGrid = self.call(("grid", kind), local, _schema.calls("grid", [kind])[kind])
        return grid.on_earth(place.longitude, place.latitude, place.height)

    def scene(self) -> Scene:
        """The Scene: the sum of its tables, in the order they first appear; with [place], Earth-fixed."""
        from ..scene.material import Material
        from ._tables import look_up

        materials = {
            name: self.call(("materials", name), table, partial(Material, name=name))
            for name, table in self.scenario.tables.get("materials", {}).items()
        }
        scene, origin = None, self.place()
        for kind, value in self.section("scene").items():
            for path, table in _schema.tables_of("scene", kind, value):
                place = table.get(_schema.ON)
                table = {k: look_up(k, v, materials) for k, v in table.items() if k != _schema.ON}
                if origin is not None and kind == "from_dem":
                    with self.scenario.where.blame(path, table):
                        table = on_terrain(origin, table)
                part = self.call(path, table, _schema.calls("scene")[kind])
                if place is not None:
                    with self.scenario.where.blame(path, {_schema.ON: place}):
                        part = _stand(part, scene, place)
                scene = part if scene is None else scene + part
        assert scene is not None
        return scene if origin is None else scene.on_earth(origin.longitude, origin.latitude, origin.height)

    def _aimed(self, track: Trajectory, section: str) -> Trajectory:
        table = getattr(self.scenario, section)
        if table is None:
            return track
        ((kind, values),) = table.items()
        values = earth_fixed(self.place(), values)
        return self.call((section, kind), values, partial(_schema.calls(section)[kind], track))

    def _check_local(self, kind: str, section: str) -> None:
        """ValueError for a track in local coordinates where [place] makes the scene Earth-fixed."""
        if self.scenario.place is not None and kind in ("line", "circle"):
            raise ValueError(
                f"{self.scenario.where.text((section, kind))} is a track in local coordinates, while [place] "
                "makes the scene Earth-fixed, for orbits; leave [place] out"
            )

    def section(self, name: str) -> dict[str, Any]:
        """The table of a section. ValueError where there is none."""
        table = getattr(self.scenario, name)
        if table is None:
            kinds = [k for k in _schema.calls(name) if k]
            more = f"{name}.{kinds[0]}"
            raise ValueError(f"{self.scenario.where.name}: there is no {name}; add a [{more}] table")
        return table

    def one(self, name: str) -> Any:
        """The object that a section describes in one table."""
        table = self.section(name)
        kind = next(iter(table))
        calls = _schema.calls(name, [kind])
        if kind in calls:
            return self.call((name, kind), table[kind], calls[kind])
        return self.call((name,), table, calls[""])

    def call(self, path: _schema.Path, table: Mapping[str, Any], call: _schema.Call) -> Any:
        """call(**table), with files relative to the scenario's folder; messages name file, line and table."""
        renamed = {new: old for old, new in _schema.RENAMED.items() if old in inspect.signature(call).parameters}
        with self.scenario.where.blame(path, table):
            arguments = {renamed.get(k, k): _argument(k, v) for k, v in table.items()}
            for name in ("mesh", "path", "dem", "geoid"):
                if isinstance(arguments.get(name), str):
                    arguments[name] = self.scenario.folder / arguments[name]
            left_out = [p.name for p in inspect.signature(call).parameters.values() if _schema.may_be_left_out(p)]
            return call(**{**dict.fromkeys(left_out), **arguments})

    def options(self, name: str, options: Mapping[str, Any]) -> dict[str, Any]:
        """Arguments of a function. A list is a pair, or a name with its parameters: a tuple in Python."""
        table = getattr(self.scenario, name) or {}
        return {k: tuple(v) if isinstance(v, list) else v for k, v in {**table, **options}.items()}


def _stand(part: Scene, ground: Scene | None, place: object) -> Scene:
    """`part` placed on the earlier parts of the scenario, at place = [x, y] or [x, y, depth], m."""
    if ground is None:
        raise ValueError("on has no ground: put the table of the ground before this one")
    if not isinstance(place, list) or len(place) not in (2, 3):
        raise ValueError(f"on is {place!r}; give [x, y], m, or [x, y, depth]")
    return part.on(ground, place[0], place[1], depth=place[2] if len(place) == 3 else 0.0)


def _argument(key: str, value: Any) -> Any:
    """A value as its call takes it: pairs of a complex key become complex numbers."""
    if key == "eps_r" and isinstance(value, list):
        if len(value) != 2 or not all(isinstance(v, (int, float)) for v in value):
            raise ValueError(f"eps_r is {value}; give a number, or with losses a pair [real, imaginary], as [3, -0.05]")
        return complex(*value)
    if key in COMPLEX and isinstance(value, list) and value and all(isinstance(v, list) for v in value):
        for i, pair in enumerate(value):
            if len(pair) != 2 or not all(isinstance(v, (int, float)) for v in pair):
                raise ValueError(f"{key}[{i}] is {pair}; a complex number is a pair [real, imaginary]")
        return np.asarray(value, np.float64) @ (1, 1j)
    if key == "values" and np.ndim(value) == 3:  # gains of an antenna's table
        return np.asarray(value, np.float64) @ (1, 1j)
    return value
