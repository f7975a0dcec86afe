"""The table that `sarcl devices` prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

HEAD = ("", "", "device", "platform", "kind", "works", "fp64", "vector", "memory", "largest buffer")


def device_table(devices: Sequence[Any], picked: Sequence[int]) -> str:
    """`sarcl.devices()` as a table, a star at the indices `picked`, the reason under what does not work."""
    from .cl import size_text

    rows = [HEAD]
    for d in devices:
        mark = "*" if d.index in picked else ""
        yes = ["yes" if v else "no" for v in (d.works, d.fp64)]
        rows.append((mark, str(d.index), d.name, d.platform, d.kind, *yes, str(d.vector_width),
                     size_text(d.memory), size_text(d.max_alloc)))  # fmt: skip
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    for n, d in reversed(list(enumerate(devices, 1))):
        if not d.works:
            lines.insert(n + 1, f"{'':{widths[0] + widths[1] + 4}}does not work: {d.why}")
    if picked:
        lines += ["", "* is used unless --device or SARCL_DEVICE names another"]
    return "\n".join(lines) if devices else "no OpenCL device"
