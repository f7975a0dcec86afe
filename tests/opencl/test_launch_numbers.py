"""Structs by value: every number arrives where its name says, on every device; other names are refused."""

import re

import numpy as np
import pytest
from helpers.kernel_probe import placed

from sarcl.opencl import launch_numbers as module
from sarcl.opencl.launch_numbers import launch_numbers

PROBE = """
typedef struct {
    int a, b;  // a comment; with a semicolon
    float eye[3];
    ulong far;
    int last;
    float ratio;
} probe_numbers;

__kernel void probe(probe_numbers given, __global float *out) {
    size_t i = get_global_id(0);
    out += 8 * i;
    out[0] = given.a;
    out[1] = given.b;
    vstore3(vload3(0, given.eye), 0, out + 2);
    out[5] = (float)(given.far >> 32);
    out[6] = given.last;
    out[7] = given.ratio;
}
"""
VALUES = {"last": -3, "a": 1, "b": 2**31 - 1, "eye": [0.5, -1.5, 2.0], "far": 5 * 2**32 + 7, "ratio": 0.25}


@pytest.fixture
def probe(monkeypatch):
    placed(monkeypatch, "probe.cl", PROBE)
    module._layout.cache_clear()
    yield
    module._layout.cache_clear()


def test_every_number_arrives_where_its_name_says(device, probe):
    given = launch_numbers("probe.cl", "probe", **VALUES)
    assert given.nbytes == 40
    out = device.zeros(4 * 8 * 3)
    device.run(device._build("probe.cl", {})["probe"], (3,), None, given, out)
    wanted = [1, np.float32(2**31 - 1), 0.5, -1.5, 2, 5, -3, 0.25]
    assert np.array_equal(device.download(out, np.empty((3, 8), np.float32)), np.tile(np.float32(wanted), (3, 1)))


def test_other_names_and_numbers_that_do_not_fit_are_refused(probe):
    with pytest.raises(TypeError, match=re.escape("probe_numbers of probe.cl: missing ['a'], unknown ['c']")):
        launch_numbers("probe.cl", "probe", **{**{k: v for k, v in VALUES.items() if k != "a"}, "c": 1})
    with pytest.raises(OverflowError):
        launch_numbers("probe.cl", "probe", **{**VALUES, "b": 2**31})
    with pytest.raises(TypeError, match=re.escape("kernels/probe.cl has no `typedef struct { ... } other_numbers;`")):
        launch_numbers("probe.cl", "other")
