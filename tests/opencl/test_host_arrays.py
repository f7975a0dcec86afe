"""Arrays whose memory a buffer of a CPU device shares live as long as kernels may read them, and no longer."""

import gc
import weakref

import numpy as np
import pytest

from sarcl.opencl.choose_device import open_device

KERNEL = """
__kernel void slow(__global const int *from, int n, __global int *out) {
    int i = get_global_id(0), x = 0;
    for (int k = 0; k < n; k++) x = (x * 3 + from[(i + k) % 4096]) & 0xFFFF;
    out[i] = x;
}
"""


@pytest.fixture
def device():
    """A CPU device."""
    device = open_device()
    if not device.is_cpu:
        pytest.skip("buffers of other devices are copies")
    device.finish()
    return device


def slow(device, monkeypatch):
    monkeypatch.setattr("sarcl.opencl.device.source", lambda file: KERNEL)
    return device._build("slow.cl", {})["slow"]


def uploaded(device, values):
    """A buffer, and a reference that dies with the array whose memory it shares."""
    array = np.array(values)
    return device.upload(array), weakref.ref(array)


def test_an_array_that_is_dropped_while_a_kernel_reads_it_is_kept_until_the_kernel_has_ended(device, monkeypatch):
    kernel, values = slow(device, monkeypatch), np.arange(4096, dtype=np.int32) % 7
    out, results = device.empty(4 * 64), []
    for drops in (False, True):
        buffer, array = uploaded(device, values)
        device.run(kernel, (64,), None, buffer, 200_000, out)
        if drops:
            del buffer
            gc.collect()
            assert array() is not None
            rubbish = [np.full(4096, 99, np.int32) for _ in range(50)]  # takes memory that is free
        results.append(device.download(out, np.empty(64, np.int32)))
    assert array() is None
    assert np.array_equal(*results) and rubbish


def test_an_array_that_no_kernel_can_read_any_more_is_freed_at_once(device, monkeypatch):
    kernel, out = slow(device, monkeypatch), device.empty(4 * 64)
    buffer, array = uploaded(device, np.zeros(4096, np.int32))
    del buffer
    assert array() is None
    buffer, array = uploaded(device, np.zeros(4096, np.int32))
    device.run(kernel, (64,), None, buffer, 10, out)
    device.finish()
    del buffer
    assert array() is None


@pytest.mark.parametrize("nbytes", [1, 4, 20, 48, 4099])
def test_zeros_are_zero_whatever_the_size(device, nbytes):
    rubbish = device.empty(nbytes)
    device.write(rubbish, np.full(nbytes, 255, np.uint8))
    del rubbish
    assert not device.download(device.zeros(nbytes), np.empty(nbytes, np.uint8)).any()
