"""Echoes of facets that shadow one another, from polygons of another library: slow, and independent of sarcl's."""

from __future__ import annotations

import numpy as np
import shapely

from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.vectors import unit
from sarcl.reference.lit_part import plane_axes
from sarcl.scattering.physical_optics import scattering_matrix, triangle_integral
from sarcl.scene.triangles import cut

BELOW = 0.999  # of the height of an antenna: occluders above that are nowhere near it
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
            part = np.column_stack([occluder[:, :2], heights])
            for sign, limit in ((1, 0.0), (-1, -BELOW * abs(eye[2]))):  # what lies beyond the antenna casts no shadow
                part = above(part, sign, limit)
            corners = [eye[:2] + (x[:2] - eye[:2]) * abs(eye[2]) / (abs(eye[2]) - x[2]) for x in part]
            if len(corners) > 2:
                # shadows of places near the antenna reach far beyond the facet, and GEOS loses digits
                shadows.append(shapely.clip_by_rect(shapely.Polygon(corners).buffer(0), *lit.buffer(0.1).bounds))
        if shadows:
            lit = _without(lit, shadows)
    return lit


def _without(lit, shadows):
    """A polygon less shadows; one by one where GEOS loses area: once it left nothing of a polygon that they touch."""
    dark = shapely.union_all(shadows, grid_size=1e-12)
    left = lit.difference(dark)
    if abs(left.area + lit.intersection(dark).area - lit.area) > 1e-9 * lit.area:
        left = lit
        for shadow in shadows:
            left = shapely.difference(left, shadow, grid_size=1e-12)
    return left


def above(polygon, sign, limit):
    """The part of a polygon, corners (n, 3), where sign z >= limit."""
    out = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True) if len(polygon) else ():
        over = sign * a[2] - limit, sign * b[2] - limit
        if over[0] >= 0:
            out.append(a)
        if over[0] * over[1] < 0:
            out.append(a + over[0] / (over[0] - over[1]) * (b - a))
    return np.array(out)


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


def near_echo(triangles, two_sided, frequencies, antennas, reference_range, edge, polarization="HH"):
    """Echo of perfect conductors near antennas, of one pulse, complex128 (n,): lit polygons cut into pieces.

    two_sided  (k,) bool: others are dark from behind;  antennas  one or two, m (3,);  edge  m: pieces no longer than
    this each have their own direction and path
    """
    row, column = ("HV".index(letter) for letter in polarization)
    out = np.zeros(len(frequencies), complex)
    ends = [antennas[0], antennas[-1]]
    for facet, both in zip(triangles, two_sided, strict=True):
        center, axes = facet.mean(axis=0), plane_axes(facet)
        heights = [float((end - center) @ axes[2]) for end in ends]
        if heights[0] * heights[1] <= 0 or (not both and heights[0] < 0):
            continue
        flat = [np.array(t.exterior.coords)[:3] for t in
                shapely.constrained_delaunay_triangles(lit_polygon(facet, triangles, antennas)).geoms]  # fmt: skip
        if not flat:
            continue
        solid = np.stack([center + part @ axes[:2] for part in flat])
        pieces = cut(solid, edge, 10**7)[0]
        places = pieces.mean(axis=1)
        sights = [unit(end - places) for end in ends]
        normal = np.broadcast_to(axes[2] * np.sign(heights[0]), places.shape)
        matrix = scattering_matrix(normal, *sights, np.inf)[:, row, column]
        path = sum(np.sqrt(((places.astype(np.longdouble) - end) ** 2).sum(axis=1)) for end in ends)
        delay = (path - 2 * np.longdouble(reference_range)) / SPEED_OF_LIGHT
        for i, f in enumerate(frequencies):
            k = 2 * np.pi * f / SPEED_OF_LIGHT
            a = k / (2 * np.sqrt(np.pi)) * matrix * triangle_integral(pieces, k * (sights[0] + sights[1]))
            out[i] += (a * np.exp(-2j * np.pi * ((np.longdouble(f) * delay) % 1).astype(float))).sum()
    return out
