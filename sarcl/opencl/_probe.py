"""OpenCL as a child process sees it: a driver that crashes or hangs ends the child alone, which says how far it got."""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from . import _child

if TYPE_CHECKING:
    from .device_list import DeviceInfo

MAIN = "from sarcl.opencl import _probe; _probe.main()"
LOAD, OPEN = "load", "open"  # steps of a child beside the numbers of the devices that it tries


@dataclass
class View:
    """What a child saw.

    step       the last that it began: "" imports, LOAD of the drivers, the number of a device on trial, OPEN
    end        how it was ended, with its last words; empty where it ended by itself
    broken     why numpy, scipy or pyopencl cannot be imported
    cache      the folder of caches that cannot be written, and why
    platforms  name and number of devices of each
    libraries  paths of the libraries that were loaded, where the system tells them
    devices    by their numbers
    picked     numbers of the devices that sarcl opens;  refused: why it opens none
    """

    step: str = ""
    end: str = ""
    broken: str = ""
    cache: tuple[str, str] = ("", "")
    platforms: list[tuple[str, int]] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    devices: dict[int, DeviceInfo] = field(default_factory=dict)
    picked: list[int] = field(default_factory=list)
    refused: str = ""


def view(
    *skipped: int,
    until: str = OPEN,
    environment: _child.Variables | None = None,
    patience: float = _child.PATIENCE,
) -> View:
    """What a child sees that lists the devices, tries those of other numbers than `skipped`, and opens what sarcl uses.

    until                  LOAD: it lists the devices alone
    environment, patience  as of _child.run
    """
    output, end = _child.run(MAIN, until, *map(str, skipped), environment=environment, patience=patience)
    seen = View(end=end)
    for line in output.splitlines():
        name, _, text = line.partition(" ")
        with suppress(ValueError):  # a line that the end of the child cut
            value = json.loads(text)
            if name == "device":
                from .device_list import DeviceInfo  # it needs NumPy, which may be what is wrong

                seen.devices[value["index"]] = DeviceInfo(**value)
            else:
                setattr(seen, name, value)
    return seen


def main() -> None:
    """The child: a line with the name of a field of View and its value, each step before it begins."""
    until, *skipped = sys.argv[1:]
    lines = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what drivers print

    def tell(name: str, value: object) -> None:
        print(name, json.dumps(value), file=lines, flush=True)

    try:
        import pyopencl  # noqa: F401
        import scipy  # noqa: F401

        from . import _cache_folder, _queries, _trial_record
        from .choose_device import open_devices
        from .device_list import listed, tried
    except Exception as exc:
        return tell("broken", f"{type(exc).__name__}: {exc}")
    tell("cache", _cache_folder.unwritable())
    tell("step", LOAD)
    for info, _ in listed():
        tell("device", vars(info))
    tell("platforms", [(name, len(handles)) for name, _, handles in _queries.platforms()])
    with suppress(OSError), open("/proc/self/maps") as file:
        tell("libraries", sorted({line.split(maxsplit=5)[5].strip() for line in file if ".so" in line}))
    if until == LOAD:
        return None
    _trial_record.clear()
    for index in (info.index for info, _ in listed() if str(info.index) not in skipped):
        tell("step", str(index))
        tell("device", vars(tried(index)))
    tell("step", OPEN)
    try:
        tell("picked", [device.info.index for device in open_devices(None)])
    except Exception as exc:
        tell("refused", str(exc))
    return None
