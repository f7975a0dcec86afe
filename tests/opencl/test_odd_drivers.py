"""Drivers that refuse questions, or whose answers cannot be true: their devices are passed over, the rest is used."""

import struct
from types import SimpleNamespace

import pytest

import sarcl
from sarcl.opencl import _queries, device_list
from sarcl.opencl.choose_device import open_device

QUESTIONS = (
    "name", "type", "global_mem_size", "max_mem_alloc_size", "max_compute_units", "driver_version", "local_mem_size",
    "max_work_group_size", "double_fp_config", "platform", "extensions", "warp_size_nv", "wavefront_width_amd",
)  # fmt: skip
NEEDED = ("global_mem_size", "max_mem_alloc_size")


class OddHandle:
    """The handle of a working device, whose driver refuses questions and gives `answers` to others."""

    def __init__(self, handle, refused=(), **answers):
        self._handle, self._refused, self._answers = handle, refused, answers

    def __getattr__(self, question):
        import pyopencl

        if question in self._refused:
            raise pyopencl.LogicError("Device.get_info failed: INVALID_VALUE", -30)
        if question in self._answers:
            return self._answers[question]
        return getattr(self._handle, question)


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """A record of trials that these tests share."""
    return tmp_path_factory.mktemp("cache") / "devices.json"


@pytest.fixture
def machine(monkeypatch, record):
    """A function that lists these handles, each on a platform of its own, before those of the machine."""
    from sarcl.opencl import _trial_record

    true = _queries.platforms()

    def forget():
        _trial_record._record.cache_clear()
        device_list._listed.cache_clear()
        device_list.tried.cache_clear()

    def lists(*handles):
        odd = [(f"Odd {i}", "1", [handle]) for i, handle in enumerate(handles)]
        monkeypatch.setattr(_queries, "platforms", lambda: odd + true)
        forget()
        return sarcl.devices()

    monkeypatch.setattr(_trial_record, "_path", lambda: record)
    lists.handle = next(handle for info, handle in device_list.listed() if device_list.tried(info.index).works)
    yield lists
    monkeypatch.undo()
    forget()


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_driver_that_refuses_one_question_hides_no_other_device(machine, question):
    alone = machine()
    found = machine(OddHandle(machine.handle, refused=(question,)))
    assert [(d.name, d.works) for d in found[1:]] == [(d.name, d.works) for d in alone]
    if question in NEEDED:
        assert not found[0].works and "does not say how much memory it has" in found[0].why
    assert open_device(1).info.name == alone[0].name


@pytest.mark.parametrize("question, answer", [("global_mem_size", 0), ("max_mem_alloc_size", -1)])
def test_a_device_without_memory_is_refused_and_says_so(machine, question, answer):
    odd = machine(OddHandle(machine.handle, **{question: answer}))[0]
    assert not odd.works and "its driver says that it has" in odd.why
    with pytest.raises(sarcl.NoDeviceError, match="its driver says that it has"):
        open_device("odd")


def test_a_buffer_larger_than_the_memory_is_not_believed(machine):
    memory = machine.handle.global_mem_size
    assert machine(OddHandle(machine.handle, max_mem_alloc_size=8 * memory))[0].max_alloc == memory


def test_platforms_that_cannot_list_their_devices_are_left_out(monkeypatch):
    import pyopencl

    def fails():
        raise pyopencl.LogicError("clGetDeviceIDs failed", -33)

    broken = SimpleNamespace(name="broken", get_devices=fails)
    nameless = SimpleNamespace(get_devices=lambda: ["a device"])
    monkeypatch.setattr(pyopencl, "get_platforms", lambda: [broken, nameless])
    assert _queries.platforms() == [("unknown", "unknown", ["a device"])]


def test_what_plans_ask_of_a_device_is_sensible_on_every_device():
    for info in sarcl.devices():
        if info.works:
            assert info.local_memory >= 0 and info.max_group >= 1 and info.warp >= 1
            assert info.fp64 or not info.fast_fp64
            if info.kind == "cpu":
                assert info.warp == 1 and info.fast_fp64 == info.fp64


def gpu(**answers):
    import pyopencl

    return SimpleNamespace(type=pyopencl.device_type.GPU, name="G", **answers)


def test_the_warp_of_a_gpu_is_asked_of_its_driver_and_else_of_the_trials_compiler():
    for known, warp in (({"warp_size_nv": 32}, 32), ({"wavefront_width_amd": 64}, 64), ({}, 0)):
        assert _queries.facts(gpu(**known))["warp"] == warp


def test_the_place_on_the_bus_is_asked_in_the_three_ways_of_drivers(monkeypatch):
    nvidia = gpu(pci_bus_id_nv=0x41, pci_slot_id_nv=8)
    amd = gpu(topology_amd=SimpleNamespace(bus=0x41, device=1, function=0))
    khronos = gpu(extensions="cl_khr_fp64 cl_khr_pci_bus_info")
    monkeypatch.setattr(_queries, "raw_info", lambda *question: struct.pack("4I", 0, 0x41, 1, 0))
    assert [_queries.facts(handle)["pci"] for handle in (nvidia, amd, khronos)] == ["41:01.0"] * 3
    monkeypatch.setattr(_queries, "raw_info", lambda *question: b"")
    assert _queries.facts(khronos)["pci"] == _queries.facts(gpu())["pci"] == ""


def test_a_question_that_pyopencl_does_not_know_is_asked_of_the_driver_itself():
    if _queries._loader() is None:
        pytest.skip("no library that finds OpenCL drivers")
    vendor_id, no_question = 0x1001, 0x7FFF
    for _, handle in device_list.listed():
        assert struct.unpack("I", _queries.raw_info(handle, vendor_id, 4))[0] == handle.vendor_id
        assert _queries.raw_info(handle, no_question, 4) == b""
