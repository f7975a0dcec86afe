"""Fields of a scene: converted to read-only arrays of one length, and refused where no scene has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import validation
from . import _changes
from .material_arguments import checked_table

if TYPE_CHECKING:
    from .scene import Scene

ARRAYS = ("positions", "amplitudes", "apertures", *_changes.FACET_ARRAYS)


def check(scene: Scene) -> None:
    """Put converted fields in the place of those given; ValueError names one that does not fit, and its row."""
    for name in ("positions", "triangles"):
        validation.ndim(f"scene {name}", getattr(scene, name))
    n, k = (np.shape(a)[0] if np.ndim(a) else 1 for a in (scene.positions, scene.triangles))
    if n + k == 0:
        raise ValueError("scene is empty; give it at least one point or facet")
    if scene.material is None:
        object.__setattr__(scene, "material", np.broadcast_to(np.int32(0), (k,)))
    if scene.point_roughness is None:
        object.__setattr__(scene, "point_roughness", _changes.no_displacements(k))
    if scene.apertures is None:
        object.__setattr__(scene, "apertures", np.broadcast_to(0.0, (n,)))
    shapes: dict[str, tuple[int, ...]] = {"positions": (n, 3), "amplitudes": (n,), "apertures": (n,)}
    shapes |= {"triangles": (k, 3, 3), "point_roughness": (k, 3, 3)}
    dtypes = {"amplitudes": np.complex128, "two_sided": np.bool_, "material": np.int32}
    for name in ARRAYS:
        value, dtype = getattr(scene, name), dtypes.get(name, np.float64)
        # read-only arrays are not copied
        if not isinstance(value, np.ndarray) or value.flags.writeable or value.dtype != dtype:
            value = validation.sealed(validation.converted(f"scene {name}", value, dtype))
        expected = shapes.get(name, (k,))
        if value.shape != expected:
            raise ValueError(f"scene {name} has shape {value.shape}, wanted {expected}")
        validation.finite(f"scene {name}", value if any(value.strides) else value[:1])  # broadcast: one number for all
        object.__setattr__(scene, name, value)
    for name, unit, kind in (("roughness", "m", "a standard deviation"), ("apertures", "m^2", "an area")):
        values = getattr(scene, name)
        if (values < 0).any():
            row = int(np.argmin(values))
            raise ValueError(f"{name}[{row}] is {values[row]:g} {unit}; {kind} cannot be negative")
    table, factor = checked_table(scene.materials, scene.material)
    if factor is not None:
        object.__setattr__(scene, "reflectivity", validation.sealed(scene.reflectivity * factor))
    object.__setattr__(scene, "materials", table)
    closed = scene.sheets & ~scene.two_sided
    if closed.any():
        row = int(np.argmax(closed))
        raise ValueError(
            f"facet {row} reflects from one side alone, as a closed body does, and its material has a thickness of "
            f"{table[scene.material[row]].thickness:g} m; sheets are open: give two_sided=True, or no thickness"
        )
