"""The demo's scene, made by code: an airfield with an aeroplane, two tanks, a hangar, a control tower and trees.

Metres; x to the right of the picture, y up in it, z up. Each object is made about the origin, standing on
z = 0 and heading along +x, then turned and placed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import reduce
from operator import add
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..scene.material import Material
from ..scene.scene import Scene
from ..scene.triangles import normals

if TYPE_CHECKING:
    from trimesh import Trimesh

NumberOrArray = TypeVar("NumberOrArray", float, np.ndarray)
Chord = list[tuple[float, float]]  # (x, y) of its ends, m

HALF = 26.5  # m, half the side of the ground
# Amplitude reflectivities, chosen to look like an airfield at X band
METAL, CONCRETE, GRASS, PAINT, ASPHALT = 0.9, 0.6, 0.22, 0.22, 0.07
ROUGH = Material(diagram="cos")  # rough on a scale below the facets, so that every surface has speckle
# Slabs of concrete with heights of 4 mm: at 35 deg grazing, 9.6 GHz, 0.4 of the power stays in the mirror's direction.
# Walls with heights of 7.5 mm leave 0.002 of the power: smoother ones would outshine all else
SLAB, WALL = Material(diagram="cos", height=4e-3), Material(diagram="cos", height=7.5e-3)
FACING = 0.99  # cosine between the normals of walls that reflect to slabs, and the way along the ground to the radar
# Flat ground about objects: middle of the foot of the wall that faces the radar, width, and lengths behind that wall
# and before it, m. The part before it is a slab, onto which the wall reflects, and back
PADS = (
    (14.0, 19.0, 12.6, 9.0, 5.9),
    (-9.5, 16.6, 2.8, 3.0, 8.0),
    (-15.5, -8.25, 7.4, 4.5, 1.9),
    (-9.0, -15.25, 7.4, 4.5, 1.9),
)
SLAB_HEIGHT = 0.03  # m, above the ground
UNDER = 0.12  # m, by which a slab reaches under its wall, which is turned by a degree
FLAT_BEYOND = 3.0  # m about a pad, over which the ground rises to its own height


def scene(edge: float, seed: int = 0) -> Scene:
    """The whole scene, the ground in cells whose edges are at most `edge`, m; `echo` cuts the objects."""
    random = np.random.default_rng(seed)
    parts = [ground(edge, random), place(aeroplane(), (3.5, -5.5), 122, METAL), slabs()]
    parts += [on_pad(hangar(), (14.0, 15.0), 1, CONCRETE), on_pad(tower(), (-9.5, 15.5), -1, CONCRETE)]
    parts += [on_pad(tank(), (-15.5, -10.0), 1, METAL), on_pad(tank(), (-9.0, -17.0), 179, METAL)]
    parts += [tree((x, y, relief(x, y)), height, random) for x, y, height in TREES]
    return parts[0] + reduce(add, parts[1:])  # the ground, which is large, is copied once


TREES = (
    (-20.5, 18.0, 6.5), (-16.5, 20.5, 5.0), (-22.5, 12.0, 5.5), (-18.0, 13.0, 6.0), (-21.5, 6.5, 5.0),
    (20.5, -19.0, 6.0), (22.5, -13.5, 5.0), (16.0, -22.0, 5.5),
)  # fmt: skip


def rough(level: float) -> Material:
    """A rough surface of this amplitude reflectivity."""
    return replace(ROUGH, reflectivity=level)


def place(
    meshes: list[Trimesh], at: tuple[float, float], heading_deg: float, level: float, height: float | None = None
) -> Scene:
    """Rough meshes turned by a heading and placed on the ground, or at a height, m."""
    position = (*at, float(relief(*at)) if height is None else height)
    c, s = np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    parts = (Scene.from_mesh(m, material=rough(level), position=position, rotation=turn) for m in meshes)
    return reduce(add, parts)


def on_pad(meshes: list[Trimesh], at: tuple[float, float], heading_deg: float, level: float) -> Scene:
    """As `place`, on a pad; the upright walls that face the radar are smooth enough to reflect to its slab."""
    out = place(meshes, at, heading_deg, level, SLAB_HEIGHT)
    is_wall = normals(out.triangles)[:, 1] > FACING
    return replace(out, materials=(*out.materials, WALL), material=np.where(is_wall, len(out.materials), out.material))


def relief(x: NumberOrArray, y: NumberOrArray) -> NumberOrArray:
    """Height of the ground, m: flat near the taxiway and on pads, gently undulating away from them."""
    away = 1 - np.exp(-((taxiway(x, y) / 12) ** 2))
    for middle, foot, width, behind, before in PADS:
        outside = np.abs(x - middle) - width / 2, np.abs(y - foot - (before - behind) / 2) - (before + behind) / 2
        beside = sum(np.maximum(distance, 0) ** 2 for distance in outside)
        away = away * (1 - np.exp(-beside / FLAT_BEYOND**2))
    return away * (0.5 * np.sin(x / 6.5 + 1) * np.cos(y / 8.0) + 0.25 * np.sin((x + 2 * y) / 5.1))


def taxiway(x: NumberOrArray, y: NumberOrArray) -> NumberOrArray:
    """Distance from the taxiway's bent middle line, m."""
    return (y - 1.5 - 5 * np.tanh((x + 3) / 8)) / np.sqrt(1 + (0.62 / np.cosh((x + 3) / 8) ** 2) ** 2)


