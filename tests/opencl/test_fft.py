"""Transforms on a GPU are cut into batches, whose launches are short."""

from __future__ import annotations

import itertools
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers.devices import as_gpu

from sarcl.opencl import fft
from sarcl.opencl.device import Device, Limits


def noise(rows, length):
    random = np.random.default_rng(1)
    return (random.standard_normal((rows, length)) + 1j * random.standard_normal((rows, length))).astype(np.complex64)


@pytest.fixture
def planned(monkeypatch):
    """Shapes of the batches, in their order."""
    shapes, plan = [], fft.compiled_plan

    def seen(device, shape, kind):
        shapes.append(shape)
        return plan(device, shape, kind)

    seen.cache_clear = plan.cache_clear
    monkeypatch.setattr(fft, "compiled_plan", seen)
    return shapes


@pytest.mark.parametrize("inverse", [False, True])
def test_rows_in_batches_are_those_of_one_batch_to_the_bit(device, planned, inverse):
    data = noise(13, 96)
    whole = fft.rows(as_gpu(device), data, inverse=inverse)
    planned.clear()
    assert np.array_equal(fft.rows(as_gpu(device, transform=4 * 96 + 5), data, inverse=inverse), whole)
    assert planned == 4 * [(4, 96)]  # of the last batch three rows are not used


def test_batches_are_smaller_on_slow_devices(device):
    fast, slow, slowest = (Device(replace(device.info, kind="gpu", rate=r), device._raw) for r in (1e12, 1e9, 1e3))
    assert fft.rows_at_once(fast, 1024) == fast.limits.transform // 1024
    assert fft.rows_at_once(slow, 1024) == int(fft.LASTS * 1e9 / fft.SAMPLE) // 1024 < fft.rows_at_once(fast, 1024)
    assert fft.rows_at_once(slowest, 1024) == 1


def test_a_launch_that_lasts_long_makes_the_next_batches_smaller(device, monkeypatch, planned):
    gpu, data = Device(replace(device.info, kind="gpu"), device._raw, Limits(transform=16 * 64)), noise(40, 64)
    monkeypatch.setattr(fft, "lasted", lambda event, enqueued: fft.LASTS * planned[-1][0] / 5)  # five rows in fft.LASTS
    made = fft.reikna_rows(gpu, data, False)
    assert np.linalg.norm(made - np.fft.fft(data)) <= 1e-6 * np.linalg.norm(made)
    assert planned == [(16, 64), *5 * [(5, 64)]]
    assert fft.rows_at_once(gpu, 64) == 5 and fft.rows_at_once(gpu, 128) == 2


def test_good_lengths_have_small_factors_and_are_the_least():
    powers = itertools.product(*(factor ** np.arange(14) for factor in (2, 3, 5, 7, 11)))
    lengths = np.unique([int(np.prod(each)) for each in powers if np.prod(np.array(each, float)) < 1e4])
    for n in (*range(1, 2000), 2049, 4001):
        assert fft.good_length(n) == lengths[np.searchsorted(lengths, n)]


@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
@pytest.mark.parametrize("inverse", [False, True])
def test_many_rows_have_the_bits_of_scipy_fft(dtype, inverse):
    import scipy.fft

    data = noise(40, 99).astype(dtype)
    wanted = scipy.fft.ifft(data, norm="forward") if inverse else scipy.fft.fft(data)
    np.testing.assert_array_equal(fft.rows(None, data, inverse=inverse), wanted)
    buffer = data.copy()
    np.testing.assert_array_equal(fft.rows(None, buffer, inverse=inverse, overwrite=True), wanted)


PROCESS = """
import sys
from importlib.machinery import PathFinder
import numpy as np
from sarcl.opencl import fft
find_spec = PathFinder.find_spec
if sys.argv[1] == "elsewhere":
    PathFinder.find_spec = lambda name, *others: None if name == "pypocketfft" else find_spec(name, *others)
data = np.exp(1j * np.arange(4000).reshape(40, 100) ** 2).astype(np.complex64)
forward, inverse = fft.rows(None, data), fft.rows(None, data, inverse=True)
assert ("scipy.special" in sys.modules) == (sys.argv[1] == "elsewhere")
import scipy.fft
assert (forward == scipy.fft.fft(data)).all()
assert (inverse == scipy.fft.ifft(data, norm="forward")).all()
"""


@pytest.mark.parametrize("extension", ["in its place", "elsewhere"])
def test_scipy_fft_is_imported_only_where_its_extension_is_elsewhere(extension):
    subprocess.run([sys.executable, "-c", PROCESS, extension], check=True)
