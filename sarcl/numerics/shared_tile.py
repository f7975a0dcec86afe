"""Tiles of a grid that a work-group sums in local memory (kernels/shared_tile.clh): where they are used, and how."""

from __future__ import annotations

from ..opencl.device import Device, Kernel
from ..opencl.group_sizes import first_allowed

ACROSS = 8  # work-items of a group along each axis, as in kernels/shared_tile.clh: no fewer than taps
CELLS = 32  # cells per side of the largest tile
LOCAL = 16 * 1024  # bytes of local memory of such a tile, with 8 taps


def used_by(device: Device) -> bool:
    """Whether a device sums tiles so; else each work-item sums a tile of its own."""
    return device.shares(LOCAL, ACROSS**2)


def spreading_kernel(device: Device, file: str, **macros: int) -> tuple[bool, Kernel]:
    """The kernel `spread` of a file, and whether work-groups sum tiles: not where its driver allows too few items."""
    sizes = (ACROSS**2, 1) if used_by(device) else (1,)
    items, (kernel,) = first_allowed(
        device, sizes, lambda items: (device.kernel(file, "spread", **macros, GROUPED=int(items > 1)),)
    )
    return items > 1, kernel


def launch(device: Device, tiles: tuple[int, int], grouped: bool) -> tuple[tuple[int, int], tuple[int, int] | None]:
    """Global and local size of a kernel over tiles along two axes; grouped: as `spreading_kernel` says."""
    if grouped:
        return (ACROSS * tiles[0], ACROSS * tiles[1]), (ACROSS, ACROSS)
    return tiles, (1, 1) if device.is_cpu else None
