"""One image by several devices: one plan, one queue of tiles, one result."""

from __future__ import annotations

import os
import threading
import time

import numpy as np
import pytest
from helpers.cases import image_error, noise_history, quick_of

import sarcl
from sarcl.blocks.workers import cut
from sarcl.imaging.direct.direct import Direct
from sarcl.imaging.tiling.plane import PlaneTiling
from sarcl.opencl.choose_device import open_device, open_devices
from sarcl.opencl.device import Device
from sarcl.opencl.device_list import devices
from sarcl.opencl.failures import DeviceFailed

GRID = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(700, 301), spacing=(0.03, 0.02))


@pytest.fixture(scope="module")
def raw():
    return noise_history(n_samples=16)


@pytest.fixture
def pair():
    """Two devices: those of the machine where it has several, else one and its twin without float64."""
    working = [info.index for info in devices() if info.works]
    first = open_device(working[0])
    return [first, open_device(working[1]) if len(working) > 1 else first.without_fp64()]


def no_threads_left():
    return [
        t.name for t in threading.enumerate() if t is not threading.main_thread() and not t.name.startswith("pytest")
    ]


def reported(raw, **options):
    """The image of GRID, and what it reported of its progress."""
    calls = []
    return sarcl.backproject(raw, GRID, progress=lambda *a: calls.append(a), **options), calls


@pytest.mark.parametrize("tolerance", quick_of([1e-5], [1e-2, 1e-5]))
def test_two_devices_make_the_image_of_one(raw, pair, tolerance):
    one = sarcl.backproject(raw, GRID, tolerance=tolerance, method="direct", device=pair[0])
    both = sarcl.backproject(raw, GRID, tolerance=tolerance, method="direct", device=pair)
    # one plan: what differs is the rounding of float32 and of wide numbers, the least error that can be asked for
    assert np.linalg.norm(both.data - one.data) <= 1e-6 * np.linalg.norm(one.data)
    assert both.report.plan == one.report.plan and both.report.predicted_error == one.report.predicted_error
    assert both.report.contributions_done == one.report.contributions_done
    assert both.report.contributions_skipped == one.report.contributions_skipped
    assert both.report.device == f"{pair[0].info.name} + {pair[1].info.name}"
    small = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(90, 70), spacing=(0.03, 0.02))
    image = sarcl.backproject(raw, small, tolerance=tolerance, device=pair)
    assert image_error(image, raw) <= image.report.predicted_error <= tolerance


def test_both_take_tiles_from_one_queue(raw, pair, monkeypatch):
    taken = {}
    fill = Direct.fill

    def counting(self, first, last, *rest):
        taken.setdefault(self.device, []).append((first, last))
        time.sleep(0.02)  # as if tiles took long: the other is not idle
        return fill(self, first, last, *rest)

    monkeypatch.setattr(Direct, "fill", counting)
    sarcl.backproject(raw, GRID, method="direct", device=pair)
    assert set(taken) == set(pair)
    runs = sorted(run for part in taken.values() for run in part)
    assert [a for a, _ in runs[1:]] == [b for _, b in runs[:-1]]  # all bands, none twice


def test_files_and_listed_points_work_with_several_devices(pair, raw, tmp_path):
    raw.save(tmp_path / "raw.h5")
    lazy = sarcl.read(tmp_path / "raw.h5")
    one = sarcl.backproject(raw, GRID, method="direct", device=pair[0])
    both = sarcl.backproject(lazy, GRID, method="direct", device=pair, out=tmp_path / "a.h5", resume=True)
    assert np.linalg.norm(both.data[...] - one.data) <= 1e-6 * np.linalg.norm(one.data)
    for i in (1, 2):
        pieces = sarcl.backproject(raw, GRID, method="direct", device=pair, out=tmp_path / "b.h5", tile=(i, 2))
    assert np.linalg.norm(pieces.data[...] - one.data) <= 1e-6 * np.linalg.norm(one.data)
    listed = sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-4, 4, (300_000, 3)))
    few = raw[:3]
    one, both = (sarcl.backproject(few, listed, device=d, tolerance=1e-2) for d in (pair[0], pair))
    assert np.linalg.norm(both.data - one.data) <= 1e-6 * np.linalg.norm(one.data)


