"""Targets of bodies of several materials, from closed meshes: conductors, dielectrics, conductors in dielectrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import TooThin
from ...base.validation import number
from ..lattice import Lattice
from ..target import Target, material_edges
from ._dielectrics import Lines, check_cells, conductivities, halved, lagging_weights, on_grid, permittivities
from ._thin_parts import RIM as RIM
from .cut_cells import Box, Intervals, conductor, edge_lengths
from .mesh_lines import MeshLines, mesh_lines


@dataclass(frozen=True, eq=False)
class Body:
    """Closed surfaces of one material.

    triangles     corners in m (k, 3, 3), counter-clockwise seen from outside
    permittivity  relative, eps' - j eps'', with its losses by conductivity; None: a perfect conductor
    """

    triangles: np.ndarray
    permittivity: complex | None = None


def bodies(lattice: Lattice, parts: Sequence[Body], k: float | None = None, reach: float = 0.0) -> Target:
    """The lists of several bodies.

    k      wavenumber in vacuum, rad/m, at which permittivities hold: eps'' becomes a conductivity; conductors need none
    reach  widest strip of a conductor, thinner than a cell, that may be a sheet through the nodes beside it, cells; at
           least `_thin_parts.RIM`
    Conductors take what they cover; where dielectrics overlap, the later one holds.

    ValueError: `mesh_lines` refuses a mesh, a permittivity is not one of a passive body, or cells are too large for it.
    """
    for i, part in enumerate(parts):
        _check_passive(i, part.permittivity)
    metal = [part.triangles for part in parts if part.permittivity is None]
    metals, lines = Target.nothing(), None
    if metal:
        lines = mesh_lines(lattice, np.concatenate(metal), reach)
        along_x, along_y, along_z = lines.intervals
        lines = replace(lines, intervals=(_with_nodes(along_x, lines.strips), along_y, along_z))
        metals = conductor(lattice, lines.intervals, lines.areas)
        metals = replace(metals, gap=lines.gap, strip_area=lines.strip_area)
    if len(metal) == len(parts):
        return metals
    wavenumber, fine, dielectric = number("k", k, above=0), halved(lattice), []
    for i, part in enumerate(parts):
        if part.permittivity is not None:
            check_cells(lattice, part.permittivity, wavenumber)
            value = on_grid(lattice, part.permittivity, wavenumber)
            dielectric.append((_named(f"parts[{i}]", fine, part.triangles).intervals, value))
    hidden = mesh_lines(fine, np.concatenate(metal), 2 * reach).intervals if metal else None
    insulators = _dielectric_edges(lattice, dielectric, hidden, lines, wavenumber)
    return Target(
        np.concatenate([metals.edges, insulators.edges]), np.concatenate([metals.share, insulators.share], axis=1),
        metals.faces, metals.weight, metals.resting, metals.gap, metals.strip_area,
        insulators.coupled, insulators.coupling, insulators.lagging, insulators.keep,
    )  # fmt: skip


def _with_nodes(along_x: Intervals, nodes: np.ndarray) -> Intervals:
    """Intervals along x, with nodes (n, 3) that are inside as well: edges between two of these conduct."""
    place = nodes[:, 0].astype(float)
    return Intervals(
        np.concatenate([along_x.lines, nodes[:, 1:]]), np.append(along_x.start, place), np.append(along_x.end, place)
    )


def _named(name: str, lattice: Lattice, triangles: np.ndarray) -> MeshLines:
    """`mesh_lines` on cells of half the size, whose errors name the part."""
    try:
        return mesh_lines(lattice, triangles)
    except TooThin as thin:
        cell = None if thin.cell is None else 2 * thin.cell
        raise TooThin(f"{name}, on cells of half the size: {thin}", cell) from thin
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def _check_passive(i: int, permittivity: complex | None) -> None:
    if permittivity is None:
        return
    value = complex(permittivity)
    if not (np.isfinite(value) and value.real >= 1 and value.imag <= 0):
        raise ValueError(
            f"parts[{i}] has permittivity {value:.4g}; wanted eps' - j eps'' of a passive body, with eps' at least 1 "
            "and eps'' at least 0, or None for a perfect conductor"
        )


def _joined(group: list[Intervals]) -> Intervals:
    """Intervals of the halved grid, in nodes of the grid itself."""
    lines = np.concatenate([part.lines for part in group]) // 2
    start, end = (np.concatenate([getattr(part, name) for part in group]) / 2 for name in ("start", "end"))
    return Intervals(lines, start, end)


def _dielectric_edges(
    lattice: Lattice, parts: list[tuple[Lines, complex]], hidden: Lines | None, metal: MeshLines | None, k: float
) -> Target:
    """The lists of edges that are partly in dielectrics, none in a conductor alone."""
    by_axis = [[intervals[axis] for intervals, _ in parts] for axis in range(3)]
    box = Box.around(lattice, [_joined(group) for group in by_axis])
    free = edge_lengths(box, metal.intervals)[1] if metal is not None else None
    places, values, across = [], [], []
    for axis, edges in enumerate(permittivities(box, parts, hidden)):
        outside = np.ones(len(edges.at), bool) if free is None else free[axis].flat[edges.at] > 0
        places.append(box.in_grid(lattice, edges.at[outside], axis))
        values.append(edges.values[outside])
        across.append(edges.across[:, outside])
    at, value, coupling = np.concatenate(places), np.concatenate(values), np.concatenate(across, axis=1)
    target = material_edges(lattice, at, value.real, conductivities(lattice, value, k))
    is_coupled = np.abs(coupling).max(axis=0, initial=0) > 0
    weights, lagging, keep = lagging_weights(lattice, coupling[:, is_coupled], k)
    own = target.share[1][is_coupled]
    return replace(target, coupled=at[is_coupled], coupling=weights * own, lagging=lagging * own, keep=keep)
