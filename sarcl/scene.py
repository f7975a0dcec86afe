"""Scenes: point scatterers and triangular facets."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import check

log = logging.getLogger(__name__)

# Amplitude reflectivity at normal incidence by material name; a number may be given in place of a name.
MATERIALS = {"metal": 1.0}


@dataclass(frozen=True, eq=False)
class Scene:
    """Point scatterers and triangular facets in one Cartesian frame, m. Scenes add: ``ground + tank``.

    positions     points, m (n, 3)
    amplitudes    complex (n,); |amplitude|^2 is the radar cross section, m^2
    triangles     facet corners, m (k, 3, 3), counter-clockwise seen from outside
    reflectivity  amplitude reflectivity of each facet, 0 to 1 (k,)
    roughness     standard deviation of each facet's height, m (k,): `echo` moves every facet along its normal
                  by a seeded Gaussian height, which makes speckle once it exceeds about a quarter wavelength
    two_sided     facets that reflect from both sides (k,): open sheets, and meshes that are not watertight
    """

    positions: np.ndarray
    amplitudes: np.ndarray
    triangles: np.ndarray
    reflectivity: np.ndarray
    roughness: np.ndarray
    two_sided: np.ndarray

    def __post_init__(self) -> None:
        n, k = (np.shape(a)[0] if np.ndim(a) else 1 for a in (self.positions, self.triangles))
        if n + k == 0:
            raise ValueError("scene is empty; give it at least one point or facet")
        shapes = {"positions": (n, 3), "triangles": (k, 3, 3), "amplitudes": (n,)}
        dtypes = {"amplitudes": np.complex128, "two_sided": np.bool_}
        for name in self.__dataclass_fields__:
            value, dtype = getattr(self, name), dtypes.get(name, np.float64)
            # What is read-only already needs no copy.
            if not isinstance(value, np.ndarray) or value.flags.writeable or value.dtype != dtype:
                value = check.sealed(check.converted(f"scene {name}", value, dtype))
            wanted = shapes.get(name, (k,))
            if value.shape != wanted:
                raise ValueError(f"scene {name} has shape {value.shape}, wanted {wanted}")
            check.finite(f"scene {name}", value)
            object.__setattr__(self, name, value)
        if (self.roughness < 0).any():
            bad = int(np.argmin(self.roughness))
            raise ValueError(f"roughness[{bad}] is {self.roughness[bad]:g} m; a standard deviation cannot be negative")

    @classmethod
    def points(cls, positions: Any, amplitudes: Any = 1.0) -> Scene:
        """Point scatterers at `positions`, m (n, 3), of complex `amplitudes` (n,) or one for all."""
        positions = check.array("positions", positions, np.float64, ("n", 3))
        if np.ndim(amplitudes) == 0:
            amplitudes = [amplitudes] * len(positions)
        amplitudes = check.array("amplitudes", amplitudes, np.complex128, (len(positions),))
        return cls(positions, amplitudes, *_no_facets())

    @classmethod
    def facets(
        cls, triangles: Any, *, material: str | float = "metal", roughness: Any = 0.0, two_sided: Any = True
    ) -> Scene:
        """Facets from their corners, m (k, 3, 3). Facets of no area are left out and counted in the log.

        ValueError when there are none, a corner is not finite, or every facet has zero area.
        """
        triangles = check.array("triangles", triangles, np.float64, ("n_facets", 3, 3))
        k = len(triangles)
        roughness = _spread("roughness", roughness, (k,))
        two_sided = _spread("two_sided", two_sided, (k,), np.bool_)
        longest = np.maximum.reduce(edges(triangles))
        # A needle thinner than 1e-12 of its length has no area that float64 corners could carry.
        solid = 2 * areas(triangles) > 1e-12 * longest**2
        if not solid.any():
            raise ValueError(f"all {k} facets are degenerate (zero area); nothing would reflect: check the mesh")
        if not solid.all():
            log.info("left out %d of %d facets: zero area", k - solid.sum(), k)
            triangles, roughness, two_sided = (check.sealed(a[solid]) for a in (triangles, roughness, two_sided))
        reflectivity = np.full(len(triangles), _reflectivity(material))
        return cls(*_no_points(), triangles, reflectivity, roughness, two_sided)

    @classmethod
    def from_mesh(
        cls,
        mesh: Any,
        *,
        material: str | float = "metal",
        scale: float = 1.0,
        position: Any = (0.0, 0.0, 0.0),
        rotation: Any = None,
        max_edge: float | None = None,
        roughness: float = 0.0,
    ) -> Scene:
        """A mesh file that trimesh reads, or a trimesh.Trimesh: corner -> rotation(scale corner) + position.

        scale     m per unit of the file
        position  m (3,)
        rotation  matrix (3, 3), rotation vector (3,) in rad, one angle about z in rad, or scipy's Rotation
        max_edge  cut facets until no edge is longer, m; `echo` also cuts to what the waveform resolves

        A mesh that is not watertight reflects from both sides of its facets, so that its winding does not
        matter. FileNotFoundError, ValueError: file missing, unreadable, without faces, corners not finite.
        """
        scale = check.number("scale", scale, above=0)
        position = check.array("position", position, np.float64, (3,))
        mesh = _load_mesh(mesh)
        triangles = np.asarray(mesh.triangles, np.float64) * scale @ _rotation(rotation).T + position
        scene = cls.facets(triangles, material=material, roughness=roughness, two_sided=not mesh.is_watertight)
        return scene if max_edge is None else scene.split(max_edge)

    @classmethod
    def from_heights(cls, x: Any, y: Any, z: Any, *, material: str | float = "metal", roughness: Any = 0.0) -> Scene:
        """Terrain of heights z (n_y, n_x) over increasing x (n_x,), y (n_y,), m: two facets a cell, facing up.

        roughness  m, one number or one per cell (n_y - 1, n_x - 1)
        """
        x = check.array("x", x, np.float64, ("n_x",))
        y = check.array("y", y, np.float64, ("n_y",))
        z = check.array("z", z, np.float64, (len(y), len(x)))
        for name, axis in (("x", x), ("y", y)):
            if len(axis) < 2 or not (np.diff(axis) > 0).all():
                raise ValueError(
                    f"{name} must hold at least two increasing values: a cell needs an extent; turn a falling axis "
                    "round together with z"
                )
        corner = np.stack([*np.meshgrid(x, y), z], axis=-1)
        sw, se, nw, ne = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
        triangles = np.stack([np.stack([sw, se, ne], axis=2), np.stack([sw, ne, nw], axis=2)], axis=2)
        cells = (len(y) - 1, len(x) - 1)
        roughness = _spread("roughness", roughness, cells)
        return cls.facets(
            triangles.reshape(-1, 3, 3), material=material, roughness=np.repeat(roughness, 2), two_sided=False
        )

    def __repr__(self) -> str:
        size = " x ".join(f"{s:.4g}" for s in self.bounds[1] - self.bounds[0])
        return f"Scene({len(self.positions)} points, {len(self.triangles)} facets, {size} m)"

    def __add__(self, other: Scene) -> Scene:
        if not isinstance(other, Scene):
            return NotImplemented
        names = self.__dataclass_fields__
        return Scene(*(check.sealed(np.concatenate([getattr(self, n), getattr(other, n)])) for n in names))

    @property
    def bounds(self) -> np.ndarray:
        """Lower and upper corner of the box that holds everything, m (2, 3)."""
        corners = np.concatenate([self.positions, self.triangles.reshape(-1, 3)])
        return box(corners)

    @property
    def center(self) -> np.ndarray:
        """Centre of that box, m (3,)."""
        return self.bounds.mean(axis=0)

    def split(self, max_edge: float, max_facets: int = 50_000_000) -> Scene:
        """The same surface with facets bisected at their longest edge until none is longer than max_edge, m.

        MemoryError when more than `max_facets` would be needed.
        """
        max_edge = check.number("max_edge", max_edge, above=0)
        if len(self.triangles) == 0:
            return self
        too_many = (
            f"facets no longer than {max_edge:g} m would number more than {max_facets:,}; "
            "take a smaller scene, a larger max_edge or a coarser resolution"
        )
        # No facet is larger than the equilateral one: most hopeless cuts end here, before they fill the memory.
        if areas(self.triangles).sum() > max_facets * np.sqrt(3) / 4 * max_edge**2:
            raise MemoryError(too_many)
        done: list[tuple[np.ndarray, ...]] = []
        names = ("triangles", "reflectivity", "roughness", "two_sided")
        part = tuple(getattr(self, n) for n in names)
        n_done = 0
        while len(part[0]):
            lengths = edges(part[0])
            long = np.maximum.reduce(lengths) > max_edge
            done.append(tuple(a[~long] for a in part))
            n_done += len(done[-1][0])
            if n_done + 2 * long.sum() > max_facets:
                raise MemoryError(too_many)
            part = tuple(np.concatenate([a, b]) for a, b in _bisect(tuple(a[long] for a in part), lengths[:, long]))
        joined = {n: check.sealed(np.concatenate([d[i] for d in done])) for i, n in enumerate(names)}
        return replace(self, **joined)


def box(points: np.ndarray) -> np.ndarray:
    """Lower and upper corner of the box that holds points (n, d): (2, d)."""
    # column by column: a reduction along the long axis of (n, 3) is several times slower
    return np.stack([[c.min() for c in points.T], [c.max() for c in points.T]])


def edges(triangles: np.ndarray) -> np.ndarray:
    """Lengths of the edges of triangles (k, 3, 3), corner i to i + 1: (3, k)."""
    d = (triangles[:, (i + 1) % 3] - triangles[:, i] for i in range(3))
    return np.stack([np.sqrt(np.einsum("ij,ij->i", e, e)) for e in d])


def areas(triangles: np.ndarray) -> np.ndarray:
    """Area of each triangle (k, 3, 3), m^2 (k,)."""
    n = _cross(triangles)
    return np.sqrt(np.einsum("ij,ij->i", n, n)) / 2


def centroids(triangles: np.ndarray) -> np.ndarray:
    """Centroid of each triangle (k, 3, 3), m (k, 3)."""
    return (triangles[:, 0] + triangles[:, 1] + triangles[:, 2]) / 3


def normals(triangles: np.ndarray) -> np.ndarray:
    """Outward unit normal of each triangle (k, 3, 3): (k, 3)."""
    n = _cross(triangles)
    return n / np.sqrt(np.einsum("ij,ij->i", n, n))[:, None]


def _cross(t: np.ndarray) -> np.ndarray:
    return np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])


def _bisect(part: tuple[np.ndarray, ...], lengths: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Both halves of every facet, cut at the middle of its longest edge; attributes are repeated."""
    start = lengths.argmax(axis=0)
    row = np.arange(len(start))
    a, b, c = (part[0][row, (start + i) % 3] for i in range(3))
    middle = (a + b) / 2
    halves = np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)
    return [halves, *((x, x) for x in part[1:])]


