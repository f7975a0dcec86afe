"""FFTs of rows and columns on a device, and what weighs samples there, against their twins in float64."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import as_gpu

from sarcl.numerics.transforms import Transforms
from sarcl.numerics.weighted_samples import WeightedSamples
from sarcl.opencl import fft
from sarcl.opencl.pipeline import Pipeline
from sarcl.reference.transposition import columns, lay
from sarcl.reference.weighted_samples import turned


def noise(shape, kind=np.complex64, seed=0):
    random = np.random.default_rng(seed)
    return (random.standard_normal(shape) + 1j * random.standard_normal(shape)).astype(kind)


@pytest.fixture
def still(monkeypatch):
    """FFTs that leave rows as they are."""
    monkeypatch.setattr(fft, "in_place", lambda *given: None)


# rows folded and padded; fewer and more than a group of 8; one column, all of them; bins that wrap on both sides
@pytest.mark.parametrize("n_rows, length", [(11, 20), (20, 20), (50, 20), (9, 3)])
@pytest.mark.parametrize("first, count, n, origin, sign", [(0, 13, 20, 0, 1), (5, 8, 17, 9, -1), (12, 1, 1, -3, 1)])
def test_columns_are_taken_and_laid_as_the_twins_say(device, still, n_rows, length, first, count, n, origin, sign):
    gpu, array, n = as_gpu(device), noise((n_rows, 13)), min(n, length)
    weights = np.random.default_rng(1).uniform(1, 2, n).astype(np.float32)
    made = Transforms(gpu, length, count)
    made.columns(gpu.upload(array), array.shape, first, count)
    taken = gpu.download(made._work, np.empty((count, length), np.complex64))
    wanted = columns(array, first, count, length)
    if n_rows <= length:
        assert np.array_equal(taken, wanted)
    assert np.abs(taken - wanted).max() <= 1e-6 * np.abs(wanted).max()
    out = gpu.copied(noise((n, count + 4), seed=2))
    made.lay(out, count + 4, 3, count, (gpu.copied(weights), n), origin, sign)
    got = gpu.download(out, np.empty((n, count + 4), np.complex64))
    assert np.array_equal(got[:, 3 : 3 + count], lay(taken, weights, origin, sign))
    assert np.array_equal(got[:, :3], noise((n, count + 4), seed=2)[:, :3])  # what is beside is kept
    assert np.array_equal(got[:, 3 + count :], noise((n, count + 4), seed=2)[:, 3 + count :])


def test_rows_are_taken_from_the_middle_of_a_buffer(device, still):
    gpu, array = as_gpu(device), noise((9, 21))
    made = Transforms(gpu, 21, 4)
    made.rows(gpu.upload(array), 3, 4)
    assert np.array_equal(gpu.download(made._work, np.empty((4, 21), np.complex64)), array[3:7])


@pytest.mark.parametrize("sign", [1, -1])
def test_columns_are_transformed_in_their_place_in_batches(device, sign):
    array, length = noise((24, 10)), 24
    gpu = as_gpu(device, transform=4 * length)
    buffer, made = gpu.copied(array), Transforms(gpu, length, 10)
    ones = gpu.copied(np.ones(length, np.float32)), length
    assert made.most == 4 and made.nbytes == 4 * (8 * length + fft.temporary_bytes(length, np.complex64))
    for first in range(0, 10, made.most):
        count = min(made.most, 10 - first)
        made.columns(buffer, array.shape, first, count)
        made.lay(buffer, 10, first, count, ones, 0, sign)
    got = gpu.download(buffer, np.empty_like(array))
    wanted = np.fft.fft(array, axis=0) if sign > 0 else length * np.fft.ifft(array, axis=0)
    assert np.linalg.norm(got - wanted) <= 1e-6 * np.linalg.norm(wanted)


def test_fewer_rows_are_transformed_at_a_time_in_fewer_bytes(device):
    row = 8 * 24 + fft.temporary_bytes(24, np.complex64)
    assert [Transforms(as_gpu(device), 24, 10, n * row).most for n in (0.5, 1, 3.5, 99)] == [1, 1, 3, 10]


@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
@pytest.mark.parametrize("wide", [True, False])
def test_samples_are_weighed_and_turned_as_the_twin_says(device, kind, wide):
    gpu = as_gpu(device if wide else device.without_fp64())
    if kind == np.complex128 and not gpu.info.fp64:
        pytest.skip("no float64")
    n, rows, random = 70000, 3, np.random.default_rng(4)  # so many samples that single numbers do not hold the cycles
    samples, across, along = noise((rows, n), kind), random.uniform(0.5, 2, n), random.uniform(0.5, 2, rows)
    first, step = random.uniform(0, 1, rows), random.uniform(0, 1, rows)
    made = WeightedSamples(gpu, across, rows, samples.dtype)
    wanted = turned(samples, along, across, first, step)
    bound, largest = made.bound(samples, along), np.abs(wanted).max()
    assert largest <= bound <= 5 * largest and made.bound(samples, 0 * along) == 0
    out = gpu.copied(np.zeros((rows + 1, n), np.complex64))
    with Pipeline(gpu) as pipeline:
        pipeline.new_block()
        made.make(pipeline, samples, along, (first, step), out, 1)
    got = gpu.download(out, np.empty((rows + 1, n), np.complex64))
    assert not got[0].any()
    assert np.abs(got[1:] - wanted).max() <= 1.5e-6 * np.abs(wanted).max()
    made.add_energy(out, 1, slice(0, 2), bound)
    made.add_energy(out, 3, slice(2, 3), bound)
    made.add_energy(out, 1, slice(0, 1), 1e3)  # again, at another scale: a row counts once
    assert made.energy() == pytest.approx((np.abs(wanted) ** 2).sum(), rel=2e-6)


@pytest.mark.parametrize("size", [1e-18, 1e14])
def test_squares_beyond_single_numbers_are_summed(device, size):
    gpu, given = as_gpu(device), (noise((2, 40)) * np.float32(size)).astype(np.complex64)
    made = WeightedSamples(gpu, np.ones(40), 2, given.dtype)
    made.add_energy(gpu.upload(given), 0, slice(0, 2), 6 * size)
    assert made.energy() == pytest.approx((np.abs(given.astype(np.complex128)) ** 2).sum(), rel=1e-6)


def test_weighted_samples_that_sums_may_not_hold_are_the_hosts(device):
    gpu, ones = as_gpu(device), np.ones(3)
    made = WeightedSamples(gpu, np.ones(50), 3, np.dtype(np.complex64))
    # of all rows: a third of what device_profiles sums
    for factor, wanted in ((1e20, True), (1e23, False), (1e-24, True), (1e-27, False), (0, True)):
        assert (made.bound(noise((3, 50)) * np.float32(factor), ones) is not None) is wanted
    assert made.bound(noise((3, 50)), 1e19 * ones) is None
    assert made.bound(noise((3, 50), np.clongdouble), ones) is None
