"""What a driver's errors become: messages with device, need and remedy; and two threads that share a device."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import noise_history

import sarcl
from sarcl.opencl import programs
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device
from sarcl.opencl.failures import DeviceFailed

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
PLACES = np.stack([np.full(24, -7e3), np.linspace(-9, 9, 24), np.full(24, 5e3)], axis=1)
TRACK = sarcl.Trajectory(np.linspace(0, 1, 24), PLACES)


def raising(error):
    def fails(*args, **options):
        raise error

    return fails


class Kernel:
    """A kernel whose launch the driver refuses."""

    function_name = "backproject"

    def __init__(self, error, num_args):
        self.error, self.num_args = error, num_args

    def __call__(self, *args, **options):
        raise self.error


def test_a_kernel_that_finds_no_memory_names_its_buffers_and_the_remedy():
    """NVIDIA allocates at first use: the error comes from the launch."""
    import pyopencl

    device = open_device()
    error = pyopencl.MemoryError("clEnqueueNDRangeKernel failed: MEM_OBJECT_ALLOCATION_FAILURE", -4)
    with pytest.raises(MemoryError) as caught:
        device.run(Kernel(error, 3), (8,), None, device.empty(3_000_000), 5, device.empty(2_000_000))
    said = str(caught.value)
    assert "kernel backproject, with buffers of 5 MB, does not fit on" in said and device.info.name in said
    assert (
        "MEM_OBJECT_ALLOCATION_FAILURE" in said and "pass a smaller max_bytes" in said and "end other programs" in said
    )


def test_memory_that_is_missed_only_at_the_end_names_the_kernel_too(monkeypatch):
    import pyopencl

    first = open_device()
    device = Device(replace(first.info, kind="gpu", vector_width=1), first._raw)
    kernel = device.kernel("assemble_image.cl", "move")
    buffers = [device.zeros(4096) for _ in range(3)]
    device.run(kernel, (8, 1), None, buffers[0], np.uint64(8), buffers[1], buffers[2], np.uint64(8))
    device.finish()
    lost = pyopencl.MemoryError("clFinish failed: OUT_OF_RESOURCES", -5)
    monkeypatch.setattr(device, "queue", type("Queue", (), {"finish": raising(lost)}))
    with pytest.raises(MemoryError, match=r"kernel move or those before it, with buffers of 12\.3 kB, does not fit on"):
        device.finish()


def test_a_driver_that_claims_more_memory_than_it_has_is_named_with_the_need(monkeypatch):
    import pyopencl

    device = open_device()
    none = pyopencl.MemoryError("create_buffer failed: MEM_OBJECT_ALLOCATION_FAILURE", -4)
    monkeypatch.setattr(pyopencl, "Buffer", raising(none))
    with pytest.raises(MemoryError, match=r"a buffer of 1 MB does not fit on .* pass a smaller max_bytes"):
        device.empty(1_000_000)


def test_a_device_that_is_lost_is_named_and_another_is_suggested():
    import pyopencl

    device = open_device()
    gone = pyopencl.RuntimeError("clEnqueueNDRangeKernel failed: DEVICE_NOT_AVAILABLE", -2)
    with pytest.raises(
        DeviceFailed, match=r"kernel backproject failed on .* DEVICE_NOT_AVAILABLE; try another device="
    ):
        device.run(Kernel(gone, 0), (8,), None)


def test_a_program_without_kernels_is_said_to_come_from_a_damaged_cache():
    """PoCL takes an empty file of its cache for a program."""
    import pyopencl

    program = open_device()
    built = pyopencl.Program(program.context, "void nothing(void) {}").build()
    with pytest.raises(RuntimeError, match=r"a program without kernels: its cache of built programs.* may be damaged"):
        programs.kernels_of(built)


def test_two_threads_on_one_device_compute_what_one_after_the_other_does():
    device = open_device()
    raw, grid = noise_history(), sarcl.ImageGrid.plane(shape=40, spacing=0.2)
    scenes = [sarcl.Scene.points(np.random.default_rng(i).uniform(-4, 4, (50, 3)), np.ones(50)) for i in range(2)]
    works = [
        lambda: sarcl.backproject(raw, grid, device=device, check=False).data,
        lambda: sarcl.backproject(raw, grid, device=device, tolerance=1e-5, check=False).data,
        lambda: sarcl.echo(scenes[0], CHIRP, TRACK, device=device).samples,
        lambda: sarcl.echo(scenes[1], CHIRP, TRACK, device=device).samples,
    ]
    alone = [work() for work in works]
    for _ in range(3):
        made = [None] * len(works)

        def run(i, made=made):
            made[i] = works[i]()

        threads = [threading.Thread(target=run, args=(i,)) for i in range(len(works))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert all(np.array_equal(a, b) for a, b in zip(made, alone, strict=True))


def test_threads_that_open_a_device_get_the_same_one(monkeypatch):
    from sarcl.opencl import choose_device
    from sarcl.opencl import device as device_module

    made, together = [], threading.Barrier(4)
    opened = device_module.once(lambda index: object())

    def run():
        together.wait()
        made.append(opened(0))

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(map(id, made))) == 1
    assert choose_device.open_listed.__wrapped__ is not None
