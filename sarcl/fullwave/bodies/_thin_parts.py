"""Refusal of parts of a body that fall between the nodes of a grid, with the size of cells that resolves them.

Between nodes a plate or a wire is transparent: no edge of the grid lies in it. Tips and sharp edges of a body are
thinner than a cell as well, however small the cells are. What counts is how far from a point of the surface the grid
holds the body. A part is refused where

- a line enters and leaves between two nodes through facets that are parallel (PARALLEL), and no part that the grid
  holds lies within RIM cells, or within `reach` where that is more: a plate that is wider than the rim of a wing. Held
  are cells that are inside as a whole, and plates where they are as thick as a cell; or
- no node is inside within REACH cells, or none within a cell and no held part as above, and the facet across the body
  is parallel and less than a cell away: a plate or a wire that no line meets, or that a node lies in here and there,
- no node is inside within EDGE cells: sharp edges reach that far from where they are as thick as a cell, or
- the whole mesh is smaller than a cell: a node inside it conducts, and no edge does.

Narrower strips, as at the trailing edge of a wing, become sheets of conductor: the nodes beside them are named, as
nodes that are inside as well.

Gaps between nodes are closed on the grid: an edge whose ends are both in a conductor conducts as a whole. Other gaps
narrower than a cell hold a layer of nodes, in which waves go to and fro for long. Seams of meshes are closed on
purpose. Therefore such gaps are measured, and the caller decides.
"""

from __future__ import annotations

import numpy as np

from ...base.errors import TooThin
from ..lattice import Lattice
from ._closed_mesh import ClosedMesh

RIM, REACH, EDGE = 3, 4, 12  # cells; a wedge of 5 degrees is as thick as a cell at 11.4 cells from its edge
PARALLEL = np.cos(np.radians(5))  # of the angle between two facets: sharper edges are taken as plates
RAYS = 64  # at most, through the parts that are refused, to find how thick they are
SEALED = 1e-3  # cells: narrower gaps are inaccuracies of a mesh
NARROW = 1 + 1e-4  # cells: a gap of one cell whose sides lie on nodes is closed, too
BESIDE = (
    1.0  # cells along a plate from where a line meets it, to nodes of its sheet: lines end up to a cell from its edge
)
SHARE = 0.7  # of the thickness: cells that leave nodes inside of a round wire, too


