"""The kernels of spectral echoes against their twins, facets' amplitudes, maps, and where these lie."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import thinned
from helpers.devices import as_gpu

import sarcl
from sarcl import pointing
from sarcl.numerics import shared_tile
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference import spectral_echo as twin
from sarcl.scattering.antenna_weights import weights_of
from sarcl.scattering.facet_shadows import ShadowRule
from sarcl.scattering.physical_optics import normals_and_areas
from sarcl.scattering.random_surface import pieces_of
from sarcl.scattering.scatterers import facets_of
from sarcl.scattering.subdivision import CutScene
from sarcl.simulation.spectral import _facet_factors as factors
from sarcl.simulation.spectral._aspect_window import DopplerGrid, aspects, wavenumber
from sarcl.simulation.spectral._azimuth_transfer import transfer_tables
from sarcl.simulation.spectral._map_plan import CELLS, plan_map, range_wavenumbers
from sarcl.simulation.spectral._map_spectrum import ReflectivityMap
from sarcl.simulation.spectral._scatterer_amplitudes import ScattererAmplitudes
from sarcl.simulation.spectral._scratch import Scratch
from sarcl.simulation.spectral._straight_track import straight_track

RANGES, BAND = (2000.0, 2020.0), (3.0e9, 3.1e9)  # with the aspects below FFTs of powers of two, built in a second


def ones(sines, frequency):
    return np.ones((1, len(sines)), np.complex128)


@pytest.fixture(params=[*CELLS, "shared"])
def task(request, device):
    tile = request.param
    if tile == "shared":
        tile, device = CELLS[1], as_gpu(device)
        assert shared_tile.used_by(device)
    seen = aspects(0.01, 0.0175, RANGES, BAND, (-50.0, 50.0), 1e-3)
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
    held.add(assembled(held, b, 8e5)[some], some, transfer.tables[0, 0], transfer, f, part, 8e5)
    assert np.linalg.norm(part - out[some]) <= 1e-6 * np.linalg.norm(out)


def test_kernels_are_their_twins(task):
    held, transfer, _, _, b = task
    plan, device = held.plan, held.device
    n_tiles = plan.n_columns // plan.tile
    made = device.empty(8 * plan.n_rows * plan.n_columns)
    values = (b * held.wave)[held.order]
    device.run(
        held.spread, *shared_tile.launch(device, (n_tiles, plan.n_rows // plan.tile), held.grouped),
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


CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=2e-6)
MATERIALS = {
    "metal": "metal",
    "dispersive": sarcl.Material(eps_r=4.0, conductivity=0.5),
    "rough": sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="cos2"),
    "slightly rough": sarcl.Material(eps_r=9.0, conductivity=1e-3, height=2e-3, diagram="exp", width=0.5),
}
ANTENNAS = {
    "none": (None, None),
    "gaussian": (sarcl.Antenna.gaussian(width=(0.02, 0.1)), sarcl.Radar(power=1e3)),
    "two": (
        (sarcl.Antenna.rectangular(size=(0.5, 0.1)), sarcl.Antenna.table(
            np.linspace(-0.1, 0.1, 9), np.linspace(-0.2, 0.2, 7), np.outer(np.hanning(11)[1:-1], np.ones(7)))),
        None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("material, antenna", thinned(MATERIALS, ANTENNAS))
def test_factors_of_facets_are_their_amplitudes(material, antenna, device):
    line = sarcl.Trajectory.line(start=(0, -60, 6e3), velocity=(0, 100, 0), prf=250, n_pulses=40)
    track = pointing.stripmap(line, look=float(np.arctan2(8e3, 6e3)), side="right")
    axis = np.linspace(-6, 6, 9)
    heights = np.random.default_rng(1).normal(size=(9, 9)) * 0.3
    scene = sarcl.Scene.from_heights(8e3 + axis, axis, heights, material=MATERIALS[material])
    scene = scene + sarcl.shapes.box((2, 2, 3), material="metal").on(scene, 8e3, 0)
    antennas = PulseGeometry(track.positions, track.positions)
    (facets,), _ = facets_of(
        CutScene(scene, None, pieces_of(scene, np.inf, np.inf, 0)), antennas,
        shadows=ShadowRule(False, True, 1e-2, max_bytes=1e9), skips={"facing away"},
        device=device, progress=lambda *_: None,
    )  # fmt: skip
    weights = weights_of(*ANTENNAS[antenna], track, None, CHIRP, scene.center)
    polarizations = ("HH", "HV", "VH", "VV")
    amplitudes = ScattererAmplitudes(
        facets, weights, straight_track(track, 1e10, 1e-3), polarizations, np.array([0.0, 0.0, 1.0])
    )
    some = np.flatnonzero(np.random.default_rng(2).random(len(facets)) < 0.8)
    for budget in (1e9, 1.0):
        held = factors.FacetFactors(device, amplitudes, some, budget, at_once=100)
        for sine, frequency in ((-0.004, 9.55e9), (0.003, 9.67e9)):
            wanted = amplitudes(some, sine, frequency)
            found = held(sine, frequency)
            assert found.dtype == np.complex64 and found.shape == wanted.shape
            areas = normals_and_areas(facets.triangles[some])[1]
            peak = np.sqrt(np.pi) * frequency / 3e8 * areas * 2.1 * weights.peak
            assert (np.abs(found - wanted).max(axis=1) <= 1e-5 * peak).all()
            # facets of 50 wavelengths, most of them far from their specular directions
            assert np.linalg.norm(found - wanted) <= 6e-5 * np.linalg.norm(wanted)


@pytest.mark.parametrize("room", [0, 1e9])
def test_a_scratch_holds_what_is_written(room, tmp_path):
    random = np.random.default_rng(0)
    wanted = random.normal(size=(37, 11)) + 1j * random.normal(size=(37, 11))
    held = Scratch((37, 11), room, tmp_path)
    assert (held.whole is None) == (room == 0)
    assert not held.rows(0, 37).any()
    held.put(20, wanted[20:].astype(np.complex64))
    held.put(0, wanted[:20])
    rows = held.rows(5, 30)
    assert np.array_equal(rows, wanted[5:30].astype(np.complex64))
    rows *= 2
    held.put(5, rows)
    assert np.allclose(held.columns(3, 7, 200)[5:30], 2 * wanted[5:30, 3:7], rtol=1e-6)
    assert np.allclose(held.columns(0, 11, 1e9)[30:], wanted[30:], rtol=1e-6)
    assert not list(tmp_path.iterdir())  # the file has no name
