"""Scenes: point scatterers and triangular facets, from arrays, heights, meshes and elevation models."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import validation
from ..base.boxes import box
from ..base.text import NotebookTable, interval
from . import _changes, _fields, terrain
from . import triangles as geometry
from ._kept import Kept
from .material import Material
from .material_arguments import FacetMaterials, MaterialLike, merge, resolve

if TYPE_CHECKING:
    import trimesh
    from scipy.spatial.transform import Rotation

    from ..base.types import PathLike

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Scene(NotebookTable):
    """Point scatterers and triangular facets in one Cartesian frame, m. Scenes add: ``ground + tank``.

    positions        points, m (n, 3)
    amplitudes       complex (n,); |amplitude|^2 is the radar cross section, m^2
    triangles        facet corners, m (k, 3, 3), counter-clockwise seen from outside
    reflectivity     factor on each facet's amplitude, 0 to 1 (k,), which includes that of its material
    roughness        standard deviation of each facet's height, m (k,): `echo` moves every facet along its normal
                     by a seeded Gaussian height, which causes speckle above about a quarter of a wavelength
    two_sided        facets that reflect from both sides (k,): open sheets, and meshes that are not watertight
    material         index of each facet's material in `materials`, int32 (k,), default 0
    materials        tuple of sarcl.Material, default a perfect conductor; their own reflectivity is moved into
                     `reflectivity`
    point_roughness  displacement of each corner by one standard deviation, m (k, 3, 3); `realized` applies it
    apertures        m^2 (n,), of points that send back what falls on such an area, as a Luneburg lens does: `echo`
                     multiplies their amplitudes by sqrt(4 pi) aperture/wavelength at the carrier (`at_frequency`);
                     0 for other points, the default
    heights          (x, y, z) of the largest terrain of from_heights in the scene, if any: no antenna may stand
                     under it, and `echo` leaves it out as an occluder where all of it lies below every line of sight

    >>> ground = sarcl.Scene.from_heights([-20, 0, 20], [-20, 0, 20], np.zeros((3, 3)))
    >>> house, lamp = sarcl.shapes.box((4, 2, 3)), sarcl.Scene.points([[-5, 0, 1]], amplitudes=10)
    >>> scene = ground + house.on(ground, 5, 0) + lamp
    >>> len(scene.triangles), len(scene.positions)
    (20, 1)
    >>> ground.height_at(5, 0), scene.moved((0, 0, 2)).bounds[0]
    (0.0, array([-20., -20.,   2.]))
    >>> sarcl.Scene.facets([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], material="metal").split(max_edge=0.8).triangles.shape
    (4, 3, 3)
    >>> import trimesh
    >>> body = sarcl.Scene.from_mesh(trimesh.creation.box((4, 2, 3)), max_edge=1.0)
    >>> rough = sarcl.Scene.from_heights([0, 1, 2], [0, 1, 2], np.zeros((3, 3)), point_roughness=0.01).realized(seed=1)
    >>> on_site = scene.on_earth(longitude=7.01, latitude=46.005, height=640)
    >>> alps = sarcl.Scene.from_dem("terrain.tif", heights="ellipsoid")  # needs sarcl[maps]
    """

    positions: NDArray[np.float64]
    amplitudes: NDArray[np.complex128]
    triangles: NDArray[np.float64]
    reflectivity: NDArray[np.float64]
    roughness: NDArray[np.float64]
    two_sided: NDArray[np.bool_]
    material: NDArray[np.int32] = None  # type: ignore[assignment]
    materials: tuple[Material, ...] = ()
    point_roughness: NDArray[np.float64] = None  # type: ignore[assignment]
    heights: terrain.Heights | None = None
    apertures: NDArray[np.float64] = None  # type: ignore[assignment]

    if TYPE_CHECKING:  # types of the arguments; the fields above have the types after conversion

        def __init__(
            self,
            positions: ArrayLike,
            amplitudes: ArrayLike,
            triangles: ArrayLike,
            reflectivity: ArrayLike,
            roughness: ArrayLike,
            two_sided: ArrayLike,
            material: ArrayLike | None = None,
            materials: Sequence[Material] = (),
            point_roughness: ArrayLike | None = None,
            heights: terrain.Heights | None = None,
            apertures: ArrayLike | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        _fields.check(self)

    @classmethod
    def points(cls, positions: ArrayLike, amplitudes: ArrayLike = 1.0, *, apertures: ArrayLike = 0.0) -> Scene:
        """Point scatterers at `positions`, m (n, 3), of complex `amplitudes` (n,) or one for all.

        apertures  m^2 (n,) or one for all: as in Scene, for points whose cross section grows with the frequency
        """
        positions = validation.array("positions", positions, np.float64, ("n", 3))
        geometry.check_reach("positions", positions)
        if validation.ndim("amplitudes", amplitudes) == 0:
            amplitudes = [cast(complex, amplitudes)] * len(positions)
        amplitudes = validation.array("amplitudes", amplitudes, np.complex128, (len(positions),))
        areas = validation.each("apertures", apertures, len(positions))
        none = np.zeros(0)
        return cls(positions, amplitudes, np.zeros((0, 3, 3)), none, none, np.zeros(0, bool), apertures=areas)

    @classmethod
    def facets(
        cls,
        triangles: ArrayLike,
        *,
        material: FacetMaterials = "metal",
        materials: Sequence[MaterialLike] | None = None,
        reflectivity: ArrayLike = 1.0,
        roughness: ArrayLike = 0.0,
        point_roughness: ArrayLike | None = None,
        two_sided: ArrayLike = True,
    ) -> Scene:
        """Facets from their corners, m (k, 3, 3). Facets without area are left out; their number is logged.

        material      a name of sarcl.scene.material.MATERIALS, a sarcl.Material, a number (a perfect conductor of this
                      amplitude reflectivity, 0 to 1), or one of these for each facet (k,)
        materials     a list of materials that `material` refers to by name, or by whole numbers as indices
        reflectivity  another factor, 0 to 1, one or (k,)
        roughness, two_sided   as in Scene, one or (k,);  point_roughness  as in Scene (k, 3, 3)
        Raises ValueError when there are none, a corner is not finite, or every facet has zero area.
        """
        triangles = validation.array("triangles", triangles, np.float64, ("n_facets", 3, 3))
        geometry.check_reach("triangles", triangles)
        k = len(triangles)
        index, factor, table = resolve(material, materials, (k,))
        factor = factor * terrain.spread("reflectivity", reflectivity, (k,))
        if not ((factor >= 0) & (factor <= 1)).all():
            raise ValueError("reflectivity must lie between 0 and 1: it is a factor on the amplitude")
        parts: dict[str, Any] = {
            "triangles": triangles,
            "reflectivity": validation.sealed(factor),
            "roughness": terrain.spread("roughness", roughness, (k,)),
            "two_sided": terrain.spread("two_sided", two_sided, (k,), np.bool_),
            "material": index,
            "point_roughness": _changes.no_displacements(k),
        }
        if point_roughness is not None:
            parts["point_roughness"] = validation.array("point_roughness", point_roughness, np.float64, (k, 3, 3))
        solid = geometry.solid(triangles)
        if not solid.any():
            raise ValueError(f"all {k} facets are degenerate (zero area); nothing would reflect: check the mesh")
        if not solid.all():
            log.info("left out %d of %d facets: zero area", k - solid.sum(), k)
            parts = {n: validation.sealed(a[solid]) for n, a in parts.items()}
        return cls(positions=np.zeros((0, 3)), amplitudes=np.zeros(0, np.complex128), materials=table, **parts)

    @classmethod
    def from_mesh(
        cls,
        mesh: str | Path | trimesh.Trimesh | trimesh.Scene,
        *,
        material: MaterialLike | Mapping[str, MaterialLike] = "metal",
        scale: float | None = None,
        units: Literal["m", "cm", "mm", "in", "ft"] | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | Rotation | None = None,
        max_edge: float | None = None,
        roughness: float = 0.0,
        repair: bool = True,
        external: bool = False,
    ) -> Scene:
        """A mesh file that trimesh reads, or a trimesh.Trimesh or .Scene: corner -> rotation(scale corner) + position.

        material  one for all, or {part: material}, a part named by its node, geometry or material in the file;
                  "*" is every part not named
        scale     m per unit of the file; None: the unit that the file names (.dae and .3mf do; a warning says so where
                  it is not the metre), else 1, with a warning for a scene longer than 1 km
        units     "m", "cm", "mm", "in" or "ft": the unit of the file, in place of scale
        position  m (3,)
        rotation  matrix (3, 3), rotation vector (3,) in rad, one angle about z in rad, or scipy's Rotation
        max_edge  cut facets until no edge is longer, m; `echo` also cuts to what the waveform resolves
        repair    remove repeated faces, wind neighbours consistently and closed bodies outwards, but for walls of
                  cavities in them; what is done is logged
        external  the file may name others (buffers, materials) outside its folder: for files that you trust

        A mesh that is not watertight reflects from both sides of its facets, so that its winding does not
        matter. Raises FileNotFoundError or ValueError for a file that is missing, unreadable or without faces, and for
        corners that are not finite.
        """
        from ..io.meshes.mesh import load, metres_per_unit, part_materials

        position = validation.array("position", position, np.float64, (3,))
        rotate = geometry.rotation(rotation)
        content = load(mesh, validation.flag("repair", repair), validation.flag("external", external))
        parts = part_materials(material, content)
        scale = metres_per_unit(content, scale, units)
        with np.errstate(over="ignore", invalid="ignore"):
            corners = content.triangles * scale @ rotate.T + position
        geometry.check_reach(f"corners of a mesh of scale {scale:g}", corners)
        if not geometry.solid(corners).any():
            what = f"mesh file {Path(mesh).name!r}" if isinstance(mesh, (str, Path)) else "mesh"
            raise ValueError(
                f"all {len(corners)} facets are degenerate (zero area); nothing would reflect: check the {what}"
            )
        scene = cls.facets(corners, **parts, roughness=roughness, two_sided=not content.closed)
        return scene if max_edge is None else scene.split(max_edge)

    @classmethod
    def from_heights(
        cls,
        x: ArrayLike,
        y: ArrayLike,
        z: ArrayLike | Callable[[np.ndarray, np.ndarray], ArrayLike],
        *,
        material: FacetMaterials = "metal",
        materials: Sequence[MaterialLike] | None = None,
        roughness: ArrayLike = 0.0,
        point_roughness: ArrayLike = 0.0,
    ) -> Scene:
        """Terrain of heights z (n_y, n_x) over increasing x (n_x,), y (n_y,), m: two facets per cell, facing up.

        z                or a function z(x, y) of two arrays (n_y, n_x)
        material         one, or one per cell (n_y - 1, n_x - 1); materials  as in Scene.facets
        roughness        m, one number or one per cell: the cell's facets are moved along their normals
        point_roughness  m, one number or one per grid point (n_y, n_x): standard deviation of its height;
                         facets are moved and tilted, the surface stays closed (`Scene.realized`)
        """
        points = terrain.grid(x, y, z)
        up = np.array([0.0, 0.0, 1.0])
        scene = cls.facets(
            **terrain.surface(
                points, up, material=material, materials=materials, roughness=roughness, point_roughness=point_roughness
            )
        )
        return replace(scene, heights=terrain.heights(points))

    @classmethod
    def from_dem(
        cls,
        path: PathLike,
        *,
        bounds: Sequence[float] | np.ndarray | None = None,
        center: Sequence[float] | np.ndarray | None = None,
        frame: Literal["local", "ecef"] = "local",
        heights: str | None = None,
        geoid: str | Path | ArrayLike | Callable[[np.ndarray, np.ndarray], ArrayLike] | None = None,
        nodata: float | None = None,
        material: FacetMaterials = "metal",
        materials: Sequence[MaterialLike] | None = None,
        roughness: ArrayLike = 0.0,
        point_roughness: ArrayLike = 0.0,
        external: bool = False,
    ) -> Scene:
        """Terrain from an elevation model, file `path`, that rasterio reads (GeoTIFF ...): pip install sarcl[maps].

        bounds   (west, south, east, north), degrees, default the whole file
        center   (longitude, latitude[, height]), degrees and m: origin of the local frame, default the centre of the
                 area that is read, at height 0 above the ellipsoid
        frame    "local": x east, y north, z up at center; "ecef": Earth-centred, Earth-fixed
        heights  vertical reference, where the file does not say: "ellipsoid", or the geoid's name ("EGM96", "EGM2008")
        geoid    height of that geoid above the ellipsoid, m: a number, an array of the points read, a function
                 of longitude and latitude in degrees, or a raster file of it; 0 uses heights above the geoid as
                 heights above the ellipsoid, with a warning
        nodata   height that marks missing data, where the file does not say
        material, materials, roughness, point_roughness   as in from_heights, rows as in the file
        external  the file may lead to rasters outside its folder, as virtual rasters (.vrt) do, or to a network: for
                  files that you trust

        Cells without data have no facets; their number is logged. Raises FileNotFoundError, ImportError, and ValueError
        where there is no CRS, no vertical reference, nothing in bounds, only nodata, or heights that are not finite.
        """
        from ..io import elevation

        tile = elevation.load(path, bounds=bounds, heights=heights, geoid=geoid, nodata=nodata, external=external)
        points, up = elevation.place(tile, frame, center)
        return cls.facets(
            **terrain.surface(
                points, up, material=material, materials=materials, roughness=roughness, point_roughness=point_roughness
            )
        )

    def __repr__(self) -> str:
        size = " x ".join(f"{s:.4g}" for s in self.bounds[1] - self.bounds[0])
        return f"Scene({len(self.positions)} points, {len(self.triangles)} facets, {size} m)"

    def _notebook_rows(self) -> Iterator[tuple[str, str]]:
        yield "points", f"{len(self.positions)}"
        yield "facets", f"{len(self.triangles)}"
        yield from ((axis, interval(ends, "m")) for axis, ends in zip("xyz", self.bounds.T, strict=True))
        counts = np.bincount(self.material, minlength=len(self.materials))
        for material, count in zip(self.materials, counts, strict=True):
            if count:
                yield f"facets of {material.name}", f"{count}"

    def __add__(self, other: Scene) -> Scene:
        if not isinstance(other, Scene):
            return NotImplemented
        table, places = merge([self.materials, other.materials])
        moves = self.has_random_points or other.has_random_points
        names = (n for n in _fields.ARRAYS if n != "point_roughness" or moves)
        joined = {n: validation.sealed(np.concatenate([getattr(self, n), getattr(other, n)])) for n in names}
        parts = [p[s.material] for p, s in zip(places, (self, other), strict=True)]
        joined["material"] = validation.sealed(np.concatenate(parts))
        largest = max((s.heights for s in (self, other)), key=lambda h: 0 if h is None else h[2].size)
        return Scene(**joined, materials=table, heights=largest)

    @property
    def sheets(self) -> NDArray[np.bool_]:
        """Facets (k,) that are thin sheets: their material has a thickness."""
        return np.array([m.thickness > 0 for m in self.materials], bool)[self.material]

    @property
    def scattering_models(self) -> tuple[str, ...]:
        """Names of the scattering models of installed packages by which facets scatter."""
        return tuple(m.scattering for i, m in enumerate(self.materials) if m.scattering and (self.material == i).any())

    @property
    def has_random_points(self) -> bool:
        """Whether point_roughness is not yet realized."""
        return any(self.point_roughness.strides) and bool(self.point_roughness.any())

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the box that holds all points and facets, m (2, 3)."""
        return self._bounds.copy()

    @cached_property
    def _bounds(self) -> NDArray[np.float64]:
        parts = [box(part) for part in (self.positions, self.triangles.reshape(-1, 3)) if len(part)]
        return box(np.concatenate(parts))

    @property
    def center(self) -> NDArray[np.float64]:
        """Centre of that box, m (3,)."""
        return self.bounds.mean(axis=0)

    height_at, on, moved, on_earth = _changes.height_at, _changes.on, _changes.moved, _changes.on_earth
    realized, part, split = _changes.realized, _changes.part, _changes.split
    at_frequency = _changes.at_frequency

    @property
    def on_heights(self) -> NDArray[np.bool_] | None:
        """True (k,) for facets that lie on the terrain; None without one, or where these are not all of it."""
        if (heights := self.heights) is None:
            return None
        return self.kept.of("facets on heights", lambda: terrain.facets_on(heights, self.triangles))

    @cached_property
    def kept(self) -> Kept:
        """Results that follow from the scene alone, which calls of the verbs share; for the library's own use."""
        return Kept()
