"""A far radar for the scenes of published figures, and the expected mean of their images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal, stats

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.numerics.windows import weights
from sarcl.scattering import physical_optics


@dataclass(frozen=True)
class Radar:
    """Far away at -x, `look` rad off the vertical, turning by `turn` rad about z: range runs along x, azimuth along y.

    bandwidth, center  Hz
    """

    look: float
    bandwidth: float
    turn: float
    n_pulses: int
    center: float = 9.6e9

    @property
    def null(self):
        """How far the first null of a point lies on the ground, m: (along y, along x), a grid's spacing."""
        side = 2 * np.sin(self.look)
        return SPEED_OF_LIGHT / self.center / (self.turn * side), SPEED_OF_LIGHT / (self.bandwidth * side)

    @property
    def up(self):
        """Unit vector from the scene to the radar."""
        return np.array([-np.sin(self.look), 0, np.cos(self.look)])

    def echo(self, scene, **options):
        n = self.n_pulses
        azimuth = np.pi + self.turn * ((np.arange(n) + 0.5) / n - 0.5)
        around = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1) * np.sin(self.look)
        places = 1e6 * np.column_stack([around, np.full(n, np.cos(self.look))])
        wave = sarcl.Waveform.chirp(center=self.center, bandwidth=self.bandwidth, duration=1e-6)
        options = {"tolerance": 1e-2, "check": False, **options}
        return sarcl.echo(scene, wave, sarcl.Trajectory(np.arange(n) / 100.0, places), **options)

    def grid(self, shape, pixels=1, **options):
        """So many pixels a null, about the origin."""
        return sarcl.ImageGrid.plane(shape=shape, spacing=[n / pixels for n in self.null], **options)

    def focus(self, raw, grid, **options):
        """Pixels whose |.|^2 is the cross section of a point, m^2."""
        image = sarcl.backproject(raw, grid, **{"tolerance": 1e-2, "check": False, **options})
        return np.asarray(image.data) / image.gain

    def powers(self, scene, pair=(0, 0)):
        """Mean RCS of facets whose roughness has a diagram, m^2 (k,): pi |S|^2 D A/Omega, docs/theory/facets.md."""
        normal, area = physical_optics.normals_and_areas(scene.triangles)
        permittivity = np.array([m.permittivity(self.center) for m in scene.materials])[scene.material]
        s = physical_optics.scattering_matrix(normal, self.up, self.up, permittivity)[:, pair[0], pair[1]]
        delta = np.arccos(np.clip(normal @ self.up, -1, 1))
        lobes = np.array([m.lobe(delta) / m.solid_angle for m in scene.materials])
        return np.pi * np.abs(s) ** 2 * lobes[scene.material, np.arange(len(delta))] * area


def ground(y, x, cells=(1, 1), **options):
    """Flat ground from y[0] to y[1] and x[0] to x[1], m, of so many cells."""
    axes = [np.linspace(*ends, n + 1) for ends, n in zip((y, x), cells, strict=True)]
    return sarcl.Scene.from_heights(*axes[::-1], np.zeros([len(a) for a in axes]), **options)


def speckle(pixels):
    """p values of Rayleigh amplitudes and of uniform phases (Kolmogorov-Smirnov), and std/mean of the intensity."""
    power = np.abs(pixels.ravel()) ** 2
    amplitude = np.sqrt(power / power.mean())
    rayleigh = stats.kstest(amplitude, "rayleigh", args=(0, np.sqrt(0.5))).pvalue
    uniform = stats.kstest(np.angle(pixels.ravel()), "uniform", args=(-np.pi, 2 * np.pi)).pvalue
    return rayleigh, uniform, power.std() / power.mean()


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
