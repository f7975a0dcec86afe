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

    request = json.loads(options)
    device = open_device(request["device"])
    if not request["fp64"]:
        device = device.without_fp64()
    raw, grid = _cases.load(Path(folder))
    backproject(raw, grid, tolerance=request["tolerance"], method=request["method"], device=device, check=False)


if __name__ == "__main__":
    main(*sys.argv[1:])
