"""Spheres as intervals on grid lines, and a float64 twin of the fields on a device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sarcl.fullwave import runs
from sarcl.fullwave.absorber import coefficients
from sarcl.fullwave.bodies.cut_cells import Intervals
from sarcl.fullwave.incident import entrances
from sarcl.fullwave.lattice import COURANT, lattice_around
from sarcl.fullwave.target import Target
from sarcl.reference import equations, fdtd


def sphere_intervals(lattice, centre, radius):
    """Where grid lines along x, y and z are inside a sphere."""
    node, r, out = (np.asarray(centre) - lattice.origin) / lattice.cell, radius / lattice.cell, []
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        line = np.stack(np.meshgrid(np.arange(lattice.shape[b]), np.arange(lattice.shape[c]), indexing="ij"), -1)
        line = line.reshape(-1, 2)
        square = r**2 - ((line - node[[b, c]]) ** 2).sum(axis=1)
        half = np.sqrt(square[square > 0])
        out.append(Intervals(line[square > 0], node[a] - half, node[a] + half))
    return tuple(out)


def conductor_on_grid(triangles, cell):
    """The grid about the box of a closed conductor, facets (k, 3, 3), whose centre is the grid's; and its target."""
    low, high = triangles.reshape(-1, 3).min(axis=0), triangles.reshape(-1, 3).max(axis=0)
    grid = lattice_around(low, high, cell, runs.MARGIN)
    return grid, runs.target_of(grid, [(triangles, None)], 1.0)


class Twin:
    """What Fields does, by sarcl/reference/equations.py and fdtd.py: fields e and h, and the residuals of each step."""

    def __init__(self, lattice, target, e, h, absorber=0, wave=None):
        self.lattice, self.target, self.wave, self.step = lattice, target, wave, 0
        self.e, self.h = np.array(e, float), np.array(h, float)
        self.old = [self.e.flat[target.edges], self.h.flat[target.faces]]
        self.late = np.zeros(len(target.coupled))
        self.layers = [
            [self._along(axis, absorber, magnetic) for magnetic in (0, 1)] for axis in range(3 if absorber else 0)
        ]
        self.psi = np.zeros((3, 2, 2, *lattice.shape))
        self.entrances = entrances(lattice, wave.low, wave.high) if wave else ([], [])

    def _along(self, axis, absorber, magnetic):
        out = np.zeros((2, self.lattice.shape[axis]))
        out[:, :absorber], out[:, -absorber:] = np.split(np.array(coefficients(absorber)[magnetic]), 2, axis=1)
        return out

    def advance(self):
        """One step: the residuals of edges and of faces."""
        equations.update_h(self.e, self.h, COURANT)
        self._correct(self.h, self.e, magnetic=1)
        faces = fdtd.faces(self.e, self.h, self.target.faces, self.target.weight, self.old[1], COURANT)
        equations.update_e(self.e, self.h, COURANT)
        self._correct(self.e, self.h, magnetic=0)
        edges = fdtd.edges(self.e, self.target.edges, self.target.share, self.old[0])
        if len(self.target.coupled):
            added = fdtd.couple(self.e, self.h, self.target.coupled, self.target.coupling, self.late,
                                self.target.lagging, self.target.keep, COURANT)  # fmt: skip
            number = np.argsort(self.target.edges)[np.searchsorted(np.sort(self.target.edges), self.target.coupled)]
            edges[number] += added
            self.old[0][number] += added
        self.step += 1
        return edges, faces

    def _correct(self, to, source, magnetic):
        for axis, layers in enumerate(self.layers):
            s = -COURANT if magnetic else COURANT
            fdtd.absorb(to, source, self.psi[axis, magnetic], axis, *layers[magnetic], s)
        for part in self.entrances[magnetic] if self.wave and self.step < self.wave.n_steps else ():
            first, rest = self.wave.read(part.source, magnetic=not magnetic)
            values = self.wave.values(self.step, 1)[0][(first % 8)[:, None], (first // 8)[:, None] + np.arange(6)]
            fdtd.incident(to, part.at, values, rest, part.amount)


def random_target(lattice, rng, inside=0, coupled=False):
    """Lists of a few edges and faces at random places, `inside` cells or more from the walls of the grid; half of the
    edges are coupled to those across them, if so asked.
    """
    core = np.zeros((3, *lattice.shape), bool)
    core[(slice(None), *(slice(inside, n - inside) for n in lattice.shape))] = True
    places = np.flatnonzero(core)
    edges, faces = (rng.permutation(places)[: max(1, len(places) // 7)] for _ in range(2))
    target = Target(edges, rng.uniform(-0.4, 0.4, (2, len(edges))), faces, rng.uniform(0.2, 1.2, (4, len(faces))))
    if not coupled:
        return target
    some = edges[: len(edges) // 2]
    coupling, lagging = rng.uniform(-0.1, 0.1, (2, 4, len(some)))
    return replace(target, coupled=some, coupling=coupling, lagging=lagging, keep=0.9)
