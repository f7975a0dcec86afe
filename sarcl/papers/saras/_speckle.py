"""SARAS, section III: speckle of homogeneous ground (figures 5 to 7, table I)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from ...figures import html
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ...scene.scene import Scene
from ..far_radar import FarRadar, ground, speckle
from ..lab import SIGNIFICANT, TEST, Lab, histogram, picture, rayleigh, tested
from ..paper import Section
from ._ground import FLAT, ROUGH

# Table I: rows along range, columns along azimuth, lags of 0 to 4 pixels
TABLE = (
    (1.00, 0.51, 0.15, 0.11, 0.12),
    (0.70, 0.35, 0.11, 0.06, 0.08),
    (0.14, 0.05, 0.01, 0.00, 0.02),
    (0.21, 0.11, 0.04, 0.03, 0.02),
    (0.10, 0.04, 0.02, 0.01, 0.01),
)
# Resolution cells along azimuth and range; in full those of the paper's 512 x 512 pixels, and 8 more
CELLS = {True: (96, 96), False: (316, 240)}
FACETS = 4  # per cell and direction
FINE = 8  # pixels per cell of figure 7


def section(lab: Lab) -> Section:
    """Figures 5 to 7 and table I."""
    out = Section.of("saras", "speckle")
    n = CELLS[lab.quick]
    radar = replace(FLAT, n_pulses=round(1.1 * n[0]))
    y, x = ((-k * null / 2, k * null / 2) for k, null in zip(n, radar.null, strict=True))
    flat = ground(y, x, (FACETS * n[0], FACETS * n[1]), material=ROUGH)
    raw = radar.echo(flat, seed=1, device=lab.device)
    shown = radar.grid(n)
    image = radar.focus(raw, shown, device=lab.device)
    pixels = image[2:-2, 2:-2]
    _distributions(out, pixels)
    amplitude = np.abs(pixels.ravel()) / np.sqrt((np.abs(pixels) ** 2).mean())
    levels, density = histogram(amplitude, 3.0)
    out.draw(picture(np.abs(image) ** 2, shown, "Flat homogeneous ground (figure 5)."))
    out.plot(
        "Grey levels of the image", [("image", levels, density), ("Rayleigh", levels, rayleigh(levels))], dots=["image"]
    )
    _correlations(out, lab, radar, raw, n)
    return out


def _distributions(out: Section, pixels: np.ndarray) -> None:
    """Figure 6: amplitude, phase and intensity of independent pixels."""
    noise = speckle(pixels)
    out.words = {"test": TEST, "significant": SIGNIFICANT}
    for item, p in (("amplitudes of the image", noise.rayleigh), ("phases of the image", noise.uniform)):
        out.states(item, p, p > SIGNIFICANT, measured=tested(p))
    error = 1 / np.sqrt(pixels.size)  # of the contrast of so many exponential intensities
    why = {"why": ""} if abs(noise.contrast - 1) <= 4 * error else {}
    out.number("standard deviation of the intensity over its mean", noise.contrast, within=4 * error, **why)
    of_intensity = speckle(np.abs(pixels) ** 2 + 0j).rayleigh
    holds = of_intensity > SIGNIFICANT
    out.states("intensities of the image", of_intensity, holds, measured=tested(of_intensity))


def _correlations(out: Section, lab: Lab, radar: FarRadar, raw: PhaseHistory, n: tuple[int, int]) -> None:
    """Table I and figure 7."""
    # The lags of one pixel give its size: the response of a flat spectrum is sinc(distance/null)
    size = [brentq(lambda s, v=value: np.sinc(s) - v, 0.1, 0.99) for value in (TABLE[0][1], TABLE[1][0])]
    shape = [int((k - 8) / s) for k, s in zip(n, size, strict=True)]
    pixels = radar.focus(raw, radar.grid(shape, (1 / size[0], 1 / size[1])), device=lab.device)
    table = np.array([[_correlation(pixels, azimuth, along) for azimuth in range(5)] for along in range(5)])
    for name, printed, measured in (("azimuth", TABLE[0], table[0]), ("range", [row[0] for row in TABLE], table[:, 0])):
        for lag in range(1, 5):
            why = {} if lag == 1 else {"why": ""}
            out.words = {"lag": lag, "name": name}
            out.number("autocorrelation, lag {lag} in {name}", float(measured[lag]), expected=printed[lag], **why)
    difference = float(np.abs(table - TABLE).max())
    out.states("autocorrelation at all 25 lags", difference, difference < 0.06)
    error = 1 / np.sqrt(np.prod(shape) * np.prod(size))
    out.say(size=size, error=error, shape=shape)
    rows = [[str(i), *(f"{a:.2f} / {b:.2f}" for a, b in zip(TABLE[i], table[i], strict=True))] for i in range(5)]
    head = ["range lag", *(f"azimuth lag {i}" for i in range(5))]
    out.draw(html.table(head, rows, "Table I: printed / measured autocorrelation."))
    grid = radar.grid((n[0] - 8, FINE * (n[1] - 8)), (1, FINE))
    fine = radar.focus(raw, grid, device=lab.device)
    lags = np.arange(4 * FINE + 1)
    curve = np.array([_correlation(fine, 0, int(i)) for i in lags])
    point = radar.echo(Scene.points([[0.0, 0.0, 0.0]]), range_window=(-20.0, 20.0), device=lab.device)
    places = np.column_stack([lags / FINE * radar.null[1], np.zeros((len(lags), 2))])
    response = np.abs(radar.focus(point, ImageGrid.points(places), device=lab.device))
    off = float(np.abs(curve - response).max())
    out.states("autocorrelation along range and the response of a point", off, off < 0.05)
    curves = [("autocorrelation of the image", lags / FINE, curve), ("response of a point", lags / FINE, response)]
    out.plot("Range section of the image's autocorrelation", curves)
    out.keep(table=table, pixel_in_nulls=size, curve=curve, response=response)


def _correlation(pixels: np.ndarray, azimuth: int, along: int) -> float:
    """Modulus of the autocorrelation of an image (azimuth, range) at lags in pixels."""
    rows, columns = pixels.shape
    product = pixels[azimuth:, along:] * pixels[: rows - azimuth, : columns - along].conj()
    return float(np.abs(product.mean()) / (np.abs(pixels) ** 2).mean())
