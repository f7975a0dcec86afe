"""Transforms of range_doppler along the track: sums of few rows are the FFTs that they stand for."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from helpers.cases import image_error, noise_on
from helpers.devices import as_gpu

import sarcl
from sarcl.opencl.device import Device


def few_rows(n=11, away=40e3, spacing=0.02, n_samples=24):
    """Noise in rows so near to one another that a Fresnel zone, 18 m, holds a thousand of them."""
    y = spacing * (np.arange(n) - n // 2)
    tx = np.stack([np.full(n, -0.7 * away), y, np.full(n, 0.7 * away)], axis=1)
    return noise_on(tx, n_samples=n_samples, bandwidth=200e6, time=y / 100)


@pytest.mark.parametrize(
    "options", [{}, {"spacing": (1e-4, None)}, {"azimuth_beam": 0.003, "window": "hamming"}], ids=str
)
def test_images_by_sums_are_those_by_ffts(options, monkeypatch):
    raw, asked = few_rows(), []
    kind = type(sarcl.range_doppler.planned(raw, side="right").task.plan)
    pays = kind.sums_pay
    monkeypatch.setattr(kind, "sums_pay", lambda *given: asked.append(pays(*given)) or asked[-1])
    image = sarcl.range_doppler(raw, side="right", check=False, **options)
    assert asked == [True, True]
    assert image_error(image, raw, most=100) <= image.report.predicted_error if "azimuth_beam" not in options else True
    monkeypatch.setattr(kind, "sums_pay", lambda *given: False)
    wanted = sarcl.range_doppler(raw, side="right", check=False, **options)
    assert np.linalg.norm(image.data - wanted.data) <= 2e-6 * np.linalg.norm(wanted.data)


def test_few_rows_need_no_array_of_all_doppler_bins(device):
    """An FFT of 85 000 samples was made of each column, most of them zeros: it took minutes and gigabytes."""
    raw = few_rows(spacing=2e-4)
    forecast = sarcl.plan(sarcl.range_doppler, raw, side="right")
    length = int(str(forecast.plan["Doppler bins"]).split()[-1])
    n_times, n_ranges = (int(n) for n in str(forecast.plan["pixels"]).split(" x "))
    assert length > 50_000 and n_times < 20
    assert forecast.bytes < 8 * length * n_ranges / 20
    for on in (device, as_gpu(device)):
        tracemalloc.start()
        sarcl.range_doppler(raw, side="right", check=False, device=on)
        held = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert held < 8 * length * n_ranges / 2


def test_many_rows_are_transformed_by_ffts_on_the_device(device, monkeypatch):
    files, kernel = [], Device.kernel
    monkeypatch.setattr(Device, "kernel", lambda *given, **macros: files.append(given[1]) or kernel(*given, **macros))
    raw = few_rows(n=200, spacing=0.2)
    image = sarcl.range_doppler(raw, side="right", check=False, device=as_gpu(device))
    assert "compression_filter.cl" in files and np.isfinite(image.data).all()
    files.clear()
    sarcl.range_doppler(few_rows(spacing=2e-4), side="right", check=False, device=as_gpu(device))
    assert "compression_filter.cl" not in files
