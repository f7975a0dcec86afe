"""Questions to a driver, each guarded: a driver that refuses one must not hide the other devices of the machine."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..base.text import first_line

GPU_WARP = 32  # work-items, of a GPU that does not tell its own number


class Facts(NamedTuple):
    """What a driver says of a device; `why` names a question that it must answer and refuses, else it is empty."""

    name: str
    kind: str
    vector_width: int
    memory: int
    max_alloc: int
    units: int
    driver: str
    local_memory: int
    max_group: int
    warp: int
    why: str


def platforms() -> list[tuple[str, str, list[Any]]]:
    """Name, version and pyopencl's devices of every platform that lists any."""
    import pyopencl

    found = []
    try:
        listed = pyopencl.get_platforms()
    except pyopencl.Error:  # the loader finds no platform
        return []
    for platform in listed:
        try:
            handles = platform.get_devices()
        except pyopencl.Error:
            continue
        found.append((text_of(platform, "name"), text_of(platform, "version"), handles))
    return found


def asked(thing: Any, question: str, otherwise: Any = None) -> Any:
    """The answer to a question, an attribute of a device or platform; `otherwise` where the driver refuses it."""
    try:
        return getattr(thing, question)
    except Exception:  # pyopencl.Error, AttributeError of a question unknown here, or UnicodeDecodeError of a text
        return otherwise


def text_of(thing: Any, question: str) -> str:
    """The answer to a question for a text; "unknown" where there is none."""
    return str(asked(thing, question, "")).replace("\0", "").strip() or "unknown"


def facts(handle: Any) -> Facts:
    """What the driver says of a device, with the least that kernels may rely on where it refuses a question."""
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
    return Facts(
        name=text_of(handle, "name"),
        kind=kind,
        vector_width=8 if kind == "cpu" else 1,
        memory=memory,
        max_alloc=min(max_alloc, memory),
        units=max(1, int(asked(handle, "max_compute_units", 1))),
        driver=text_of(handle, "driver_version"),
        local_memory=max(0, int(asked(handle, "local_mem_size", 0))),
        max_group=max(1, int(asked(handle, "max_work_group_size", 1))),
        warp=1 if kind == "cpu" else int(_warp(handle)),
        why=why,
    )


def _warp(handle: Any) -> int:
    """Work-items that a GPU runs in step."""
    return asked(handle, "warp_size_nv") or asked(handle, "wavefront_width_amd") or GPU_WARP