def _no_facets() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return np.zeros((0, 3, 3)), np.zeros(0), np.zeros(0), np.zeros(0, bool)


def _no_points() -> tuple[np.ndarray, np.ndarray]:
    return np.zeros((0, 3)), np.zeros(0, np.complex128)


def _spread(name: str, value: Any, shape: tuple[int, ...], dtype: Any = np.float64) -> np.ndarray:
    """`value` for every facet or cell: one number for all, or an array of `shape`; read-only."""
    if np.ndim(value) == 0:
        return np.broadcast_to(check.array(name, value, dtype, ()), shape)
    return check.array(name, value, dtype, shape)


def _reflectivity(material: str | float) -> float:
    if isinstance(material, str):
        if material not in MATERIALS:
            known = ", ".join(map(repr, MATERIALS))
            raise ValueError(f"material is {material!r}; known are {known}, or give a reflectivity from 0 to 1")
        return MATERIALS[material]
    value = check.number("material", material, least=0)
    if value > 1:
        raise ValueError(f"material is {value:g}; an amplitude reflectivity lies between 0 and 1")
    return value


def _rotation(rotation: Any) -> np.ndarray:
    """Matrix (3, 3) of a rotation given as a matrix, a rotation vector in rad, an angle about z, or None."""
    if rotation is None:
        return np.eye(3)
    if hasattr(rotation, "as_matrix"):
        rotation = rotation.as_matrix()
    if np.ndim(rotation) == 0:
        rotation = (0.0, 0.0, check.number("rotation", rotation))
    if np.ndim(rotation) == 1:
        from scipy.spatial.transform import Rotation

        return Rotation.from_rotvec(check.array("rotation", rotation, np.float64, (3,)).copy()).as_matrix()
    matrix = check.array("rotation", rotation, np.float64, (3, 3))
    # float32 matrices are orthonormal to 1e-7 only
    if not np.allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=1e-6) or np.linalg.det(matrix) < 0:
        raise ValueError("rotation is a matrix that does not rotate: its rows must be orthonormal, its determinant +1")
    left, _, right = np.linalg.svd(matrix)
    return left @ right


