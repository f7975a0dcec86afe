"""Fixtures: every OpenCL device on the machine and its twins, and the folder of outside data."""

from __future__ import annotations

import os
from collections import defaultdict
from pathlib import Path

import pytest
from helpers.block_runs import client, pair  # noqa: F401  # fixtures
from helpers.devices import ALONE, TWINS, opened, variants


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(config, items):
    """Leave out tests on twins of devices, or leave them to the slow tests.

    Repeated tests run on no twin: twins run every value of every parameter with its quick partners. Of the twins that
    only the slow tests have, each runs every fourth combination of a test's values; the two run different ones where
    there are enough. The quick tests run every third combination on the remaining twin, and costly ones on none.
    """
    left_out, combinations, quick = set(), defaultdict(list), defaultdict(list)
    for item in items:
        twin = _twin(item)
        if twin and item.get_closest_marker("repeated"):
            left_out.add(item)
        elif twin in ALONE:
            combinations[item.parent.nodeid, item.originalname, twin].append(item)
        elif twin and not item.get_closest_marker("slow"):
            quick[item.parent.nodeid, item.originalname].append(item)
    for (*_, twin), found in combinations.items():
        first = min(2 * ALONE.index(twin), len(found) - 1)
        left_out.update(item for at, item in enumerate(found) if (at - first) % 4)
    for found in quick.values():
        for at, item in enumerate(found):
            if at % 3 or item.get_closest_marker("costly"):
                item.add_marker(pytest.mark.slow)
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
        items[:] = [item for item in items if item not in left_out]


def _twin(item):
    """The name of the twin in TWINS that a test of the fixtures `device` and `double` runs on, if any."""
    params = item.callspec.params if hasattr(item, "callspec") else {}
    if not any(name in ("device", "double") and value and value[1] for name, value in params.items()):
        return None
    return next(name for name in TWINS if f"-{name}" in item.callspec.id)


@pytest.fixture(params=variants())
def device(request):
    """An open device; a kernel that fails on it fails the test."""
    return opened(request.param)


@pytest.fixture(params=variants(slow=()))
def every_device(request):
    """As `device`, with no twin left to the slow tests: where the branches themselves are tested, at little cost."""
    return opened(request.param)


@pytest.fixture(params=variants(fp64=True))
def double(request):
    """Every device that has float64, and its twin of one lane."""
    if request.param is None:
        pytest.skip("no float64")
    return opened(request.param)


@pytest.fixture(scope="session")
def data_folder():
    """Measured data that nobody here made: SARCL_DATA, or ../shared/data beside the repository."""
    folder = Path(os.environ.get("SARCL_DATA") or Path(__file__).parents[2] / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no data folder {folder.name!r}: set SARCL_DATA")
    return folder