def test_progress_is_reported_by_the_callers_thread_alone(raw, pair):
    calls = []
    sarcl.backproject(raw, GRID, device=pair, progress=lambda *a: calls.append((threading.current_thread(), *a)))
    assert {c[0] for c in calls} == {threading.main_thread()}
    done, total = [c[2] for c in calls], raw.n_rows * GRID.size
    assert done == sorted(set(done)) and (done[0], done[-1]) == (0, total) and {c[3] for c in calls} == {total}


def test_a_device_that_fails_ends_the_run_with_its_error(raw, pair, monkeypatch):
    fill = Direct.fill

    def failing(self, *rest):
        if self.device is pair[1]:
            raise RuntimeError("the device has been unplugged")
        time.sleep(0.01)
        return fill(self, *rest)

    monkeypatch.setattr(Direct, "fill", failing)
    with pytest.raises(RuntimeError, match="unplugged"):
        sarcl.backproject(raw, GRID, method="direct", device=pair)
    assert not [name for name in no_threads_left() if "sarcl" in name]


def lost_after(monkeypatch, lost, blocks):
    """The devices in `lost` fail, each in its block after so many, as where the driver has lost them.

    The others wait for it: they would have made all blocks where a device begins late.
    """
    fill, count, failed = Direct.fill, dict.fromkeys(map(id, lost), 0), threading.Event()

    def failing(self, *rest):
        if id(self.device) in count:
            count[id(self.device)] += 1
            if count[id(self.device)] > blocks:
                failed.set()
                raise DeviceFailed("kernel backproject failed: DEVICE_NOT_AVAILABLE")
        else:
            failed.wait(10)
        return fill(self, *rest)

    monkeypatch.setattr(Direct, "fill", failing)


@pytest.mark.parametrize("blocks", [0, 1])
def test_the_blocks_of_a_device_that_is_lost_are_made_by_the_others(raw, pair, monkeypatch, caplog, blocks):
    wanted = sarcl.backproject(raw, GRID, method="direct", device=pair)
    lost_after(monkeypatch, pair[1:], blocks)
    image, calls = reported(raw, method="direct", device=pair, max_bytes=4e6)
    assert np.linalg.norm(image.data - wanted.data) <= 1e-6 * np.linalg.norm(wanted.data)
    assert image.report.contributions_done == wanted.report.contributions_done
    assert calls[-1][1:] == (raw.n_rows * GRID.size,) * 2
    assert "DEVICE_NOT_AVAILABLE; the other devices go on without it" in caplog.text
    assert not [name for name in no_threads_left() if "sarcl" in name]


def test_where_every_device_is_lost_finished_tiles_are_kept_and_the_same_call_continues(
    raw, pair, monkeypatch, tmp_path
):
    options = {"method": "direct", "device": pair, "max_bytes": 4e6, "out": tmp_path / "image.h5", "resume": True}
    wanted = sarcl.backproject(raw, GRID, method="direct", device=pair)
    with monkeypatch.context() as during:
        lost_after(during, pair, 1)
        with pytest.raises(DeviceFailed, match="DEVICE_NOT_AVAILABLE"):
            sarcl.backproject(raw, GRID, **options)
    assert list(tmp_path.glob("image.h5.parts/*.tiles"))
    image = sarcl.backproject(raw, GRID, **options)
    assert np.linalg.norm(image.data - wanted.data) <= 1e-6 * np.linalg.norm(wanted.data)
    assert "bands" in image.report.plan["from files"]


