"""Work-items of a kernel's groups, where the driver may allow fewer for this kernel than for others of the device."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from .device import Device, Kernel


def first_allowed(
    device: Device, sizes: Iterable[int], build: Callable[[int], tuple[Kernel, ...]]
) -> tuple[int, tuple[Kernel, ...]]:
    """The first size of a group that the driver allows for all kernels built for it, and these kernels.

    sizes  largest first. The last one is taken without a question: mostly that of kernels whose items share nothing
    """
    *larger, least = sizes
    for size in larger:
        kernels = build(size)
        if all(size <= device.max_group(kernel) for kernel in kernels):
            return size, kernels
    return least, build(least)
