"""Blocks of work whose uploads go on while a device computes."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from helpers.devices import as_gpu

from sarcl.opencl.device import Device
from sarcl.opencl.pipeline import Pipeline


def moved(device, source, n, out):
    """Enqueue a copy of n pixels of four planes, by a kernel."""
    slot = device.copied(np.zeros(1, np.int32))
    move = device.kernel("assemble_image.cl", "move")
    device.run(move, (n, 1), None, source, np.uint64(n), slot, out, np.uint64(n))


@pytest.fixture(params=["itself", "GPU"])
def made(request, device):
    """A device, as it is and in the place of a GPU."""
    return device if request.param == "itself" else as_gpu(device)


def test_every_block_reads_its_own_upload(made):
    random, n = np.random.default_rng(0), 5000
    sizes = [n, n, n, n // 2, 2 * n, n, 7]  # a shorter block, and one for which a buffer must grow
    blocks = [random.standard_normal((4, size)).astype(np.float32) for size in sizes]
    outs, ended = [made.zeros(16 * size) for size in sizes], []
    with Pipeline(made) as pipeline:
        for i, block in enumerate(blocks):
            pipeline.new_block()
            held = block.copy()
            first, second = pipeline.upload(np.full(3, np.pi)), pipeline.upload(held)
            assert first is not second
            moved(made, second, sizes[i], outs[i])
            pipeline.step(lambda i=i: ended.append(i))
            if not made.is_cpu:
                held[:] = np.nan  # the array was copied; on a CPU its memory is the buffer
            assert ended == list(range(i + 1 if made.is_cpu else i))
    assert ended == list(range(len(sizes)))
    for out, block in zip(outs, blocks, strict=True):
        assert np.array_equal(made.download(out, np.empty_like(block)), block)


def test_the_host_waits_for_the_step_before_and_for_nothing_else(device, monkeypatch):
    gpu, finished, waited = as_gpu(device), [], []
    finish, wait = Device.finish, Device.wait
    monkeypatch.setattr(Device, "finish", lambda self: (finished.append(self), finish(self)))
    monkeypatch.setattr(Device, "wait", lambda self, event: (waited.append(event), wait(self, event)))
    data = np.ones((4, 100), np.float32)
    with Pipeline(gpu) as pipeline:
        for _ in range(5):
            pipeline.new_block()
            moved(gpu, pipeline.upload(data), 100, gpu.empty(1600))
            pipeline.step()
        assert len(waited) == 4 and finished == []
    assert finished == [gpu]


def test_after_an_exception_nothing_runs_and_nothing_follows(made, monkeypatch):
    finished, ended, finish = [], [], Device.finish
    monkeypatch.setattr(Device, "finish", lambda self: (finished.append(self), finish(self)))
    pipeline = Pipeline(made)
    with pytest.raises(KeyboardInterrupt), pipeline:
        pipeline.new_block()
        moved(made, pipeline.upload(np.ones((4, 100), np.float32)), 100, made.empty(1600))
        if not made.is_cpu:
            pipeline.step(lambda: ended.append(0))
        raise KeyboardInterrupt
    assert finished[-1] is made and ended == []
    with pipeline:  # and it may be used again
        pipeline.new_block()
        pipeline.step(lambda: ended.append(1))
    assert ended == [1]


@pytest.mark.parametrize("n", [1, 249, 250, 251, 500, 501, 1234])
def test_large_arrays_leave_a_gpu_in_pieces_with_the_same_bits(device, n):
    gpu, values = as_gpu(device, download=1000), np.arange(n, dtype=np.float32)
    buffer = gpu.copied(values)
    assert np.array_equal(gpu.download(buffer, np.empty_like(values)), values)
    assert np.array_equal(
        gpu.download(buffer, np.empty((1, n // 2), np.float32), offset=4 * (n - n // 2)), values[None, n - n // 2 :]
    )
    apart = np.full((n, 1), -1, np.complex64)
    assert np.array_equal(gpu.download(gpu.copied(values.astype(np.complex64)), apart), values[:, None])


def test_page_locked_memory_is_used_again_and_little_of_it_is_kept(device):
    gpu = as_gpu(device, upload=1000)
    queue = gpu.another_queue()
    first, second = gpu.page_locked(queue, 3000), gpu.page_locked(queue, 3000)
    assert first.size >= 3000 and not np.shares_memory(first, second)
    gpu.give_back(first)
    assert gpu.page_locked(queue, 3001) is not first and gpu.page_locked(queue, 1499) is not first
    assert gpu.page_locked(queue, 1500) is first
    oldest = weakref.ref(first)
    gpu.give_back(first)
    del first
    gpu.give_back(second)  # 6000 bytes in all
    assert oldest() is None and gpu.page_locked(queue, 3000) is second


def test_a_second_pipeline_uploads_through_the_memory_of_the_first(device):
    gpu, data, used = as_gpu(device, upload=2000), np.ones((4, 100), np.float32), []
    queue = gpu.another_queue()
    for _ in range(3):
        with Pipeline(gpu) as pipeline:
            pipeline.new_block()
            moved(gpu, pipeline.upload(data), 100, gpu.empty(1600))
            pipeline.step()
        del pipeline
        gc.collect()
        memory = gpu.page_locked(queue, data.nbytes)
        used.append(memory.ctypes.data)
        gpu.give_back(memory)
    assert len(set(used)) == 1
