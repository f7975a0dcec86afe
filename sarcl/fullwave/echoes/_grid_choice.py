"""The grid of fullwave_echo: cells per wavelength that carry the band, and the memory that a run takes."""

from __future__ import annotations

import numpy as np

from ...base import host_memory
from ...base.constants import SPEED_OF_LIGHT
from ...base.text import size_text
from ...base.validation import choice, number
from ...opencl.device import Device
from ...scattering.physical_optics import normals_and_areas
from ...scene.scene import Scene
from .. import runs
from ..lattice import Lattice
from ._closed_bodies import parts_of

FEWEST_CELLS = 8.0  # per shortest wavelength; below, waves of the grid and cut cells differ too much from the truth
AUTO = 12.0  # cells per shortest wavelength that "auto" takes for conductors
# Cells per shortest wavelength in dielectrics that "auto" takes: spheres of permittivities 2 to 5 had errors of 2.6 to
# 3.4 % with 10, which fall with the square of the cells. More than the last take too long.
AUTO_INSIDE, AUTO_ERROR, AUTO_LIMITS = 10.0, 3e-2, (8.0, 20.0)
FLAT = 0.01  # of the surface: sides with less are not worth smaller cells
SHARE = 0.5  # of the installed memory, where max_bytes is None: a run cannot be divided


def default_bytes(device: Device) -> float:
    """Bytes that a run may take where max_bytes is None: SHARE of what a GPU has, or of what is installed beside a CPU,
    whose drivers give less while other programs take some: forecasts do not depend on that.
    """
    installed = host_memory.installed()
    return SHARE * (installed if device.is_cpu and np.isfinite(installed) else min(device.info.memory, installed))


def chosen_cells(asked: object, scene: Scene, highest: float, tolerance: float) -> float:
    """`cells` as a number; "auto": AUTO for conductors, and for dielectrics as many as leave about the tolerance as an
    error of the grid, AUTO_INSIDE per wavelength in the body at a tolerance of AUTO_ERROR, by its square root.

    highest  frequency, Hz
    """
    if not isinstance(asked, str):
        return number("cells", asked, above=0)
    choice("cells", asked, ("auto",))
    inside = float(np.clip(AUTO_INSIDE * np.sqrt(AUTO_ERROR / tolerance), *AUTO_LIMITS))
    shorter = [float(np.abs(np.sqrt(eps))) for _, eps in parts_of(scene, highest) if eps is not None]
    return max(AUTO, float(np.ceil(10 * inside * max(shorter, default=0)) / 10))


def check_cells(cells: float, band: tuple[float, float]) -> float:
    """Cells per shortest wavelength, at least FEWEST_CELLS; band  lowest and highest frequency, Hz."""
    if cells < FEWEST_CELLS:
        raise ValueError(
            f"cells is {cells:g} per shortest wavelength, and the waveform reaches {band[1] / 1e9:.4g} GHz, "
            f'above what they carry; give cells of at least {FEWEST_CELLS:g} (or "auto"), or a waveform up to '
            f"{band[1] * cells / FEWEST_CELLS / 1e9:.4g} GHz"
        )
    return cells


def grid_choice(
    scene: Scene, band: tuple[float, float], cells: float, budget: float, finer: float = runs.FINER
) -> tuple[Lattice, runs.RunCost]:
    """The grid of `cells` per shortest wavelength, or up to `finer` times as many, about a scene; what a run takes.

    MemoryError where it does not fit into `budget` bytes, with the size that does.
    """
    area, flat = float(normals_and_areas(scene.triangles)[1].sum()), flat_sides(scene)

    def cell_of(n: float) -> float:
        return runs.fitting_cell(scene.bounds, SPEED_OF_LIGHT / band[1] / n, flat, finer)

    def planned(n: float) -> tuple[np.ndarray, runs.RunCost]:
        cell = cell_of(n)
        shape = runs.grid_shape(scene.bounds, cell, flat)
        return shape, runs.run_cost(shape, cell, area, band)

    def fits(n: float) -> bool:
        shape, cost = planned(n)
        return cost.bytes(1) <= budget and not runs.too_many_cells(shape)

    shape, cost = planned(cells)
    if fits(cells):
        return runs.grid_about(scene.bounds, cell_of(cells), flat), cost
    most, less = 0.0, cells
    for _ in range(40):
        middle = (most + less) / 2
        most, less = (middle, less) if fits(middle) else (most, middle)
    what = "more than the kernels count"
    if cost.bytes(1) > budget:
        what = f"it needs {size_text(cost.bytes(1))}, and {size_text(budget)} are allowed"
    remedy = "raise max_bytes"
    if most >= FEWEST_CELLS:
        highest, best = band[1] * most / cells / 1e9, np.floor(10 * most) / 10
        remedy = f"what fits is cells={best:g}, or a waveform up to {highest:.3g} GHz; or {remedy}"
    elif most > 0.1:
        highest = band[1] * most / FEWEST_CELLS / 1e9
        remedy = f"what fits is a waveform up to {highest:.3g} GHz with cells={FEWEST_CELLS:g}; or {remedy}"
    raise MemoryError(f"a run on a grid of {' x '.join(map(str, shape))} cells: {what}; {remedy}")


def flat_sides(scene: Scene) -> np.ndarray:
    """Which sides of a scene's box hold facets of FLAT of its surface or more: low, high along x, y, z; bool (2, 3)."""
    areas = normals_and_areas(scene.triangles)[1]
    near = 1e-6 * float((scene.bounds[1] - scene.bounds[0]).max())
    is_in_side = np.abs(scene.triangles[:, :, None] - scene.bounds).max(axis=1) <= near  # facets, low and high, axes
    return np.asarray((areas[:, None, None] * is_in_side).sum(axis=0) >= FLAT * areas.sum())
