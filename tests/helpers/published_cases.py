"""A far radar for the scenes of published figures, and the expected mean of their images."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
from scipy import signal

from sarcl.numerics.windows import weights
from sarcl.papers import far_radar
from sarcl.papers.far_radar import FarRadar, ground
from sarcl.scattering import physical_optics

__all__ = ["Radar", "expected", "ground", "inside_box", "inside_frustum", "looks", "misfit", "speckle"]


class Radar(FarRadar):
    """The far radar of the papers' pages, with the power that facets send back."""

    def powers(self, scene, pair=(0, 0)):
        """Mean RCS of facets whose roughness has a diagram, m^2 (k,): pi |S|^2 D A/Omega, docs/theory/facets.md."""
        normal, area = physical_optics.normals_and_areas(scene.triangles)
        permittivity = np.array([m.permittivity(self.center) for m in scene.materials])[scene.material]
        s = physical_optics.scattering_matrix(normal, self.up, self.up, permittivity)[:, pair[0], pair[1]]
        delta = np.arccos(np.clip(normal @ self.up, -1, 1))
        lobes = np.array([m.lobe(delta) / m.solid_angle for m in scene.materials])
        return np.pi * np.abs(s) ** 2 * lobes[scene.material, np.arange(len(delta))] * area


def speckle(pixels):
    """p values of Rayleigh amplitudes and of uniform phases, and std/mean of the intensity."""
    return astuple(far_radar.speckle(pixels))[:3]


def inside_box(x, y, z, size):
    return lambda p: (np.abs(p - [x, y, z + size[2] / 2]) < np.array(size) / 2).all(axis=1)


def inside_frustum(x, y, z, bottom, top, height):
    """Of a cylinder and a cone too."""

    def inside(p):
        part = (p[:, 2] - z) / height
        return (np.hypot(p[:, 0] - x, p[:, 1] - y) < bottom + (top - bottom) * part) & (part > 0) & (part < 1)

    return inside


def expected(radar, scene, solids, grid, window=None, pair=(0, 0), edge=0.6):
    """Mean |pixel|^2 of a rough scene, m^2: what the radar sees of it, each piece at its range, spread by the response.

    solids  functions that say which points (n, 3) lie inside: what hides others; rays are followed in steps
    Nothing of it is the library's but S and the materials' lobes: neither shadows nor places, phases or focusing.
    """
    pieces = scene.split(edge)
    power, places = radar.powers(pieces, pair), pieces.triangles.mean(axis=1)
    for step in np.arange(0.05, scene.bounds[1, 2] / radar.up[2], 0.4):
        lit = np.flatnonzero(power)
        hidden = np.any([inside(places[lit] + step * radar.up) for inside in solids], axis=0)
        power[lit[hidden]] = 0
    # by its range on the ground: what is high lies nearer
    shown = places * [1, 1, 0] - np.outer(places[:, 2] / np.tan(radar.look), [1, 0, 0])
    at = grid.index(shown)
    out = np.zeros(grid.shape)
    low = np.floor(at).astype(int)
    for corner in np.ndindex(2, 2):
        index, share = low + corner, np.prod(1 - np.abs(at - low - corner), axis=1)
        there = ((index >= 0) & (index < grid.shape)).all(axis=1)
        np.add.at(out, tuple(index[there].T), (share * power)[there])
    for axis, (n, null) in enumerate(zip((radar.n_pulses, 256), radar.null, strict=True)):
        w = weights(window, n)
        off = np.arange(-grid.shape[axis] + 1, grid.shape[axis]) * grid.spacing[axis] / null
        response = np.abs(np.exp(2j * np.pi * np.outer(off, (np.arange(n) + 0.5) / n - 0.5)) @ w / w.sum()) ** 2
        out = signal.fftconvolve(out, np.expand_dims(response, 1 - axis), mode="same", axes=axis)
    return out


def looks(radar, scene, grid, n, polarization=("HH",)):
    """Mean |pixel|^2 over n echoes of other seeds, under Hamming's window, for each polarisation."""
    total = np.zeros((len(polarization), *grid.shape))
    for seed in range(n):
        raw = radar.echo(scene, seed=seed, polarization=polarization)
        for i, name in enumerate(polarization):
            total[i] += np.abs(radar.focus(raw.select(polarization=name), grid, window="hamming")) ** 2 / n
    return total


def misfit(power, wanted, n, pixels=2):
    """How far n looks are from what is expected, where anything is to be seen, with so many pixels a null.

    Of power / wanted - 1: the rms over what it should be, that rms's standard error, and the mean in standard errors.
    """
    inner = np.zeros(power.shape, bool)
    inner[6:-6, 6:-6] = True
    ratio = (power / wanted)[inner & (wanted > 0.1 * np.median(wanted[wanted > 1e-3 * wanted.max()]))]
    independent = ratio.size / (pixels * 1.695) ** 2  # n sum w^4/(sum w^2)^2 of Hamming's window
    off = np.sqrt(n * ((ratio - 1) ** 2).mean())
    return off, np.sqrt((2 + 6 / n) / independent) / 2, (ratio.mean() - 1) * np.sqrt(n * independent)