def ground(edge: float, random: np.random.Generator) -> Scene:
    """Grass in patches, a taxiway with its middle line."""
    n = int(np.ceil(2 * HALF / (edge / np.sqrt(2))))
    axis = np.linspace(-HALF, HALF, n + 1)
    x, y = np.meshgrid(axis, axis)
    bare = Scene.from_heights(axis, axis, relief(x, y), material=ROUGH)
    x, y, _ = np.moveaxis(bare.triangles.mean(axis=1), -1, 0)
    level = GRASS * (1 + 0.35 * patches(x, y, random))
    level[y < -12.5 - 0.3 * x] *= 1.7  # a field of taller growth, at the bottom of the picture
    across = np.abs(taxiway(x, y))
    level[across < 3.0] = ASPHALT
    level[across < 0.18] = PAINT
    return replace(bare, reflectivity=np.clip(level, 0, 1))


def slabs() -> Scene:
    """Slabs of concrete before walls, with which they make corners."""
    from ..scene import shapes

    material = replace(SLAB, reflectivity=CONCRETE)
    sides = [
        ((x, foot + (before - UNDER) / 2, SLAB_HEIGHT), (width, before + UNDER)) for x, foot, width, _, before in PADS
    ]
    return reduce(add, (shapes.plate(size, material=material).moved(middle) for middle, size in sides))


