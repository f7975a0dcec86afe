"""Wan et al. 2004, section 6.2: 16 patches of rising roughness or permittivity (figures 4 and 5)."""

from __future__ import annotations

import numpy as np
from scipy import stats

from ...scene.material import Material
from ...scene.scene import Scene
from ..far_radar import FarRadar, ground
from ..lab import Lab, picture
from ..paper import Section
from ._radar import l_band

# Patches in the order of rising values, as figure 4 numbers them row by row from above; the 14th has the middle value
ORDER = (1, 2, 3, 4, 8, 12, 16, 15, 14, 13, 9, 5, 6, 7, 11, 10)
RISING = np.argsort(ORDER)  # place of patches 1 to 16 in that order
SIDE = 0.75  # m, of the squares of two facets
SIZE = {True: (14, 2), False: (28, 6)}  # resolution cells along the side of a patch; looks


def section(lab: Lab) -> Section:
    """Figures 4 and 5."""
    out = Section.of("wan", "patches")
    size, n = SIZE[lab.quick]
    permittivity = values(3.0, 0.2)
    rough = _figure(out, lab, size, n, values(0.16, 0.01), np.full(16, 3.0), "a: roughness rises by 0.01 m from 0.08 m")
    eps = _figure(out, lab, size, n, np.full(16, 0.16), permittivity, "b: permittivity rises by 0.2 from 1.4")
    rise = float(stats.spearmanr(rough, RISING).statistic)
    out.states("coefficient as roughness grows", rise, rise > 0.9)
    fall = float(stats.spearmanr(eps, RISING).statistic)
    out.states("coefficient as permittivity grows", fall, fall < -0.9)
    reflected = 20 * np.log10((np.sqrt(permittivity) - 1) / (np.sqrt(permittivity) + 1))
    slope = float(stats.linregress(reflected, 10 * np.log10(eps)).slope)
    out.say(slope=slope)
    in_order = np.argsort(RISING)
    out.plot(
        "Brightness of the 16 patches",
        [
            (name, np.arange(1, 17), 10 * np.log10(brightness[in_order] / brightness.min()))
            for name, brightness in (("a: roughness", rough), ("b: permittivity", eps))
        ],
    )
    out.keep(roughness=rough, permittivity=eps, slope=slope)
    return out


def values(middle: float, step: float) -> np.ndarray:
    """Of patches 1 to 16 (16,)."""
    return np.asarray(middle + step * (RISING - ORDER.index(14)))


def _figure(
    out: Section, lab: Lab, size: int, n: int, roughness: np.ndarray, permittivity: np.ndarray, caption: str
) -> np.ndarray:
    """Mean power of each patch (16,) in n looks; the picture goes to the page."""
    radar = l_band(int(5.2 * size))
    grid = radar.grid((4 * size, 4 * size), center=(radar.null[1] / 2, radar.null[0] / 2, 0))
    power = np.zeros(grid.shape)
    for seed in range(n):
        scene = _field(radar, size, roughness, permittivity).realized(seed)
        raw = radar.echo(scene, shadows=False, seed=seed, device=lab.device)
        power += np.abs(radar.focus(raw, grid, device=lab.device)) ** 2 / n
    out.draw(picture(power, grid, f"Figure 5 {caption}, in the order of figure 4; mean of {n} looks.", -25.0))
    patches = power[::-1].reshape(4, size, 4, size)[:, 2:-2, :, 2:-2]
    return np.asarray(patches.mean(axis=(1, 3)).ravel())


def _field(radar: FarRadar, size: int, roughness: np.ndarray, permittivity: np.ndarray) -> Scene:
    """Ground of 4 x 4 patches of `size` resolution cells a side."""
    cells = [round(size * n / SIDE) for n in radar.null]
    patch = np.arange(16).reshape(4, 4)[::-1]  # rows from below
    fine = np.repeat(np.repeat(patch, cells[0], axis=0), cells[1], axis=1)
    points = np.pad(roughness[fine], (0, 1), mode="edge")
    y, x = ((-2 * size * n, 2 * size * n) for n in radar.null)
    materials = [Material(eps_r=float(e)) for e in permittivity]
    return ground(y, x, fine.shape, material=fine, materials=materials, point_roughness=points)
