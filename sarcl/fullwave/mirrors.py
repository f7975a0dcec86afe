"""Mirror symmetry: which planes through the grid's centre leave a target unchanged, and the anchors that share a run.

A mirror M across x, y or z maps the grid onto itself. Where it leaves the target unchanged, the run of a wave along d
with polarisation e is also that of a wave along M d with polarisation M e: the echo that the mirrored currents form at
transmitter p and receiver r, received in polarisation e_r, is that of the run's own currents at M p, M r and M e_r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..opencl.device import Device
from .currents import Currents
from .formed_echoes import formed_echoes
from .lattice import Lattice
from .target import Target

ALIKE = 1e-3  # difference of mirrored coefficients of cells: corners of meshes are rounded to parts of a cell
SAME_PHASE = 0.02  # rad at the farthest cell: mirrored directions that differ by less are those of a pulse


@dataclass(frozen=True)
class Twin:
    """The anchor that another anchor's run serves too: its pulse, the axis of the mirror, the sign of the polarisation.

    The polarisation sent at that pulse is `sign` (1 or -1) times the mirror image of the run's own.
    """

    pulse: int
    axis: int
    sign: int


def mirror_axes(lattice: Lattice, target: Target) -> tuple[int, ...]:
    """Axes x, y, z (0, 1, 2) across which a mirror at the grid's centre leaves the target unchanged."""
    return tuple(axis for axis in range(3) if _unchanged(lattice, target, axis))


def _unchanged(lattice: Lattice, target: Target, axis: int) -> bool:
    # A face of weights 1, and 0 at edges inside a conductor, has the vacuum update. Rounding decides if it is listed.
    whole = np.abs(target.weight - np.round(target.weight)) < ALIKE
    cut = ~(whole & (target.weight < 1 + ALIKE)).all(axis=0)
    faces, weight = target.faces[cut], target.weight[:, cut]
    swapped = weight.copy()
    component = faces // int(np.prod(lattice.shape))
    for near, pair in ((1, [1, 0, 2, 3]), (2, [0, 1, 3, 2])):  # edges at both ends along the direction after a face's
        along = (component + near) % 3 == axis
        swapped[:, along] = weight[:, along][pair]
    return all(
        _alike(at, values, _image(lattice, at, axis, magnetic=magnetic), mirrored)
        for at, values, mirrored, magnetic in (
            (target.edges, target.share, target.share, False),
            (faces, weight, swapped, True),
        )
    )


def _alike(at: np.ndarray, values: np.ndarray, other_at: np.ndarray, other: np.ndarray) -> bool:
    """Whether two lists hold the same places with the same coefficients (c, n)."""
    order, other_order = np.argsort(at), np.argsort(other_at)
    same = np.array_equal(at[order], other_at[other_order])
    return same and bool(np.allclose(values[:, order], other[:, other_order], rtol=ALIKE, atol=ALIKE))


def _image(lattice: Lattice, at: np.ndarray, axis: int, *, magnetic: bool) -> np.ndarray:
    """Places of the mirrored components; -1 beyond the grid."""
    component, *node = np.unravel_index(at, (3, *lattice.shape))
    n = lattice.shape[axis]
    between = (component == axis) != magnetic  # components that stand between two nodes along the axis
    node[axis] = n - node[axis] - between
    inside = node[axis] < n
    node[axis] = np.where(inside, node[axis], 0)
    return np.where(inside, np.ravel_multi_index([component, *node], (3, *lattice.shape)), -1)


def twins(axes: tuple[int, ...], towards: np.ndarray, sent: np.ndarray, k: float, radius: float) -> dict[int, Twin]:
    """For pulses whose direction is the mirror image of another pulse's: that other, which their run serves too.

    axes       of mirrors (mirror_axes);  k, radius  largest wavenumber, rad/m, and largest distance of a cell, m
    towards    unit vectors to the transmitter (P, 3);  sent  unit vectors, polarisations sent (P, 3)
    """
    tree, out = cKDTree(towards), {}
    for axis in axes:
        flip = _flip(axis)
        apart, other = tree.query(towards * flip)
        along = (sent * flip * sent[other]).sum(axis=1)
        for pulse in np.flatnonzero((k * radius * apart < SAME_PHASE) & (np.abs(along) > 0.5)):
            if other[pulse] != pulse and pulse not in out:
                out[int(pulse)] = Twin(int(other[pulse]), axis, int(np.sign(along[pulse])))
    return out


def _flip(axis: int) -> np.ndarray:
    return np.where(np.arange(3) == axis, -1.0, 1.0)


def mirrored_echoes(
    device: Device, currents: Currents, twin: Twin, tx: np.ndarray, rx: np.ndarray, received: np.ndarray, *,
    max_bytes: float | None = None,
) -> np.ndarray:  # fmt: skip
    """Echoes as formed_echoes gives them, complex64 (P, Q, F), from the currents of the twin of the run's anchor."""
    flip = _flip(twin.axis)
    tx, rx = ((antenna - currents.centre) * flip + currents.centre for antenna in (tx, rx))
    return twin.sign * formed_echoes(device, currents, tx, rx, received * flip, max_bytes=max_bytes)