def _load_mesh(mesh: Any) -> Any:
    """A trimesh.Trimesh from a path or an object, its parts joined."""
    from pathlib import Path

    import trimesh

    what = "mesh"
    if isinstance(mesh, (str, Path)):
        what = f"mesh file {Path(mesh).name!r}"
        mesh = _read_mesh(Path(mesh), what)
    if isinstance(mesh, trimesh.Scene):
        mesh = mesh.to_mesh() if mesh.geometry else trimesh.Trimesh()
    if not isinstance(mesh, trimesh.Trimesh):
        raise TypeError(f"{what} is a {type(mesh).__name__}; give a file name or a trimesh.Trimesh")
    if len(mesh.faces) == 0:
        raise ValueError(
            f"{what} has no faces; nothing would reflect: check what the file holds and how it was exported"
        )
    check.finite(f"{what} vertices", np.asarray(mesh.vertices))
    if not mesh.is_watertight:
        welded = mesh.copy()
        welded.merge_vertices(merge_tex=True, merge_norm=True)
        return welded
    return mesh


def _read_mesh(path: Any, what: str) -> Any:
    """What trimesh makes of a file."""
    import trimesh

    if not path.exists():
        raise FileNotFoundError(f"mesh file {str(path)!r} does not exist; check the name and the folder")
    if path.is_dir():
        raise IsADirectoryError(f"mesh file {str(path)!r} is a folder; give the name of a file in it")
    known = sorted(trimesh.available_formats())
    if path.suffix.lower().lstrip(".") not in known:
        raise ValueError(f"{what}: unknown format {path.suffix!r}; known are {', '.join(known)}")
    try:
        # process=False: merging and reordering corners is not needed and hides what the file holds
        return trimesh.load_scene(path, process=False)
    except Exception as exc:
        # trimesh takes what is no binary file for text, and guesses its encoding with a package we do not need
        guess = isinstance(exc, ModuleNotFoundError) and exc.name == "charset_normalizer"
        why = "neither a whole binary file nor text" if guess else str(exc) or type(exc).__name__
        raise ValueError(
            f"{what} cannot be read as {path.suffix} ({why}): it is truncated, damaged or not what its name "
            "says; export it again"
        ) from exc
