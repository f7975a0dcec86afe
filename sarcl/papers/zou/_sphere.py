"""The sphere through the whole chain against Mie's series, which outranks the paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...imaging.backproject import backproject
from ...reference.mie import conducting_sphere
from ..paper import Section
from ._lab import Lab, radius

ECHO_ERROR, PEAK_ERROR, PLACE_ERROR = 0.05, 0.2, 0.02  # share of the rms; dB; m
OPTICS_ERROR = 0.03  # share of the rms: flat facets in place of the sphere, and 1e-2 of tolerance
RADIUS = 1.5  # m, table 2
SPACING = 0.02  # m, of pixels


def optics_of_sphere(radius: float, k: np.ndarray) -> np.ndarray:
    """Monostatic echo of a conducting sphere by physical optics, its centre at zero phase, m (n,); k: 1/m (n,).

    The integral of (n.u) exp(2j k n.u radius) over the lit half, in the convention of `reference.mie`.
    """
    b = 2 * k * radius
    return np.asarray(-1j * np.sqrt(np.pi) * radius * (np.exp(1j * b) + 1j / b * (np.exp(1j * b) - 1)))


def section(lab: Lab) -> Section:
    """Echoes and image of the sphere."""
    out = Section.of("zou", "mie")
    both = lab.full_wave("sphere")
    raw = both.select(polarization="HH")
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    a = RADIUS / lab.radar.reduction
    mie = np.array([conducting_sphere(a, 2 * np.pi * v / SPEED_OF_LIGHT)[0] for v in f])
    samples = raw.read(0, raw.n_rows)
    apart = float(np.linalg.norm(samples - mie) / (np.linalg.norm(mie) * np.sqrt(raw.n_rows)))
    out.states("sphere: echoes in HH against Mie's series", apart, apart < ECHO_ERROR, echo_error=ECHO_ERROR)
    optics = np.asarray(lab.optics("sphere").samples)
    closed = optics_of_sphere(a, 2 * np.pi * f / SPEED_OF_LIGHT)
    off = float(np.linalg.norm(optics - closed) / (np.linalg.norm(closed) * np.sqrt(len(optics))))
    holds = off < OPTICS_ERROR
    out.states("sphere: echoes of physical optics against their closed form", off, holds, optics_error=OPTICS_ERROR)
    cross = both.select(polarization="VH").read(0, raw.n_rows)
    level = float(20 * np.log10(np.linalg.norm(cross) / np.linalg.norm(samples)))
    out.states("sphere: VH over HH", level, level < -40)
    grid = lab.radar.grid((0.6, radius(lab.scene("sphere"))), SPACING)
    cuts, peaks = [], []
    series = replace(raw, samples=np.tile(mie, (raw.n_rows, 1)), report=None)
    for name, data in (("full wave", raw), ("Mie's series", series)):
        image = backproject(data, grid, tolerance=1e-3, check=False, device=lab.device)
        pixels = np.abs(np.asarray(image.data)) / image.gain
        cut = pixels[grid.shape[0] // 2]
        range_ = (np.arange(grid.shape[1]) - grid.shape[1] // 2) * SPACING
        i = int(cut.argmax())
        low, mid, high = cut[i - 1 : i + 2]
        peaks.append((20 * np.log10(mid), range_[i] + SPACING * (high - low) / (2 * (2 * mid - low - high))))
        cuts.append((name, range_, 20 * np.log10(np.maximum(cut, 1e-6))))
    items = ("sphere: brightest pixel, HH", PEAK_ERROR), ("sphere: slant range of the brightest place", PLACE_ERROR)
    for (item, within), measured, exact in zip(items, *peaks, strict=True):
        out.number(item, measured, expected=exact, within=within)
    out.say(a=a, front=peaks[0][1], creeping=np.pi / 2 * a)
    out.plot("Cut along slant range through the image", cuts)
    pulses = f / 1e9
    out.plot(
        "Radar cross section of the sphere",
        [
            ("full wave, mean over pulses", pulses, 20 * np.log10(np.sqrt((np.abs(samples) ** 2).mean(axis=0)))),
            ("Mie's series", pulses, 20 * np.log10(np.abs(mie))),
        ],
    )
    out.keep(error=apart, cross_db=level, ka=[float(2 * np.pi * v * a / SPEED_OF_LIGHT) for v in (f[0], f[-1])])
    return out
