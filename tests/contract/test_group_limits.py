"""Every verb where the driver allows fewer work-items for each kernel than for its device: on a GPU of 256 items, 16 KB
of local memory and buffers of 4 MB, without float64."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import prod

import numpy as np
import pytest
from helpers.array_cases import SCENE, TONE, WINDOW, line, passing
from helpers.cases import noise_on, straight
from helpers.devices import opened, variants

import sarcl
from sarcl.opencl.device import Device

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
CIRCLE = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.02, n_pulses=24)
PASS = sarcl.Trajectory.line(start=(0, -60, 6e3), velocity=(0, 100, 0), prf=250, n_pulses=300)
PLANE = sarcl.ImageGrid.plane(shape=(70, 64), spacing=0.25)
LIMITS = 128, 64, 16
SLOW = pytest.mark.slow


class SmallGroups(Device):
    """A GPU whose driver allows `limit` work-items for each kernel, and refuses groups of more."""

    def __init__(self, device, limit):
        small = {"fp64": False, "fast_fp64": False, "local_memory": 2**14, "max_group": 256, "max_alloc": 2**22}
        super().__init__(replace(device.info, kind="gpu", vector_width=1, **small), device._raw)
        self.limit, self.groups = limit, {}

    def max_group(self, kernel):
        return min(self.limit, super().max_group(kernel))

    def run(self, kernel, size, group, *args, **options):
        if group is not None:
            assert prod(group) <= self.limit, (
                f"{kernel.function_name}: the driver allows {self.limit} items, not {group}"
            )
            self.groups[kernel.function_name] = prod(group)
        super().run(kernel, size, group, *args, **options)


@cache
def small_groups(limit):
    return SmallGroups(opened(variants(names=())[0].values[0]), limit)


def scattered(n=300, ground=0.0, extent=8.0):
    random = np.random.default_rng(0)
    places = random.uniform(-extent, extent, (n, 3)) * [1, 1, 0.1] + [ground, 0, 0]
    return sarcl.Scene.points(places, random.standard_normal(n) + 0j)


def ground(**material):
    axis = np.linspace(-2, 2, 6)
    return sarcl.Scene.from_heights(axis, axis, np.zeros((6, 6)), **material)


def strip():
    along = 60.0 * (np.arange(160) / 159 - 0.5)
    tx = np.stack([np.full(160, -2.8e3), along, np.full(160, 2.856e3)], axis=1)
    return noise_on(tx, n_samples=80, bandwidth=150e6, time=np.linspace(0, 0.6, 160))


def image(method, rows=70, **options):
    return lambda common: sarcl.backproject(noise_on(straight(rows)), PLANE, method=method, **options, **common)


# of each verb: what it computes, a kernel whose groups have items of their own, and how many of them within each limit
CASES = {
    "echo of points": (
        lambda common: sarcl.echo(scattered(), CHIRP, CIRCLE, tolerance=1e-3, **common), "spread", (64, 64, None),
    ),
    "echo of facets": (
        lambda common: sarcl.echo(ground(), CHIRP, CIRCLE, tolerance=1e-2, shadows=False, **common),
        "spread_facets", (64, 64, None),
    ),
    "echo of a rough ground": (
        lambda common: sarcl.echo(ground(roughness=0.02), CHIRP, CIRCLE, tolerance=1e-2, **common),
        "spread_facets", (64, 64, None),
    ),
    "factorised echo": (
        lambda common: sarcl.echo(scattered(2000), CHIRP, CIRCLE, tolerance=1e-2, method="factorized", **common),
        "expand", (64, 64, 16),
    ),
    "echo of an array": (
        lambda common: sarcl.echo(
            SCENE, TONE, passing(6), array=line(5, spacing=0.4), reference=(0, 0, 0), range_window=WINDOW,
            tolerance=1e-2, **common,
        ),
        "spread", (64, 64, None),
    ),
    "spectral echo": (
        lambda common: sarcl.spectral_echo(scattered(80, 8e3, 50.0), CHIRP, PASS, tolerance=1e-2, **common),
        "spread", (64, 64, None),
    ),
    "direct image": (image("direct", 2240, tolerance=1e-3), "backproject_shared_lines", (64, 64, 16)),
    "factorised image": (image("factorized", 400, tolerance=1e-2), None, ()),
    "polar format": (
        lambda common: sarcl.polar_format(noise_on(straight(60)), PLANE, tolerance=1e-2, **common),
        "spread", (64, 64, None),
    ),
    "range-Doppler": (
        lambda common: sarcl.range_doppler(strip(), tolerance=1e-2, **common), "columns", (64, 64, 16),
    ),
}  # fmt: skip


@pytest.mark.parametrize("limit", [pytest.param(128, marks=SLOW), pytest.param(64, marks=SLOW), 16])
@pytest.mark.parametrize("case", CASES)
def test_every_verb_keeps_its_tolerance_where_a_driver_allows_few_items(case, limit):
    make, kernel, items = CASES[case]
    device = small_groups(limit)
    device.groups.clear()
    report = make({"device": device, "check": True}).report
    assert report.measured_error <= report.predicted_error <= report.tolerance
    if kernel is not None:
        assert device.groups.get(kernel) == items[LIMITS.index(limit)]


@pytest.mark.parametrize("limit, items", [pytest.param(64, 32, marks=SLOW), (16, 16), (4, None)])
def test_sums_of_currents_are_the_same_with_few_items(limit, items):
    body, wave = sarcl.shapes.box((0.2, 0.3, 0.1)), sarcl.Waveform.chirp(center=0.6e9, bandwidth=2e8, duration=2e-8)
    track = sarcl.Trajectory(None, np.array([[40.0, 0, 0], [39.0, 9, 0], [38.0, 12, 3]]))
    device = small_groups(limit)
    device.groups.clear()
    some, most = (
        sarcl.fullwave_echo(body, wave, track, cells=8, anchors=1, model_error=False, check=False, device=d).samples
        for d in (device, small_groups(128))
    )
    assert device.groups.get("current_sums") == items
    assert np.linalg.norm(some[:] - most[:]) <= 1e-6 * np.linalg.norm(most[:])
