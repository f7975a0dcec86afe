"""Launches on GPUs are cut into short parts; what the parts compute is what one launch computes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import noise_history

import sarcl
from sarcl.opencl import _launches
from sarcl.opencl._launches import FIRST, LASTS, Launches, fixed_axes, in_groups
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device

WATCHDOG = 0.3  # s, that no launch should take


CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
PLACES = np.stack([np.full(24, -7e3), np.linspace(-9, 9, 24), np.full(24, 5e3)], axis=1)
TRACK = sarcl.Trajectory(np.linspace(0, 1, 24), PLACES)


class Gpu:
    """A simulated queue: a step takes 1/rate s, a launch at least 5 us; it ends while the host waits for it."""

    def __init__(self, rate):
        self.rate, self.each, self.parts, self.waits = rate, 1.0, [], 0

    def enqueue(self, size, offset):
        seconds = 5e-6 + math.prod(size) * self.each / self.rate
        self.parts.append((size, offset, seconds))
        return Event(self, seconds)


class Event:
    def __init__(self, gpu, seconds):
        self.gpu, self.command_execution_status = gpu, 1
        self.profile = type("Profile", (), {"start": 0, "end": int(seconds * 1e9)})

    def wait(self):
        self.gpu.waits += 1
        self.command_execution_status = 0


def launched(gpu, launches, size, group=None, fixed=frozenset(), steps=1.0):
    """Parts of one launch of a kernel: (size, offset, seconds)."""
    gpu.parts, gpu.each = [], steps
    launches.launch("kernel", size, group, fixed, steps, gpu.enqueue, lambda: None)
    return gpu.parts


@pytest.mark.parametrize("rate", [1e7, 1e9, 1e11, 1e13])
@pytest.mark.parametrize("size, group", [((10**7,), None), ((64, 10**6), (64, 1)), ((2**22, 7), (256, 1))])
def test_no_part_is_long_whatever_the_speed_and_all_work_items_run_once(rate, size, group):
    gpu, launches = Gpu(rate), Launches()
    for steps in (1.0, 50.0, 4000.0):
        if math.prod(size) * steps / rate > 3000:
            continue
        parts = launched(gpu, launches, size, group, steps=steps)
        assert max(seconds for *_, seconds in parts) <= WATCHDOG
        axis = max(range(len(size)), key=lambda i: (size[i] // (group[i] if group else _launches.ALONG ** (i == 0)), i))
        at = 0
        for part, offset, _ in parts:
            assert (offset or (0,) * len(size))[axis] == at
            assert [n for i, n in enumerate(part) if i != axis] == [n for i, n in enumerate(size) if i != axis]
            at += part[axis]
        assert at == size[axis]
        # once the speed is known, parts are as long as they may be: few are needed
        assert len(parts) <= 12 + 1.5 * math.prod(size) * steps / rate / LASTS


def test_a_kernel_that_is_known_to_be_short_is_launched_whole_and_not_timed():
    gpu, launches = Gpu(1e12), Launches()
    launched(gpu, launches, (10**6,))
    waits = gpu.waits
    for _ in range(10):
        assert [part[:2] for part in launched(gpu, launches, (10**6,))] == [((10**6,), None)]
    assert gpu.waits <= waits + 2


def test_groups_stay_whole_and_fixed_axes_are_not_cut():
    gpu = Gpu(1e6)
    for size, _, _ in launched(gpu, Launches(), (96 * 1000, 3), (96, 1), steps=100.0):
        assert size[0] % 96 == 0 and size[1] == 3
    assert {size[1] for size, *_ in launched(gpu, Launches(), (2000, 30), fixed=frozenset({1}), steps=1e4)} == {30}
    assert len(launched(gpu, Launches(), (2000, 30), fixed=frozenset({0, 1}), steps=1e4)) == 1


@pytest.mark.parametrize("n", [1487, 11195, 8423, 3863, 2 * 131071])
def test_launches_that_no_warp_divides_are_whole_groups_and_a_rest(n):
    (first, many), (rest, few) = in_groups((n, 3), None, frozenset())
    assert (first, many + few, rest) == (0, n, many) and many % 256 == 0 and 0 < few < 256
    for size, group, fixed in (((n, 3), (1, 1), ()), ((n,), None, (0,)), ((8192,), None, ()), ((227,), None, ())):
        assert in_groups(size, group, frozenset(fixed)) == [(0, size[0])]


def test_axes_whose_size_a_kernel_asks_for_are_found():
    assert fixed_axes("int n = get_global_size(0), g = get_group_id(2), i = get_global_id(1);") == {0, 2}


def test_a_driver_without_a_clock_is_timed_by_the_host(monkeypatch):
    import pyopencl

    class Clockless:
        @property
        def profile(self):
            raise pyopencl.RuntimeError("clGetEventProfilingInfo failed: PROFILING_INFO_NOT_AVAILABLE", -7)

    monkeypatch.setattr(_launches.time, "perf_counter", lambda: 12.5)
    assert _launches.lasted(Clockless(), 12.0) == 0.5


def gpu_of(device):
    """A device that says it is a GPU."""
    return Device(replace(device.info, kind="gpu", vector_width=1), device._raw)


def images(device):
    """Results of many kernels."""
    raw, grid = noise_history(), sarcl.ImageGrid.plane(shape=(40, 33), spacing=0.2)
    points = sarcl.Scene.points(np.random.default_rng(1).uniform(-4, 4, (50, 3)), np.ones(50))
    made = [sarcl.backproject(raw, grid, device=device, tolerance=t, check=False).data for t in (1e-2, 1e-5)]
    made.append(sarcl.echo(points, CHIRP, TRACK, device=device).samples)
    made.append(sarcl.beam(sarcl.AntennaArray.linear(5, spacing=0.01), 1e10, times=np.linspace(0, 1e-9, 40),
                           positions=np.random.default_rng(2).uniform(100, 200, (70, 3)), device=device))  # fmt: skip
    return made


@pytest.mark.slow
def test_results_of_cut_launches_are_those_of_whole_ones_to_the_bit(monkeypatch):
    first = open_device()
    if not first.is_cpu:
        pytest.skip("the first device is no CPU")
    whole, parts = images(gpu_of(first)), []
    for name, little in (("FIRST", 16.0), ("LASTS", 2e-5), ("ALONG", 8)):
        monkeypatch.setattr(_launches, name, little)
    launch = Launches.launch

    def counted(self, kernel, size, group, fixed, steps, enqueue, flush):
        def part(size, offset):
            parts.append((kernel.function_name, offset is not None))
            return enqueue(size, offset)

        return launch(self, kernel, size, group, fixed, steps, part, flush)

    monkeypatch.setattr(Launches, "launch", counted)
    cut = images(gpu_of(first))
    assert all(np.array_equal(a, b) for a, b in zip(cut, whole, strict=True))
    assert {"backproject", "tile_constants", "spread"} <= {name for name, is_cut in parts if is_cut}
    assert FIRST == 2.0**20
