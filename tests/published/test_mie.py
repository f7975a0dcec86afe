"""The Mie series of conducting spheres against published values, and full-wave echoes of spheres against the series."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import opened, variants
from helpers.far_field import amplitude
from helpers.fdtd_cases import sphere_intervals

from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.fullwave.bodies.cut_cells import conductor
from sarcl.fullwave.bodies.materials import Body, bodies
from sarcl.fullwave.bodies.mesh_lines import mesh_lines
from sarcl.fullwave.currents import currents
from sarcl.fullwave.incident import PlaneWave
from sarcl.fullwave.lattice import lattice_around
from sarcl.fullwave.pulse import Pulse
from sarcl.fullwave.target import material_edges
from sarcl.reference.mie import conducting_sphere, dielectric_sphere

# RCS over pi a^2 by ka: the series itself, evaluated elsewhere
SERIES = {
    0.1: 0.00089834, 0.5: 0.52957628, 1: 3.63756654, 1.02808: 3.654954, 1.74327: 0.285039, 2: 1.00814308,
    2.33545: 1.969581, 2.95725: 0.505599, 4: 0.78532864, 5: 1.16883705, 10: 0.92923022, 20: 0.96635740,
    30: 1.01610017, 55: 0.99461424, 100: 0.99902542,
}  # fmt: skip
RADII = {"s2": 0.3, "s7": 9.6}  # m, of the spheres of the Austin RCS Benchmark Suite, problem IA


@pytest.mark.parametrize("ka", SERIES)
def test_the_series_has_the_known_values(ka):
    assert np.isclose(abs(conducting_sphere(1.0, ka)[0]) ** 2 / np.pi, SERIES[ka], rtol=5e-6)


def test_large_spheres_echo_as_physical_optics():
    a = conducting_sphere(1.0, 200.0)
    assert np.isclose(a[0], -1j * np.sqrt(np.pi) * np.exp(400j), rtol=5e-3)
    assert np.isclose(a[1], -a[0], rtol=1e-9)


@pytest.mark.parametrize("sphere", RADII)
@pytest.mark.parametrize("frequency", ["f1", "f6"])
@pytest.mark.parametrize("polarization", ["H", "V"])
def test_bistatic_echoes_are_those_of_the_austin_benchmark(data_folder, sphere, frequency, polarization):
    rows = np.loadtxt(data_folder / "austin_rcs" / "IA" / f"ref_rcs.I.A.{sphere}.{frequency}.{polarization}.txt")
    angle, k = np.pi - np.radians(rows[:, 2]), 2 * np.pi * rows[0, 0] / SPEED_OF_LIGHT
    a = conducting_sphere(RADII[sphere], k, angle)["VH".index(polarization)]
    assert np.abs(20 * np.log10(np.abs(a)) - rows[:, 3]).max() < 2e-6  # dB; the files have six digits


def test_a_dielectric_sphere_is_a_conductor_for_large_permittivity_and_a_dipole_where_it_is_small():
    """a = sqrt(4 pi) k^2 r^3 (eps - 1)/(eps + 2) for small spheres, by the dipole that a field induces."""
    assert np.allclose(dielectric_sphere(1.0, 2.0, 1e5 * (1 - 1j)), conducting_sphere(1.0, 2.0), rtol=0.01)
    for eps in (1.001, 3.0, 4 - 7j):
        wanted = np.sqrt(4 * np.pi) * 0.01**2 * (eps - 1) / (eps + 2)
        assert np.isclose(abs(dielectric_sphere(1.0, 0.01, eps)[0]), abs(wanted), rtol=1e-3)


def sphere_run(param, ka, cells, travel, n, staircase=False, material=None, pulse=None):
    """Currents of a sphere of 1 m radius at n wavenumbers up to ka, `cells` cells per shortest wavelength."""
    cell = 2 * np.pi / ka / cells
    centre = cell * np.array([0.13, 0.27, 0.41])
    grid = lattice_around(centre - 1, centre + 1, cell, 16)
    if material:  # edges whose middle is inside the sphere
        places = np.arange(3 * np.prod(grid.shape))
        edges = places[np.linalg.norm(grid.positions(places, magnetic=False) - centre, axis=1) < 1.0]
        target = material_edges(grid, edges, *(np.full(len(edges), value) for value in material))
    else:
        target = conductor(grid, sphere_intervals(grid, centre, 1.0), staircase=staircase)
    top = ka * SPEED_OF_LIGHT / (2 * np.pi)
    wave = PlaneWave(np.array(travel), np.array([1.0, 0.2, 0]), pulse or Pulse.gaussian(0.05 * top, top))
    k = np.linspace(0.5, ka, n)
    return currents(opened(param), grid, target, wave, k, absorber=10, gap=3), centre


def echo(run, centre, towards, polarization):
    """Amplitudes about the centre of the sphere: the wave's path to it and back is taken out."""
    k_back = np.array([run.k]).T @ np.array([towards - run.wave.travel])
    return amplitude(run, towards, polarization) * np.exp(-1j * k_back @ (centre - run.centre))


