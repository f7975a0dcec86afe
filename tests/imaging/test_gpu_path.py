"""Images as a GPU makes them: profiles on the device, uploads beside the computation. A CPU stands in for one."""

from __future__ import annotations

import weakref
from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_history, noise_on, straight
from helpers.devices import as_gpu

import sarcl
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device

GRID = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(60, 50), spacing=(0.03, 0.02))
LISTED = sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-2, 2, (700, 3)))
CASES = {
    "few taps": (GRID, 1e-2, {}),
    "many taps": (GRID, 1e-5, {"bistatic": True}),
    "listed points": (LISTED, 1e-3, {}),
    "beam": (GRID, 1e-3, {"beam": (6e-5, (-0.7, 0, -0.714)), "window": (None, "hamming")}),
    "float64": (GRID, 1e-9, {}),
}

FIVE_BLOCKS = {"upload": 64 * 16 * 8}  # bytes of 64 rows of 16 samples, of 280


@pytest.fixture
def calls(monkeypatch):
    """The device's methods of these names, in the order of their calls."""
    made = []
    for name in ("finish", "mark", "wait", "write_behind"):
        method = getattr(Device, name)
        monkeypatch.setattr(
            Device, name, lambda self, *a, name=name, method=method: (made.append(name), method(self, *a))[1]
        )
    return made


@pytest.mark.parametrize(
    "case", [pytest.param(c, marks=[pytest.mark.slow] if c in ("many taps", "listed points") else []) for c in CASES]
)
def test_images_meet_their_tolerance_in_blocks_of_rows(device, case, calls):
    grid, tolerance, options = CASES[case]
    if case == "float64" and not device.info.fp64:
        pytest.skip("no float64")
    options = dict(options)
    raw = noise_history(n_rows=280, n_samples=16, bistatic=options.pop("bistatic", False))
    progress = []
    image = sarcl.backproject(
        raw, grid, tolerance=tolerance, method="direct", device=as_gpu(device, **FIVE_BLOCKS), check=True,
        progress=lambda *report: progress.append(report[1:]), **options,
    )  # fmt: skip
    assert image.report.measured_error <= image.report.predicted_error <= tolerance
    assert image.report.seconds["profiles"] > 0 and image.report.seconds["backproject"] > 0
    assert [done for done, _ in progress] == sorted(done for done, _ in progress) and len(progress) >= 6
    assert progress[-1] == (raw.n_rows * grid.size,) * 2
    # five blocks of rows, of one step each: the host waits for all but the last before the end, and finishes once
    assert calls.count("mark") == 5 and calls.count("finish") == 1
    assert calls.index("finish") > max(i for i, name in enumerate(calls) if name == "mark")


def test_a_step_begins_while_the_one_before_runs(device, calls):
    raw = noise_history(n_rows=280, n_samples=16)
    gpu = as_gpu(device, **FIVE_BLOCKS)
    sarcl.backproject(raw, GRID, tolerance=1e-2, method="direct", device=gpu, check=False)
    uploads = [i for i, name in enumerate(calls) if name == "write_behind"]
    marks, waits = ([i for i, name in enumerate(calls) if name == kind] for kind in ("mark", "wait"))
    assert len(uploads) == 3 * len(marks) == 15  # samples, weights and geometry of each block
    for block in range(1, 4):  # between its mark and the wait for it lie the next block's uploads and mark
        assert marks[block] < uploads[3 * block + 3] < uploads[3 * block + 5] < marks[block + 1] < waits[block]


