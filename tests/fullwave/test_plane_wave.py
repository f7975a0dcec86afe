"""Plane waves of the Yee grid, and how they enter it."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import opened, variants

from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.fullwave import dispersion
from sarcl.fullwave.currents import RunOptions, currents
from sarcl.fullwave.fields import BLOCK, Fields
from sarcl.fullwave.incident import PlaneWave, wave_table
from sarcl.fullwave.lattice import COURANT, Lattice, lattice_around
from sarcl.fullwave.pulse import Pulse
from sarcl.fullwave.target import Target, material_edges
from sarcl.reference import equations

CELL = 0.01  # m
DIRECTIONS = [(0, 0, -1.0), (0.6, 0.8, 0), (0.36, -0.48, 0.8), (-1, 1, 1)]


def unit(vector):
    return np.array(vector, float) / np.linalg.norm(vector)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("cells", [4, 10, 40])
def test_a_plane_wave_of_the_grid_solves_its_update_equations(direction, cells):
    grid, d = Lattice(CELL, (5, 6, 16), np.zeros(3)), unit(direction)
    k = np.array([2 * np.pi / (cells * CELL)])
    omega = dispersion.grid_omega(grid, k, d)
    assert np.allclose(dispersion.wavenumber(grid, omega, d), k, rtol=1e-12)
    units = dispersion.fields(dispersion.grid_vector(grid, k, d), np.array([0.3, 1.0, -0.2]))
    places = np.arange(3 * np.prod(grid.shape))

    def wave(magnetic, steps):
        phase = omega * steps * grid.time_step - k * (grid.positions(places, magnetic) @ d)
        return np.cos(phase).reshape(3, *grid.shape) * units[magnetic][0][:, None, None, None]

    e, h = wave(0, 0), wave(1, 0.5)
    equations.update_e(e, h, COURANT)
    inner = (slice(None), *[slice(1, -1)] * 3)
    assert np.abs(e - wave(0, 1))[inner].max() < 1e-13
    equations.update_h(e, h, COURANT)
    assert np.abs(h - wave(1, 1.5))[inner].max() < 1e-13


def test_dispersion_at_ten_cells_along_an_axis_is_the_closed_form():
    """sin(omega dt/2) = s sin(k dx/2): 1.55 % slow at c dt/dx = 0.289."""
    grid, k = Lattice(CELL, (1, 1, 16), np.zeros(3)), 2 * np.pi / (10 * CELL)
    omega = dispersion.grid_omega(grid, np.array([k]), unit((1, 0, 0)))[0]
    assert np.isclose(np.sin(omega * grid.time_step / 2), COURANT * np.sin(k * CELL / 2), rtol=1e-13)
    own = dispersion.wavenumber(grid, np.array([k * SPEED_OF_LIGHT]), unit((1, 0, 0)))[0]
    assert 0.0154 < own / k - 1 < 0.0160
    assert np.isclose(dispersion.flux(grid, np.array([k]), unit((1, 0, 0)))[0], np.cos(k * CELL / 2), rtol=1e-13)


def test_waves_that_the_grid_does_not_carry_are_refused():
    grid = Lattice(CELL, (1, 1, 16), np.zeros(3))
    with pytest.raises(ValueError, match=r"below two cells of 0\.01 m; use smaller cells"):
        dispersion.grid_omega(grid, np.array([2 * np.pi / (1.9 * CELL)]), unit((1, 0, 0)))
    with pytest.raises(ValueError, match=r"above what cells of 0\.01 m carry; use smaller cells"):
        dispersion.wavenumber(grid, np.array([2 * np.pi * SPEED_OF_LIGHT / (1.9 * CELL)]), unit((1, 0, 0)))
    with pytest.raises(ValueError, match="lies along travel"):
        PlaneWave(np.array([0, 0, 2.0]), np.array([0, 0, 1.0]), Pulse.gaussian(1e9, 2e9))
    with pytest.raises(ValueError, match="give a multiple of 16, such as 32"):
        Lattice(CELL, (1, 1, 17), np.zeros(3))


@pytest.mark.parametrize(
    "cells, layers, message",
    [
        ((40, 40, 48), 17, "absorber is 17 cells; layers have at most 16"),
        ((19, 40, 48), 10, "does not hold layers of 10 cells on each side; it needs at least"),
        ((40, 40, 16), 10, "does not hold layers of 10 cells on each side; it needs at least"),
    ],
)
@pytest.mark.parametrize("param", variants(names=()))
def test_layers_that_do_not_fit_are_refused(param, cells, layers, message):
    with pytest.raises(ValueError, match=message):
        Fields(opened(param), Lattice(CELL, cells, np.zeros(3)), Target.nothing(), absorber=layers)


@pytest.mark.parametrize("param", variants(names=()))
def test_targets_outside_the_box_and_wavenumbers_outside_the_band_are_refused(param):
    grid = Lattice(CELL, (32, 32, 32), np.zeros(3))
    top = SPEED_OF_LIGHT / (10 * CELL)
    wave = PlaneWave(unit((0, 0, -1)), unit((1, 0, 0)), Pulse.gaussian(0.5 * top, top))
    k = 2 * np.pi * np.array([0.7, 0.9]) * top / SPEED_OF_LIGHT

    def run(node, k):
        at = np.ravel_multi_index((0, *node), (3, *grid.shape))
        target = material_edges(grid, np.array([at]), np.array([2.0]), np.array([0.0]))
        return currents(opened(param), grid, target, wave, k, absorber=8, gap=2, options=RunOptions(most_steps=0))

    assert run((16, 16, 16), k).n_steps == 0
    with pytest.raises(
        ValueError, match=r"target has an edge in cell \(16, 10, 16\), outside the box of the incident wave"
    ):
        run((16, 10, 16), k)
    with pytest.raises(ValueError, match=r"k\[1\] is 125\.7 rad/m, .* give a pulse whose band holds every wavenumber"):
        run((16, 16, 16), k * np.array([1, 20 / 9]))


def test_a_gaussian_pulse_has_its_band_its_length_and_no_constant_part():
    pulse = Pulse.gaussian(1e9, 3e9)
    f = np.array([0.0, 1e9, 2e9, 3e9, pulse.highest])
    assert np.allclose(np.abs(pulse.spectrum(f)), [0, 0.1, 1, 0.1, 0], atol=1e-6)
    t, lines = np.linspace(pulse.half_length, 2 * pulse.half_length, 50), np.linspace(1e6, pulse.highest, 4000)
    late = (np.exp(2j * np.pi * np.outer(t, lines)) @ pulse.spectrum(lines)).real
    assert np.abs(late).max() < 1e-7 * np.abs(pulse.spectrum(lines)).sum()


@pytest.mark.parametrize("param", variants(names=()))
@pytest.mark.parametrize("direction", DIRECTIONS[1:3])
def test_the_wave_leaks_less_than_90_db_out_of_its_box(param, direction):
    """Ten cells per wavelength at the upper end of the band, where the spectrum is 0.1 of its peak."""
    top = SPEED_OF_LIGHT / (10 * CELL)
    grid = lattice_around(np.zeros(3), np.full(3, 20 * CELL), CELL, 12)
    low, high = np.full(3, 12), np.array(grid.shape) - 12
    centre = grid.origin + CELL * np.array(grid.shape) / 2
    wave = PlaneWave(unit(direction), np.array([0.2, 0.3, 1.0]), Pulse.gaussian(0.1 * top, top))
    table = wave_table(grid, wave, low, high, centre)
    fields = Fields(opened(param), grid, Target.nothing(), absorber=8, wave=table)
    inside, outside = 0.0, 0.0
    scattered = np.ones(grid.shape, bool)
    scattered[tuple(slice(a - 1, b + 1) for a, b in zip(low, high, strict=True))] = False
    while fields.step < table.n_steps:
        for _ in range(4):
            fields.advance(BLOCK)
        e, _ = fields.download()
        inside, outside = max(inside, np.abs(e).max()), max(outside, np.abs(e[:, scattered]).max())
    assert 0.5 < inside < 1.1
    assert 20 * np.log10(outside / inside) < -90


@pytest.mark.parametrize("param", variants(names=()))
def test_inside_the_box_stands_the_wave_that_was_asked_for(param):
    top = SPEED_OF_LIGHT / (10 * CELL)
    grid = lattice_around(np.zeros(3), np.full(3, 8 * CELL), CELL, 6)
    low, high = np.full(3, 6), np.array(grid.shape) - 6
    centre = grid.origin + CELL * np.array(grid.shape) / 2
    table = wave_table(
        grid,
        PlaneWave(unit((0.36, -0.48, 0.8)), np.array([0, 1.0, 0]), Pulse.gaussian(0.1 * top, top)),
        low,
        high,
        centre,
    )
    fields = Fields(opened(param), grid, Target.nothing(), wave=table)
    for _ in range(int(table.delay / grid.time_step) // BLOCK):
        fields.advance(BLOCK)
    e, h = fields.download()
    at = np.flatnonzero(
        np.broadcast_to((np.indices(grid.shape) > 7).all(0) & (np.indices(grid.shape) < 12).all(0), e.shape)
    )
    for field, magnetic, steps in ((e, 0, fields.step), (h, 1, fields.step - 0.5)):
        path = (grid.positions(at, magnetic) - centre) @ table.wave.travel
        k = dispersion.wavenumber(grid, table.omega, table.wave.travel)
        units = dispersion.fields(dispersion.grid_vector(grid, k, table.wave.travel), table.wave.polarization)[magnetic]
        turns = np.exp(1j * ((steps * grid.time_step - table.delay) * table.omega - np.outer(path, k)))
        wanted = (turns * table.amplitudes * units[:, at // e[0].size].T).real.sum(axis=1)
        assert np.abs(wanted).max() > 0.3
        assert np.abs(field.flat[at] - wanted).max() < 1e-5


@pytest.mark.parametrize("param", variants(names=()))
def test_the_absorbing_layers_reflect_less_than_one_part_in_a_thousand(param):
    """A short current at the centre, against a grid so large that no echo of its walls comes back in time."""
    fields = []
    for cells, layers in ((32, 10), (64, 0)):
        grid = Lattice(CELL, (cells, cells, cells), np.zeros(3))
        run, start = Fields(opened(param), grid, Target.nothing(), absorber=layers), np.zeros((3, *grid.shape))
        near = [np.arange(n) - n // 2 for n in grid.shape]
        x, y, z = np.meshgrid(*near, indexing="ij")
        bump = np.exp(-(x**2 + y**2 + z**2) / 8.0)  # a ring of E without divergence
        start[0], start[1] = equations.before(bump, 1), -equations.before(bump, 0)
        run.start(start, np.zeros_like(start))
        for _ in range(15):
            run.advance(BLOCK)
        cut = tuple(slice(n // 2 - 5, n // 2 + 5) for n in grid.shape)
        fields.append((run.download()[0][(slice(None), *cut)], np.abs(start).max()))
    (small, peak), (large, _) = fields
    assert np.abs(small - large).max() < 1e-3 * peak
