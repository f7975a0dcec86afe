"""Programs that plans build, from a device that computes nothing."""

from __future__ import annotations

import pytest
from gpu_static import tasks
from gpu_static.collect import PAPER, WITHOUT_FP64, collected

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