@pytest.mark.parametrize("param", variants(names=()))
def test_a_small_sphere_echoes_to_the_radar_and_to_the_side(param):
    """Up to ka 1.5 at 20 cells per wavelength, a radius of five cells: amplitude, phase and polarisation."""
    run, centre = sphere_run(param, 1.5, 20, (0.0, 0.0, -1.0), 8)
    assert run.ended == "decayed" and run.n_steps < 1500
    wanted = np.array([conducting_sphere(1.0, k)[0] for k in run.k])
    got = echo(run, centre, -run.wave.travel, run.wave.polarization)
    assert np.abs(got - wanted).max() < 0.03 * np.abs(wanted).max()
    across = np.cross(run.wave.travel, run.wave.polarization)
    assert (
        np.abs(echo(run, centre, -run.wave.travel, across)).max() < 0.01 * np.abs(wanted).max()
    )  # no cross-polarisation
    side = np.array([conducting_sphere(1.0, k, np.pi / 2)[0] for k in run.k])
    assert np.abs(echo(run, centre, across, run.wave.polarization) - side).max() < 0.03 * np.abs(side).max()


@pytest.mark.parametrize("param", variants(names=()))
@pytest.mark.parametrize("travel, largest", [((0.0, 0.0, -1.0), 0.04), ((0.5, -0.3, -0.8), 0.016)])
def test_a_mesh_of_a_sphere_whose_radius_is_six_cells(param, travel, largest):
    """Up to ka 4 at 10 cells per wavelength, with exact areas of faces; the mesh has the volume of the sphere."""
    ball = shapes.sphere(1.0, facets=5000, rotation=(0.3, 0.5, -0.2)).triangles
    ball = ball * (4 * np.pi / 3 / (np.linalg.det(ball).sum() / 6)) ** (1 / 3)
    cell, top = 2 * np.pi / 4 / 10, 4 * SPEED_OF_LIGHT / (2 * np.pi)
    centre = cell * np.array([0.13, 0.27, 0.41])
    grid = lattice_around(centre - 1, centre + 1, cell, 15)
    found = mesh_lines(grid, ball + centre)
    target = conductor(grid, found.intervals, found.areas)
    wave = PlaneWave(np.array(travel), np.array([1.0, 0.2, 0]), Pulse.gaussian(0.05 * top, top))
    run = currents(opened(param), grid, target, wave, np.linspace(0.5, 4, 15), absorber=10, gap=3)
    wanted = np.array([conducting_sphere(1.0, k)[0] for k in run.k])
    got = echo(run, centre, -run.wave.travel, run.wave.polarization)
    assert np.abs(got / wanted - 1).max() < largest


@pytest.mark.slow
@pytest.mark.parametrize("param", variants(names=()))
@pytest.mark.parametrize("travel", [(0.0, 0.0, -1.0), (0.5, -0.3, -0.8)])
def test_a_sphere_from_ka_half_to_ten_at_ten_cells_per_wavelength(param, travel):
    """0.15 dB rms and 3 % complex in steps of ka 0.1, by one run."""
    run, centre = sphere_run(param, 10.0, 10, travel, 96)
    wanted = np.array([conducting_sphere(1.0, k)[0] for k in run.k])
    got = echo(run, centre, -run.wave.travel, run.wave.polarization)
    assert np.sqrt(np.mean((20 * np.log10(np.abs(got / wanted))) ** 2)) < 0.15
    assert np.abs(got / wanted - 1).max() < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("param", variants(names=()))
def test_a_staircase_sphere_is_far_worse(param):
    run, centre = sphere_run(param, 6.0, 10, (0.0, 0.0, -1.0), 20, staircase=True)
    assert run.n_steps < 2000
    wanted = np.array([conducting_sphere(1.0, k)[0] for k in run.k])
    got = echo(run, centre, -run.wave.travel, run.wave.polarization)
    assert 0.5 < np.sqrt(np.mean((20 * np.log10(np.abs(got / wanted))) ** 2)) < 4