class ThinParts:
    """Points of a surface, collected axis by axis, and the check of all."""

    def __init__(self, lattice: Lattice, mesh: ClosedMesh, reach: float) -> None:
        self.lattice, self.corners, self.reach = lattice, mesh.corners / mesh.unit, max(float(RIM), reach)
        self._inwards = -np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        self._inwards /= np.maximum(np.linalg.norm(self._inwards, axis=1), 1e-300)[:, None]
        self._points = [(np.arange(len(self.corners)), self.corners.mean(axis=1))]
        self._plates: list[tuple[np.ndarray, np.ndarray]] = []
        self._sheets: list[tuple[np.ndarray, np.ndarray]] = []
        self._held: list[np.ndarray] = []
        self._area = 0.0  # of plates thinner than a cell, cells
        self._gaps: list[np.ndarray] = []

    def add(self, facet: np.ndarray, place: np.ndarray) -> None:
        """Points on facets (n,), in nodes (n, 3)."""
        self._points.append((facet, place))

    def add_pairs(
        self, entered: np.ndarray, left: np.ndarray, axis: int, place: np.ndarray, end: np.ndarray, empty: np.ndarray
    ) -> None:
        """Facets (n,) through which lines along an axis enter a body, at `place`, and leave it again, at `end`, in
        nodes (n, 3); `empty`: where no node lies between.
        """
        plate, slope = self._parallel(entered, left), np.abs(self._inwards[entered, axis])
        thick = (end - place)[:, axis] * slope >= 1
        self._held += [place[plate & thick], end[plate & thick]]
        thin, missed = plate & ~thick, plate & empty
        self._sheets.append((entered[thin], (place[thin] + end[thin]) / 2))
        self._plates.append((entered[missed], place[missed]))
        self._area += float(slope[thin].sum())  # of all axes: sum of n_a^2 = 1 per cell of the plate

    def add_gaps(self, left: np.ndarray, entered: np.ndarray, axis: int, length: np.ndarray) -> None:
        """Facets (n,) through which lines along an axis leave a body, and enter one again; lengths between, cells."""
        width = (length * np.abs(self._inwards[left, axis]))[self._parallel(left, entered)]
        self._gaps.append(width[(width > SEALED) & (width < NARROW)])

    @property
    def gap(self) -> float | None:
        """Width, m, of the gaps that are narrower than a cell: their median; None: there are none."""
        widths = np.concatenate(self._gaps)
        return float(np.median(widths)) * self.lattice.cell if len(widths) else None

    @property
    def strips(self) -> tuple[np.ndarray, float]:
        """Nodes of sheets in place of plates thinner than a cell, each once, int (n, 3); the area, m^2, of
        these plates. None where nodes lie on all lines through them.

        Nodes within (|n_x| + |n_y| + |n_z|)/2 cells of a plane of normal n are joined by edges and leave no hole
        (Andres, Acharya and Sibata, Graph. Models Image Process. 59, 1997: standard planes).
        """
        facet, place = (np.concatenate(part) for part in zip(*self._sheets, strict=True))
        if not any(len(part) for part, _ in self._plates):
            return np.zeros((0, 3), np.int64), 0.0
        normal = self._inwards[facet][:, None]
        node = np.rint(place).astype(np.int64)[:, None] + np.indices((3, 3, 3)).reshape(3, -1).T - 1
        to = node - place[:, None]
        height = (to * normal).sum(axis=2, keepdims=True)
        beside = np.linalg.norm(to - height * normal, axis=2) < BESIDE
        near = beside & (np.abs(height[..., 0]) <= np.abs(normal).sum(axis=2) / 2)
        return np.unique(node[near], axis=0), self._area * self.lattice.cell**2

    def _parallel(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Which facets (n,) are parallel, and face opposite ways."""
        return np.asarray((self._inwards[first] * self._inwards[second]).sum(axis=1) < -PARALLEL)

    def check(self, inside: np.ndarray, low: np.ndarray) -> None:
        """TooThin, a ValueError, where parts are too thin; inside: which nodes are, from node `low` (3,) on."""
        size = self.lattice.cell * float(np.ptp(self.corners.reshape(-1, 3), axis=0).max())
        if size < self.lattice.cell:
            raise TooThin(
                f"triangles reach over {size:.2g} m, less than a cell of {self.lattice.cell:g} m, too small for the "
                f"grid; give cells of at most {SHARE * size:.2g} m, or triangles in metres",
                SHARE * size,
            )
        facet, place = self._unresolved(inside, low)
        if not len(facet):
            return
        some = _spread(len(facet))
        cell = self.lattice.cell
        thickness = cell * float(np.quantile(self._across(facet[some], place[some])[0], 0.25))
        at = np.array2string(self.lattice.origin + cell * place[some[0]], precision=4)
        resolved, remedy = None, "give them a thickness"
        if thickness > 1e-5 * cell:
            resolved = SHARE * thickness
            remedy = f"give cells of at most {resolved:.2g} m, or make these parts thicker"
        raise TooThin(
            f"triangles have parts that are too thin for cells of {cell:g} m: about {thickness:.2g} m thick, one at "
            f"{at} m, so that they fall between the nodes of the grid; {remedy}",
            resolved,
        )

    def _unresolved(self, inside: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points that are refused: facets (n,), places in nodes (n, 3)."""
        plates, points = (
            tuple(np.concatenate(part) for part in zip(*group, strict=True)) for group in (self._plates, self._points)
        )
        whole = _whole_cells(inside)
        wide = self._wide(whole, low, plates[1])
        alone = _far(inside, low, EDGE, points[1])
        sparse = _far(inside, low, 1, points[1]) & self._wide(whole, low, points[1])
        far = np.flatnonzero((_far(inside, low, REACH, points[1]) | sparse) & ~alone)
        far = far[_spread(len(far))]
        thickness, opposite = self._across(points[0][far], points[1][far])
        flat = far[(thickness < 1) & self._parallel(points[0][far], opposite)]
        chosen = np.concatenate([np.flatnonzero(alone), flat])
        return np.concatenate([plates[0][wide], points[0][chosen]]), np.concatenate(
            [plates[1][wide], points[1][chosen]]
        )

    def _wide(self, whole: np.ndarray, low: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Which places in nodes (n, 3) have no cell that is inside as a whole within RIM cells along each axis, and no
        part that the grid holds within `reach` cells.
        """
        from scipy.spatial import KDTree

        far = _far(whole, low, RIM, place)
        if far.any():
            first = np.maximum(np.floor(place[far].min(axis=0) - self.reach).astype(int) - low, 0)
            last = np.maximum(np.ceil(place[far].max(axis=0) + self.reach).astype(int) - low, 0)
            near = whole[tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))]
            held = np.concatenate([np.argwhere(near) + low + first, *self._held])
            if len(held):
                far[far] = ~np.isfinite(KDTree(held).query(place[far], distance_upper_bound=self.reach)[0])
        return far

    def _across(self, facet: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance from points on facets (n,) inwards to where the body ends, in cells (n,), inf where no facet is met;
        and that facet (n,).

        Source: T. Moeller and B. Trumbore, J. Graphics Tools 2 (1997): u and v in the facet, t along the ray.
        """
        first, second = self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        out, opposite = np.full(len(facet), np.inf), np.zeros(len(facet), np.int64)
        for i, (ray, origin) in enumerate(zip(self._inwards[facet], place, strict=True)):
            across = np.cross(ray, second)
            from_corner = origin - self.corners[:, 0]
            turned = np.cross(from_corner, first)
            with np.errstate(divide="ignore", invalid="ignore"):
                scale = 1 / (first * across).sum(axis=1)
                u, v, t = (
                    (from_corner * across).sum(axis=1) * scale,
                    turned @ ray * scale,
                    (turned * second).sum(1) * scale,
                )
                hit = (u > -1e-9) & (v > -1e-9) & (u + v < 1 + 1e-9) & (t > -1e-6) & (self._inwards @ ray < 0)
            if hit.any():
                opposite[i] = np.flatnonzero(hit)[np.argmin(t[hit])]
                out[i] = abs(max(float(t[opposite[i]]), 0.0))  # of a sheet -0.0, too
        return out, opposite


def _spread(n: int) -> np.ndarray:
    """Up to RAYS of n numbers, evenly."""
    return np.linspace(0, n - 1, min(RAYS, n)).astype(int)


def _whole_cells(inside: np.ndarray) -> np.ndarray:
    """Nodes at the corners of cells that are inside as a whole: all eight corners are."""
    padded = np.pad(inside, 1)
    for axis in range(3):
        line = np.moveaxis(padded, axis, 0)  # a view
        line[:-1] = line[:-1] & line[1:]
    for axis in range(3):
        line = np.moveaxis(padded, axis, 0)
        line[1:] = line[1:] | line[:-1]
    return np.asarray(padded[1:-1, 1:-1, 1:-1])


def _far(held: np.ndarray, low: np.ndarray, reach: int, place: np.ndarray) -> np.ndarray:
    """Which places in nodes (n, 3) have none of the nodes `held` of a box from node `low` on within `reach` cells."""
    from scipy.ndimage import maximum_filter

    near = maximum_filter(np.pad(held, reach), size=2 * reach + 1, mode="constant", cval=False)
    node = np.rint(place).astype(int) - low + reach
    inner = ((node >= 0) & (node < near.shape)).all(axis=1)
    return np.asarray(~(near[tuple(np.where(inner[:, None], node, 0).T)] & inner))
