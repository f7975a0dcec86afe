"""Programs that plans build, from a device that computes nothing."""

from __future__ import annotations

import pytest
from gpu_static import tasks
from gpu_static.collect import PAPER, WITHOUT_FP64, PaperDevice, collected

from sarcl.opencl.launch_numbers import launch_numbers

CHOSEN = {name: tasks.tasks()[name] for name in ("direct 1e-03", "echo points", "pixel taper")}


@pytest.mark.parametrize("info", [PAPER, WITHOUT_FP64], ids=["fp64", "no-fp64"])
def test_programs_have_one_lane_the_devices_float64_and_groups_as_launched(info):
    found = collected(CHOSEN, info)
    files = {variant.file for variant in found}
    assert {"backproject.cl", "spread_points.cl", "tile_constants.cl", "range_profiles.cl"} <= files
    for variant, use in found.items():
        macros = dict(variant.macros)
        assert macros.get("VW", 1) == 1 and macros.get("FP64", info.fp64) == info.fp64 and use.tasks
    gathered = [use for variant, use in found.items() if variant.file == "backproject.cl"]
    assert all(use.groups["backproject"] <= {16, 64, 256} for use in gathered)


def test_tasks_that_fail_are_named_with_the_reason():
    with pytest.raises(RuntimeError, match=r"(?s)PaperDevice.*\n'broken': ZeroDivisionError"):
        collected({"broken": lambda: 1 / 0})


def test_a_launch_whose_numbers_are_not_the_struct_of_its_kernel_fails():
    device = PaperDevice(PAPER, {})
    device.begin("one launch")
    untile, move = (device.kernel("assemble_image.cl", name) for name in ("untile", "move"))
    numbers = launch_numbers("assemble_image.cl", "untile", pixels=1, across=1, high=1, wide=1, columns=1)
    device.run(untile, (1, 1), None, numbers, device.empty(16))
    for kernel, first in ((untile, device.empty(16)), (move, numbers)):
        with pytest.raises(AssertionError, match="first, not"):
            device.run(kernel, (1, 1), None, first)