def test_an_interrupt_ends_all_devices(raw, pair, tmp_path):
    def stop(stage, done, total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sarcl.backproject(raw, GRID, device=pair, out=tmp_path / "a.h5", progress=stop)
    assert not [name for name in no_threads_left() if "sarcl" in name]
    assert list(tmp_path.iterdir()) == []


def test_devices_are_named_in_lists_as_alone(monkeypatch):
    working = [info.index for info in devices() if info.works]
    first = open_device(working[0])
    assert open_devices(working[0]) == open_devices([working[0]]) == open_devices(first) == [first]
    assert open_devices("all") == open_devices(working) == [open_device(i) for i in working]
    assert open_devices(",".join(map(str, working))) == open_devices("all")
    assert open_devices(",".join(map(str, working)) + ", ,") == open_devices("all")  # commas too many
    monkeypatch.setenv("SARCL_DEVICE", "all")
    assert open_devices(None) == open_devices("all")


def test_what_uses_one_device_takes_the_first_of_a_list_that_works(raw, monkeypatch, capsys):
    from sarcl.cli.parser import main

    working = [info.index for info in devices() if info.works]
    first = open_device(working[0])
    every, one = ",".join(map(str, working)), f"{working[0]},"
    for names, wanted in (("all", open_device()), (every, first), (one, first), (f" , nothing, {one}", first)):
        monkeypatch.setenv("SARCL_DEVICE", names)
        assert open_device() is wanted
        if "nothing" not in names:  # what takes several wants them all
            assert main(["devices"]) == 0
            starred = [line.split()[1] for line in capsys.readouterr().out.splitlines() if line.startswith("*  ")]
            assert str(wanted.info.index) in starred
    monkeypatch.setenv("SARCL_DEVICE", "nothing, no such device")
    with pytest.raises(sarcl.NoDeviceError, match="SARCL_DEVICE 'nothing, no such device' matches no"):
        open_device()
    with pytest.raises(sarcl.NoDeviceError, match="device '0,1' matches no"):  # in a call a list is a list
        open_device("0,1")


def test_forecasts_are_for_all_devices(raw, pair, monkeypatch):
    one, both = (sarcl.plan(raw, GRID, method="direct", device=d) for d in (pair[0], pair))
    assert one.plan == both.plan
    pixels = GRID.size * 8
    other = sarcl.plan(raw, GRID, method="direct", device=pair[1])
    assert both.bytes - pixels == pytest.approx(one.bytes + other.bytes - 2 * pixels)
    assert both.seconds - both.planning <= 1.01 * (one.seconds - one.planning)
    monkeypatch.setenv("SARCL_DEVICE", "all")
    every = sarcl.plan(raw, GRID, method="direct")
    monkeypatch.setenv("SARCL_DEVICE", ",".join(str(i.index) for i in devices() if i.works) + ",")
    assert sarcl.plan(raw, GRID, method="direct").bytes == every.bytes


def test_cpus_add_up_to_the_fastest_of_them_and_others_to_all(pair, monkeypatch):
    from dataclasses import replace

    from sarcl.imaging import forecast

    def device(kind):
        return Device(replace(pair[0].info, kind=kind), pair[0]._raw)

    speeds = {device("cpu"): 1.0, device("cpu"): 3.0, device("gpu"): 10.0, device("gpu"): 20.0}
    monkeypatch.setattr(forecast, "speed", speeds.__getitem__)
    assert forecast.rate_of(list(speeds)) == 33.0
    assert forecast.rate_of([d for d in speeds if d.is_cpu]) == 3.0


def test_bad_lists_of_devices_say_what_is_wrong(raw):
    first = next(info for info in devices() if info.works)
    with pytest.raises(ValueError, match=f"device {first.index} and {first.index} are both .*; name it once"):
        sarcl.backproject(raw, GRID, device=[first.index, first.index])
    with pytest.raises(ValueError, match="device is an empty list"):
        sarcl.backproject(raw, GRID, device=[])
    with pytest.raises(sarcl.NoDeviceError, match="'no such device' matches no"):
        sarcl.backproject(raw, GRID, device=[first.index, "no such device"])


def test_blocks_are_all_bands_cut_where_they_must_be():
    tiling = PlaneTiling(GRID, 32)
    whole = (0, tiling.n_bands)
    for todo in ([whole], [(0, 3), (5, 6), (8, tiling.n_bands)], []):
        held = [b for a, c in todo for b in range(a, c)]
        for most in (0, 1, 20_000, 1e5, float("inf")):
            for ends in (set(), {2, 5, 9}, set(range(tiling.n_bands + 1))):
                blocks = cut(tiling, todo, most, ends)
                assert [b for a, c in blocks for b in range(a, c)] == held
                assert not any(a < end < c for a, c in blocks for end in ends)
                assert all(tiling.count(a, c) <= 1.5 * max(most, 32 * 301) for a, c in blocks)
                coarse = cut(tiling, todo, most, ends, unit=4)
                assert [b for a, c in coarse for b in range(a, c)] == held
                assert {a for a, _ in coarse} <= {a for a, _ in todo} | ends | set(range(0, tiling.n_bands, 4))


# ---- dask


@pytest.fixture(scope="module")
def client():
    distributed = pytest.importorskip("distributed", reason="dask is not installed: pip install 'sarcl[dask]'")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=2, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_workers_of_a_cluster_make_the_image_of_one_device(raw, client, tmp_path):
    raw.save(tmp_path / "raw.h5")
    lazy = sarcl.read(tmp_path / "raw.h5")
    rows = np.arange(0, raw.n_rows, 2)
    for some, other in ((raw, raw), (lazy, raw), (lazy[rows], raw[rows]), (sarcl.concatenate([lazy, lazy]), None)):
        wanted = sarcl.backproject(some if other is None else other, GRID)
        image, calls = reported(some, cluster=client, max_bytes=4e6)
        assert np.array_equal(image.data, wanted.data)
        assert image.report.contributions_skipped == wanted.report.contributions_skipped
        assert image.report.device == wanted.report.device
        assert len(calls) > 3 and calls[-1][1] == calls[-1][2]


def test_every_worker_opens_its_device_in_its_own_process(raw, client):
    def contexts():
        import gc

        from sarcl.opencl.device import Device

        return os.getpid(), sum(isinstance(one, Device) for one in gc.get_objects())

    sarcl.backproject(raw, GRID, cluster=client)
    found = client.run(contexts)
    assert len({pid for pid, _ in found.values()} | {os.getpid()}) == 3
    assert [n for _, n in found.values()] == [1, 1]


def test_a_cluster_keeps_finished_tiles_as_one_device_does(raw, client, tmp_path):
    def stop(stage, done, total):
        if done > total / 3:
            raise KeyboardInterrupt

    wanted = sarcl.backproject(raw, GRID)
    with pytest.raises(KeyboardInterrupt):
        sarcl.backproject(raw, GRID, cluster=client, out=tmp_path / "a.h5", resume=True, progress=stop)
    assert list(tmp_path.glob("a.h5.parts/bands-*.tiles"))
    image = sarcl.backproject(raw, GRID, cluster=client, out=tmp_path / "a.h5")
    assert "from files" in image.report.plan
    assert np.array_equal(image.data[...], wanted.data)
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]


