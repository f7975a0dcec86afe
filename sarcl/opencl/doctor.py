"""What keeps OpenCL, or a part of it, from working on this machine, and the remedy of each fault."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from typing import TYPE_CHECKING, NamedTuple

from ..base.text import size_text
from . import _cache_folder, _child, _drivers, _linker
from ._probe import LOAD, View, view

if TYPE_CHECKING:
    from .device_list import DeviceInfo

HIDING = """OCL_ICD_VENDORS OPENCL_VENDOR_PATH OCL_ICD_FILENAMES POCL_DEVICES CUDA_VISIBLE_DEVICES ROCR_VISIBLE_DEVICES
    HIP_VISIBLE_DEVICES GPU_DEVICE_ORDINAL ZE_AFFINITY_MASK CL_CONFIG_DEVICES""".split()  # variables that hide devices
DRIVER = "sudo apt-get install -y pocl-opencl-icd (Debian, Ubuntu; others: docs/guide/install.md)"
LEAST_MEMORY = 1e9  # bytes of a device or host: `sarcl demo --quick` takes 0.7 GB
NO_FLOAT64 = (
    "all works, in pairs of float32, except edges of shadows (pass shadows=False), exact=True of linear.Echoes, and "
    "tolerances near 1e-6 and below"
)
Look = Callable[..., View]  # what a child sees, as _probe.view


class Finding(NamedTuple):
    """What is wrong and its remedy; is_fault: it keeps a device, a driver or sarcl itself from working."""

    what: str
    remedy: str
    is_fault: bool = True


@dataclass
class Examination:
    """What was found of OpenCL.

    loader    path of the library that loads drivers, "" where it is not known
    drivers   .icd file and library of each driver that the loader is told of
    devices   with the results of new trials
    picked    numbers of the devices that sarcl uses by default or by SARCL_DEVICE; none: it cannot work
    """

    loader: str
    drivers: list[tuple[str, str]]
    devices: list[DeviceInfo]
    picked: list[int]
    findings: list[Finding]


def examine(look: Look = view) -> Examination:
    """Examine OpenCL in child processes, through `look`."""
    crashes: dict[int, str] = {}
    while (seen := look(*crashes)).step.isdecimal():
        crashes[int(seen.step)] = seen.end  # the other devices are tried by another child
        _cache_folder.drop_empty_programs()
    drivers = _drivers.drivers()
    findings = [*_of_packages(seen), *_of_variables(seen, look), *_of_drivers(seen, drivers, look)]
    if not (seen.devices or drivers or _faults(findings)):
        first = "unset OCL_ICD_VENDORS, and " if os.environ.get("OCL_ICD_VENDORS") else ""
        findings.append(Finding("there is no OpenCL driver", first + DRIVER))
    for device in seen.devices.values():
        findings += _of_device(device, crashes.get(device.index, ""), seen, look)
    findings += _of_choice(seen)
    if not seen.picked and not _faults(findings):  # drivers that do not stand one another
        remedy = "set OCL_ICD_VENDORS to the .icd file of one driver"
        findings.append(Finding(f"OpenCL ends every program that uses it: {seen.end}", remedy))
    return Examination(
        loader=next((path for path in seen.libraries if "libOpenCL" in path), ""),
        drivers=[(str(driver.icd), driver.library) for driver in drivers],
        devices=list(seen.devices.values()),
        picked=seen.picked,
        findings=findings,
    )


def _faults(findings: list[Finding]) -> list[Finding]:
    return [finding for finding in findings if finding.is_fault]


def _of_packages(seen: View) -> Iterator[Finding]:
    """Packages that cannot be imported, and a cache folder that cannot be written."""
    if "libOpenCL" in seen.broken:
        remedy = "sudo apt-get install -y ocl-icd-libopencl1, or pip install --only-binary :all: pyopencl"
        yield Finding(f"pyopencl finds no loader of OpenCL drivers: {seen.broken}", remedy)
    elif seen.broken:
        yield Finding(f"numpy, scipy or pyopencl cannot be imported: {seen.broken}", "install that package again")
    folder, why = seen.cache
    if why:
        remedy = "set XDG_CACHE_HOME to a folder that you may write to, with free space, and unset POCL_CACHE_DIR"
        yield Finding(f"the cache folder {folder!r} of kernels cannot be written: {why}", remedy, False)


def _of_variables(seen: View, look: Look) -> Iterator[Finding]:
    """Devices that are listed where the variables that hide devices are unset, and only there."""
    names = [name for name in HIDING if name in os.environ]
    if not names:
        return
    others = look(until=LOAD, environment=dict.fromkeys(names))
    hidden = Counter(d.name for d in others.devices.values()) - Counter(d.name for d in seen.devices.values())
    if hidden:
        what = f"{', '.join(f'{name}={os.environ[name]!r}' for name in names)} hides {', '.join(hidden)}"
        yield Finding(what, f"unset {' '.join(names)}, unless you mean it", not seen.devices)
    if os.environ.get("OCL_ICD_FILENAMES") and _drivers.wheel():
        what = "the loader in pyopencl's wheel does not read OCL_ICD_FILENAMES"
        yield Finding(what, "set OCL_ICD_VENDORS to a folder with .icd files", False)


def _of_drivers(seen: View, drivers: list[_drivers.Driver], look: Look) -> Iterator[Finding]:
    """Drivers that cannot be loaded, that crash, or list no device; two versions of one driver."""
    sound = []
    for driver in drivers:
        what, remedy = ("", "") if driver.is_among(seen.libraries) else driver.trouble()
        if what:
            yield Finding(what, remedy)
        else:
            sound.append(driver)
    if len(sound) > sum(count > 0 for _, count in seen.platforms) and not seen.broken:
        for driver in sound:
            yield from _of_listing(driver, look)
    for platform, count in Counter(name for name, _ in seen.platforms).items():
        if count > 1:
            versions = " and ".join(sorted({d.driver for d in seen.devices.values() if d.platform == platform}))
            remedy = "remove the .icd file of one, or set OCL_ICD_VENDORS to that of the other"
            yield Finding(f"{count} drivers of {platform} are loaded together: {versions}", remedy, False)


def _of_listing(driver: _drivers.Driver, look: Look) -> Iterator[Finding]:
    """Why a driver that can be loaded lists no device."""
    with driver.alone() as environment:
        seen = look(until=LOAD, environment=dict.fromkeys(HIDING) | environment)
    if seen.end:
        remedy = f"remove {driver.icd}, or set OCL_ICD_VENDORS to a folder with the others; PoCL needs /sys and /proc"
        yield Finding(f"the driver of {driver.icd} ends every program that loads it: {seen.end}", remedy)
    elif not seen.devices:
        remedy = "has the machine its card, and its kernel module? are you in the groups video and render?"
        yield Finding(f"the driver of {driver.icd} lists no device", remedy, False)


def _of_device(device: DeviceInfo, crash: str, seen: View, look: Look) -> Iterator[Finding]:
    name = f"device {device.index}, {device.name} ({device.platform}, driver {device.driver}),"
    why = f"its trial ends the process: {crash}" if crash else device.why
    if why:
        part = "has float64 that does not work" if device.works else "does not work"
        if why.endswith(_linker.REMEDY):
            why, remedy = why.removesuffix(f": {_linker.REMEDY}"), _linker.REMEDY
        else:
            remedy = _remedy(device, seen, look)
        yield Finding(f"{name} {part}: {why}", remedy)
    elif not device.fp64:
        yield Finding(f"{name} has no float64", NO_FLOAT64, False)
    if device.memory < LEAST_MEMORY:
        remedy = "larger tasks are refused: compute smaller images, or use another device"
        yield Finding(f"{name} has {size_text(device.memory)} of memory", remedy, False)


def _remedy(device: DeviceInfo, seen: View, look: Look) -> str:
    """What to do about a device that does not pass its trial; it is tried again with empty caches of kernels."""
    with _child.empty_caches() as caches:
        others = seen.devices.keys() - {device.index}
        fresh = look(*others, environment=caches).devices.get(device.index)
    if fresh and fresh.works and not fresh.why:
        return "delete the caches of kernels, which are damaged: ~/.cache/pocl or POCL_CACHE_DIR, and ~/.cache/pyopencl"
    try:
        of_wheel = device.driver.startswith(metadata.version("pocl-binary-distribution"))
    except metadata.PackageNotFoundError:
        of_wheel = False
    if of_wheel and device.platform == _linker.PLATFORM:
        return "pip uninstall pocl-binary-distribution, too old for this processor; others: docs/guide/install.md"
    return "update its driver or install another (docs/guide/install.md), or name another device in SARCL_DEVICE"


def _of_choice(seen: View) -> Iterator[Finding]:
    """Why sarcl opens no device, although one works."""
    working, choice = [d.index for d in seen.devices.values() if d.works], os.environ.get("SARCL_DEVICE")
    if seen.picked or not working:
        return
    if choice and "matches no working" in seen.refused:
        remedy = "unset it, or give cpu, gpu, a number of the list above or a part of a name in it"
        yield Finding(f"SARCL_DEVICE={choice!r} names no device that works", remedy)
    elif seen.refused:
        what, _, remedy = seen.refused.partition("; ")
        yield Finding(f"no device can be opened: {what}", remedy or "see the other faults")
    else:
        remedy = f"set SARCL_DEVICE={working[0]} until the fault above is mended"
        yield Finding(f"the choice of a device ends every program that uses sarcl: {seen.end}", remedy)
