"""One image in a process of its own: python -m sarcl.bench.one_shot FOLDER OPTIONS, options as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path


def main(folder: str, options: str) -> None:
    """Read the case in `folder`, open the device, make the image."""
    from ..imaging.backproject import backproject
    from ..opencl.choose_device import open_device
    from . import _cases

    given = json.loads(options)
    device = open_device(given["device"])
    if not given["fp64"]:
        device = device.without_fp64()
    raw, grid = _cases.load(Path(folder))
    backproject(
        raw, grid, tolerance=given["tolerance"], method=given["method"], device=device, check=False
    )  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
