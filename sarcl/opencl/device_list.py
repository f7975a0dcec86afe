"""OpenCL devices of this machine, tried with a small kernel before they are used: drivers list devices that fail."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from . import _after_fork, _cache_folder, _linker, _queries, _trial_record
from ._trial import Outcome, trial, version

if TYPE_CHECKING:
    import pyopencl


NOT_TRIED = "not tried"


@dataclass(frozen=True)
class DeviceInfo:
    """One OpenCL device.

    index, platform, name, kind   as the driver lists them; kind is "gpu", "cpu" or "accelerator"
    works                         the trial's kernels built and gave the right numbers
    why                           reason why it does not work, or why the float64 that it offers is not used
    fp64                          float64 kernels built and gave the right numbers
    vector_width                  lanes per work-item: 1 on GPUs, 8 on CPUs
    memory, max_alloc             bytes of the device and of its largest buffer
    units, driver                 compute units; driver version
    local_memory                  bytes of local memory per work-group, at most 64 KiB: as much as the trial used
    max_group                     most work-items of a work-group; a kernel may allow fewer (Device.max_group)
    warp                          work-items that run in step: a warp of NVIDIA, a wave of AMD; 1 on CPUs
    fast_fp64                     fp64, and a float64 operation takes at most 6 times as long as one in float32
    rate                          float32 multiplications with additions per second in the trial
    pci                           place on the PCI bus, where the driver tells it
    """

    index: int
    platform: str
    name: str
    kind: str
    works: bool
    why: str
    fp64: bool
    vector_width: int
    memory: int
    max_alloc: int
    units: int
    driver: str
    local_memory: int
    max_group: int
    warp: int
    fast_fp64: bool
    rate: float = field(compare=False)  # another in each trial
    pci: str


def devices() -> tuple[DeviceInfo, ...]:
    """Every OpenCL device of this machine with the result of its trial; empty where there is no OpenCL platform.

    The result of a trial is recorded in the user's cache folder (sarcl/devices.json) with the versions of driver,
    platform and trial; later processes do not repeat it. A trial that ended in an error, which may have been by chance,
    is repeated in each process, and `sarcl devices` tries every device again.

    >>> names = [device.name for device in sarcl.devices()]
    """
    return tuple(tried(info.index) for info, _ in listed())


def tried_again() -> tuple[DeviceInfo, ...]:
    """`devices()` after a new trial of every device, whatever is recorded."""
    _trial_record.clear()
    tried.cache_clear()
    return devices()


def listed() -> tuple[tuple[DeviceInfo, Any], ...]:
    """Every device of every platform before its trial (works is False), with pyopencl's handle."""
    _after_fork.check()
    _cache_folder.prepare()
    return _listed()


@functools.cache
def _listed() -> tuple[tuple[DeviceInfo, Any], ...]:
    devices: list[tuple[DeviceInfo, Any]] = []
    for platform, _, handles in _queries.platforms():
        for handle in handles:
            facts = _queries.facts(handle)
            facts["why"] = facts["why"] or NOT_TRIED
            info = DeviceInfo(
                index=len(devices), platform=platform, works=False, fp64=False, fast_fp64=False, rate=0, **facts
            )
            devices.append((info, handle))
    return tuple(devices)


@functools.cache
def tried(index: int) -> DeviceInfo:
    """Device `index` with the result of its trial: the recorded one, or that of a trial now."""
    info, handle = listed()[index]
    if info.why != NOT_TRIED:
        return info
    outcome = _trial_record.find(key := _key(info, handle))
    if outcome is None:
        if _linker.is_missing(info.platform) and (why := _linker.trouble(index)):
            return replace(info, why=why)
        outcome = trial_of(index)
        if outcome.settled:
            _trial_record.keep(key, outcome)
    if outcome.why:
        return replace(info, why=outcome.why)
    return replace(
        info, works=True, why=outcome.why64, fp64=outcome.fp64, fast_fp64=outcome.fp64 and outcome.fast_fp64,
        rate=outcome.rate, local_memory=outcome.local_memory, warp=info.warp or outcome.warp,
    )  # fmt: skip


def trial_of(index: int) -> Outcome:
    """The result of a trial of device `index` now."""
    info, handle = listed()[index]
    offered = bool(_queries.asked(handle, "double_fp_config"))
    return trial(handle, info.vector_width, offered, info.local_memory, info.max_group)


def distinct(infos: Iterable[DeviceInfo]) -> list[DeviceInfo]:
    """These devices, of each that several platforms list only that of the highest rate."""
    infos = list(infos)
    out: list[DeviceInfo] = []
    for info in sorted(infos, key=lambda i: (-i.rate, i.index)):
        if not any(_same(info, other, infos) for other in out):
            out.append(info)
    return sorted(out, key=lambda i: i.index)


def _same(a: DeviceInfo, b: DeviceInfo, infos: list[DeviceInfo]) -> bool:
    """Whether two platforms list one device: by its place on the PCI bus, or where one does not tell it, by its
    name, kind and memory, and its number among those alike on its platform. All CPU devices are the machine's CPU."""
    if a.platform == b.platform or a.kind != b.kind:
        return False
    if a.kind == "cpu":
        return True
    if a.pci and b.pci:
        return a.pci == b.pci
    return _alike(a, infos) == _alike(b, infos)


def _alike(info: DeviceInfo, infos: list[DeviceInfo]) -> tuple[str, int, int]:
    """Name and memory of a device, and its number among those of its platform that have the same."""
    before = [i for i in infos if i.platform == info.platform and i.index < info.index]
    return info.name, info.memory, sum((i.name, i.memory) == (info.name, info.memory) for i in before)


def _key(info: DeviceInfo, handle: pyopencl.Device) -> str:
    """What the result of a trial depends on: the device, the versions of driver and platform, the trial itself, and
    whether PoCL finds a linker."""
    platform = _queries.text_of(_queries.asked(handle, "platform"), "version")
    linker = ", no ld" if _linker.is_missing(info.platform) else ""
    return f"{info.index} {info.name}, driver {info.driver}, {info.platform} {platform}, trial {version()}{linker}"
