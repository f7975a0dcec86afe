"""Arguments that name the materials of facets, as tables of materials and an index for each facet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..base import validation
from .material import MATERIALS, METAL, Material

# a name of MATERIALS, or the amplitude reflectivity of a perfect conductor; one for all facets, or one for each
MaterialLike = Material | str | float
FacetMaterials = MaterialLike | Sequence[MaterialLike] | Sequence[Sequence[MaterialLike]] | np.ndarray


def resolve(
    material: FacetMaterials, materials: Sequence[MaterialLike] | None, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, tuple[Material, ...]]:
    """The arguments `material` and `materials` as (index, reflectivity, table), of `shape` facets or cells.

    material   a name of MATERIALS or `materials`, a Material, an amplitude reflectivity of a perfect conductor
               (0 to 1), or an array of `shape` of one of these; with `materials`, whole numbers index it
    materials  materials in the same words
    Materials in the table have reflectivity 1: the second array holds it. ValueError names an unknown material.
    """
    choices = None if materials is None else _checked_list(materials)
    names = {m.name: (m, r) for m, r in choices or () if m.name}
    assigned = _array(material)
    if assigned.ndim and assigned.shape != shape:
        raise ValueError(f"material has shape {assigned.shape}, wanted one for all or {shape}")
    is_index = assigned.dtype.kind in "iu"
    if is_index and choices is not None:
        if assigned.size and not 0 <= assigned.min() <= assigned.max() < len(choices):
            index_outside = assigned.min() if assigned.min() < 0 else assigned.max()
            raise ValueError(
                f"material holds {index_outside}; whole numbers are indices into materials, 0 to {len(choices) - 1}"
            )
        index, kinds = assigned, choices
    elif is_index and assigned.ndim:
        raise ValueError(
            "material is an array of whole numbers; give the materials=[...] they are indices into, or floats from 0 "
            "to 1 for reflectivities"
        )
    elif assigned.dtype.kind in "iuf":
        value = _reflectivity(assigned)
        return (np.broadcast_to(np.int32(0), shape), np.broadcast_to(value, shape), (METAL,))
    elif assigned.dtype.kind == "U":
        words, index = np.unique(assigned, return_inverse=True)
        index, kinds = index.reshape(assigned.shape), [_with_reflectivity(str(word), names) for word in words]
    else:
        places: dict[object, int] = {}
        index = np.array([places.setdefault(_key(m), len(places)) for m in assigned.flat], np.int32)
        index, kinds = index.reshape(assigned.shape), [_with_reflectivity(m, names) for m in places]
    table, place = merge([[m for m, _ in kinds]])
    factor = np.array([r for _, r in kinds])
    return (np.broadcast_to(place[0][index].astype(np.int32), shape), np.broadcast_to(factor[index], shape), table)


def merge(tables: Sequence[Sequence[Material]]) -> tuple[tuple[Material, ...], list[np.ndarray]]:
    """Tables joined without repeats, and for each table the indices of its materials in the joined one."""
    joined: dict[Material, int] = {}
    places = [np.array([joined.setdefault(m, len(joined)) for m in table], np.int32) for table in tables]
    return tuple(joined), places


def checked_table(materials: Sequence[Material], index: np.ndarray) -> tuple[tuple[Material, ...], np.ndarray | None]:
    """Materials of reflectivity 1 that index, (k,), refers to, default metal; and the reflectivity of each facet (k,).

    None in place of reflectivities that are all 1. Raises ValueError for an index outside the table.
    """
    if not isinstance(materials, (list, tuple)):
        raise TypeError(f"materials is a {type(materials).__name__}; give a list of sarcl.Material, or () for metal")
    table = tuple(materials) or ((METAL,) if len(index) else ())
    for m in table:
        validation.instance("materials", m, Material)
    if index.size and not 0 <= index.min() <= index.max() < len(table):
        index_outside = index.min() if index.min() < 0 else index.max()
        raise ValueError(f"scene material holds {index_outside}; it is an index into materials, 0 to {len(table) - 1}")
    if all(m.reflectivity == 1 for m in table):
        return table, None
    factor = np.array([m.reflectivity for m in table])[index]
    return tuple(replace(m, reflectivity=1.0) for m in table), factor


def _array(material: object) -> np.ndarray:
    """`material` as an array of numbers, of words, or of objects."""
    if isinstance(material, (Material, Mapping)) or material is None:
        array = np.empty((), object)
        array[()] = material
        return array
    validation.ndim("material", material)
    array = np.asarray(material)
    # NumPy would make strings of the numbers in a list of strings and numbers
    is_mixed = array.dtype.kind == "U" and not isinstance(material, (str, np.ndarray, np.generic))
    return np.asarray(material, object) if is_mixed or array.dtype.kind not in "iufU" else array


def _key(material: object) -> object:
    try:
        hash(material)
    except TypeError:
        raise _unknown(material, {}) from None
    return material


def _checked_list(materials: object) -> list[tuple[Material, float]]:
    if isinstance(materials, (str, Mapping)) or not isinstance(materials, Sequence) or not len(materials):
        raise ValueError(f"materials is {materials!r:.60}; give a list of materials, such as ['metal', 'concrete']")
    return [_with_reflectivity(m, {}) for m in materials]


def _with_reflectivity(material: object, names: Mapping[str, tuple[Material, float]]) -> tuple[Material, float]:
    """A material of reflectivity 1, and its reflectivity."""
    if isinstance(material, Material):
        return replace(material, reflectivity=1.0), material.reflectivity
    if isinstance(material, str):
        if material in names:
            return names[material]
        if material not in MATERIALS:
            raise _unknown(material, names)
        return _with_reflectivity(MATERIALS[material], names)
    if isinstance(material, Mapping):
        raise _unknown(material, names)
    return METAL, float(_reflectivity(np.asarray(validation.number("material", material))))


def _unknown(material: object, names: Mapping[str, object]) -> ValueError:
    choices = ", ".join(map(repr, [*names, *(n for n in MATERIALS if n not in names)]))
    return ValueError(
        f"material is {material!r:.60}; known are {choices}; or give a sarcl.Material, or a reflectivity from 0 to 1"
    )


def _reflectivity(value: np.ndarray) -> np.ndarray:
    """Amplitude reflectivities, 0 to 1."""
    validation.finite("material", value)
    if value.min(initial=0) < 0:
        raise ValueError(f"material is {value.min():g}; it must be at least 0: a number is an amplitude reflectivity")
    if value.max(initial=0) > 1:
        raise ValueError(
            f"material is {value.max():g}; an amplitude reflectivity lies between 0 and 1: a number means a "
            "perfect conductor of that reflectivity"
        )
    return value.astype(np.float64)
