"""Documents of measurements: machine, devices and rows, ready for JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.threads import threads
from ..base.validation import count, number
from ..base.version import __version__
from ..opencl import device_list
from ..opencl.choose_device import open_device
from ..opencl.device import Device, DeviceChoice

FORMAT = 2  # version of the document
FACTS = ("index", "name", "platform", "driver", "kind", "fp64", "units")  # of a device, in a document
Document = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Measuring:
    """What a benchmark measures, on which devices, and how often.

    sizes, tolerances  of the tasks: at least 8; relative errors, above 0
    devices   as `sarcl.devices` names them; None: all that work;  no_fp64  measure each again without float64
    repeats   runs of each row, in turns;  limit  s; runs expected to last longer are left out
    patience  s to wait before each run until no other program runs
    ValueError for what does not fit.
    """

    sizes: Sequence[int] | None = None
    tolerances: Sequence[float] | None = None
    devices: Sequence[DeviceChoice | None] | None = None
    no_fp64: bool = False
    repeats: int = 3
    limit: float = 120.0
    patience: float = 0.0

    def __post_init__(self) -> None:
        for i, n in enumerate(self.sizes or ()):
            count(f"sizes[{i}]", n, least=8)
        for i, tolerance in enumerate(self.tolerances or ()):
            number(f"tolerances[{i}]", tolerance, above=0)
        count("repeats", self.repeats)
        number("limit", self.limit, above=0)
        number("patience", self.patience, least=0)

    def opened_devices(self) -> list[Device]:
        """The devices, all that work by default, and with no_fp64 a twin without float64 of each that has it."""
        devices = self.devices or [info.index for info in device_list.devices() if info.works] or [None]
        opened = [open_device(device) for device in dict.fromkeys(devices)]
        return opened + [device.without_fp64() for device in opened if self.no_fp64 and device.info.fp64]


def header(devices: Sequence[Device]) -> Document:
    """The first entries of every document: machine, devices, an empty list of peers."""
    return {
        "format": FORMAT,
        "machine": _machine(),
        "devices": [{name: getattr(d.info, name) for name in FACTS} for d in devices],
        "peers": [],
    }


def load() -> list[float]:
    """Load average of the last minute, one value; NaN where the system does not say."""
    return [os.getloadavg()[0]] if hasattr(os, "getloadavg") else [float("nan")]


def _machine() -> dict[str, Any]:
    processor = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return {
        "processor": processor or platform.machine(),
        "processors": os.cpu_count(),
        "threads": threads(),
        "system": platform.system(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "sarcl": __version__,
        "load": load(),
    }


def write(document: Document, path: Path) -> None:
    """The document as a JSON file that appears whole."""
    from ..io import output_paths

    with output_paths.atomic(path) as part:
        part.write_text(json.dumps(document, indent=1, default=_plain) + "\n")


def _plain(value: object) -> object:
    """NumPy numbers of a plan as plain numbers, lists or text."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value)


def slug(scene: str) -> str:
    """The name of a task as part of a file's name."""
    return scene.replace(" ", "-")
