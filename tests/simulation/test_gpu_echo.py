"""Echoes as a GPU makes them: the samples alone come back. A CPU device stands in for one."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import as_gpu

import sarcl
from sarcl.opencl.device import Device

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
N_PULSES = 80
TRACK = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.07, n_pulses=N_PULSES)


def points():
    random = np.random.default_rng(0)
    return sarcl.Scene.points(random.uniform(-8, 8, (300, 3)), random.standard_normal(300) + 0j)


def plates():
    return sarcl.Scene.from_heights(np.linspace(-3, 3, 5), np.linspace(-3, 3, 5), np.zeros((5, 5)))


@pytest.mark.parametrize("make", [points, pytest.param(plates, marks=pytest.mark.slow)])
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
