"""SARAS, figure 12: 22 patches of different materials, with and without small-scale and large-scale statistics."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...model.phase_history import PhaseHistory
from ...scattering.physical_optics import fresnel
from ...scene.material import Diagram, Material
from ..far_radar import FarRadar, ground, speckle
from ..lab import SIGNIFICANT, TEST, Lab, histogram, picture, rayleigh
from ..paper import Section
from ._ground import FLAT, ROUGH, SMOOTH

ROWS = ((0, 5), (5, 6), (11, 5), (16, 6))  # first patch and number of patches of each row, from below
# Resolution cells along azimuth and range; in full those of 512 x 512 pixels of the size that table I implies
FIELD = {True: (72, 108), False: (304, 228)}
STRIPS = {True: 1, False: 4}  # parts of the field along azimuth, whose echoes are computed one after the other
STANDARD_ERRORS = 4.0  # of the contrast that reject Rayleigh amplitudes: reached by chance once in 16 000 patches
MARGIN = 3  # cells: those so near to another patch are left out


@dataclass(frozen=True)
class Case:
    """facets  per cell along azimuth and range;  sigma  of the heights, in wavelengths;  rayleigh  as printed"""

    facets: tuple[int, int]
    material: Material
    sigma: float
    words: str
    rayleigh: bool


CASES = {
    "a": Case((4, 4), ROUGH, 1.0, "rough facets on a rough profile", True),
    "b": Case((4, 4), ROUGH, 0.0, "rough facets", True),
    "c": Case((16, 4), SMOOTH, 1.0, "smooth facets on a rough profile", False),
    "d": Case((4, 4), SMOOTH, 0.0, "no statistics", False),
}


def section(lab: Lab) -> Section:
    """Figure 12 a to d, each with the grey levels of the lower left patch."""
    out = Section.of("saras", "patches")
    field = FIELD[lab.quick]
    number, electric = patches(field)
    radar = replace(FLAT, n_pulses=round(1.3 * field[0]))
    inner = [interior(number, i) for i in range(22)]
    reflected = np.array(
        [abs(fresnel(np.ones(()), m.permittivity(radar.center))[0]) ** 2 for m in _table("cos2", electric)]
    )
    mean = {}
    for name, case in CASES.items():
        # pixels are the middles of cells
        grid = radar.grid(field, center=(radar.null[1] / 2, radar.null[0] / 2, 0))
        raw = _echoes(lab, radar, case, number, _table(case.material.diagram, electric))
        pixels = radar.focus(raw, grid, device=lab.device)
        clean = np.abs(radar.focus(raw, grid, window="hamming", device=lab.device)) ** 2
        mean[name] = np.array([clean[cells].mean() for cells in inner])
        statistics = speckle(pixels[inner[0]])
        amplitude = np.abs(pixels[inner[0]])
        # The intensities of Rayleigh amplitudes are exponential: n of them have a contrast of 1 +- 1/sqrt(n)
        sigmas = float((statistics.contrast - 1) * np.sqrt(len(amplitude)))
        rejected = [
            text
            for text, is_rejected in (
                (f"its contrast, {abs(sigmas):.0f} standard errors from 1", abs(sigmas) > STANDARD_ERRORS),
                (f"the {TEST}", statistics.rayleigh <= SIGNIFICANT),
            )
            if is_rejected
        ]
        verdict = f"Rayleigh rejected by {' and by '.join(rejected)}" if rejected else "Rayleigh not rejected"
        out.words = {"name": name, "statistics": case.words, "verdict": verdict, "n": len(amplitude),
                     "significant": SIGNIFICANT, "test": TEST, "standard_errors": STANDARD_ERRORS}  # fmt: skip
        value, expected = [statistics.rayleigh, statistics.contrast], "Rayleigh" if case.rayleigh else "not Rayleigh"
        out.states("case {name}, {statistics}: grey levels", value, (not rejected) == case.rayleigh, expected=expected)
        bins, density = histogram(amplitude / np.sqrt((amplitude**2).mean()), 3.0, 16)
        out.draw(picture(clean, grid, f"Figure 12 {name}: {case.words}. Hamming window.", -25.0))
        curves = [(f"case {name}", bins, density), ("Rayleigh", bins, rayleigh(bins))]
        out.plot("Grey levels of the lower left patch", curves, dots=[f"case {name}"])
    out.say()
    _brightness(out, mean, reflected)
    out.keep(mean=mean, reflected=reflected)
    return out


def _echoes(lab: Lab, radar: FarRadar, case: Case, number: np.ndarray, materials: list[Material]) -> PhaseHistory:
    """Echoes of patches `number` (rows, columns of cells): the sum over strips, each with random numbers of its own."""
    half = [m * n / 2 for m, n in zip(number.shape, radar.null, strict=True)]
    deep = 1.1 * (half[0] * radar.turn / 2 + half[1]) * float(np.sin(radar.look)) + case.sigma
    strips = np.array_split(number, STRIPS[lab.quick])
    total: PhaseHistory | None = None
    first = 0
    for seed, strip in enumerate(strips, 1):
        fine = np.repeat(np.repeat(strip, case.facets[0], axis=0), case.facets[1], axis=1)
        y = radar.null[0] * first - half[0], radar.null[0] * (first + len(strip)) - half[0]
        scene = ground(
            y,
            (-half[1], half[1]),
            fine.shape,
            material=fine,
            materials=materials,
            point_roughness=case.sigma * SPEED_OF_LIGHT / radar.center,
        )
        raw = radar.echo(scene, seed=seed, reference=(0, 0, 0), range_window=(-deep, deep), device=lab.device)
        total = raw if total is None else replace(raw, samples=np.asarray(raw.samples) + np.asarray(total.samples))
        first += len(strip)
    assert total is not None
    return total


def _brightness(out: Section, mean: dict[str, np.ndarray], reflected: np.ndarray) -> None:
    """Whether patches are as bright as their reflectivity says, and how bright a mirror is."""
    bright = reflected > 1e-3
    ratio = 10 * np.log10(mean["b"][bright] / reflected[bright])
    rms, span = float(np.std(ratio)), np.ptp(10 * np.log10(reflected[bright]))
    out.states("case b: brightness of the patches and Fresnel's |R|^2", rms, rms < 1.0, rms=rms, span=span)
    level = float(10 * np.log10(np.median(mean["d"][bright] / mean["b"][bright])))
    out.states("case d: power of the patches without statistics", level, level < -40, below=-level)


def patches(field: tuple[int, int]) -> tuple[np.ndarray, list[tuple[float, float]]]:
    """The number of each cell's patch, from the lower left one, and (eps_r, S/m) of each: the printed ranges, mixed so
    that neighbours differ."""
    rows = [first + np.arange(field[1]) * n // field[1] for first, n in ROWS]
    i = np.arange(22)
    electric = np.linspace(1, 40, 22)[(5 * i + 11) % 22], np.geomspace(1e-4, 1, 22)[(7 * i + 11) % 22]
    return np.repeat(rows, field[0] // 4, axis=0), list(zip(*(e.tolist() for e in electric), strict=True))


def interior(number: np.ndarray, i: int) -> np.ndarray:
    """Cells of patch i that lie more than MARGIN cells from its border."""
    mask = np.pad(number == i, MARGIN)
    shifts = [(s, a) for s in (-MARGIN, MARGIN) for a in (0, 1)]
    return np.all([np.roll(mask, *shift) for shift in shifts], axis=0)[MARGIN:-MARGIN, MARGIN:-MARGIN]


def _table(diagram: Diagram, electric: list[tuple[float, float]]) -> list[Material]:
    return [Material(eps_r=e, conductivity=s, diagram=diagram) for e, s in electric]
