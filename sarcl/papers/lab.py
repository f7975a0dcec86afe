"""Shared by papers whose figures are images: looks at scenes with a far radar, pictures, histograms."""

from __future__ import annotations

import numpy as np

from ..figures import html
from ..model.image_grid import ImageGrid
from ..opencl.device import DeviceChoice
from ..scene.scene import Scene
from .far_radar import FarRadar

TEST, SIGNIFICANT = "test of Kolmogorov and Smirnov", 0.01  # of distributions; smaller p values reject them


class Lab:
    """Echoes and images on one device.

    device  an OpenCL device;  quick  smaller fields and fewer looks
    """

    def __init__(self, device: DeviceChoice | None = None, quick: bool = False) -> None:
        self.device, self.quick = device, quick

    def looks(
        self, radar: FarRadar, scene: Scene, grid: ImageGrid, n: int, polarization: tuple[str, ...] = ("HH",)
    ) -> tuple[np.ndarray, np.ndarray]:
        """Power of the first look, and mean power over n looks with other random numbers, under Hamming's window.

        Both m^2 (n polarisations, rows, columns).
        """
        first, total = np.zeros(0), np.zeros((len(polarization), *grid.shape))
        for seed in range(n):
            raw = radar.echo(scene, seed=seed, polarization=polarization, device=self.device)
            power = [
                np.abs(radar.focus(raw.select(polarization=p), grid, window="hamming", device=self.device)) ** 2
                for p in polarization
            ]
            first = np.stack(power) if seed == 0 else first
            total += np.stack(power) / n
        return first, total


def picture(power: np.ndarray, grid: ImageGrid, caption: str, floor_db: float = -30.0) -> html.Block:
    """Powers, m^2 (rows, columns), on a grid about the origin as a figure, white at the percentile 99.5."""
    assert grid.spacing is not None
    half = [n * s / 2 for n, s in zip(grid.shape, grid.spacing, strict=True)]
    db = 10 * np.log10(np.maximum(power, 1e-12 * power.max()))
    return html.picture(
        db, (-half[1], half[1]), (-half[0], half[0]), "ground range, m", "azimuth, m", caption, floor_db=floor_db,
        percentile=99.5, unit="dB re 1 m²", equal=True,
    )  # fmt: skip


def tested(p: float) -> str:
    """A p value in words."""
    if p > SIGNIFICANT:
        return f"not rejected: p = {p:.2g}"
    return f"rejected: p = {p:.1e}" if p > 1e-12 else "rejected: p below 1e-12"


def histogram(values: np.ndarray, top: float, bins: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Middles of bins from 0 to `top`, and the density of the values in them."""
    density, edges = np.histogram(values, bins, (0, top))
    return (edges[:-1] + edges[1:]) / 2, density / len(values) / np.diff(edges)


def rayleigh(amplitude: np.ndarray) -> np.ndarray:
    """Density of Rayleigh's distribution with mean square 1."""
    return np.asarray(2 * amplitude * np.exp(-(amplitude**2)))
