"""Range-Doppler images as a GPU makes them: samples go up once, the image comes down once. A CPU stands in for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_on
from helpers.devices import as_gpu
from helpers.moved import held_bytes, moved_bytes

import sarcl
from sarcl.base import float_pairs
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.range_doppler import _focus_on_device
from sarcl.imaging.range_doppler._aperture_window import ApertureWindow
from sarcl.imaging.range_doppler._doppler import Band
from sarcl.numerics import windows
from sarcl.numerics.interpolation import interpolator
from sarcl.opencl.launch_numbers import launch_numbers
from sarcl.reference.range_doppler import compressed, straighten

SPEED = 100.0


def noise(n=200, n_samples=80, aperture=90.0, squint=0.0, bandwidth=150e6):
    along = aperture * (np.arange(n) / (n - 1) - 0.5)
    tx = np.stack([np.full(n, -2.8e3), along + 2.8e3 * np.tan(squint), np.full(n, 2.856e3)], axis=1)
    return noise_on(tx, n_samples=n_samples, bandwidth=bandwidth, time=np.linspace(0, aperture / SPEED, n))


CASES = {
    "one range block": ({}, {"tolerance": 1e-2}),
    "several range blocks": ({"squint": 0.4, "n": 300}, {"tolerance": 1e-4}),
    "beam": ({"n": 300, "aperture": 150.0}, {"tolerance": 1e-2, "azimuth_beam": 0.012}),
    "beam with a window": (
        {"n": 300, "aperture": 150.0}, {"tolerance": 1e-2, "azimuth_beam": 0.012, "window": "hamming"},
    ),
    "track longer than the FFT": (
        {"n": 700, "aperture": 350.0}, {"tolerance": 1e-2, "azimuth_beam": 0.012, "times": (1.7, 1.75)},
    ),
}  # fmt: skip
SLOW = "several range blocks", "beam", "beam with a window", "track longer than the FFT"


@pytest.mark.parametrize("case", [pytest.param(c, marks=[pytest.mark.slow] if c in SLOW else []) for c in CASES])
@pytest.mark.costly
def test_images_of_the_device_are_those_of_the_host_within_the_tolerance(device, case):
    track, options = CASES[case]
    raw = noise(**track)
    raw = replace(raw, reference_range=raw.reference_range + np.linspace(-2, 2, raw.n_rows))
    image = sarcl.range_doppler(raw, device=as_gpu(device), check=True, **options)
    assert image.report.measured_error <= image.report.predicted_error <= options["tolerance"]
    blocks = int(image.report.plan["range blocks"])
    assert (blocks > 1) is (case == "several range blocks")
    if case == "track longer than the FFT":
        assert int(str(image.report.plan["Doppler bins"]).split()[-1]) < raw.n_rows
    wanted = sarcl.range_doppler(raw, device=device, check=False, **options)
    assert np.linalg.norm(image.data - wanted.data) <= 4e-6 * np.linalg.norm(wanted.data)


@pytest.mark.slow
def test_samples_of_double_precision_and_finer_rows(device):
    raw = noise(n=120, aperture=50.0)
    raw = replace(raw, samples=raw.samples.astype(np.complex128))
    options = {"tolerance": 1e-2, "spacing": (0.5 * 50 / 119 / SPEED, None), "check": False}
    image, wanted = (sarcl.range_doppler(raw, device=d, **options) for d in (as_gpu(device), device))
    assert np.linalg.norm(image.data - wanted.data) <= 4e-6 * np.linalg.norm(wanted.data)


@pytest.mark.parametrize("upload", [2**26, 30 * 80 * 16])  # one block of rows, and several
def test_samples_go_up_once_and_the_image_comes_down_once(device, upload):
    raw = noise()
    with moved_bytes() as moved:
        image = sarcl.range_doppler(raw, tolerance=1e-2, device=as_gpu(device, upload=upload), check=False)
    plan = image.report.plan
    bins, length = (int(str(plan["Doppler bins"]).split()[i]) for i in (0, -1))
    lines = bins * (20 * -(-image.data.shape[1] // 64) + 12)
    tables = 24 * raw.n_rows + 100 * raw.n_samples + 4 * length + 4 * sum(image.data.shape) + 1000
    assert raw.samples.nbytes <= moved.up <= raw.samples.nbytes + lines + tables
    assert moved.down == image.data.nbytes
    assert image_error(image, raw, most=100) <= 1e-2


@pytest.mark.parametrize(
    "max_bytes, n_samples, ranges, kept",
    [
        pytest.param(1e8, 300, None, (True, True), marks=pytest.mark.slow),
        pytest.param(3.6e6, 700, (3980.0, 4180.0), (True, False), marks=pytest.mark.slow),
        pytest.param(2.6e6, 300, None, (False, True), marks=pytest.mark.slow),
        (1e6, 300, None, (False, False)),
    ],
)
def test_buffers_keep_to_max_bytes_and_change_nothing(device, max_bytes, n_samples, ranges, kept, monkeypatch):
    """With the rows and the compressed bins on the device, one of them, or none."""
    raw = noise(n=160, aperture=60.0, n_samples=n_samples)
    options = {"tolerance": 1e-2, "check": False, "ranges": ranges}
    rooms, for_task = [], _focus_on_device.Room.for_task
    monkeypatch.setattr(_focus_on_device.Room, "for_task", lambda *given: rooms.append(for_task(*given)) or rooms[-1])
    whole = sarcl.range_doppler(raw, device=device, **options)
    with held_bytes(monkeypatch) as held:
        image = sarcl.range_doppler(raw, device=as_gpu(device), max_bytes=max_bytes, **options)
    print(f"{held.most} of {max_bytes:.0f} bytes")
    assert [(room.spectra, room.folded) for room in rooms] == [kept]
    assert min(max_bytes, 4e6) / 4 < held.most <= max_bytes
    assert np.linalg.norm(image.data - whole.data) <= 4e-6 * np.linalg.norm(whole.data)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:overflow encountered")
def test_sums_that_a_device_may_not_hold_are_the_hosts_or_refused(device):
    raw, gpu = noise(n=100, aperture=40.0), as_gpu(device)
    wanted = sarcl.range_doppler(raw, device=gpu, check=False)
    for factor in (1e15, 1e21, 1e27):
        scaled = replace(raw, samples=raw.samples * np.float32(factor))
        image = sarcl.range_doppler(scaled, device=gpu, check=False)
        assert np.linalg.norm(image.data / np.float32(factor) - wanted.data) <= 4e-6 * np.linalg.norm(wanted.data)
    for options in ({}, {"max_bytes": 1e6}):
        scaled = replace(raw, samples=raw.samples * np.float32(1e34))
        with pytest.raises(ValueError, match=r"samples times weights reach .*; sums of 8000 in complex64 hold up to"):
            sarcl.range_doppler(scaled, device=gpu, **options)
        faint = replace(raw, samples=raw.samples.astype(np.complex128) * 1e-37)
        with pytest.raises(ValueError, match="complex64 loses digits below 1e-35"):
            sarcl.range_doppler(faint, device=gpu, **options)


def test_blocks_of_rows_may_weigh_nothing(device):
    raw = noise()
    options = {"weights": np.arange(200) >= 100.0, "check": False}  # as the looks are made of which a rate is found
    with moved_bytes() as moved:
        image = sarcl.range_doppler(raw, device=as_gpu(device, upload=20 * 80 * 16), **options)
    assert moved.down == image.data.nbytes
    wanted = sarcl.range_doppler(raw, device=device, **options)
    assert np.linalg.norm(image.data - wanted.data) <= 4e-6 * np.linalg.norm(wanted.data)


@pytest.mark.parametrize("wide", [True, False])
@pytest.mark.parametrize("windowed", [False, True])
def test_bins_are_compressed_as_the_twin_says(device, wide, windowed):
    """The kernel alone, far off broadside, where its phases are many cycles."""
    gpu, random = as_gpu(device if wide else device.without_fp64()), np.random.default_rng(5)
    n, length, center = 37, 48, 9.6e9
    frequencies = center + (np.arange(n) - n // 2) * 20e6
    sines = np.array([0.2, 0.299, 0.4, 0.5, 0.601, 0.7])
    band = Band(0.3, 0.6, 0.05, 0.0)
    if windowed:
        band = Band(0.3, 0.6, 0.05, 0.0, ApertureWindow.over(0.25, 0.65, windows.table("hamming"), 0.01, 0.1))
    bends, distance = sines * center, 123456.7
    kept = np.array([1, 1, 1, 1, 1, 0], np.float32)
    spectra = (random.standard_normal((8, n)) + 1j * random.standard_normal((8, n))).astype(np.complex64)
    factors = random.uniform(1, 2, n).astype(np.float32)
    values, first, step = np.ones(1), 0.0, 1.0
    if band.window is not None:
        values, first = band.window.weights, band.window.sines[0]
        step = band.window.sines[1] - first
    out = gpu.zeros(8 * 4 * length)
    gpu.run(
        gpu.kernel("compression_filter.cl", "compress"), (length, 4), None,
        launch_numbers(
            "compression_filter.cl", "compress", n_samples=n, first=5, period=7, n_bins=6, begin=2,
            center=float_pairs.wide(np.array(center)),
            delay=float_pairs.wide(np.array(2 / SPEED_OF_LIGHT * distance)), low=band.low, high=band.high,
            taper=band.taper, window_first=first, window_step=step, n_window=len(values),
        ),
        gpu.upload(spectra), gpu.upload(float_pairs.wide(frequencies)), gpu.upload(factors),
        gpu.upload(np.concatenate([float_pairs.wide(bends), kept[None]])), gpu.upload(values.astype(np.float32)), out,
    )  # fmt: skip
    got = gpu.download(out, np.empty((4, length), np.complex64))
    rows = (5 + np.arange(2, 6)) % 7
    wanted = compressed(spectra[rows], frequencies, bends[2:], distance, band.weight) * factors * kept[2:, None]
    laid = np.zeros((4, length), np.complex128)
    laid[:, (n // 2 - np.arange(n)) % length] = wanted
    assert not got[3].any() and (np.abs(got[2]) > 0).any()
    assert np.abs(got - laid).max() <= 2e-6 * np.abs(laid).max()


@pytest.mark.parametrize("taps", [2, 4, 6, 8])
def test_profiles_are_read_and_added_as_the_twin_says(device, taps):
    gpu, random, kernel = as_gpu(device), np.random.default_rng(2), interpolator(taps, 2.0)
    bins, columns, stride, origin, n_ranges = 5, 100, 500, 250, 130
    profiles = (random.standard_normal((bins, stride)) + 1j * random.standard_normal((bins, stride))).astype(
        np.complex64
    )
    cell = random.integers(-50, 50, (bins, 2)).astype(np.int32)
    line = random.uniform(-0.5, 0.5, (bins, 2, 4)).astype(np.float32)
    share, start = random.uniform(1, 2, n_ranges).astype(np.float32), np.full((6, n_ranges), 1 + 2j, np.complex64)
    wanted = np.empty((bins, columns), np.complex128)
    for q in range(bins):
        for i in range(columns):
            a, b, c, d = line[q, i // 64].astype(np.float64)
            at = np.array([origin + cell[q, i // 64] + a + b * (i % 64)])
            wanted[q, i] = share[20 + i] * straighten(profiles[q], at, np.array([c + d * (i % 64)]), kernel)[0]
    made = gpu.kernel("range_doppler.cl", "straighten_onto", VW=1, TAPS=taps, TERMS=kernel.terms, SEGMENT=64)
    for add in (1, 0):
        out = gpu.copied(start)
        gpu.run(
            made, (columns, bins), None,
            launch_numbers(
                "range_doppler.cl", "straighten_onto", stride=stride, origin=origin, begin=20, first=4, period=6,
                n_ranges=n_ranges, add=add,
            ),
            gpu.upload(profiles), gpu.upload(cell), gpu.upload(line), gpu.upload(kernel.table), gpu.upload(share), out,
        )  # fmt: skip
        got = gpu.download(out, np.empty_like(start))
        expected = start.astype(np.complex128)
        expected[(4 + np.arange(bins)) % 6, 20 : 20 + columns] = wanted + add * (1 + 2j)
        assert np.abs(got - expected).max() <= 2e-5 * np.abs(wanted).max()
        assert np.array_equal(got[3], start[3])  # the row that no bin falls on
