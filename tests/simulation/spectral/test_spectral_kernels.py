"""The kernels of spectral echoes against their twins, and the map's spectrum against the sum that it computes."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import as_gpu

from sarcl.numerics import shared_tile
from sarcl.reference import spectral_echo as twin
from sarcl.simulation.spectral._aspect_window import DopplerGrid, aspects, wavenumber
from sarcl.simulation.spectral._azimuth_transfer import transfer_tables
from sarcl.simulation.spectral._map_plan import CELLS, plan_map, range_wavenumbers
from sarcl.simulation.spectral._map_spectrum import ReflectivityMap

RANGES, BAND = (2000.0, 2040.0), (3.0e9, 3.1e9)


def ones(sines, frequency):
    return np.ones((1, len(sines)), np.complex128)


@pytest.fixture(params=[*CELLS, "shared"])
def task(request, every_device):
    tile, device = request.param, every_device
    if tile == "shared":
        tile, device = CELLS[1], as_gpu(every_device)
        assert shared_tile.used_by(device)
    seen = aspects(0.01, 0.03, RANGES, BAND, (-50.0, 50.0), 1e-3)
    transfer = transfer_tables(seen, ones, 1, 2, 4)
    ends = np.outer(2 * wavenumber(np.array(BAND)), transfer.limits) * 200.0 / (2 * np.pi)
    grid = DopplerGrid(200.0, 200, int(ends.min()), int(ends.max() - ends.min()))
    numbers = range_wavenumbers(transfer, grid)
    plan = plan_map(1e-4, numbers, grid, RANGES, 0.0, tile, 1e-3)
    random = np.random.default_rng(0)
    n = 300
    azimuth, slant_range = random.uniform(-150, 250, n), random.uniform(*RANGES, n)
    b = (random.normal(size=n) + 1j * random.normal(size=n)).astype(np.complex64)
    held = ReflectivityMap(device, plan, numbers, grid, azimuth, slant_range)
    return held, transfer, azimuth, slant_range, b


def assembled(held, amplitudes, budget):
    """The transform over azimuth, of all bands of rows."""
    return np.concatenate(
        [made for _, made in held.over_azimuth(amplitudes, slice(0, held.grid.count), budget)], axis=1
    )


def test_the_spectrum_is_the_sum_over_the_scatterers(task):
    held, transfer, azimuth, slant_range, b = task
    f = np.linspace(*BAND, 7)
    whole = slice(0, held.grid.count)
    out = np.zeros((held.grid.count, 7), np.complex64)
    held.add(assembled(held, b, 1e9), whole, transfer.tables[0, 0], transfer, f, out, 1e9)
    middle, u = held.numbers.phase.middle_range, held.grid.wavenumbers
    for i, k in enumerate(wavenumber(f).tolist()):
        kappa = np.sqrt(4 * k**2 - u**2)
        wanted = twin.map_spectrum(b, azimuth, slant_range - middle, u, kappa)
        wanted *= np.exp(1j * u**2 / (kappa + 2 * k) * middle) * transfer.amplitude(0, 0, float(f[i]), u)
        assert np.linalg.norm(out[:, i] - wanted) <= held.plan.error * np.linalg.norm(wanted)
    # a part of the wavenumbers, in bands of few rows: the same
    some = slice(3, held.grid.count - 5)
    part = np.zeros((held.grid.count - 8, 7), np.complex64)
    held.add(assembled(held, b, 2e6)[some], some, transfer.tables[0, 0], transfer, f, part, 2e6)
    assert np.linalg.norm(part - out[some]) <= 1e-6 * np.linalg.norm(out)


def test_kernels_are_their_twins(task):
    held, transfer, _, _, b = task
    plan, device = held.plan, held.device
    n_tiles = plan.n_columns // plan.tile
    made = device.empty(8 * plan.n_rows * plan.n_columns)
    values = (b * held.wave)[held.order]
    device.run(
        held.spread, *shared_tile.launch(device, (n_tiles, plan.n_rows // plan.tile)),
        device.upload(values), held.first, held.rest, held.start, held.table, n_tiles, 0, made,
    )  # fmt: skip
    grid = device.download(made, np.empty((plan.n_rows, plan.n_columns), np.complex64))
    first = device.download(held.first, np.empty((len(b), 2), np.int32))
    rest = device.download(held.rest, np.empty((len(b), 2), np.float32))
    wanted = twin.spread(values, first, rest, plan.kernel, grid.shape)
    assert np.linalg.norm(grid - wanted) <= 1e-6 * np.linalg.norm(wanted)

    f, whole = np.linspace(*BAND, 5), slice(0, held.grid.count)
    over = assembled(held, b, 1e9)
    out = np.zeros((held.grid.count, 5), np.complex64)
    held.add(over, whole, transfer.tables[0, 0], transfer, f, out, 1e9)
    padded = np.zeros((len(over), plan.n_range), np.complex64)
    padded[:, : plan.n_rows - plan.origin] = over[:, plan.origin :]
    padded[:, plan.n_range - plan.origin :] = over[:, : plan.origin]
    wanted = np.concatenate([
        twin.migrate(
            np.fft.fft(padded[part]), twin.Coordinates(*coordinates), transfer.tables[0, 0], transfer.basis(f),
            plan.kernel,
        )
        for part, coordinates in held.coordinates(transfer, f, whole, 1e9)
    ])  # fmt: skip
    assert np.linalg.norm(out - wanted) <= 2e-6 * np.linalg.norm(wanted)
