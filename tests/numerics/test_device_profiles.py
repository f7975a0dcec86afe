"""Range profiles made on a device, against those of the host."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import as_gpu

from sarcl.numerics import device_profiles, interpolation, range_profiles
from sarcl.numerics.device_profiles import DeviceProfiles, SpreadSamples

SINGLE, DOUBLE = np.complex64, np.complex128


def noise(rows, n, kind, seed=0):
    random = np.random.default_rng(seed)
    return (random.standard_normal((rows, n)) + 1j * random.standard_normal((rows, n))).astype(kind)


def made_on(gpu, maker, samples, weight):
    out = maker.make(gpu.upload(samples), samples.dtype, gpu.upload(maker.weights(weight)), len(samples))
    return gpu.download(out, np.empty((len(samples), maker.stride), maker.dtype))


# odd and even numbers of samples, one sample, padding longer than the profile; powers of two and other lengths
CASES = [
    (7, 20, 3, SINGLE, SINGLE), (8, 20, 45, SINGLE, DOUBLE), (1, 16, 8, SINGLE, SINGLE), (16, 16, 0, SINGLE, SINGLE),
    (8, 64, 10, SINGLE, SINGLE), (9, 64, 10, DOUBLE, SINGLE), (8, 64, 130, DOUBLE, DOUBLE),
]  # fmt: skip


@pytest.mark.parametrize("n_samples, length, pad, dtype, kind", CASES)
def test_profiles_of_the_device_are_those_of_the_host(device, n_samples, length, pad, dtype, kind):
    if not device.info.fp64 and DOUBLE in (dtype, kind):
        pytest.skip("no float64")
    gpu = as_gpu(device, transform=2 * length)  # rows of a block in parts, the last one short
    random = np.random.default_rng(1)
    across, along = random.uniform(-1, 1, n_samples), random.uniform(0.1, 3, 5)
    samples = noise(5, n_samples, kind)
    maker = DeviceProfiles(gpu, across, length, pad, dtype)
    assert device_profiles.possible(gpu, length, dtype) and maker.holds(samples, along)
    wanted = range_profiles.from_samples(
        None, samples.astype(DOUBLE), along[:, None] * across, length, pad, dtype=DOUBLE
    )
    for rows in (slice(0, 5), slice(1, 4)):  # fewer rows in the buffers of more
        got = made_on(gpu, maker, samples[rows], along[rows])
        error = np.linalg.norm(got - wanted[rows]) / np.linalg.norm(wanted[rows])
        assert error <= (4e-7 if dtype == SINGLE else 1e-15)
        if pad:
            assert np.array_equal(got[:, :pad], got[:, length : length + pad])  # the other end, bit by bit
            assert np.array_equal(got[:, -pad:], got[:, pad : 2 * pad])


def test_weights_of_profiles_are_rounded_once(device):
    # a spectrum of one sample is a constant: the product of three numbers, without an error of the FFT
    gpu, random = as_gpu(device), np.random.default_rng(3)
    across, along, samples = random.uniform(1, 2, 1), random.uniform(1, 2, 400), noise(400, 1, SINGLE)
    got = made_on(gpu, DeviceProfiles(gpu, across, 16, 0), samples, along)[:, 3]
    exact = samples[:, 0].astype(DOUBLE) * along * across
    for part in (np.real, np.imag):
        assert (np.abs(part(got) - part(exact)) <= 1.01 * 2.0**-24 * np.abs(part(exact))).all()


def test_what_the_sums_of_the_device_do_not_hold_is_left_to_the_host(device):
    gpu = as_gpu(device)
    ones, samples = np.ones(2), noise(2, 8, SINGLE)
    maker = DeviceProfiles(gpu, np.ones(8), 20, 2)
    assert maker.holds(samples, ones)
    for factor, wanted in ((1e20, True), (1e24, False), (1e33, False)):
        assert maker.holds(samples * np.float32(factor), ones) is wanted
        assert maker.holds(-samples * np.float32(factor), ones) is wanted
    assert not maker.holds(samples, 1e19 * ones) and not maker.holds(samples, 1e-19 * ones)
    assert not DeviceProfiles(gpu, np.full(8, 1e19), 20, 2).holds(samples, ones)
    assert maker.holds(samples.astype(DOUBLE), ones) is gpu.info.fp64
    assert not maker.holds(samples.astype(np.clongdouble), ones)
    assert not device_profiles.possible(gpu, 20, DOUBLE)  # reikna's error grows with lengths that are no power of two
    assert device_profiles.possible(gpu, 64, DOUBLE) is gpu.info.fp64
    if device.is_cpu:
        assert not device_profiles.possible(device, 64, SINGLE)


def test_the_rows_that_fit_are_the_most_whose_bytes_do(device):
    maker = DeviceProfiles(as_gpu(device), np.ones(1000), 2048, 8)
    for nbytes in (1e5, 1e6, 1e8, 1e9):
        rows = maker.rows_in(nbytes)
        assert maker.nbytes(rows) <= nbytes < maker.nbytes(rows + 1)
    assert maker.nbytes(1) >= 8 * (2048 + 16 + 2048)


@pytest.mark.parametrize("n_samples, length, parts", [(37, 80, 3), (8, 64, 1), (1, 16, 2)])
def test_samples_of_spread_profiles_are_those_of_the_host(device, n_samples, length, parts):
    gpu, kernel = as_gpu(device, transform=2 * length), interpolation.interpolator(4, 2.0)
    samples = SpreadSamples(gpu, n_samples, kernel, length)
    stride = length + 2 * range_profiles.padding(kernel)
    for rows in (5, 3):
        sums = noise(parts * rows * 3, stride, SINGLE, seed=rows).reshape(parts, rows, 3, stride)
        sums[:, :, 2] *= np.float32(1e-3)
        sums[:, :, 1] += 1e3 * (np.arange(parts) - (parts - 1) / 2)[:, None, None]  # parts that cancel
        total = sums[:, :, 1:].sum(axis=(0, 2), dtype=DOUBLE).astype(SINGLE)
        wanted = range_profiles.to_samples(None, total, n_samples, kernel)
        got = samples.of(gpu.upload(sums), parts, rows)
        assert got.shape == (rows, n_samples) and got.dtype == SINGLE
        assert np.linalg.norm(got - wanted) <= 5e-7 * np.linalg.norm(wanted)
        if device.is_cpu:
            host = SpreadSamples(device, n_samples, kernel, length)
            assert np.array_equal(host.of(device.upload(sums), parts, rows), wanted) and host.row_bytes == 0
