"""Choice of the device: by the device argument, by SARCL_DEVICE, or the best device that works."""

from __future__ import annotations

import numbers
import os
from typing import Any

from ..base.text import shown
from . import _cache_folder, _linker
from .device import Device, DeviceChoice, once
from .device_list import DeviceInfo, devices, distinct, listed, tried

REMEDY = "sarcl doctor says what is wrong and how to mend it"


class NoDeviceError(RuntimeError):
    """No OpenCL device fits: none works, or none matches what was asked for.

    >>> try:
    ...     sarcl.echo(scene, chirp, track, device="abacus")
    ... except sarcl.NoDeviceError as error:
    ...     print("abacus" in str(error))
    True
    """


def open_device(choice: DeviceChoice | None = None) -> Device:
    """The device to use: `choice`, else SARCL_DEVICE, else the GPU that is fastest in its trial, else a CPU.

    choice  a Device (returned as it is), an index, "cpu", "gpu", or any part of a platform's or device's name.
    SARCL_DEVICE may name several, for `backproject` ("all", or "0,1"): here the first of them that works.
    NoDeviceError lists what there is when nothing works or nothing matches. Never asks.
    """
    if isinstance(choice, Device):
        return choice
    if isinstance(choice, bool) or not isinstance(choice, (str, numbers.Integral, type(None))):
        raise TypeError(
            f"device is {shown(choice)}; give an index, 'cpu', 'gpu', a part of the name of one of "
            "sarcl.devices(), or None"
        )
    source = "device"
    if choice is None:
        choice, source = os.environ.get("SARCL_DEVICE") or None, "SARCL_DEVICE"
    names = [choice]
    if source == "SARCL_DEVICE":
        text = str(choice or "all").strip()
        names = [""] if text.lower() == "all" else [name for name in text.split(",") if name.strip()]
    for name in names:
        for kind in ("gpu", "accelerator", "cpu"):  # where a device of a kind works, those of the next are not tried
            matching = [tried(info.index) for info, _ in listed() if info.kind == kind and _matches(info, name)]
            working = [info for info in matching if info.works]
            if working:
                return open_listed(max(working, key=lambda i: (i.rate, -i.index)).index)
    if not any(info.works for info in devices()):
        raise NoDeviceError(
            f"no OpenCL device could build a kernel. Found: {_listing()}. {_cache_folder.prepare() or REMEDY}"
        )
    raise NoDeviceError(f"{source} {choice!r} matches no working OpenCL device. Found: {_listing()}")


def with_float64(device: Device) -> Device:
    """A device itself where it has float64, else another working one that has. NoDeviceError where there is none."""
    if device.info.fp64:
        return device
    able = [info for info in devices() if info.works and info.fp64]
    if not able:
        raise NoDeviceError(
            f"edges of shadows need float64, which {device.info.name!r} lacks, as every other OpenCL device here does; "
            f"pass shadows=False, or install a driver for the CPU beside it (docs/guide/install.md)"
        )
    return open_listed(max(able, key=lambda i: (i.rate, -i.index)).index)


def _matches(info: DeviceInfo, choice: object) -> bool:
    text = str(choice).strip().lower()
    if text.isdecimal() or not isinstance(choice, str):
        return info.index == int(text)
    short = "pocl" if info.platform == _linker.PLATFORM else ""  # its name is long
    return text == info.kind or text in f"{info.platform} {info.name} {short}".lower()


def _listing() -> str:
    infos = devices()
    if not infos:
        return "no OpenCL platform at all"
    return "; ".join(f"{i.index}: {i.name} ({i.platform}{'' if i.works else ': ' + i.why})" for i in infos)


def open_devices(choice: object) -> list[Device]:
    """Open devices for a choice: one as `open_device` takes it, a list of these, or "all" that work.

    "all" takes a device that several platforms list once, and the CPU once.

    The text "0,1" is a list too, as in SARCL_DEVICE. ValueError for a device named twice.
    """
    choices = split_choice(choice)
    if not choices:
        raise ValueError("device is an empty list; name at least one, or leave it out")
    opened = [open_device(c) for c in choices]
    for i, device in enumerate(opened):
        if device in opened[:i]:
            twice = choices[opened.index(device)]
            raise ValueError(f"device {choices[i]!r} and {twice!r} are both {device.info.name}; name it once")
    return opened


def split_choice(choice: object) -> list[Any]:
    """The single choices in `choice`, each as `open_device` takes it."""
    if choice is None:
        choice = os.environ.get("SARCL_DEVICE") or None
    if isinstance(choice, str) and choice.strip().lower() == "all":
        return [info.index for info in distinct(i for i in devices() if i.works)] or [None]
    if isinstance(choice, str) and "," in choice:
        return [name.strip() for name in choice.split(",") if name.strip()]
    return list(choice) if isinstance(choice, (list, tuple)) else [choice]


@once
def open_listed(index: int) -> Device:
    """The device of this index in the list, opened once."""
    return Device(tried(index), listed()[index][1])