def test_a_worker_that_is_killed_is_replaced(raw, client):
    import signal

    wanted = sarcl.backproject(raw, GRID)
    victims = [pid for pid in client.run(os.getpid).values()][:1]

    def kill(stage, done, total):
        if done and victims:
            os.kill(victims.pop(), signal.SIGKILL)

    image = sarcl.backproject(raw, GRID, cluster=client, progress=kill)
    assert not victims and np.array_equal(image.data, wanted.data)


@pytest.mark.parametrize("how", ["workers", "scheduler"])
def test_where_all_workers_are_lost_what_was_finished_stays(raw, tmp_path, how):
    distributed = pytest.importorskip("distributed")
    import signal

    wanted, out = sarcl.backproject(raw, GRID), tmp_path / "a.h5"
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        victims = list(client.run(os.getpid).values())

        def lose(stage, done, total):
            while done and victims and how == "workers":
                os.kill(victims.pop(), signal.SIGKILL)
            if done and how == "scheduler":
                cluster.close()

        with pytest.raises(
            DeviceFailed, match=r"workers of the cluster were lost.* \d+ of \d+ blocks.*with out= it continues"
        ):
            sarcl.backproject(raw, GRID, cluster=client, out=out, progress=lose)
    assert list(tmp_path.glob("a.h5.parts/bands-*.tiles"))
    image = sarcl.backproject(raw, GRID, out=out)
    assert "from files" in image.report.plan and np.array_equal(image.data[...], wanted.data)
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]


def test_errors_of_workers_reach_the_caller(raw, client):
    with pytest.raises(sarcl.NoDeviceError, match="no such device"):
        sarcl.backproject(raw, GRID, cluster=client, device="no such device")
    with pytest.raises(TypeError, match=r"cluster is a str; wanted a dask\.distributed\.Client"):
        sarcl.backproject(raw, GRID, cluster="tcp://somewhere")
