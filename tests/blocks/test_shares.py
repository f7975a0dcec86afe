"""Several devices share the bands of an image: simulated devices, whose speeds are known."""

from __future__ import annotations

import heapq
import threading

import numpy as np
import pytest
from helpers.cases import noise_history
from helpers.devices import as_gpu

import sarcl
from sarcl.blocks._shares import Shares, Worker
from sarcl.imaging import backproject as backproject_file
from sarcl.imaging.engine import RowProfiles
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device


class Bands:
    """A tiling of bands of `width` pixels."""

    def __init__(self, width=1000):
        self.width = width

    def count(self, first, last):
        return (last - first) * self.width


def simulate(speeds, *, rates=None, todo=((0, 400),), profiles=0.0, least=0.0, most=float("inf"), unit=1, ends=None):
    """Devices of so many pixels per second, which need `profiles` seconds before each block: their blocks, and when
    each ends. rates: what is believed of the speeds beforehand."""
    n, time = len(speeds), 0.0
    devices = [Worker(end, least, rate) for end, rate in zip(ends or [set()] * n, rates or speeds, strict=True)]
    shares = Shares(Bands(), list(todo), devices, most=most, unit=unit, now=lambda: time)
    blocks, end, running = [[] for _ in range(n)], [0.0] * n, {}
    events = [(0.0, k) for k in range(n)]
    while events:
        time, k = heapq.heappop(events)
        end[k] = time
        for j, (begun, pixels, before) in running.items():  # progress of the others, as far as they have reported it
            if j != k:
                shares.made(j, before + min(max(time - begun - profiles, 0) * speeds[j], pixels))
        block = shares.take(k)
        running.pop(k, None)
        if block:
            pixels = Bands().count(*block)
            running[k] = time, pixels, sum(Bands().count(*b) for b in blocks[k])
            blocks[k].append(block)
            heapq.heappush(events, (time + profiles + pixels / speeds[k], k))
    made = sorted(b for part in blocks for b in part)
    assert [band for a, b in made for band in range(a, b)] == [band for a, b in todo for band in range(a, b)]
    return blocks, end


def test_alike_devices_take_one_block_each_where_a_second_is_not_worth_its_profiles():
    for n in (2, 3, 4):
        blocks, end = simulate([1e4] * n, least=1e5)
        assert [len(b) for b in blocks] == [1] * n
        assert max(end) <= 1.02 * 40 / n


def test_the_rest_of_large_shares_corrects_what_was_believed():
    speeds = [1e4, 1.3e4]  # believed to be alike: the same card, at another clock
    blocks, end = simulate(speeds, rates=[1, 1], least=1e3)
    assert max(end) <= 1.1 * 4e5 / sum(speeds) and max(len(b) for b in blocks) <= 6


@pytest.mark.parametrize("wrong", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("ratio", [2.0, 20.0, 200.0])
def test_a_slow_device_beside_a_fast_one_does_not_end_last_by_much(ratio, wrong):
    speeds = [1e5, 1e5 / ratio]
    blocks, end = simulate(speeds, rates=[1, wrong / ratio], todo=[(0, 4000)], least=1e4)
    ideal = 4e6 / sum(speeds)
    assert max(end) <= 1.1 * ideal
    assert len(blocks[0]) + len(blocks[1]) <= 16


def test_a_device_that_would_take_less_than_half_a_block_takes_none():
    blocks, end = simulate([1e6, 1e2], todo=[(0, 40)], least=1e9)
    assert blocks == [[(0, 40)], []]
    assert max(end) <= 1.1 * 40e3 / 1e6
    blocks, end = simulate([1e2, 1e6], todo=[(0, 40)], least=1e9)  # also where it asks first
    assert blocks[0] == [] and sum(b - a for a, b in blocks[1]) == 40


def test_profiles_cost_a_tenth_at_most():
    # a block of the least size takes ten times as long as the profiles before it
    for n in (2, 3):
        _, end = simulate([1e4] * n, profiles=0.1, least=1e4)
        assert max(end) <= 1.15 * 40 / n


def test_blocks_end_where_they_must():
    todo = [(0, 37), (50, 211), (300, 400)]
    blocks, _ = simulate([1e4, 3e4], todo=todo, ends=[{20, 60, 100}, {150}], unit=4, least=1e3)
    for block, ends in zip(blocks, ({20, 60, 100}, {150}), strict=True):
        assert not any(a < end < b for a, b in block for end in ends)
    starts = {a for part in blocks for a, _ in part}
    assert all(a % 4 == 0 for a in starts - {0, 50, 300, 150})
    blocks, _ = simulate([1e4, 3e4], most=2e4)
    assert all(b - a <= 20 for part in blocks for a, b in part)
    one, _ = simulate([1e4, 1e4], todo=[(7, 8)])  # a single band is made by one of them
    assert sorted(map(len, one)) == [0, 1]
    assert simulate([1e4, 1e4], todo=[])[0] == [[], []]


def test_two_alike_devices_make_the_profiles_of_each_row_once_each(monkeypatch):
    first = open_device()
    pair, made = [first, Device(first.info, first._raw)], {}
    upload, both_have_work = RowProfiles.upload, threading.Barrier(2, timeout=60)

    def counted(self, start, stop):
        if self.device not in made:
            both_have_work.wait()  # neither makes all blocks before the other has begun
        made[self.device] = made.get(self.device, 0) + stop - start
        return upload(self, start, stop)

    monkeypatch.setattr(RowProfiles, "upload", counted)
    raw = noise_history(n_rows=64, n_samples=512)
    grid = sarcl.ImageGrid.plane(shape=(400, 300), spacing=0.03)
    both = sarcl.backproject(raw, grid, tolerance=1e-2, method="direct", device=pair, check=False)
    assert made == {pair[0]: 64, pair[1]: 64}
    one = sarcl.backproject(raw, grid, tolerance=1e-2, method="direct", device=first, check=False)
    assert np.array_equal(both.data, one.data)


def test_speeds_are_measured_where_devices_differ(monkeypatch):
    first, asked = open_device(), []
    same, other = Device(first.info, first._raw), as_gpu(first)

    class Stop(Exception):
        pass

    def stop(*given):
        asked.append(given[-1])
        raise Stop

    monkeypatch.setattr(backproject_file, "LocalWorkers", stop)
    monkeypatch.setattr(backproject_file, "speed", {first: 3.0, other: 7.0}.__getitem__)
    raw, grid = noise_history(), sarcl.ImageGrid.plane(shape=8, spacing=0.03)
    for pair in ([first, same], [first, other]):
        with pytest.raises(Stop):
            sarcl.backproject(raw, grid, device=pair)
    assert asked == [[1.0, 1.0], [3.0, 7.0]]
