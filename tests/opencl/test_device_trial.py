"""The trial of a device: what the kernels that matter compute, compared with NumPy; devices that get it wrong."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import sarcl
from sarcl.cli.parser import main
from sarcl.opencl import _linker, _trial, _trial_record, choose_device, device_list, programs
from sarcl.opencl._trial import RESULTS, Outcome
from sarcl.opencl.choose_device import open_device, open_devices
from sarcl.opencl.device_list import DeviceInfo

# A mistake of a driver as a change of the trial's source, and what the trial says of it.
MISTAKES = {
    "a struct by pointer is wrong": (r"d->y = w_sub\(T.y, x.y\);", "d->y = w_add(T.y, x.y);", "path_difference"),
    "sums are simplified": (r"t = sum_of\(s, -a\);\n", "t = b;\n", "the rounding error of a float32 sum"),
    "a sum is fused with a product": (
        r"exact_sum\(high \* other, other\)", "quick_sum(fma(high, other, other), (fv)0)", "float32 sum with a product",
    ),
    "fma rounds the product": (r"fma\(a, b, -p\)", "(p - p)", "by fma"),
    "a square root of nothing": (
        r"wv w_sqrt\(wv a\) \{", "wv w_sqrt(wv a) { if (1) return w_make((fv)1, (fv)0);", "square root",
    ),
    "no rounding to integers": (r"#define MAGIC 12582912.0f", "#define MAGIC 12582911.0f", "cycle"),
    "no wait at a barrier": (r"shared\[k \* group \+ group - 1 - l\]", "shared[k * group + l]", "past a barrier"),
}  # fmt: skip


def outcome(device, fp64=True):
    info = device.info
    return _trial.trial(device._raw, info.vector_width, fp64 and info.fp64, info.local_memory, info.max_group)


def test_a_device_that_computes_right_passes(device):
    found = outcome(device)
    assert not found.why and not found.why64 and found.settled
    assert found.fp64 == device.info.fp64
    assert found.rate > 0 and found.warp >= 1 and 0 <= found.local_memory <= device.info.local_memory


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_device_that_makes_a_mistake_is_refused_with_what_was_wrong(mistake, monkeypatch):
    device = open_device()
    pattern, wrong, said = MISTAKES[mistake]
    text, n = re.subn(pattern, lambda match: wrong, programs.source("trial.cl"))
    assert n, "the mistake is no longer found in the source"
    monkeypatch.setattr(_trial, "source", lambda file: text)
    found = outcome(device, fp64=False)
    assert "a trial kernel" in found.why and "wrong numbers" in found.why and said in found.why
    assert found.settled


def test_not_a_number_is_a_wrong_number():
    result = _trial.Result("the sum", 1, 1.0, 1.0)
    right = np.ones(3)
    assert not _trial.compared(result, np.ones((1, 3), np.float32), right)
    assert "the sum is nan, not 1" in _trial.compared(result, np.array([[1, np.nan, 1]], np.float32), right)


def test_every_result_has_the_rows_that_the_kernel_writes():
    assert sum(r.rows for r in RESULTS) == 25
    assert [w.shape for w in _trial.wanted(*_trial._given())] == [(_trial.N,)] * len(RESULTS)


@pytest.mark.parametrize("most, sizes", [(20000, (64, 63, 31, 15)), (2**16 - 16, (64, 63))])
def test_local_memory_that_a_driver_refuses_is_offered_a_little_less_then_in_halves(monkeypatch, most, sizes):
    """A driver that claims more than its kernels can use: the trial finds what they can."""
    import pyopencl

    device, asked, true = open_device(), [], pyopencl.LocalMemory
    if device.info.local_memory < 2**16:
        pytest.skip("less than 64 KiB of local memory")

    def local(nbytes):
        asked.append(nbytes)
        if nbytes > most:
            raise pyopencl.RuntimeError("clEnqueueNDRangeKernel failed: OUT_OF_RESOURCES", -5)
        return true(nbytes)

    monkeypatch.setattr(pyopencl, "LocalMemory", local)
    assert outcome(device, fp64=False).local_memory == 1024 * sizes[-1]
    assert asked == [1024 * size for size in sizes]


def test_float64_that_is_claimed_and_wrong_is_not_used_and_said(monkeypatch, capsys):
    device = open_device()
    if not device.info.fp64:
        pytest.skip("no float64")
    right = _trial._wrong_numbers
    calls = []

    def wrong(*given):
        calls.append(given)
        return right(*given) if len(calls) == 1 else "wrong numbers: float64 is float32"

    monkeypatch.setattr(_trial, "_wrong_numbers", wrong)
    found = outcome(device)
    assert not found.why and not found.fp64 and not found.fast_fp64 and found.settled
    assert found.why64 == "wrong numbers: float64 is float32"


@pytest.mark.parametrize("slower, fast", [(2, True), (32, False)])
def test_float64_is_fast_where_it_was_timed_so(monkeypatch, slower, fast):
    device = open_device().one_lane()
    if not device.info.fp64:
        pytest.skip("no float64")
    monkeypatch.setattr(_trial, "_rate", lambda q, k, lanes, dtype: 1e12 if dtype is np.float32 else 1e12 / slower)
    assert outcome(device).fast_fp64 == fast


def test_kernels_use_pairs_of_float32_where_float64_is_slow():
    device = open_device()
    if not device.info.fp64:
        pytest.skip("no float64")
    from sarcl.opencl.device import Device

    slow = Device(replace(device.info, fast_fp64=False), device._raw)
    slow.kernel("tile_constants.cl", "tile_constants", BISTATIC=0, BEAM=0, LOCAL=0, RANGE=0)
    assert [dict(key[1:])["FP64"] for key in slow._kernels] == [0]
    grid = sarcl.ImageGrid.plane(shape=16, spacing=0.2)
    from helpers.cases import noise_history

    images = [sarcl.backproject(noise_history(), grid, device=d, tolerance=1e-7) for d in (slow, device)]
    assert np.array_equal(images[0].data, images[1].data)  # float64 is there for what needs it


def fake(monkeypatch, *devices, rates=None):
    """A machine with these devices (platform, name, kind, memory, pci), all of which work; opened, one is its index."""
    common = dict(works=False, why=device_list.NOT_TRIED, fp64=False, vector_width=1, max_alloc=1, units=4, driver="1",
                  local_memory=1, max_group=1, warp=1, fast_fp64=False, rate=0.0)  # fmt: skip
    infos = [
        device_list.DeviceInfo(index=i, platform=p, name=n, kind=k, memory=m, pci=pci, **common)
        for i, (p, n, k, m, pci) in enumerate(devices)
    ]
    listed = tuple((i, SimpleNamespace(platform=SimpleNamespace(version="1"), index=i.index)) for i in infos)
    for module in (device_list, choose_device):
        monkeypatch.setattr(module, "listed", lambda: listed)
    rates = rates or [1e9] * len(devices)
    monkeypatch.setattr(device_list, "trial", lambda handle, *offered: Outcome(rate=rates[handle.index]))
    monkeypatch.setattr(device_list._trial_record, "find", lambda key: None)
    monkeypatch.setattr(device_list._trial_record, "keep", lambda key, found: None)
    monkeypatch.setattr(choose_device, "open_listed", lambda index: index)
    monkeypatch.delenv("SARCL_DEVICE", raising=False)
    device_list.tried.cache_clear()


@pytest.fixture(autouse=True)
def other_tests_ask_anew():
    yield
    device_list.tried.cache_clear()


def test_the_fastest_gpu_is_taken_whatever_its_compute_units(monkeypatch):
    gpus = [("Intel", "Iris", "gpu", 1, ""), ("NVIDIA", "RTX", "gpu", 2, ""), ("P", "CPU", "cpu", 3, "")]
    fake(monkeypatch, *gpus, rates=[1e12, 9e12, 99e12])
    assert open_device() == 1
    assert open_device("iris") == 0


SAME = {
    "one place on the bus": ([("NVIDIA", "RTX", "gpu", 8, "01:00.0"), ("PoCL", "rtx-cuda", "gpu", 7, "01:00.0")], [1]),
    "other places": ([("A", "RTX", "gpu", 8, "01:00.0"), ("B", "RTX", "gpu", 8, "02:00.0")], [0, 1]),
    "name and memory": ([("A", "Xe", "gpu", 8, ""), ("B", "Xe", "gpu", 8, "03:00.0")], [1]),
    "other memory": ([("A", "Xe", "gpu", 8, ""), ("B", "Xe", "gpu", 16, "")], [0, 1]),
    "two cards of one platform": ([("A", "RTX", "gpu", 8, "")] * 2, [0, 1]),
    "two cards of two platforms": ([("A", "X", "gpu", 8, "")] * 2 + [("B", "X", "gpu", 8, "")] * 2, [2, 3]),
    "the processor": ([("PoCL", "cpu", "cpu", 8, ""), ("Intel", "Xeon", "cpu", 9, "")], [1]),
    "a processor and a card": ([("A", "APU", "cpu", 8, ""), ("B", "APU", "gpu", 8, "")], [0, 1]),
}


@pytest.mark.parametrize("case", SAME)
def test_all_takes_one_device_once(monkeypatch, case):
    devices, wanted = SAME[case]
    fake(monkeypatch, *devices, rates=[1e9 * (i + 1) for i in range(len(devices))])
    assert open_devices("all") == wanted


@pytest.mark.skipif(sys.platform != "linux", reason="PoCL's linker ld")
def test_a_missing_linker_is_named_where_pocl_would_end_the_process(tmp_path):
    if not any(info.platform == _linker.PLATFORM for info, _ in device_list.listed()):
        pytest.skip("no PoCL here")
    code = (
        "import sarcl\n"
        "found = [d for d in sarcl.devices() if d.platform == 'Portable Computing Language']\n"
        "print(all(d.works for d in found) or found[0].why)"
    )
    own = {"PATH": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path), "POCL_CACHE_DIR": str(tmp_path)}
    run = subprocess.run([sys.executable, "-c", code], env={**os.environ, **own}, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    if run.stdout.strip() == "True":
        pytest.skip("this PoCL holds a linker of its own")
    assert "PoCL links kernels with the program ld, and there is none on PATH" in run.stdout
    assert str(tmp_path) in run.stdout and "apt-get install binutils" in run.stdout and "ld\" doesn't" not in run.stdout


def test_where_ld_is_missing_a_device_that_builds_kernels_is_used(monkeypatch):
    monkeypatch.setattr(_linker, "is_missing", lambda platform: True)
    monkeypatch.setattr(_trial_record, "find", lambda key: None)
    monkeypatch.setattr(_trial_record, "keep", lambda key, found: None)
    for info, _ in device_list.listed():
        if device_list.tried(info.index).works:
            assert device_list.tried.__wrapped__(info.index).works  # ld is there: the trial passes in the other process


# The record of trials ----------------------------------------------------------------------------------------


@pytest.fixture
def record(tmp_path, monkeypatch):
    """An empty record of trials in a folder of its own: its path, a list that grows with each trial, a new process."""
    path, trials, trial = tmp_path / "cache" / "devices.json", [], device_list.trial

    def counted(handle, *offered):
        trials.append(handle)
        return trial(handle, *offered)

    def new_process():
        _trial_record._record.cache_clear()
        device_list.tried.cache_clear()
        trials.clear()

    monkeypatch.setattr(_trial_record, "_path", lambda: path)
    monkeypatch.setattr(device_list, "trial", counted)
    new_process()
    yield SimpleNamespace(path=path, trials=trials, new_process=new_process)
    new_process()


def test_a_trial_that_succeeded_is_not_repeated_by_the_next_process(record):
    first = sarcl.devices()
    assert record.trials
    entries = json.loads(record.path.read_text())
    assert [entry["fp64"] for entry in entries.values() if not entry["why"]] == [d.fp64 for d in first if d.works]
    assert all(any(d.driver in key and d.name in key for d in first) for key in entries)
    assert [p.name for p in record.path.parent.iterdir()] == [record.path.name]
    record.new_process()
    assert sarcl.devices() == first
    assert not [info for info, handle in device_list.listed() if first[info.index].works and handle in record.trials]


def test_the_command_devices_tries_every_device_again(record, capsys):
    first = sarcl.devices()
    record.new_process()
    assert main(["devices"]) == 0
    assert set(record.trials) == {handle for _, handle in device_list.listed()}
    assert first[0].name[:20] in capsys.readouterr().out
    assert json.loads(record.path.read_text())


@pytest.mark.parametrize("contents", [b"", b"{", b"[1]", b'{"a": 1}', b"\xff\x00", b"[" * 60000, b'{"a":' * 20000])
def test_a_damaged_record_is_taken_for_empty_and_written_again(record, contents):
    record.path.parent.mkdir()
    record.path.write_bytes(contents)
    works = [d for d in sarcl.devices() if d.works]
    assert works and record.trials
    assert len(json.loads(record.path.read_text())) == len(works)


def test_a_record_of_another_user_or_behind_a_link_is_not_believed(record, tmp_path, monkeypatch):
    sarcl.devices()
    entries = record.path.read_text()
    other = tmp_path / "other.json"
    record.path.rename(other)
    record.path.symlink_to(other)
    record.new_process()
    sarcl.devices()
    assert record.trials and not record.path.is_symlink()
    assert other.read_text() == entries and json.loads(record.path.read_text()).keys() == json.loads(entries).keys()
    monkeypatch.setattr("os.getuid", lambda: os.stat(record.path).st_uid + 1)
    record.new_process()
    sarcl.devices()
    assert record.trials


def test_a_record_that_cannot_be_written_is_no_error(record):
    record.path.parent.write_text("a file where the folder should be")
    assert any(d.works for d in sarcl.devices())
    record.new_process()
    assert any(d.works for d in sarcl.devices()) and record.trials


def test_the_record_lies_in_the_cache_folder_of_the_user_and_nowhere_else(monkeypatch, tmp_path):
    if sys.platform == "linux":
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        assert _trial_record._path() == tmp_path / "sarcl" / "devices.json"
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *names, **options: "~/.cache/sarcl")
    with pytest.raises(OSError, match="would lie in the current folder"):
        _trial_record._path()
    _trial_record._record.cache_clear()
    assert _trial_record.find("any") is None
    _trial_record._record.cache_clear()


def two_devices(monkeypatch, works):
    """A graphics card and a processor, of which those in `works` work; opened, a device is its index."""
    common = dict(works=False, why="not tried", fp64=False, vector_width=1, memory=1, max_alloc=1, units=4, driver="1",
                  local_memory=1, max_group=1, warp=1, fast_fp64=False, rate=0.0, pci="")  # fmt: skip
    platform = SimpleNamespace(version="1")
    infos = [
        DeviceInfo(index=i, platform="P", name=f"{k} of P", kind=k, **common) for i, k in enumerate(("gpu", "cpu"))
    ]
    listed = tuple((i, SimpleNamespace(platform=platform, double_fp_config=0, kind=i.kind)) for i in infos)
    for module in (device_list, choose_device):
        monkeypatch.setattr(module, "listed", lambda: listed)
    tried = []

    def trial(handle, lanes, fp64, *offered):
        tried.append(handle.kind)
        if handle.kind not in works:
            return Outcome(settled=False, why="broken")
        return Outcome(fp64=fp64, fast_fp64=fp64)

    monkeypatch.setattr(device_list, "trial", trial)
    monkeypatch.setattr(choose_device, "open_listed", lambda index: index)
    return tried


def test_only_the_device_that_is_asked_for_is_tried(record, monkeypatch):
    monkeypatch.delenv("SARCL_DEVICE", raising=False)
    tried = two_devices(monkeypatch, works=("gpu", "cpu"))
    assert open_device("cpu") == 1 and tried == ["cpu"]
    assert open_device() == 0 and tried == ["cpu", "gpu"]
    assert "0 gpu of P" in record.path.read_text()


def test_a_device_that_fails_is_passed_over_not_recorded_and_tried_by_the_next_process(record, monkeypatch):
    monkeypatch.delenv("SARCL_DEVICE", raising=False)
    tried = two_devices(monkeypatch, works=("cpu",))
    for _ in range(2):
        assert open_device() == 1
        assert open_device() == 1
        assert "gpu" not in record.path.read_text()
        record.new_process()
    assert tried == ["gpu", "cpu", "gpu"]
    with pytest.raises(sarcl.NoDeviceError, match=r"'gpu' matches no working OpenCL device. Found: 0: .* broken"):
        open_device("gpu")


def test_a_trial_in_float64_that_failed_once_is_repeated_by_the_next_process(record, monkeypatch):
    two_devices(monkeypatch, works=("gpu", "cpu"))
    for _, handle in device_list.listed():
        handle.double_fp_config = 63  # both offer float64
    failing, trials = {"gpu"}, []

    def trial(handle, *offered):
        trials.append(handle.kind)
        if handle.kind in failing:
            return Outcome(settled=False, why64="out of memory")
        return Outcome(fp64=True)

    monkeypatch.setattr(device_list, "trial", trial)
    assert [(d.works, d.fp64, d.why) for d in sarcl.devices()] == [(True, False, "out of memory"), (True, True, "")]
    assert "gpu" not in record.path.read_text()
    failing.clear()
    record.new_process()
    trials.clear()
    assert [(d.works, d.fp64) for d in sarcl.devices()] == [(True, True), (True, True)]
    assert trials == ["gpu"]  # the cpu's verdict was recorded
    record.new_process()
    assert all(d.fp64 for d in sarcl.devices()) and len(trials) == 1


def test_a_device_that_computes_wrong_numbers_is_recorded_as_such_and_not_tried_again(record, monkeypatch):
    tried = two_devices(monkeypatch, works=("cpu",))

    def trial(handle, *offered):
        tried.append(handle.kind)
        return Outcome(why="" if handle.kind == "cpu" else "wrong numbers")

    monkeypatch.setattr(device_list, "trial", trial)
    for _ in range(2):
        assert [(d.works, d.why) for d in sarcl.devices()] == [(False, "wrong numbers"), (True, "")]
        record.new_process()
    assert tried == ["gpu", "cpu"]


def test_a_device_that_offers_no_float64_is_not_tried_again(record, monkeypatch):
    tried = two_devices(monkeypatch, works=("gpu", "cpu"))
    for _ in range(2):
        assert not any(d.fp64 for d in sarcl.devices())
        record.new_process()
    assert tried == ["gpu", "cpu"]
