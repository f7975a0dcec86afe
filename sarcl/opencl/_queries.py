"""Questions to a driver, each guarded: a driver that refuses one must not hide the other devices of the machine."""

from __future__ import annotations

import ctypes
import ctypes.util
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base import host_memory
from ..base.text import first_line

if TYPE_CHECKING:
    import pyopencl


PCI_BUS_INFO = 0x410F  # CL_DEVICE_PCI_BUS_INFO_KHR: domain, bus, device and function


def platforms() -> list[tuple[str, str, list[Any]]]:
    """Name, version and pyopencl's devices of every platform that lists any."""
    import pyopencl

    out = []
    try:
        listed = pyopencl.get_platforms()
    except pyopencl.Error:  # the loader finds no platform
        return []
    for platform in listed:
        try:
            handles = platform.get_devices()
        except pyopencl.Error:
            continue
        out.append((text_of(platform, "name"), text_of(platform, "version"), handles))
    return out


def asked(thing: object, question: str, otherwise: object = None) -> Any:
    """The answer to a question, an attribute of a device or platform; `otherwise` where the driver refuses it."""
    try:
        return getattr(thing, question)
    except Exception:  # pyopencl.Error, AttributeError of a question unknown here, or UnicodeDecodeError of a text
        return otherwise


def text_of(thing: object, question: str) -> str:
    """The answer to a question for a text; "unknown" where there is none."""
    return str(asked(thing, question, "")).replace("\0", "").strip() or "unknown"


def facts(handle: pyopencl.Device) -> dict[str, Any]:
    """What the driver says of a device, with the least that kernels may rely on where it refuses a question.

    Named as the fields of DeviceInfo; warp: 0 where the driver does not say it; why: a question that it must answer and
    refuses, else empty.
    """
    import pyopencl

    kinds = {pyopencl.device_type.GPU: "gpu", pyopencl.device_type.CPU: "cpu"}
    bits = asked(handle, "type", 0)
    kind = next((name for flag, name in kinds.items() if bits & flag), "accelerator")
    memory, max_alloc, why = 0, 0, ""
    try:
        memory, max_alloc = int(handle.global_mem_size), int(handle.max_mem_alloc_size)
    except Exception as exc:
        why = f"its driver does not say how much memory it has: {first_line(exc)}"
    if not why and min(memory, max_alloc) <= 0:
        why = f"its driver says that it has {memory} bytes of memory, and buffers of {max_alloc} bytes"
    if kind == "cpu":  # some drivers add the swap space
        memory = int(min(memory, host_memory.installed()))
    return dict(
        name=text_of(handle, "name"),
        kind=kind,
        vector_width=8 if kind == "cpu" else 1,
        memory=memory,
        max_alloc=min(max_alloc, memory),
        units=max(1, int(asked(handle, "max_compute_units", 1))),
        driver=text_of(handle, "driver_version"),
        local_memory=max(0, int(asked(handle, "local_mem_size", 0))),
        max_group=max(1, int(asked(handle, "max_work_group_size", 1))),
        warp=1 if kind == "cpu" else int(asked(handle, "warp_size_nv") or asked(handle, "wavefront_width_amd") or 0),
        pci=_pci(handle),
        why=why,
    )


def _pci(handle: pyopencl.Device) -> str:
    """Bus, device and function of a device on the PCI bus: "41:00.0"; empty where the driver does not tell them."""
    if "cl_khr_pci_bus_info" in str(asked(handle, "extensions", "")).split():
        address = raw_info(handle, PCI_BUS_INFO, 16)
        if address:
            _, bus, device, function = struct.unpack("4I", address)
            return f"{bus:02x}:{device:02x}.{function:x}"
    bus, slot = asked(handle, "pci_bus_id_nv"), asked(handle, "pci_slot_id_nv")
    if bus is not None and slot is not None:
        return f"{bus:02x}:{slot >> 3:02x}.{slot & 7:x}"
    place = asked(handle, "topology_amd")
    if place is not None:
        return f"{place.bus:02x}:{place.device:02x}.{place.function:x}"
    return ""


def _loader() -> str | None:
    """The library that finds OpenCL drivers: the system's, else that inside pyopencl's wheel."""
    import pyopencl

    inside = Path(pyopencl.__file__).parent.glob(".libs/libOpenCL*")
    return ctypes.util.find_library("OpenCL") or next(map(str, inside), None)


def raw_info(handle: pyopencl.Device, question: int, size: int) -> bytes:
    """Bytes that clGetDeviceInfo answers to a question that pyopencl does not know; none where it refuses."""
    loader = _loader()
    place = asked(handle, "int_ptr")
    if loader is None or place is None:
        return b""
    answer = ctypes.create_string_buffer(size)
    ask = ctypes.CDLL(loader).clGetDeviceInfo
    status = ask(ctypes.c_void_p(place), ctypes.c_uint(question), ctypes.c_size_t(size), answer, None)
    return b"" if status else answer.raw
