"""Echoes as a GPU makes them: the samples alone come back. A CPU device stands in for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.devices import as_gpu

import sarcl
from sarcl.opencl.device import Device
from sarcl.simulation import spreading

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
N_PULSES = 80
TRACK = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.07, n_pulses=N_PULSES)


def points():
    random = np.random.default_rng(0)
    return sarcl.Scene.points(random.uniform(-8, 8, (300, 3)), random.standard_normal(300) + 0j)


def plates():
    return sarcl.Scene.from_heights(np.linspace(-3, 3, 5), np.linspace(-3, 3, 5), np.zeros((5, 5)))


@pytest.mark.parametrize("make", [points, pytest.param(plates, marks=pytest.mark.slow)])
@pytest.mark.costly
def test_samples_alone_are_downloaded_and_meet_their_tolerance(device, make, monkeypatch):
    downloads, download = [], Device.download

    def counted(self, buffer, out, offset=0):
        if out.dtype == np.complex64:
            downloads.append(out.shape)
        return download(self, buffer, out, offset)

    monkeypatch.setattr(Device, "download", counted)
    raw = sarcl.echo(
        make(), CHIRP, TRACK, range_window=(-30, 30), shadows=False, tolerance=1e-4, check=True, device=as_gpu(device)
    )
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-4
    assert downloads and {shape[-1] for shape in downloads} == {raw.n_samples}
    assert sum(shape[0] for shape in downloads) % N_PULSES == 0  # rows, and no padding of profiles


def with_and_without_groups(device):
    """GPUs whose work-groups add up scatterers together, and without local memory for that."""
    gpu = as_gpu(device)
    gpus = {True: gpu, False: Device(replace(gpu.info, local_memory=0), gpu._raw)}
    assert all(spreading.Rows(gpu, 64, 1, 1, 1).grouped is grouped for grouped, gpu in gpus.items())
    return gpus


def scattered(n, extent):
    random = np.random.default_rng(3)
    return sarcl.Scene.points(random.uniform(-extent, extent, (n, 3)), random.standard_normal(n) + 0j)


@pytest.mark.parametrize(
    "scene, options",
    [
        (scattered(1000, 2.0), {}),  # hundreds of scatterers in a sample
        (scattered(300, 200.0), {"range_window": (-500, 500)}),  # some in a window of local memory, most beyond it
        (scattered(700, 60.0), {"range_window": (-20, 30)}),  # tiles that cross the edges of the range window
        pytest.param(
            scattered(130, 40.0),
            {"antenna": sarcl.Antenna.gaussian(width=(0.006, 0.02)), "pointed": True},
            marks=pytest.mark.slow,
        ),
        pytest.param(scattered(70, 3.0), {"tolerance": 1e-6}, marks=pytest.mark.slow),
        pytest.param(scattered(1, 3.0), {}, marks=pytest.mark.slow),
    ],
    ids=["dense", "sparse", "window", "antenna", "1e-6", "one"],
)
def test_rows_that_work_groups_add_up_are_those_of_single_work_items(device, scene, options):
    options = dict(options)
    track = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.01, n_pulses=5)
    if options.pop("pointed", False):
        track = sarcl.pointing.spotlight(track, (0, 0, 0))
    made = {}
    for grouped, gpu in with_and_without_groups(device).items():
        made[grouped] = sarcl.echo(scene, CHIRP, track, check=True, device=gpu, **{"tolerance": 1e-4, **options})
    got, wanted = (made[g].report for g in (True, False))
    assert got.measured_error <= options.get("tolerance", 1e-4)
    assert np.linalg.norm(made[True].samples - made[False].samples) <= 1e-6 * np.linalg.norm(made[False].samples)
    assert got.contributions_done == wanted.contributions_done
    assert got.contributions_skipped == wanted.contributions_skipped


@pytest.mark.parametrize(
    "options",
    [
        {"shadows": True, "max_edge": 0.5},
        pytest.param({"shadows": False, "max_edge": 0.5, "polarization": "all"}, marks=pytest.mark.slow),
        pytest.param(
            {
                "shadows": False,
                "max_edge": 0.5,
                "antenna": sarcl.Antenna.gaussian(width=(0.003, 0.02)),
                "tolerance": 1e-2,
            },
            marks=pytest.mark.slow,
        ),
    ],
    ids=["shadows", "channels", "beam"],
)
@pytest.mark.costly
def test_facets_that_work_groups_add_up_are_those_of_single_work_items(device, options):
    axis = np.linspace(-4, 4, 6)
    scene = sarcl.Scene.from_heights(axis, axis, np.random.default_rng(0).normal(size=(6, 6)) * 0.3)
    track = sarcl.pointing.spotlight(TRACK.picked(slice(0, 5)), (0, 0, 0))
    made = {}
    for grouped, gpu in with_and_without_groups(device).items():
        made[grouped] = sarcl.echo(
            scene, CHIRP, track, range_window=(-4, 3.5), check=False, device=gpu, **{"tolerance": 1e-3, **options}
        )
    got, wanted = made[True], made[False]
    # float32 sums in another order, of facets whose echoes cancel
    assert np.linalg.norm(got.samples - wanted.samples) <= 5e-6 * np.linalg.norm(wanted.samples)
    assert got.report.contributions_done == wanted.report.contributions_done > 0
    assert got.report.contributions_skipped == wanted.report.contributions_skipped


@pytest.mark.parametrize("n_pulses", [1, 100, 10_000])
def test_groups_are_at_least_100_000_work_items(device, n_pulses):
    for units in (8, 132):
        gpu = Device(replace(device.info, kind="gpu", units=units, vector_width=1), device._raw)
        parts = spreading.Rows(gpu, 64, 1, n_pulses, 10**6).splits
        assert min(n_pulses, spreading.most_pulses(gpu)) * parts * spreading.GROUP >= 100_000
    assert spreading.Rows(gpu, 64, 1, 1, 7).splits == 7
