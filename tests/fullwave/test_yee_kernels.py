"""The kernels of full-wave echoes against their float64 twins, and tiles of steps against whole steps."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.fdtd_cases import Twin, random_target

from sarcl.fullwave.fields import BLOCK, Fields, tiles
from sarcl.fullwave.incident import PlaneWave, wave_table
from sarcl.fullwave.lattice import Lattice
from sarcl.fullwave.pulse import Pulse
from sarcl.fullwave.target import Target
from sarcl.reference import fdtd

ROUNDING = 2e-6  # float32 over BLOCK steps of fields of order 1


def lattice_of(shape):
    return Lattice(0.01, shape, np.zeros(3))


def random_fields(shape, rng):
    return rng.uniform(-1, 1, (2, 3, *shape))


def wave_for(lattice, inset):
    """A wave of eight cells' length along no axis, in a box `inset` cells from the walls."""
    low, high = np.full(3, inset), np.array(lattice.shape) - inset
    top = 299792458.0 / (8 * lattice.cell)
    wave = PlaneWave(np.array([0.36, -0.48, 0.8]), np.array([1.0, 2, 0]), Pulse.gaussian(0.1 * top, top))
    return wave_table(lattice, wave, low, high, lattice.centre)


@pytest.mark.parametrize("shape", [(1, 1, 16), (3, 5, 16), (2, 17, 32), (9, 8, 48)])
def test_vacuum_updates_equal_the_twin(device, shape):
    grid, rng = lattice_of(shape), np.random.default_rng(1)
    e, h = random_fields(shape, rng)
    fields, twin = Fields(device, grid, Target.nothing()), Twin(grid, Target.nothing(), e, h)
    fields.start(e, h)
    fields.advance(BLOCK)
    for _ in range(BLOCK):
        twin.advance()
    got_e, got_h = fields.download()
    assert np.abs(got_e - twin.e).max() < ROUNDING * 10
    assert np.abs(got_h - twin.h).max() < ROUNDING * 10


@pytest.mark.parametrize("shape, layers", [((8, 9, 32), 4), ((7, 21, 48), 3), ((34, 33, 48), 16)])
def test_absorbing_layers_equal_the_twin(device, shape, layers):
    grid, rng = lattice_of(shape), np.random.default_rng(2)
    e, h = random_fields(shape, rng)
    fields = Fields(device, grid, Target.nothing(), absorber=layers)
    twin = Twin(grid, Target.nothing(), e, h, absorber=layers)
    fields.start(e, h)
    fields.advance(BLOCK)
    for _ in range(BLOCK):
        twin.advance()
    got_e, got_h = fields.download()
    assert np.abs(got_e - twin.e).max() < ROUNDING * 10
    assert np.abs(got_h - twin.h).max() < ROUNDING * 10
    vacuum = Twin(grid, Target.nothing(), e, h)
    vacuum.advance()
    assert np.abs(vacuum.e - e).max() > 0.1  # the fields change much more than by rounding


@pytest.mark.parametrize("coupled", [False, True])
def test_lists_and_their_residuals_equal_the_twin(device, coupled):
    grid, rng = lattice_of((7, 9, 32)), np.random.default_rng(3)
    e, h = random_fields(grid.shape, rng)
    target = random_target(grid, rng, inside=2 * coupled, coupled=coupled)
    fields, twin = Fields(device, grid, target), Twin(grid, target, e, h)
    fields.start(e, h)
    fields.advance(5)
    wanted = [twin.advance() for _ in range(5)]
    for part, (at, number) in ((fields.edges, (target.edges, 0)), (fields.faces, (target.faces, 1))):
        order = np.searchsorted(np.sort(at), part.places)
        expected = np.array([step[number] for step in wanted])[:, np.argsort(at)][:, order]
        assert np.abs(part.residuals(5) - expected).max() < ROUNDING * 10 * np.abs(expected).max()
    got_e, got_h = fields.download()
    assert np.abs(got_e - twin.e).max() < ROUNDING * 10
    assert np.abs(got_h - twin.h).max() < ROUNDING * 10


