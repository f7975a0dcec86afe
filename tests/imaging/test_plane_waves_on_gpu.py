"""Polar format images as a GPU makes them: samples go up once, the image comes down once. A CPU stands in for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_on
from helpers.devices import as_gpu
from helpers.moved import held_bytes, moved_bytes

import sarcl
from sarcl.reference.polar_format import polar_format as plane_sum

ARC = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.1, n_pulses=60).positions
GRID = sarcl.ImageGrid.plane(shape=(51, 64), spacing=(0.3, 0.25))


def error_of(image, raw):
    center = image.grid.at(*(n // 2 for n in image.grid.shape))
    return image_error(image, raw, most=200, exact=lambda *a, **k: plane_sum(*a, center=center, **k))


@pytest.mark.parametrize("tolerance", [1e-2, pytest.param(1e-5, marks=pytest.mark.slow)])
def test_images_of_the_device_are_those_of_the_host_within_the_tolerance(device, tolerance):
    raw = noise_on(ARC)
    raw = replace(raw, reference_range=raw.reference_range + np.linspace(-3, 3, 60), weight=np.linspace(0, 1, 60))
    for kind in (np.complex64, np.complex128):
        given = replace(raw, samples=raw.samples.astype(kind))
        image = sarcl.polar_format(
            given, GRID, tolerance=tolerance, window="hamming", device=as_gpu(device), check=True
        )
        assert image.report.measured_error <= image.report.predicted_error <= tolerance
        wanted = sarcl.polar_format(given, GRID, tolerance=tolerance, window="hamming", device=device)
        assert np.linalg.norm(image.data - wanted.data) <= 2e-6 * np.linalg.norm(wanted.data)


@pytest.mark.parametrize("upload", [2**26, 10 * 96 * 24])  # one block of rows, and several
def test_samples_go_up_once_and_the_image_comes_down_once(device, upload):
    raw = noise_on(ARC)
    with moved_bytes() as moved:
        image = sarcl.polar_format(raw, GRID, tolerance=1e-3, device=as_gpu(device, upload=upload), check=False)
    small = 200 * raw.n_rows + 8 * 96 + 4 * sum(GRID.shape) + 1000  # weights, lines, the table, energies
    assert raw.samples.nbytes <= moved.up <= raw.samples.nbytes + small
    assert image.data.nbytes <= moved.down <= image.data.nbytes + 128 * raw.n_rows
    assert error_of(image, raw) <= 1e-3


@pytest.mark.parametrize("max_bytes", [1e6, *(pytest.param(n, marks=pytest.mark.slow) for n in (1.6e6, 1e8))])
def test_buffers_keep_to_max_bytes(device, max_bytes, monkeypatch):
    raw, grid = noise_on(ARC, n_samples=800), sarcl.ImageGrid.plane(shape=(180, 150), spacing=0.08)
    whole = sarcl.polar_format(raw, grid, tolerance=1e-3, device=device, check=False)
    with held_bytes(monkeypatch) as held, moved_bytes() as moved:
        image = sarcl.polar_format(raw, grid, tolerance=1e-3, device=as_gpu(device), max_bytes=max_bytes, check=False)
    assert max_bytes / 4 < held.most <= max_bytes or max_bytes == 1e8
    assert (moved.down > 1.5 * image.data.nbytes) is (max_bytes < 1e8)
    assert np.linalg.norm(image.data - whole.data) <= 1e-6 * np.linalg.norm(whole.data)
    options = {"tolerance": 1e-3, "device": as_gpu(device), "max_bytes": max_bytes}
    assert sarcl.plan(sarcl.polar_format, raw, grid, **options).predicted_error


@pytest.mark.filterwarnings("ignore:overflow encountered")
def test_sums_that_a_device_may_not_hold_are_the_hosts_or_refused(device):
    raw, gpu = noise_on(ARC), as_gpu(device)
    wanted = sarcl.polar_format(raw, GRID, tolerance=1e-3, device=gpu, check=False)
    for factor in (1e21, 1e28):
        scaled = replace(raw, samples=raw.samples * np.float32(factor))
        image = sarcl.polar_format(scaled, GRID, tolerance=1e-3, device=gpu, check=False)
        assert np.linalg.norm(image.data / np.float32(factor) - wanted.data) <= 2e-6 * np.linalg.norm(wanted.data)
    scaled = replace(raw, samples=raw.samples * np.float32(1e34))
    with pytest.raises(ValueError, match=r"samples times weights reach .*; sums of 5760 in complex64 hold up to"):
        sarcl.polar_format(scaled, GRID, tolerance=1e-3, device=gpu)
    faint = replace(raw, samples=raw.samples.astype(np.complex128) * 1e-37)
    with pytest.raises(ValueError, match="complex64 loses digits below 1e-35"):
        sarcl.polar_format(faint, GRID, tolerance=1e-3, device=gpu)


def test_a_dark_image_is_reported_by_the_energy_that_the_device_sums(device):
    n = 512
    frequency = 9.6e9 - 150e6 + np.arange(n) * 300e6 / n
    reference = np.linalg.norm(ARC, axis=1)
    path = 2 * (np.linalg.norm(ARC - np.array([60.0, 0, 0]), axis=1) - reference)
    samples = np.exp(-2j * np.pi * np.outer(path, frequency) / 299792458.0)
    raw = sarcl.PhaseHistory(
        samples, frequency=frequency[0], frequency_step=300e6 / n, tx=ARC, reference_range=reference
    )
    grid = sarcl.ImageGrid.plane(shape=(20, 20), spacing=0.5)
    told = [
        float(sarcl.polar_format(raw, grid, tolerance=1e-3, device=d).report.plan["error of a dark image"])
        for d in (device, as_gpu(device))
    ]
    assert told[1] == pytest.approx(told[0], rel=0.11)  # two digits are printed
