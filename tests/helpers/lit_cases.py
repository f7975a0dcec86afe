"""Echoes of facets that shadow one another, from polygons of another library: slow, and independent of sarcl's."""

from __future__ import annotations

import numpy as np
import shapely

from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.vectors import unit
from sarcl.reference.lit_part import plane_axes
from sarcl.scattering.physical_optics import scattering_matrix, triangle_integral

FAR = 2e6  # m: the waves are plane over scenes of a few metres


def lit_polygon(facet, occluders, antennas, on_plane=1e-9):
    """The part of a facet, m (3, 3), that antennas see past occluders, m (n, 3, 3), about its centroid: of GEOS."""
    axes, center = plane_axes(facet), facet.mean(axis=0)
    lit = shapely.Polygon(((facet - center) @ axes.T)[:, :2])
    for antenna in antennas:
        eye = (antenna - center) @ axes.T
        side = np.sign(eye[2])
        shadows = []
        for occluder in (occluders - center) @ axes.T:
            heights = np.where(np.abs(occluder[:, 2]) <= on_plane, 0.0, side * occluder[:, 2])
            if heights.max() <= 0:
                continue
            corners = []
            for i in range(3):
                j = (i + 1) % 3
                for part in (0.0, heights[i] / (heights[i] - heights[j]) if heights[i] * heights[j] < 0 else None):
                    if part is None or (part == 0 and heights[i] < 0):
                        continue
                    place = occluder[i, :2] + part * (occluder[j, :2] - occluder[i, :2])
                    height = heights[i] + part * (heights[j] - heights[i])
                    corners.append(eye[:2] + (place - eye[:2]) * abs(eye[2]) / (abs(eye[2]) - height))
            if len(corners) > 2:
                shadows.append(shapely.Polygon(corners).buffer(0))
        if shadows:
            lit = lit.difference(shapely.union_all(shadows, grid_size=1e-12))
    return lit


def exact_echo(triangles, frequencies, antennas, reference_range, occluders=None, polarization="HH"):
    """Echo of perfect conductors, two-sided, of one pulse, complex128 (n,), and the sum of squared amplitudes (n,).

    antennas  one or two, FAR away, m (3,);  occluders  m (n, 3, 3), default the facets themselves
    """
    occluders = triangles if occluders is None else occluders
    row, column = ("HV".index(letter) for letter in polarization)
    out, power = np.zeros(len(frequencies), complex), np.zeros(len(frequencies))
    for facet in triangles:
        center, axes = facet.mean(axis=0), plane_axes(facet)
        sights = [unit(antenna - center) for antenna in antennas]
        to_tx, to_rx = sights[0], sights[-1]
        normal = axes[2] * (1 if axes[2] @ (to_tx + to_rx) > 0 else -1)
        matrix = scattering_matrix(normal, to_tx, to_rx, np.inf)[row, column]
        lit = lit_polygon(facet, occluders, antennas)
        ends = [antennas[0], antennas[-1]]
        path = sum(np.sqrt(((center.astype(np.longdouble) - end) ** 2).sum()) for end in ends)
        delay = (path - 2 * np.longdouble(reference_range)) / SPEED_OF_LIGHT
        parts = [np.array(t.exterior.coords)[:3] for t in shapely.constrained_delaunay_triangles(lit).geoms]
        for i, f in enumerate(frequencies):
            k = 2 * np.pi * f / SPEED_OF_LIGHT
            q = axes[:2] @ (to_tx + to_rx) * k
            total = 0.0
            for flat in parts:
                solid = np.concatenate([flat, np.zeros((3, 1))], axis=1)[None]
                mean = triangle_integral(solid, np.append(q, 0.0))[0]
                total += mean * np.exp(1j * flat.mean(axis=0) @ q)
            a = k / (2 * np.sqrt(np.pi)) * matrix * total
            power[i] += abs(a) ** 2
            out[i] += a * np.exp(-2j * np.pi * float((np.longdouble(f) * delay) % 1))
    return out, power