@pytest.mark.slow
@pytest.mark.parametrize("param", variants(names=()))
@pytest.mark.parametrize("permittivity, aside, least", [(3.0, 0.13, 0.05), (3 - 1.26j, 0.0, 0.03)])
def test_a_dielectric_sphere_up_to_ka_3(param, permittivity, aside, least):
    """From a mesh, 20 cells per wavelength: 11 in the sphere, whose radius is 9.5 cells."""
    ball = shapes.sphere(1.0, facets=5000, rotation=(0.3, 0.5, -0.2)).triangles
    ball = ball * (4 * np.pi / 3 / (np.linalg.det(ball).sum() / 6)) ** (1 / 3)
    cell, top = 2 * np.pi / 3 / 20, 3 * SPEED_OF_LIGHT / (2 * np.pi)
    grid = lattice_around(np.full(3, -1 - 2 * aside * cell), np.full(3, 1.0), cell, 16)
    wave = PlaneWave(np.array([0.5, -0.3, -0.8]), np.array([1.0, 0.2, 0]), Pulse.gaussian(0.05 * top, top))
    target = bodies(grid, [Body(ball, permittivity)], 3.0)
    run = currents(opened(param), grid, target, wave, np.linspace(0.5, 3, 11), absorber=10, gap=3)
    at_k = np.real(permittivity) + 1j * np.imag(permittivity) * 3 / run.k
    wanted = np.array([dielectric_sphere(1.0, k, e)[0] for k, e in zip(run.k, at_k, strict=True)])
    got = echo(run, np.zeros(3), -run.wave.travel, run.wave.polarization)
    assert np.abs(got - wanted).max() < least * np.abs(wanted).max()


@pytest.mark.slow
@pytest.mark.parametrize("param", variants(names=()))
def test_echoes_are_reciprocal(param):
    """A receiver in direction u of a wave along d sees what one in direction -d sees of a wave along -u."""
    d, u = np.array([0.36, -0.48, 0.8]), np.array([0.8, 0.6, 0.0])
    p, q = np.array([0.8, 0.6, 0.0]), np.array([0.0, 0.0, 1.0])
    cell, k = 0.1, np.array([4.0])
    grid = lattice_around(np.full(3, -0.5), np.full(3, 0.5), cell, 16)
    rng = np.random.default_rng(1)
    blocks = rng.integers(-4, 2, (4, 3)), rng.integers(2, 5, (4, 3))  # a body without symmetry
    solid = np.zeros(grid.shape, bool)
    for low, size in zip(*blocks, strict=True):
        solid[tuple(slice(n // 2 + a, n // 2 + a + b) for n, a, b in zip(grid.shape, low, size, strict=True))] = True
    edges = np.concatenate([np.flatnonzero(solid) + a * solid.size for a in range(3)])
    target = material_edges(grid, edges, np.full(len(edges), 5.0), np.full(len(edges), 0.02))
    pulse = Pulse.gaussian(0.5 * 4 * SPEED_OF_LIGHT / 6.3, 1.5 * 4 * SPEED_OF_LIGHT / 6.3)
    there = currents(opened(param), grid, target, PlaneWave(d, p, pulse), k, absorber=10, gap=3)
    back = currents(opened(param), grid, target, PlaneWave(-u, q, pulse), k, absorber=10, gap=3)
    a, b = amplitude(there, u, q)[0], amplitude(back, -d, p)[0]
    assert abs(a) > 0.01
    assert abs(a - b) < 0.01 * abs(a)


@pytest.mark.slow
@pytest.mark.parametrize("param", variants(names=()))
def test_echoes_do_not_depend_on_the_waveform(param):
    """A Gaussian pulse, and one whose spectrum is spread in time as that of a chirp."""
    top = 1.5 * SPEED_OF_LIGHT / (2 * np.pi)
    short = Pulse.gaussian(0.3 * top, top)
    spread = 5.0 / top**2  # s per Hz: frequencies that differ by `top` pass 5/top apart

    def chirp(f):
        return short.spectrum(f) * np.exp(-1j * np.pi * spread * (f - 0.65 * top) ** 2)

    long = Pulse(chirp, short.half_length + spread * top, short.highest)
    runs = [sphere_run(param, 1.5, 20, (0.5, -0.3, -0.8), 3, pulse=pulse) for pulse in (short, long)]
    (a, b), steps = (
        [echo(*run, -run[0].wave.travel, run[0].wave.polarization) for run in runs],
        [r.n_steps for r, _ in runs],
    )
    assert steps[1] > steps[0]
    assert np.abs(a - b).max() < 1e-3 * np.abs(a).max()
