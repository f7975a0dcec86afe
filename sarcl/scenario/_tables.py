"""Python objects written as the tables of a scenario."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from ..base import wgs84
from ..earth.dates import date
from ..earth.place import Place
from ..earth.state_vectors import StateVectors
from ..earth.two_line import TwoLineElements
from ..model.antenna import Antenna
from ..model.antenna_array import AntennaArray
from ..model.image_grid import ImageGrid
from ..model.orbit import Orbit
from ..model.radar import Radar
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..scene.material import METAL, Material
from ..scene.scene import Scene


def table_of(value: Any) -> Any:
    """The table of a Waveform, Trajectory, Scene, ...; any other value unchanged.

    An object made from its table equals the object; meshes are written as facets, not as the file they came from.
    """
    if isinstance(value, Waveform):
        return {"chirp" if value.kind == "down-chirp" else value.kind: _waveform(value)}
    if isinstance(value, Trajectory):
        table = _without_none(value, ("times", "positions", "velocities", "attitude", "accelerations"))
        return table if value.stop_and_go else {**table, "stop_and_go": False}
    if isinstance(value, Orbit):
        return _orbit(value)
    if isinstance(value, Place):
        return _without_none(value, ("longitude", "latitude", "height"))
    if isinstance(value, Scene):
        return _scene(value)
    if isinstance(value, Material):
        return _material(value)
    if isinstance(value, Antenna):
        return _antenna(value)
    if isinstance(value, AntennaArray):
        return _without_none(value, ("positions", "offsets", "weights", "plan"))
    if isinstance(value, Radar):
        return _without_none(value, ("power", "losses_db", "noise_temperature"))
    if isinstance(value, ImageGrid):
        if value.times is not None:
            return {"zero_doppler": {"times": value.times, "ranges": value.ranges, "positions": value.listed}}
        if value.map_axes is not None:
            x, y, dx, dy = value.map_axes
            bounds = x - dx / 2, y - dy / 2, x + (value.shape[1] - 0.5) * dx, y + (value.shape[0] - 0.5) * dy
            heights = wgs84.geodetic(value.positions)[2]
            return {"on_map": {"crs": value.crs, "bounds": bounds, "spacing": (dy, dx), "heights": heights}}
        if not value.is_plane:
            return {"points": {"positions": value.listed}}
        return {"plane": _without_none(value, ("center", "shape", "spacing", "normal", "x_axis"))}
    return value


def plain(value: Any) -> Any:
    """A value with arrays and tuples as lists, complex numbers as [real, imaginary], paths and dates (UTC) as text, at
    any depth."""
    if isinstance(value, (datetime.date, np.datetime64)):
        return str(np.datetime_as_string(date(value), unit="auto"))
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return sorted(value) if isinstance(value, (set, frozenset)) else value


def _orbit(value: Orbit) -> dict[str, Any]:
    epoch = {} if value.epoch is None else {"epoch": value.epoch}
    path = value.path
    if isinstance(path, TwoLineElements):
        return {"tle": {"line1": path.lines[0], "line2": path.lines[1], "span": value.span}}
    if isinstance(path, StateVectors):
        return {"states": {**_without_none(path, ("times", "positions", "velocities")), **epoch}}
    elements = {
        **_without_none(path, ("semi_major_axis", "eccentricity", "inclination", "node")),
        "argument_of_perigee": path.perigee,
        "mean_anomaly": path.anomaly,
        "j2": path.with_j2,
        "span": value.span,
    }
    return {"kepler": {**elements, **epoch}}


def _waveform(value: Waveform) -> dict[str, Any]:
    if value.kind == "sampled":
        return _without_none(value, ("signal", "rate", "center"))
    table = _without_none(value, ("center", "bandwidth", "duration"))
    return {**table, "down": True} if value.kind == "down-chirp" else table


def _antenna(value: Antenna) -> dict[str, Any]:
    kind = {"aperture": "rectangular"}.get(value.kind, value.kind)
    own = {
        "isotropic": (),
        "rectangular": ("size", "taper"),
        "gaussian": ("width", "frequency"),
        "table": ("azimuth", "elevation", "values", "frequency"),
    }[kind]
    common = ("gain_db",) if kind == "isotropic" else ("gain_db", "two_way", "mount")
    return {kind: _without_none(value, (*own, *common))}


def named(scene: Scene) -> dict[str, Material]:
    """The scene's materials, in their order, by unique names."""
    names: dict[str, Material] = {}
    for m in scene.materials:
        name, n = ("metal" if m == METAL else m.name or "material"), 1
        while name in names or (name == "metal" and m != METAL):
            n += 1
            name = f"{m.name or 'material'} {n}"
        names[name] = m
    return names


def look_up(key: str, value: object, materials: Mapping[str, Material]) -> Any:
    """A value of a scene's table, with names of materials replaced by the Materials where the key takes these."""
    if key not in ("material", "materials"):
        return value
    if isinstance(value, str):
        return materials.get(value, value)
    if isinstance(value, list):
        return [look_up(key, v, materials) for v in value]
    if isinstance(value, Mapping):
        return {part: look_up(key, v, materials) for part, v in value.items()}
    return value


def _material(value: Material) -> dict[str, Any]:
    # written even when equal to the default: defaults of other fields depend on these
    always = ("eps_r", "conductivity", "height")
    plain = {f.name: getattr(value, f.name) for f in fields(value) if f.name != "name"}
    return {n: v for n, v in plain.items() if n in always or v != Material.__dataclass_fields__[n].default}


def _scene(value: Scene) -> dict[str, Any]:
    tables: dict[str, Any] = {}
    if len(value.positions):
        apertures = {"apertures": value.apertures} if value.apertures.any() else {}
        tables["points"] = [{"positions": value.positions, "amplitudes": value.amplitudes, **apertures}]
    if len(value.triangles):
        names = list(named(value))
        # one table a run of facets of one material: their order, and so their random heights, stays
        change = np.flatnonzero(np.diff(value.material)) + 1
        tables["facets"] = [
            {
                "triangles": value.triangles[a:b],
                "material": names[value.material[a]],
                "reflectivity": value.reflectivity[a:b],
                "roughness": value.roughness[a:b],
                **({"point_roughness": value.point_roughness[a:b]} if value.point_roughness[a:b].any() else {}),
                "two_sided": value.two_sided[a:b],
            }
            for a, b in zip([0, *change], [*change, len(value.triangles)], strict=True)
        ]
    return tables


def _without_none(value: object, names: tuple[str, ...]) -> dict[str, Any]:
    return {n: getattr(value, n) for n in names if getattr(value, n) is not None}
