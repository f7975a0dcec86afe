"""Waveform forming: sums of currents against the twin in float64, echoes against the far field of the run itself."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.current_cases import antennas, difference, random_currents, twin, unit
from helpers.devices import as_gpu
from helpers.far_field import amplitude

from sarcl.fullwave import dispersion
from sarcl.fullwave.current_sums import BENT, GROUPS, PATHS, current_sums
from sarcl.fullwave.currents import Currents
from sarcl.fullwave.formed_echoes import formed_echoes, paths_of
from sarcl.fullwave.incident import PlaneWave
from sarcl.opencl.device import Device

# float32: paths of 10 m to 1e-6 m, phases of some 100 cycles to 3e-5 rad, sums of 2048 terms
ROUNDING = 5e-5


@pytest.mark.parametrize(
    ("n", "n_frequencies", "n_pulses"), [(1, 1, 1), (31, 7, 8), (500, 8, 9), (700, 17, 3), (2049, 9, 16)]
)
@pytest.mark.parametrize("kind", ["itself", "gpu"])
def test_sums_of_currents_are_those_of_the_twin(device, kind, n, n_frequencies, n_pulses):
    currents = random_currents(n, n_frequencies)
    if kind == "gpu":
        device = as_gpu(device)
        assert device.shares(PATHS, GROUPS[0])
    tx = antennas(currents, n_pulses, 0.2)
    for rx in (tx, antennas(currents, n_pulses, 0.5, seed=2)):
        paths = paths_of(currents, tx, rx)
        got = current_sums(device, currents, paths, max_bytes=None)
        assert difference(got, twin(currents, paths, tx, rx)) < ROUNDING


def test_distances_are_spherical_at_1100_metres_from_a_target_of_10_metres(device):
    currents = random_currents(300, 5, shape=(64, 30, 32), cell=0.15)
    tx = antennas(currents, 8, 0.1)
    paths = paths_of(currents, tx, tx)
    got = current_sums(device, currents, paths, max_bytes=None)
    assert difference(got, twin(currents, paths, tx, tx)) < ROUNDING
    far = currents.centre + 1e9 * paths.tx
    assert difference(got, twin(currents, paths, far, far)) > 0.05


def test_uneven_frequencies_are_followed_one_by_one(device):
    currents = random_currents(200, 19)
    object.__setattr__(currents, "k", currents.k * np.linspace(0.9, 1, 19) ** 2)
    tx = antennas(currents, 5, 0.2)
    paths = paths_of(currents, tx, tx)
    assert np.abs(np.diff(currents.k, 2)).max() / (2 * np.pi) > BENT  # cycles per metre of path
    got = current_sums(device, currents, paths, max_bytes=None)
    assert difference(got, twin(currents, paths, tx, tx)) < ROUNDING


def test_little_memory_gives_the_same_sums_in_parts(device):
    """More pulses than are summed at a time, and 2700 cells of each component, 2048 at a time."""
    currents = random_currents(8000, 40)
    tx = antennas(currents, 260, 0.2)
    paths = paths_of(currents, tx, tx)
    whole = current_sums(device, currents, paths, max_bytes=None)
    assert difference(current_sums(device, currents, paths, max_bytes=1e6), whole) < 1e-6


def test_in_the_direction_of_the_run_formed_echoes_are_its_far_field(device):
    currents = random_currents(400, 6)
    tx = currents.centre - 1e9 * currents.wave.travel[None]
    received = np.random.default_rng(3).normal(size=(2, 1, 3))
    got = formed_echoes(device, currents, tx, tx, received)[0]
    wanted = np.array([amplitude(currents, -currents.wave.travel, vector) for vector in received[:, 0]])
    assert difference(got, wanted) < ROUNDING


def test_a_receiver_elsewhere_sees_the_bistatic_far_field(device):
    currents = random_currents(400, 6)
    towards = unit((-0.2, 0.9, 0.4))
    tx, rx = (currents.centre + 1e9 * direction[None] for direction in (-currents.wave.travel, towards))
    vector = np.array([0.3, -0.5, 0.8])
    got = formed_echoes(device, currents, tx, rx, vector[None, None])[0, 0]
    assert difference(got, amplitude(currents, towards, vector)) < ROUNDING


def test_currents_that_follow_the_incident_wave_give_the_echo_of_the_run_of_each_pulse(device):
    """Currents w exp(-j k d.x) differ in these phases alone from one direction d to another."""
    first = random_currents(400, 6)
    weight = np.random.default_rng(5).normal(size=(2, 400))
    runs = []
    for travel in (first.wave.travel, unit((1, 0.1, -0.8))):
        wave = PlaneWave(travel, np.array([0, 1.0, 0]), first.wave.pulse)
        parts = []
        for row, (at, magnetic) in enumerate(((first.edges, False), (first.faces, True))):
            path = (first.lattice.positions(at, magnetic) - first.centre) @ travel
            parts.append((weight[row] * np.exp(-1j * np.outer(first.k, path))).astype(np.complex64))
        omega = dispersion.grid_omega(first.lattice, first.k, travel)
        runs.append(Currents(
            first.lattice, wave, first.centre, first.k, omega, first.edges, parts[0], first.faces, parts[1], 0, 0.0
        ))  # fmt: skip
    tx = first.centre - 1e9 * runs[1].wave.travel[None]
    received = np.array([[[0.0, 1.0, 0.0]]])
    formed, own = (formed_echoes(device, run, tx, tx, received) for run in runs)
    assert difference(formed, own) < ROUNDING


def smooth_track(currents, n, jitter=0.0):
    """Antennas on a line at 1.1 km that sees the target over 19 degrees, and H and V of each."""
    tx = currents.centre + np.column_stack([np.linspace(-184, 184, n), np.full(n, -778.0), np.full(n, 778.0)])
    tx += jitter * np.random.default_rng(4).normal(size=tx.shape)
    look = (currents.centre - tx) / np.linalg.norm(currents.centre - tx, axis=1)[:, None]
    h = np.cross(look, [0, 0, 1.0]) / np.linalg.norm(np.cross(look, [0, 0, 1.0]), axis=1)[:, None]
    return tx, np.stack([h, np.cross(h, look)])


def computed_pulses(monkeypatch):
    """Numbers of pulses of each call of current_sums from here on."""
    seen, sums = [], current_sums

    def counted(device, currents, paths, max_bytes):
        seen.append(len(paths.tx))
        return sums(device, currents, paths, max_bytes=max_bytes)

    monkeypatch.setattr("sarcl.fullwave.formed_echoes.current_sums", counted)
    return seen


@pytest.mark.parametrize("receiver_at", [(0, 0, 0), (250, 0, 40)])
def test_of_a_smooth_track_few_pulses_are_computed_and_the_others_interpolated(device, monkeypatch, receiver_at):
    currents = random_currents(800, 5, shape=(64, 30, 32), cell=0.15)
    tx, received = smooth_track(currents, 1024)
    rx = tx + receiver_at
    seen = computed_pulses(monkeypatch)
    got = formed_echoes(device, currents, tx, rx, received)
    assert len(seen) == 1 and seen[0] < 90
    some = np.array([1, 2, 100, 333, 511, 700, 900, 1022])
    wanted = formed_echoes(device, currents, tx[some], rx[some], received[:, some])
    assert seen[1] == len(some)
    assert difference(got[some], wanted) < 2 * ROUNDING


def test_of_a_track_that_shakes_all_pulses_are_computed(device, monkeypatch):
    currents = random_currents(200, 3, shape=(64, 30, 32), cell=0.15)
    tx, received = smooth_track(currents, 1024, jitter=1.0)
    seen = computed_pulses(monkeypatch)
    got = formed_echoes(device, currents, tx, tx, received)
    assert sum(seen) == 1024
    some = np.arange(0, 1024, 150)
    assert difference(got[some], formed_echoes(device, currents, tx[some], tx[some], received[:, some])) < ROUNDING


def test_pulses_from_one_place_have_one_echo(device):
    currents = random_currents(100, 3)
    tx = np.tile(antennas(currents, 1, 0.0), (50, 1))
    got = formed_echoes(device, currents, tx, tx, np.tile([0, 1.0, 0], (1, 50, 1)))
    assert difference(got, np.tile(got[:1], (50, 1, 1))) < ROUNDING


def test_work_items_that_share_the_frequencies_as_on_a_gpu_give_the_same_sums(device, monkeypatch):
    currents = random_currents(3000, 20)
    tx = antennas(currents, 5, 0.2)
    paths = paths_of(currents, tx, tx)
    wanted = current_sums(device, currents, paths, max_bytes=None)
    monkeypatch.setattr(Device, "is_cpu", False)
    assert difference(current_sums(device, currents, paths, max_bytes=None), wanted) < 1e-6