def patches(x: np.ndarray, y: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Smooth random variation about 0, mostly within +-1, from waves 3 to 30 m long; float32."""
    x, y = x.astype(np.float32), y.astype(np.float32)
    total = np.zeros_like(x)
    for _ in range(24):
        k = 2 * np.pi / random.uniform(3, 30)
        angle, phase = random.uniform(0, 2 * np.pi, 2).tolist()
        total += np.sin(k * math.cos(angle) * x + k * math.sin(angle) * y + phase)
    return total / np.sqrt(24)


def tree(foot: tuple[float, float, float], height: float, random: np.random.Generator, leaves: int = 3500) -> Scene:
    """A crown of leaves: small facets at random in an ellipsoid, denser towards its surface."""
    direction = random.normal(size=(leaves, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    radius = np.cbrt(random.uniform(0.25, 1, leaves))
    size = np.array([0.3, 0.3, 0.42]) * height
    bumps = 1 + 0.15 * np.sin(5 * np.arctan2(direction[:, 1], direction[:, 0]) + 3 * direction[:, 2])
    middle = direction * (radius * bumps)[:, None] * size + (0, 0, 0.57 * height)
    corners = middle[:, None] + 0.12 * random.normal(size=(leaves, 3, 3))
    return Scene.facets(corners + np.asarray(foot), material=rough(0.45))


def aeroplane() -> list[Trimesh]:
    """A small airliner, 22 m long and 22 m across."""
    import trimesh

    up = 2.7  # m, height of the fuselage axis
    radius = [0, 0.25, 0.7, 1.2, 1.35, 1.35, 1.2, 0.8, 0]
    along = [-11, -10.6, -8.5, -5, -3, 6.5, 8.3, 9.9, 10.8]
    body = trimesh.creation.revolve(np.column_stack([radius, along]), sections=28)
    body.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), (1, 0, 0)))
    body.apply_translation((0, 0, up))
    parts = [body]
    for side in (-1, 1):
        root, tip = [(3.2, 0.6), (-2.4, 0.6)], [(-1.9, 11.0), (-3.6, 11.0)]
        parts.append(slab(root, tip, side, up - 0.5, up + 0.5, 0.55, 0.15))
        parts.append(
            slab([(-7.6, 0.2), (-10.0, 0.2)], [(-9.4, 4.3), (-10.7, 4.3)], side, up + 0.4, up + 0.6, 0.3, 0.12)
        )
        engine = trimesh.creation.cylinder(radius=0.75, height=3.2, sections=20)
        engine.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), (1, 0, 0)))
        engine.apply_translation((2.0, 4.0 * side, up - 0.95))
        leg = trimesh.creation.box((0.3, 0.3, up - 0.5))
        leg.apply_translation((-1.0, 2.2 * side, (up - 0.5) / 2))
        parts += [engine, leg]
    nose = trimesh.creation.box((0.3, 0.3, up - 0.5))
    nose.apply_translation((8.5, 0, (up - 0.5) / 2))
    edges = [(-6.6, up + 1, 0.15), (-10.2, up + 0.6, 0.15), (-9.6, up + 4.6, 0.08), (-11.2, up + 4.6, 0.08)]
    fin = hull([(x, s * thick, z) for x, z, thick in edges for s in (-1, 1)])
    return [*parts, nose, fin]


def slab(
    root: Chord, tip: Chord, side: int, z_root: float, z_tip: float, thick_root: float, thick_tip: float
) -> Trimesh:
    """A wing: the hull of two chords (x, y), each of some thickness."""
    corners = [(x, side * y, z_root + s * thick_root / 2) for x, y in root for s in (-1, 1)]
    return hull(corners + [(x, side * y, z_tip + s * thick_tip / 2) for x, y in tip for s in (-1, 1)])


def tank() -> list[Trimesh]:
    """A battle tank, hull 7 m long, its gun forward."""
    import trimesh

    tracks = []
    for side in (-1, 1):
        outline = [(-3.4, 0.55), (-2.7, 0.0), (2.6, 0.0), (3.4, 0.6), (3.2, 1.0), (-3.2, 1.0)]
        tracks.append(hull([(x, side * y, z) for x, z in outline for y in (1.15, 1.75)]))
    body = hull(
        [(x, y, z) for x, z in [(-3.3, 0.5), (-3.1, 1.35), (2.0, 1.35), (3.5, 0.85), (3.0, 0.45)] for y in (-1.5, 1.5)]
    )
    low = [(-1.9, -1.25), (-1.9, 1.25), (0.6, 1.35), (1.6, 0.5), (1.6, -0.5), (0.6, -1.35)]
    turret = hull([(x, y, 1.3) for x, y in low] + [(0.8 * x - 0.1, 0.75 * y, 2.25) for x, y in low])
    gun = trimesh.creation.cylinder(radius=0.16, height=4.8, sections=12)
    gun.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), (1, 0, 0.04)))
    gun.apply_translation((3.6, 0, 1.85))
    return [*tracks, body, turret, gun]


def hangar() -> list[Trimesh]:
    """A gabled hall 12 x 8 m, 4 m to the eaves and 6 m to the ridge, its ridge along x."""
    low = [(x, y, z) for x in (-6, 6) for y in (-4, 4) for z in (0, 4)]
    return [hull([*low, (-6, 0, 6), (6, 0, 6)])]


def tower() -> list[Trimesh]:
    """A control tower 10 m high: a shaft, a glazed cab that widens upwards, a mast."""
    import trimesh

    def square(side: float, z: float) -> list[tuple[float, float, float]]:
        return [(side / 2 * sx, side / 2 * sy, z) for sx in (-1, 1) for sy in (-1, 1)]

    mast = trimesh.creation.cylinder(radius=0.15, height=3, sections=8)
    mast.apply_translation((0, 0, 11))
    return [
        hull(square(2.2, 0) + square(2.2, 7)),
        hull(square(2.8, 7) + square(4.4, 9.4)),
        hull(square(4.4, 9.4) + square(3.0, 10)),
        mast,
    ]


def hull(corners: ArrayLike) -> Trimesh:
    """The convex hull of points, m (n, 3), as a mesh."""
    import trimesh

    return trimesh.convex.convex_hull(np.asarray(corners, float))
