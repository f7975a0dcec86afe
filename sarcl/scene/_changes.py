"""Scenes that follow from a scene: moved, placed on others or on the Earth, realized, and cut. Methods of Scene."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import arguments, validation
from ..base.constants import SPEED_OF_LIGHT
from . import terrain
from . import triangles as geometry

if TYPE_CHECKING:
    from .scene import Scene

FACET_ARRAYS = ("triangles", "reflectivity", "roughness", "two_sided", "material", "point_roughness")
POINT_HEIGHTS = 1  # stream of random numbers; stream 0 is that of the facets' heights


def no_displacements(k: int) -> np.ndarray:
    """Zero displacements for k facets, which occupy no memory."""
    return np.broadcast_to(0.0, (k, 3, 3))


def height_at(scene: Scene, x: float, y: float) -> float:
    """Height of the highest facet at (x, y), m, in a frame whose z points up. ValueError where there is none."""
    x, y = validation.number("x", x), validation.number("y", y)
    z = geometry.highest(scene.triangles, x, y)
    if z is None:
        low, high = scene.bounds
        raise ValueError(
            f"no facet lies at x {x:g}, y {y:g} m; the scene reaches from ({low[0]:g}, {low[1]:g}) to "
            f"({high[0]:g}, {high[1]:g})"
        )
    return z


def on(scene: Scene, ground: Scene, x: float, y: float, *, depth: float = 0.0) -> Scene:
    """This scene moved so that its origin is over (x, y) and its lowest point `depth` m under `ground` there.

    Composites are sums: ``ground + tank.on(ground, 10, -5)``. ValueError where there is no ground at (x, y).
    """
    validation.instance("ground", ground, type(scene))
    rise = ground.height_at(x, y) - float(scene.bounds[0, 2]) - validation.number("depth", depth)
    return scene.moved((x, y, rise))


def moved(scene: Scene, by: ArrayLike) -> Scene:
    """This scene moved by a vector, m (3,)."""
    by = validation.array("by", by, np.float64, (3,))
    positions, triangles = validation.sealed(scene.positions + by), validation.sealed(scene.triangles + by)
    heights = scene.heights
    if heights is not None:
        x, y, z = (validation.sealed(values + step) for values, step in zip(heights, by, strict=True))
        heights = x, y, z
    return replace(scene, positions=positions, triangles=triangles, heights=heights)


def on_earth(scene: Scene, longitude: float, latitude: float, height: float = 0.0) -> Scene:
    """This scene, in x east, y north, z up of a place, in Earth-fixed coordinates, as for echoes of an orbit.

    longitude, latitude, height   of the place, degrees and m above the ellipsoid

    Terrain of from_heights has its shadows computed by rays afterwards, as other facets have. ValueError for angles
    that are no place.
    """
    from ..earth.place import Place

    place = Place(longitude, latitude, height)
    fields: dict[str, Any] = {
        n: validation.sealed(place.positions(getattr(scene, n))) for n in ("positions", "triangles")
    }
    if scene.has_random_points:
        fields["point_roughness"] = validation.sealed(np.asarray(scene.point_roughness @ place.axes))
    return replace(scene, heights=None, **fields)


def realized(scene: Scene, seed: int = 0) -> Scene:
    """One realization of the surface that point_roughness describes: corners are moved by seeded Gaussian numbers.

    The number is a hash of the seed and the corner's position, so facets that share a corner stay joined, and
    neither order nor neighbours matter. Scenes without point_roughness are returned as they are.
    """
    seed = validation.count("seed", seed, 0)
    if not scene.has_random_points:
        return scene
    return scene.kept.of(("realized", seed), lambda: _realized(scene, seed))


def _realized(scene: Scene, seed: int) -> Scene:
    from ..base.counter_rng import gaussian

    random = gaussian(scene.triangles.reshape(-1, 3), seed, POINT_HEIGHTS).reshape(-1, 3, 1)
    moved = validation.sealed(scene.triangles + random * scene.point_roughness)
    heights = None if scene.heights is None else terrain.raised(scene.heights, scene.triangles, moved)
    return replace(scene, triangles=moved, point_roughness=no_displacements(len(moved)), heights=heights)


def at_frequency(scene: Scene, frequency: float) -> Scene:
    """The same echo at `frequency`, Hz, with `apertures` made part of the points' amplitudes.

    Scenes without apertures are returned as they are. ValueError for a frequency that is not greater than 0.
    """
    frequency = validation.carrier("frequency", frequency)
    if not scene.apertures.any():
        return scene
    areas = scene.apertures
    factor = np.where(areas > 0, np.sqrt(4 * np.pi) * areas * frequency / SPEED_OF_LIGHT, 1.0)
    return replace(scene, amplitudes=validation.sealed(scene.amplitudes * factor), apertures=np.zeros_like(areas))


def part(scene: Scene, which: np.ndarray) -> Scene:
    """The scene with only those of its facets for which `which`, bool (k,), is True."""
    which = arguments.chosen("which", which, len(scene.triangles), "facets")
    parts: dict[str, Any] = {n: validation.sealed(getattr(scene, n)[which]) for n in FACET_ARRAYS}
    return replace(scene, **parts)


def split(scene: Scene, max_edge: float, max_facets: int = 50_000_000) -> Scene:
    """The same surface with facets bisected at their longest edge until none is longer than max_edge, m.

    Raises MemoryError when more than `max_facets` would result, ValueError for point_roughness not yet realized.
    """
    max_edge = validation.number("max_edge", max_edge, above=0)
    max_facets = validation.count("max_facets", max_facets)
    if len(scene.triangles) == 0:
        return scene
    if scene.has_random_points:
        raise ValueError(
            "point_roughness is one random height per grid point, and cutting facets would add points; "
            "call scene.realized(seed) first"
        )
    triangles, row = geometry.cut(scene.triangles, max_edge, max_facets)
    belongs: dict[str, Any] = {
        n: validation.sealed(getattr(scene, n)[row]) for n in ("reflectivity", "roughness", "two_sided", "material")
    }
    return replace(scene, triangles=validation.sealed(triangles), point_roughness=no_displacements(len(row)), **belongs)
