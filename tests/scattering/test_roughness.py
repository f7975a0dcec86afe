"""Facets that are rough below their size: power by their diagram, speckle by statistics, coherence by height."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest
from helpers.cases import thinned
from helpers.facet_cases import WET, seen_from, still
from scipy import stats

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.scattering.physical_optics import fresnel
from sarcl.scene.material import COHERENT, DIAGRAMS, Material

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)


def flat(side, material, cells=1):
    axis = np.linspace(-side / 2, side / 2, cells + 1)
    return sarcl.Scene.from_heights(axis, axis, np.zeros((cells + 1, cells + 1)), material=material)


def nrcs(scene, area, elevation, seeds=8, **options):
    """Mean power over frequencies, pulses and seeds, per area: sigma0."""
    track = still(*(seen_from(2e4, elevation, a) for a in np.linspace(0, 0.04, 12)))
    raws = [sarcl.echo(scene, CHIRP, track, seed=s, shadows=False, tolerance=1e-2, **options) for s in range(seeds)]
    return np.mean([np.abs(raw.samples) ** 2 for raw in raws]) / area


LOBES = [
    (Material(diagram="isotropic"), np.pi, lambda d: 1),
    (Material(diagram="cos"), 2 * np.pi / 3, np.cos),
    (Material(diagram="cos2"), np.pi / 2, lambda d: np.cos(d) ** 2),
    (Material(eps_r=4.0, diagram="isotropic"), np.pi, lambda d: 1),
]


@pytest.mark.parametrize("material, omega, lobe, elevation", thinned(LOBES, [0.3, 0.9]))
def test_power_follows_the_diagram_and_is_kept(material, omega, lobe, elevation):
    # sigma0 = pi |S|^2 D/Omega with S = 2 R cos: Lambert's 4 |R|^2 cos^2 for an isotropic one
    reflected = abs(fresnel(np.cos(elevation), material.permittivity(9.6e9))[0])
    wanted = np.pi * (2 * np.cos(elevation) * reflected) ** 2 * lobe(elevation) / omega
    assert material.solid_angle == pytest.approx(omega, rel=1e-9)
    # 8 seeds, 12 aspects, some 80 frequencies: a standard error of 1 to 2 %
    assert nrcs(flat(12.0, material), 144.0, elevation) == pytest.approx(wanted, rel=0.08)


def test_the_kernel_has_a_line_for_every_diagram():
    kernel = files("sarcl.kernels").joinpath("facet_planes.clh").read_text()
    for name in set(DIAGRAMS) - set(COHERENT):
        assert f"diagram == (fv)DIAGRAM_{name.upper()} ?" in kernel, name


def test_power_does_not_depend_on_how_finely_a_surface_is_cut():
    material = Material(diagram="cos")
    coarse, fine = (nrcs(flat(12.0, material, n), 144.0, 0.7) for n in (1, 96))
    assert fine == pytest.approx(coarse, rel=0.08)


def test_an_exponential_lobe():
    narrow = Material(diagram="exp", width=0.2)
    near, far = (nrcs(flat(10.0, narrow), 100.0, e, seeds=4) for e in (0.05, 0.4))
    wanted = np.exp(-((0.4 / 0.2) ** 2) + (0.05 / 0.2) ** 2) * (np.cos(0.4) / np.cos(0.05)) ** 2
    assert far / near == pytest.approx(wanted, rel=0.15)


@pytest.mark.parametrize("height", [0.0, 1e-3, 2e-3, 4e-3])
def test_the_coherent_part_falls_with_the_height(height):
    # a plate at normal incidence: q.n = 2 k, amplitude exp(-(2 k h)^2/2)
    tone = sarcl.Waveform.chirp(center=9.6e9, bandwidth=1e6, duration=1e-6)
    plate = flat(1.0, Material(height=height))
    raw = sarcl.echo(plate, tone, still([0, 0, 5e6]), shadows=False, tolerance=1e-4)
    k = 2 * np.pi * 9.6e9 / SPEED_OF_LIGHT
    fall = np.exp(-((2 * k * height) ** 2) / 2)
    assert np.abs(raw.samples).mean() == pytest.approx(k / np.sqrt(np.pi) * fall, rel=1e-3)


@pytest.mark.parametrize(
    "material",
    [Material(diagram="isotropic"), Material(eps_r=5.0, conductivity=0.1, height=2e-3, diagram="cos"),
     Material(diagram="exp", width=0.3, height=1e-3)],
    ids=["incoherent", "partly", "lobe"],
)  # fmt: skip
def test_the_kernel_adds_what_the_twin_does(device, material):
    random = np.random.default_rng(7)
    corners = random.uniform(-3, 3, (60, 1, 3)) + random.uniform(-0.1, 0.1, (60, 3, 3))
    scene = sarcl.Scene.facets(corners, material=material) + sarcl.Scene.facets(corners + 0.3, material=WET)
    track = still(*(seen_from(8e3, 0.8, a) for a in np.linspace(0, 0.05, 20)))
    raw = sarcl.echo(scene, CHIRP, track, polarization="all", shadows=False, check=True, device=device)
    assert 0 < raw.report.measured_error <= raw.report.predicted_error <= 1e-3


def test_speckle_belongs_to_the_seed_and_to_places():
    scene = flat(6.0, Material(diagram="cos"))
    track = still(seen_from(1e4, 0.7), seen_from(1e4, 0.7, 0.01))
    options = {"shadows": False, "tolerance": 1e-3, "check": False}
    one, same, other = (sarcl.echo(scene, CHIRP, track, seed=s, **options).samples for s in (1, 1, 2))
    assert np.array_equal(one, same)
    assert abs(np.vdot(one, other)) < 0.3 * np.linalg.norm(one) * np.linalg.norm(other)
    # a neighbour changes nothing
    beside = scene + sarcl.Scene.facets([[[0, 0, 50], [0.1, 0, 50], [0, 0.1, 50]]], material=0.0)
    near = sarcl.echo(beside, CHIRP, track, seed=1, reference=(0, 0, 0), range_window=(-9, 9), **options)
    alone = sarcl.echo(scene, CHIRP, track, seed=1, reference=(0, 0, 0), range_window=(-9, 9), **options)
    assert np.linalg.norm(near.samples - alone.samples) <= 2e-3 * np.linalg.norm(alone.samples)


@pytest.fixture(scope="module")
def speckle():
    """An image of flat homogeneous rough ground, pixels half a null apart, and its response to a point."""
    band, turn, elevation, n = 300e6, 0.05, np.pi / 4, 160
    wave = sarcl.Waveform.chirp(center=9.6e9, bandwidth=band, duration=1e-6)
    track = still(*(seen_from(1e6, elevation, a) for a in turn * (np.arange(n) / n - 0.5)))
    null = SPEED_OF_LIGHT / (2 * band * np.sin(elevation)), SPEED_OF_LIGHT / (2 * 9.6e9 * turn * np.sin(elevation))
    size = 160
    grid = sarcl.ImageGrid.plane(shape=(size, size), spacing=(null[1] / 2, null[0] / 2))
    side = (size / 2 + 8) * max(null)
    axis = np.linspace(-side / 2, side / 2, 2)
    ground = sarcl.Scene.from_heights(
        axis, axis, np.zeros((2, 2)), material=Material(eps_r=4.0, conductivity=1e-3, diagram="cos")
    )
    raw = sarcl.echo(ground, wave, track, shadows=False, tolerance=1e-2, seed=5)
    image = sarcl.backproject(raw, grid, tolerance=1e-2)
    point = sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), wave, track, range_window=(-60, 60), tolerance=1e-3)
    return np.asarray(image.data), np.asarray(sarcl.backproject(point, grid, tolerance=1e-3).data)


def test_one_look_is_rayleigh_exponential_and_uniform(speckle):
    # SARAS Fig 6: pixels one null apart are independent
    pixels = speckle[0][4:-4:2, 4:-4:2].ravel()
    assert pixels.size >= 5000
    amplitude = np.abs(pixels) / np.sqrt((np.abs(pixels) ** 2).mean())
    assert stats.kstest(amplitude, "rayleigh", args=(0, np.sqrt(0.5))).pvalue > 0.01
    assert stats.kstest(amplitude**2, "expon").pvalue > 0.01
    assert stats.kstest(np.angle(pixels), "uniform", args=(-np.pi, 2 * np.pi)).pvalue > 0.01
    assert amplitude.std() / amplitude.mean() == pytest.approx(0.5227, abs=0.02)


def test_the_autocorrelation_is_that_of_the_point_response(speckle):
    # SARAS Table I, Fig 7: whole curves out to the third null; pixels are half a null apart
    image, response = speckle
    for axis in (0, 1):
        curves = []
        for data in (image, response):
            spectrum = np.abs(np.fft.fft(data, 2 * data.shape[axis], axis=axis)) ** 2
            curve = np.fft.ifft(spectrum.sum(axis=1 - axis)).real[:7]
            curves.append(curve / curve[0])
        assert np.abs(curves[0] - curves[1]).max() < 0.03