@pytest.mark.parametrize("spacing, order", [(0.03, "order 2"), (0.25, "order 3")])
@pytest.mark.parametrize("case", ["monostatic", pytest.param("bistatic", marks=pytest.mark.slow)])
def test_linear_terms_in_two_parts_are_as_exact_as_wide_ones(device, spacing, order, case):
    """Their error is far below the bound, which holds for the worst place; each part matters at this tolerance."""
    raw = noise_history(n_rows=128, n_samples=64, bistatic=case == "bistatic")
    grid = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(64, 40), spacing=spacing)
    image = sarcl.backproject(raw, grid, tolerance=3e-5, method="direct", device=as_gpu(device), check=True)
    assert (image.report.plan["ranges"], image.report.plan["series"]) == ("linear term in two parts", order)
    assert image.report.measured_error <= min(5e-6, image.report.predicted_error)


@pytest.mark.slow
def test_subapertures_meet_their_tolerance(device):
    raw = noise_on(straight(400))
    grid = sarcl.ImageGrid.plane(shape=(150, 170), spacing=0.25)
    image = sarcl.backproject(raw, grid, tolerance=1e-2, method="factorized", device=as_gpu(device), check=False)
    assert image_error(image, raw, most=150) <= image.report.predicted_error <= 1e-2


def test_subapertures_add_up_the_blocks_of_rows():
    raw, grid = noise_on(straight(600)), sarcl.ImageGrid.plane(shape=(40, 80), spacing=0.2)
    device = as_gpu(open_device("cpu"))
    image = sarcl.backproject(raw, grid, tolerance=1e-2, method="factorized", device=device, check=True)
    assert image.report.measured_error <= image.report.predicted_error <= 1e-2


def test_samples_too_large_for_the_sums_of_the_device_are_summed_on_the_host_or_refused(device):
    raw, gpu = noise_history(n_samples=16), as_gpu(device)
    small = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(20, 20), spacing=0.03)
    wanted = sarcl.backproject(raw, small, tolerance=1e-3, method="direct", device=gpu).data
    for factor in (1e22, 1e28):
        scaled = replace(raw, samples=raw.samples * np.float32(factor))
        image = sarcl.backproject(scaled, small, tolerance=1e-3, method="direct", device=gpu)
        assert np.linalg.norm(image.data / np.float32(factor) - wanted) <= 1e-6 * np.linalg.norm(wanted)
    scaled = replace(raw, samples=raw.samples * np.float32(1e34))
    with pytest.raises(ValueError, match=r"samples times weights reach .* in rows of 16; sums in complex64 hold up to"):
        sarcl.backproject(scaled, small, tolerance=1e-3, method="direct", device=gpu)


def test_an_interrupt_leaves_nothing_running(device, calls):
    raw = noise_history(n_rows=280, n_samples=16)
    gpu = as_gpu(device, **FIVE_BLOCKS)

    def stop(stage, done, total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sarcl.backproject(raw, GRID, tolerance=1e-2, method="direct", device=gpu, progress=stop)
    assert calls[-1] == "finish" and calls.count("finish") == 1 and calls.count("mark") == 2


@pytest.mark.parametrize("case, max_bytes", [("few taps", 1.5e6), ("float64", 2e6)])
def test_buffers_on_the_device_keep_to_max_bytes(device, case, max_bytes, monkeypatch):
    import pyopencl

    grid, tolerance, _ = CASES[case]
    if case == "float64" and not device.info.fp64:
        pytest.skip("no float64")
    held, most, whole = [0], [0], pyopencl.Buffer

    class Buffer(whole):
        def __init__(self, context, flags, size=0, hostbuf=None):
            super().__init__(context, flags, size, hostbuf)
            if not flags & pyopencl.mem_flags.ALLOC_HOST_PTR:  # memory of the host
                nbytes = self.size
                held[0] += nbytes
                most[0] = max(most[0], held[0])
                weakref.finalize(self, lambda: held.__setitem__(0, held[0] - nbytes))

    monkeypatch.setattr(pyopencl, "Buffer", Buffer)
    raw = noise_on(straight(400), n_samples=256)
    sarcl.backproject(
        raw, grid, tolerance=tolerance, method="direct", device=as_gpu(device), max_bytes=max_bytes, check=False
    )
    assert max_bytes / 4 < most[0] <= max_bytes
