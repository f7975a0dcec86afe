"""The pass of bench/spaceborne.py: orbit, antenna, terrain, solids and reflectors, and what theory says about them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import sarcl
from sarcl.scene.triangles import of_grid

CENTER, BANDWIDTH = 5.405e9, 60e6  # Hz: C band, 2.5 m in slant range
WAVE = 299_792_458.0 / CENTER
START, SLANT, PRF = 0.0, 980e3, 2000.0  # s; m, 38 degrees of incidence from 800 km; Hz
APERTURE = 10.0, 2.0  # m, the antenna's size along azimuth and elevation
LEVEL, ROUGHNESS = 200.0, 0.15  # m: height of the ground above the ellipsoid; standard deviation of random heights
STONE = sarcl.Material(eps_r=3.0, diagram="cos2")
SOLIDS = {"frustum": -0.25, "cuboid": 0.0, "cylinder": 0.25}  # ground range of their centres over the swath's width
HILLS = ((-0.40, 0.25, 0.010), (0.40, -0.25, 0.014))  # places, and heights over the width; widths are 0.06 of it
REFLECTORS = (
    (-0.42, -0.30), (-0.12, 0.33), (0.0, -0.33), (0.12, 0.28), (0.42, 0.23), (0.40, -0.25),
)  # fmt: skip
MAST = (0.2, -0.37), 80.0  # place of a reflector on a mast, and its height over the ground, m
RCS = 5e4  # m^2: trihedrals with edges of 2.5 m
SIZES = {"frustum": (80.0, 50.0, 80.0), "cuboid": (80.0, 80.0, 60.0), "cylinder": (40.0, 80.0)}  # m


@dataclass(frozen=True)
class Pass:
    """A pass over one scene.

    swath     m (ground range, azimuth);  cell  m, the ground's grid: two facets per cell
    n_pulses  at PRF;  post  m, spacing of the elevation model;  pixel  m, of the terrain grid
    """

    swath: tuple[float, float]
    cell: float
    n_pulses: int
    post: float
    pixel: float

    @cached_property
    def orbit(self) -> Any:
        """A Kepler orbit about the rotating Earth, 800 km high."""
        return sarcl.Orbit.kepler(7.17e6, 1e-3, 1.72, argument_of_perigee=0.6, span=(-60.0, 60.0))

    @cached_property
    def origin(self) -> np.ndarray:
        """Middle of the scene, m (3,)."""
        return np.asarray(self.orbit.geolocate(START, SLANT, heights=LEVEL, side="right"))

    @cached_property
    def axes(self) -> np.ndarray:
        """Rows (3, 3): ground range away from the satellite, azimuth, up, at the origin."""
        longitude, latitude, _ = sarcl.wgs84.geodetic(self.origin)
        up = sarcl.wgs84.up(longitude, latitude)
        away = self.origin - self.orbit.positions(START)
        away = away - (away @ up) * up
        away /= np.linalg.norm(away)
        return np.stack([away, np.cross(up, away), up])

    @cached_property
    def aimed(self) -> tuple[float, float]:
        """Time, s, at which the beam's centre is at the origin with yaw steering, and its look angle, rad."""
        look = float(self.orbit.view(START, self.origin).look)
        middle = START
        for _ in range(8):
            aim = self.orbit.boresight(middle, look=look, attitude="yaw")
            off = self.origin - aim
            look += float(off @ self.axes[0]) * np.cos(look) / SLANT
            middle += float(off @ self.axes[1]) / self.ground_speed
        return middle, look

    @property
    def look(self) -> float:
        """Look angle of the beam, rad."""
        return self.aimed[1]

    @cached_property
    def track(self) -> Any:
        """The pulses, about the time at which the beam's centre is at the origin."""
        middle, look = self.aimed
        start = middle - (self.n_pulses - 1) / 2 / PRF
        return self.orbit.trajectory(start=start, prf=PRF, n_pulses=self.n_pulses, attitude="yaw", look=look)

    @cached_property
    def ground_speed(self) -> float:
        """Speed of the zero-Doppler point at the origin's slant range, m/s."""
        ends = self.orbit.geolocate(START + np.array([-0.1, 0.1]), SLANT, heights=LEVEL, side="right")
        return float(np.linalg.norm(ends[1] - ends[0])) / 0.2

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Heights above the ellipsoid, m, at ground range and azimuth, m."""
        out = np.full(np.broadcast_shapes(x.shape, y.shape), LEVEL)
        width = 0.06 * self.swath[0]
        for across, along, height in HILLS:
            apart = (x - across * self.swath[0]) ** 2 + (y - along * self.swath[1]) ** 2
            out = out + height * self.swath[0] * np.exp(-apart / (2 * width**2))
        return np.asarray(out)

    def places(self, x: np.ndarray, y: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Earth-fixed positions, m (..., 3), at ground range and azimuth, m, and heights above the ellipsoid, m."""
        flat = self.origin + x[..., None] * self.axes[0] + y[..., None] * self.axes[1]
        longitude, latitude, _ = sarcl.wgs84.geodetic(flat)
        return np.asarray(sarcl.wgs84.ecef(longitude, latitude, heights))

    def local(self, positions: np.ndarray) -> np.ndarray:
        """Ground range, azimuth and height over the tangent plane, m (..., 3)."""
        return np.asarray((positions - self.origin) @ self.axes.T)

    @cached_property
    def model(self) -> Any:
        """The elevation model: bare ground, without solids and random heights, 100 m wider than the scene."""
        ends = (np.arange(-half - 100, half + 100 + self.post, self.post) for half in np.array(self.swath) / 2)
        x, y = np.meshgrid(*ends)
        longitude, latitude, _ = sarcl.wgs84.geodetic(self.places(x, y, np.full(x.shape, LEVEL)))
        return sarcl.ElevationModel(longitude, latitude, self.heights(x, y))

    def ground(self, seed: int = 0) -> Any:
        """Facets of the ground, on the elevation model, with Gaussian heights of their corners."""
        sides = (np.linspace(-s / 2, s / 2, round(s / self.cell) + 1) for s in self.swath)
        x, y = np.meshgrid(*sides)
        longitude, latitude, _ = sarcl.wgs84.geodetic(self.places(x, y, np.full(x.shape, LEVEL)))
        heights = self.model.heights_at(longitude, latitude)
        heights = heights + np.random.default_rng(seed).normal(0, ROUGHNESS, heights.shape)
        triangles = of_grid(np.asarray(sarcl.wgs84.ecef(longitude, latitude, heights)))
        return sarcl.Scene.facets(triangles, two_sided=False, material=STONE)

    def solids(self) -> Any:
        """Frustum, cuboid and cylinder on the ground."""
        edge: dict[str, Any] = {"edge": 1.2 * self.cell, "material": STONE}
        makers = {"frustum": sarcl.shapes.frustum, "cylinder": sarcl.shapes.cylinder}
        out = None
        for name, at in SOLIDS.items():
            size = SIZES[name]
            made = sarcl.shapes.box(size, **edge) if name == "cuboid" else makers[name](*size, **edge)
            foot, axes = self.foot(at)
            turned = sarcl.Scene.facets(made.triangles @ axes + foot, two_sided=False, material=STONE)
            out = turned if out is None else out + turned
        return out

    def foot(self, across: float) -> tuple[np.ndarray, np.ndarray]:
        """The centre of a solid's base, m (3,), and the axes of the place there, rows (3, 3)."""
        foot = self.places(np.array(across * self.swath[0]), np.array(0.0), np.array(LEVEL))
        longitude, latitude, _ = sarcl.wgs84.geodetic(foot)
        up = sarcl.wgs84.up(longitude, latitude)
        away = self.axes[0] - (self.axes[0] @ up) * up
        away /= np.linalg.norm(away)
        return foot, np.stack([away, np.cross(up, away), up])

    @cached_property
    def reflectors(self) -> np.ndarray:
        """Positions of the corner reflectors, m (n, 3); the last one stands on a mast."""
        x, y = (np.array([*REFLECTORS, MAST[0]]) * self.swath).T
        longitude, latitude, _ = sarcl.wgs84.geodetic(self.places(x, y, np.full(len(x), LEVEL)))
        heights = self.model.heights_at(longitude, latitude)
        heights[-1] += MAST[1]
        return np.asarray(sarcl.wgs84.ecef(longitude, latitude, heights))

    def weights(self, raw: Any, point: np.ndarray) -> np.ndarray:
        """Product of both gains towards a point at every pulse, (n,)."""
        antenna, axes = self.antenna, self.antenna.axes(self.track)
        gains = [antenna.gain(np.einsum("ni,nij->nj", point - end, axes), CENTER) for end in (raw.tx, raw.rx)]
        return np.asarray((gains[0] * gains[1]).real)

    @property
    def antenna(self) -> Any:
        """A uniform rectangular aperture."""
        return sarcl.Antenna.rectangular(size=APERTURE)

    def edges(self, name: str, incidence: float) -> tuple[float, float]:
        """Ground ranges, m, at which the layover of a solid begins and its shadow ends, by its height and radii."""
        size, x = SIZES[name], SOLIDS[name] * self.swath[0]
        high = size[-1]
        top = {"frustum": size[1], "cuboid": size[0] / 2, "cylinder": size[0]}[name]
        return x - top - high / np.tan(incidence), x + top + high * np.tan(incidence)

    def sigma0(self, incidence: float) -> float:
        """Mean cross section per area of level ground with the slopes of its random heights: 8 |R|^2 cos^4."""
        slope = ROUGHNESS * np.sqrt(2) / self.cell
        tilts = np.random.default_rng(1).normal(0, slope, (200_000, 2))
        area = np.sqrt(1 + (tilts**2).sum(axis=1))
        cosine = np.clip((np.cos(incidence) - tilts[:, 0] * np.sin(incidence)) / area, 0, 1)
        root = np.sqrt(STONE.eps_r - 1 + cosine**2)
        reflected = ((cosine - root) / (cosine + root)) ** 2
        return float((8 * reflected * cosine**4 * area).mean())
