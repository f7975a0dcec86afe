"""Bytes that a computation may take on a device."""

from __future__ import annotations

from ..base.validation import number
from .device import Device

CPU_BYTES = 2**30  # bytes, default memory for blocks on a CPU device: other programs share that memory


def budget(device: Device, max_bytes: float | None) -> float:
    """Bytes for blocks on the device: max_bytes, or the default. ValueError below 1 MB."""
    if max_bytes is None:
        return min(CPU_BYTES, device.info.memory / 2) if device.is_cpu else device.info.memory / 2
    return number("max_bytes", max_bytes, least=1e6)