def test_an_incident_wave_equals_the_twin(device):
    grid = lattice_of((13, 14, 32))
    table = wave_for(grid, 4)
    fields = Fields(device, grid, Target.nothing(), wave=table)
    twin = Twin(grid, Target.nothing(), *np.zeros((2, 3, *grid.shape)), wave=table)
    blocks = int(table.delay / grid.time_step) // BLOCK  # the peak of the pulse is in the box
    for _ in range(blocks):
        fields.advance(BLOCK)
    for _ in range(blocks * BLOCK):
        twin.advance()
    got_e, got_h = fields.download()
    assert np.abs(twin.e).max() > 0.1
    assert np.abs(got_e - twin.e).max() < ROUNDING
    assert np.abs(got_h - twin.h).max() < ROUNDING


def test_running_transforms_equal_the_twin(device):
    grid, rng = lattice_of((4, 6, 16)), np.random.default_rng(4)
    e, h = random_fields(grid.shape, rng)
    target = random_target(grid, rng)
    fields = Fields(device, grid, target)
    fields.start(e, h)
    omega, part = np.array([0.0, 0.1, 0.4]), fields.edges
    sums, wanted = device.zeros(8 * len(omega) * part.count), 0
    for block, n_steps in enumerate((BLOCK, BLOCK, 3)):
        fields.advance(n_steps)
        times = block * BLOCK + np.arange(n_steps)
        turns = np.exp(-1j * np.outer(times, omega))
        phase = device.copied(np.stack([turns.real, turns.imag], -1).astype(np.float32))
        norms = fields.transform(part, phase, sums, n_steps, len(omega))
        change = fdtd.transform(part.residuals(n_steps).astype(float), times, omega)
        wanted = wanted + change
        for got, values in zip(norms, (change, wanted), strict=True):
            assert np.allclose(got, (np.abs(values) ** 2).sum(axis=1), rtol=1e-5)
    got = device.download(sums, np.empty((len(omega), 2, part.count), np.float32))[:, :, : len(part.places)]
    assert np.abs(got[:, 0] + 1j * got[:, 1] - wanted).max() < 1e-6 * np.abs(wanted).max()


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("width", [1, 3, 16])
def test_steps_done_tile_by_tile_give_the_same_bits(device, width, coupled):
    grid, rng = lattice_of((17, 13, 32)), np.random.default_rng(5)
    target, table = random_target(grid, rng, inside=6, coupled=coupled), wave_for(grid, 4)
    runs = []
    for tile in (100, width):
        fields = Fields(device, grid, target, absorber=3, wave=table, tile=tile)
        fields.start(*random_fields(grid.shape, np.random.default_rng(6)))
        for n_steps in (BLOCK, BLOCK, 3):
            fields.advance(n_steps)
        runs.append([*fields.download(), fields.edges.residuals(3), fields.faces.residuals(3)])
    for whole, tiled in zip(*runs, strict=True):
        assert np.abs(whole).max() > 1e-3
        assert np.array_equal(whole, tiled)


@pytest.mark.parametrize("n_planes, n_steps, width", [(1, 1, 1), (5, 8, 2), (17, 3, 4), (16, 8, 16)])
@pytest.mark.parametrize("ahead", [0, 1])
def test_tiles_visit_every_plane_of_every_step_after_what_it_needs(n_planes, n_steps, width, ahead):
    e, h = np.zeros((2, n_planes), int)  # steps that each plane has done
    for step, magnetic, (first, last) in tiles(n_planes, n_steps, width, ahead):
        if magnetic:
            assert (h[first:last] == step).all() and (e[first : last + 1] == step).all()
            h[first:last] += 1
        else:
            assert (e[first:last] == step).all() and (h[max(first - 1, 0) : last + ahead] == step + 1).all()
            e[first:last] += 1
    assert (e == n_steps).all() and (h == n_steps).all()
