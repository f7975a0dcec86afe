"""Solids of exact dimensions as facets: ``from sarcl import shapes; ground + shapes.cone(3, 5).on(ground, 10, 0)``.

They stand on z = 0 with their axis along z through the origin (a sphere is centred at the origin), and are then
rotated and moved. Corners lie on the true surface, so curved solids are inscribed: n facets around the axis stay
within 1 - cos(pi/n) of the radius. `tank` is made of several closed bodies, which overlap. `plate`, `disc` and the
calibration targets `trihedral`, `dihedral` and `top_hat` are thin sheets; all others are closed and face outwards.
`luneburg` is a point. `trihedral_rcs` and the like are the targets' radar cross sections in closed form.

    edge        m, largest edge of a facet: with smaller ones, facets follow curved surfaces more closely
    sections    number of facets around the axis, default 72, or more where `edge` requires it
    options     material, materials, reflectivity, roughness, two_sided as in Scene.facets, for all facets;
                position m (3,), rotation as in Scene.from_mesh
Each returns a Scene. ValueError names a dimension that is not greater than 0. Source: SARAS Figs 9-17 (cone,
parallelepiped, cylinder), Wan et al. Figs 6-8 (frustum, cuboid, cylinder), Zou et al. table 2 (tank).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation
from . import _solids, _tank
from . import triangles as geometry
from ._target_rcs import FORMS, Form, check_brim
from ._target_rcs import dihedral_rcs as dihedral_rcs
from ._target_rcs import luneburg_rcs as luneburg_rcs
from ._target_rcs import top_hat_rcs as top_hat_rcs
from ._target_rcs import trihedral_rcs as trihedral_rcs
from .material_arguments import FacetMaterials, MaterialLike
from .scene import Scene

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class SurfaceOptions(TypedDict, total=False):
    """Options of every shape, for all its facets: as in Scene.facets and Scene.from_mesh."""

    position: ArrayLike
    rotation: ArrayLike | Rotation | None
    material: FacetMaterials
    materials: Sequence[MaterialLike] | None
    reflectivity: ArrayLike
    roughness: ArrayLike


class ClosedOptions(SurfaceOptions, total=False):
    """Options of closed shapes, whose facets reflect from outside unless two_sided is True."""

    two_sided: ArrayLike


def plate(
    size: ArrayLike, *, edge: float | None = None, two_sided: ArrayLike = True, **options: Unpack[SurfaceOptions]
) -> Scene:
    """A rectangle of size (x, y), m, about the origin in z = 0, facing up: two facets, or more if `edge` requires.

    >>> len(sarcl.shapes.plate((2, 1)).triangles)
    2
    """
    x, y = _dimensions("size", size, 2)
    corners = np.array([[[-x, -y, 0], [x, -y, 0]], [[-x, y, 0], [x, y, 0]]]) / 2
    return _place(geometry.of_grid(corners), edge, two_sided=two_sided, **options)


def disc(
    radius: float,
    *,
    edge: float | None = None,
    sections: int | None = None,
    two_sided: ArrayLike = True,
    **options: Unpack[SurfaceOptions],
) -> Scene:
    """A circular disc about the origin in z = 0, facing up.

    >>> len(sarcl.shapes.disc(1).triangles)
    72
    """
    radius = _length("radius", radius)
    return _revolve([(radius, 0), (0, 0)], edge, sections, two_sided=two_sided, **options)


def box(size: ArrayLike, *, edge: float | None = None, **options: Unpack[ClosedOptions]) -> Scene:
    """A right parallelepiped of size (x, y, z), m: twelve facets, or more if `edge` requires.

    >>> len(sarcl.shapes.box((4, 2, 3), material="concrete").triangles)
    12
    """
    x, y, z = _dimensions("size", size, 3)
    low, high = np.array([-x / 2, -y / 2, 0]), np.array([x / 2, y / 2, z])
    sides = []
    for axis in range(3):
        # the other two axes, ordered so that their cross product is `axis`
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for end, first, second in ((high, a, b), (low, b, a)):
            face = np.empty((2, 2, 3))
            face[..., axis] = end[axis]
            face[..., first] = [[low[first], high[first]]] * 2
            face[..., second] = [[low[second]] * 2, [high[second]] * 2]
            sides.append(geometry.of_grid(face))
    return _place(np.concatenate(sides), edge, **options)


def cylinder(
    radius: float,
    height: float,
    *,
    edge: float | None = None,
    sections: int | None = None,
    **options: Unpack[ClosedOptions],
) -> Scene:
    """An upright circular cylinder with its lids: radius and height, m.

    >>> len(sarcl.shapes.cylinder(2, 4).triangles)
    288
    """
    radius, height = _length("radius", radius), _length("height", height)
    return _revolve([(0, 0), (radius, 0), (radius, height), (0, height)], edge, sections, **options)


def cone(
    radius: float,
    height: float,
    *,
    edge: float | None = None,
    sections: int | None = None,
    **options: Unpack[ClosedOptions],
) -> Scene:
    """An upright circular cone with its base: radius and height, m.

    >>> len(sarcl.shapes.cone(3, 5).triangles)
    144
    """
    radius, height = _length("radius", radius), _length("height", height)
    return _revolve([(0, 0), (radius, 0), (0, height)], edge, sections, **options)


def frustum(
    bottom: float,
    top: float,
    height: float,
    *,
    edge: float | None = None,
    sections: int | None = None,
    **options: Unpack[ClosedOptions],
) -> Scene:
    """A truncated cone of a height and radii `bottom` and `top` with its lids; sections=4 makes it a truncated pyramid.

    >>> len(sarcl.shapes.frustum(3, 1, 4).triangles)
    288
    """
    bottom, top = _length("bottom", bottom), _length("top", top)
    height = _length("height", height)
    return _revolve([(0, 0), (bottom, 0), (top, height), (0, height)], edge, sections, **options)


def sphere(
    radius: float, *, edge: float | None = None, facets: int | None = None, **options: Unpack[ClosedOptions]
) -> Scene:
    """A sphere about the origin: an icosahedron with edges divided into n parts, 20 n^2 facets of similar size.

    n follows from `edge`, or is the smallest that gives at least `facets`, default 2000.

    >>> len(sarcl.shapes.sphere(1).triangles)
    2000
    """
    radius = _length("radius", radius)
    if edge is not None and facets is not None:
        raise ValueError("sphere takes edge or facets, not both: one follows from the other")
    if edge is None:
        n = int(np.ceil(np.sqrt(validation.count("facets", 2000 if facets is None else facets) / 20)))
        return _place(radius * _solids.geodesic(n), None, **options)
    edge = validation.number("edge", edge, above=0)
    # from the icosahedron's edge; facets in the middle of its faces are larger
    n = max(1, int(np.ceil(min(1.05 * radius / edge, 1e9))))
    while (longest := radius * geometry.edges(unit := _solids.geodesic(n)).max()) > edge:
        n = max(n + 1, int(n * longest / edge))
    return _place(radius * unit, None, **options)


def tank(
    size: ArrayLike = _tank.SIZE,
    *,
    edge: float | None = None,
    sections: int | None = None,
    **options: Unpack[ClosedOptions],
) -> Scene:
    """A tank of overall size (x, y, z), m, its gun forward along x: the complex target of Zou et al. 2021, table 2.

    Closed bodies that overlap: hull with a sloped front, tracks, side boxes, turret, gun, cupola with a mast, drums at
    the rear (`sarcl/scene/_tank.py`); the paper prints the size alone. Other sizes stretch it. The thinnest part is the
    gun, 0.24 m. sections: of every round part.

    >>> sarcl.shapes.tank().bounds
    array([[-4.79 , -2.005,  0.   ],
           [ 4.79 ,  2.005,  4.02 ]])
    """
    stretch = np.array(_dimensions("size", size, 3)) / _tank.SIZE
    finest = None if edge is None else validation.number("edge", edge, above=0) / float(stretch.max())
    return _place(_tank.triangles(finest, sections) * stretch, edge, **options)


def trihedral(
    side: float,
    *,
    form: Form = "triangular",
    edge: float | None = None,
    two_sided: ArrayLike = True,
    **options: Unpack[SurfaceOptions],
) -> Scene:
    """A corner of three plates at right angles: vertex at the origin, folds of length `side`, m, along x, y and z.

    It opens along (1, 1, 1). form: of its plates, "triangular" (the corner of a cube cut off) or "square".

    >>> len(sarcl.shapes.trihedral(1.0).triangles)
    3
    """
    side, n = _length("side", side), 3 if validation.choice("form", form, FORMS) == "triangular" else 4
    axes = side * np.eye(3)
    outlines = [[0 * axes[i], axes[i], axes[i] + axes[i - 2], axes[i - 2]] for i in range(3)]
    plates = np.array([[o[0], o[1], o[2]] if n == 4 else [o[0], o[1], o[3]] for o in outlines])
    if n == 4:
        plates = np.concatenate([plates, [[o[0], o[2], o[3]] for o in outlines]])
    return _place(plates, edge, two_sided=two_sided, **options)


def dihedral(
    size: ArrayLike, *, edge: float | None = None, two_sided: ArrayLike = True, **options: Unpack[SurfaceOptions]
) -> Scene:
    """Two plates at a right angle, of size (across, along) the fold, m: x from 0 in z = 0, and z from 0 in x = 0.

    The fold lies along y, its middle at the origin; it opens along (1, 0, 1).

    >>> len(sarcl.shapes.dihedral((1, 1)).triangles)
    4
    """
    across, along = _dimensions("size", size, 2)
    ends = np.array([-along / 2, along / 2])
    rows = [[(0.0, y, across), (0.0, y, 0.0), (across, y, 0.0)] for y in ends]
    return _place(geometry.of_grid(np.array(rows)), edge, two_sided=two_sided, **options)


def top_hat(
    disc_radius: float,
    cylinder_radius: float,
    height: float,
    *,
    edge: float | None = None,
    sections: int | None = None,
    two_sided: ArrayLike = True,
    **options: Unpack[SurfaceOptions],
) -> Scene:
    """An upright cylinder (cylinder_radius, height, m) with its lid on a disc about the origin (disc_radius, m): a
    dihedral from all sides.

    >>> target = sarcl.shapes.top_hat(1.0, 0.3, 0.8, position=(0, 0, 0.1))
    >>> target.bounds[1]
    array([1. , 1. , 0.9])
    """
    disc, radius = _length("disc_radius", disc_radius), _length("cylinder_radius", cylinder_radius)
    height = _length("height", height)
    check_brim(disc, radius)
    profile = [(disc, 0.0), (radius, 0.0), (radius, height), (0.0, height)]
    return _revolve(profile, edge, sections, two_sided=two_sided, **options)


def luneburg(radius: float, *, position: ArrayLike = (0.0, 0.0, 0.0)) -> Scene:
    """The echo of a Luneburg lens of `radius`, m, with a reflector: one point at `position`, m (3,), no facets.

    The point has the lens's radar cross section at the carrier, `luneburg_rcs`, in HH and VV, from all directions: a
    real lens serves those for which its reflector lies behind it. The path through the lens, of index
    sqrt(2 - (r/radius)^2), is longer than in air: a real lens appears pi/2 radius behind its centre, seen from the
    radar. `position` is where it appears.

    >>> sarcl.shapes.luneburg(0.15, position=(0, 0, 1)).positions
    array([[0., 0., 1.]])
    """
    area = np.pi * _length("radius", radius) ** 2
    position = validation.array("position", position, np.float64, (3,))
    return Scene.points([position], apertures=area)


def _revolve(
    profile: Sequence[tuple[float, float]], edge: float | None, sections: int | None, **options: Unpack[ClosedOptions]
) -> Scene:
    """The surface of revolution about the z axis of a line of (radius, z), from bottom to top."""
    return _place(_solids.revolved(profile, edge, sections), edge, **options)


def _place(
    triangles: np.ndarray,
    edge: float | None,
    *,
    position: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike | Rotation | None = None,
    **options: Any,
) -> Scene:
    """Facets rotated, moved and cut."""
    position = validation.array("position", position, np.float64, (3,))
    options = {"two_sided": False, **options}
    scene = Scene.facets(triangles @ geometry.rotation(rotation).T + position, **options)
    if edge is None:
        return scene
    return scene.split(min(validation.number("edge", edge, above=0), geometry.FARTHEST))


def _length(name: str, value: object) -> float:
    length = validation.number(name, value, above=0)
    geometry.check_reach(name, np.array(length))
    return length


def _dimensions(name: str, size: ArrayLike, n: int) -> list[float]:
    size = validation.array(name, size, np.float64, (n,))
    geometry.check_reach(name, size)
    return [validation.number(f"{name}[{i}]", v, above=0) for i, v in enumerate(size)]


SHAPES = (plate, disc, box, cylinder, cone, frustum, sphere, tank, trihedral, dihedral, top_hat)


def _spell_out(shape: Callable[..., Scene]) -> None:
    """Show the keywords of `options` to help() and scenario files, as the signature of the shape."""
    own = inspect.signature(shape)
    more = [p for call in (_place, Scene.facets) for p in inspect.signature(call).parameters.values()]
    parameters = {p.name: p for p in more if p.kind is p.KEYWORD_ONLY and p.name != "point_roughness"}
    parameters["two_sided"] = parameters["two_sided"].replace(default=False)
    parameters.update(own.parameters)
    del parameters["options"]
    order = sorted(parameters.values(), key=lambda p: p.kind)
    shape.__dict__["__signature__"] = own.replace(parameters=order)


for _one in SHAPES:
    _spell_out(_one)
